"""What is known of a stream on a terminal: rendered by rich at several widths, and as plain lines."""

from __future__ import annotations

import io
import math
import re
import time
from dataclasses import replace

import numpy as np
import pytest
from rich.cells import cell_len
from rich.console import Console

from fits import identified, made_fit
from lives import double, followed, watched
from monodyn.estimation.fit import Doubt
from monodyn.live import terminal
from monodyn.live.meter import Meter, Pace, Spread
from monodyn.live.terminal import PlainLines, Shown, Terminal, drawn, plain_line

PACE = Pace(29.97, Spread(0.0042, 0.0079), Spread(0.0101, 0.0187))


def rendered(step, width, height=50, pace=PACE, name="double.mp4", stopping=False):
    """Render a frame; return the lines."""
    console = Console(width=width, height=height, record=True, file=io.StringIO(), color_system=None)
    console.print(drawn(Shown(name, 1.0, step, pace, stopping), width, height))
    return [line.rstrip() for line in console.export_text().splitlines()]


@pytest.mark.parametrize("width", [40, 47, 60, 80, 100, 120, 200])
def test_everything_stands_on_it_whole_at_any_width(width):
    step = followed(45, double())
    lines = rendered(step, width)
    assert max(map(cell_len, lines)) <= width
    text = " ".join(" ".join(lines).split())
    assert lines[0] == "double.mp4  following"
    for fact in ("1.50 s", "30.0 frames/s", "pose 4.2/7.9 ms", "fit 10.1/18.7 ms", "2 skipped"):
        assert any(fact in line for line in lines), fact
    assert f"Trusted. {step.said}" in text
    assert "Enough motion? yes" in text
    joint = double().mechanism.joints[0]
    where = math.degrees(step.pose.position[0, 0])
    assert re.search(rf"{joint.name} +{where:.2f}".replace("-", "−"), text)
    assert "0.57 " in text  # 0.01 rad, what predictions were off by
    length = double().parameter("link1.length")
    half = (length.upper - length.lower) / 2
    found = re.search(r"link1\.length +([\d.]+) ± ([\d.]+) +m\b", text)
    assert found
    assert float(found[1]) == pytest.approx(length.value, abs=length.std / 10)
    assert float(found[2]) == pytest.approx(half, rel=0.05)
    assert "not determined" in text
    # where it is narrow a unit may be cut, and no name and no number
    assert not re.search("…", text.replace("N m …", ""))
    # tables are next to each other where there is room for both
    assert any("joint" in line and "parameter" in line for line in lines) == (width >= 120)


@pytest.mark.parametrize(("width", "height"), [(40, 20), (80, 20), (80, 16), (120, 12)])
def test_it_is_no_higher_than_the_terminal_and_the_verdict_is_on_it(width, height):
    lines = rendered(followed(45, double()), width, height)
    assert len(lines) <= height
    assert any("Trusted." in line for line in lines)
    assert any("link1.length" in line for line in lines)
    assert any(re.search(r"and \d+ more", line) for line in lines)


def test_bars_shrink_with_the_intervals():
    bars = [terminal._bar(share) for share in (2.0, 1.0, 0.1, 0.01, 0.001, 1e-6)]
    assert [len(bar) for bar in bars] == [10, 10, 7, 3, 0, 0]


def test_what_happens_before_anything_is_known_is_said():
    assert rendered(None, 80, pace=Pace(None, None, None)) == ["double.mp4  opening"]
    lines = rendered(watched(30), 80, pace=Pace(30.0, None, None))
    assert lines == [
        "double.mp4  watching",
        "1.00 s   30.0 frames/s   0 skipped",
        "Waiting for motion.",
    ]
    tracked = replace(followed(), estimate=None, base=None, error=np.zeros(0), said="Looking.")
    lines = rendered(tracked, 80)
    assert "Enough motion?" not in " ".join(lines)
    assert any(re.match(r" *joint1 +−?[\d.]+ +0.057 +– +deg", line) for line in lines)


