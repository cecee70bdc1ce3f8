"""Kernels that do not count who holds their arrays: they make none, and give none away."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core.errors import NumbaError
from numba.core.runtime.nrt import rtsys

import monodyn
from monodyn import load
from monodyn.mechanism.simulate import accelerations, rollout, rollouts_derivatives, transitions
from monodyn.mechanism.tree import Directions
from monodyn.uncounted import COUNTED, UNCOUNTED
from monodyn.vision.drawing.edges import edge_terms, no_shifts
from monodyn.vision.drawing.follow import EdgeSearch, MoveLimits, follow
from monodyn.vision.drawing.mismatch import pose_balance, row_balance
from monodyn.vision.drawing.outline import outline
from monodyn.vision.drawing.rig import rig_of
from pictures import CAMERA, drawn_mask, trusted

SOURCE = Path(monodyn.__file__).parent
OPTION = re.compile(r"\*\*(UNCOUNTED|INLINED|COUNTED)\b")
"""How a kernel says whether it counts."""
POSE = np.array([0.5, -0.8])


def uncounted() -> list[tuple[str, ast.FunctionDef]]:
    """Return all such kernels with their modules."""
    found = []
    for file in sorted(SOURCE.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if "monodyn.uncounted" not in text:
            continue
        module = ".".join(("monodyn", *file.relative_to(SOURCE).with_suffix("").parts))
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef):
                how = " ".join(ast.unparse(one) for one in node.decorator_list)
                if "**UNCOUNTED" in how or "**INLINED" in how:
                    found.append((module, node))
    return found


def is_number(module: str, part: ast.expr) -> bool:
    """Return whether an expression is a number that a module imported by another one has."""
    if not (isinstance(part, ast.Attribute) and isinstance(part.value, ast.Name)):
        return False
    imported = getattr(importlib.import_module(module), part.value.id, None)
    return isinstance(imported, ModuleType) and isinstance(getattr(imported, part.attr), int | float)


def given_away(module: str, kernel: ast.FunctionDef) -> list[str]:
    """Return what a kernel returns that may hold an array: an argument, a part of one, or what has fields."""
    named = {argument.arg for argument in kernel.args.args}
    numbers = {
        a.arg for a in kernel.args.args if a.annotation and ast.unparse(a.annotation) in ("float", "int")
    }
    doubtful = []
    for node in ast.walk(kernel):
        if not isinstance(node, ast.Return) or node.value is None:
            continue
        for part in node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]:
            is_argument = isinstance(part, ast.Name) and part.id in named - numbers
            is_slice = isinstance(part, ast.Subscript) and any(
                isinstance(n, ast.Slice) for n in ast.walk(part)
            )
            is_made = isinstance(part, ast.Call) and ast.unparse(part.func)[0].isupper()
            if (
                is_argument
                or is_slice
                or is_made
                or (isinstance(part, ast.Attribute) and part.attr != "size" and not is_number(module, part))
            ):
                doubtful.append(ast.unparse(part))
    return doubtful


def test_they_return_numbers_alone() -> None:
    """Whoever calls them counts on holding what is returned, and would let go of it once too often."""
    kernels = uncounted()
    assert len(kernels) > 60
    found = {f"{module}.{kernel.name}": given_away(module, kernel) for module, kernel in kernels}
    assert {name: parts for name, parts in found.items() if parts} == {}
    wrong = ast.parse("def wrong(rig, px: float):\n    return Rig(rig.links), px, rig, rig.first[2:]").body[0]
    assert isinstance(wrong, ast.FunctionDef)
    assert given_away("monodyn.vision.drawing.blurred", wrong) == ["Rig(rig.links)", "rig", "rig.first[2:]"]
    # a field is one whatever modules there are, and so is what a module has that is no number
    fields = ast.parse("def wrong(rig):\n    return rig.links, probe.np, probe.USED").body[0]
    assert isinstance(fields, ast.FunctionDef)
    assert given_away("monodyn.vision.drawing.blurred", fields) == ["rig.links", "probe.np"]


def test_numba_takes_both_options() -> None:
    """They are not among those that it documents."""
    kernels = {(module, kernel.name) for module, kernel in uncounted()}
    for module, name in kernels:
        compiled: Any = getattr(importlib.import_module(module), name)
        assert compiled.targetoptions["_nrt"] is False

    @njit(**UNCOUNTED)
    def makes(count: int) -> float:
        return np.zeros(count).sum()

    with pytest.raises((NumbaError, RuntimeError)):
        makes(3)

    @njit(**COUNTED)
    def made(count: int) -> float:
        return np.ones(count).sum()

    @njit(**UNCOUNTED)
    def calls(count: int) -> float:
        return made(count)

    assert calls(3) == 3.0


def _moves() -> None:
    mechanism, times = load("double"), np.linspace(0.0, 1.0, 40)
    tree, none = mechanism.tree, np.zeros(0)
    q, v = rollout(tree, times, POSE, 0.0 * POSE, substeps=4)
    accelerations(tree, q, v, 0.0 * q)
    transitions(tree, times, np.hstack((q, v)), substeps=4)
    nothing = Directions(
        np.zeros((*tree.links.shape, 0)), np.zeros((2, 0)), np.zeros((2, 0), int), *3 * (none,)
    )
    for most_off in (0.0, 1.0):
        whole, start = np.array([0, len(times)]), np.concatenate((POSE, 0.0 * POSE))[None]
        rollouts_derivatives(tree, nothing, times, whole, start, substeps=4, most_off=most_off)


def _looks() -> None:
    mechanism = load("double")
    rig, mask = rig_of(mechanism, CAMERA), drawn_mask(mechanism, CAMERA, POSE)
    limits = MoveLimits(np.full(2, -9.0), np.full(2, 9.0), np.ones(2))
    for skew in (0.0, 0.1):
        moving = rig._replace(skew=np.full(2, skew), sweep=np.full(2, skew))
        edge_terms(mask, trusted(mechanism), moving, no_shifts(moving), POSE, 4.0, 2.0)
        follow(mask, trusted(mechanism), moving, POSE + 0.02, limits, EdgeSearch(np.array([6.0, 4.0]), 2.0))
        pose_balance(row_balance(mask[0]), moving, np.tile(POSE, (3, 1)), len(rig.radius))
    outline(mechanism, CAMERA, POSE)


@pytest.mark.parametrize("work", [_moves, _looks])
def test_nothing_is_kept_or_let_go_of_twice(work: Callable[[], None]) -> None:
    """As many arrays are let go of as are made; the first time others are made to stay."""
    counting: Any = importlib.import_module("numba.core.runtime._nrt_python")
    counting.memsys_enable_stats()
    try:
        work()
        before = rtsys.get_allocation_stats()
        for _ in range(3):
            work()
        after = rtsys.get_allocation_stats()
    finally:
        counting.memsys_disable_stats()
    assert after.mi_alloc > before.mi_alloc
    assert after.mi_alloc - before.mi_alloc == after.mi_free - before.mi_free
    assert after.alloc - before.alloc == after.free - before.free


def test_what_they_call_says_how_it_is_compiled() -> None:
    """Else that would be as whatever has called it first, which a cache would hide."""
    options: dict[str, set[str]] = {}
    for file in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.decorator_list:
                how = " ".join(ast.unparse(one) for one in node.decorator_list)
                if "njit" in how:
                    options.setdefault(node.name, set()).add(how)
    silent = {name for name, hows in options.items() if not all(OPTION.search(how) for how in hows)}
    called = {
        ast.unparse(node.func)
        for _, kernel in uncounted()
        for node in ast.walk(kernel)
        if isinstance(node, ast.Call)
    }
    assert called & set(options)
    assert called & silent == set()
