"""``run.toml``: what is written is read back as the same settings, to the last digit."""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from random import Random
from types import NoneType
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
import pytest

from monodyn.choices import Tolerance
from monodyn.cli.options import COMMANDS
from monodyn.cli.parse import parsed
from monodyn.cli.table import Option, listed
from monodyn.errors import SettingsError
from monodyn.estimation.settings import IdentifySettings
from monodyn.forms import NOTATIONS, notation
from monodyn.live.settings import LiveSettings
from monodyn.results.run_toml import command_toml, document_toml, is_no_file
from monodyn.settings import UNUSED, RunSettings, settings_classes
from monodyn.settings_file import run_toml
from monodyn.vision.settings import CameraSettings, LocateSettings, TrackSettings
from support import slow

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
    text = run_toml(command, {word: value, "model": "chain:3"}, settings)
    found = read_back(tmp_path, command, text)
    assert asdict(found.settings) == asdict(settings)
    assert found.model == "chain:3"
    read = getattr(found, word)
    assert (list(map(str, read)) if isinstance(value, list) else str(read)) == value
    # what is read back is written as the same file
    again = run_toml(command, {word: read, "model": found.model}, found.settings)
    assert again == text


def test_other_settings_come_back(tmp_path: Path) -> None:
    for settings in (
        RunSettings(),
        RunSettings(method="paper", camera=CameraSettings(method="fast")),
        RunSettings(masks=Path("/a/masks"), camera=CameraSettings(exposure=THIRD, readout=-0.01)),
        RunSettings(identify=IdentifySettings(torque="fourier", terms=2, series="alone")),
    ):
        text = run_toml("run", {"clip": Path("/a/clip.mp4"), "model": "auto"}, settings)
        assert asdict(read_back(tmp_path, "run", text).settings) == asdict(settings)


def test_numbers_of_numpy_come_back(tmp_path: Path) -> None:
    settings = RunSettings(
        fit_frames=(np.int64(3), np.int32(90)), time_range=(np.float64(-0.5), 2), until=np.float32(0.1),
        tolerance=Tolerance(np.float64(THIRD), np.float64(1e-9)), roi=(np.int64(1), 2, 300, 200),
        fix={"gravity": np.float64(9.8)}, bounds={"link1.length": (np.float64(-1.0), np.float64(THIRD))},
    )  # fmt: skip
    text = run_toml("run", {"clip": Path("/a/clip.mp4"), "model": "auto"}, settings)
    assert "np." not in text
    assert asdict(read_back(tmp_path, "run", text).settings) == asdict(settings)
    for number in (np.int64(3), np.float64(0.1), np.bool_(True)):
        assert tomllib.loads(command_toml("reproduce", {"seed": number}))["seed"] == number
    text = run_toml("live", {"source": np.int64(0), "model": "auto"}, RunSettings())
    assert tomllib.loads(text)["source"] == "0"


def test_a_stream_comes_back(tmp_path: Path) -> None:
    live = LiveSettings(pace="real", ahead=THIRD, size=(64, 48), pixels="rgb24", queue=7)
    text = run_toml("live", {"source": 0, "model": "/a/m.xml"}, RunSettings(), live)
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
        text = run_toml("run", {"clip": "films/a.mp4", "model": model}, RunSettings())
        found = tomllib.loads(text)
        assert (found["clip"], found["model"]) == (f"{tmp_path}/films/a.mp4", there)
    text = run_toml("run", {"clip": "12", "model": "bob"}, RunSettings())
    assert tomllib.loads(text)["clip"] == f"{tmp_path}/12"
    assert "clip" not in tomllib.loads(run_toml("run", {"clip": None, "model": "bob"}, RunSettings()))


@pytest.mark.parametrize("name", ['a "b"', "c\\d", "e\nf\tg", "ü ∞ 🎥", "h\x7fi\x01", "#j = [k]"])
def test_any_name_of_a_file_comes_back(name: str, tmp_path: Path) -> None:
    text = run_toml("run", {"clip": Path("/a") / name, "model": "bob"}, RunSettings())
    assert read_back(tmp_path, "run", text).clip == Path("/a") / name


def test_a_name_that_is_no_text_is_left_out_with_a_comment() -> None:
    text = run_toml("run", {"clip": Path("/a/\udcff.mp4"), "model": "bob"}, RunSettings())
    assert "# clip: no text" in text
    assert "clip" not in tomllib.loads(text)


def test_the_file_says_how_it_is_used() -> None:
    text = run_toml("track", {"clip": "a.mp4", "model": "bob"}, RunSettings())
    assert text.splitlines()[:2] == [
        "# The settings of this run. To do it again, into another folder:",
        "#   monodyn track --config run.toml --out again",
    ]


