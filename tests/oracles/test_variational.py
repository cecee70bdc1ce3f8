"""Derivatives by the variational equation, against complex steps through rollouts in finer steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from zoo import ZOO

from monodyn.mechanism import load, variational
from monodyn.mechanism.drive import FOURIER, Drive
from monodyn.mechanism.model import Mechanism
from monodyn.mechanism.simulate import rollout, rollouts, rollouts_derivatives
from monodyn.mechanism.tree import (
    AIR,
    COM_X,
    COM_Y,
    DAMPING,
    DRAG,
    FRICTION,
    INERTIA,
    MASS,
    STIFFNESS,
    Directions,
    Tree,
)

TINY = 1e-30
TIMES = np.linspace(0.0, 0.3, 10)


def resisted(name: str, tmp_path: Path, *columns: int) -> tuple[Tree, Directions]:
    """Return a tree of the zoo with what acts at every joint, and what its free parameters change."""
    path = tmp_path / "mechanism.xml"
    path.write_text(ZOO[name])
    mechanism = load(path)
    links, rng = mechanism.tree.links.copy(), np.random.default_rng(5)
    links[:, FRICTION] = 0.0
    for column in columns:
        links[:, column] = rng.uniform(1e-4, 1e-3, len(links))
    directions = mechanism.directions([p.name for p in mechanism.parameters if p.free and not p.follows])
    changes = directions.links.copy()
    changes[:, FRICTION] = 0.0
    return replace(mechanism.tree, links=links), replace(directions, links=changes)


def stepped(tree: Tree, directions: Directions, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives of positions and rates, by complex steps through 64 steps between two stamps."""
    params, dofs = directions.links.shape[2], len(tree.parent)
    columns = []
    for k in range(params + 2 * dofs):
        start = state.astype(complex)
        moved = replace(tree, links=tree.links + 0j)
        if k < params:
            moved = tree.along(directions, k, 1j * TINY)
        else:
            start[k - params] += 1j * TINY
        columns.append(rollout(moved, TIMES, *np.split(start, 2), substeps=64))
    return tuple(np.stack([one[i].imag / TINY for one in columns], axis=2) for i in range(2))


