"""The report page: what it says first, that it needs no network, and that foreign text stays text."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest

from fits import made_fit, noisy_film, record
from monodyn.estimation.fit import Doubt
from monodyn.estimation.parts import Premise
from monodyn.mechanism import load
from monodyn.results import page
from monodyn.results.findings import Findings
from monodyn.results.page import flat, page_text, plotting_script
from monodyn.results.predict import predict
from monodyn.results.trace import trace_of


def test_page_says_status_and_advice_first_and_escapes() -> None:
    fit = made_fit()
    trace = trace_of(fit, record(fit), predict(fit, until=1.2), name="<i>clip</i>")
    text = page_text(Findings(fit, [trace], "<script>alert(1)</script>", notes=("A & B",)))
    found = "One link, 20.00 ± 0.20 cm; damping over inertia 0.1235 ± 0.0025 at joint1 (95 %)."
    found = found.replace(" ± ", "\u00a0±\u00a0")
    order = ["<strong>Trusted. Identified from 20 frames.", found, "<h2>Motion</h2>", "What is known"]
    assert sorted(order, key=text.index) == order
    assert "Measure &lt;b&gt;one&lt;/b&gt; mass &amp; be done." in text
    assert "<script>alert(1)" not in text
    assert "A &amp; B" in text
    assert '<code>joint1.damping / link1.J</code></td><td data-title="value">0.1235</td>' in text


def test_errors_have_two_digits_and_three_from_ten_on() -> None:
    cart = load("cartpole")
    slide, hinge = (joint.name for joint in cart.joints)
    assert page._errors(cart.joints, {slide: 0.00123456, hinge: np.radians(12.345)}) == "1.2 mm · 12.3°"
    assert page._errors(cart.joints, {slide: 0.14632, hinge: None}) == "146 mm · –"


def test_the_page_begins_with_its_film_and_is_no_larger_than_a_mailbox_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long the film is: what does not fit in is left out, and that is said."""
    fit = made_fit()
    findings = Findings(fit, [trace_of(fit, record(fit))], "x")
    alone, film = len(page_text(findings)), noisy_film(tmp_path / "overlay.mp4")
    for room, said in ((film.stat().st_size * 2, False), (film.stat().st_size // 2, True)):
        monkeypatch.setattr(page, "LARGEST", alone + room)
        text = page_text(findings, (film, b"a still"))
        assert len(text.encode()) <= alone + room
        assert text.index("<video") < text.index("<strong>Trusted.") < text.index("<h2>Motion</h2>")
        cut = re.search(r"Here the first [12] s; <code>overlay.mp4</code> has all of it\.", text)
        assert bool(cut) is said
        data = re.search('src="data:video/mp4;base64,([^"]*)"', text)
        assert data
        with av.open(io.BytesIO(base64.b64decode(data[1]))) as shown:
            assert len(list(shown.decode(video=0))) >= 20
    monkeypatch.setattr(page, "LARGEST", alone)
    text = page_text(findings, (film, b"a still"))
    assert "<video" not in text
    assert '<img src="data:image/jpeg;base64,YSBzdGlsbA=="' in text


def test_premises_stand_once_and_last() -> None:
    said = Premise("Lengths follow from gravity.")
    text = page_text(Findings(made_fit(advice=(said, "Measure it.")), [], "x"))
    assert text.count(said) == 1
    assert said in section(text, "What all this rests on")
    assert "Measure it." in section(text, "What is not known")


def test_friction_stands_among_what_is_known_as_it_is_known() -> None:
    known = section(page_text(Findings(made_fit(), [], "x")), "What is known, and how well")
    assert '<code>joint1.damping / link1.J</code></td><td data-title="value">0.1235</td>' in known
    assert "damping over inertia, at joint1" in known


def section(text: str, title: str) -> str:
    """Return what stands under a heading of a page."""
    return text.partition(f"<h2>{title}</h2>")[2].partition("</section>")[0]


def test_what_is_not_determined_is_not_among_what_is_known() -> None:
    for combinations, said in ((made_fit().combinations, "factor of all masses"), ((), "not determined by")):
        text = page_text(Findings(made_fit(combinations=combinations), [], "x"))
        known, unknown = section(text, "What is known, and how well"), section(text, "What is not known")
        assert '<code>link1.length</code></td><td data-title="value">0.2' in known
        assert "<code>joint1.damping</code>" not in known
        assert '<code>joint1.damping</code></td><td data-title="taken as">0.001</td>' in unknown
        assert said in unknown
    held = replace(made_fit().parameters[1], free=False, name="link1.width", unit="m", value=0.03)
    torques = load("single").with_torque("free", knots=np.array([0.0, 1.0]))
    text = page_text(Findings(made_fit(parameters=(held,), torque="free", mechanism=torques), [], "x"))
    assert "held: torques would make up" in section(text, "What is not known")
    # what is not known of a doubtful fit stands with its status; the table is there all the same
    doubted = page_text(Findings(made_fit().doubted([Doubt("approximate", "Rough.")]), [], "x"))
    assert "joint1.damping" in section(doubted, "What is not known")
    assert "Measure" not in section(doubted, "What is not known")


def test_page_needs_no_network() -> None:
    fit = made_fit()
    text = page_text(Findings(fit, [trace_of(fit, record(fit))], "x"))
    assert not re.search(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=[\"']?(?:https?:)?//", text)
    assert text.count("<script>") == text.count("</script>") == 2
    assert text.count("Licensed under the MIT license") == 1


def test_the_plotting_script_has_its_licence_beside_it() -> None:
    folder = Path(page.__file__).parent / "plotly-basic"
    assert "Permission is hereby granted" in (folder / "LICENSE").read_text(encoding="utf-8")
    assert plotting_script().startswith("/**\n* plotly.js (basic - minified) v")
    assert "</script" not in plotting_script()


def test_page_of_a_fit_that_failed() -> None:
    fit = made_fit(starts=()).doubted([Doubt("refused", "Too few frames.")])
    text = page_text(Findings(fit, [], "x"))
    assert 'class="status refused"' in text
    assert "<strong>Refused. Too few frames." in text
    assert "Plotly" not in text


def test_settings_are_listed_with_dotted_names() -> None:
    settings = {"seed": 0, "fix": {}, "track": {"reach": 4.0, "method": None}}
    assert flat(settings) == {"seed": "0", "fix": "–", "track.reach": "4.0", "track.method": "–"}


def test_every_page_links_the_files_of_its_folder() -> None:
    """That of a refused fit, too, where one looks what was seen."""
    refused = made_fit(starts=()).doubted([Doubt("refused", "Too few frames.")])
    for fit in (made_fit(), refused):
        text = page_text(Findings(fit, [], "x"), files=["fit.json", "diagnosis.png"])
        assert (
            'Files in this folder: <a href="fit.json"><code>fit.json</code></a>, '
            '<a href="diagnosis.png"><code>diagnosis.png</code></a>.' in section(text, "All files")
        )
        assert "<dt>" in section(text, "What to do next")
    assert "Files in this folder" not in page_text(Findings(refused, [], "x"))


def test_a_refused_fit_is_not_called_known_and_fills_nothing() -> None:
    """Its motion before the fitted frames may be anything, and would stretch the axes."""
    fit = made_fit()
    poses = record(fit)
    first = replace(poses, seen=np.arange(len(poses)) >= 5)
    for one, known in ((fit, True), (fit.doubted([Doubt("refused", "It is another mechanism.")]), False)):
        text = page_text(Findings(one, [trace_of(one, first)], "x"))
        assert ("What is known, and how well" in text) is known
        assert ("These combinations" in text or "What is not known" in text) <= known
        assert ("neither values nor intervals are to be relied on" in text) is not known
        assert ('"filled": null' in text or '"filled":null' in text) is not known
