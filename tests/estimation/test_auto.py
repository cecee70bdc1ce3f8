"""Which kind of torque acts: the simplest that the evidence supports."""

import re
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from damaged import DAMAGES, NOISE
from driven import DOUBLE, MASSIVE, PERIOD, STIFF, THICKNESS, pull, simulated, started, task_of
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.unknowns import assumed_sizes
from monodyn.estimation.torque import auto
from monodyn.estimation.torque.evidence import at_noise, slow_part
from monodyn.estimation.torque.task import Task, TorqueSolution
from monodyn.estimation.verdict.combinations import inertial_ratios
from monodyn.mechanism import Mechanism, load
from monodyn.stages import identify
from monodyn.types import Poses
from support import slow
from swings import TIMES, leaning, motion, record, scaled, white

AUTO = IdentifySettings(torque="auto")
SINGLE = DOUBLE[: DOUBLE.index('<body name="link2"')] + "</body></worldbody></mujoco>"


def damaged(name: str, seed: int) -> tuple[Poses, Mechanism]:
    """Return a record of the alarms with the mechanism that it is taken to be of."""
    found = DAMAGES[name](np.random.default_rng(seed))
    mechanism = load(found.model).with_choices(fix=found.fix)
    return white(found.joints, found.time, found.position, NOISE), mechanism


def leaving(residuals: np.ndarray, first: tuple[int, ...], sigma: float = 1.0) -> tuple[Any, Any]:
    data = SimpleNamespace(measured=np.ones(residuals.shape, dtype=bool), first=np.array(first))
    return SimpleNamespace(data=data), SimpleNamespace(complete=True, sigma=sigma, residuals=residuals)


def test_noise_has_no_slow_part_and_a_wave_has_its_rms() -> None:
    noise = np.random.default_rng(0).normal(size=(4000, 2))
    assert slow_part(*leaving(noise, (0, 4000))) < 0.2
    wave = np.sqrt(2.0) * 1.5 * np.sin(np.arange(4000) / 40.0)
    noise[:, 1] += wave
    assert slow_part(*leaving(noise, (0, 4000))) == pytest.approx(1.5, rel=0.05)


def test_records_are_no_neighbours() -> None:
    """Rows of 2 and -2 by record: the one pair that would be negative does not count."""
    residuals = np.array([[2.0], [2.0], [-2.0], [-2.0]])
    assert slow_part(*leaving(residuals, (0, 2, 4))) == pytest.approx(2.0)


@pytest.mark.parametrize("seed", range(5))
def test_noise_larger_than_stated_is_noise(seed: int) -> None:
    """Noise of eight times what is stated leaves a mean product that is no torque; a wave as large is one."""
    noise = 8.0 * np.random.default_rng(seed).normal(size=(180, 1))
    assert at_noise(*leaving(noise, (0, 180), sigma=8.0))
    wave = 8.0 * np.sin(np.arange(180) / 5.0)[:, None]
    assert not at_noise(*leaving(wave, (0, 180), sigma=8.0))
    assert at_noise(*leaving(0.05 * wave, (0, 180)))


def test_friction_stays_where_it_leaves_nothing(passive, tmp_path) -> None:
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS)
    fit = identify(passive[0], start, AUTO)
    assert (fit.torque, fit.tried_torques) == ("friction", ())
    assert fit.acting == ("viscous friction",)


@pytest.mark.slow
def test_free_bodies_on_a_slide_keep_the_scale_of_the_picture() -> None:
    """A weight sits a little beside the pole, and the picture has all lengths and the way 1.6 times short."""
    start = load("cartpole")
    truth = scaled(start, cart=1.6, link1=1.6).with_bodies("free")
    pole = truth.values["link1.length"]
    truth = truth.with_values({"cart.mass": 0.3, "link1.com_y": 0.02 * pole})
    position = motion(truth, TIMES, [0.0, 0.5], [0.2, 0.0]) / [1.6, 1.0]
    fit = identify(record(start, TIMES, position, noise=5e-4, metric=False), start, AUTO)
    assert "free bodies" in fit.tried_torques[0].kind
    assert fit.scale == pytest.approx(1.6, rel=0.03)
    for name in ("cart.length", "link1.length"):
        assert fit.parameter(name).value == pytest.approx(truth.values[name], rel=0.03)


