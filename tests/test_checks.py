"""What a run refuses before it begins, and what it says of a clip without the mechanism."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dotted import BALLS
from monodyn.checks import (
    after_refusal,
    camera_choices,
    check_tracked,
    chosen_mechanism,
    clip_and_mechanism,
    drawn_mechanism,
    fitted_part,
    fitted_range,
    free_range,
    left_out,
    prediction_times,
    tracked_share,
    untracked,
)
from monodyn.errors import FitError, MechanismError, SettingsError, VideoError
from monodyn.estimation.settings import IdentifySettings
from monodyn.results.trace import frame_numbers
from monodyn.settings import RunSettings
from monodyn.types import Poses
from monodyn.vision.clip import container
from monodyn.vision.clip.video import Video, read
from monodyn.vision.foreground.background import Background
from monodyn.vision.foreground.thumbnails import Window
from monodyn.vision.release import FreeSpan
from monodyn.vision.settings import CameraSettings, LocateSettings
from support import DEMO, ClipMaker, refuses

MODEL = DEMO / "double.xml"
FOURIER, FREE = IdentifySettings(torque="fourier"), IdentifySettings(torque="free")


@pytest.fixture
def video(make_clip: ClipMaker) -> Video:
    """A clip of 12 frames at 30 Hz."""
    return read(make_clip())


def poses(seen: int, count: int) -> Poses:
    """Return the poses of a clip, the first of which were seen."""
    position = np.where(np.arange(count)[:, None] < seen, 0.0, np.nan)
    covariance = np.zeros((count, 1, 1))
    return Poses(
        ("joint1",), np.arange(count), np.arange(count) / 30, position, covariance, np.arange(count) < seen
    )


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (RunSettings(bounds={"camera.depth": (1.0, 2.0)}),
         "bounds of 'camera.depth': expected a parameter of the mechanism; give the camera's with fix."),
        (RunSettings(fix={"torque.period": 1.0}),
         "parameter 'torque.period': expected --identify.torque fourier with it, got 'auto'; choose that "
         "torque, or leave the parameter out."),
        (RunSettings(fix={"torque.lag": 0.01}),
         "parameter 'torque.lag': expected --torques FILE with it, got none; name the file, or leave the "
         "parameter out."),
        (RunSettings(free=["joint1.torque.3"], identify=FREE),
         "parameter 'joint1.torque.3': expected one that can be fixed, freed or bounded, got one of a "
         "free torque, which is found as a whole; leave the parameter out."),
        (RunSettings(fix={"camera.zoom": 1.0}),
         "parameter 'camera.zoom': expected one of the camera's; parameters: 'camera.x', 'camera.y', "
         "'camera.depth', 'camera.roll', 'camera.pitch', 'camera.yaw', 'camera.focal'."),
        (RunSettings(free=["camera.roll"], identify=IdentifySettings(method="paper")),
         "parameter 'camera.roll': identify.method paper takes gravity's direction as given; give the "
         "roll with --fix, or use identify.method fast."),
    ],
)  # fmt: skip
def test_choices_that_are_refused(settings: RunSettings, message: str) -> None:
    with refuses(SettingsError, message):
        chosen_mechanism(MODEL, settings)


def test_gravity_may_have_any_direction_in_a_table() -> None:
    found = chosen_mechanism(MODEL, RunSettings(free=["camera.roll"]), camera=False)
    assert found.parameter("camera.roll").free
    given = chosen_mechanism(MODEL, RunSettings(fix={"camera.roll": 0.1}), camera=False)
    assert given.values["camera.roll"] == 0.1
    # of a clip it is the scene that knows
    assert not chosen_mechanism(MODEL, RunSettings(free=["camera.roll"])).parameter("camera.roll").free
    said = (
        "parameter 'camera.roll': expected a mechanism on a single hinge of the world, whose angles a "
        "tilt adds to; leave it out."
    )
    with refuses(SettingsError, said):
        chosen_mechanism("cartpole", RunSettings(free=["camera.roll"]), camera=False)


def test_tables_have_no_camera() -> None:
    said = (
        "parameter 'camera.depth': expected one of the mechanism's; tables of joint positions have no "
        "camera, leave it out."
    )
    with refuses(SettingsError, said):
        chosen_mechanism(MODEL, RunSettings(fix={"camera.depth": 1.0}), camera=False)


def test_a_model_has_a_name() -> None:
    with refuses(MechanismError, "model: expected a file or a bundled name, got an empty one; name one."):
        chosen_mechanism("", RunSettings())


def test_choices_are_split_between_camera_and_mechanism() -> None:
    settings = RunSettings(fix={"camera.depth": 2.0, "gravity": 9.8}, free=["camera.focal", "time_scale"])
    assert camera_choices(settings) == ({"camera.depth": 2.0}, ["camera.focal"])
    mechanism = chosen_mechanism(MODEL, settings)
    assert mechanism.parameter("gravity").value == 9.8
    assert mechanism.parameter("time_scale").free


def test_a_periodic_torque_can_be_chosen_from() -> None:
    settings = RunSettings(identify=FOURIER, bounds={"torque.period": (0.2, 0.4)})
    period = chosen_mechanism(MODEL, settings).parameter("torque.period")
    assert (period.value, period.lower, period.upper) == (0.4, 0.2, 0.4)


def test_a_mechanism_without_shape_has_no_picture(make_clip: ClipMaker, tmp_path: Path) -> None:
    model = tmp_path / "bare.xml"
    model.write_text(
        '<mujoco model="bare"><worldbody><body name="b"><joint name="j" axis="0 -1 0"/>'
        '<inertial pos="0.1 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>'
    )
    said = (
        "mechanism 'bare': expected a moving body with a geom or a site that a clip can show, got none; add "
        "its shape."
    )
    with refuses(MechanismError, said):
        clip_and_mechanism(make_clip(), model, RunSettings())


def test_the_clip_of_a_run_is_decoded_once(make_clip: ClipMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    real, shown = container.pictures, []

    def counted(opened: object, stream: object) -> Iterator[object]:
        for picture in real(opened, stream):
            shown.append(picture)
            yield picture

    path = make_clip()
    monkeypatch.setattr(container, "pictures", counted)
    video, _ = clip_and_mechanism(path, MODEL, RunSettings())
    # those that are looked at for size and stamps come first
    for first, stop in ((0, 12), (5, 9), (0, 12)):
        assert [frame.index for frame in video.frames(first, stop)] == list(range(first, stop))
    assert len(shown) == container.OPENING + 12


def test_a_background_that_is_not_there(make_clip: ClipMaker) -> None:
    said = "background 'nowhere.png': expected a picture file, found none; check the path."
    with refuses(SettingsError, said):
        clip_and_mechanism(make_clip(), MODEL, RunSettings(background=Path("nowhere.png")))


def test_dots_are_of_one_instant(make_clip: ClipMaker, tmp_path: Path) -> None:
    model = tmp_path / "balls.xml"
    model.write_text(BALLS.replace("<mujoco>", '<mujoco model="balls">'))
    said = (
        "camera.exposure, camera.readout: expected a mechanism that shows its outline, got 'balls', which is "
        "followed by its dots; leave them out."
    )
    for camera in (CameraSettings(exposure=0.01), CameraSettings(readout=-0.01)):
        with refuses(SettingsError, said):
            clip_and_mechanism(make_clip(), model, RunSettings(camera=camera))
    clip_and_mechanism(make_clip(), model, RunSettings(camera=CameraSettings(exposure=0.0)))


def test_frames_of_the_fit() -> None:
    assert fitted_range(None, 12) == (0, 9)
    assert fitted_range((3, None), 12) == (3, 12)
    for first, stop in ((5, 900), (9, 3), (4, 5)):
        said = (
            f"fit-frames: expected a range of at least two frames within 0:12, got {first}:{stop}; "
            "the clip has 12 frames."
        )
        with refuses(SettingsError, said):
            fitted_range((first, stop), 12)


def test_rows_of_a_table_that_are_fitted() -> None:
    time = np.arange(12) / 25.0
    seen, covariance = np.ones(12, dtype=bool), np.tile(np.eye(1), (12, 1, 1))
    table = Poses(("hinge",), np.arange(12), time, np.zeros((12, 1)), covariance, seen)
    assert fitted_part(table, None, "a.csv") == (0, 12)
    assert fitted_part(table, (3, None), "a.csv") == (3, 12)
    # the motion is simulated before and after the rows that are fitted, too
    apart = replace(table, time=time + 60.0 * (np.arange(12) >= 8))
    said = (
        "a.csv: expected rows that follow each other, got pauses of 60 s between rows of 0.44 s, the longest "
        "after 0.28 s; give what comes before and after a pause as records of their own."
    )
    with refuses(VideoError, said):
        fitted_part(apart, (0, 6), "a.csv")


def test_frames_of_the_fit_where_the_mechanism_moves_freely() -> None:
    """It hangs in frames 20 to 29, and is held before and after 100."""
    span = FreeSpan(30, 100, (), 10)
    assert free_range(None, (0, 90), span) == (30, 83)
    assert free_range((25, None), (25, 120), span) == (25, 100)
    assert free_range((5, 60), (5, 60), span) == (20, 60)
    with refuses(
        FitError,
        "fit-frames: expected frames in which the mechanism moves freely, 30:100, got 99:120; give a range "
        "there, or --time-range A:B [s] where it moves freely.",
    ):
        free_range((99, 120), (99, 120), span)


def test_a_prediction_goes_on_in_steps_of_the_clip(video: Video) -> None:
    assert np.array_equal(prediction_times(video.times, 9, None), video.times[9:])
    times = prediction_times(video.times, 9, 0.5)
    assert np.allclose(times, np.arange(9, 16) / 30.0)
    assert frame_numbers(times, video.times, np.arange(12)).tolist() == list(range(9, 16))
    assert np.allclose(prediction_times(video.times, 9, 0.32), [0.3])


def test_ends_of_a_prediction_that_are_refused(video: Video) -> None:
    said = "until: expected a time after the last fitted frame at 0.267 s, got 0.2 s."
    with refuses(SettingsError, said):
        prediction_times(video.times, 9, 0.2)
    said = (
        "until: expected at most 64.0333 s (the end of the record, ten times its length and a minute, and no "
        "more than 1000000 rows), got 1e+300 s."
    )
    with refuses(SettingsError, said):
        prediction_times(video.times, 9, 1e300)


def test_a_clip_without_the_mechanism_says_so(video: Video) -> None:
    said = (
        f"clip '{video.path}': expected the mechanism in frames 0 to 2, tracked it in none; "
        "Light it better. Come closer. What makes a clip good, with examples: docs/filming.md."
    )
    with refuses(FitError, said):
        check_tracked(poses(0, 3), video, ["Light it better.", "Come closer."])
    said = said.replace("Light it better. Come closer.", "look at diagnosis.png.")
    with refuses(FitError, said):
        check_tracked(poses(0, 3), video, [])
    check_tracked(poses(1, 3), video, [])


def test_a_refused_clip_leads_to_the_page_on_filming() -> None:
    said = ["What makes a clip good, with examples: docs/filming.md."]
    filmed, pointed, dotted = (
        SimpleNamespace(tracks=tracks)
        for tracks in (None, SimpleNamespace(clip=None), SimpleNamespace(clip=object()))
    )
    assert after_refusal(SimpleNamespace(ok=False), filmed, compared=True) == said
    # dots are found in the clip
    assert after_refusal(SimpleNamespace(ok=False), dotted, compared=True) == said
    assert after_refusal(SimpleNamespace(ok=False), filmed, compared=False) == [
        "If it may be another mechanism, run the clip without --model: the bundled ones are tried, and the "
        "one that comes nearest is named.",
        *said,
    ]
    assert after_refusal(SimpleNamespace(ok=True), filmed, compared=False) == []
    # points were filmed by somebody else
    assert after_refusal(SimpleNamespace(ok=False), pointed, compared=False) == []


def test_a_clip_that_is_tracked_in_parts_has_advice() -> None:
    assert untracked(poses(9, 10)) == []
    # a picture that repeats the one before is not expected to be tracked
    assert untracked(poses(8, 10), 2) == []
    assert untracked(poses(8, 10)) == [
        "Only 8 of 10 frames were tracked; diagnosis.png shows which, and why. Where the mechanism hardly "
        "stands out, a lower --segment.contrast may help; where the background shows parts of it, "
        "--background with a picture without the mechanism."
    ]


def test_frames_in_which_a_part_was_tracked_are_counted_apart() -> None:
    """Everything that counts tracked frames counts them alike."""
    joints = np.zeros((12, 2), dtype=bool)
    joints[:3], joints[3:8, 0] = True, True
    two = Poses(
        ("joint1", "joint2"), np.arange(12), np.arange(12) / 30.0, np.zeros((12, 2)),
        np.tile(np.eye(2), (12, 1, 1)), joints.all(axis=1), joint_seen=joints,
    )  # fmt: skip
    assert tracked_share(two, "12 frames") == "3 of 12 frames were tracked whole, and 5 in part"
    assert untracked(two, 2)[0].startswith(
        "Only 3 of 10 frames were tracked whole, and 5 in part; diagnosis.png "
    )


def test_what_is_left_out_of_the_picture_is_said() -> None:
    luma, known = np.zeros((60, 90), np.uint8), np.ones((60, 90), dtype=bool)
    whole = Background(luma, None, 1.0, known, Window(10, 50, 20, 80))
    assert left_out(whole) == []
    assert left_out(replace(whole, others=~known)) == [
        "Something else moves in the picture: the mechanism was looked for in 20,10,60,40 [px] alone, and "
        "what moves apart from it there is left out; --roi X,Y,W,H chooses another part."
    ]
    assert left_out(replace(whole, others=~known), given=True) == [
        "Something moves outside of --roi 20,10,60,40 as well and is left out: where the mechanism reaches "
        "out of that region, give a larger one."
    ]


def test_a_focal_length_is_given_once() -> None:
    given = LocateSettings(focal=500.0)
    for choice in ({"fix": {"camera.focal": 800.0}}, {"free": ["camera.focal"]}):
        settings = RunSettings(locate=given, **choice)
        with refuses(
            SettingsError,
            "parameter 'camera.focal': --locate.focal gives it, 500 px; leave one of them out.",
        ):
            chosen_mechanism("double", settings)


def test_every_link_that_cannot_be_seen_needs_a_dot(tmp_path: Path) -> None:
    def model(inner: str, outer: str) -> Path:
        inertia = '<inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.01 0.01"/>'
        text = (
            f'<mujoco><worldbody><body name="link1"><joint type="hinge" axis="0 -1 0"/>{inertia}{inner}'
            f'<body name="link2" pos="0 0 -0.2"><joint type="hinge" axis="0 -1 0"/>{inertia}{outer}</body>'
            "</body></worldbody></mujoco>"
        )
        (tmp_path / "dots.xml").write_text(text)
        return tmp_path / "dots.xml"

    site = '<site name="{}" pos="0 0 -0.2"/>'
    with refuses(
        MechanismError,
        "mechanism 'dots': expected a dot on 'link2' or on a body that it carries, as nothing else of it can "
        "be seen, got none; add a site.",
    ):
        drawn_mechanism(model(site.format("one"), ""), RunSettings())
    # what a body carries shows where its hinge is
    assert drawn_mechanism(model("", site.format("two")), RunSettings()).name == "dots"
