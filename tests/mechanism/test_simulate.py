"""The door to motion: substeps from a stated error, what it refuses."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from monodyn.errors import MechanismError
from monodyn.mechanism import load, planar, reversals
from monodyn.mechanism import simulate as simulate_module
from monodyn.mechanism.drive import UNDRIVEN
from monodyn.mechanism.simulate import (
    Trajectory,
    accelerations,
    energy,
    rollout,
    rollout_derivatives,
    rollouts,
    rollouts_derivatives,
    simulate,
    transitions,
)
from monodyn.mechanism.substeps import least_substeps
from monodyn.mechanism.tree import CREEP, HINGE, SLIDE
from support import refuses


def test_substeps_keep_the_stated_error() -> None:
    mechanism = load("double")
    times = np.linspace(0, 1.3, 40)
    q0, v0 = np.array([0.2, 1.0]), np.zeros(2)
    exact, _ = rollout(mechanism.tree, times, q0, v0, substeps=512)
    for tolerance in (1e-3, 1e-5, 1e-7):
        steps, _ = least_substeps(
            lambda k: rollout(mechanism.tree, times, q0, v0, substeps=k)[0], tolerance, 4096
        )
        states = simulate(mechanism, times, q0, v0, tolerance=tolerance)
        error = np.abs(states.position - exact).max()
        # The estimate is of leading order; the next order is worth some tens of percent at large steps.
        assert error < 1.5 * tolerance
        if steps > 1:
            fewer, _ = rollout(mechanism.tree, times, q0, v0, substeps=steps // 2)
            assert np.abs(fewer - exact).max() > 0.5 * tolerance


def test_rollout_runs_backwards() -> None:
    mechanism = load("triple")
    q0, v0 = np.array([-0.4, 0.2, 0.1]), np.array([1.0, -1.0, 0.5])
    times = np.linspace(0, 0.5, 16)
    q, v = rollout(mechanism.tree, times, q0, v0, substeps=64)
    back, _ = rollout(mechanism.tree, times[::-1], q[-1], v[-1], substeps=64)
    # The error of RK4 at 0.5 ms, there and back.
    assert np.allclose(back[::-1], q, rtol=0, atol=1e-8)


def test_runs_end_to_end_are_those_one_by_one() -> None:
    """Runs of one row, of two, and of unequal steps; torques at knots act on some from their middle on."""
    triple = load("triple").with_torque("free", knots=np.array([0.0, 0.3, 0.35, 0.9]))
    rng = np.random.default_rng(3)
    names = [p.name for p in triple.parameters if p.kind == "torque"]
    triple = triple.with_values({name: rng.normal(scale=1e-3) for name in names})
    directions = triple.directions([*names, "link1.length", "joint2.damping"])
    first = np.array([0, 1, 3, 12, 20])
    times = np.sort(rng.uniform(0.0, 1.0, 20))
    states = rng.normal(scale=0.3, size=(4, 6))
    together = rollouts_derivatives(
        triple.tree, directions, times, first, states, substeps=3, drive=triple.drive
    )
    motion = rollouts(triple.tree, times, first, states, substeps=3, drive=triple.drive)
    for k, state in enumerate(states):
        rows = slice(first[k], first[k + 1])
        one = rollout_derivatives(
            triple.tree, directions, times[rows], *np.split(state, 2), substeps=3, drive=triple.drive
        )
        for whole, part in zip(together, one, strict=True):
            np.testing.assert_array_equal(whole[rows], part)
        alone = rollout(triple.tree, times[rows], *np.split(state, 2), substeps=3, drive=triple.drive)
        for whole, part in zip(motion, alone, strict=True):
            np.testing.assert_array_equal(whole[rows], part)
    assert together[2][:, :, : len(names)].any()


def test_a_bound_out_of_reach_ends_the_doubling() -> None:
    assert least_substeps(lambda steps: np.array([1.0 / steps]), 1e-9, 8) == (8, pytest.approx(0.125 / 15))
    assert least_substeps(lambda steps: np.array([np.nan]), 1e-3, 4) == (4, np.inf)
    # changes that stay the same
    assert least_substeps(lambda steps: np.array([np.log2(steps)]), 1e-3, 8) == (8, pytest.approx(1.0 / 15))


@pytest.mark.parametrize(
    ("error", "tried", "found"),
    [
        # of order four: what 8 steps leave follows from what 2 and 4 did
        (lambda steps: steps**-4.0, [1, 2, 4, 8], 8),
        # a slower fall is extrapolated as it is, down to a third of an order less
        (lambda steps: steps**-3.0, [1, 2, 4, 8, 16], 16),
        # one that is no order of a method is not: every number is tried
        (lambda steps: steps**-2.5, [1, 2, 4, 8, 16, 32, 64], 32),
        # nor is more taken for granted than the order gives, where what falls falls to a 24th
        (lambda steps: {1: 0.1252, 2: 5.21e-3, 4: 2.1e-4}.get(steps, 1e-5), [1, 2, 4, 8], 4),
        # what falls at once was not in the range of its order before: it is tried, too
        (lambda steps: {1: 9.0, 2: 3.0, 4: 2e-3, 8: 1e-4, 16: 1e-5}.get(steps, 0.0), [1, 2, 4, 8, 16], 8),
        # nor is what falls once
        (lambda steps: {1: 1.0, 2: 0.5, 4: 0.4, 8: 0.1, 16: 0.09, 32: 1e-9, 64: 0.0}[steps],
         [1, 2, 4, 8, 16, 32, 64], 32),
    ],
)  # fmt: skip
def test_the_last_doubling_is_known_before_it_is_tried(error, tried: list[int], found: int) -> None:
    asked = []

    def positions(steps: int) -> np.ndarray:
        asked.append(steps)
        return np.array([1.0 + error(steps)])

    steps, off = least_substeps(positions, 2.6e-4, 4096)
    assert (asked, steps) == (tried, found)
    assert error(steps) <= 2.6e-4
    assert error(steps // 2) > 2.6e-4
    assert off == pytest.approx(error(steps), rel=0.2, abs=1e-8)


@pytest.mark.parametrize("shape", [(), (1,), (3, 3)])
def test_arrays_of_other_joints_are_refused(shape: tuple[int, ...]) -> None:
    """The kernels do not look: another length would read other memory."""
    double, bad, good = load("double"), np.zeros(shape), np.zeros((3, 2))
    tree, times = double.tree, np.arange(3.0)
    entry = double.directions(["gravity"])
    message = (
        f"simulate: expected arrays of the tree's 2 joints, got one of shape {shape}; give one value a joint."
    )
    for call in (
        lambda: accelerations(tree, good, bad, good),
        lambda: energy(tree, bad, good),
        lambda: rollout(tree, times, bad, good[0], substeps=1),
        lambda: rollout_derivatives(tree, entry, times, good[0], bad, substeps=1),
    ):
        with refuses(MechanismError, message):
            call()
    with refuses(
        MechanismError,
        "simulate: expected arrays of the tree's 2 joints, got one of shape (0, 3); give one value a joint.",
    ):
        rollout(tree, times, good[0], good[0], substeps=1, drive=UNDRIVEN(3))


def test_simulate_checks_what_it_is_given() -> None:
    double, still = load("double"), np.zeros(2)
    with refuses(MechanismError, "simulate.times: must increase, but sample 1 is 0 s after 1 s."):
        simulate(double, np.array([1.0, 0.0]), still, still)
    with refuses(MechanismError, "simulate.q0: expected an array of shape (2), got (1,)."):
        simulate(double, np.arange(2.0), np.zeros(1), still)
    with refuses(MechanismError, "Trajectory.velocity: expected an array of shape (2, any), got (3, 2)."):
        Trajectory(np.arange(2.0), np.zeros((2, 2)), np.zeros((3, 2)))


def test_transitions_multiply_to_the_derivative_by_the_start() -> None:
    mechanism, times = load("double"), np.array([0.0, 0.1, 0.15, 0.3])
    with refuses(MechanismError, "transitions: expected a state at each of 4 times, got 3; give one each."):
        transitions(mechanism.tree, times, np.zeros((3, 4)), substeps=1)
    start = np.array([0.4, 0.9, -1.0, 2.0])
    motion = np.concatenate(rollout(mechanism.tree, times, *np.split(start, 2), substeps=8), axis=1)
    found = transitions(mechanism.tree, times, motion, substeps=8)
    whole = np.eye(4)
    for step in found:
        whole = step @ whole
    # against differences of the motion itself
    for i in range(4):
        ahead, behind = (
            np.concatenate(
                [part[-1] for part in rollout(mechanism.tree, times, *np.split(at, 2), substeps=8)]
            )
            for at in (start + 1e-6 * np.eye(4)[i], start - 1e-6 * np.eye(4)[i])
        )
        assert np.allclose(whole[:, i], (ahead - behind) / 2e-6, atol=1e-7)


def test_few_steps_follow_dry_friction_through_its_change_of_sign(tmp_path) -> None:
    """A mass on a spring that rubs, against another integrator of adaptive steps."""
    file = tmp_path / "rubbing.xml"
    file.write_text(
        '<mujoco><worldbody><body name="cart"><joint name="x" type="slide" axis="1 0 0" stiffness="40" '
        'frictionloss="0.8" damping="0.001"/><geom type="box" size=".1 .1 .1" mass="1"/></body></worldbody>'
        "</mujoco>"
    )
    tree, times = load(str(file)).tree, np.linspace(0.0, 3.0, 91)
    start, rest = np.array([0.5]), np.zeros(1)
    q, _ = rollout(tree, times, start, rest, substeps=2)

    def rates(_: float, state: np.ndarray) -> list[float]:
        rubbing = 0.8 * np.tanh(state[1] / CREEP[SLIDE])
        return [state[1], -40.0 * state[0] - 1e-3 * state[1] - rubbing]

    exact = solve_ivp(rates, (0.0, 3.0), [0.5, 0.0], t_eval=times, rtol=1e-11, atol=1e-12, max_step=1e-3)
    # two steps that are not divided are off by 1.4e-3
    assert np.abs(q[:, 0] - exact.y[0]).max() < 2e-5


@pytest.mark.parametrize("substeps", [1, 2, 4])
def test_a_joint_that_dry_friction_holds_has_the_right_derivatives(substeps: int) -> None:
    """Held joints have no acceleration: steps as long as without friction would leave that state."""
    held = {"joint1.friction": 0.01, "joint2.friction": 0.005}
    mechanism = load("double").with_choices(fix=held)
    times, start, rest = np.arange(120) / 60.0, np.array([-0.8, 0.4]), np.zeros(2)
    directions = mechanism.directions(("link1.length", *held))
    q, _, dq, _ = rollout_derivatives(mechanism.tree, directions, times, start, rest, substeps=substeps)

    def fine(**friction: float) -> np.ndarray:
        tree = mechanism.with_choices(fix=friction).tree
        return rollout(tree, times, start, rest, substeps=64)[0]

    assert np.abs(q - fine()).max() < 5e-5
    for k, name in enumerate(held, 1):
        ahead, behind = (fine(**{name: held[name] + side * 1e-6}) for side in (1.0, -1.0))
        assert np.allclose(dq[:, :, k], (ahead - behind) / 2e-6, rtol=2e-3, atol=0.05)


def test_what_friction_alone_gives_a_joint_is_that_of_the_whole_inertia() -> None:
    """The diagonal of the inverse inertia matrix, of a mechanism with branches."""
    tree = load("triple").tree
    n = len(tree.parent)
    q, v, work = np.array([0.3, -0.7, 1.1]), np.zeros(n), np.empty((n, planar.WORK))
    h, a = np.empty((n, n)), np.empty(n)
    planar.forward(
        tree.parent, tree.kind, tree.links, tree.gravity, q, v, np.zeros(n), np.zeros(n), work, h, a
    )
    for i in range(n):
        pushed = accelerations(tree, q[None], v[None], np.eye(n)[[i]])[0]
        assert reversals._yield(tree.parent, h, i) == pytest.approx((pushed - a)[i], rel=1e-9)


@pytest.mark.parametrize("forth", [1.0, -1.0])
def test_a_knot_is_carried_along_from_where_its_hat_begins(forth: float) -> None:
    """Each in the interval in which its torque is first not zero, on a grid far finer than the knots."""
    rng = np.random.default_rng(3)
    stamps, times = np.sort(rng.uniform(0.0, 2.0, 9)), np.sort(forth * rng.uniform(0.4, 1.6, 12))
    times = forth * times
    entry = np.array([[0, -1, 1, 2, 3, 4, -1, 5, 6]])
    begins = simulate_module._begins(stamps, times, entry, 8)
    for parameter in range(8):
        knot = np.flatnonzero(entry[0] == parameter)
        shows = []
        for a, b in itertools.pairwise(times):
            hat = np.interp(np.linspace(a, b, 2001), stamps, np.arange(9) == (knot[0] if len(knot) else -1))
            shows.append(hat[1:-1].any())
        assert begins[parameter] == (1 + shows.index(True) if any(shows) else len(times))


@pytest.mark.parametrize(("substeps", "followed"), [(1, True), (8, True), (64, False)])
def test_a_held_joint_is_followed_in_so_many_parts_between_two_stamps(substeps: int, followed: bool) -> None:
    """Each step would take 32 of them."""
    tree = load("double").with_choices(fix={"joint1.friction": 1e-2}).tree
    zero, work, h, a, hold = (
        np.zeros(2),
        np.empty((2, planar.WORK)),
        np.empty((2, 2)),
        np.empty(2),
        np.empty(2),
    )
    planar.forward(tree.parent, tree.kind, tree.links, tree.gravity, zero, zero, zero, zero, work, h, a)
    fastest = 1e-2 * reversals._yield(tree.parent, h, 0) / CREEP[HINGE]
    step = 32 * reversals.STABLE / fastest
    part = reversals.part_of_step(
        tree.parent, tree.kind, tree.links, zero, zero, h, step, step, substeps, hold
    )  # fmt: skip
    assert part == pytest.approx(step / 32 if followed else step, rel=1e-9)
    assert hold.tolist() == [0.0, 0.0] if followed else hold[0] > 0.0


def test_a_joint_under_friction_that_nothing_overcomes_stays() -> None:
    """Held without short parts, whatever moves at the other joint: as if welded."""
    mechanism = load("double").with_choices(fix={"joint2.friction": 1e4})
    times, start = np.arange(60) / 60.0, (np.array([-0.8, 0.4]), np.array([1.0, 0.0]))
    q, _ = rollout(mechanism.tree, times, *start, substeps=2)
    assert np.abs(q[:, 1] - 0.4).max() < 1e-3
    rigid, _ = rollout(mechanism.with_values({"joint2.armature": 1e9}).tree, times, *start, substeps=2)
    assert np.abs(q[:, 0] - rigid[:, 0]).max() < 1e-3
