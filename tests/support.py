"""What tests of several rooms share: tiny clips, commands run in this process, messages compared whole."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from monodyn.vision.clip.video import Video

DEMO = Path(__file__).parents[1] / "src" / "monodyn" / "cli" / "clip"

ClipMaker = Callable[..., Path]


@contextlib.contextmanager
def refuses(error: type[Exception], message: str) -> Iterator[None]:
    """Expect an error whose whole text is ``message``; ``test_messages.py`` looks for the messages here."""
    with pytest.raises(error) as found:
        yield
    assert str(found.value) == message


def slow(*values: object) -> pytest.ParameterSet:
    """Mark one case of a parametrized test as slow: ``make check`` runs it, ``make test`` does not."""
    return pytest.param(*values, marks=pytest.mark.slow)


def square(index: int, width: int, height: int, size: int = 10) -> np.ndarray:
    """Draw frame ``index``: a white square on dark grey whose left edge is at column 2 + index."""
    picture = np.full((height, width), 60, np.uint8)
    picture[6 : 6 + size, 2 + index : 2 + index + size] = 220
    return picture


def left_edge(luma: np.ndarray) -> int:
    """Find the left edge of the square [px]."""
    return int(np.argmax(luma.max(axis=0) > 140))


def left_edges(video: Video) -> list[int]:
    """List the left edge of the square in every frame of a clip [px]."""
    return [left_edge(frame.luma) for frame in video.frames()]


@dataclass(frozen=True)
class Done:
    """A command that ran: its exit code, what it printed, and its folder."""

    code: int
    out: str
    err: str
    folder: Path


def command(*words: object, folder: Path = Path()) -> Done:
    """Run a command in this process."""
    from monodyn.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([str(word) for word in words])
    return Done(code, out.getvalue(), err.getvalue(), folder)
