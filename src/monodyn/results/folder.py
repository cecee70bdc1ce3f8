"""The run folder: which files are ours, and how they get there without ever destroying anything.

Every file is written under another name and renamed when it is whole. A folder that already holds a run is
refused unless it may be replaced. Then the new run is written into the sub-folder ``unfinished`` and takes
the place of the old one only when it is complete, so that a full disk or Ctrl-C leaves the old run as it was.
The swap moves all of the old run aside (``replaced``) before the first new file arrives: whatever stops it,
the folder never holds files of two runs. Results of other kinds get into their folders in the same way.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from monodyn.choices import MOST_DRAWN
from monodyn.errors import SettingsError

DRAWN = tuple(f"ensemble_{number:02d}.xml" for number in range(MOST_DRAWN))
"""Names of the models that are drawn from what the data allow."""
FILES = (
    "poses.csv",
    "camera.csv",
    "states.csv",
    "torques.csv",
    "prediction.csv",
    "fit.json",
    "model.xml",
    "model.urdf",
    "clip.mp4",
    "overlay.mp4",
    "diagnosis.png",
    "report.html",
    "error.log",
    *DRAWN,
    "run.json",
)
"""Names of the files of a run; nothing else in the folder is ever touched."""

SIGNS = {
    "run": ("fit.json", "run.json"),
    "controller": ("control.json",),
    "prediction": ("prediction.json",),
}
"""Files by which a folder is known to hold a result, by the word of its kind; others have names in common."""

STAGE = "unfinished"
ASIDE = "replaced"


@dataclass(frozen=True)
class FolderKind:
    """What an output folder holds.

    Attributes:
        word: What it is called in messages.
        files: Names of its files; nothing else in the folder is ever touched.
        whole: True where the files come to their names all at once, not one by one.
    """

    word: str
    files: tuple[str, ...]
    whole: bool = False


RUN = FolderKind("run", FILES)


class RunFolder:
    """An output folder that takes the files of one run.

    Attributes:
        path: The folder that the user named.
        kind: What it holds.
        stage: Folder the files are written to; another one than ``path`` while an old run is being replaced,
            and until the end where its kind is ``whole``.
        written: Names of the files written so far.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        force: bool = False,
        inputs: Sequence[object] = (),
        kind: FolderKind = RUN,
    ) -> None:
        """Check that the folder can take a run and create it.

        Args:
            path: The folder; it is created with its parents when it does not exist.
            force: Replace a run that is already there.
            inputs: Files that are read; none may be one that the run would replace.
            kind: What the folder is to hold.

        Raises:
            SettingsError: the path is a file, holds a run and ``force`` is not set, holds an input under a
                name of ours or a result of another kind, or cannot be created.
        """
        self.path, self.kind = Path(path), kind
        if not str(path):
            raise SettingsError("out: expected the name of a folder, got an empty one; give one with --out.")
        self.written: list[str] = []
        self._spare(inputs)
        if self.path.exists() and not self.path.is_dir():
            raise SettingsError(f"out '{self.path}': expected a folder, got a file; give another name.")
        self._be_alone()
        old = [name for name in kind.files if (self.path / name).exists()]
        if old and not force:
            article = "an" if kind.word[0] in "aeiou" else "a"
            raise SettingsError(
                f"out '{self.path}': expected a folder without {article} {kind.word}, it holds {old[0]}; "
                f"give another folder, or --force to replace the {kind.word}."
            )
        # the old run stays readable until the new one is complete
        self.stage = self.path / STAGE if old or kind.whole else self.path
        if self.stage != self.path:
            self._clear(self.stage)
        # only what this run creates may be removed again when nothing comes of it
        self._made = [folder for folder in (self.stage, *self.stage.parents) if not folder.exists()]
        try:
            self.stage.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._cannot("create the folder", error) from error

    def _spare(self, inputs: Sequence[object]) -> None:
        """Raise if an input is a file that this run would replace or remove."""
        # in the folders of a swap that was stopped, too: those are emptied
        places = [self.path / sub / name for sub in ("", STAGE, ASIDE) for name in self.kind.files]
        for given in (Path(str(given)) for given in inputs if given is not None):
            if given.is_file() and any(place.exists() and place.samefile(given) for place in places):
                raise SettingsError(
                    f"out '{self.path}': expected another folder than that of the inputs, got the one of "
                    f"'{given}', which the {self.kind.word} would replace; give another with --out."
                )

    def _be_alone(self) -> None:
        """Raise if the folder holds a result of another kind: replacing ours would take files from it."""
        for word, names in SIGNS.items():
            found = [name for name in names if name not in self.kind.files and (self.path / name).exists()]
            if word != self.kind.word and found:
                raise SettingsError(
                    f"out '{self.path}': expected a folder without a {word}, it holds {found[0]}; give "
                    "another folder with --out."
                )

    def write(self, name: str, writer: Callable[[Path], None]) -> None:
        """Write one file; it appears under its name only when it is whole.

        Args:
            name: One of the names in ``kind.files``.
            writer: Writes the file at the path it is given.

        Raises:
            SettingsError: the file cannot be written (disk full, no permission).
        """
        assert name in self.kind.files, f"{name} is not among the files of this folder"
        # in the same folder, because only there is renaming one indivisible step
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
            name: One of the names in ``kind.files``.
            text: Its content.

        Raises:
            SettingsError: the file cannot be written (disk full, no permission).
        """
        self.write(name, lambda part: _write_text(part, text))

    def finish(self) -> None:
        """Put a complete run into its place and remove the remains of the old one.

        Raises:
            SettingsError: a file cannot be moved.
        """
        if self.stage == self.path:
            return
        aside = self.path / ASIDE
        self._clear(aside)
        try:
            # first all old files out, then all new files in: at no time are files of both runs in the folder
            aside.mkdir(exist_ok=True)
            for name in self.kind.files:
                if (self.path / name).exists():
                    os.replace(self.path / name, aside / name)
            for name in self.written:
                os.replace(self.stage / name, self.path / name)
        except BaseException as error:
            self._put_back(aside)
            if isinstance(error, OSError):
                raise self._cannot(f"replace the old {self.kind.word}", error) from error
            raise
        unfinished, self.stage = self.stage, self.path
        self._clear(aside)
        self._clear(unfinished)

    def _put_back(self, aside: Path) -> None:
        """Undo a swap that was stopped: the places of the files show how far it came."""
        try:
            # the last new file is in place: the swap was complete, only the clearing up was stopped
            if all(not (self.stage / name).exists() for name in self.written):
                return
            # the new files go back first, or an old file would overwrite one of them
            for name in self.written:
                if not (self.stage / name).exists():
                    os.replace(self.path / name, self.stage / name)
            for name in self.kind.files:
                if (aside / name).exists():
                    os.replace(aside / name, self.path / name)
            aside.rmdir()
        except OSError:
            # both runs are still on the disk, in ``replaced`` and ``unfinished``; the first error is reported
            return

    def _clear(self, folder: Path) -> None:
        """Remove our own files from a sub-folder, and the folder when nothing else is in it."""
        if not folder.is_dir():
            return
        try:
            for name in self.kind.files:
                (folder / name).unlink(missing_ok=True)
                (folder / f".{name}.part").unlink(missing_ok=True)
            if not any(folder.iterdir()):
                folder.rmdir()
        except OSError as error:
            raise self._cannot(f"empty '{folder.name}'", error) from error

    @contextmanager
    def filling(self) -> Iterator[None]:
        """Put what the block wrote into its place at the end; an error leaves the folder as it was.

        Raises:
            SettingsError: a file cannot be moved.
        """
        assert self.kind.whole
        try:
            yield
            self.finish()
        except BaseException:
            if self.stage != self.path:
                with suppress(SettingsError):
                    self._clear(self.stage)
                self.written.clear()
                self.abandon()
            raise

    def abandon(self) -> None:
        """Remove the folders that were created for a run of which nothing was written."""
        if self.written:
            return
        for folder in self._made:
            try:
                folder.rmdir()
            except FileNotFoundError:
                continue
            except OSError:
                return

    def _cannot(self, what: str, error: OSError) -> SettingsError:
        why = error.strerror or str(error)
        cure = "free some space or give" if error.errno == errno.ENOSPC else "give"
        return SettingsError(f"out '{self.path}': cannot {what} ({why}); {cure} another folder with --out.")


def _write_text(path: Path, text: str) -> None:
    with path.open("w", encoding="utf-8", errors="backslashreplace", newline="\n") as file:
        file.write(text)
        file.flush()
        # without it a power failure after the renaming may leave an empty file
        os.fsync(file.fileno())
