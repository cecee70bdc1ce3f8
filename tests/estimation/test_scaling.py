"""Changes of units that leave the motion as it is."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.record.samples import prepare
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.scaling import (
    starts_of_scales,
    with_clock_of_start,
    with_gravity_of_start,
    with_masses_of_start,
)
from monodyn.mechanism import Measured, load
from monodyn.stages import identify
from support import slow
from swings import SIZES, TIMES, motion, record, scaled, sigmas


@pytest.mark.parametrize("model", ["single", slow("cartpole")])
def test_an_open_time_scale_stays_at_the_start(model):
    """With dry friction, whose smooth sign does not scale, and with slides in the scale of the picture."""
    start, times = load(model).with_values({"time_scale": 0.5}), np.arange(150) / 30.0
    true = scaled(load(model), cart=1.6, link1=1.6).with_values({"joint1.friction": 2e-4})
    slides = [joint.kind == "slide" for joint in true.joints]
    swing = motion(true, times, [0.0, 0.9][-len(slides) :], [0.2, 0.0][-len(slides) :])
    slow = record(start, 3.0 * times, np.where(slides, swing / 1.6, swing), noise=5e-4, metric=False)
    fit = identify(slow, start.with_choices(free=["time_scale", "joint1.friction"]))
    assert fit.ok
    assert np.isinf(fit.parameter("time_scale").std)
    assert fit.parameter("time_scale").value == pytest.approx(0.5, rel=1e-3)  # kept near the start
    length = {c.name: c for c in fit.combinations}[f"{true.joints[0].body}.length / time_scale^2"]
    assert sigmas(length, 9.0 * true.values[f"{true.joints[0].body}.length"]) < 4.0


def test_gravity_against_the_time_scale(poses, double, truth):
    known = {name: value for name, value in truth.values.items() if name.rsplit(".", 1)[-1] in SIZES}
    fit = identify(poses, double.with_choices(fix=known, free=["time_scale", "gravity"]))
    assert sigmas({c.name: c for c in fit.combinations}["time_scale^2 * gravity"], 9.81) < 4.0
    assert (
        "The data do not fix gravity and time_scale one by one; the true frame rate (--rate for a clip, or "
        "--fix time_scale=VALUE) or the value of gravity would fix the rest."
    ) in fit.advice


HINGE = ("damping", "friction", "stiffness", "torque", "drag", "air")
SIZES_ALONE = ("length", "width", "tail", "tip", "com_x", "com_y")


def freed(model, bodies):
    """Return a problem in which every parameter that can be an unknown is one, sizes seen by a picture."""
    start = load(model).with_bodies(bodies).with_torque("fourier", terms=1, period=0.7)
    names = [p.name for p in start.parameters if not p.follows and p.kind not in ("offset", "armature")]
    sizes = [p.name for p in start.parameters if p.kind in SIZES_ALONE[:4] and not p.follows]
    start = start.with_choices(free=names).with_measured(Measured(tuple(sizes), 1e4 * np.eye(len(sizes))))
    still = np.zeros((12, len(start.joints)))
    return posed(start, prepare([record(start, TIMES[:12], still)], start))


def powers(problem, change, k):
    """Return by how many powers of ``k`` a change of units moves each unknown, by name."""
    unknowns = replace(
        problem.unknowns, lower=np.full(len(problem.unknowns), -np.inf),
        upper=np.full(len(problem.unknowns), np.inf),
    )  # fmt: skip
    problem = replace(problem, unknowns=unknowns)
    x = np.where(unknowns.log, unknowns.x0, 0.1)
    at = unknowns.names.index({"gravity": "gravity", "clock": "time_scale"}[change])
    x[at] -= (1.0 if change == "gravity" else 0.5) * np.log(k)
    moved = {"gravity": with_gravity_of_start, "clock": with_clock_of_start}[change](problem, x)
    ratio = np.where(unknowns.log, np.exp(moved - x), moved / np.where(unknowns.log, 1.0, x))
    found = np.log(ratio) / np.log(k)
    return dict(zip(unknowns.names, found.round(9).tolist(), strict=True))


@pytest.mark.parametrize(("bodies", "weighted"), [("uniform", 4.0), ("free", 2.0)])
def test_longer_in_more_gravity(bodies, weighted):
    """What keeps the motion of hinges: lengths and gravity k times, inertias and torques k^2 or k^4 times."""
    problem = freed("double", bodies)
    table = dict.fromkeys((*SIZES_ALONE, "gravity"), 1.0) | dict.fromkeys((*HINGE, "inertia"), weighted)
    found = powers(problem, "gravity", 1.3)
    for name, kind in zip(problem.unknowns.names, problem.unknowns.kinds, strict=True):
        if (bodies, kind) != ("free", "density"):  # nothing depends on it
            assert found[name] == table.get(kind, 0.0), name


@pytest.mark.parametrize("model", ["double", "cartpole"])
@pytest.mark.parametrize(("bodies", "mass"), [("uniform", 2.0), ("free", 0.0)])
def test_longer_on_a_slower_clock(model, bodies, mass):
    """Motion takes k^(1/2) times as long; at a slide masses stand where inertias stand at a hinge."""
    problem = freed(model, bodies)
    joints = {joint.name: joint.kind for joint in problem.mechanism.joints}
    found = powers(problem, "clock", 1.3)
    unknowns = problem.unknowns
    for name, kind, owner in zip(unknowns.names, unknowns.kinds, unknowns.owners, strict=True):
        inertia = mass + 2.0 if joints.get(owner, "hinge") == "hinge" else mass
        force = inertia - 1.0 if joints.get(owner, "hinge") == "hinge" else inertia
        table = dict.fromkeys(SIZES_ALONE, 1.0) | {
            "time_scale": 0.5, "period": 0.5, "lead": 0.5, "mass": mass, "inertia": mass + 2.0,
            "damping": inertia - 0.5, "stiffness": inertia - 1.0, "friction": force, "torque": force,
            "rest": 0.0 if joints.get(owner, "hinge") == "hinge" else 1.0,
            **dict.fromkeys(
                ("drag", "air"), inertia if joints.get(owner, "hinge") == "hinge" else mass - 1.0
            ),
        }  # fmt: skip
        if (bodies, kind) != ("free", "density"):  # nothing depends on it
            assert found[name] == table.get(kind, 0.0), name


def test_masses_return_to_the_start():
    problem = freed("double", "free")
    unknowns = problem.unknowns
    heavy = unknowns.of_kind("mass", "inertia", "density", "thickness")
    x = unknowns.x0 + np.where(heavy, np.log(3.0), 0.0)
    loose = unknowns.of_kind("damping")
    x[loose] = 0.3
    moved = with_masses_of_start(problem, x)
    np.testing.assert_allclose(moved[heavy], unknowns.x0[heavy], atol=1e-12)
    np.testing.assert_allclose(moved[loose], 0.1, rtol=1e-12)
    still = ~heavy & ~unknowns.of_kind("damping", "friction", "stiffness", "torque")
    np.testing.assert_array_equal(moved[still], x[still])


def test_scales_that_are_tried():
    """Lengths where they are free; else gravity or the time scale does the same; else there is one start."""
    double = load("double")
    data = prepare([record(double, TIMES[:12], np.zeros((12, 2)))], double)
    factors = np.array([0.5, 4.0])
    lengths = {p.name: p.value for p in double.parameters if p.kind == "length"}
    longer = posed(double, data)
    for factor, x in zip(factors, starts_of_scales(longer, factors), strict=True):
        values = longer.unknowns.named(x)
        assert all(values[name] == pytest.approx(factor * value) for name, value in lengths.items())
        assert values["link1.thickness"] == pytest.approx(double.values["link1.thickness"])
    for name, power in (("gravity", -1.0), ("time_scale", -0.5)):
        problem = posed(double.with_choices(fix=lengths, free=[name]), data)
        found = [problem.unknowns.named(x)[name] for x in starts_of_scales(problem, factors)]
        np.testing.assert_allclose(found, double.values[name] * factors**power)
    assert len(starts_of_scales(posed(double.with_choices(fix=lengths), data), factors)) == 1
