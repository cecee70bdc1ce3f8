"""Masses and inertias of geoms: against MuJoCo, and closed forms against integrals."""

from pathlib import Path

import numpy as np

from models import HINGE, mjcf, read
from monodyn.mechanism.solids import box_moments, hull_moments


def test_masses_of_solids_are_those_of_mujoco(tmp_path: Path) -> None:
    """A mesh and a box tilted out of the plane, with ``load`` comparing mass and inertia itself (to 1e-6)."""
    mechanism = read(
        tmp_path,
        mjcf(
            f'<body name="a">{HINGE}<geom type="mesh" mesh="w"/>'
            '<geom type="box" size=".03 .01 .005" pos=".05 0 0" euler="20 30 40"/>'
            '<geom type="ellipsoid" size=".03 .01 .005" pos=".05 0 0.03" euler="20 30 40"/>'
            '<geom type="capsule" size=".01" fromto="0 0 0 .05 .03 .02"/>'
            '<geom type="cylinder" size=".01" fromto="0 0 0 .05 .03 .02"/></body>',
            '<asset><mesh name="w" vertex="0 -.01 -.02 0 .01 -.02 0 -.01 .02 0 .01 .02 .12 0 0"/></asset>',
        ),
    )
    assert [p.name for p in mechanism.parameters if p.name.endswith("width")] == [
        "a.width", "a.box.width", "a.ellipsoid.width", "a.capsule.width", "a.cylinder.width",
    ]  # fmt: skip


def test_moments_of_a_tilted_box_are_those_of_its_hull() -> None:
    """The closed form against the integral over the hull, on random boxes."""
    rng = np.random.default_rng(3)
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    for _ in range(5):
        axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        half = rng.uniform(0.01, 0.1, size=3)
        points = (cube * half) @ axes.T
        hull = hull_moments(points / np.ptp(points, axis=0))
        for ours, theirs in zip(box_moments(axes, half), hull, strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-15)  # rounding