@pytest.mark.slow
def test_bodies_whose_mass_is_not_where_their_outline_is_are_free() -> None:
    """A weight sits near the end of the second link; no uniform body of any size moves like that."""
    uniform = load("double")
    given = {p.name: p.value for p in (*assumed_sizes(uniform), uniform.parameter("link1.length"))}
    mass, at = 0.3, 0.19
    values = uniform.values
    moved = (values["link2.mass"] * values["link2.com_x"] + mass * at) / (values["link2.mass"] + mass)
    truth = uniform.with_bodies("free").with_values(
        {
            "link2.mass": values["link2.mass"] + mass,
            "link2.com_x": moved,
            "link2.inertia": values["link2.inertia"]
            + values["link2.mass"] * (moved - values["link2.com_x"]) ** 2
            + mass * (moved - at) ** 2,
        }
    )
    poses = record(truth, TIMES, motion(truth, TIMES, [-0.4, 0.6], [0.0, 0.0]))
    known = uniform.with_choices(fix=given)
    fit = identify(poses, known, AUTO)
    assert fit.ok, fit.status
    assert [tried.kind for tried in fit.tried_torques] == ["friction with free bodies", "friction"]
    ratios = {c.name: c for c in fit.combinations}
    true = inertial_ratios(truth, truth.tree, full=True)
    for name in ("link1.J / link2.J", "link2.mx * gravity / link2.J"):
        assert ratios[name].value == pytest.approx(true[name].real, abs=4.0 * ratios[name].std)
        assert ratios[name].std < 0.05 * abs(true[name])
    # the user's word stands, and is not called trusted
    held = identify(poses, known, IdentifySettings(torque="auto", bodies="uniform"))
    assert "free bodies" not in " ".join(tried.kind for tried in held.tried_torques)
    assert held.grade != "trusted"


@pytest.mark.slow
def test_a_periodic_torque_is_taken_for_what_it_explains_of_other_rows(driven, tmp_path) -> None:
    fit = identify(driven[0], started(DOUBLE, tmp_path, 0.5, **THICKNESS), AUTO)
    assert fit.ok, fit.status
    assert (fit.torque, fit.acting[-1]) == ("fourier", "periodic torque")
    assert fit.parameter("torque.period").value == pytest.approx(PERIOD, rel=5e-3)
    assert [tried.kind for tried in fit.tried_torques] == ["periodic torque", "friction"]
    assert [tried.chosen for tried in fit.tried_torques] == [True, False]
    assert re.fullmatch(
        r"residuals of [\d.]+ times the noise, \d+ unknowns; rows kept back are off by [\d.]+ and [\d.]+ "
        r"times the noise.",
        fit.tried_torques[1].said,
    )
    off = fit.tried_torques[1].said.split("off by ")[1].split(" times")[0]
    assert f"; rows kept back are off by {off} times the noise." in fit.advice[0]
    assert fit.advice[0].startswith(
        f"The evidence is for a periodic torque, of period {fit.parameter('torque.period').value:.4g} s with "
        f"1 harmonic: {fit.tried_torques[0].said} Friction alone: "
    )


def test_wrong_proportions_are_no_friction_of_another_kind(tmp_path) -> None:
    """Links of twice and 0.7 times the width that the file has, which no table shows."""
    wider = DOUBLE.replace("0.115 0.003 0.016", "0.115 0.003 0.032").replace(
        "0.085 0.003 0.014", "0.085 0.003 0.010"
    )
    record, _ = simulated(wider, [-1.5, 0.3], 120)
    fit = identify(record, started(DOUBLE, tmp_path, 0.7))
    assert fit.ok, fit.status
    assert (fit.acting, fit.tried_torques) == (("viscous friction",), ())


@pytest.mark.slow
def test_a_torque_without_a_period_is_taken_where_sizes_are_given(tmp_path) -> None:
    record, _ = simulated(DOUBLE, [-1.5, 0.3], 100, pull)
    settings = replace(AUTO, starts=1)
    given = {"link1.length": 0.23, "link1.width": 0.032, "link2.length": 0.17, "link2.width": 0.028}
    fit = identify(record, started(DOUBLE, tmp_path, 1.0, **THICKNESS, **given), settings)
    assert (fit.torque, fit.grade) == ("free", "approximate")
    assert fit.status == (
        "Approximate. Neither friction nor a periodic torque explains the motion. One torque a joint and "
        "time stamp was taken, which explains any motion: it is right only as far as the given sizes and "
        "masses are, and predicts nothing."
    )
    fit = identify(record, started(DOUBLE, tmp_path, 1.0, **THICKNESS), settings)
    assert fit.torque != "free"


