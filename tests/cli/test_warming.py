"""What is compiled at first use, and by which process."""

from __future__ import annotations

import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from monodyn.cli import main, warming
from monodyn.cli.warming import compiling_beside, identify_demo


@pytest.mark.slow
def test_the_other_process_identifies_the_demo_clip(tmp_path: Path) -> None:
    outcome = identify_demo(tmp_path)
    assert outcome.fit is not None
    assert outcome.fit.grade == "trusted"
    assert (tmp_path / "run" / "prediction.csv").is_file()


@pytest.mark.parametrize("interrupted", [False, True])
def test_the_other_process_ends_with_this_one_and_leaves_nothing(
    interrupted: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    children, usual = list[subprocess.Popen[bytes]](), subprocess.Popen

    def begun(words: list[str], **how: int) -> subprocess.Popen[bytes]:
        assert words[:3] == [sys.executable, "-m", "monodyn.cli.warming"]
        children.append(usual(words, **how))
        return children[-1]

    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(subprocess, "Popen", begun)
    try:
        with compiling_beside():
            assert children[0].poll() is None
            assert Path(str(children[0].args[-1])).parent == tmp_path
            if interrupted:
                raise KeyboardInterrupt
    except KeyboardInterrupt:
        assert interrupted
    assert children[0].poll() is not None
    assert not list(tmp_path.iterdir())


def test_the_other_process_ends_when_nothing_is_left_of_this_one(tmp_path: Path) -> None:
    """Of what SIGKILL ends the system closes the pipe."""
    child = subprocess.Popen([sys.executable, "-m", warming.__name__, str(tmp_path)], stdin=subprocess.PIPE)
    assert child.stdin is not None
    child.stdin.close()
    assert child.wait(60) == 0
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("words", "compiled", "beside"),
    [
        (("run", "text.mp4"), False, True),
        (("run", "text.mp4"), True, False),
        (("live", "text.mp4"), False, True),
        (("predict", "missing"), False, False),
        (("models", "--json"), False, False),
    ],
)
def test_two_processes_compile_where_nothing_is_and_all_is_needed(
    words: tuple[str, ...], compiled: bool, beside: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    begun = []

    @contextmanager
    def counted():
        begun.append(1)
        yield

    monkeypatch.setattr(warming, "compiling_beside", counted)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    if compiled:
        (tmp_path / "planar.rollouts-1.py311.nbi").touch()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "text.mp4").write_text("no clip")
    main([*words, *(["--model", "single", "--out", "run"] if words[0] in ("run", "live") else [])])
    assert len(begun) == beside
