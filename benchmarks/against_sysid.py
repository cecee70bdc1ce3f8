"""Compare the identification of a double pendulum with mujoco.sysid and with a plain scipy script.

Run: ``python benchmarks/against_sysid.py [--repeats N] [--json FILE] [--gate]``; it needs the
extra ``bench``. All three get the same simulated angles with the same noise, and estimate the same nine
unknowns: two lengths, the ratio of the thicknesses, two dampings and the start state.
mujoco.sysid and the script begin with the lengths 3 % off, because from the file itself they end in another
valley. Monodyn is measured three times: begun there, too, its covariance included, which is the same task;
begun at the file, with the search for start values in addition; and all of ``identify``, which looks for dry
friction, weighs the noise, and adds intervals, twins and the verdict. Times are those of the CPU.
"""

from __future__ import annotations

import contextlib
import io
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import monodyn
from figures import Figure, command_line, finish, table
from monodyn.estimation.record.samples import Pieces, ordered, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import Search
from monodyn.estimation.shooting.shoot import Optimum, Route, fit_pieces
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.verdict.uncertainty import knowledge_at
from monodyn.estimation.window import Refitted, refit, start_of, window_of
from monodyn.mechanism import Mechanism
from monodyn.mechanism.simulate import simulate
from monodyn.optimize.levenberg import SearchSettings
from monodyn.types import Poses

SPANS = (40, 150, 300)
"""Frames: 1.3, 5 and 10 s."""
RATE, NOISE = 30.0, 1e-3
"""Frames a second and standard deviation of an angle [rad]."""
WIDTH, THICKNESS, DENSITY = 0.01, 0.02, 2700.0
"""Of the links, the second one's thickness is searched [m, m, kg/m^3]."""
FILE, TRUTH = (0.1, 0.1, 1.0, 1e-3, 1e-3), (0.13, 0.09, 1.3, 6e-4, 3e-4)
"""Lengths [m], ratio of the thicknesses and dampings [N m s/rad]."""
START = (0.7, 0.4, 0.0, 0.5)
"""Angles and rates at the first frame [rad, rad/s]."""
OFF = 1.03
"""Factor by which lengths are off where a search has no start of its own."""
STEPS = 8
"""Integration steps between two frames, of order four: the fewest with which what is estimated is within a
tenth of its standard deviation of what exact integration gives (with 4 it is 0.7 to 1.3 of them off). Monodyn
chooses as many where it begins there, and twice as many for its own optimum."""
TARGET = 50.0
"""Times that Monodyn is faster than mujoco.sysid, at least."""
FROM_NOTHING = {40: 33.0}
"""Most time of a search from nothing by the frames of the record [ms]."""
BASELINE = Path(__file__).parent / "baseline" / "against_sysid.json"
"""Figures of an earlier run, with which those of this one are compared."""
ONE_MORE = {40: 10.0}
"""Most time of a fit from the optimum of the frames before, likewise [ms]."""


class Found(NamedTuple):
    """What a search has found.

    Attributes:
        values: Lengths, ratio of thicknesses and dampings, (param,).
        seconds: CPU time, its median [s].
    """

    values: np.ndarray
    seconds: float


def main() -> int:
    """Measure and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 without mujoco.sysid.
    """
    parser = command_line(__doc__, ())
    parser.add_argument("--repeats", type=int, default=9, metavar="N", help="repeats of Monodyn (9)")
    options = parser.parse_args()
    try:
        # without its own dependencies it is there, and empty
        from mujoco.sysid import ParameterDict  # noqa: F401
    except ImportError as missing:
        print(f"against_sysid.py: expected mujoco[sysid] 4: {missing}.", file=sys.stderr)
        return 2
    figures = []
    for frames in SPANS:
        figures += compared(recorded(frames), max(options.repeats, 1))
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate, baseline=BASELINE)