@pytest.mark.slow
def test_a_drag_that_only_led_to_the_dry_friction_is_none(tmp_path) -> None:
    """Friction without any dry friction is far off; a drag leads nearer, from where the dry one is found."""
    dry = DOUBLE.replace('damping="0.001"', f'damping="0.001" frictionloss="0.004" {STIFF}')
    poses, _ = simulated(dry, [-0.8, 0.4], 120)
    start = started(DOUBLE, tmp_path, 0.5, **THICKNESS)
    task = task_of([poses], start)
    problem = posed(start.with_torque("friction"), task.data)
    optimum, _ = task.search(problem).from_starts()
    assert not at_noise(problem, optimum)
    before = auto._Tried(auto.FRICTION, TorqueSolution(problem, optimum))
    # by the joints' drag, and by the air's
    both = auto._dragged(start, before, task, task.search(problem).route)
    assert [found.kind for found in both] == [auto.FRICTION, auto.FRICTION]
    for found in both:
        mechanism = found.solution.problem.mechanism_at(found.solution.optimum.x)
        assert mechanism.values["joint1.friction"] == pytest.approx(0.004, rel=0.05)
        assert not any(p.free for p in mechanism.parameters if p.kind in ("drag", "air"))


@pytest.mark.slow
def test_the_air_on_a_carried_link_is_told_from_a_drag_of_its_joint(tmp_path) -> None:
    """Moved with the drag of the air on both links, strong enough that no friction leads near it."""
    start = started(DOUBLE, tmp_path, 0.5, **MASSIVE)
    truth = load(tmp_path / "model.xml").with_values({"joint1.drag": 2e-3, "joint2.air": 1e-3})
    poses = record(truth, TIMES, motion(truth, TIMES, [-0.4, 0.9], [0.0, 3.0]))
    fit = identify(poses, start, AUTO)
    assert fit.acting[-1] == "air drag"
    assert fit.tried_torques[0].kind == "friction with air drag"
    for name, true in (("joint1.drag", 2e-3), ("joint2.air", 1e-3)):
        assert fit.parameter(name).value == pytest.approx(true, abs=4.0 * fit.parameter(name).std)
        assert fit.parameter(name).std < 0.1 * true
    assert fit.parameter("link1.length").value == pytest.approx(0.23, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("joint", "slack"), [("joint1", -60.0), ("joint2", -60.0), ("joint1", 60.0)])
def test_a_spring_is_named_and_where_it_is_freed_estimated(joint: str, slack: float, tmp_path) -> None:
    """MuJoCo's springs, slack off the middle of the motion: bodies whose mass lies anywhere take them up."""
    at = DOUBLE.index(f'name="{joint}" type="hinge"')
    model = DOUBLE[:at] + f'stiffness="0.05" springref="{slack}" ' + DOUBLE[at:]
    poses, _ = simulated(model, [-0.5, 0.4], 150)
    start = started(DOUBLE, tmp_path, 0.8)
    fit = identify(poses, start, AUTO)
    assert fit.grade != "trusted"
    said = [doubt.reason for doubt in fit.doubts if f"With a spring at {joint} the motion" in doubt.reason]
    found = re.search(
        r"comes (\S+) times as close to the record(, and link1.length is 0.23 m and .*):", said[0]
    )
    assert found
    times, other = found.groups()
    assert float(times) > 2.0
    assert said == [
        f"With a spring at {joint} the motion comes {times} times as close to the record{other}: if there is "
        f"one, --free {joint}.stiffness {joint}.rest."
    ]
    freed = identify(poses, start.with_choices(free=[f"{joint}.stiffness"]), AUTO)
    assert freed.grade == "trusted"
    assert freed.acting[-1] == "spring"
    for name, true in (("link1.length", 0.23), (f"{joint}.rest", np.radians(slack))):
        found = freed.parameter(name)
        assert found.value == pytest.approx(true, abs=4.0 * found.std)
        assert found.std < 0.02


def test_a_spring_that_small_swings_do_not_tell_from_weight_is_named(tmp_path) -> None:
    start = started(SINGLE, tmp_path, 1.0)
    said = {}
    for reach in (0.2, 1.2):
        poses, _ = simulated(SINGLE, [reach - np.pi / 2], 120)
        said[reach] = [s for s in identify(poses, start, AUTO).advice if "a spring at joint1" in s]
    assert [len(sentences) for sentences in said.values()] == [1, 0]
    assert said[0.2][0] == (
        "In a motion as small as this a spring at joint1 would act as weight does: link1.length holds only "
        "where there is none. A livelier motion tells them apart, with --free joint1.stiffness joint1.rest."
    )


@pytest.mark.slow
def test_a_drag_of_bodies_out_of_the_files_proportion_keeps_them_uniform() -> None:
    """Sizes that no table shows are not quite the file's: that is no reason for free bodies."""
    fit = identify(*damaged("quadratic drag", 101), AUTO)
    assert fit.tried_torques[0].kind == "friction with quadratic drag"
    assert "inertia" not in {p.name.split(".")[1] for p in fit.parameters if p.free}


@pytest.mark.slow
def test_a_drag_that_leaves_more_than_another_clock_is_none() -> None:
    """The stamps run slow against given lengths: a drag lowers what is left over, and is not the reason."""
    fit = identify(*damaged("a clock slow by 20 %", 108), AUTO)
    assert fit.grade == "refused"
    assert fit.torque == "friction"
    assert not any("drag" in name for name in (*fit.acting, *(one.kind for one in fit.tried_torques)))


