"""``run.json``: what was run, on what, with which versions, how long each stage took, and how it ended.

``run.toml`` is written along with it: the settings alone, as ``--config`` takes them."""

from __future__ import annotations

import hashlib
import platform
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from monodyn.choices import is_bundled
from monodyn.errors import MonodynError, is_interrupt
from monodyn.results.export import json_text, jsonable
from monodyn.results.folder import RunFolder
from monodyn.results.run_toml import RUN_TOML

if TYPE_CHECKING:
    from monodyn.estimation.fit import Grade

PACKAGES = ("monodyn", "numpy", "scipy", "numba", "mujoco-core", "av", "opencv-python-headless")
"""Packages whose versions are kept."""


@dataclass(frozen=True)
class Compared:
    """One of the mechanisms between which the evidence decided.

    Attributes:
        model: Its name.
        chosen: Whether it is the one that was taken.
        said: What spoke for and against it, a sentence with its figures.
        mismatch: Mismatch of outline and mask as a share of the mask's area; None where it was not located.
        key_frames: In how many key frames it lies on its mask, and of how many; None without a picture.
        grade: That of its fit; None where it was not identified.
        prediction: Largest error of its prediction as a share of the motion; None where there is none.
    """

    model: str
    chosen: bool
    said: str
    mismatch: float | None = None
    key_frames: tuple[int, int] | None = None
    grade: Grade | None = None
    prediction: float | None = None


class RunLog:
    """Collects the content of ``run.json`` while a run goes on.

    Attributes:
        command: Name of the command.
        inputs: Given files by their part, with size and SHA-256.
        settings: Settings as values of JSON.
        run_toml: The content of ``run.toml``; empty where no command does this again.
        versions: Versions by package.
        seconds: Wall time by stage [s].
        notes: Sentences about the input.
        free_frames: First frame in which the mechanism moves freely and the one after the last, or None.
        region: Top, bottom, left and right of the part of the picture that shows it [px], or None.
        comparison: The mechanisms that were tried, the chosen one first; none where the user named it.
    """

    def __init__(
        self, command: str, inputs: Mapping[str, object], settings: object, run_toml: str = ""
    ) -> None:
        """Start the log.

        Args:
            command: Name of the command.
            inputs: Paths or bundled names by their part.
            settings: The settings, a dataclass.
            run_toml: The content of ``run.toml``.
        """
        self.command, self.run_toml = command, run_toml
        self.inputs = {part: fingerprint(part, value) for part, value in inputs.items()}
        values = asdict(settings) if is_dataclass(settings) and not isinstance(settings, type) else settings
        self.settings: dict[str, Any] = jsonable(values)
        self.versions = versions()
        self.seconds: dict[str, float] = {}
        self.notes: list[str] = []
        self.free_frames: tuple[int, int] | None = None
        self.region: tuple[int, int, int, int] | None = None
        self.comparison: Sequence[Compared] = ()
        self._begun = time.strftime("%Y-%m-%dT%H:%M:%S%z")

    def chose(self, comparison: Sequence[Compared]) -> None:
        """Note which mechanism was taken, as if the user had named it.

        Args:
            comparison: All that were tried, the chosen one first.
        """
        self.inputs["model"] = fingerprint("model", comparison[0].model)
        self.comparison = comparison

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the wall time of the block to a stage.

        Args:
            name: Name of the stage.
        """
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    def document(self, status: str, files: list[str], message: str = "") -> dict[str, Any]:
        """Return the content of ``run.json``.

        Args:
            status: ``done``, ``interrupted`` or ``failed``.
            files: Names of the files written.
            message: Why, when it is not done.
        """
        return {
            "status": status,
            "message": message,
            "command": self.command,
            "begun": self._begun,
            "inputs": self.inputs,
            "settings": self.settings,
            "seed": self.settings.get("seed"),
            "versions": self.versions,
            "seconds": {name: round(value, 4) for name, value in self.seconds.items()},
            "free_frames": None if self.free_frames is None else list(self.free_frames),
            "region": None if self.region is None else _corner_and_sides(*self.region),
            "notes": self.notes,
            "comparison": [asdict(one) for one in self.comparison],
            "files": files,
        }


def _corner_and_sides(top: int, bottom: int, left: int, right: int) -> list[int]:
    """Return a rectangle as ``--roi`` takes it: column, row, width, height [px]."""
    return [left, top, right - left, bottom - top]


@contextmanager
def recorded(folder: RunFolder | None, log: RunLog) -> Iterator[RunLog]:
    """Yield ``log``; then write ``run.json`` however the block ends, and move a complete run to its place.

    Args:
        folder: The run folder; None writes nothing.
        log: What to write; the block may set ``log.notes``.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed, in whatever form it came out of the block.
    """
    try:
        if folder is not None:
            log.notes += folder.notes
        yield log
        if folder is not None:
            _write_again(folder, log)
            # last of all files: a folder whose run.json has the status done is complete
            folder.write_text("run.json", json_text(log.document("done", [*folder.written, "run.json"])))
            folder.finish()
    except BaseException as error:
        interrupted = is_interrupt(error)
        if folder is not None:
            _record_failure(folder, log, error, interrupted)
        if interrupted:
            place = None if folder is None else folder.stage
            said = []
            if place is not None and place.is_dir():
                fresh = folder is not None and place == folder.path
                said = [f"what was finished is in '{place}'{', which --force replaces' if fresh else ''}."]
            raise KeyboardInterrupt(*said) from error
        raise
    finally:
        if folder is not None:
            folder.close()


def _record_failure(folder: RunFolder, log: RunLog, error: BaseException, interrupted: bool) -> None:
    """Write ``run.json`` of a run that did not come to its end, and the traceback of what nobody foresaw."""
    message = str(error) if isinstance(error, MonodynError) else type(error).__name__
    kept = folder.keep_traceback(error)
    # bad input of which nothing was written leaves no trace, not even an empty folder
    if not folder.finished and (folder.written or interrupted):
        status = "interrupted" if interrupted else "failed"
        with suppress(MonodynError):
            _write_again(folder, log)
            folder.write_text("run.json", json_text(log.document(status, [*folder.written, *kept], message)))


def _write_again(folder: RunFolder, log: RunLog) -> None:
    """Write ``run.toml``, with which the run can be done again."""
    if log.run_toml:
        folder.write_text(RUN_TOML, log.run_toml)


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that the numbers depend on."""
    from importlib.metadata import PackageNotFoundError, version

    found = {"python": platform.python_version(), "platform": f"{platform.system()} {platform.machine()}"}
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def fingerprint(part: str, value: object) -> dict[str, Any]:
    """Name an input and hash it when it is a file; a folder counts by the names and sizes of its files.

    Args:
        part: What part it has in the run, as ``clip``.
        value: A path, or a bundled name.
    """
    path, name = Path(str(value)), str(value)
    if part == "model" and is_bundled(name):
        if is_bundled(value):
            return {"name": name}
        # a path of that name: read as a text it has to be a path again
        name = f"./{name}"
    if path.is_file():
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return {"name": name, "bytes": path.stat().st_size, "sha256": digest}
    if path.is_dir():
        # a folder of pictures may be large: names and sizes distinguish another one well enough
        listing = sorted(f"{file.name} {file.stat().st_size}" for file in path.iterdir() if file.is_file())
        digest = hashlib.sha256("\n".join(listing).encode()).hexdigest()
        return {"name": name, "files": len(listing), "sha256_of_listing": digest}
    return {"name": name}
