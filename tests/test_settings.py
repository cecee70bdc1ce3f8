"""The settings of a run: what the stages take from it, and what is refused."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, get_origin, get_type_hints

import pytest

from monodyn.errors import SettingsError
from monodyn.settings import SHARED, STAGES, RunSettings, published_method, settings_classes
from monodyn.vision.settings import CameraSettings, LocateSettings, TrackSettings
from support import refuses

SETTINGS = [
    (stage, kind, setting.name, setting.default)
    for stage, kind in settings_classes().items()
    for setting in fields(kind)
]
FLOATS = [(stage, kind, name) for stage, kind, name, usual in SETTINGS if isinstance(usual, float)]
COUNTS = [(stage, kind, name) for stage, kind, name, usual in SETTINGS if type(usual) is int]
WORDS = [
    (stage, kind, name)
    for stage, kind, name, usual in SETTINGS
    if isinstance(usual, str) or get_origin(get_type_hints(kind)[name]) is Literal or name == "method"
]


def test_an_exposure_needs_pictures_and_the_default_method() -> None:
    rolling = CameraSettings(readout=0.02)
    assert RunSettings(camera=rolling).camera.readout == 0.02
    with refuses(
        SettingsError,
        "camera.exposure, camera.readout: expected pictures and the method 'fast', got --points, which knows "
        "neither; leave them out.",
    ):
        RunSettings(points=Path("points.csv"), camera=rolling)
    with refuses(
        SettingsError,
        "camera.exposure, camera.readout: expected pictures and the method 'fast', got a stage by the "
        "published method, which knows neither; leave them out.",
    ):
        RunSettings(method="paper", camera=CameraSettings(exposure=0.01))
    assert RunSettings(method="paper", camera=CameraSettings(exposure=0.0)).camera.exposure == 0.0


def test_frames_to_fit_are_counted_from_the_first() -> None:
    for frames, got in (((-3, 5), "-3:5"), ((0, -10), "0:-10"), ((-1, None), "-1:")):
        said = f"fit-frames: expected A:B with frames from 0 on, got {got}; count from the first frame."
        with refuses(SettingsError, said):
            RunSettings(fit_frames=frames)


def test_the_seed_and_the_method_of_the_run_reach_its_stages() -> None:
    settings = RunSettings(seed=5, method="paper", track=TrackSettings(method="fast"))
    assert (settings.locate.seed, settings.identify.seed) == (5, 5)
    assert settings.segment.method == "fast"
    methods = [getattr(settings, stage).method for stage in ("camera", "locate", "track", "identify")]
    assert methods == ["paper", "paper", "fast", "paper"]


def test_a_run_has_the_settings_of_every_installed_method() -> None:
    settings = RunSettings(locate=LocateSettings(focal=900.0))
    assert settings.locate.focal == 900.0
    for stage, kind in settings_classes().items():
        assert isinstance(getattr(settings, stage), kind)


def test_importing_the_settings_loads_nothing_heavy() -> None:
    heavy = ("numpy", "scipy", "numba", "mujoco", "cv2", "av", "jinja2")
    code = (
        f"import sys, monodyn.settings as s; s.RunSettings(); print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"seed": -1}, "seed: expected 0 or more, got -1; give a whole number."),
        ({"method": "odd"}, "method: expected one of 'fast', 'paper', got 'odd'."),
        ({"rate": 0.0}, "rate: expected 0.001 to 1e+06 Hz, got 0; give the true frames a second."),
        (
            {"distortion": (-0.3, 0.1, 0.0)},
            "camera.distortion: expected K1,K2,P1,P2[,K3] in the order of OpenCV, got -0.3,0.1,0; give four "
            "or five numbers.",
        ),
        (
            {"distortion": (-0.3, math.nan, 0.0, 0.0)},
            "camera.distortion: expected K1,K2,P1,P2[,K3] in the order of OpenCV, got -0.3,nan,0,0; give "
            "four or five numbers.",
        ),
        ({"rate": math.nan}, "rate: expected 0.001 to 1e+06 Hz, got nan; give the true frames a second."),
    ],
)
def test_settings_that_are_refused(given: dict[str, Any], message: str) -> None:
    with refuses(SettingsError, message):
        RunSettings(**given)


@pytest.mark.parametrize(("stage", "kind", "name"), FLOATS, ids=[f"{s}.{n}" for s, _, n in FLOATS])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_no_number_of_a_stage_may_be_infinite(stage: str, kind: Any, name: str, value: float) -> None:
    with pytest.raises(SettingsError, match=f"^{stage}.{name.replace('_', '[_-]')}: expected .*, got "):
        kind(**{name: value})


@pytest.mark.parametrize(("stage", "kind", "name"), COUNTS, ids=[f"{s}.{n}" for s, _, n in COUNTS])
def test_no_count_of_a_stage_may_be_negative(stage: str, kind: Any, name: str) -> None:
    with pytest.raises(SettingsError, match=f"^{stage}.{name.replace('_', '[_-]')}.*: expected .*, got "):
        kind(**{name: -1})


@pytest.mark.parametrize(("stage", "kind", "name"), WORDS, ids=[f"{s}.{n}" for s, _, n in WORDS])
def test_no_word_of_a_stage_may_be_unknown(stage: str, kind: Any, name: str) -> None:
    # what all stages share has no stage before it
    where = name if name in SHARED else f"{stage}.{name}"
    with pytest.raises(SettingsError, match=f"^{where}: expected one of '.*, got 'nonsense'"):
        kind(**{name: "nonsense"})


@pytest.mark.parametrize("where", [{"method": "paper"}, {"track": TrackSettings(method="paper")}])
def test_a_method_that_is_not_installed_is_refused(
    where: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "monodyn.paper.settings", None)
    assert settings_classes() == STAGES
    assert type(RunSettings().track) is TrackSettings
    said = "method 'paper': the published method is not part of this installation; use the method 'fast'."
    with refuses(SettingsError, said):
        RunSettings(**where)


def test_another_missing_module_is_no_choice_of_a_method() -> None:
    with pytest.raises(ModuleNotFoundError), published_method():
        import a_module_that_is_not_there  # type: ignore[import-not-found]  # noqa: F401


def test_a_richer_class_of_a_stage_stays() -> None:
    @dataclass(frozen=True)
    class Wider(settings_classes()["track"]):
        memory: int = 3

    assert RunSettings(track=Wider(memory=5)).track.memory == 5