@pytest.mark.parametrize(
    ("uniform", "followed", "starts"),
    [(True, True, 0), (True, False, 1), (False, True, 1), (False, False, 1)],
)
def test_further_starts_where_no_kind_with_the_same_bodies_follows(monkeypatch, uniform, followed, starts):
    """What free bodies follow from a wrong start uniform ones may follow from another."""

    def solved(uniform, follows):
        unknowns = SimpleNamespace(uniform=uniform)
        problem = SimpleNamespace(unknowns=unknowns, mechanism=SimpleNamespace(torque="friction"))
        return SimpleNamespace(problem=problem, optimum=SimpleNamespace(follows=follows))

    asked: list[Any] = []
    search = SimpleNamespace(explained=lambda optimum: optimum.follows)
    monkeypatch.setattr(Task, "search", lambda *_: search)
    monkeypatch.setattr(auto, "_explained", lambda _: False)
    monkeypatch.setattr(auto, "_explained_by_the_picture", lambda *_: False)
    monkeypatch.setattr(auto, "fit_friction", lambda *_: solved(True, False))
    monkeypatch.setattr(auto, "_further", lambda *_: solved(uniform, followed))
    monkeypatch.setattr(auto, "_from_further_starts", lambda *_: asked.append(_))
    nothing: Any = None
    auto.fit_auto(load("double"), Task(nothing, (), AUTO, None))
    assert len(asked) == starts


def test_where_further_starts_lead_to_what_a_picture_is_wrong_by_nothing_more_is_tried(monkeypatch):
    def solved(follows):
        problem = SimpleNamespace(
            unknowns=SimpleNamespace(uniform=True), mechanism=SimpleNamespace(torque="friction")
        )
        return SimpleNamespace(problem=problem, optimum=SimpleNamespace(follows=follows))

    first, again = solved(False), solved(False)
    tried: list[Any] = []
    monkeypatch.setattr(Task, "search", lambda *_: SimpleNamespace(explained=lambda optimum: False))
    monkeypatch.setattr(auto, "_explained", lambda _: False)
    monkeypatch.setattr(auto, "_explained_by_the_picture", lambda solution, _: solution is again)
    monkeypatch.setattr(auto, "fit_friction", lambda *_: first)
    monkeypatch.setattr(auto, "_further", lambda _, __, solution: tried.append(solution) or solution)
    monkeypatch.setattr(auto, "_from_further_starts", lambda *_: again)
    monkeypatch.setattr(auto, "likeliest", lambda _: 1)
    nothing: Any = None
    assert auto.fit_auto(load("double"), Task(nothing, (), AUTO, None)) is again
    assert tried == [first]


LONGER = np.arange(120) / 60.0
"""Time stamps of records that a picture is wrong about [s], (frame,)."""


def turned(truth: Mechanism, off: Sequence[float], seed: int) -> Poses:
    """Return a free motion seen by a camera that stands wrong in two ways, each by some deviations."""
    position = motion(truth, LONGER, [1.1, 0.5], [0.0, 1.0])
    shifts = leaning(position)
    wrong = position + np.tensordot(off, shifts, axes=1)
    return replace(record(truth, LONGER, wrong, seed=seed), shifts=shifts)


@pytest.mark.slow
@pytest.mark.parametrize(("off", "seed"), [((-2.6, 0.4), 3), slow((1.8, -2.5), 6)])
def test_what_a_picture_is_wrong_by_is_no_torque_and_no_mass(monkeypatch, truth, double, off, seed) -> None:
    """Left to the torques it is: free bodies, or a drag, follow the camera's errors well enough."""
    poses = turned(truth, off, seed)
    fit = identify(poses, double, AUTO)
    assert fit.grade == "trusted"
    assert not fit.tried_torques
    for name in ("link1.length", "link2.length"):
        found = fit.parameter(name)
        assert abs(found.value - truth.values[name]) < 2.5 * found.std
        assert found.value == pytest.approx(truth.values[name], rel=2e-3)
    common = fit.common_of(0)
    assert common is not None
    assert np.abs(common.mean - off).max() < 0.4
    monkeypatch.setattr(auto, "cleared", lambda *_: None)
    assert identify(poses, double, AUTO).tried_torques


@pytest.mark.slow
@pytest.mark.parametrize("drag", [{"joint1.drag": 0.002}, slow({"joint2.drag": 0.002})])
def test_a_drag_is_not_what_a_picture_is_wrong_by(truth, double, drag) -> None:
    fit = identify(turned(truth.with_values(drag), (0.5, -0.5), 0), double, AUTO)
    assert fit.tried_torques[0].kind == "friction with quadratic drag"
