"""Other programs load what is written and move it as we do; one that is not installed is skipped visibly.

``pip install .[test-clients]`` installs them all.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from zoo import ZOO

import handed_over
from handed_over import BULLET, FOLLOWED, LINEAR
from monodyn.mechanism import Mechanism, load, write_mjcf, write_urdf
from monodyn.mechanism.simulate import rollout
from monodyn.mechanism.urdf import NOT_IN_URDF

NAMES = [*ZOO, "bundled single", "bundled double", "bundled triple", "bundled bob", "bundled cartpole"]
HOW = "is not installed: pip install .[test-clients]"
every_mechanism = pytest.mark.parametrize("name", NAMES)


def _written(name: str, folder: Path) -> Mechanism:
    """Write both files of a mechanism without what URDF cannot hold, and without dry friction."""
    (folder / "given.xml").write_text(ZOO.get(name, ""))
    mechanism = load(folder / "given.xml" if name in ZOO else name.removeprefix("bundled "))
    lost = {f"{j.name}.{what}": 0.0 for j in mechanism.joints for what in (*NOT_IN_URDF, "friction")}
    mechanism = mechanism.with_values(lost | {"gravity": 9.7})
    write_mjcf(mechanism, folder / "model.xml")
    write_urdf(mechanism, folder / "model.urdf")
    return mechanism


def _agreed(name: str) -> float:
    # between two joints of one body URDF has links of 1e-14 kg, which weigh in the twelfth digit
    return 1e-11 if name == "planar_body" else handed_over.AGREED


@every_mechanism
def test_drake_accelerates_it_as_we_do(name: str, tmp_path: Path) -> None:
    """With Drake's contacts, which must not act: bodies of the zoo overlap."""
    pytest.importorskip("pydrake.all", reason=f"drake {HOW}")
    mechanism = _written(name, tmp_path)
    theirs = handed_over.drake_accelerations(tmp_path, mechanism)
    assert handed_over.disagreement(mechanism, theirs) < _agreed(name)


@every_mechanism
def test_pinocchio_accelerates_it_as_we_do(name: str, tmp_path: Path) -> None:
    pytest.importorskip("pinocchio", reason=f"pin {HOW}")
    mechanism = _written(name, tmp_path)
    theirs = handed_over.pinocchio_accelerations(tmp_path, mechanism)
    assert handed_over.disagreement(mechanism, theirs) < _agreed(name)


@every_mechanism
def test_pybullet_moves_it_as_we_do_with_default_flags(name: str, tmp_path: Path) -> None:
    pytest.importorskip("pybullet", reason=f"pybullet {HOW}")
    mechanism = _written(name, tmp_path)
    dofs, times = len(mechanism.joints), np.arange(int(handed_over.BULLET_SECONDS * 30) + 1) / 30.0
    # near rest, where a first-order integrator is good enough to compare
    hang = np.array([-1.5 if i == 0 else 0.1 for i in range(dofs)])
    q, v = rollout(mechanism.tree, times, hang, np.full(dofs, 0.2), substeps=64)
    states = {joint.name: q[:, i] for i, joint in enumerate(mechanism.joints)}
    states |= {f"{joint.name}_vel": v[:, i] for i, joint in enumerate(mechanism.joints)}
    default, stated = (
        handed_over.bullet_motion(tmp_path, mechanism, states, of_file=own) for own in (False, True)
    )
    # the only difference is where the inertia comes from
    assert np.abs(default - stated).max() < 1e-9
    assert np.degrees(np.abs(default - q)).max() < BULLET


@every_mechanism
def test_yourdfpy_places_the_bodies_as_mujoco_does(name: str, tmp_path: Path) -> None:
    yourdfpy = pytest.importorskip("yourdfpy", reason=f"yourdfpy {HOW}")
    mechanism = _written(name, tmp_path)
    robot = yourdfpy.URDF.load(str(tmp_path / "model.urdf"))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(model)
    data.qpos[:] = np.random.default_rng(1).uniform(-2.0, 2.0, model.nq)
    robot.update_cfg({joint.name: data.qpos[i] for i, joint in enumerate(mechanism.joints)})
    mujoco.mj_forward(model, data)
    for body in mechanism.bodies:
        frame, theirs = robot.get_transform(body), data.body(body)
        # where a body stands against its last joint differs between the formats; its mass does not
        com = next(link.inertial.origin for link in robot.robot.links if link.name == body)
        np.testing.assert_allclose((frame @ com)[:3, 3], theirs.xipos, atol=1e-9)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Run folders of a simulated record, and of one under a periodic torque."""
    return {
        case: handed_over.made_run(case, tmp_path_factory.mktemp(case) / "run")
        for case in ("swinging", "driven")
    }


@pytest.mark.slow
@pytest.mark.parametrize("table", ["states", "prediction"])
def test_mujoco_follows_the_tables_from_the_keyframe(runs: dict[str, Path], table: str) -> None:
    assert handed_over.followed(runs["swinging"], table) < FOLLOWED
    driven = runs["driven"]
    assert handed_over.followed(driven, table, by=handed_over.series_of(driven)) < FOLLOWED
    assert handed_over.followed(driven, table, by=handed_over.lines_of(driven)) < LINEAR
    # without what drives it the motion is another one
    assert handed_over.followed(driven, table) > 1.0


@pytest.mark.slow
def test_the_lines_of_the_page_drive_the_model(runs: dict[str, Path]) -> None:
    page = (Path(__file__).parents[2] / "docs" / "simulators.md").read_text(encoding="utf-8")
    (lines,) = (block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "mjcb" in block)
    names: dict[str, Any] = {}
    exec(lines.replace('"run/', f'"{runs["driven"]}/'), names)
    states = handed_over.columns(runs["driven"] / "states.csv")
    model, data = names["model"], names["data"]
    model.opt.timestep = 1.0 / 30.0 / 100.0
    try:
        for row in range(len(states["time"])):
            off = data.qpos - [states["joint1"][row], states["joint2"][row]]
            assert np.degrees(np.abs(off)).max() < LINEAR
            mujoco.mj_step(model, data, 100)
    finally:
        mujoco.set_mjcb_control(None)


def test_a_program_that_is_not_installed_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert handed_over.installed("mujoco")
    assert not handed_over.installed("no_such_program")
    assert capsys.readouterr().err == (
        "handed_over: no_such_program SKIPPED, it is not installed; pip install .[test-clients]\n"
    )
