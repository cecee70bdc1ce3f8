"""Sub-pixel edges, their derivatives, and the poses and sizes that follow from them, on drawn masks."""

import cv2
import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import FULL, Camera
from monodyn.vision.drawing.edges import edge_terms
from monodyn.vision.drawing.follow import follow
from monodyn.vision.drawing.outline import outline
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.foreground.palette import View
from monodyn.vision.locating.bundle import refine, size_information

CAMERA = Camera(320, 240, 300.0, x=0.05, y=-0.1, depth=0.9)
REACHES = np.array([8.0, 6.0, 4.0, 4.0, 4.0])


def draw(mechanism, camera, q, blur=0.8):
    """Draw a soft mask sixteen times finer than the pixels, then average and blur it."""
    fine = 16
    big = np.zeros((camera.height * fine, camera.width * fine), np.uint8)
    for _, polygon in outline(mechanism, camera, q):
        corners = np.round(((polygon + 0.5) * fine - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(big, [corners], FULL, cv2.LINE_8, 4)
    mask = cv2.resize(big, (camera.width, camera.height), interpolation=cv2.INTER_AREA).astype(np.float32)
    return np.round(cv2.GaussianBlur(mask, (0, 0), blur)).astype(np.uint8)[None]


def plain(mechanism):
    """Read one plane for all geoms, trusted everywhere."""
    geoms = len(mechanism.shapes.radius)
    trust = np.ones((1, CAMERA.height, CAMERA.width), np.float32)
    return View(trust, np.zeros(geoms, np.int64), np.zeros(geoms, np.bool_))


def terms(mechanism, mask, q, reach=4.0):
    rig = rig_of(mechanism, CAMERA)
    return edge_terms(
        mask, *plain(mechanism), rig.parent, rig.kind, rig.link, rig.first, rig.links[None],
        rig.points[None], rig.radius[None], rig.camera[None], np.empty(0), q, reach, 2.0,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["single", "double", "bob", "cartpole"])
@pytest.mark.parametrize("blur", [0.6, 1.5])
def test_edges_lie_on_the_outline_whatever_the_blur(name, blur):
    mechanism = load(name)
    q = np.linspace(-0.8, 0.5, len(mechanism.joints)) * np.where(mechanism.tree.kind == 1, 0.1, 1.0)
    _, _, facts = terms(mechanism, draw(mechanism, CAMERA, q, blur), q)
    assert facts[0] > 40
    assert facts[1] == 1.0
    # 8-bit masks and half-pixel sampling leave a few hundredths; blur takes more off near the corners
    assert facts[2] < 0.08 + 0.09 * blur


@pytest.mark.parametrize("name", ["double", "bob", "cartpole", "chain:3"])
def test_follow_finds_the_pose(name):
    mechanism = load(name)
    hinge = mechanism.tree.kind == 0
    truth = np.where(hinge, np.linspace(-0.9, 0.9, len(hinge)), 0.02)
    mask = draw(mechanism, CAMERA, truth)
    start = truth + np.where(hinge, 0.06, 0.01) * np.where(np.arange(len(hinge)) % 2, -1, 1)
    free = np.full(len(hinge), np.inf)
    q, information, facts = follow(
        mask, np.ones(mask.shape, np.float32),
        *plain(mechanism)[1:], *rig_of(mechanism, CAMERA), start, -free, free,
        np.ones(len(hinge)), REACHES, 2.0,
    )  # fmt: skip
    # a few hundredths of a pixel over links of 30 to 60 px
    np.testing.assert_allclose(q, truth, atol=2e-3)
    assert np.all(np.linalg.eigvalsh(information) > 0)
    assert facts[3] > 0.95


def test_follow_keeps_within_its_limits():
    mechanism = load("single")
    mask = draw(mechanism, CAMERA, np.array([0.3]))
    q, _, _ = follow(
        mask, np.ones(mask.shape, np.float32),
        *plain(mechanism)[1:], *rig_of(mechanism, CAMERA), np.array([0.2]),
        np.array([0.0]), np.array([0.25]), np.ones(1), REACHES, 2.0,
    )  # fmt: skip
    assert q[0] == 0.25


def test_gradient_is_the_derivative_of_the_residuals():
    """Half the sum of squared displacements falls along the right side of the normal equations."""
    mechanism = load("double")
    truth = np.array([-0.4, 0.5])
    mask = draw(mechanism, CAMERA, truth)
    near = truth + np.array([0.01, -0.008])
    normal, right, _ = terms(mechanism, mask, near)
    np.testing.assert_allclose(normal, normal.T, atol=1e-9 * normal.max())
    # one Gauss-Newton step from 0.01 rad away lands within the drawing's own error
    np.testing.assert_allclose(near + np.linalg.solve(normal, right), truth, atol=2e-3)


def test_edges_hidden_by_another_body_do_not_count():
    mechanism = load("double")
    folded = np.array([0.4, np.pi - 0.05])
    _, _, folded_facts = terms(mechanism, draw(mechanism, CAMERA, folded), folded)
    open_ = np.array([0.4, 1.5])
    _, _, open_facts = terms(mechanism, draw(mechanism, CAMERA, open_), open_)
    assert folded_facts[0] < 0.75 * open_facts[0]
    assert folded_facts[2] < 0.15


def test_pixels_that_are_not_trusted_say_nothing():
    mechanism = load("single")
    q = np.array([-0.5])
    mask = draw(mechanism, CAMERA, q)
    rig = rig_of(mechanism, CAMERA)
    blind = plain(mechanism)._replace(trust=np.zeros(mask.shape, np.float32))
    _, information, facts = follow(
        mask,
        *blind,
        *rig,
        q,
        np.full(1, -9.0),
        np.full(1, 9.0),
        np.ones(1),
        REACHES,
        2.0,
    )
    assert facts[0] == 0
    assert information[0, 0] == 0.0


def test_refine_recovers_camera_and_size_ratios():
    start = load("double")
    true = start.with_values(
        {"link1.length": 0.23, "link1.width": 0.036, "link2.length": 0.16, "link2.width": 0.027}
    )
    camera = Camera(320, 240, 300.0, x=0.02, y=-0.03, depth=0.95)
    rng = np.random.default_rng(2)
    poses = np.column_stack([rng.uniform(-2.5, -0.5, 10), rng.uniform(-1.5, 1.5, 10)])
    masks = [draw(true, camera, q) for q in poses]
    names = [
        "link1.length",
        "link1.width",
        "link1.tail",
        "link1.tip",
        "link2.length",
        "link2.width",
        "link2.tail",
    ]
    bundle = refine(
        masks, plain(true), start,
        Camera(320, 240, 300.0, x=0.03, y=-0.02, depth=0.9),
        poses + rng.normal(scale=0.05, size=poses.shape), [*names, "camera.x", "camera.y", "camera.depth"],
        start.values, reaches=(8, 7, 6, 5, 4, 4, 4, 4, 4, 4), spacing=2.0,
    )  # fmt: skip
    found, wanted = bundle.mechanism.values, true.values
    scale = wanted["link1.length"] / found["link1.length"]
    # 0.05 px on links of 70 and 50 px, and on widths of 10 px
    assert found["link2.length"] * scale == pytest.approx(0.16, rel=2e-3)
    assert found["link1.width"] * scale == pytest.approx(0.036, rel=0.01)
    assert found["link2.width"] * scale == pytest.approx(0.027, rel=0.015)
    assert bundle.camera.x * scale == pytest.approx(0.02, abs=3e-4)
    assert bundle.camera.y * scale == pytest.approx(-0.03, abs=3e-4)
    measured = size_information(bundle, scale_free=True)
    assert measured.names == tuple(names)
    information = measured.information
    # what is left of the common scale; the links' ratio to 0.2 px on 70 and 50 px each
    assert np.abs(information @ np.ones(len(names))).max() < 1e-6 * np.trace(information)
    ratio = np.zeros(len(names))
    ratio[[0, 4]] = 1.0, -1.0
    assert np.sqrt(ratio @ np.linalg.pinv(information) @ ratio) == pytest.approx(5e-3, rel=0.3)
