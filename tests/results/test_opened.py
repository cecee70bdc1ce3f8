"""A fit that was written and read back moves as it did, with the same bands; what is not a run is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

import monodyn
from fits import identified
from monodyn.errors import SettingsError
from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism.simulate import simulate
from monodyn.results import opened as opened_module
from monodyn.types import Poses
from support import refuses

TIME = np.arange(50) / 50.0


def pushed(name="double", **torque):
    """Return noisy poses of a bundled mechanism under a torque, and its start with that torque."""
    mechanism = monodyn.load(name).with_torque(**torque) if torque else monodyn.load(name)
    sizes = {n: 0.05 for n in mechanism.values if n.endswith((".torque.cos1", ".torque.sin1"))}
    moved = mechanism.with_values(sizes)
    dofs = len(mechanism.joints)
    q = simulate(moved, TIME, np.linspace(-1.2, 0.4, dofs), np.zeros(dofs)).position
    q = q + 1e-3 * np.random.default_rng(1).standard_normal(q.shape)
    covariance = np.repeat(1e-6 * np.eye(dofs)[None], len(TIME), axis=0)
    names = tuple(joint.name for joint in mechanism.joints)
    return Poses(names, np.arange(len(TIME)), TIME, q, covariance, np.ones(len(TIME), bool)), mechanism


@pytest.mark.parametrize(
    ("name", "settings", "torque"),
    [
        ("double", IdentifySettings(torque="friction"), {}),
        ("double", IdentifySettings(torque="friction", bodies="free"), {}),
        ("cartpole", IdentifySettings(torque="friction"), {}),
        (
            "single",
            IdentifySettings(torque="fourier", terms=1),
            {"model": "fourier", "terms": 1, "period": 0.4},
        ),
        ("single", IdentifySettings(torque="free"), {"model": "fourier", "terms": 1, "period": 0.4}),
    ],
)
@pytest.mark.slow
def test_a_run_is_read_back_as_it_was(tmp_path, name, settings, torque):
    poses, _ = pushed(name, **torque)
    fit = monodyn.identify(poses, monodyn.load(name), settings)
    monodyn.report(fit, to=tmp_path / "run", poses=poses)
    back = monodyn.open_run(tmp_path / "run")
    np.testing.assert_allclose(back.mechanism.tree.links, fit.mechanism.tree.links, rtol=1e-14, atol=1e-300)
    times = np.linspace(0.0, 1.5, 40)
    there, here = monodyn.fill(fit, times), monodyn.fill(back, times)
    np.testing.assert_allclose(here.position, there.position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(here.std, there.std, rtol=1e-6)
    assert (back.grade, back.status, back.torque, back.ok) == (fit.grade, fit.status, fit.torque, fit.ok)
    length = f"{fit.mechanism.bodies[-1]}.length"
    assert back.parameter(length).std == fit.parameter(length).std


def test_what_is_no_run_is_refused_in_one_line(tmp_path):
    folder = tmp_path / "none"
    with refuses(
        SettingsError,
        f"'{folder}': expected the folder of a run, got no such folder; name the one given as --out.",
    ):
        monodyn.open_run(folder)
    with refuses(
        SettingsError,
        f"'{tmp_path}': expected the folder of a run, got a folder without fit.json; name the one given as "
        "--out.",
    ):
        monodyn.open_run(tmp_path)


def test_a_file_of_another_form_is_refused(tmp_path, monkeypatch):
    folder = tmp_path / "run"
    monodyn.report(identified(), to=folder)
    file = folder / "fit.json"
    document = json.loads(file.read_text())

    def opened(**change):
        file.write_text(json.dumps({**document, **change}))
        return monodyn.open_run(folder)

    assert opened().status == identified().status
    for schema, got in ((1, "1"), (None, "none")):
        with refuses(
            SettingsError,
            f"'{file}': expected a file of schema 2, got {got}; run it again with this version.",
        ):
            opened(schema=schema)
    with refuses(
        SettingsError, f"'{folder}': expected an identified mechanism, got a run without one: Too dark."
    ):
        opened(initial_state=[], status="Too dark.")
    for change, kind, what in (
        ({"parameters": [{"name": "gravity"}]}, "KeyError", "'value'"),
        ({"covariance": {"names": [], "matrix": []}}, "ValueError", "'record0.joint1' is not in list"),
        ({"rms": None}, "TypeError", "'NoneType' object is not subscriptable"),
    ):
        with refuses(
            SettingsError,
            f"'{file}': expected the file as it was written, got one without what it should hold "
            f"({kind}: {what}); run it again.",
        ):
            opened(**change)
    file.write_text("{")
    with refuses(
        SettingsError,
        f"'{file}': expected JSON, got other text (Expecting property name enclosed in double quotes: line 1 "
        "column 2 (char 1)); run it again.",
    ):
        monodyn.open_run(folder)
    monkeypatch.setattr(opened_module, "LARGEST", 0)
    with refuses(SettingsError, f"'{file}': expected a file of a run, got one of 1 bytes; run it again."):
        monodyn.open_run(folder)
