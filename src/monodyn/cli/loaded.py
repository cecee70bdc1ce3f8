"""Compiled functions loaded as what is called, without what only the compiler needs.

With each function numba keeps the program that was compiled, to put it into functions that are compiled
later, and parses it whenever the function is loaded. That takes longer than to load what is called, and in an
ordinary run 80 MB. Before the first function is loaded, numba tells the compiler of everything that it can
compile (``refresh``). Here both wait until something is compiled. Kernels that hash text would miss what the
second one registers; there are none.

What is kept of a function names the modules of numba that it was made of. They would be loaded with it, one
of them with all of scipy's linear algebra. What is called has no use for them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from llvmlite import binding
from numba.core import dispatcher, environment, event
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.environment import Environment
from numba.core.registry import cpu_target
from numba.core.runtime.nrt import rtsys

from monodyn.cli.compiled import IN_COMPILER

OBJECT = "object"
"""How numba names the functions that it keeps as code of the machine."""


class CalledLibrary(JITCodeLibrary):
    """A compiled function whose program is parsed when it is put into another one."""

    _bitcode: bytes | None = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> JITCodeLibrary:
        name, kind, kept = state
        if kind != OBJECT:
            return super()._unserialize(codegen, state)
        library = codegen.create_library(name)
        code, library._bitcode = kept
        library.enable_object_caching()
        library._set_compiled_object(code)
        library._finalize_final_module()
        return library

    def _get_module_for_linking(self) -> Any:
        if self._bitcode is not None:
            self._parse(self._bitcode)
        return super()._get_module_for_linking()

    def _parse(self, bitcode: bytes) -> None:
        """Parse the program; ``errors.is_of_cache`` knows what fails here."""
        self._shared_module = binding.parse_bitcode(bitcode)
        self._codegen._engine._load_defined_symbols(self._shared_module)
        self._bitcode = None

    def get_pointer_to_function(self, name: str) -> int:
        """Return where a function begins.

        Args:
            name: Its name among the symbols of the library.

        Returns:
            The address; 0 where there is no such function.
        """
        # the names are those of a program that was not parsed
        if self._bitcode is not None:
            return self._codegen._engine.get_function_address(name)
        return super().get_pointer_to_function(name)


class CalledCache(FunctionCache):
    """The files of a function, read without telling the compiler first what it can compile."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what is kept of a function for some types.

        Args:
            sig: The types.
            target_context: What it is for.

        Returns:
            The compiled function; None where there is none, and it is compiled.
        """
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


class Noted(event.Listener):
    """Notes what is compiled while it is: progress says why it stands still."""

    def on_start(self, event: Any) -> None:
        """Note that the compiler begins.

        Args:
            event: At what.
        """
        IN_COMPILER.append(event)

    def on_end(self, event: Any) -> None:
        """Note that it has ended.

        Args:
            event: At what.
        """
        IN_COMPILER.pop()


def load_to_call() -> None:
    """Have this process load compiled functions as what is called, and note what is compiled."""
    event.register("numba:compile", Noted())
    context: Any = cpu_target.target_context
    context.codegen()._library_class = CalledLibrary
    # what they call to take memory, which numba would register before it loads the first of them
    rtsys.initialize(context)
    functions: Any = dispatcher
    functions.FunctionCache = CalledCache
    kept: Any = environment
    kept._rebuild_env = _rebuilt(kept._rebuild_env)
    # thousands of calls of the compiler would be noted one by one for whoever measures it
    lock: Any = binding.ffi.lib._lock
    callbacks: list[Any] = list(getattr(lock, "_cblist", ()))
    for entered, left in callbacks:
        binding.ffi.unregister_lock_callback(entered, left)


def _rebuilt(rebuild: Callable[..., Environment]) -> Callable[..., Environment]:
    """Return what makes the environment of a function that is loaded, without the module that defines it.

    Code of the machine does not look there; what is compiled later loads the modules that it needs.
    """

    @wraps(rebuild)
    def rebuilt(module: str, constants: list[Any], name: str) -> Environment:
        if environment.lookup_environment(name) is None and module.startswith("numba."):
            # written out again it still names its module
            made = Environment({"__name__": module})
            made.consts[:], made.env_name = constants, name
            Environment._memo[name] = made
        return rebuild(module, constants, name)

    return rebuilt
