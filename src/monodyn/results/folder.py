"""The run folder: which files are ours, and how they get there without ever destroying anything.

Every file is written beside its place and renamed into it when it is whole. A folder that already holds a run
is refused unless it may be replaced; then the new run grows in the sub-folder ``unfinished`` and takes the
old one's place only when it is complete, so a full disk or Ctrl-C leaves the old run as it was.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path

from monodyn.errors import SettingsError

FILES = (
    "poses.csv",
    "states.csv",
    "prediction.csv",
    "fit.json",
    "model.xml",
    "model.urdf",
    "overlay.mp4",
    "report.html",
    "run.json",
)
"""Names of the files of a run; nothing else in the folder is ever touched."""

STAGE = "unfinished"


class RunFolder:
    """An output folder that takes the files of one run.

    Attributes:
        path: The folder the user asked for.
        stage: Folder the files are written to; another one than ``path`` while an old run is being replaced.
        written: Names of the files written so far.
    """

    def __init__(self, path: str | Path, *, force: bool = False) -> None:
        """Check that the folder can take a run and create it.

        Args:
            path: The folder; it is created with its parents when it does not exist.
            force: Replace a run that is already there.

        Raises:
            SettingsError: the path is a file, holds a run and ``force`` is not set, or cannot be created.
        """
        self.path = Path(path)
        self.written: list[str] = []
        if self.path.exists() and not self.path.is_dir():
            raise SettingsError(f"out '{self.path}': expected a folder, got a file; give another name.")
        old = [name for name in FILES if (self.path / name).exists()]
        if old and not force:
            raise SettingsError(
                f"out '{self.path}': expected a folder without a run, it holds {old[0]}; "
                "give another folder, or --force to replace the run."
            )
        self.stage = self.path / STAGE if old else self.path
        self._made = [folder for folder in (self.stage, *self.stage.parents) if not folder.exists()]
        try:
            self.stage.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._cannot("create the folder", error) from error

    def write(self, name: str, writer: Callable[[Path], None]) -> None:
        """Write one file; it appears under its name only when it is whole.

        Args:
            name: One of ``FILES``.
            writer: Writes the file at the path it is given.

        Raises:
            SettingsError: the file cannot be written (disk full, no permission).
        """
        if name not in FILES:
            raise AssertionError(f"{name} is not a file of a run")
        part = self.stage / f".{name}.part"
        try:
            writer(part)
            os.replace(part, self.stage / name)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise self._cannot(f"write {name}", error) from error
        except BaseException:
            part.unlink(missing_ok=True)
            raise
        if name not in self.written:
            self.written.append(name)

    def write_text(self, name: str, text: str) -> None:
        """Write one text file.

        Args:
            name: One of ``FILES``.
            text: Its content.

        Raises:
            SettingsError: the file cannot be written (disk full, no permission).
        """
        self.write(name, lambda part: _write_text(part, text))

    def finish(self) -> None:
        """Put a complete run into its place and remove what is left of the old one.

        Raises:
            SettingsError: a file cannot be moved.
        """
        if self.stage == self.path:
            return
        try:
            for name in FILES:
                if name in self.written:
                    os.replace(self.stage / name, self.path / name)
                else:
                    (self.path / name).unlink(missing_ok=True)
                    (self.stage / name).unlink(missing_ok=True)
            if not any(self.stage.iterdir()):
                self.stage.rmdir()
        except OSError as error:
            raise self._cannot("replace the old run", error) from error
        self.stage = self.path

    def abandon(self) -> None:
        """Remove the folders that were created for a run of which nothing was written."""
        if self.written:
            return
        for folder in self._made:
            try:
                folder.rmdir()
            except OSError:
                return

    def _cannot(self, what: str, error: OSError) -> SettingsError:
        why = error.strerror or str(error)
        cure = "free some space or give" if error.errno == errno.ENOSPC else "give"
        return SettingsError(f"out '{self.path}': cannot {what} ({why}); {cure} another folder with --out.")


def _write_text(path: Path, text: str) -> None:
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
