"""Whether a camera looks obliquely, and how, on drawn masks; what is not known then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import Camera, Poses
from monodyn.vision.drawing.camera import CAMERA_STD, around_origin, from_origin
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.locating import oblique
from monodyn.vision.locating.bundle import Bundle, KeyMasks, refine
from monodyn.vision.locating.doubt import doubt_of, edge_turns
from monodyn.vision.locating.oblique import Looking, from_other_sides, looking, open_turns, with_camera
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.variables import scene_variables
from pictures import drawn_mask, trusted
from support import slow

NAMES = ["link1.length", "link1.width", "link2.length", "link2.width", "camera.x", "camera.y", "camera.depth"]
OPEN = ["camera.pitch", "camera.yaw", "camera.focal"]
SEARCH = EdgeSearch(np.array([8.0, 6.0, 5.0, 4.0, 4.0, 4.0, 4.0, 4.0]), 2.0)


def squarely(yaw: float, away: float = 1.0, offset: float = 0.008) -> tuple[KeyMasks, Bundle]:
    """Refine a double pendulum before a camera as if it looked squarely, from ``away`` times as far."""
    double = load("double").with_values({"link2.offset": offset})
    # turned about the hinge, which stays where it is in the picture
    focal, depth = 400.0 * away, 0.95 * away
    camera = from_origin(Camera(400, 300, focal, x=0.02, y=-0.03, depth=depth, yaw=yaw))
    rng = np.random.default_rng(2)
    poses = np.column_stack([rng.uniform(-2.8, -0.3, 12), rng.uniform(-1.5, 1.5, 12)])
    masks = KeyMasks([drawn_mask(double, camera, q) for q in poses], trusted(double, camera))
    guess = SceneGuess(double, Camera(400, 300, focal, x=0.02, y=-0.03, depth=depth), poses, np.zeros(12))
    variables = replace(scene_variables(double, NAMES), focal=focal, about_origin=True)
    return masks, refine(masks, guess, variables, SEARCH)


def found(yaw: float, asked: tuple[str, ...] = (), *, exact: bool = False) -> Looking:
    """Refine a double pendulum before a camera as if it looked squarely, and find out."""
    masks, bundle = squarely(yaw)
    if exact:
        bundle = replace(bundle, rms_px=np.zeros(12), matched=np.ones(12))
    return looking(masks, bundle, OPEN, asked, SEARCH)


def test_no_picture_shows_the_roll_before_a_mechanism_on_one_hinge() -> None:
    assert open_turns(load("double"), {"camera.pitch"}) == ["camera.yaw", "camera.focal"]
    # the rail of a cart shows it
    turns = ["camera.roll", "camera.pitch", "camera.yaw"]
    assert open_turns(load("cartpole"), {"camera.focal"}) == turns


def test_a_square_camera_is_held_and_doubted() -> None:
    looks = found(0.0)
    assert looks.bundle.camera.yaw == 0.0
    assert "camera.yaw" not in looks.bundle.variables.names
    std = looks.camera_std(looks.bundle, scale_free=True)
    assert {"camera.yaw", "camera.pitch", "camera.focal"} < set(std)
    # before a square camera only the sides of the bodies show the focal length, within what is assumed of it
    assert 20.0 < std["camera.focal"] < 400.0 * CAMERA_STD["camera.focal"]
    assert 1e-3 < std["camera.yaw"] < CAMERA_STD["camera.yaw"]


def test_a_camera_that_is_hardly_turned_is_held_and_doubted_by_as_much() -> None:
    looks = found(0.004)
    assert looks.bundle.camera.yaw == 0.0
    assert looks.doubted.camera.yaw == pytest.approx(0.004, rel=0.1)
    assert looks.camera_std(looks.bundle, scale_free=True)["camera.yaw"] > 0.004
    # the sizes go with it
    assert np.abs(looks.off(looks.bundle)[looks.doubted.variables.is_size]).max() > 1e-5


def test_a_camera_turned_by_little_is_found() -> None:
    """By 0.5 deg: four standard deviations of what noise alone would do."""
    camera = found(0.008).bundle.camera
    assert camera.yaw == pytest.approx(0.008, abs=0.001)


@pytest.mark.parametrize("yaw", [slow(-0.35), 0.15])
def test_an_oblique_camera_is_found(yaw: float) -> None:
    looks = found(yaw)
    std = looks.camera_std(looks.bundle, scale_free=True)
    camera = looks.bundle.camera
    assert camera.yaw == pytest.approx(yaw, abs=0.02)
    assert abs(camera.yaw - yaw) < 4.0 * std["camera.yaw"]
    assert abs(camera.pitch) < 4.0 * std["camera.pitch"]
    values = looks.bundle.mechanism.values
    # 0.05 px on links of 80 px
    ratio = load("double").values["link2.length"] / load("double").values["link1.length"]
    assert values["link2.length"] / values["link1.length"] == pytest.approx(ratio, rel=3e-3)
    assert looks.known(looks.bundle) is looks.bundle
    assert not looks.off(looks.bundle).any()


def test_a_camera_far_aside_is_found() -> None:
    """The ends of the links, which show it, are far from where a square camera would see them."""
    assert found(0.7).bundle.camera.yaw == pytest.approx(0.7, abs=0.03)


def test_focal_length_and_turns_settle_together() -> None:
    """Distance, focal length and yaw change the pictures almost alike: steps that are held back as those of
    the search end on the way to where the edges lie."""
    masks, bundle = squarely(-0.12)
    near = around_origin(bundle.camera)
    wrong = from_origin(replace(near, focal=1.4 * near.focal, depth=1.4 * near.depth))
    every = replace(with_camera(bundle.variables, bundle.mechanism, OPEN), focal=wrong.focal)
    guess = SceneGuess(bundle.mechanism, wrong, bundle.positions, np.zeros(12))
    assert refine(masks, guess, every, SEARCH).camera.focal > 1.2 * 400.0
    settled = refine(masks, guess, every, SEARCH, settle=10)
    assert settled.camera.focal == pytest.approx(400.0, rel=0.05)
    assert settled.camera.yaw == pytest.approx(-0.12, abs=0.01)


@pytest.mark.slow
def test_a_camera_on_the_other_side_is_found() -> None:
    """As if the first steps had led to the wrong side; what is right is kept as it is."""
    masks, bundle = squarely(0.35)
    looks = looking(masks, bundle, OPEN, (), SEARCH)
    good = looks.bundle
    assert looks.bundle.alternatives == ()
    assert from_other_sides(masks, bundle, good, SEARCH) == (good, [])
    camera = from_origin(replace(around_origin(bundle.camera), yaw=-0.3))
    wrong = replace(good, camera=camera, rms_px=np.full(12, 2.0))
    assert from_other_sides(masks, bundle, wrong, SEARCH)[0].camera.yaw == pytest.approx(0.35, abs=0.02)
    # where the camera stands is given
    given = replace(wrong, variables=replace(wrong.variables, about_origin=False))
    assert from_other_sides(masks, bundle, given, SEARCH) == (given, [])


def test_a_camera_far_away_looks_the_same_from_either_side() -> None:
    """Without perspective a plane turned to the left is foreshortened as one turned to the right."""
    masks, bundle = squarely(0.35, away=400.0, offset=0.0)
    aside = from_origin(replace(around_origin(bundle.camera), yaw=0.3))
    guess = SceneGuess(bundle.mechanism, aside, bundle.positions, np.zeros(12))
    every = with_camera(bundle.variables, bundle.mechanism, ["camera.pitch", "camera.yaw"])
    good = refine(masks, guess, every, SEARCH)
    assert good.camera.yaw == pytest.approx(0.35, abs=0.02)
    best, (other,) = from_other_sides(masks, bundle, good, SEARCH)
    assert best is good
    assert other.camera.yaw == pytest.approx(-good.camera.yaw, abs=0.02)
    # either side is within the intervals
    bundle = replace(bundle, variables=replace(bundle.variables, about_origin=True))
    looks = looking(masks, bundle, ["camera.pitch", "camera.yaw"], ("camera.yaw",), SEARCH)
    (way,) = looks.bundle.alternatives
    assert way["camera.yaw"] == pytest.approx(-2.0 * looks.bundle.camera.yaw * 0.5**0.5, rel=0.1)


def test_of_two_sides_that_look_alike_the_more_usual_camera_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """A telephoto on the wrong side whose edges are nearer by what is systematic in them; where they are much
    nearer it is taken."""
    masks, bundle = squarely(0.1)
    right = replace(looking(masks, bundle, OPEN, (), SEARCH).bundle, rms_px=np.full(12, 0.2))
    far = from_origin(replace(around_origin(right.camera), focal=1600.0, depth=3.8, yaw=-0.2))
    for nearer, taken in ((1.005, right.camera.yaw), (2.0, far.yaw)):
        wrong = replace(right, camera=far, rms_px=right.rms_px / nearer)
        monkeypatch.setattr(oblique, "_refined", lambda *given: right)
        best, others = from_other_sides(masks, bundle, wrong, SEARCH)
        assert best.camera.yaw == taken
        # what the pictures do not exclude is kept
        assert (len(others) == 1) == (nearer < 1.1)


def test_turns_that_bring_no_edge_nearer_are_not_believed() -> None:
    """As if all edges had been met already before a camera that looks squarely."""
    looks = found(0.15, exact=True)
    assert looks.bundle.camera.yaw == 0.0
    assert looks.doubted.camera.yaw != 0.0


def test_turns_that_leave_most_of_the_residuals_may_as_well_be_none() -> None:
    """A mechanism that sways by a third of a pixel: what it does is not in the noise of its edges."""
    double, rng = load("double"), np.random.default_rng(5)
    square = Camera(400, 300, 400.0, x=0.02, y=-0.03, depth=0.95)
    poses = np.column_stack([rng.uniform(-2.8, -0.3, 12), rng.uniform(-1.5, 1.5, 12)])
    variables = replace(scene_variables(double, NAMES), focal=400.0, about_origin=True)
    guess = SceneGuess(double, square, poses, np.zeros(12))
    for yaw, undecided in ((0.02, True), (0.15, False)):
        turned = from_origin(replace(square, yaw=yaw))
        sways = rng.normal(0.0, 0.35 * square.depth / square.focal, (12, 2))
        masks = KeyMasks(
            [
                drawn_mask(double, replace(turned, x=turned.x + x, y=turned.y + y), q)
                for q, (x, y) in zip(poses, sways, strict=True)
            ],
            trusted(double, turned),
        )
        looks = looking(masks, refine(masks, guess, variables, SEARCH), OPEN, (), SEARCH)
        found_yaw = looks.bundle.camera.yaw
        std = looks.camera_std(looks.bundle, scale_free=True)["camera.yaw"]
        assert abs(found_yaw - yaw) < 4.0 * std
        assert bool(looks.bundle.alternatives) == undecided
        # a camera that looks squarely is within the interval, too
        assert (abs(found_yaw) < 2.0 * std) == undecided


def test_a_roll_shows_by_itself() -> None:
    """What it takes away is no reason to turn the camera otherwise."""
    cart, rng = load("cartpole"), np.random.default_rng(2)
    camera = Camera(400, 300, 400.0, depth=1.6)
    poses = np.column_stack([rng.uniform(-0.2, 0.2, 12), rng.uniform(-2.4, -0.7, 12)])
    rolled = from_origin(replace(camera, roll=0.05))
    masks = KeyMasks([drawn_mask(cart, rolled, q) for q in poses], trusted(cart, rolled))
    names = [p.name for p in cart.parameters if p.kind in ("length", "width")]
    variables = scene_variables(cart, [*names, "camera.y", "camera.depth"])
    variables = replace(variables, focal=400.0, about_origin=True)
    bundle = refine(masks, SceneGuess(cart, camera, poses, np.zeros(12)), variables, SEARCH)
    looks = looking(masks, bundle, ["camera.roll", *OPEN], (), SEARCH)
    assert looks.bundle.camera.roll == pytest.approx(0.05, abs=2e-3)
    assert "camera.roll" in looks.bundle.variables.names
    assert looks.bundle.camera.yaw == looks.bundle.camera.pitch == 0.0


def test_what_the_user_asks_for_is_estimated_in_any_case() -> None:
    looks = found(0.0, ("camera.yaw",))
    assert "camera.yaw" in looks.bundle.variables.names
    assert looks.bundle.camera.yaw != 0.0


def test_nothing_open_is_nothing_found() -> None:
    looks = found(0.0)
    masks = KeyMasks([], trusted(load("double")))
    assert looking(masks, looks.bundle, [], [], SEARCH).bundle.variables is looks.bundle.variables


def test_the_place_before_the_camera_is_undone() -> None:
    camera = Camera(64, 48, 50.0, x=0.1, y=-0.2, depth=1.5, roll=0.1, pitch=0.2, yaw=-0.3)
    there = from_origin(around_origin(camera))
    assert (there.x, there.y, there.depth) == pytest.approx((camera.x, camera.y, camera.depth))
    square = Camera(64, 48, 50.0, x=0.1, y=-0.2, depth=1.5)
    assert around_origin(square) == square


def test_doubt_moves_all_poses_by_what_the_camera_may_be_wrong() -> None:
    """The angles of an outline that a turned camera would see differ by what is stated."""
    looks = found(0.0)
    doubt = doubt_of(looks.bundle, looks.known(looks.bundle), looks.off(looks.bundle), 2.0, scale_free=True)
    positions = looks.bundle.positions
    frames = len(positions)
    poses = Poses(
        ("joint1", "joint2"), np.arange(frames), np.arange(frames) / 30.0, positions,
        np.tile(1e-6 * np.eye(2), (frames, 1, 1)), np.ones(frames, bool), metric=False,
    )  # fmt: skip
    shifts = doubt.with_shifts(poses, np.zeros(2, bool)).shifts
    assert shifts is not None
    std = np.degrees(np.sqrt(np.sum(shifts**2, axis=0)))
    # links of 80 px, edges off by 0.2 px everywhere: 0.1 to 0.3 deg, and never nothing
    assert 0.02 < std.min() < std.max() < 1.0
    unseen = replace(poses, position=np.where(np.arange(frames)[:, None] == 3, np.nan, positions))
    again = doubt.with_shifts(unseen, np.zeros(2, bool)).shifts
    assert again is not None
    assert not again[:, 3].any()
    np.testing.assert_allclose(np.delete(again, 3, axis=1), np.delete(shifts, 3, axis=1))


def test_edges_that_are_off_turn_one_link_each(tmp_path) -> None:
    """Of links on one another, with a slide between two of them and a hinge the other way round."""
    geom = '<geom type="box" size=".1 .01 .01" pos=".1 0 0"/>'
    joints = (
        '<joint name="a" axis="0 -1 0"/>', '<joint name="b" axis="0 1 0"/>',
        '<joint name="s" type="slide" axis="1 0 0"/>', '<joint name="c" axis="0 -1 0"/>',
    )  # fmt: skip
    text = ""
    for name, joint in reversed(list(zip("abdc", joints, strict=True))):
        place = "" if name == "a" else ' pos=".2 0 0"'
        text = f'<body name="{name}"{place}>{joint}{geom}{text}</body>'
    (tmp_path / "chain.xml").write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    mechanism = load(tmp_path / "chain.xml")
    names, signs = [j.name for j in mechanism.joints], np.array([j.sign for j in mechanism.joints])
    assert names == ["a", "b", "s", "c"]
    position = np.random.default_rng(0).uniform(-2.0, 2.0, (9, 4))
    moved = edge_turns(mechanism, 1e-3).at(position)
    assert not moved[:, :, 2].any()
    turned = np.cumsum(moved * np.where(np.array(names) == "s", 0.0, signs), axis=2)[:, :, [0, 1, 3]]
    # each direction turns one link alone, the three in turn by five waves each
    several = np.abs(turned).max(axis=1) > 1e-12
    np.testing.assert_array_equal(several, np.repeat(np.eye(3, dtype=bool), 5, axis=0))
    # both ends are off: by the root of two over the length
    np.testing.assert_allclose(np.sum(turned**2, axis=0), 2.0 * (1e-3 / 0.2) ** 2)


def test_what_hides_a_joint_leaves_the_doubt_of_the_others() -> None:
    looks = found(0.0)
    doubt = doubt_of(looks.bundle, looks.known(looks.bundle), looks.off(looks.bundle), 2.0, scale_free=True)
    # a slow swing, in which a hidden link is about where it was in the frames around
    swing = np.linspace(0.0, 1.0, 12)
    positions = np.column_stack([swing - 2.0, 0.5 - swing])
    poses = Poses(
        ("joint1", "joint2"), np.arange(12), np.arange(12) / 30.0, positions,
        np.tile(1e-6 * np.eye(2), (12, 1, 1)), np.ones(12, bool), metric=False,
    )  # fmt: skip
    whole = doubt.with_shifts(poses, np.zeros(2, bool)).shifts
    gaps = positions.copy()
    gaps[[0, 5, 6], 1] = np.nan
    some = doubt.with_shifts(replace(poses, position=gaps), np.zeros(2, bool)).shifts
    gaps[:, 1] = np.nan
    never = doubt.with_shifts(replace(poses, position=gaps), np.zeros(2, bool)).shifts
    assert whole is not None
    assert some is not None
    assert never is not None
    assert not some[:, [0, 5, 6], 1].any()
    np.testing.assert_allclose(some[:, 5:7], whole[:, 5:7] * [1.0, 0.0], atol=1e-9)
    # beyond the ends it is taken to be as in the nearest frame
    np.testing.assert_allclose(some[:, 0, 0], whole[:, 0, 0], rtol=0.2, atol=1e-3)
    assert np.sqrt(np.sum(never[:, :, 0] ** 2, axis=0)).min() > 1e-4
    assert not never[:, :, 1].any()
