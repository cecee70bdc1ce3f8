"""Sub-pixel edges and their derivatives, on drawn masks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models import mjcf, read
from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.tree import SLIDE
from monodyn.vision.drawing.camera import X
from monodyn.vision.drawing.edges import (
    BEHIND,
    NEAR,
    SAMPLES,
    SQUARES,
    TRUST,
    Agreement,
    Shifts,
    edge_terms,
    no_shifts,
    robust_weight,
)
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.foreground.coverage import CHANGED_LEVEL
from pictures import CAMERA, drawn_mask, stacked_mask, stacked_view, trusted


def terms(mechanism: Mechanism, mask: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, Agreement]:
    rig = rig_of(mechanism, CAMERA)
    return edge_terms(mask, trusted(mechanism), rig, no_shifts(rig), q, 4.0, 2.0)


@pytest.mark.parametrize("name", ["single", "double", "bob", "cartpole"])
@pytest.mark.parametrize("blur", [0.6, 1.5])
def test_edges_lie_on_the_outline_whatever_the_blur(name: str, blur: float) -> None:
    mechanism = load(name)
    q = np.linspace(-0.8, 0.5, len(mechanism.joints)) * np.where(mechanism.tree.kind == SLIDE, 0.1, 1.0)
    _, _, agreement = terms(mechanism, drawn_mask(mechanism, CAMERA, q, blur), q)
    assert agreement.samples > 40
    assert agreement.matched == 1.0
    # 8-bit masks and half-pixel sampling leave a few hundredths; blur takes more off near the corners
    assert agreement.rms_px < 0.08 + 0.09 * blur


def test_gradient_is_the_derivative_of_the_residuals() -> None:
    """Half the sum of squared displacements falls along the right side of the normal equations."""
    mechanism = load("double")
    truth = np.array([-0.4, 0.5])
    mask = drawn_mask(mechanism, CAMERA, truth)
    near = truth + np.array([0.01, -0.008])
    normal, right, _ = terms(mechanism, mask, near)
    np.testing.assert_allclose(normal, normal.T, atol=1e-9 * normal.max())
    # one Gauss-Newton step from 0.01 rad away lands within the drawing's own error
    np.testing.assert_allclose(near + np.linalg.solve(normal, right), truth, atol=2e-3)


def test_edges_hidden_by_another_body_do_not_count() -> None:
    mechanism = load("double")
    folded = np.array([0.4, np.pi - 0.05])
    _, _, hidden = terms(mechanism, drawn_mask(mechanism, CAMERA, folded), folded)
    open_ = np.array([0.4, 1.5])
    _, _, shown = terms(mechanism, drawn_mask(mechanism, CAMERA, open_), open_)
    assert hidden.samples < 0.75 * shown.samples
    assert hidden.rms_px < 0.15


@pytest.mark.parametrize("elbow", [np.pi, np.pi - 0.05, -3.0])
def test_a_geom_in_front_of_another_shows_all_of_its_edges(elbow: float) -> None:
    """The second link lies on the first, in a colour of its own."""
    mechanism, rig = load("double"), rig_of(load("double"), CAMERA)
    folded = np.array([0.4, elbow])
    mask, near = stacked_mask(mechanism, CAMERA, folded), folded + np.array([0.005, -0.01])
    off, links = [], []
    for known in (True, False):
        view = stacked_view(known=known)
        normal, right, found = edge_terms(mask, view, rig, no_shifts(rig), near, 4.0, 2.0)
        off.append(np.abs(near + np.linalg.solve(normal + 1e-6 * np.eye(2), right) - folded).max())
        links.append(found.links)
    assert off[0] < 1e-3
    assert links[0][1, BEHIND] == 0
    # without the order they count as covered, and the first link's as if it were not
    assert links[1][1, BEHIND] > 0.5 * links[0][1, SAMPLES]
    assert links[0][0, BEHIND] > links[1][0, BEHIND]
    assert off[1] > 2.0 * off[0]


def test_a_geom_that_shows_where_another_should_cover_it_keeps_its_edges() -> None:
    """The second link is not there, and is looked for on the first."""
    mechanism, rig = load("double"), rig_of(load("double"), CAMERA)
    q = np.array([0.4, np.pi - 0.05])
    alone = stacked_mask(mechanism, CAMERA, np.array([0.4, 1.5]))
    alone[1] = 0
    with_order, without = (
        edge_terms(alone, stacked_view(known=known), rig, no_shifts(rig), q, 4.0, 2.0).agreement.links[0]
        for known in (True, False)
    )
    np.testing.assert_array_equal(with_order, without)
    assert with_order[NEAR] > 0.8 * with_order[TRUST]


def test_in_the_plane_of_any_difference_a_geom_in_front_has_no_edge() -> None:
    """Nothing of the second link's colour is trusted; in the other plane the link behind shows as well."""
    mechanism, rig = load("double"), rig_of(load("double"), CAMERA)
    q = np.array([0.4, np.pi - 0.02])
    planes = stacked_mask(mechanism, CAMERA, q)
    mask, view = np.concatenate((planes, planes.max(axis=0, keepdims=True))), stacked_view()
    trust = np.stack([view.trust[0], 0.0 * view.trust[0], view.trust[0]])
    found = edge_terms(mask, view._replace(trust=trust, border=2), rig, no_shifts(rig), q, 4.0, 2.0)
    link = found.agreement.links[1]
    assert link[BEHIND] > link[SAMPLES] > 0
    assert np.sqrt(link[SQUARES] / link[NEAR]) < 0.2
    assert link[NEAR] == pytest.approx(link[TRUST])


