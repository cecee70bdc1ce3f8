"""The folder of an experiment: files grow in a hidden sub-folder and come to their names all at once."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from monodyn.errors import SettingsError

FILES = ("clip.mp4", "truth.json", "start.xml", "table.csv", "reproduce.json", "reproduce.html")
"""Names of the files of an experiment; nothing else in the folder is ever touched."""


class Place:
    """A folder that takes the files of one experiment.

    Attributes:
        path: The folder the user asked for.
    """

    def __init__(self, path: str | Path, *, force: bool = False, inputs: Sequence[object] = ()) -> None:
        """Check that the folder can take an experiment.

        Args:
            path: The folder; it is created with its parents when it does not exist.
            force: Replace an experiment that is already there.
            inputs: Files that are read; none may be one that the experiment would replace.

        Raises:
            SettingsError: the path is empty or a file, holds an experiment and ``force`` is not set, or holds
                an input under a name of ours.
        """
        if not str(path):
            raise SettingsError("out: expected the name of a folder, got an empty one; give one with --out.")
        self.path, self._stage = Path(path), Path(path)
        if self.path.exists() and not self.path.is_dir():
            raise SettingsError(f"out '{self.path}': expected a folder, got a file; give another name.")
        old = [name for name in FILES if (self.path / name).exists()]
        if old and not force:
            raise SettingsError(
                f"out '{self.path}': expected a folder without an experiment, it holds {old[0]}; "
                "give another folder, or --force to replace the experiment."
            )
        for given in (Path(str(value)) for value in inputs if value is not None):
            if given.is_file() and any((self.path / name).samefile(given) for name in old):
                raise SettingsError(
                    f"out '{self.path}': expected another folder than that of the inputs, got the one of "
                    f"'{given}', which the experiment would replace; give another with --out."
                )

    @contextmanager
    def filling(self) -> Iterator[None]:
        """Take files until the block ends, then put them into place; an error leaves the folder as it was.

        Raises:
            SettingsError: the folder or a file cannot be written.
        """
        made = [folder for folder in (self.path, *self.path.parents) if not folder.exists()]
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            self._stage = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=self.path))
        except OSError as error:
            raise self._cannot("create the folder", error) from error
        try:
            yield
            for name in FILES:
                if (self._stage / name).exists():
                    os.replace(self._stage / name, self.path / name)
                else:
                    (self.path / name).unlink(missing_ok=True)
            made = []
        except OSError as error:
            raise self._cannot("write", error) from error
        finally:
            shutil.rmtree(self._stage, ignore_errors=True)
            for folder in made:
                try:
                    folder.rmdir()
                except OSError:
                    break

    def at(self, name: str) -> Path:
        """Return where a file is while the folder is being filled.

        Args:
            name: One of ``FILES``.
        """
        if name not in FILES:
            raise AssertionError(f"{name} is not a file of an experiment")
        return self._stage / name

    def write_text(self, name: str, text: str) -> None:
        """Write one text file.

        Args:
            name: One of ``FILES``.
            text: Its content.
        """
        self.at(name).write_text(text, encoding="utf-8", newline="\n")

    def _cannot(self, what: str, error: OSError) -> SettingsError:
        why = error.strerror or str(error)
        return SettingsError(f"out '{self.path}': cannot {what} ({why}); give another folder with --out.")
