"""From where a mechanism can be let go, and how long its motion counts."""

from dataclasses import replace

import numpy as np

from monodyn.mechanism.simulate import energy, simulate
from monodyn.results.releases import HAND, hanging_at_rest, releases, until_parted


def test_it_hangs_where_its_energy_is_least(fit):
    np.testing.assert_allclose(hanging_at_rest(fit), [-np.pi / 2.0, 0.0], atol=1e-3)


def test_of_motions_that_part_only_the_beginning_counts(fit):
    position, times = np.radians([60.0, 120.0]), np.arange(241) / 30.0
    zero = np.zeros(2)
    start = replace(fit.starts[0], position=position, velocity=zero, time=0.0)
    together = until_parted(fit, start, times)
    assert 10 < len(together) < len(times)
    off = []
    for turned in (np.array([1e-6, 0.0]), np.array([0.0, 1e-6])):
        near, far = (simulate(fit.mechanism, times, q, zero, tolerance=1e-9).position
                     for q in (position, position + turned))  # fmt: skip
        off.append((far - near) / 1e-6)
    apart = HAND * np.linalg.norm(off, axis=0).max(axis=1)
    assert apart[: len(together)].max() < 1.05
    assert apart[len(together)] > 0.9


def test_what_is_not_held_hangs_from_what_is(fit):
    found = releases(fit)
    for one in found:
        free = np.flatnonzero(~one.held)
        for turned in (0.05, -0.05):
            moved = np.tile(one.position, (2, 1))
            moved[1, free] += turned
            # with whole degrees the least energy is missed by half a degree at most
            heights = energy(fit.mechanism.tree, moved, 0.0 * moved)
            assert len(free) == 0 or heights[0] < heights[1]
    np.testing.assert_allclose(np.degrees(found[2].position), [0.0, -90.0], atol=1e-9)
    assert found[2].held.tolist() == [True, False]
    assert {tuple(one.held) for one in found} == {(True, False), (True, True)}
