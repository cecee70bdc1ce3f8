"""What is written simulates the same motion in MuJoCo, and reads back as the same mechanism."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from zoo import FRICTION, ZOO

from monodyn.mechanism import BUNDLED, Mechanism, load, write_mjcf, write_urdf
from monodyn.mechanism.simulate import rollout
from monodyn.mechanism.urdf import NOT_IN_URDF

SEED = 20120802
NAMES = [*ZOO, *(f"bundled {name}" for name in BUNDLED if name != "chain:N"), "bundled chain:10"]


def _mechanism(name: str, folder: Path) -> Mechanism:
    """Return a mechanism of the zoo (or a bundled one), with sizes that are not the file's."""
    path = folder / "given.xml"
    path.write_text(ZOO.get(name, ""))
    mechanism = load(path if name in ZOO else name.removeprefix("bundled "))
    changed = {p.name: 1.1 * p.value for p in mechanism.parameters if p.free and p.value > 0}
    return mechanism.with_values(changed | {"gravity": 9.7})


def _mujoco_motion(path: Path, q0: np.ndarray, v0: np.ndarray) -> tuple[mujoco.MjModel, np.ndarray]:
    """Return the model and its positions over 1 s at 0.2 ms steps, contacts and limits off."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(
        mujoco.mjtDisableBit.mjDSBL_LIMIT
    )
    model.opt.timestep = 2e-4
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q0, v0
    rows = [q0]
    for _ in range(10):
        for _ in range(500):
            mujoco.mj_step(model, data)
        rows.append(data.qpos.copy())
    return model, np.array(rows)


def _ours(mechanism: Mechanism, q0: np.ndarray, v0: np.ndarray) -> np.ndarray:
    tree = mechanism.tree
    times = np.linspace(0, 1, 11)
    return rollout(tree, times, q0, v0, substeps=500)[0]


def _start(mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(SEED)
    n = len(mechanism.joints)
    return rng.uniform(-0.5, 0.5, n), rng.uniform(-0.5, 0.5, n)


@pytest.mark.parametrize("name", NAMES)
def test_mjcf_moves_the_same(name: str, tmp_path: Path) -> None:
    mechanism = _mechanism(name, tmp_path)
    write_mjcf(mechanism, tmp_path / "model.xml")
    q0, v0 = _start(mechanism)
    model, theirs = _mujoco_motion(tmp_path / "model.xml", q0, v0)
    assert [model.joint(j).name for j in range(model.njnt)] == [j.name for j in mechanism.joints]
    # Same steps, so rounding; the wildest of these motions multiplies it by 1e6 in a second.
    assert np.allclose(_ours(mechanism, q0, v0), theirs, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_urdf_moves_the_same(name: str, tmp_path: Path) -> None:
    mechanism = _mechanism(name, tmp_path)
    # URDF knows neither springs nor rotor inertia.
    lost = {f"{j.name}.{what}": 0.0 for j in mechanism.joints for what in NOT_IN_URDF}
    mechanism = mechanism.with_values(lost)
    write_urdf(mechanism, tmp_path / "model.urdf")
    q0, v0 = _start(mechanism)
    model, theirs = _mujoco_motion(tmp_path / "model.urdf", q0, v0)
    assert [model.joint(j).name for j in range(model.njnt)] == [j.name for j in mechanism.joints]
    # As above; the links between two joints of one body weigh 1e-12 kg there.
    assert np.allclose(_ours(mechanism, q0, v0), theirs, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("write", [write_mjcf, write_urdf])
def test_reads_back_as_the_same_mechanism(name: str, write, tmp_path: Path) -> None:
    mechanism = _mechanism(name, tmp_path)
    path = tmp_path / "model.xml"
    write(mechanism, path)
    again = load(path)
    columns = list(range(14)) if write is write_mjcf else list(range(11))
    links, read = _comparable(mechanism), _comparable(again)
    assert np.array_equal(again.tree.parent, mechanism.tree.parent)
    assert np.array_equal(again.tree.kind, mechanism.tree.kind)
    # A few roundings by quaternions; the 1e-12 kg between two joints of one body add to its mass in URDF.
    assert np.allclose(read[:, columns], links[:, columns], rtol=1e-9, atol=2e-12)
    assert np.allclose(again.tree.gravity, mechanism.tree.gravity, rtol=1e-12, atol=0)
    assert [(j.name, j.kind, j.sign) for j in again.joints] == [
        (j.name, j.kind, j.sign) for j in mechanism.joints
    ]
    if write is write_mjcf:
        assert [(j.lower, j.upper) for j in again.joints] == [(j.lower, j.upper) for j in mechanism.joints]


@pytest.mark.parametrize("name", NAMES)
def test_what_was_read_is_written_the_same_again(name: str, tmp_path: Path) -> None:
    write_mjcf(_mechanism(name, tmp_path), tmp_path / "once.xml")
    write_mjcf(load(tmp_path / "once.xml"), tmp_path / "twice.xml")
    assert (tmp_path / "twice.xml").read_bytes() == (tmp_path / "once.xml").read_bytes()


def test_a_turned_mechanism_of_odd_sizes_is_written_the_same_again(tmp_path: Path) -> None:
    """Numbers with all of their digits, which every reader rounds."""
    rng = np.random.default_rng(SEED)
    for name in ("bundled double", "cart_branches", "chain"):
        mechanism = _mechanism(name, tmp_path)
        for k in range(10):
            odd = {p.name: p.value * rng.uniform(0.5, 2.0) for p in mechanism.parameters if p.free}
            path, again = tmp_path / f"{k}.xml", tmp_path / f"{k}again.xml"
            write_mjcf(mechanism.with_values(odd), path)
            write_mjcf(load(path), again)
            assert again.read_bytes() == path.read_bytes()


def _comparable(mechanism: Mechanism) -> np.ndarray:
    """Return the links without what does not count: slack springs, how joints share a body's anchor."""
    links = mechanism.tree.links.copy()
    links[links[:, 11] == 0, 12] = 0
    for i in range(1, len(links)):
        if mechanism.joints[i].body == mechanism.joints[i - 1].body:
            links[i, :2] += links[i - 1, :2]
            links[i - 1, :2] = 0
    return links


