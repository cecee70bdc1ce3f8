"""``run.toml``: what is written is read back as the same settings, to the last digit."""

from __future__ import annotations

import math
import tomllib
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, get_type_hints

import pytest

from monodyn.choices import Tolerance
from monodyn.cli.parse import parsed
from monodyn.estimation.settings import IdentifySettings
from monodyn.forms import NOTATIONS, notation
from monodyn.live.settings import LiveSettings
from monodyn.settings import UNUSED, RunSettings, settings_classes
from monodyn.settings_file import settings_text
from monodyn.vision.settings import CameraSettings, LocateSettings, TrackSettings

THIRD = 1 / 3
CHANGED: dict[str, Any] = {
    "fit_frames": (3, None), "roi": (1, 2, 300, 200), "time_range": (THIRD, 5.1), "until": 10 * THIRD,
    "tolerance": Tolerance(THIRD, 1e-9), "fix": {"gravity": 9.80665, "link1.length": 0.1 + 0.2},
    "free": ("joint1.drag", "camera.focal"), "bounds": {"link2.length": (THIRD, math.inf)},
    "background": Path("/a/still.png"), "points": Path("/a/tracks.csv"), "points_map": {"knee": "joint2"},
    "points_size": (640, 480), "points_axis": "up", "distortion": (-THIRD, 0.0, 1e-17, 0.0),
    "torques": (Path("/a/one, two.csv"), Path("/a/b.csv")), "ensemble": 3, "rate": 1000 * THIRD, "seed": 5,
    "uncertainty": "profile", "method": "fast",
    "locate": LocateSettings(focal=1000 * THIRD, search_frames=9),
    "track": TrackSettings(reach=THIRD * 10, matched=0.1 + 0.2),
    "identify": IdentifySettings(bodies="free", error_bound=1e-7),
}  # fmt: skip
"""A value for every setting of a run that may stand beside the others."""


def read_back(folder: Path, command: str, text: str) -> Any:
    path = folder / "run.toml"
    path.write_text(text, encoding="utf-8")
    return parsed(command, ["--config", str(path), "--out", str(folder)])


@pytest.mark.parametrize("command", UNUSED)
def test_every_setting_of_every_command_comes_back(command: str, tmp_path: Path) -> None:
    given = {name: value for name, value in CHANGED.items() if name not in UNUSED[command]}
    settings = RunSettings(**given)
    word, value = {
        "identify": ("poses", ["/a/one.csv", "/a/two.csv"]),
        "live": ("source", "/a/clip.mp4"),
    }.get(command, ("clip", "/a/clip.mp4"))
    text = settings_text(command, {word: value, "model": "chain:3"}, settings)
    found = read_back(tmp_path, command, text)
    assert asdict(found.settings) == asdict(settings)
    assert found.model == "chain:3"
    read = getattr(found, word)
    assert (list(map(str, read)) if isinstance(value, list) else str(read)) == value
    # what is read back is written as the same file
    again = settings_text(command, {word: read, "model": found.model}, found.settings)
    assert again == text


def test_other_settings_come_back(tmp_path: Path) -> None:
    for settings in (
        RunSettings(),
        RunSettings(method="paper", camera=CameraSettings(method="fast")),
        RunSettings(masks=Path("/a/masks"), camera=CameraSettings(exposure=THIRD, readout=-0.01)),
        RunSettings(identify=IdentifySettings(torque="fourier", terms=2, series="alone")),
    ):
        text = settings_text("run", {"clip": Path("/a/clip.mp4"), "model": "auto"}, settings)
        assert asdict(read_back(tmp_path, "run", text).settings) == asdict(settings)


def test_a_stream_comes_back(tmp_path: Path) -> None:
    live = LiveSettings(pace="real", ahead=THIRD, size=(64, 48), pixels="rgb24", queue=7)
    text = settings_text("live", {"source": 0, "model": "/a/m.xml"}, RunSettings(), live)
    found = read_back(tmp_path, "live", text)
    assert (found.source, found.model, found.live) == ("0", "/a/m.xml", live)


def test_every_type_of_setting_can_be_written() -> None:
    for kind in (RunSettings, LiveSettings, *settings_classes().values()):
        hints = get_type_hints(kind)
        for setting in fields(kind):
            if setting.name not in settings_classes():
                assert callable(notation(hints[setting.name]).write)
    assert all(form.metavar or kind is bool for kind, form in NOTATIONS.items())


def test_files_are_named_from_the_root_and_names_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for model, there in (
        ("double", "double"),
        (Path("double"), f"{tmp_path}/double"),
        ("m.xml", f"{tmp_path}/m.xml"),
    ):
        text = settings_text("run", {"clip": "films/a.mp4", "model": model}, RunSettings())
        found = tomllib.loads(text)
        assert (found["clip"], found["model"]) == (f"{tmp_path}/films/a.mp4", there)
    text = settings_text("run", {"clip": "12", "model": "bob"}, RunSettings())
    assert tomllib.loads(text)["clip"] == f"{tmp_path}/12"
    assert "clip" not in tomllib.loads(settings_text("run", {"clip": None, "model": "bob"}, RunSettings()))


@pytest.mark.parametrize("name", ['a "b"', "c\\d", "e\nf\tg", "ü ∞ 🎥", "h\x7fi\x01", "#j = [k]"])
def test_any_name_of_a_file_comes_back(name: str, tmp_path: Path) -> None:
    text = settings_text("run", {"clip": Path("/a") / name, "model": "bob"}, RunSettings())
    assert read_back(tmp_path, "run", text).clip == Path("/a") / name


def test_a_name_that_is_no_text_is_left_out_with_a_comment() -> None:
    text = settings_text("run", {"clip": Path("/a/\udcff.mp4"), "model": "bob"}, RunSettings())
    assert "# clip: no text" in text
    assert "clip" not in tomllib.loads(text)


def test_the_file_says_how_it_is_used() -> None:
    text = settings_text("track", {"clip": "a.mp4", "model": "bob"}, RunSettings())
    assert text.splitlines()[:2] == [
        "# The settings of this run. To do it again, into another folder:",
        "#   monodyn track --config run.toml --out again",
    ]
