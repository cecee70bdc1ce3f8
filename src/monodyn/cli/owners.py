"""Programs of LLVM that have one owner, wherever Ctrl-C comes while something is compiled.

llvmlite has a program linked into another one, which destroys it, or given to the engine, which then owns it,
and notes that afterwards. Ctrl-C comes between the two more often than anywhere else, for it waits until LLVM
is done; the program would then be destroyed twice, which ends the process by a fault. Here it is noted
before: at worst a program is left over at the end of a process.
"""

from __future__ import annotations

from functools import wraps
from typing import Any

from llvmlite.binding import ModuleRef, executionengine, ffi, module


def note_owners_before() -> None:
    """Have this process note who owns a program before its owner takes it."""
    linking: Any = module
    linking.link_modules = _link
    engine: Any = executionengine.ExecutionEngine
    add = engine.add_module

    @wraps(add)
    def added(self: Any, taken: Any) -> None:
        taken._owned = True
        add(self, taken)

    engine.add_module = added


def _link(into: ModuleRef, other: ModuleRef) -> None:
    """Put a program into another one; ``other`` is nobody's to destroy afterwards."""
    library: Any = ffi.lib
    # one that is nobody's already has none, and says so
    pointer = other._as_parameter_
    other.detach()
    with ffi.OutputString() as said:
        if library.LLVMPY_LinkModules(into, pointer, said):
            raise RuntimeError(str(said))
