"""The page: tables, figures and pictures in one file."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from experiments import evidence, lost, moved, repetition
from monodyn.reproduce.cases import Case
from monodyn.reproduce.claims import claims
from monodyn.reproduce.experiment import figures
from monodyn.reproduce.page import PageContent, page_text, picture_rows
from monodyn.reproduce.plans import FitPlan
from monodyn.types import Frame


def test_the_page_shows_tables_figures_and_pictures_without_a_network() -> None:
    failed = Case(FitPlan("fast", "II", 40, series="with-friction"), "failed: no <period>")
    cases = [moved("I", 1e-3), failed, moved("III", 0.0), *(moved("I", 1e-3, frames=n) for n in (20, 30))]
    found = [repetition(*cases), repetition(*cases)]
    shown = figures(found)
    frame = Frame(0, 0.0, np.full((480, 720), 90, np.uint8))
    seen = {method: found[0].evidence[method].seen for method in ("paper", "fast")}
    pictures = picture_rows([frame], seen)
    judged = claims([each.evidence for each in found])
    text = page_text(PageContent("About.", found, judged, shown, pictures))
    own = re.sub(r"<script>.*?</script>", "", text, flags=re.S)
    assert not re.search(r"(src|href)=.?(http|//)", own)
    assert "failed: no &lt;period&gt;" in own
    assert re.findall(r"<h2>Figure (\d):", own) == ["3", "5", "6", "7", "8", "9"]
    assert own.count("data:image/jpeg;base64,") == 2
    assert own.count("held in 2 of 2") >= 1
    assert "rests on 2 pendulums, 180 frames" in own
    data = json.loads(re.search(r"const FIGURES = (.*?);\n", text)[1])  # type: ignore[index]
    assert [len(figure["panels"]) for figure in data] == [4, 0, 3, 0, 3, 2, 0, 1]
    simulated = data[2]["panels"][0]["series"][-1]
    assert simulated["y"][0] == pytest.approx(np.degrees(-0.3 + 1e-3), abs=1e-3)
    # every figure that has panels has a place, and no other
    places = {int(number) for number in re.findall(r'id="plot(\d+)"', own)}
    assert places == {i for i, figure in enumerate(data) if figure["panels"]}


def test_words_that_all_pendulums_share_stand_once() -> None:
    found = [repetition(moved("I", 1e-3)) for _ in range(3)]
    judged = claims([each.evidence for each in found])
    text = page_text(PageContent("About.", found, judged, [], []))
    own = re.sub(r"<script>.*?</script>", "", text, flags=re.S)
    assert own.count("it does not filter: every pose is weighted with its covariance") == 1


def test_a_clip_without_any_poses_has_a_page() -> None:
    nothing = repetition(published=lost())
    nothing = type(nothing)("clip.mp4", nothing.clip, None, None, {"paper": lost(), "fast": lost("fast")})
    judged = claims([nothing.evidence])
    text = page_text(PageContent("About.", [nothing], judged, figures([nothing]), []))
    assert "There are no poses: failed: x" in text
    assert "There is no fit to show." in text
    assert evidence().seen.status == "done"