@pytest.mark.parametrize("name", NAMES)
def test_mjcf_looks_the_same(name: str, tmp_path: Path) -> None:
    mechanism = _mechanism(name, tmp_path)
    path = tmp_path / "model.xml"
    write_mjcf(mechanism, path)
    ours, theirs = mechanism.shapes, load(path).shapes
    assert np.array_equal(ours.link, theirs.link)
    for g in range(len(ours.body)):
        a = ours.points[ours.first[g] : ours.first[g + 1]]
        b = theirs.points[theirs.first[g] : theirs.first[g + 1]]
        # Sizes are written in full; a mesh's corners are single precision in MuJoCo.
        assert np.allclose(_extents(a), _extents(b), rtol=0, atol=1e-7)
        assert ours.radius[g] == pytest.approx(theirs.radius[g], rel=1e-9)


def _extents(points: np.ndarray) -> np.ndarray:
    """Return the bounding box of points, which does not depend on their order."""
    return np.array([points.min(axis=0), points.max(axis=0)])


def test_friction_loss_is_written(tmp_path: Path) -> None:
    (tmp_path / "given.xml").write_text(FRICTION)
    mechanism = load(tmp_path / "given.xml")
    write_mjcf(mechanism, tmp_path / "model.xml")
    write_urdf(mechanism, tmp_path / "model.urdf")
    for name in ("model.xml", "model.urdf"):
        model = mujoco.MjModel.from_xml_path(str(tmp_path / name))
        assert model.dof_frictionloss.tolist() == [0.02, 0.01]


def test_friction_loss_moves_the_same(tmp_path: Path) -> None:
    """With what MuJoCo takes unless a file says otherwise the motions part by 13 mrad."""
    (tmp_path / "given.xml").write_text(FRICTION)
    mechanism = load(tmp_path / "given.xml")
    write_mjcf(mechanism, tmp_path / "model.xml")
    q0, v0 = _start(mechanism)
    _, theirs = _mujoco_motion(tmp_path / "model.xml", q0, v0)
    assert np.allclose(_ours(mechanism, q0, v0), theirs, rtol=0, atol=3e-3)


def test_urdf_says_what_it_cannot_hold(tmp_path: Path) -> None:
    (tmp_path / "given.xml").write_text(ZOO["chain"])
    write_urdf(load(tmp_path / "given.xml"), tmp_path / "model.urdf")
    text = (tmp_path / "model.urdf").read_text()
    spring, rotor = "stiffness 0.03 N m/rad about 0.349066 rad", "armature 0.0002 kg m^2"
    assert f"<!-- not in URDF: {spring} and {rotor} of the next joint -->" in text
