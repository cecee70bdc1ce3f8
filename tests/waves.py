"""Records and settings for the tests of the published least squares."""

import numpy as np

from monodyn.mechanism import load
from monodyn.mechanism.simulate import rollout
from monodyn.paper.settings import PaperIdentifySettings
from swings import record, scaled

PAPER = PaperIdentifySettings(method="paper")
SMALL = 2e-4
"""Noise [rad] that leaves the truncation of the filter's start as large as the noise itself."""


def driven(mechanism, times, q0):
    start = np.array(q0), np.zeros(len(q0))
    return rollout(mechanism.tree, times, *start, substeps=16, drive=mechanism.drive)[0]


def fourier_truth(times, period=1.1):
    """Return a driven double pendulum that differs from its file in sizes, and its noisy record."""
    truth = scaled(load("double"), link1=1.4, link2=1.4).with_torque("fourier", terms=2, period=period)
    values = {"joint1.torque.sin1": 0.05, "joint1.torque.cos2": 0.02, "joint2.torque.cos1": 0.01}
    truth = truth.with_values(values)
    return truth, record(truth, times, driven(truth, times, [-1.5, 0.2]), noise=SMALL)
