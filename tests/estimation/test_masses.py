"""What determines masses themselves: only where something in proportion to them was measured."""

from __future__ import annotations

import json

import numpy as np
import pytest

import monodyn
from monodyn.results.models import what_is_known
from swings import motion, record


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "fix", "scale"),
    [
        ("single", {"link1.mass": 0.2}, "given"),
        ("single", {"link1.thickness": 0.004}, "given"),
        ("double", {"link2.mass": 0.15}, "given"),
        ("double", {"joint1.damping": 2e-3}, "given"),
        # a density leaves the thickness open, and no friction is none at all scales
        ("double", {"link1.density": 2700.0}, None),
        ("double", {"joint1.damping": 0.0}, None),
        ("double", {}, None),
    ],
)
def test_one_measured_mass_makes_all_of_them_absolute(tmp_path, name, fix, scale):
    """The truth is the bundled file with twice its thicknesses and dampings, but for what is given."""
    times = np.arange(60) / 30.0
    file = monodyn.load(name)
    doubled = {n: 2.0 * v for n, v in file.values.items() if n.endswith((".thickness", ".damping"))}
    true = file.with_values(doubled)
    factor = 1.0
    for given, value in fix.items():
        if value and not given.endswith("density"):
            factor = value / true.values[given]
    start = [-0.4, 0.6][: len(file.joints)]
    position = motion(true, times, start, [0.0] * len(start))
    poses = record(file, times, position, noise=1e-4)
    fit = monodyn.identify(poses, file.with_choices(fix=fix))
    assert fit.mass_scale == scale
    monodyn.report(fit, to=tmp_path / "run", poses=poses)
    assert json.loads((tmp_path / "run" / "fit.json").read_text())["mass_scale"] == scale
    text = (tmp_path / "run" / "model.xml").read_text()
    assert ("Only ratios show" in text) == (scale is None)
    # read back it still is what it was
    assert monodyn.open_run(tmp_path / "run").mass_scale == scale
    if scale:
        for body in file.bodies:
            mass = fit.parameter(f"{body}.mass")
            assert mass.value == pytest.approx(factor * true.values[mass.name], abs=4.0 * mass.std + 1e-12)


def test_a_given_mass_beside_free_ones_determines_no_scale() -> None:
    """Free, the pole's mass may be any: with its centre, inertia and frictions it makes the same motion."""
    times = np.arange(90) / 30.0
    file = monodyn.load("cartpole").with_choices(
        fix={"cart.mass": 0.35}, free=["link1.mass", "link1.com_x", "link1.inertia"]
    )
    position = motion(file, times, [0.0, -0.4], [0.0, 0.0])
    values, other = file.values, {}
    # of what acts together all is k times as much, the mass 0.2 kg more
    k = (0.35 + values["link1.mass"] + 0.2) / (0.35 + values["link1.mass"])
    other["link1.mass"] = values["link1.mass"] + 0.2
    other["link1.com_x"] = k * values["link1.mass"] * values["link1.com_x"] / other["link1.mass"]
    about = values["link1.inertia"] + values["link1.mass"] * values["link1.com_x"] ** 2
    other["link1.inertia"] = k * about - other["link1.mass"] * other["link1.com_x"] ** 2
    other |= {f"{joint}.damping": k * values[f"{joint}.damping"] for joint in ("slide", "joint1")}
    alike = motion(file.with_values(other), times, [0.0, -0.4], [0.0, 0.0])
    np.testing.assert_allclose(alike, position, atol=1e-9)
    fit = monodyn.identify(record(file, times, position, noise=1e-4), file)
    assert fit.ok
    assert np.isinf(fit.parameter("link1.mass").std)
    assert fit.mass_scale is None
    noted = monodyn.linearize(fit, {"joint1": -np.pi / 2}, actuated=["slide"]).notes
    assert "known up to one factor" in noted[0]
    assert (
        "Only ratios show: masses, inertias, frictions, springs and torques are known up to one common "
        "factor, that of the file that the run began with. A known torque makes them absolute; that "
        "cart.mass was given does not." in what_is_known(fit)
    )
    known = monodyn.identify(
        record(file, times, position, noise=1e-4), file.with_choices(fix={"link1.mass": 0.1})
    )
    assert known.mass_scale == "given"


TWO = """<mujoco><option gravity="0 0 -9.81"/><default><joint axis="0 -1 0" damping="0.001"/>
  <geom type="box" density="2700" size="0.1075 0.003 0.015" pos="0.0925 0 0"/></default><worldbody>
  <body name="a"><joint name="ja"/><geom/></body>
  <body name="b" pos="0.5 0 0"><joint name="jb"/><geom/></body></worldbody></mujoco>"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "fix", "free"),
    [
        # of two that hang side by side one is weighed: what torques do to it is known
        (TWO, {"a.mass": 0.05}, []),
        # a length, which follows from gravity, lacks; the mass does not
        ("single", {"link1.mass": 0.05, "link1.density": 2700.0}, ["gravity"]),
    ],
    ids=["two", "gravity"],
)
def test_what_else_is_open_is_no_scale_of_masses(tmp_path, file, fix, free) -> None:
    if file.startswith("<"):
        (tmp_path / "two.xml").write_text(file)
        file = tmp_path / "two.xml"
    times, start = np.arange(75) / 30.0, monodyn.load(file).with_choices(fix=fix, free=free)
    dofs = len(start.joints)
    position = motion(start, times, [-0.9, 0.6][:dofs], [0.0] * dofs)
    fit = monodyn.identify(record(start, times, position, noise=1e-4), start)
    assert any(np.isinf(p.std) for p in fit.parameters)
    assert fit.mass_scale == "given"
