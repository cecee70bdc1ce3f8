"""Edges of a picture in which the outline moves while it is exposed."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.vision.drawing.blurred import covered_part, times_of
from monodyn.vision.drawing.edges import BEHIND, NEAR, SAMPLES, SQUARES, TRUST, edge_terms, no_shifts
from monodyn.vision.drawing.follow import EdgeSearch, MoveLimits, follow
from monodyn.vision.drawing.probe import Normal
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.shutter import Shutter
from monodyn.vision.locating.bundle import KeyMasks, refine
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.variables import scene_variables
from pictures import CAMERA, exposed_mask, stacked_mask, stacked_view, trusted

SEARCH = EdgeSearch(np.array([8.0, 6.0, 5.0, 4.0, 4.0, 4.0]), 3.0)


@pytest.mark.parametrize("name", ["single", "double", "bob"])
@pytest.mark.parametrize("turn", [0.05, 0.2, -0.35])
def test_the_middle_of_the_motion_is_found(name: str, turn: float) -> None:
    mechanism = load(name)
    q = np.array([-1.1, 0.6])[: len(mechanism.joints)]
    sweep = np.array([turn, 0.8 * turn])[: len(q)]
    # an acceleration that changes the rate by a third in the exposure
    bend = sweep / 24.0
    mask = exposed_mask(mechanism, CAMERA, q, sweep=sweep, bend=bend)
    rig = rig_of(mechanism, CAMERA)._replace(sweep=sweep, bend=bend)
    limits = MoveLimits(q - 1.0, q + 1.0, np.full(len(q), 1.0))
    found, _, agreement = follow(mask, trusted(mechanism), rig, q + 0.02, limits, SEARCH)
    # what sharp pictures reach, or a hundredth of the blur: a curved path is taken for a parabola
    assert np.abs(found - q).max() < max(np.radians(0.07), np.abs(sweep).sum() / 100.0)
    assert agreement.matched > 0.9
    assert agreement.inside > 0.9


def test_sizes_come_from_blurred_pictures() -> None:
    """No picture is sharp: the rod is blurred over many times its width, but for what is near the pivot."""
    mechanism = load("bob")
    turns = np.array([0.1, 0.15, -0.2, 0.3, -0.3, 0.2])
    q = np.linspace(-2.3, -0.6, len(turns))[:, None]
    planes = [exposed_mask(mechanism, CAMERA, p, sweep=t) for p, t in zip(q, turns, strict=True)]
    rates = turns[:, None] / 0.05
    shutter = Shutter(0.05, 0.0, 0.0, q, rates, 0.0 * rates)
    masks = KeyMasks(planes, trusted(mechanism), shutter=shutter)
    sizes = {name: mechanism.values[name] for name in ("link1.width", "link1.sphere.width")}
    start = mechanism.with_values({name: 1.1 * size for name, size in sizes.items()})
    guess = SceneGuess(start, CAMERA, q + 0.01, np.zeros(len(q)))
    variables = scene_variables(start, list(sizes))
    found = refine(masks, guess, variables, SEARCH, settle=20).mechanism
    for name, size in sizes.items():
        assert found.values[name] == pytest.approx(size, rel=0.02)


def test_a_link_before_another_shows_its_edges_in_a_blurred_picture() -> None:
    """The second link lies on the first, each in a plane of its own; both turn about the first hinge."""
    mechanism, q, sweep = load("double"), np.array([0.4, np.pi - 0.05]), np.array([0.08, 0.0])
    times = (np.arange(15) + 0.5) / 15 - 0.5
    planes = np.mean([stacked_mask(mechanism, CAMERA, q + t * sweep) for t in times], axis=0)
    rates = sweep / 0.05
    shutter = Shutter(0.05, 0.0, 0.0, q[None], rates[None], 0.0 * rates[None])
    rig = shutter.of(rig_of(mechanism, CAMERA), 0)
    mask, links = planes.round().astype(np.uint8), []
    for known in (True, False):
        found = edge_terms(mask, stacked_view(known=known), rig, no_shifts(rig), q, 4.0, 2.0)
        links.append(found.agreement.links)
    assert links[0][1, BEHIND] == 0
    for link in links[0]:
        assert link[NEAR] == pytest.approx(link[TRUST])
        assert np.sqrt(link[SQUARES] / link[NEAR]) < 0.15
    assert links[1][1, BEHIND] > links[1][1, SAMPLES]
    assert links[0][0, BEHIND] > links[1][0, BEHIND]


def test_light_makes_no_difference_between_slow_and_fast() -> None:
    """A rod that stands out more than its colour by a fifth: half covered no pixel would tell."""
    mechanism = load("bob").with_values({"link1.width": 8.0 * CAMERA.depth / CAMERA.focal})
    q = np.linspace(-2.3, -0.6, 6)[:, None]
    start = SceneGuess(mechanism, CAMERA, q, np.zeros(len(q)))
    widths = []
    for turn in (0.02, 0.2):
        turns = turn * np.array([1.0, 1.1, -1.2, 1.3, -1.3, 1.2])
        drawn = [exposed_mask(mechanism, CAMERA, p, sweep=t) for p, t in zip(q, turns, strict=True)]
        planes = [(1.2 * plane).round().astype(np.uint8) for plane in drawn]
        shutter = Shutter(0.05, 0.0, 0.0, q, turns[:, None] / 0.05, 0.0 * q)
        masks = KeyMasks(planes, trusted(mechanism), shutter=shutter)
        variables = scene_variables(mechanism, ["link1.width"])
        found = refine(masks, start, variables, SEARCH, settle=20).mechanism
        widths.append(found.values["link1.width"])
    assert widths[1] == pytest.approx(widths[0], rel=0.03)


def test_what_a_picture_knows_of_a_pose_falls_with_the_blur() -> None:
    mechanism, q = load("bob"), np.array([-1.1])
    known = []
    for turn in (0.0, 0.15, 0.3):
        rig = rig_of(mechanism, CAMERA)._replace(sweep=np.array([turn]))
        mask = exposed_mask(mechanism, CAMERA, q, sweep=turn)
        known.append(edge_terms(mask, trusted(mechanism), rig, no_shifts(rig), q, 4.0, 3.0).normal[0, 0])
    assert known[0] > 1.5 * known[1] > 2.0 * known[2] > 0.0


def test_how_much_of_a_normal_a_moving_square_covers() -> None:
    """A square of 4 px that moves along the normal, then across it until it is beyond."""
    px = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    # the hull turns so that (dy, -dx) of an edge points outwards
    hull = np.arange(4)
    at = Normal(4.0, 2.0, 1.0, 0.0)
    along = (-3.0, 0.0, 3.0, 0.0)
    for time in (-0.5, -0.1, 0.0, 0.4):
        low, high = covered_part(px, hull, 0, 4, at, along, time)
        assert (low, high) == pytest.approx((-4.0 + 6.0 * time, 6.0 * time), abs=1e-12)
    across = (0.0, -3.0, 0.0, 3.0)
    ends = [covered_part(px, hull, 0, 4, at, across, time) for time in (-0.4, 0.0, 0.4)]
    covered = [high - low for low, high in ends]
    assert covered[1] == pytest.approx(4.0)
    assert max(covered[0], covered[2]) < 0.0
    assert [times_of(path) for path in (along, (0.0, 0.0, 90.0, 0.0), (0.0, 0.0, 0.5, 0.0))] == [6, 32, 4]
