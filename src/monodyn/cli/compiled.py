"""Where compiled functions are kept, whether there are any, and how those that are damaged are forgotten."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from pathlib import Path

IN_COMPILER: list[object] = []
"""What the compiler is at, the innermost last."""


def keep_compiled() -> str:
    """Choose a temporary folder for compiled functions when the usual ones cannot be written.

    Returns:
        A sentence for the user, or nothing.
    """
    if any(_writable(folder) for folder in _compiled_places()):
        return ""
    folder = Path(tempfile.gettempdir()) / f"monodyn-{getattr(os, 'getuid', int)()}"
    # the name can be guessed: somebody else may have made the folder to have code run by us
    if not _private(folder):
        folder = Path(tempfile.mkdtemp(prefix="monodyn-"))
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    return f"no usual folder for compiled functions can be written; they are kept in '{folder}'."


def compiled_before() -> bool:
    """Return whether the functions that simulate, which every computation needs, were compiled before."""
    return any(next(folder.rglob("planar.*.nbi"), None) for folder in _compiled_places())


def forget_compiled() -> None:
    """Remove what is kept of the compiled functions of all modules that are loaded."""
    from numba.core.dispatcher import Dispatcher

    modules = [module for name, module in sys.modules.items() if name.startswith("monodyn.")]
    compiled = [each for module in modules for each in vars(module).values() if isinstance(each, Dispatcher)]
    for folder in {Path(each.stats.cache_path) for each in compiled if each.stats.cache_path}:
        for file in folder.glob("*.nb[ci]"):
            with contextlib.suppress(OSError):
                file.unlink()


def _compiled_places() -> list[Path]:
    """Return the folders for compiled functions, as numba tries them."""
    import monodyn

    given = os.environ.get("NUMBA_CACHE_DIR")
    return (
        [Path(given)]
        if given
        else [Path(monodyn.__file__).parent / "mechanism" / "__pycache__", _user_cache()]
    )


def _user_cache() -> Path:
    """Return the user's folder for compiled functions, as numba names it."""
    if sys.platform == "darwin":
        return Path("~/Library/Caches/numba").expanduser()
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", "~/AppData/Local")).expanduser() / "numba"
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "numba"


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except (OSError, RuntimeError):
        return False


def _private(folder: Path) -> bool:
    """Return whether a folder, made if need be, is ours alone: compiled functions are code that is run."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return False
    ours = not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & 0o077)
    return ours and not folder.is_symlink() and _writable(folder)
