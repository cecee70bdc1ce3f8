"""The run folder: which files are ours, and how they get there without ever destroying anything.

One process at a time writes to a folder. Every file is written under another name and renamed when it is
whole. A folder that already holds a run is refused unless it may be replaced. Then the new run is written
into the sub-folder ``unfinished`` and takes the place of the old one, in one step, only when it is complete:
a full disk or Ctrl-C leaves the old run as it was. What a run that was stopped has left there is kept for
its owner. Results of other kinds get into their folders in the same way.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from monodyn.choices import MOST_DRAWN
from monodyn.errors import SettingsError, is_unforeseen
from monodyn.results.exchange import settle_on_disk
from monodyn.results.lock import LOCK, FolderLock
from monodyn.results.swap import ASIDE, NEW, STAGE, is_unsettled, settle, take_place
from monodyn.results.unforeseen import TRACEBACK, keep_traceback

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
    *DRAWN,
    "run.toml",
    "run.json",
)
"""Names of the files of a run; nothing else in the folder is ever touched."""

SIGNS = {
    "run": ("fit.json", "run.json"),
    "controller": ("control.json",),
    "prediction": ("prediction.json",),
}
"""Files by which a folder is known to hold a result, by the word of its kind; others have names in common."""

RECORDING = ".recording.mp4"
"""What a stream is recorded as until it ends."""


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
        finished: Whether it is complete, and in its place.
        notes: Where the files of a run are that was stopped here before, a sentence.
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
            SettingsError: the path is a file, somebody else writes to it, it holds a run and ``force`` is not
                set, holds an input under a name of ours or a result of another kind, or cannot be created.
        """
        self.path, self.kind = Path(path), kind
        if not str(path):
            raise SettingsError("out: expected the name of a folder, got an empty one; give one with --out.")
        # without a name it cannot be exchanged with another one
        if self.path.is_dir() and not self.path.resolve().name:
            raise SettingsError(
                f"out '{self.path}': expected a folder with a name, got the root of a disk; give another "
                "with --out."
            )
        self._written: set[str] = set()
        self.notes: list[str] = []
        self.finished = False
        self._spare(inputs)
        if self.path.exists() and not self.path.is_dir():
            raise SettingsError(f"out '{self.path}': expected a folder, got a file; give another name.")
        # only what this run creates may be removed again when nothing comes of it
        self._made = [folder for folder in (self.path, *self.path.parents) if not folder.exists()]
        try:
            self._lock = FolderLock(self.path)
        except OSError as error:
            raise self._cannot("create the folder", error) from error
        try:
            self.stage = self._begin(force)
        except BaseException:
            self.close()
            raise

    @property
    def written(self) -> list[str]:
        """Names of the files written so far, in the order of the kind."""
        return [name for name in self.kind.files if name in self._written]

    def _begin(self, force: bool) -> Path:
        """Check what is in the folder; return where the files are to be written."""
        try:
            settle(self.path)
            self._be_alone()
            old = self._old()
            if old and not force:
                raise self._held(old)
            # the old run stays readable until the new one is complete
            staged = bool(old) or self.kind.whole
            self._keep_remains(staged)
            if not staged:
                return self.path
            stage = self.path / STAGE
            if not stage.exists():
                self._made.insert(0, stage)
                stage.mkdir()
            return stage
        except OSError as error:
            raise self._cannot("prepare the folder", error) from error

    def _old(self) -> list[str]:
        """Name the files of the kind that are there."""
        return [name for name in self.kind.files if (self.path / name).exists()]

    def _held(self, old: Sequence[str]) -> SettingsError:
        """Return the complaint about a folder that holds a result."""
        word = self.kind.word
        article = "an" if word[0] in "aeiou" else "a"
        return SettingsError(
            f"out '{self.path}': expected a folder without {article} {word}, it holds {old[0]}; "
            f"give another folder, or --force to replace the {word}."
        )

    def _keep_remains(self, staged: bool) -> None:
        """Put what a run that was stopped has left where no other one comes, and note it."""
        parts = [*(f".{name}.part" for name in self.kind.files), RECORDING, TRACEBACK]
        loose = [name for name in (*parts, ASIDE) if (self.path / name).exists()]
        stage, there = self.path / STAGE, set()
        if stage.is_dir():
            for name in (NEW, LOCK):
                (stage / name).unlink(missing_ok=True)
            there = set(os.listdir(stage))
        # a folder of that name may be somebody's own
        left = bool(there) if staged else not there.isdisjoint((*self.kind.files, *parts))
        if not loose and not left:
            return
        kept = next(place for k in count(1) if not (place := self.path / f"{STAGE}_{k}").exists())
        if left:
            stage.rename(kept)
        else:
            kept.mkdir()
        for name in loose:
            os.replace(self.path / name, kept / name)
        # unlike half a file half a film can be watched
        if (kept / RECORDING).exists():
            (kept / RECORDING).rename(kept / RECORDING.removeprefix("."))
        self.notes.append(f"What a run that was stopped before had written is kept in '{kept}'.")

    def _spare(self, inputs: Sequence[object]) -> None:
        """Raise if an input is a file that this run would replace or remove."""
        # in the folder of a run that was stopped, too, which gets another name
        places = [self.path / sub / name for sub in ("", STAGE) for name in self.kind.files]
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
            # without it a power failure after the renaming may leave an empty file
            settle_on_disk(part)
            os.replace(part, self.stage / name)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise self._cannot(f"write {name}", error) from error
        except BaseException:
            part.unlink(missing_ok=True)
            raise
        self._written.add(name)

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
        """Put a complete run into its place and remove the old one.

        Raises:
            SettingsError: a file cannot be moved.
        """
        try:
            if self.stage == self.path:
                settle_on_disk(self.path)
            else:
                take_place(self.path, self.kind.files, self._lock)
            self.finished = True
        except BaseException as error:
            # the first error is reported; what stays undone is done when the folder is used next
            with suppress(SettingsError, OSError):
                settle(self.path)
            self.finished = self.stage != self.path and not self.stage.exists()
            if isinstance(error, OSError):
                raise self._cannot(f"replace the old {self.kind.word}", error) from error
            raise
        finally:
            if self.finished:
                self.stage = self.path

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
        except BaseException as error:
            self.keep_traceback(error)
            if not self.finished:
                with suppress(SettingsError):
                    self._clear(self.stage)
                self._written.clear()
            raise
        finally:
            self.close()

    def keep_traceback(self, error: BaseException) -> list[str]:
        """Write the traceback of an error that nobody foresaw next to what was written before it.

        Args:
            error: What ends the run; of any other one there is none.

        Returns:
            The name of the file, or nothing.
        """
        # a folder that is complete has the files of its run, and no others
        kept = not self.finished and is_unforeseen(error) and keep_traceback(error, self.stage)
        return [TRACEBACK] if kept else []

    def close(self) -> None:
        """Let others write to the folder; remove what was created for a run of which nothing was written."""
        self._lock.release()
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


def recover(path: Path) -> None:
    """Bring a swap that was stopped in a folder to its end, where nobody else does and it can be written.

    Args:
        path: A folder that is to be read.
    """
    if path.is_dir() and is_unsettled(path):
        with suppress(SettingsError, OSError):
            lock = FolderLock(path)
            try:
                settle(path)
            finally:
                lock.release()


def _write_text(path: Path, text: str) -> None:
    with path.open("w", encoding="utf-8", errors="backslashreplace", newline="\n") as file:
        file.write(text)
