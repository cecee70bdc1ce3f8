"""What the motion fixes of bodies whose single inertias stay open."""

import numpy as np
import pytest

from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.verdict.combinations import inertial_ratios, unit_of
from monodyn.mechanism.tree import ANCHOR_X, COM_X, INERTIA, MASS
from monodyn.stages import identify
from swings import TIMES, motion, record, sigmas


def test_free_bodies_give_the_regrouped_inertias(double, truth):
    records = [
        record(truth, TIMES, motion(truth, TIMES, start, rate), seed=seed)
        for seed, (start, rate) in enumerate([([0.3, 0.5], [0.0, 1.0]), ([-2.0, 0.2], [1.0, 0.0])])
    ]
    fit = identify(records, double, IdentifySettings(bodies="free"))
    assert fit.ok
    assert len(fit.starts) == 2
    links = truth.tree.links
    mass, com, inertia = links[:, 5], links[:, 6], links[:, 8]
    about = inertia + mass * com**2 + np.array([mass[1] * links[1, 0] ** 2, 0.0])
    first = mass * com + np.array([mass[1] * links[1, 0], 0.0])
    found = {c.name: c for c in fit.combinations}
    assert sigmas(found["link1.J / link2.J"], about[0] / about[1]) < 4.0
    assert sigmas(found["link1.mx * gravity / link2.J"], 9.81 * first[0] / about[1]) < 4.0
    assert sigmas(found["link1.length * link2.mx / link2.J"], links[1, 0] * first[1] / about[1]) < 4.0
    assert sigmas(found["joint1.damping / link1.J"], 2e-3 / about[0]) < 4.0
    assert sigmas(fit.parameter("link1.length"), truth.values["link1.length"]) < 4.0


def test_all_that_a_joint_adds_comes_over_the_inertia_it_acts_on(double):
    values = {"joint1.friction": 3e-3, "joint2.air": 2e-5, "joint2.drag": 1e-5, "joint2.damping": 4e-4}
    tree = double.with_values(values).tree
    ratios, links = inertial_ratios(double, tree, full=False), tree.links
    hanging = links[:, MASS] * links[:, COM_X] ** 2 + links[:, INERTIA]
    first = hanging[0] + links[1, MASS] * links[1, ANCHOR_X] ** 2
    assert ratios["joint1.friction / link1.J"] == pytest.approx(3e-3 / first, rel=1e-12)
    for kind in ("damping", "drag", "air"):
        expected = values[f"joint2.{kind}"] / hanging[1]
        assert ratios[f"joint2.{kind} / link2.J"] == pytest.approx(expected, rel=1e-12)
    units = {name: unit_of(double, name) for name in ratios}
    assert units["joint1.friction / link1.J"] == "1/s^2"
    assert units["joint2.drag / link2.J"] == units["joint2.air / link2.J"] == ""
    assert units["joint2.damping / link2.J"] == "1/s"
