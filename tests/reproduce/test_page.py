"""The page: tables, figures and pictures in one file."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from experiments import DESIGN, FAILED, JOINTS, moved, seen
from monodyn.reproduce.cases import Case, FitPlan, run_case
from monodyn.reproduce.claims import Evidence, claims, fourier_deviates
from monodyn.reproduce.clip import ClipSettings, simulated
from monodyn.reproduce.experiment import figures
from monodyn.reproduce.page import PageContent, PageTable, page_text, picture_rows
from monodyn.reproduce.tables import case_row, document, gain_row, plain_rows
from monodyn.reproduce.vision import Seen
from monodyn.types import Frame


def test_a_period_of_the_whole_clip_is_marked_wherever_the_case_stands() -> None:
    found = seen()
    # 20 frames are not much more than half a period of this motion
    case = run_case(FitPlan("fast", "II", "measured", 20), found, None, DESIGN)
    assert case.fit is not None
    assert case.clip_period
    assert case_row(case, JOINTS)["period_from"] == "whole clip"
    marked = replace(moved("II", 5e-3), clip_period=True)
    plain = fourier_deviates(Evidence(found, [moved("I", 1e-3), moved("II", 5e-3)], DESIGN)).numbers
    told = fourier_deviates(Evidence(found, [moved("I", 1e-3), marked], DESIGN)).numbers
    assert told == f"{plain}; the period is from the whole clip, predicted frames included"
    assert plain_rows([marked], JOINTS)[1][0][0] == "II*"
    both = {"fast": found, "paper": FAILED}
    text = page_text(PageContent("", both, [marked], [], [], [], JOINTS))
    assert "period from<br>the whole clip" in text
    assert (
        "In Case II the fitted frames do not determine the period: it is taken from the whole clip, "
        "predicted frames included."
    ) in text


def test_a_larger_residual_of_the_default_method_in_case_three_is_explained() -> None:
    remark = (
        "In Case III the default method has the larger residual where it does not follow the noise of the "
        "poses from frame to frame. The errors against the truth and of the prediction are the ones to "
        "compare."
    )
    default, second = moved("III", 5e-3), moved("II", 0.0)
    published = moved("III", 0.0, noise=1.0)
    published = replace(published, plan=replace(published.plan, method="paper"))
    both = {"fast": seen(), "paper": replace(seen(), method="paper")}
    assert remark in page_text(PageContent("", both, [default, published, second], [], [], [], JOINTS))
    assert remark not in page_text(PageContent("", both, [default, second], [], [], [], JOINTS))


def test_the_page_shows_tables_figures_and_pictures_without_a_network() -> None:
    truth = simulated(ClipSettings(frames=90))
    both = {"fast": seen(), "paper": Seen("paper", "failed: <lost>")}
    failed = Case(FitPlan("paper", "II", "measured", 40), "failed: no period")
    cases = [moved("I", 1e-3), moved("I", 2e-3, "filtered"), moved("II", 5e-3), failed, moved("III", 0.0)]
    cases += [moved("I", 1e-3, frames=n) for n in (20, 30)]
    shown = figures(both, cases, truth, DESIGN)
    frame = Frame(0, 0.0, np.full((480, 720), 90, np.uint8))
    content = PageContent(
        "About.", both, cases, claims(both, cases, DESIGN), shown, picture_rows([frame], both), JOINTS
    )
    text = page_text(content)
    own = re.sub(r"<script>.*?</script>", "", text, flags=re.S)
    assert not re.search(r"(src|href)=.?(http|//)", own)
    assert "failed: &lt;lost&gt;" in own
    assert "failed: no period" in own
    assert re.findall(r"<h2>Figure (\d):", own) == ["3", "5", "6", "7", "8", "9"]
    alone = next(figure for figure in shown if figure.title.startswith("Figure 6"))
    assert "simulated, published method" not in [text for _, _, text in alone.legend]
    assert ("box", "fitted", "fitted frames") in alone.legend
    assert own.count("data:image/jpeg;base64,") == 2
    data = json.loads(re.search(r"const FIGURES = (.*?);\n", text)[1])
    assert [len(figure["panels"]) for figure in data] == [4, 3, 3, 3, 3, 2, 1]
    simulated_ = data[2]["panels"][0]["series"][-1]
    assert simulated_["y"][0] == pytest.approx(np.degrees(-0.3 + 1e-3), abs=1e-3)


def test_the_table_says_by_how_much_the_default_method_is_better() -> None:
    default = replace(moved("I", 1e-3), seconds=0.5)
    published = replace(moved("I", 4e-3), plan=replace(default.plan, method="paper"), seconds=0.25)
    cases = [default, published, moved("II", 0.0)]
    gain = gain_row(case_row(published, JOINTS), case_row(default, JOINTS))
    assert gain["error_joint1_deg"] == pytest.approx(4.0, rel=1e-5)
    assert gain["ahead_joint2_deg"] == pytest.approx(4.0, rel=1e-5)
    assert gain["seconds"] == pytest.approx(0.5)
    assert plain_rows(cases, JOINTS)[1][2][2:6] == ["published / default", "–", "1", "0.5"]
    both = {"fast": seen(), "paper": replace(seen(), method="paper", seconds_locate=3.0)}
    text = page_text(PageContent("", both, cases, [], [], [], JOINTS))
    row = re.search(r"<td class=\"text\">ratio</td>(.*?)</tr>", text, flags=re.S)[1]
    assert re.findall(r"[\d.]+×", row)[:2] == ["1×", "0.5×"]
    assert row.count("<td>4× · 4×</td>") == 2
    assert text.count('<td class="text">ratio</td>') == 2
    assert ">3×<" in text
    assert "not counted" in text
    made = document(both, cases, [], JOINTS)["published_over_default"]
    assert made["poses"]["seconds_locate"] == 3.0
    assert [row["case"] for row in made["fits"]] == ["I"]


def test_columns_without_a_number_are_left_out() -> None:
    table = PageTable.of(["method", "truth", "l1"], [("", ["a", "–", "1"]), ("last", ["b", "–", "–"])])
    assert table.head == ["method", "l1"]
    assert table.rows == [("", ["a", "1"]), ("last", ["b", "–"])]
    untold = {"fast": replace(seen(), errors=None), "paper": FAILED}
    cases = [replace(moved(name, 1e-3), error=None) for name in ("I", "II")]
    text = page_text(PageContent("", untold, cases, [], [], [], JOINTS))
    assert "truth [°]" not in text
    assert "l1 [%]" not in text
    columns, rows = plain_rows(cases, JOINTS)
    assert "against truth [deg]" not in columns
    assert len(rows[0]) == len(columns)
