"""Derivatives of the accelerations in one state, against complex steps through the other kernel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from zoo import ZOO

from monodyn.mechanism import load
from monodyn.mechanism.simulate import acceleration_derivatives, accelerations
from monodyn.mechanism.tree import AIR, DRAG, FRICTION, STIFFNESS, Tree

TINY = 1e-30


@pytest.mark.parametrize("name", ZOO)
def test_derivatives_are_those_of_complex_steps(name: str, tmp_path: Path) -> None:
    path = tmp_path / "mechanism.xml"
    path.write_text(ZOO[name])
    mechanism = load(path)
    names = [p.name for p in mechanism.parameters if p.free and not p.follows]
    directions = mechanism.directions(names)
    # everything that can act at a joint does
    links, rng = mechanism.tree.links.copy(), np.random.default_rng(11)
    for column in (FRICTION, STIFFNESS, DRAG, AIR):
        links[:, column] = rng.uniform(1e-4, 1e-3, len(links))
    tree = Tree(mechanism.tree.parent, mechanism.tree.kind, links, mechanism.tree.gravity)
    dofs = len(links)
    q, v, tau = rng.normal(size=(3, 4, dofs))
    # near rest, where dry friction is steep
    v[0] *= 1e-3
    at, slopes = acceleration_derivatives(tree, directions, q, v, tau)
    np.testing.assert_allclose(at, accelerations(tree, q, v, tau), rtol=1e-12)
    assert slopes.shape == (4, dofs, len(names) + 3 * dofs)
    # where moving a slide changes nothing, terms of the size of the accelerations cancel
    rounding = 1e-9 * np.abs(at).max()
    for p in range(len(names)):
        moved = accelerations(tree.along(directions, p, 1j * TINY), q, v, tau).imag / TINY
        np.testing.assert_allclose(slopes[:, :, p], moved, rtol=1e-9, atol=rounding, err_msg=names[p])
    thorough = Tree(tree.parent, tree.kind, tree.links + 0j, tree.gravity + 0j)
    for k, way in enumerate(1j * TINY * np.eye(3 * dofs)):
        steps = np.split(way, 3)
        moved = accelerations(thorough, q + steps[0], v + steps[1], tau + steps[2]).imag / TINY
        np.testing.assert_allclose(slopes[:, :, len(names) + k], moved, rtol=1e-9, atol=rounding)
