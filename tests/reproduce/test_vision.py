"""What a method saw, against the truth."""

from __future__ import annotations

import numpy as np
import pytest

from experiments import seen
from monodyn.reproduce.clip import ClipSettings, simulated
from monodyn.reproduce.vision import aligned


def test_true_angles_are_turned_to_the_measured_ones() -> None:
    found = seen()
    truth = simulated(ClipSettings(frames=90)).position
    assert aligned(truth, found.poses.position) == pytest.approx(truth + np.array([0.0, 2.0 * np.pi]))
