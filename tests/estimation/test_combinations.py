"""What the motion fixes of bodies whose single inertias stay open."""

import numpy as np

from monodyn.estimation.settings import IdentifySettings
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