def compared(poses: Poses, repeats: int) -> list[Figure]:
    """Return the figures of one record, identified by all.

    Args:
        poses: The record.
        repeats: Fits of Monodyn; the others take one each.
    """
    begun = mechanism(FILE)
    by_monodyn = timed(lambda: of_monodyn(poses, begun), repeats)
    from_nothing = timed(lambda: searched(poses, begun), repeats)
    problem = problem_of(poses)
    from_there = timed(lambda: begun_there(problem, poses), repeats)
    others = {
        "mujoco.sysid, mujoco": timed(lambda: of_sysid(poses, "mujoco"), 1),
        "mujoco.sysid, scipy": timed(lambda: of_sysid(poses, "scipy"), 1),
        "scipy script": timed(lambda: of_script(poses), 1),
    }
    case, truth = f"{len(poses)} frames", np.array(TRUTH)
    figures = [
        Figure(case, "Monodyn, all of identify", 1e3 * by_monodyn.seconds, "ms"),
        Figure(case, "Monodyn, lengths off", _off(by_monodyn, truth), "%"),
        Figure(
            case,
            "Monodyn, search from nothing",
            1e3 * from_nothing.seconds,
            "ms",
            FROM_NOTHING.get(len(poses)),
        ),
        Figure(case, "Monodyn, search from nothing, lengths off", _off(from_nothing, truth), "%"),
        Figure(case, "Monodyn, begun where they begin", 1e3 * from_there.seconds, "ms"),
        Figure(case, "Monodyn, begun there, lengths off", _off(from_there, truth), "%"),
        Figure(
            case,
            "Monodyn, one frame more",
            1e3 * next_frame(poses, repeats),
            "ms",
            ONE_MORE.get(len(poses)),
        ),
    ]
    for name, found in others.items():
        figures += [
            Figure(case, name, found.seconds, "s"),
            Figure(case, f"{name}, lengths off", _off(found, truth), "%"),
        ]
    fastest = min(found.seconds for name, found in others.items() if name.startswith("mujoco"))
    script = others["scipy script"].seconds
    return [
        *figures,
        Figure(
            case,
            "mujoco.sysid / Monodyn begun there",
            fastest / from_there.seconds,
            "times",
            TARGET,
            least=True,
        ),
        Figure(case, "scipy script / Monodyn begun there", script / from_there.seconds, "times"),
        Figure(case, "mujoco.sysid / search from nothing", fastest / from_nothing.seconds, "times"),
        Figure(case, "mujoco.sysid / all of identify", fastest / by_monodyn.seconds, "times"),
        Figure(case, "scipy script / all of identify", script / by_monodyn.seconds, "times"),
    ]


def recorded(frames: int) -> Poses:
    """Return a simulated record.

    Args:
        frames: Its frames.
    """
    times = np.arange(frames) / RATE
    q0, v0 = np.split(np.array(START), 2)
    motion = simulate(mechanism(TRUTH), times, q0, v0, tolerance=1e-8).position
    noisy = motion + NOISE * np.random.default_rng(0).normal(size=motion.shape)
    covariance = np.tile(NOISE**2 * np.eye(2), (frames, 1, 1))
    seen = np.ones(frames, dtype=bool)
    return Poses(("joint1", "joint2"), np.arange(frames), times, noisy, covariance, seen, True)


