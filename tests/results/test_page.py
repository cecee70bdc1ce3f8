"""The report page: what it says first, that it needs no network, and that foreign text stays text."""

from __future__ import annotations

import re

from fits import made_fit, record
from monodyn.estimation.fit import Doubt
from monodyn.results.findings import Findings
from monodyn.results.page import flat, page_text
from monodyn.results.predict import predict
from monodyn.results.trace import trace_of


def test_page_says_status_and_advice_first_and_escapes() -> None:
    fit = made_fit()
    trace = trace_of(fit, record(fit), predict(fit, until=1.2), name="<i>clip</i>")
    text = page_text(Findings(fit, [trace], "<script>alert(1)</script>", notes=("A & B",)))
    assert text.index("<strong>Trusted. Identified from 20 frames.") < text.index("Parameters")
    assert "Measure &lt;b&gt;one&lt;/b&gt; mass &amp; be done." in text
    assert "<script>alert(1)" not in text
    assert "A &amp; B" in text
    assert "not determined by this motion" in text
    assert "<code>joint1.damping / link1.J</code></td><td>0.1235</td>" in text


def test_page_needs_no_network() -> None:
    fit = made_fit()
    text = page_text(Findings(fit, [trace_of(fit, record(fit))], "x"))
    assert not re.search(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=[\"']?(?:https?:)?//", text)
    assert text.count("<script>") == text.count("</script>") == 2


def test_page_of_a_fit_that_failed() -> None:
    fit = made_fit(starts=()).doubted([Doubt("refused", "Too few frames.")])
    text = page_text(Findings(fit, [], "x"))
    assert 'class="status refused"' in text
    assert "<strong>Refused. Too few frames." in text
    assert "Plotly" not in text


def test_settings_are_listed_with_dotted_names() -> None:
    settings = {"seed": 0, "fix": {}, "track": {"reach": 4.0, "method": None}}
    assert flat(settings) == {"seed": "0", "fix": "–", "track.reach": "4.0", "track.method": "–"}