ODD = (
    "a,b",
    "a=b",
    "a b",
    "ü ∞",
    '"q"',
    "c\\d",
    "#x",
    "-x",
    "--force",
    "x\ny",
    "[t]",
    "a.b",
    "5",
    "true",
    ".",
    "double",
)
"""Names that a file or a joint may have, and a command line may take for something else."""


def drawn(kind: Any, random: Random) -> Any:
    """Draw a value of the type of a setting, as Python or numpy has it."""
    if NoneType in get_args(kind):
        (kind,) = (one for one in get_args(kind) if one is not NoneType)
    some = range(random.randint(0, 3))
    number = random.choice((-1, 1, 1, 1)) * 10 ** random.uniform(-3, 3)
    whole = random.choice((-3, 0, 1, 2, 7, 40, 400, 2**40))
    if get_origin(kind) is Literal:
        return random.choice(get_args(kind))
    if get_origin(kind) is tuple:
        inner = get_args(kind)
        inner = [inner[0]] * random.choice((0, 3, 4, 5)) if inner[-1] is Ellipsis else inner
        return tuple(None if random.random() < 0.3 and NoneType in get_args(one) else drawn(one, random)
                     for one in inner)  # fmt: skip
    if get_origin(kind) is Mapping:
        return {random.choice((*ODD, "")): drawn(get_args(kind)[1], random) for _ in some}
    if get_origin(kind) is Sequence:
        return tuple(random.choice(ODD) for _ in some)
    if kind is Tolerance:
        return Tolerance(np.float64(abs(number)), abs(number))
    return random.choice({
        bool: (True, False, np.bool_(True)),
        int: (whole, np.int64(whole), np.int32(whole % 1000)),
        float: (number, np.float64(number), np.float32(number), whole, np.int64(whole)),
        str: ODD,
        Path: [Path("/a", odd) for odd in ODD],
    }[kind])  # fmt: skip


DRAWS = 8
FILED = [slow(name) if name in UNUSED else name for name, entry in COMMANDS.items() if entry.file]


@pytest.mark.parametrize("command", FILED)
def test_whatever_an_option_may_be_is_written_and_read_as_the_same(command: str, tmp_path: Path) -> None:
    options, random, taken = listed(command), Random(command), set()
    path = tmp_path / "run.toml"
    for option in options:
        needed = [word for one in options if one.usual is MISSING and one is not option
                  for word in (f"--{one.name}", "double")]  # fmt: skip
        for _ in range(DRAWS):
            value = drawn(option.kind, random)
            text, expected = filed(command, option, value)
            path.write_text(text, encoding="utf-8", newline=random.choice(("\n", "\r\n")))
            words = ["--config", str(path), *needed]
            if expected is None:
                with pytest.raises(SettingsError):
                    parsed(command, words)
                continue
            found = parsed(command, words)
            taken.add(option.name)
            place = found if not option.place else found.live if option.place == "live" else found.settings
            assert (asdict(place) if option.place else getattr(found, option.field)) == expected, option.name
    # some stand beside others alone, or in a narrow range
    assert len(taken) > 0.8 * len(options)


def filed(command: str, option: Option, value: Any) -> tuple[str, Any]:
    """Write a value as a program does; with it what is to be read, None where a program may not have it."""
    if not option.place:
        if option.form.named or option.kind in (Tolerance, Sequence[str]) or option.name == "view":
            return document_toml(command, {option.name: option.form.write(value)}, {}), value
        text = command_toml(command, {option.name: value})
        named = option.file and isinstance(value, str) and not is_no_file(option.name, value)
        return text, os.path.abspath(value) if named else value
    inputs = {"model": "double"}
    try:
        if option.place == "live":
            live = LiveSettings(**{option.field: value})
            return run_toml(command, inputs, RunSettings(), live), asdict(live)
        chosen = {option.field: value}
        if option.place == "settings":
            settings = RunSettings(
                **chosen, **{"points": Path("/a")} if option.name.startswith("points.") else {}
            )
        else:
            settings = RunSettings(**{option.place: settings_classes()[option.place](**chosen)})
        return run_toml(command, inputs, settings), asdict(settings)
    except SettingsError:
        return document_toml(command, {option.name: option.form.write(value)}, {}), None


@pytest.mark.parametrize("model", ["5", "-", "http://x", "chain"])
def test_a_model_is_found_from_every_folder_whatever_its_name(
    model: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = run_toml("run", {"clip": "a.mp4", "model": model}, RunSettings())
    (tmp_path / "there").mkdir()
    monkeypatch.chdir("there")
    assert read_back(tmp_path, "run", text).model == os.path.abspath(f"../{model}")
    # and so in a file of one's own
    assert read_back(tmp_path, "run", f'clip = "a"\nmodel = "{model}"').model == str(tmp_path / model)