def test_derivatives_by_shared_parameters_against_finite_differences() -> None:
    """The rows of the normal equations hold the outline's motion by pose and by size: they agree where a
    size moves the outline as a joint does."""
    mechanism = load("cartpole")
    q = np.array([0.03, 0.4])
    mask = drawn_mask(mechanism, CAMERA, q)
    rig, step = rig_of(mechanism, CAMERA), 1e-6
    camera = rig.camera.copy()
    camera[X] -= step
    shifts = Shifts(rig.links[None], rig.points[None], rig.radius[None], camera[None], np.array([step]))
    normal, right, _ = edge_terms(mask, trusted(mechanism), rig, shifts, q, 4.0, 2.0)
    # the cart slides to the right as the camera goes to the left
    np.testing.assert_allclose(normal[2], normal[0], rtol=1e-6, atol=1e-6 * normal.max())
    assert right[2] == pytest.approx(right[0], rel=1e-5, abs=1e-6 * abs(right).max())


def test_a_shaded_geom_is_taken_against_its_own_level() -> None:
    """At 70 % of its colour all around, an edge against full coverage seems to lie 30 % of the search length
    too far inside."""
    mechanism = load("single")
    q = np.array([-0.5])
    mask = (0.7 * drawn_mask(mechanism, CAMERA, q)).astype(np.uint8)
    rig, view = rig_of(mechanism, CAMERA), trusted(mechanism)
    _, _, plain = edge_terms(mask, view, rig, no_shifts(rig), q, 4.0, 2.0)
    shaded = view._replace(shaded=np.ones_like(view.shaded))
    _, _, own = edge_terms(mask, shaded, rig, no_shifts(rig), q, 4.0, 2.0)
    assert plain.rms_px > 1.0
    assert own.rms_px < 0.2


def test_a_pose_that_cannot_be_drawn_has_no_samples() -> None:
    mechanism = load("single")
    rig = rig_of(mechanism, replace(CAMERA, depth=-1.0))
    mask = np.zeros((1, CAMERA.height, CAMERA.width), np.uint8)
    normal, right, agreement = edge_terms(
        mask, trusted(mechanism), rig, no_shifts(rig), np.zeros(1), 4.0, 2.0
    )
    assert agreement[:4] == (0, 0.0, 0.0, 0.0)
    assert not normal.any()
    assert not right.any()


