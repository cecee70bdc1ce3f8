"""A finished run takes the place of an old one in one step: whatever stops it, the folder holds one of them.

The new run is a folder of its own. It goes beside the old one, and the two exchange their names: that is the
step. What else is in the folder follows, each name on its own; until then a link in its place leads to it.

Where the system has no such step, or the folder has to stay (it is the working folder, a mount, somebody
else's), all old files move aside, one renaming says that the new run is the one that counts, and all new
files move in. What was stopped on the way is undone before that renaming, and completed after it, by
``settle``.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from monodyn.errors import SettingsError
from monodyn.results.exchange import can_exchange, exchange, settle_on_disk
from monodyn.results.lock import LOCK, FolderLock

STAGE = "unfinished"
"""Sub-folder in which a new run is written."""
NEW = ".monodyn.new"
"""A file in the new one of the two folders that exchange their names; it lists the files of the old run."""
ARRIVING = ".monodyn.arriving"
"""What ``STAGE`` is called while its files move in."""
ASIDE = ".monodyn.replaced"
"""Sub-folder in which the old files are meanwhile."""


def take_place(path: Path, files: Sequence[str], lock: FolderLock) -> None:
    """Put the run in the sub-folder ``STAGE`` in the place of the one in its folder.

    Args:
        path: The folder.
        files: Names of the files that make up a run; nothing else in the folder is ever touched.
        lock: The lock of the folder; it goes on to the new one.

    Raises:
        OSError: A file cannot be moved. Then, as after Ctrl-C, ``settle`` is to be called.
    """
    old = [name for name in files if os.path.lexists(path / name)]
    real = path.resolve()
    if _may_go(real):
        try:
            lock.spread(real / STAGE)
            _exchange(real, old)
        except OSError:
            _undo(real)
        else:
            _carry_over(real)
            return
    _move(path, old)


def settle(path: Path) -> None:
    """Undo a swap that was stopped before its step, and complete one that was stopped after it.

    Args:
        path: The folder, which is locked.

    Raises:
        SettingsError: The list of the files of the old run cannot be read.
        OSError: A file cannot be moved.
    """
    if not is_unsettled(path):
        return
    real = path.resolve()
    if (_beside(real) / NEW).exists():
        _undo(real)
    elif (real / NEW).exists():
        _carry_over(real)
    if (path / ARRIVING).is_dir():
        _move_in(path)
    elif (path / ASIDE).is_dir():
        _move_back(path)


def is_unsettled(path: Path) -> bool:
    """Return whether a swap in a folder was stopped, or goes on.

    Args:
        path: The folder.
    """
    real = path.resolve()
    # the whole of a disk has no name to exchange
    if not real.name:
        return False
    return any(place.exists() for place in (_beside(real) / NEW, real / NEW, path / ARRIVING, path / ASIDE))


def _beside(real: Path) -> Path:
    """Return where the one folder is that does not have the name."""
    return real.with_name(f".{real.name}.replacing")


def _link(real: Path, name: str) -> str:
    """Return what the link says that stands for a name until that follows."""
    return f"../{_beside(real).name}/{name}"


def _is_link(place: Path, said: str) -> bool:
    return place.is_symlink() and os.readlink(place) == said


def _may_go(real: Path) -> bool:
    """Return whether a folder may give its name to another one."""
    try:
        # whoever stands in it would go with it, and whoever it belongs to would lose it
        stands = real.samefile(Path.cwd())
        owned = not hasattr(os, "geteuid") or real.stat().st_uid == os.geteuid()
    except OSError:
        return False
    return can_exchange() and owned and not stands and not os.path.lexists(_beside(real))


def _exchange(real: Path, old: Sequence[str]) -> None:
    """Exchange the names of a folder and of the new run, which gets a link for all else in the folder."""
    stage, beside = real / STAGE, _beside(real)
    (stage / NEW).write_text(json.dumps(old), encoding="utf-8")
    settle_on_disk(stage / NEW)
    with suppress(OSError):
        shutil.copystat(real, stage)
    os.rename(stage, beside)
    for name in os.listdir(real):
        if name != LOCK and name not in old:
            os.symlink(_link(real, name), beside / name)
    settle_on_disk(beside)
    settle_on_disk(real.parent)
    exchange(real, beside)
    settle_on_disk(real.parent)


def _carry_over(real: Path) -> None:
    """Have all else in the old folder follow the name, and remove the old run."""
    beside = _beside(real)
    if beside.is_dir():
        for name in os.listdir(beside):
            said = _link(real, name)
            if _is_link(real / name, said):
                exchange(real / name, beside / name)
            if _is_link(beside / name, said):
                (beside / name).unlink()
        # without the list what has followed is safe, and the rest stays where it is
        old = _listed(real / NEW, beside)
        for name in os.listdir(beside):
            # it came while the others were linked
            if name not in old and name != LOCK and not os.path.lexists(real / name):
                os.rename(beside / name, real / name)
        settle_on_disk(real)
        for name in (*old, LOCK):
            (beside / name).unlink(missing_ok=True)
        # what nobody knows stays where it is
        with suppress(OSError):
            beside.rmdir()
    (real / NEW).unlink()


def _listed(file: Path, beside: Path) -> list[str]:
    """Return the names of the files of the old run, as they were written down before the step."""
    try:
        names = json.loads(file.read_text(encoding="utf-8"))
        # a name that leads elsewhere is none of ours
        if isinstance(names, list) and all(isinstance(one, str) and Path(one).name == one for one in names):
            return names
    except ValueError:
        pass
    raise SettingsError(
        f"'{file}': expected the list of the files of the run that was replaced, got a file that is damaged; "
        f"these files are in '{beside}': move what you need of them elsewhere, then remove both."
    )


def _undo(real: Path) -> None:
    """Put a new run that did not get the name back into the folder."""
    beside, stage = _beside(real), real / STAGE
    if (beside / NEW).exists():
        for name in os.listdir(beside):
            if _is_link(beside / name, _link(real, name)):
                (beside / name).unlink()
        os.rename(beside, stage)
    for name in (NEW, LOCK):
        (stage / name).unlink(missing_ok=True)


def _move(path: Path, old: Sequence[str]) -> None:
    """Move the files of the old run aside and those of the new one in."""
    (path / ASIDE).mkdir()
    for name in old:
        os.replace(path / name, path / ASIDE / name)
    settle_on_disk(path)
    os.rename(path / STAGE, path / ARRIVING)
    settle_on_disk(path)
    _move_in(path)


def _move_in(path: Path) -> None:
    """Move the files of a new run in, and remove those of the old one."""
    for name in os.listdir(path / ARRIVING):
        os.replace(path / ARRIVING / name, path / name)
    settle_on_disk(path)
    # the folder that says how far it came goes last
    if (path / ASIDE).is_dir():
        for name in os.listdir(path / ASIDE):
            (path / ASIDE / name).unlink()
        (path / ASIDE).rmdir()
    (path / ARRIVING).rmdir()


def _move_back(path: Path) -> None:
    """Move the files of an old run back from where they were moved aside."""
    for name in os.listdir(path / ASIDE):
        if not os.path.lexists(path / name):
            os.replace(path / ASIDE / name, path / name)
    # what is there twice stays, and no other run takes the place
    with suppress(OSError):
        (path / ASIDE).rmdir()