def mechanism(values: tuple[float, ...] | np.ndarray) -> Mechanism:
    """Return the double pendulum at parameter values, all else given.

    Args:
        values: Lengths, ratio of thicknesses and dampings, (param,).
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "double.xml"
        file.write_text(_xml(FILE))
        loaded = monodyn.load(str(file))
    named = dict(zip(_NAMES, _own(values), strict=True))
    fixed = {"link1.width": WIDTH, "link2.width": WIDTH, "link1.thickness": THICKNESS}
    return loaded.with_choices(fix=fixed).with_values(named)


_NAMES = ("link1.length", "link2.length", "link2.thickness", "joint1.damping", "joint2.damping")


def _own(values: tuple[float, ...] | np.ndarray) -> list[float]:
    first, second, ratio, *dampings = map(float, values)
    return [first, second, ratio * THICKNESS, *dampings]


def _xml(values: tuple[float, ...] | np.ndarray) -> str:
    """Write the pendulum as MuJoCo has it."""
    first, second, ratio, damping1, damping2 = map(float, values)
    return f"""<mujoco><option timestep="{1.0 / RATE / STEPS!r}" integrator="RK4"/><worldbody>
      <body name="link1"><joint name="joint1" axis="0 -1 0" damping="{damping1!r}"/>
      <geom type="box" size="{first / 2!r} {WIDTH / 2} {THICKNESS / 2}" pos="{first / 2!r} 0 0"
        density="{DENSITY}" quat="0.7071067811865476 0.7071067811865476 0 0"/>
      <body name="link2" pos="{first!r} 0 0"><joint name="joint2" axis="0 -1 0" damping="{damping2!r}"/>
      <geom type="box" size="{second / 2!r} {WIDTH / 2} {ratio * THICKNESS / 2!r}"
        pos="{second / 2!r} 0 0"
        density="{DENSITY}" quat="0.7071067811865476 0.7071067811865476 0 0"/>
      </body></body></worldbody>
      <sensor><jointpos joint="joint1"/><jointpos joint="joint2"/></sensor></mujoco>"""


def of_monodyn(poses: Poses, begun: Mechanism) -> np.ndarray:
    """Return what Monodyn identifies, intervals included, (param,): lengths, ratio and dampings.

    Args:
        poses: The record.
        begun: The pendulum as the file has it.
    """
    fit = monodyn.identify(poses, begun, IdentifySettings(torque="friction"))
    values = [fit.parameter(name).value for name in _NAMES]
    return np.array([*values[:2], values[2] / THICKNESS, *values[3:]])


def searched(poses: Poses, begun: Mechanism) -> np.ndarray:
    """Return what Monodyn's search finds from nothing, the covariance included, (param,).

    Args:
        poses: The record.
        begun: The pendulum as the file has it.
    """
    data, smoothed = prepare((poses,), begun), (smooth(ordered(poses, begun)),)
    problem = posed(begun.with_torque("friction"), data)
    found, _ = Search(problem, smoothed, IdentifySettings(torque="friction"), None).from_starts()
    return _values_at(problem, found)


def problem_of(poses: Poses) -> Problem:
    """Return the unknowns that a fit has, with a record as data.

    Args:
        poses: The record.
    """
    begun = mechanism(FILE)
    fit = monodyn.identify(poses, begun, IdentifySettings(torque="friction"))
    return window_of(fit, begun, poses).problem


def begun_there(problem: Problem, poses: Poses) -> np.ndarray:
    """Return what Monodyn identifies from where the others begin, the covariance included, (param,).

    Args:
        problem: The unknowns, with the record as data.
        poses: The record.
    """
    guess, settings = first_guess(poses), IdentifySettings()
    begun = dict(zip(_NAMES, _own(guess[:5]), strict=True))
    x = problem.unknowns.coordinates(np.array([begun[name] for name in problem.unknowns.names]))
    start = Trial(x, guess[None, 5:], Pieces(np.array([0, len(poses)]), np.array([0])))
    search = SearchSettings(decrease=1e-4, relative=1e-7)
    route = Route(settings.piece, settings.error_bound, search)
    return _values_at(problem, fit_pieces(problem, start, route, search))


def _values_at(problem: Problem, found: Optimum) -> np.ndarray:
    """Return what a search has found, (param,), once its covariance has been worked out."""
    _, jacobian = problem.rows(found.trial)
    known = knowledge_at(problem, found.x, jacobian, found.trial.pieces)
    assert found.converged
    assert np.isfinite(known.covariance).all()
    named = problem.unknowns.named(found.x)
    values = [named[name] for name in _NAMES]
    return np.array([*values[:2], values[2] / THICKNESS, *values[3:]])


def next_frame(poses: Poses, repeats: int) -> float:
    """Return the CPU time of a fit from that of the frames but the last one [s]; all but the first stay.

    Args:
        poses: The record.
        repeats: How often.
    """
    begun = mechanism(FILE)
    fit = monodyn.identify(poses[: len(poses) - 1], begun, IdentifySettings(torque="friction"))
    window = window_of(fit, begun, poses[: len(poses) - 1])
    before = refit(window, None, *start_of(fit, window))
    return timed(lambda: _one_more(poses, before), repeats).seconds


def _one_more(poses: Poses, before: Refitted) -> np.ndarray:
    found = refit(before.window.on(poses), None, before.x, before.state)
    return np.sqrt(np.diag(found.covariance))


def first_guess(poses: Poses) -> np.ndarray:
    """Return where a search without a start of its own begins, (unknown,).

    Args:
        poses: The record.
    """
    position = poses.position
    rates = (position[2] - position[0]) * RATE / 2.0 - (position[2] - 2 * position[1] + position[0]) * RATE
    return np.array([TRUTH[0] * OFF, TRUTH[1] / OFF, *FILE[2:], *position[0], *rates])


LOWER = np.array([0.02, 0.02, 0.2, 0.0, 0.0, -10.0, -10.0, -50.0, -50.0])
UPPER = np.array([0.5, 0.5, 5.0, 0.05, 0.05, 10.0, 10.0, 50.0, 50.0])


def of_sysid(poses: Poses, optimizer: str) -> np.ndarray:
    """Return what mujoco.sysid identifies, (param,): lengths, ratio and dampings.

    Args:
        poses: The record.
        optimizer: Its optimizer.
    """
    import mujoco
    from mujoco import sysid

    guess = first_guess(poses)
    params = sysid.ParameterDict(
        {
            "body": sysid.Parameter("body", guess[:5], LOWER[:5], UPPER[:5]),
            "state": sysid.Parameter("state", guess[5:], LOWER[5:], UPPER[5:]),
        }
    )
    spec = mujoco.MjSpec.from_string(_xml(FILE))
    model = spec.compile()
    span = np.arange((len(poses) - 1) * STEPS + 2) * model.opt.timestep
    control = sysid.TimeSeries(span, np.zeros((len(span), 0)))
    mapping = sysid.TimeSeries.compute_all_sensor_mapping(model)
    measured = sysid.TimeSeries(np.asarray(poses.time), np.asarray(poses.position), mapping)
    start = sysid.create_initial_state(model, *np.split(guess[5:], 2))
    record = sysid.ModelSequences("double", spec, "record", start, control, measured)

    def built(values: sysid.ParameterDict, own: mujoco.MjSpec) -> mujoco.MjModel:
        first, second, ratio, *dampings = values["body"].value.tolist()
        links, geoms, joints = own.bodies[1:], own.geoms, own.joints
        links[1].pos = [first, 0.0, 0.0]
        for geom, length, deep in zip(geoms, (first, second), (1.0, ratio), strict=True):
            geom.size, geom.pos = [length / 2, WIDTH / 2, deep * THICKNESS / 2], [length / 2, 0.0, 0.0]
        for joint, damping in zip(joints, dampings, strict=True):
            joint.damping = [damping, 0.0, 0.0]
        return own.compile()

    def rolled(*, param_dicts: list[Any], initial_states: Any, **others: Any) -> Any:
        states = [
            sysid.create_initial_state(model, *np.split(np.asarray(one["state"].value), 2))
            for one in param_dicts
        ]
        return sysid.sysid_rollout(initial_states=np.array(states), **others)

    def off(values: Any, predicted: Any, seen: Any, *_: Any, state: np.ndarray, **__: Any) -> Any:
        # the states after each step; the first frame is the start
        at = np.searchsorted(state[:, 0], poses.time[1:] - 0.5 / RATE / STEPS)
        simulated = np.vstack((values["state"].value[:2], state[at, 1:3]))
        return (simulated - seen.data) / NOISE, predicted, seen

    residual = sysid.build_residual_fn(
        models_sequences=[record], build_model=built, custom_rollout=rolled, modify_residual=off
    )
    # its optimizers print every step
    with contextlib.redirect_stdout(io.StringIO()):
        found, _ = sysid.optimize(params, residual, optimizer=optimizer, verbose=False, max_iters=200)
    return np.array(found["body"].value)


def of_script(poses: Poses) -> np.ndarray:
    """Return what a script of a page identifies, (param,): lengths, ratio and dampings.

    Args:
        poses: The record.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import least_squares

    def residual(x: np.ndarray) -> np.ndarray:
        l1, l2, ratio, d1, d2 = x[:5]
        m1, m2 = DENSITY * WIDTH * THICKNESS * l1, DENSITY * WIDTH * THICKNESS * ratio * l2
        # about the joint
        j1, j2 = m1 * (l1**2 / 3 + WIDTH**2 / 12), m2 * (l2**2 / 3 + WIDTH**2 / 12)
        g = 9.81

        def slope(_: float, s: np.ndarray) -> list[float]:
            a, b, va, vb = s
            c, sn = np.cos(b), np.sin(b)
            coupling = m2 * l1 * l2 / 2
            h11, h12, h22 = j1 + m2 * l1**2 + j2 + 2 * coupling * c, j2 + coupling * c, j2
            own = coupling * sn
            t1 = own * vb * (2 * va + vb) - (m1 / 2 + m2) * l1 * g * np.cos(a)
            t1 -= m2 * l2 / 2 * g * np.cos(a + b) + d1 * va
            t2 = -own * va**2 - m2 * l2 / 2 * g * np.cos(a + b) - d2 * vb
            det = h11 * h22 - h12**2
            return [va, vb, (h22 * t1 - h12 * t2) / det, (h11 * t2 - h12 * t1) / det]

        found = solve_ivp(
            slope, (poses.time[0], poses.time[-1]), x[5:], t_eval=poses.time, rtol=1e-7, atol=1e-8
        )
        return ((found.y[:2].T - poses.position) / NOISE).ravel()

    return least_squares(residual, first_guess(poses), bounds=(LOWER, UPPER), x_scale="jac").x[:5]


def timed(job: Callable[[], np.ndarray], repeats: int) -> Found:
    """Return what a job finds and its CPU time; it runs once more than counts where it is repeated.

    Args:
        job: The job.
        repeats: How often it counts.
    """
    if repeats > 1:
        job()
    seconds = []
    for _ in range(repeats):
        began = time.process_time()
        values = job()
        seconds.append(time.process_time() - began)
    return Found(values, float(np.median(seconds)))


def _off(found: Found, truth: np.ndarray) -> float:
    """Return the largest error of a length [%]."""
    return 100.0 * float(np.abs(found.values[:2] / truth[:2] - 1.0).max())


if __name__ == "__main__":
    sys.exit(main())