def test_the_robust_weight_falls_to_a_quarter() -> None:
    assert robust_weight(0.0, 2.0) == 1.0
    assert robust_weight(2.0, 2.0) == pytest.approx(0.25)


def test_where_a_geom_looks_like_the_background_its_border_is_an_edge() -> None:
    """The geom's own plane is not trusted; a thin line along one of its long edges is all that differs."""
    mechanism = load("single")
    q = np.array([-0.5])
    whole = drawn_mask(mechanism, CAMERA, q, 0.01)[0]
    # what is left of the mask where it does not overlap with itself, moved by two pixels
    line = np.where(np.roll(whole, -2, axis=0) > 0, 0, whole)
    planes = np.stack([np.zeros_like(line), line])
    plain = trusted(mechanism)
    trust = np.concatenate([0.0 * plain.trust, plain.trust])
    rig = rig_of(mechanism, CAMERA)
    shown = plain._replace(trust=trust, border=1)
    normal, right, found = edge_terms(planes, shown, rig, no_shifts(rig), q, 4.0, 2.0)
    assert found.samples > 10
    assert found.matched > 0.9
    assert abs(float(np.linalg.solve(normal, right)[0])) < 0.01
    # a border that has just changed is an edge, what is fainter than that is none
    for share, some in ((2.0, True), (0.9, False)):
        faint = np.round(planes * (share * CHANGED_LEVEL)).astype(np.uint8)
        seen = edge_terms(faint, shown, rig, no_shifts(rig), q, 4.0, 2.0).agreement.samples
        assert (seen > 10) == some
    hidden = plain._replace(trust=trust)
    assert edge_terms(planes, hidden, rig, no_shifts(rig), q, 4.0, 2.0).agreement.samples == 0
    assert shown.least.max() == 0.0


def test_samples_that_another_geom_covers_are_counted() -> None:
    mechanism = load("double")
    counts = []
    for elbow in (np.pi, 0.9):
        q = np.array([-0.5, elbow])
        _, _, found = terms(mechanism, drawn_mask(mechanism, CAMERA, q), q)
        counts.append(found.links[1, [SAMPLES, BEHIND]])
    # folded back the shorter link lies within the longer one; at an angle only its hinge does
    assert counts[0][1] > 3.0 * counts[0][0]
    assert counts[1][1] < counts[1][0]


def test_the_samples_of_an_edge_along_the_pixels_know_one_offset(tmp_path: Path) -> None:
    joint, box = '<joint type="slide" axis="1 0 0"/>', '<geom type="box" size="0.06 0.01 0.03"/>'
    cart = read(tmp_path, mjcf(f'<body name="cart">{joint}{box}</body>'))
    normal, _, agreement = terms(cart, drawn_mask(cart, CAMERA, np.zeros(1)), np.zeros(1))
    assert agreement.samples > 40
    # each of the two upright sides is worth about one sample, whose normal moves with the cart
    assert 1.8 < normal[0, 0] / (CAMERA.focal / CAMERA.depth) ** 2 < 2.0


def test_an_edge_along_the_pixels_shows_its_direction_as_any_other() -> None:
    single = load("single")

    def information(angle: float) -> float:
        return float(terms(single, drawn_mask(single, CAMERA, np.array([angle])), np.array([angle]))[0][0, 0])

    # of many samples at x from the hinge, sum x^2 is known across the pixels, and what is left of it without
    # the common offset, sum (x - mean)^2, along them: about a quarter
    assert 0.2 < information(0.0) / information(0.4) < 0.35
    assert information(0.4) == pytest.approx(information(0.7), rel=0.1)


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_a_shifted_mask_moves_the_pose_by_its_whole_shift(angle: float) -> None:
    single, truth = load("single"), np.array([angle + 0.004])
    normal, right, _ = terms(single, drawn_mask(single, CAMERA, truth), np.array([angle]))
    # what the samples have in common is taken out of both sides of the equations
    assert right[0] / normal[0, 0] == pytest.approx(0.004, rel=0.15)
