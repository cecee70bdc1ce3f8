"""The options of the commands come from the typed settings: each setting is written once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields
from typing import Any

import pytest

from monodyn.cli import parse, table
from monodyn.cli.options import COMMANDS, CommonOptions, RunOptions
from monodyn.cli.parse import CONFIG, parsed
from monodyn.cli.table import listed
from monodyn.errors import SettingsError
from monodyn.settings import STAGES, UNUSED, RunSettings, settings_classes
from support import command, refuses

WORDS = ("clip.mp4", "--model", "double", "--out", "run")


def with_wider_track(monkeypatch: pytest.MonkeyPatch) -> None:
    """Add a setting to the tracking, as a field of its settings and nowhere else."""

    @dataclass(frozen=True)
    class Wider(settings_classes()["track"]):
        """How the mechanism is followed.

        Attributes:
            memory: Frames that a lost mechanism is remembered.
        """

        memory: int = 12

    for module in (table, parse):
        monkeypatch.setattr(module, "settings_classes", lambda: settings_classes() | {"track": Wider})


@pytest.mark.parametrize("name", ["run", "track"])
def test_a_new_setting_of_a_stage_is_an_option(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with_wider_track(monkeypatch)
    found: Any = parsed(name, [*WORDS, "--track.memory", "5"]).settings
    assert found.track.memory == 5
    assert found.track.reach == 4.0
    assert parsed(name, WORDS).settings.track.memory == 12
    helped = " ".join(command(name, "--help-all").out.split())
    assert "--track.memory N Frames that a lost mechanism is remembered. Default: 12." in helped
    assert "--track.reach NUMBER Search length along the normals once the pose is near [px]." in helped


def test_a_new_setting_of_a_run_is_an_option_in_the_form_of_its_type(monkeypatch: pytest.MonkeyPatch) -> None:
    @dataclass(frozen=True)
    class Wider(RunSettings):
        """What a run does.

        Attributes:
            weights: Weights of joints.
            pause: Time before the first frame [s].
        """

        weights: Mapping[str, float] = field(default_factory=dict)
        pause: float = field(default=0.0, metadata={"metavar": "S"})

    for module in (table, parse):
        monkeypatch.setattr(module, "RunSettings", Wider)
    # the annotations of a class within a function are looked up in its module
    for name in ("Mapping", "field"):
        monkeypatch.setitem(globals(), name, globals()[name])
    found: Any = parsed("run", [*WORDS, "--weights", "joint1=2", "--pause", "1.5"]).settings
    assert (found.weights, found.pause) == ({"joint1": 2.0}, 1.5)
    said = "weights: expected NAME=VALUE with a number, got 'joint1'; e.g. gravity=9.81."
    with refuses(SettingsError, said):
        parsed("run", [*WORDS, "--weights", "joint1"])


def test_every_setting_is_an_option_of_a_run() -> None:
    taken = {option.field if option.place == "settings" else option.place for option in listed("run")}
    assert {setting.name for setting in fields(RunSettings)} <= taken


def test_commands_take_the_settings_that_they_use() -> None:
    track, identify = listed("track"), listed("identify")
    assert set(STAGES) - {option.place for option in track} == {"identify"}
    assert set(STAGES) - {option.place for option in identify} == {"segment", "camera", "locate", "track"}
    assert not {option.name for option in track} & {"fit-frames", "until", "bounds"}
    assert not {option.name for option in identify} & {"roi", "time-range", "background", "rate"}
    taking = {name for name, entry in COMMANDS.items() if issubclass(entry.options, CommonOptions)}
    assert taking == set(UNUSED)


def test_what_most_people_need_are_options_of_the_command() -> None:
    for name, entry in COMMANDS.items():
        known = [option.name for option in listed(name)]
        assert set(entry.people.split()) <= {*known, CONFIG.name}
        assert len(set(entry.people.split()) - {one.name for one in listed(name) if one.word}) <= 10
        # whatever must be given is among them
        needed = {option.name for option in listed(name) if option.usual is MISSING}
        assert not entry.people or needed <= set(entry.people.split())


def test_words_become_settings() -> None:
    words = [
        *WORDS, "--fit-frames", "0:120", "--fix", "gravity=9.8", "link1.length=0.2", "--fix", "camera.x=0",
        "--free", "camera.focal", "--bounds", "link2.length=0.1:0.3", "--seed", "4", "--identify.starts", "2",
        "--identify.gains", "0.4", "0.1", "0.05", "--track.no-adaptive", "--locate.start", "evolution",
        "--locate.method", "paper", "--track.method", "paper",
    ]  # fmt: skip
    found: Any = parsed("run", words).settings
    assert found.fit_frames == (0, 120)
    assert found.fix == {"gravity": 9.8, "link1.length": 0.2, "camera.x": 0.0}
    assert (found.free, found.bounds) == (("camera.focal",), {"link2.length": (0.1, 0.3)})
    assert (found.seed, found.identify.seed, found.locate.seed, found.identify.starts) == (4, 4, 4, 2)
    assert (found.track.adaptive, found.locate.start) == (False, "evolution")
    assert asdict(parsed("run", WORDS).settings) == asdict(RunSettings())


def test_an_identification_records_the_usual_settings_of_the_other_stages() -> None:
    found = parsed("identify", ["a.csv", "--model", "double", "--method", "paper"]).settings
    assert asdict(found) == asdict(RunSettings(method="paper"))


def test_a_table_is_needed() -> None:
    said = "identify: expected at least one table of joint positions, got none; name a poses.csv."
    with refuses(SettingsError, said):
        parsed("identify", ["--model", "double"]).go()


def test_options_of_a_command_are_its_class() -> None:
    assert isinstance(parsed("run", WORDS), RunOptions)
