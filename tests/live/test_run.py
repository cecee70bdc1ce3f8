"""What a stream leaves behind."""

from __future__ import annotations

import csv
import json
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import monodyn
from monodyn.errors import FitError
from monodyn.live import begin, recorder, sources
from monodyn.live.identifier import Cut
from monodyn.live.run import _tracked, follow
from monodyn.live.settings import LiveSettings
from monodyn.mechanism import load
from monodyn.settings import RunSettings
from monodyn.types import Poses
from streamed import SMALL, frames
from support import refuses


@pytest.fixture(scope="module")
def filmed():
    return frames()


def test_a_stream_in_which_nothing_moves_leaves_what_was_recorded(tmp_path):
    still = [np.full((64, 96), 100, np.uint8) for _ in range(60)]
    with refuses(
        FitError,
        "pictures: the mechanism was not found before the stream ended: Nothing is seen to move. "
        "The search needs 0.3 s of motion.",
    ):
        follow(still, "double", tmp_path / "run")
    assert json.loads((tmp_path / "run" / "run.json").read_text())["status"] == "failed"
    assert monodyn.read(tmp_path / "run" / "clip.mp4").count == 60


@pytest.mark.slow
def test_pictures_of_a_program_leave_a_run_folder_with_their_recording(filmed, tmp_path):
    seen = []
    outcome = follow(filmed[0], "double", tmp_path / "run", shown=lambda _, step: seen.append(step.index))
    assert seen == list(range(len(filmed[0])))
    assert outcome.document["grade"] == "trusted"
    for name, true in zip(("link1.length", "link2.length"), SMALL.pendulum.length, strict=True):
        row = outcome.fit.parameter(name)
        assert row.lower < true < row.upper
    again = monodyn.open_run(tmp_path / "run")
    assert again.parameter("link1.length").value == outcome.fit.parameter("link1.length").value
    with (tmp_path / "run" / "poses.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(filmed[0]) == monodyn.read(tmp_path / "run" / "clip.mp4").count
    run = json.loads((tmp_path / "run" / "run.json").read_text())
    assert (run["command"], run["status"]) == ("live", "done")
    assert {"clip.mp4", "overlay.mp4", "report.html", "model.xml"} <= set(run["files"])


@pytest.mark.slow
def test_what_was_touched_and_what_was_not_recorded_is_said(filmed, tmp_path, monkeypatch):
    """A hand turns the mechanism into another state, while the recorder is slow."""
    watched, _ = filmed
    jumped = [*watched[:120], *watched[150:]]
    moved = [frame.__class__(i, i / SMALL.rate, frame.luma, frame.chroma) for i, frame in enumerate(jumped)]
    taken, every = recorder.Recorder.take, []

    def left_out(self, frame):
        every.append(frame)
        if len(every) % 50 == 0:
            self.left_out += 1
            return
        taken(self, frame)

    monkeypatch.setattr(recorder.Recorder, "take", left_out)
    said = set()
    outcome = follow(
        moved, "double", tmp_path / "run", LiveSettings(review=4.0),
        shown=lambda _, step: said.add(step.said),
    )  # fmt: skip
    lost = len(every) // 50
    assert (
        f"{lost} frames came faster than they could be recorded; clip.mp4 is without them." in outcome.notes
    )
    first = next(note for note in outcome.notes if note.startswith("Fitted are")).split()[5]
    assert f"Fitted are the frames from {first} on: what came before is another motion." in outcome.notes
    assert 60 < int(first) < 160
    astray = next(one for one in said if one.startswith("The motion of the last"))
    seconds, times = astray.split()[5], astray.split(": ")[1].split()[0]
    assert astray == (
        f"The motion of the last {seconds} s is not that of the mechanism as identified before: {times} "
        "times as far off as the noise; something may touch it, or it has changed."
    )
    assert outcome.document["grade"] != "refused"


@pytest.mark.parametrize(
    ("why", "said"),
    [
        ("another motion", "what came before is another motion."),
        ("stamps", "the time stamps jump there, and no motion goes on across that."),
        ("unseen", "the mechanism was out of sight before."),
        ("searching", "those before were not followed, as the search for the mechanism took so long."),
        ("too fast", "those before were not followed, as they came faster than that."),
        ("", None),
    ],
)
def test_why_a_fit_begins_later_is_said_as_it_was(why, said):
    record = Poses(
        ("joint1",), np.arange(40), np.arange(40) / 30.0, np.zeros((40, 1)), np.ones((40, 1, 1)),
        np.ones(40, bool),
    )  # fmt: skip
    cut = Cut(12 / 30.0, why) if why else Cut(0.0)
    session: Any = SimpleNamespace(
        found=SimpleNamespace(scene=SimpleNamespace(doubt=None, mechanism=load("single"))),
        source=SimpleNamespace(video=None),
        identifier=SimpleNamespace(record=SimpleNamespace(whole=record), cut=cut), recorded=None,
    )  # fmt: skip
    video: Any = SimpleNamespace(count=40, times=record.time)
    _, span = _tracked(session, video, LiveSettings(), RunSettings(), None)
    assert span.notes == (() if said is None else (f"Fitted are the frames from 12 on: {said}",))
    assert span[:2] == (12 if why else 0, 40)


@pytest.fixture
def missed(tmp_path, monkeypatch):
    """Follow frames as a clip that does not wait, of which most come while the search takes long."""
    whole, search = threading.Event(), begin.search

    def slow(*given):
        whole.wait(60.0)
        return search(*given)

    monkeypatch.setattr(begin, "search", slow)
    monkeypatch.setattr(sources, "in_time", lambda frames, closing: frames)
    monkeypatch.setattr(recorder, "WAITING", 1000)

    def following(watched, until, held):
        monkeypatch.setattr(begin, "MOST_HELD", held)
        clip = recorder.Recorder(tmp_path / "clip.mp4")
        for frame in watched:
            clip.take(frame)
        clip.finish()

        def shown(_, step):
            if step.index >= until:
                whole.set()

        live = LiveSettings(pace="real", queue=1000)
        return follow(tmp_path / "clip.mp4", "double", tmp_path / "run", live, shown=shown)

    return following


@pytest.mark.slow
def test_a_clip_is_fitted_as_one_motion_however_long_the_search_takes(filmed, missed):
    """There is room for 60 frames of it: the others are read once more in the end."""
    outcome = missed(filmed[0], 200, 5_000_000)
    assert not [note for note in outcome.notes if note.startswith("Fitted are")]
    fitted = outcome.document["fitted"][0]
    assert fitted["first"] == pytest.approx(0.0, abs=0.1)
    assert fitted["rows"] > 200
    assert outcome.document["grade"] == "trusted"
    assert outcome.poses.measured.all(axis=1).mean() > 0.95


@pytest.mark.slow
def test_a_hand_in_frames_that_were_missed_is_found_in_the_end(filmed, missed):
    jumped = [*filmed[0][:120], *filmed[0][150:]]
    moved = [frame.__class__(i, i / SMALL.rate, frame.luma, frame.chroma) for i, frame in enumerate(jumped)]
    outcome = missed(moved, len(moved) - 1, 5_000_000)
    first = next(note for note in outcome.notes if note.startswith("Fitted are")).split()[5]
    assert f"Fitted are the frames from {first} on: what came before is another motion." in outcome.notes
    assert 110 < int(first) < 160