def test_a_length_that_is_not_known_yet_is_named():
    wide = [replace(row, lower=0.18, upper=0.22) if row.name == "link1.length" else row
            for row in identified().parameters]  # fmt: skip
    step = followed(base=replace(identified(), parameters=tuple(wide)), estimate=None)
    assert "Enough motion? not yet: link1.length ± 10 %" in rendered(step, 80)
    open_ = [
        replace(row, std=math.inf, lower=0.0, upper=math.inf) for row in wide if row.name == "link1.length"
    ]
    step = followed(base=replace(identified(), parameters=tuple(open_)), estimate=None)
    lines = rendered(step, 80)
    assert "Enough motion? not yet: link1.length is not determined" in lines
    assert any(re.match(r" *link1.length +not determined", line) for line in lines)


def test_a_verdict_is_in_words_and_in_colour():
    for grade, reason, colour in (("refused", "It is another mechanism.", "31"),
                                  ("approximate", "It holds for 2 s.", "33")):  # fmt: skip
        fit = identified().doubted([Doubt(grade, reason)])
        step = followed(base=fit, estimate=None, said=fit.status)
        console = Console(width=80, force_terminal=True, file=io.StringIO(), color_system="standard")
        console.print(drawn(Shown("x", 1.0, step, PACE), 80, 40))
        text = console.file.getvalue()
        assert f"\x1b[1;{colour}m{grade.capitalize()}. " in text
        plain = re.sub(r"\x1b\[[\d;]*m", "", text)
        assert f"{grade.capitalize()}. {reason}" in plain
        assert plain.count("Approximate") == (grade == "approximate")


def test_names_are_no_markup_and_long_ones_are_cut():
    lines = rendered(watched(said="[red]no[/red]"), 40, name="[bold]rtsp://" + "x" * 80)
    assert lines[0].startswith("[bold]rtsp://xx")
    assert cell_len(lines[0]) <= 40
    assert "[red]no[/red]" in lines


def test_a_lost_joint_is_not_seen():
    step = followed()
    pose = replace(step.pose, position=np.full((1, 1), np.nan), seen=np.zeros(1, bool))
    assert any(re.match(r" *joint1 +not seen +–", line) for line in rendered(replace(step, pose=pose), 80))


def test_stopping_is_said():
    lines = rendered(watched(), 100, stopping=True)
    assert lines[0] == "double.mp4  stopping"
    assert lines[-1] == "What has been found is being kept; Ctrl-C again stops at once, without it."


@pytest.mark.slow
def test_it_is_drawn_a_few_times_a_second_whatever_the_rate_of_the_frames(monkeypatch):
    count = []
    monkeypatch.setattr(terminal, "drawn", lambda *given: count.append(time.monotonic()) or "")
    console = Console(width=80, height=24, force_terminal=True, file=io.StringIO())
    step, meter = watched(), Meter()
    with Terminal(console, "x", 1.0, meter) as screen:
        began, frames = time.monotonic(), 0
        while time.monotonic() - began < 1.0:
            screen.add(step)
            frames += 1
    assert frames > 1000
    # and once at the beginning, once at the end
    assert 3 <= len(count) <= 12


def test_plain_lines_come_once_a_second_and_say_what_is_new(monkeypatch):
    monkeypatch.setattr(terminal, "EVERY", 0.1)
    out, meter, many = io.StringIO(), Meter(), [watched(k) for k in range(500)]
    with PlainLines(out, "clip.mp4", meter) as lines:
        lines.add(watched(0))
        time.sleep(0.3)
        # all of them between two lines
        for step in many:
            lines.add(step)
        time.sleep(0.3)
        lines.add(followed())
    found = out.getvalue().splitlines()
    assert found.count("clip.mp4: Waiting for motion.") == 1
    assert found.count(f"clip.mp4: {identified().status}") == 1
    assert len(found) == 5
    assert found[1] == "0.0 s, watching, 0 skipped"
    assert found[-1].startswith("1.5 s, following, 2 skipped, link1.length 0.2000 ± 0.00")


def test_a_plain_line_has_speed_lengths_and_verdict():
    step = followed(base=made_fit(), estimate=None)
    pace = Pace(30.0, Spread(0.0042, 12.0), None)
    assert plain_line(step, pace) == (
        "1.5 s, following, 30.0 frames/s, pose 4.2 ms/12 s, 2 skipped, link1.length 0.2000 ± 0.0020 m, "
        "trusted"
    )
