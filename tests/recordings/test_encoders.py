"""Real encoder records (MONODYN_DATA): every window from a naive start, ratios against the published ones."""

import os
from pathlib import Path

import pytest

from monodyn.estimation.record.tables import read_poses
from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism import load
from monodyn.stages import identify

DATA = Path(os.environ.get("MONODYN_DATA", "")) / "encoders"
FREE = IdentifySettings(bodies="free")

pytestmark = pytest.mark.skipif(
    "MONODYN_DATA" not in os.environ or not DATA.is_dir(), reason="MONODYN_DATA has no encoders folder"
)

PUBLISHED = {
    "link1.J / link2.J": 1.796,
    "link1.length * link2.mx / link2.J": 0.8824,
    "link1.mx * gravity / link2.J": 105.9,
    "link2.mx * gravity / link2.J": 50.11,
}


def fitted(name):
    mechanism = load(name.split("_")[0])
    return identify(read_poses(DATA / f"{name}.csv", mechanism), mechanism, FREE)


def test_double_pendulum_has_the_published_ratios():
    """Within 2 %: the spread between windows is about 1 %."""
    fit = fitted("double_12").check()
    assert max(fit.rms.values()) < 0.003
    found = {c.name: c.value for c in fit.combinations}
    for name, value in PUBLISHED.items():
        assert found[name] == pytest.approx(value, rel=0.02)
    assert fit.parameter("link1.length").value == pytest.approx(0.1727, rel=0.02)


@pytest.mark.parametrize("name", ["single_00", "single_01"])
def test_single_pendulum(name):
    """Nine seconds of a real pendulum with viscous friction alone: 3 mrad."""
    fit = fitted(name).check()
    assert fit.rms["joint1"] < 0.003


@pytest.mark.parametrize("window", range(2, 20, 5))
def test_windows_are_found_from_a_naive_start(window):
    """The worst leave 5 mrad, wherever the search starts; ``benchmarks/encoders.py`` counts all twenty."""
    fit = fitted(f"double_{window:02d}").check()
    assert max(fit.rms.values()) < 0.005
