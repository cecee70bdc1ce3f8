"""How long a body is whatever its shape, and bodies that end otherwise than in their file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.ends import plain_bodies, with_ends
from monodyn.mechanism.mjcf import write_mjcf
from monodyn.mechanism.simulate import simulate

BODY = """<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="arm">
<joint name="pin" axis="0 -1 0"/>{}</body></worldbody></mujoco>"""
GEOMS = {
    "box": '<geom type="box" size="0.11 0.01 0.01" pos="0.1 0 0"/>',
    "capsule": '<geom type="capsule" size="0.01" fromto="0 0 0 0.2 0 0"/>',
    "cylinder": '<geom type="cylinder" size="0.01" fromto="-0.01 0 0 0.21 0 0"/>',
    "ellipsoid": '<geom type="ellipsoid" size="0.11 0.01 0.01" pos="0.1 0 0"/>',
}


def made(tmp_path: Path, geoms: str) -> Mechanism:
    path = tmp_path / "arm.xml"
    path.write_text(BODY.format(geoms), encoding="utf-8")
    return load(path)


@pytest.mark.parametrize("kind", GEOMS)
def test_a_last_link_is_as_long_as_it_reaches_whatever_its_shape(kind: str, tmp_path: Path) -> None:
    arm = made(tmp_path, GEOMS[kind]).with_values({"arm.length": 0.3, "arm.width": 0.03})
    points, radius = arm.shapes.points, float(arm.shapes.radius[0])
    assert points[:, 0].max() + radius == pytest.approx(0.3, abs=1e-12)


@pytest.mark.parametrize(
    "mark", ['<geom type="sphere" size="0.02" pos="0.2 0 0"/>', '<site name="dot" pos="0.2 0 0"/>']
)
def test_a_rod_that_ends_in_a_ball_or_at_a_site_is_as_long_as_to_its_middle(
    mark: str, tmp_path: Path
) -> None:
    arm = made(tmp_path, GEOMS["capsule"] + mark)
    assert arm.values["arm.length"] == pytest.approx(0.2)
    assert not plain_bodies(arm)


def test_other_ends_keep_length_and_width_and_the_mass_of_the_same_shape(tmp_path: Path) -> None:
    capsule = made(tmp_path, GEOMS["capsule"])
    round_, flat = (with_ends(capsule, {"arm": share}) for share in (0.01 / 0.22, 0.0))
    for other in (round_, flat):
        assert other.values["arm.length"] == pytest.approx(0.21)
        assert other.values["arm.width"] == pytest.approx(0.02)
        assert other.values["arm.tail"] == pytest.approx(0.01)
        assert other.values["arm.com_x"] == pytest.approx(0.1, abs=1e-9)
    ratios = [m.values["arm.inertia"] / m.values["arm.mass"] for m in (capsule, round_, flat)]
    # a hull of few sides: its round ends are narrower by a few per cent of themselves
    assert ratios[1] == pytest.approx(ratios[0], rel=4e-3)
    assert ratios[2] == pytest.approx(0.22**2 / 12 + 0.02**2 / 12, rel=1e-9)
    assert plain_bodies(capsule) == {"arm": True}
    assert plain_bodies(flat) == {"arm": False}
    assert with_ends(flat, flat.ends) is flat


def test_choices_and_values_stay_with_other_ends(tmp_path: Path) -> None:
    box = made(tmp_path, GEOMS["box"]).with_choices(fix={"arm.length": 0.25}, bounds={"arm.tail": (0.0, 0.1)})
    other = with_ends(box, {"arm": 0.05})
    assert other.chosen == box.chosen
    assert {p.name for p in box.parameters} == {p.name for p in other.parameters}
    assert (other.parameter("arm.length").value, other.parameter("arm.length").free) == (0.25, False)
    assert other.parameter("arm.tail").upper == 0.1


@pytest.mark.parametrize("share", [0.0, 0.05])
def test_the_written_model_moves_as_the_one_with_other_ends(share: float, tmp_path: Path) -> None:
    arm = with_ends(made(tmp_path, GEOMS["capsule"]), {"arm": share})
    write_mjcf(arm, tmp_path / "model.xml")
    time = np.linspace(0.0, 1.0, 11)
    ends = [
        simulate(m, time, np.array([0.3]), np.zeros(1)).position for m in (arm, load(tmp_path / "model.xml"))
    ]
    # the file has 12 digits
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-7)
