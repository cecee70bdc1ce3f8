"""What is written simulates the same motion in MuJoCo, and reads back as the same mechanism."""

import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest
from zoo import FRICTION, ZOO

from monodyn.mechanism import BUNDLED, Mechanism, load, write_mjcf, write_urdf
from monodyn.mechanism.simulate import rollout
from monodyn.mechanism.tree import INERTIA, MASS
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


def _flat(path: Path) -> str:
    """Return the text of a file with its lines joined."""
    return " ".join(path.read_text(encoding="utf-8").split())


def test_what_is_written_says_how_other_programs_have_to_take_it(tmp_path: Path) -> None:
    mechanism = load("double").with_values({"joint2.air": 1e-4})
    write_mjcf(mechanism, tmp_path / "m.xml", remarks=["First -- of all."])
    write_urdf(mechanism, tmp_path / "m.urdf", remarks=["First -- of all."])
    text, urdf = _flat(tmp_path / "m.xml"), _flat(tmp_path / "m.urdf")
    assert text.startswith('<mujoco model="double"> <!-- First - - of all. -->')
    assert (
        "mjd_transitionFD (linearization by finite differences) does not take this integrator: set "
        "model.opt.integrator to mujoco.mjtIntegrator.mjINT_IMPLICITFAST before it." in text
    )
    assert "Not simulated by MuJoCo: the drag of the air on links, -c |z| z." in text
    assert "<!-- First - - of all. -->" in urdf
    assert (
        "PyBullet computes inertia from the collision geometry unless loadURDF is given "
        "flags=URDF_USE_INERTIA_FROM_FILE: each body has one box here that has the identified inertia about "
        "the hinge axis, for that purpose alone. PyBullet also damps every link, which changeDynamics(body, "
        "link, linearDamping=0, angularDamping=0) stops, and holds every joint by a motor, of which "
        "setJointMotorControl2(body, joint, VELOCITY_CONTROL, force=F) leaves the dry friction F of the "
        "joint." in urdf
    )
    assert (
        "pinocchio reads damping into model.damping, but aba and rnea leave it out: subtract model.damping * "
        "v from the torques." in urdf
    )


def test_what_is_said_of_the_linearization_holds(tmp_path: Path) -> None:
    write_mjcf(load("double"), tmp_path / "m.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    data, slope = mujoco.MjData(model), np.zeros((4, 4))
    with pytest.raises(mujoco.FatalError, match="RK4 integrator is not supported"):
        mujoco.mjd_transitionFD(model, data, 1e-6, True, slope, None, None, None)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    mujoco.mjd_transitionFD(model, data, 1e-6, True, slope, None, None, None)
    # the identity and a millisecond of rates
    assert slope[:2] == pytest.approx(np.hstack((np.eye(2), 1e-3 * np.eye(2))), abs=2e-4)


@pytest.mark.parametrize("name", NAMES)
def test_the_collision_box_has_the_inertia_about_the_hinge(name: str, tmp_path: Path) -> None:
    mechanism = _mechanism(name, tmp_path)
    write_urdf(mechanism, tmp_path / "m.urdf")
    links = {link.get("name"): link for link in ET.parse(tmp_path / "m.urdf").getroot().iter("link")}
    for joint, link, row in zip(mechanism.joints, mechanism.plan.links, mechanism.tree.links, strict=True):
        if not link.carries:
            continue
        element = links[joint.body]
        origins = [element.find(f"{what}/origin").attrib for what in ("inertial", "collision")]
        assert origins[0] == origins[1]
        x, _, z = map(float, element.find("collision/geometry/box").get("size").split())
        assert row[MASS] * (x**2 + z**2) / 12 == pytest.approx(row[INERTIA], rel=1e-12)
    boxes = {"bundled single", "bundled double", "single", "double"}
    if name in boxes:
        # a body that is a box in its axes is its own collision geometry
        sizes = [element.find(f"{what}/geometry/box").get("size") for what in ("visual", "collision")]
        assert np.fromstring(sizes[0], sep=" ") == pytest.approx(np.fromstring(sizes[1], sep=" "), rel=1e-9)
