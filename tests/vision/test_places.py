"""A geom that the file puts onto another part, and that stands elsewhere in the pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from monodyn.mechanism import Mechanism, load
from monodyn.types import Camera
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.foreground.masks import LEFT_OUT
from monodyn.vision.locating.bundle import Bundle, KeyMasks, refine
from monodyn.vision.locating.places import with_departed, with_names, without_names, without_unseen
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.thin import LEAST_WIDTH_PX
from monodyn.vision.locating.variables import SceneVariables, scene_variables
from pictures import drawn_mask, trusted

CAMERA = Camera(320, 240, 300.0, x=0.02, y=-0.03, depth=0.95)
SEARCH = EdgeSearch(np.array([8.0, 7.0, 6.0, 5.0, 4.0, 4.0, 4.0, 4.0]), 2.0)


def hammer(folder: Path, aside: float) -> Mechanism:
    """Return a rod with a head across its end."""
    (folder / "hammer.xml").write_text(
        '<mujoco><worldbody><body name="a"><joint name="j" axis="0 -1 0"/>'
        '<geom type="box" size=".12 .003 .015" pos=".12 0 0"/>'
        f'<geom name="head" type="box" size=".02 .003 .05" pos=".24 0 {aside}"/></body></worldbody></mujoco>'
    )
    return load(folder / "hammer.xml")


def refined(true: Mechanism, start: Mechanism) -> tuple[KeyMasks, Bundle, SceneVariables]:
    rng = np.random.default_rng(4)
    poses = rng.uniform(-2.5, -0.5, (10, 1))
    masks = KeyMasks([drawn_mask(true, CAMERA, q) for q in poses], trusted(true))
    names = [p.name for p in start.parameters if p.free and p.kind not in ("thickness", "damping")]
    variables = scene_variables(start, [*names, "camera.x", "camera.y", "camera.depth"])
    guess = SceneGuess(start, CAMERA, poses, np.zeros(10))
    return masks, refine(masks, guess, variables, SEARCH), variables


def test_a_head_that_is_not_centred_is_freed(tmp_path: Path) -> None:
    true, start = hammer(tmp_path, 0.012), hammer(tmp_path, 0.0)
    assert start.parameter("a.head.across").follows
    masks, bundle, variables = refined(true, start)
    freed, more = with_departed(masks, bundle, variables, SEARCH)
    assert set(more.names) - set(variables.names) == {"a.head.across"}
    values = freed.mechanism.values
    # 0.1 px on a link of 75 px
    assert values["a.head.across"] / values["a.length"] == pytest.approx(0.012 / 0.24, abs=2e-3)
    assert not freed.mechanism.parameter("a.head.across").follows


def test_variables_go_as_they_came(tmp_path: Path) -> None:
    start = hammer(tmp_path, 0.0)
    variables = scene_variables(start, ["a.length", "a.width", "camera.x", "camera.depth"])
    freed = start.with_following(["a.head.across"], follow=False)
    more = with_names(variables, freed, ["a.head.across"])
    back = without_names(more, ["a.head.across"])
    assert back.names == variables.names
    assert np.array_equal(back.read(start, CAMERA), variables.read(start, CAMERA))
    assert back.is_size.tolist() == variables.is_size.tolist()
    assert len(back.creeps) == len(back.against) == 4
    assert without_names(variables, []).names == variables.names


def test_a_head_where_the_file_has_it_stays_there(tmp_path: Path) -> None:
    true = hammer(tmp_path, 0.0)
    masks, bundle, variables = refined(true, true)
    assert with_departed(masks, bundle, variables, SEARCH) == (bundle, variables)


def test_a_departure_by_which_the_edges_agree_no_better_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    masks, bundle, variables = refined(hammer(tmp_path, 0.012), hammer(tmp_path, 0.0))
    # more than any outline can gain
    monkeypatch.setattr("monodyn.vision.locating.places.MORE_AGREE", 1.0)
    assert with_departed(masks, bundle, variables, SEARCH) == (bundle, variables)


def test_masks_without_an_edge_move_nothing(tmp_path: Path) -> None:
    start = hammer(tmp_path, 0.0)
    poses = np.linspace(-2.5, -0.5, 4)[:, None]
    # the mechanism is far outside of the picture
    away = Camera(320, 240, 300.0, x=9.0, y=0.0, depth=0.95)
    masks = KeyMasks([drawn_mask(start, away, q) for q in poses], trusted(start))
    names = [p.name for p in start.parameters if p.free and p.kind not in ("thickness", "damping")]
    # no spring holds the camera: nothing at all is known of it
    variables = scene_variables(start, [*names, "camera.x", "camera.y", "camera.depth"])
    bundle = refine(masks, SceneGuess(start, away, poses, np.zeros(4)), variables, SEARCH)
    assert with_departed(masks, bundle, variables, SEARCH) == (bundle, variables)


def test_springs_of_further_variables_hold_them_where_they_are(tmp_path: Path) -> None:
    start = hammer(tmp_path, 0.0)
    larger = start.with_values({"a.length": 0.48}).with_following(["a.head.along"], follow=False)
    variables = with_names(scene_variables(start, ["a.length"]), larger, ["a.head.along"])
    assert variables.names == ("a.length", "a.head.along")
    assert variables.start["a.head.along"] == pytest.approx(0.24, rel=1e-12)
    assert variables.read(larger, CAMERA)[1] == pytest.approx(1.0, rel=1e-12)


def on_rods(folder: Path, count: int) -> Mechanism:
    """Return rods on one pivot, with a ball at the end of each."""
    text = "".join(
        f'<body name="{"ab"[i]}"><joint name="j{i}" axis="0 -1 0"/>'
        '<geom type="capsule" size=".004" fromto="0 0 0 .2 0 0"/>'
        f'<geom name="ball{i}" type="sphere" size=".03" pos=".2 0 0"/></body>'
        for i in range(count)
    )
    (folder / "balls.xml").write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    return load(folder / "balls.xml")


def test_a_speck_at_the_pivot_is_no_thread(tmp_path: Path) -> None:
    """A rod that has shrunk to a speck, whose edges are seen: it says nothing of how long the thread is."""
    file, px = on_rods(tmp_path, 1), CAMERA.depth / CAMERA.focal
    poses = np.random.default_rng(4).uniform(-2.5, -0.5, (10, 1))
    start = file.with_following(["a.ball0.along"], follow=False)
    start = start.with_values({"a.length": 2.0 * px, "a.width": 2.0 * px, "a.ball0.along": 0.2})
    masks = KeyMasks([drawn_mask(start, CAMERA, q) for q in poses], trusted(file))
    names = ["a.length", "a.width", "a.ball0.width", "a.ball0.along"]
    variables = scene_variables(start, [*names, "camera.x", "camera.y", "camera.depth"])
    bundle = refine(masks, SceneGuess(start, CAMERA, poses, np.zeros(10)), variables, SEARCH)
    found = without_unseen(bundle, file).mechanism
    assert found.parameter("a.ball0.along").follows
    assert found.values["a.length"] == pytest.approx(bundle.mechanism.values["a.ball0.along"])


@pytest.mark.parametrize(("count", "shown"), [(1, False), (1, True), (2, False)])
def test_a_thread_that_no_picture_shows_ends_at_its_ball(tmp_path: Path, count: int, shown: bool) -> None:
    file = on_rods(tmp_path, count)
    poses = np.random.default_rng(4).uniform(-2.5, -0.5, (10, count))
    bodies = [("a", "a.ball0"), ("b", "b.ball1")][:count]
    # every thread is half as long, and its ball beyond its end
    start = file.with_following([f"{ball}.along" for _, ball in bodies], follow=False)
    start = start.with_values({f"{body}.length": 0.1 for body, _ in bodies})
    start = start.with_values({f"{ball}.along": 0.2 for _, ball in bodies})
    view = trusted(file)
    if not shown:
        view = view._replace(part=np.array([LEFT_OUT, 0] * count))
    masks = KeyMasks([drawn_mask(start, CAMERA, q) for q in poses], view)
    names = [f"{one}.{size}" for one, _ in bodies for size in ("length", "width")]
    names += [f"{ball}.{size}" for _, ball in bodies for size in ("width", "along")]
    variables = scene_variables(start, [*names, "camera.x", "camera.y", "camera.depth"])
    bundle = refine(masks, SceneGuess(start, CAMERA, poses, np.zeros(10)), variables, SEARCH)
    found = without_unseen(bundle, file)
    assert (found is bundle) == shown
    values, before = found.mechanism.values, bundle.mechanism.values
    for body, ball in bodies:
        assert found.mechanism.parameter(f"{ball}.along").follows != shown
        assert values[f"{ball}.along"] == pytest.approx(before[f"{ball}.along"], rel=1e-9)
        # a width of before would be that of a bar where the picture shows none
        thread = LEAST_WIDTH_PX * found.camera.depth / found.camera.focal
        assert values[f"{body}.width"] == (before[f"{body}.width"] if shown else pytest.approx(thread))
        share = values[f"{body}.length"] / values[f"{ball}.along"]
        assert share == pytest.approx(0.5 if shown else 1.0, rel=0.05)


def test_a_ball_whose_thread_no_picture_shows_is_on_the_thread(tmp_path: Path) -> None:
    """Seen alone a ball may be anywhere on its body: the angle of the thread follows."""
    file = on_rods(tmp_path, 1)
    poses = np.random.default_rng(4).uniform(-2.5, -0.5, (10, 1))
    free = file.with_following(["a.ball0.along", "a.ball0.across"], follow=False)
    aside = free.with_values({"a.length": 0.1, "a.ball0.along": 0.2, "a.ball0.across": -0.03})
    view = trusted(file)._replace(part=np.array([LEFT_OUT, 0]))
    masks = KeyMasks([drawn_mask(aside, CAMERA, q) for q in poses], view)
    names = [f"a.{size}" for size in ("length", "width", "ball0.width", "ball0.along", "ball0.across")]
    variables = scene_variables(aside, [*names, "camera.x", "camera.y", "camera.depth"])
    bundle = refine(masks, SceneGuess(aside, CAMERA, poses, np.zeros(10)), variables, SEARCH)
    found = without_unseen(bundle, file)
    values, before = found.mechanism.values, bundle.mechanism.values
    assert all(found.mechanism.parameter(f"a.ball0.{place}").follows for place in ("along", "across"))
    assert values["a.ball0.across"] == pytest.approx(0.0, abs=1e-12)
    reach = np.hypot(before["a.ball0.along"], before["a.ball0.across"])
    assert values["a.length"] == pytest.approx(reach, rel=1e-9)
    # the ball stays where it was seen
    places = []
    for one in (bundle, found):
        model = one.mechanism.values["a.ball0.along"] + 1j * one.mechanism.values["a.ball0.across"]
        places.append(model * np.exp(1j * one.mechanism.joints[0].sign * one.positions[:, 0]))
    assert places[1] == pytest.approx(places[0], abs=1e-9)