def off(found: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest difference as a share of the largest derivative by the same parameter."""
    size = np.abs(exact).max(axis=(0, 1))
    gap = np.abs(found - exact).max(axis=(0, 1))
    # what changes nothing does so to rounding
    assert np.all(gap[size < 1e-12 * size.max()] < 1e-12 * size.max())
    kept = size >= 1e-12 * size.max()
    return float((gap[kept] / size[kept]).max())


@pytest.mark.parametrize("name", ZOO)
def test_they_are_of_order_four(name: str, tmp_path: Path) -> None:
    tree, directions = resisted(name, tmp_path, DAMPING, STIFFNESS)
    state = np.random.default_rng(6).uniform(-1.0, 1.0, 2 * len(tree.parent))
    exact = stepped(tree, directions, state)
    whole = np.array([0, len(TIMES)])
    errors = []
    for substeps in (4, 8):
        q, v, *found = rollouts_derivatives(
            tree, directions, TIMES, whole, state[None], substeps=substeps, most_off=0.1
        )
        motion = rollouts(tree, TIMES, whole, state[None], substeps=substeps)
        np.testing.assert_array_equal(q, motion[0])
        np.testing.assert_array_equal(v, motion[1])
        errors.append([off(ours, theirs) for ours, theirs in zip(found, exact, strict=True)])
    # half the step leaves a sixteenth
    assert np.max(errors[0]) < 5e-3
    for rough, fine in zip(*errors, strict=True):
        assert fine < rough / 12.0


@pytest.mark.parametrize("name", ["double", "cart_branches", "tree"])
def test_what_brakes_by_the_square_of_the_rate(name: str, tmp_path: Path) -> None:
    tree, directions = resisted(name, tmp_path, DAMPING, STIFFNESS, DRAG, AIR)
    state, whole = (
        np.random.default_rng(8).uniform(-1.0, 1.0, 2 * len(tree.parent)),
        np.array([0, len(TIMES)]),
    )
    theirs = stepped(tree, directions, state)[0]
    *_, ours, _ = rollouts_derivatives(tree, directions, TIMES, whole, state[None], substeps=16, most_off=0.1)
    *_, very, _ = rollouts_derivatives(tree, directions, TIMES, whole, state[None], substeps=16)
    assert not np.array_equal(ours, very)
    assert off(ours, theirs) < 2e-3


def test_runs_of_many_lengths_and_parameters_that_change_nothing() -> None:
    triple = load("triple")
    directions = triple.directions(["link1.length", "link3.thickness", "joint2.damping", "gravity"])
    links = np.insert(directions.links, 2, 0.0, axis=2)
    gravity = np.insert(directions.gravity, 2, 0.0, axis=1)
    directions = Directions(links, gravity, directions.entry, *np.zeros((3, 5)))
    first, rng = np.array([0, 1, 3, 3, 12, 20]), np.random.default_rng(3)
    times, states = np.sort(rng.uniform(0.0, 1.0, 20)), rng.normal(scale=0.3, size=(5, 6))
    together = rollouts_derivatives(triple.tree, directions, times, first, states, substeps=64, most_off=0.1)
    exact = rollouts_derivatives(triple.tree, directions, times, first, states, substeps=64)
    for ours, theirs in zip(together[2:], exact[2:], strict=True):
        assert not np.array_equal(ours, theirs)
        assert not ours[:, :, 2].any()
        assert off(ours, theirs) < 1e-3
    for k in (1, 3, 4):
        rows = slice(first[k], first[k + 1])
        alone = rollouts_derivatives(
            triple.tree, directions, times[rows], np.array([0, first[k + 1] - first[k]]), states[[k]],
            substeps=64, most_off=0.1,
        )  # fmt: skip
        for whole, part in zip(together, alone, strict=True):
            np.testing.assert_array_equal(whole[rows], part)


def dry(mechanism: Mechanism) -> tuple[Tree, dict]:
    """Return a tree with dry friction."""
    links = mechanism.tree.links.copy()
    links[0, FRICTION] = 1e-3
    return replace(mechanism.tree, links=links), {}


def driven(mechanism: Mechanism) -> tuple[Tree, dict]:
    """Return a tree with a torque over time."""
    return mechanism.tree, {"drive": Drive(FOURIER, np.array([0.5]), np.full((2, 3), 0.01))}


@pytest.mark.parametrize(
    ("acting", "substeps", "scale", "most_off"),
    [(dry, 8, 1.0, np.inf), (driven, 8, 1.0, np.inf), (lambda one: (one.tree, {}), 3, 1.0, np.inf),
     (lambda one: (one.tree, {}), 2, 100.0, 0.1), (lambda one: (one.tree, {}), 8, 0.0, 0.1)],
    ids=["dry friction", "a torque over time", "an odd number of steps", "steps too long", "at rest"],
)  # fmt: skip
def test_where_they_would_not_do_the_exact_ones_come(
    acting, substeps: int, scale: float, most_off: float
) -> None:
    double = load("double")
    tree, more = acting(double)
    directions = double.directions(["link1.length", "joint1.damping"])
    if more:
        directions = replace(directions, entry=np.full((2, 3), -1))
    state = scale * np.array([[0.7, 0.4, 0.2, 0.5]])
    if scale == 0.0:
        state = np.array([[-np.pi / 2, 0.0, 0.0, 0.0]])
        tree = replace(tree, gravity=np.zeros(2))
    ways = [
        rollouts_derivatives(
            tree, directions, TIMES, np.array([0, 10]), state, substeps=substeps, most_off=bound, **more
        )
        for bound in (most_off, 0.0)
    ]
    for ours, theirs in zip(*ways, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_dry_friction_that_is_zero_but_free_takes_the_exact_ones() -> None:
    double = load("double")
    directions = double.directions(["link1.length", "joint1.friction"])
    state, whole = np.array([[0.7, 0.4, 0.2, 0.5]]), np.array([0, len(TIMES)])
    ways = [
        rollouts_derivatives(double.tree, directions, TIMES, whole, state, substeps=8, most_off=most_off)
        for most_off in (0.1, 0.0)
    ]
    np.testing.assert_array_equal(ways[0][2], ways[1][2])


def test_what_is_exact_enough_is_the_callers_question() -> None:
    double = load("double")
    directions = double.directions(["link1.length"])
    state, whole = np.array([[1.8, 1.2, 2.4, 6.0]]), np.array([0, len(TIMES)])
    exact, rough, fine = (
        rollouts_derivatives(double.tree, directions, TIMES, whole, state, substeps=4, most_off=most_off)[2]
        for most_off in (0.0, 0.1, 1e-3)
    )
    assert not np.array_equal(rough, exact)
    np.testing.assert_array_equal(fine, exact)


def test_no_parameters_no_runs_and_the_other_way_through_time() -> None:
    double = load("double")
    nothing = double.directions([])
    state = np.array([[0.3, 0.2, 0.4, 1.0]])
    back = TIMES[::-1].copy()
    found, exact = (
        rollouts_derivatives(
            double.tree, nothing, back, np.array([0, 10]), state, substeps=16, most_off=most_off
        )[2]
        for most_off in (0.1, 0.0)
    )
    assert found.shape == (10, 2, 4)
    assert not np.array_equal(found, exact)
    assert off(found, exact) < 1e-3
    none = rollouts_derivatives(
        double.tree, nothing, np.zeros(0), np.array([0]), np.zeros((0, 4)), substeps=2, most_off=0.1
    )
    assert none[2].shape == (0, 2, 4)


@pytest.mark.parametrize("amplitude", [0.0, 0.01])
def test_a_fast_joint_does_not_hide_a_stiff_one_that_hardly_moves(amplitude: float, tmp_path: Path) -> None:
    """A slow pendulum beside a light one on a stiff spring, for which the steps are too long by far; of the
    rates of both together that is a fifth."""
    path = tmp_path / "two.xml"
    path.write_text("""<mujoco><worldbody>
      <body><joint name="slow" axis="0 -1 0"/><geom type="capsule" size="0.01" fromto="0 0 0 0.3 0 0"/></body>
      <body pos="1 0 0"><joint name="stiff" axis="0 -1 0" stiffness="0.005" damping="1e-6"/>
        <geom type="capsule" size="0.002" fromto="0 0 0 0.05 0 0"/></body></worldbody></mujoco>""")
    two = load(path)
    directions = two.directions(["stiff.stiffness"])
    state, whole = np.array([[0.5, amplitude, 1.0, 0.0]]), np.array([0, len(TIMES)])
    found, exact = (
        rollouts_derivatives(two.tree, directions, TIMES, whole, state, substeps=2, most_off=most_off)[2]
        for most_off in (0.3, 0.0)
    )
    np.testing.assert_array_equal(found, exact)


def test_a_run_at_rest_and_one_without_end_say_nothing_of_the_others() -> None:
    double = load("double")
    directions = double.directions(["link1.length"])
    moving, rest = [0.3, 0.2, 0.4, 1.0], [-np.pi / 2, 0.0, 0.0, 0.0]
    times, first = np.concatenate((TIMES,) * 3), np.array([0, 10, 20, 30])
    states = np.array([moving, rest, [0.0, 0.0, 1e200, 0.0]])
    with np.errstate(all="ignore"):
        found, exact = (
            rollouts_derivatives(
                double.tree, directions, times, first, states, substeps=16, most_off=most_off
            )[2]
            for most_off in (0.1, 0.0)
        )
    assert not np.array_equal(found[:20], exact[:20])
    assert off(found[:10], exact[:10]) < 1e-3
    assert off(found[10:20], exact[10:20]) < 1e-2
    np.testing.assert_array_equal(np.isfinite(found[20:]), np.isfinite(exact[20:]))


@pytest.mark.parametrize("scale", [1.0, 6.0, 12.0])
def test_how_far_off_they_are_is_seen_in_the_rates(scale: float) -> None:
    double = load("double")
    directions = double.directions(["link1.length", "link2.thickness", "joint1.damping"])
    state, whole = scale * np.array([[0.3, 0.2, 0.4, 1.0]]), np.array([0, len(TIMES)])
    exact = rollouts_derivatives(double.tree, directions, TIMES, whole, state, substeps=64)
    for substeps in (2, 4, 8):
        *found, seen = variational.variations(
            double.tree.parent, double.tree.kind, double.tree.links, directions.links, double.tree.gravity,
            directions.gravity, TIMES, whole, substeps, state,
        )  # fmt: skip
        error = off(found[2], exact[2])
        assert seen < 3.0 * error
        assert error < 3.0 * seen + 2e-3


def test_stiff_damping_does_not_make_them_grow() -> None:
    """Steps of the motion that just do for a joint's damping are twice too long for those of an explicit
    method."""
    single = load("single")
    links = single.tree.links.copy()
    own = links[0, INERTIA] + links[0, MASS] * (links[0, COM_X] ** 2 + links[0, COM_Y] ** 2)
    step = (TIMES[1] - TIMES[0]) / 4
    links[0, DAMPING] = 2.0 * own / step
    tree, directions = replace(single.tree, links=links), single.directions(["link1.length"])
    whole, state = np.array([0, len(TIMES)]), np.array([[0.5, 1.0]])
    *_, found, _ = rollouts_derivatives(tree, directions, TIMES, whole, state, substeps=4, most_off=0.1)
    *_, very, _ = rollouts_derivatives(tree, directions, TIMES, whole, state, substeps=4)
    *_, exact, _ = rollouts_derivatives(tree, directions, TIMES, whole, state, substeps=64)
    assert not np.array_equal(found, very)
    assert np.abs(found - exact).max() < 0.1 * np.abs(exact).max()
