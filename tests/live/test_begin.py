"""The first seconds of a stream: what counts as motion, and what is kept."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lives import double, scene
from monodyn.errors import VideoError
from monodyn.live import begin as begun
from monodyn.live.begin import STILL_KEPT, Beginning, Begun, Guessed, as_clip, hardly_shown, numbered
from monodyn.live.feed import Feed
from monodyn.live.settings import LiveSettings
from monodyn.live.sources import pictures_of
from monodyn.live.stream import Session
from monodyn.mechanism import load
from monodyn.settings import RunSettings
from monodyn.types import Frame, Poses
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.release import FreeSpan
from support import refuses


def noisy(index: int, *, moving: bool, rng: np.random.Generator, rate: float = 30.0) -> Frame:
    """A grey picture with noise, and a bright bar that moves."""
    picture = 90.0 + 3.0 * rng.standard_normal((120, 160))
    if moving:
        first = 20 + 2 * index % 100
        picture[30:90, first : first + 20] = 200.0
    return Frame(index, index / rate, np.clip(picture, 16, 235).astype(np.uint8))


def test_noise_is_no_motion_and_what_was_still_gives_way():
    watched, rng = Beginning(1.0), np.random.default_rng(0)
    for k in range(150):
        watched.add(noisy(k, moving=False, rng=rng))
    assert watched.moving == 0.0
    assert watched.frames[-1].time - watched.frames[0].time <= STILL_KEPT + 1e-9
    for k in range(150, 185):
        watched.add(noisy(k, moving=True, rng=rng))
    assert watched.ready
    assert watched.moving == pytest.approx(35 / 30.0, abs=0.1)
    # the still seconds before show the background
    assert watched.frames[0].index < 150


def test_after_a_search_in_vain_half_as_much_again_is_waited_for():
    watched, rng = Beginning(0.5), np.random.default_rng(0)
    for k in range(20):
        watched.add(noisy(k, moving=True, rng=rng))
    assert watched.ready
    before = watched.moving
    # the first step of the search alone is no search
    watched.go_on(VideoError("nothing is there"))
    assert watched.ready
    watched.go_on(VideoError("nothing is there"))
    assert not watched.ready
    assert watched.needed == pytest.approx(1.5 * before)


def test_it_is_said_what_a_search_lacks():
    """Only what is certain: what has moved so far, and what a step of the search has said."""
    watched, rng = Beginning(1.5), np.random.default_rng(0)
    assert watched.lacks == "Nothing is seen to move. The search needs 0.3 s of motion."
    for k in range(5):
        watched.add(noisy(k, moving=True, rng=rng))
    assert watched.lacks == "The search needs 0.2 s more of motion."
    for k in range(5, 16):
        watched.add(noisy(k, moving=False, rng=rng))
    assert watched.lacks == "Nothing is seen to move. The search needs 0.1 s more of motion."
    rocks = replace(guess(0.5, 0.5), positions=np.array([[0.0, 0.0], [0.5, 0.1], [1.0, 0.1]]))
    watched.go_on(Guessed(rocks, SimpleNamespace()))
    assert watched.lacks == (
        "So far a first guess shows less than 10 deg of turning at joint2. Nothing is seen to move. "
        "The search needs 1.3 s more of motion."
    )
    watched.add(noisy(16, moving=True, rng=rng))
    watched.go_on(VideoError("Nothing is there."))
    assert watched.lacks == "Nothing is there. The search needs 0.2 s more of motion."


def guess(*turned: float) -> SceneGuess:
    """Make a guess whose hinges turn this far from its first key frame to the last [rad]."""
    mechanism = load("double")
    camera = scene(double()).camera
    positions = np.linspace(np.zeros(2), turned, 5)
    return SceneGuess(mechanism, camera, positions, np.zeros(5))


def test_what_a_guess_has_hardly_seen_is_said():
    assert hardly_shown(guess(1.5, 0.5)) == ""
    assert (
        hardly_shown(guess(1.5, 0.1)) == "So far a first guess shows less than 10 deg of turning at joint2."
    )
    # a whole turn less a little is a little
    assert hardly_shown(replace(guess(1.5, 0.1), positions=guess(1.5, 2.0 * np.pi).positions)) == ""
    rocks = guess(0.03, 0.03)
    said = hardly_shown(rocks)
    share = said.removeprefix(
        "So far a first guess shows less than 10 deg of turning at joint1 and joint2, and nothing of what is "
        "behind "
    ).removesuffix(" of the mechanism.")
    assert said == (
        "So far a first guess shows less than 10 deg of turning at joint1 and joint2, and nothing of what is "
        f"behind {share} of the mechanism."
    )
    assert 50 < float(share.removesuffix("%")) < 95


def test_what_is_guessed_first_is_where_the_search_begins(monkeypatch):
    """In a fifth of the motion it is guessed, in all frames so far it is looked for."""
    steps = []
    first, shown = guess(1.0, 1.0), SimpleNamespace(masks=None)

    def guessed(sought):
        steps.append(("guess", sought.masks.count))
        return first, shown

    def searched(frames, masks, mechanism, settings, given):
        steps.append((given, len(frames)))
        raise VideoError("nothing is there")

    still = SimpleNamespace(camera_path=None)
    monkeypatch.setattr(
        begun, "segment", lambda clip, *_, **__: SimpleNamespace(video=still, count=clip.count)
    )
    monkeypatch.setattr(begun, "first_scene", guessed)
    monkeypatch.setattr(begun, "Tracker", lambda *_: following(np.ones(2, bool)))
    monkeypatch.setattr(begun, "search", searched)
    rng = np.random.default_rng(0)
    source = pictures_of([noisy(k, moving=True, rng=rng) for k in range(60)], 30.0)
    with Session(source, load("double"), LiveSettings(begin=0.9), RunSettings()) as session:
        list(session.steps())
    (what, few), (given, more), (none, most) = steps
    assert (what, given, none) == ("guess", first, None)
    assert few == pytest.approx(0.18 * 30.0, abs=3.0)
    assert more == pytest.approx(0.9 * 30.0, abs=2.0)
    assert most == pytest.approx(1.5 * more, abs=2.0)


def following(seen: np.ndarray) -> SimpleNamespace:
    """A tracker to which frames show these joints, bool (dof,)."""
    covariance = np.where(seen.all(), np.eye(2), np.nan)[None]

    def follow(frame: Frame, expected: np.ndarray | None) -> Poses:
        return Poses(
            ("joint1", "joint2"), np.array([frame.index]), np.array([frame.time]),
            np.where(seen, 0.5, np.nan)[None], covariance, np.array([seen.all()]), joint_seen=seen[None],
        )  # fmt: skip

    return SimpleNamespace(follow=follow, scene="guessed")


def guessing(monkeypatch, mismatch: float, seen: np.ndarray) -> Session:
    """A stream of 60 frames whose guess leaves so much unexplained, and whose search is in vain."""
    still = SimpleNamespace(camera_path=None)
    first = replace(guess(1.0, 1.0), mismatch=np.full(5, mismatch))
    monkeypatch.setattr(begun, "segment", lambda *_, **__: SimpleNamespace(video=still))
    monkeypatch.setattr(begun, "first_scene", lambda _: (first, SimpleNamespace(masks=None)))
    monkeypatch.setattr(begun, "Tracker", lambda *_: following(seen))

    def searched(*_):
        raise VideoError("Nothing is there.")

    monkeypatch.setattr(begun, "search", searched)
    rng = np.random.default_rng(0)
    source = pictures_of([noisy(k, moving=True, rng=rng) for k in range(60)], 30.0)
    return Session(source, load("double"), LiveSettings(begin=1.5), RunSettings())


def test_what_is_guessed_is_followed_until_the_search_ends(monkeypatch):
    """What is identified waits for the search; where that is in vain nothing is followed any more."""
    with guessing(monkeypatch, 0.1, np.ones(2, bool)) as session:
        steps = list(session.steps())
        assert session.identifier.record.whole is None
    followed = [step.index for step in steps if step.phase == "following"]
    assert followed == list(range(followed[0], followed[-1] + 1))
    # the first frame that moves has none before it, and the guess is known at the one after it
    assert followed[0] / 30.0 == pytest.approx(0.3 + 3 / 30.0, abs=1e-9)
    assert followed[-1] / 30.0 == pytest.approx(1.5, abs=0.1)
    step = steps[followed[0]]
    assert (step.scene, step.fit, step.verdict) == ("guessed", None, None)
    assert step.said == "It is followed as a first guess has it. The search needs 1.2 s more of motion."
    assert steps[-1].said == "Nothing is there. The search needs 0.4 s more of motion."


def test_a_guess_that_the_pictures_do_not_show_is_not_followed(monkeypatch):
    with guessing(monkeypatch, 0.1, np.array([True, False])) as session:
        steps = list(session.steps())
    assert {(step.phase, step.pose, step.scene) for step in steps} == {("watching", None, None)}


def test_no_frame_gives_way_to_following_a_guess(monkeypatch):
    """Where the next one has come already, what is watched for the search comes first."""
    session = guessing(monkeypatch, 0.1, np.ones(2, bool))
    monkeypatch.setattr(Feed, "behind", property(lambda _: True))
    with session:
        assert {step.phase for step in session.steps()} == {"watching"}


@pytest.mark.parametrize("live", [True, False])
def test_a_stream_is_behind_where_its_next_frame_has_come_already(live):
    """What waits until it is taken never is."""
    rng = np.random.default_rng(0)
    source = pictures_of([noisy(k, moving=True, rng=rng) for k in range(2)], 30.0)
    feed = Feed(replace(source, live=live, direct=False), 4)
    try:
        assert feed._thread is not None
        feed._thread.join()
        assert feed.behind is live
        feed.next()
        feed.next()
        assert not feed.behind
    finally:
        feed.close()


def test_a_guess_that_explains_little_says_nothing(monkeypatch):
    """It is dropped, and the search is that of a whole run."""
    with guessing(monkeypatch, 0.4, np.ones(2, bool)) as session:
        steps = list(session.steps())
    assert {step.phase for step in steps} == {"watching"}
    why = steps[20].said.removesuffix(" The search needs 0.9 s more of motion.")
    assert why == "So far a first guess explains 60% of what moves."


def test_a_mechanism_that_no_frame_shows_is_not_found(monkeypatch):
    pose = np.full((4, 2), np.nan)
    nowhere = Poses(
        ("joint1", "joint2"), np.arange(4), np.arange(4) / 30.0, pose, np.ones((4, 2, 2)), np.zeros(4, bool)
    )
    masks = SimpleNamespace(video=None, background=None)
    found = SimpleNamespace(masks=masks, video=None, advice=())
    monkeypatch.setattr(begun, "locate", lambda *_, **__: found)
    monkeypatch.setattr(begun, "track_freely", lambda *_: (nowhere, FreeSpan(0, 4, ())))
    monkeypatch.setattr(begun, "left_out", lambda *_, **__: ())
    monkeypatch.setattr(begun, "doubtful_sight", lambda sight, part: f"{len(part)} frames show nothing.")
    rng = np.random.default_rng(0)
    frames = [noisy(k, moving=True, rng=rng) for k in range(4)]
    with refuses(VideoError, "4 frames show nothing."):
        begun.search(frames, masks, load("double"), RunSettings(), None)


def test_poses_of_a_stream_have_the_numbers_of_the_clip_in_which_it_was_found():
    """What was still before it moved was dropped, and what came later is not in the clip."""
    frame, pose = np.arange(30, 40), np.zeros((10, 1))
    poses = Poses(("joint1",), frame, frame / 30.0, pose, np.ones((10, 1, 1)), np.ones(10, bool))
    clip = numbered(poses, poses.time[:6])
    assert clip.frame[:6].tolist() == [0, 1, 2, 3, 4, 5]
    assert min(clip.frame[6:]) > 5


def test_what_is_held_is_bounded_also_while_it_is_looked_at(monkeypatch):
    monkeypatch.setattr(begun, "MOST_HELD", 40 * 120 * 160)
    watched, rng = Beginning(0.5), np.random.default_rng(0)
    for k in range(60):
        watched.add(noisy(k, moving=True, rng=rng))
    assert 38 <= len(watched.frames) <= 41
    held = watched.frames[0].index
    watched.holds = True
    for k in range(60, 80):
        watched.add(noisy(k, moving=True, rng=rng))
    assert watched.frames[0].index == held
    assert len(watched.frames) <= 41


def test_frames_are_a_clip_with_their_own_numbers():
    rng = np.random.default_rng(0)
    frames = [noisy(k, moving=True, rng=rng) for k in range(40, 60)]
    clip = as_clip(frames, "camera 0")
    assert (clip.count, clip.width, clip.height) == (20, 160, 120)
    assert [frame.index for frame in clip.frames(5, 8)] == [5, 6, 7]
    assert np.array_equal(clip.times, [frame.time for frame in frames])


def test_a_camera_that_moves_is_refused(monkeypatch):
    moving = SimpleNamespace(video=SimpleNamespace(camera_path=object()))
    monkeypatch.setattr(begun, "segment", lambda *_, **__: moving)
    rng = np.random.default_rng(0)
    watched = Beginning(0.5)
    for k in range(4):
        watched.add(noisy(k, moving=True, rng=rng))
    error = begun.begin(watched, "camera 0", load("double"), RunSettings())
    assert isinstance(error, VideoError)
    assert str(error) == "camera 0: expected a camera that stands still, got one that moves; fasten it."


def test_a_mechanism_of_dots_is_refused_before_the_first_frame(monkeypatch):
    rng = np.random.default_rng(0)
    source = pictures_of([noisy(k, moving=True, rng=rng) for k in range(4)], 30.0)
    mechanism = replace(load("double"), name="balls")
    monkeypatch.setattr("monodyn.live.stream.shows_dots", lambda _: True)
    with refuses(
        VideoError,
        "pictures: expected a mechanism that shows its outline, got 'balls', which is followed by its dots; "
        "record a clip and take monodyn run.",
    ):
        Session(source, mechanism, LiveSettings(), RunSettings())


def test_it_is_said_what_is_looked_at(monkeypatch):
    rng = np.random.default_rng(0)
    source = pictures_of([noisy(k, moving=True, rng=rng) for k in range(40)], 30.0)
    said = []
    error = VideoError("Nothing is there.")

    def looked(*_):
        said.append(session.said)
        return error

    monkeypatch.setattr("monodyn.live.stream.begin", looked)
    with Session(source, load("double"), LiveSettings(begin=1.0), RunSettings()) as session:
        steps = list(session.steps())
    assert steps[5].said == "The search needs 0.1 s more of motion."
    assert steps[-1].said == "Nothing is there. The search needs 0.3 s more of motion."
    seconds = (
        said[1].removeprefix("Looking for the mechanism in the last ").removesuffix(" s. Nothing is there.")
    )
    assert said[1] == f"Looking for the mechanism in the last {seconds} s. Nothing is there."
    assert 0.9 < float(seconds) < 1.2


def test_it_is_followed_before_it_is_identified(monkeypatch):
    pose = Poses(
        ("joint1",), np.zeros(1, int), np.zeros(1), np.zeros((1, 1)), np.ones((1, 1, 1)), np.ones(1, bool)
    )
    tracker = SimpleNamespace(follow=lambda *_: pose, scene=None)
    shown = Begun(SimpleNamespace(scene=None), tracker, None, 1000)
    monkeypatch.setattr("monodyn.live.stream.begin", lambda *_: shown)
    rng = np.random.default_rng(0)
    source = pictures_of([noisy(k, moving=True, rng=rng) for k in range(20)], 30.0)
    with Session(source, load("double"), LiveSettings(begin=0.9), RunSettings()) as session:
        monkeypatch.setattr(session.identifier, "begin", lambda *_: None)
        monkeypatch.setattr(session.identifier, "take", lambda *_, **__: None)
        steps = list(session.steps())
    assert (steps[0].phase, steps[-1].phase) == ("watching", "following")
    assert steps[-1].said == "The mechanism is followed; its parameters are being identified."


def test_a_stream_that_ends_during_the_guess_is_searched_all_the_same(monkeypatch):
    """Where a machine is so slow that the clip is over by then."""
    asked = []

    def looked(watched, *_):
        asked.append(watched.guessed)
        return VideoError("Nothing is there.")

    monkeypatch.setattr("monodyn.live.stream.begin", looked)
    rng = np.random.default_rng(0)
    source = pictures_of([noisy(k, moving=True, rng=rng) for k in range(40)], 30.0)
    with Session(source, load("double"), LiveSettings(begin=1.0), RunSettings()) as session:
        session._search = Future()
        session._search.set_result(VideoError("Nothing is there."))
        monkeypatch.setattr(session, "_watch", lambda frame, **_: session._beginning.add(frame))
        list(session.steps())
    assert asked == [True]
