"""What is left of runs that are killed at every step of a swap, of two at once, of Ctrl-C at any time.

``swap`` kills a process at every line that it runs from the moment at which its run is complete, ``recovery``
at every line with which the next one begins; ``together`` starts two runs into one folder; ``interrupted``
ends commands at random times while they load, compile and work. Each counts what may not be: it ends with 1
where a count is not zero. Only for Linux and macOS: processes are forked.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from monodyn import cli
from monodyn.cli import show
from monodyn.errors import SettingsError
from monodyn.results import exchange, lock, log
from monodyn.results import folder as folder_module
from monodyn.results import swap as swap_module
from monodyn.results.folder import FolderKind, RunFolder
from monodyn.results.log import RunLog, recorded

WATCHED = {module.__file__ for module in (swap_module, exchange, lock, folder_module, log)}
"""Files whose lines are the steps."""
KIND = FolderKind("run", ("poses.csv", "fit.json", "model.xml", "clip.mp4", "run.json"))
"""A run of few files."""
RUNS = {
    "old": ("poses.csv", "fit.json", "model.xml", "clip.mp4"),
    "new": ("poses.csv", "fit.json", "model.xml"),
}
"""The files of each run, next to run.json."""
FOREIGN = {"mine.txt": "mine", "notes/deep.txt": "deep", ".hidden": "hidden"}
"""What else is in the folder."""
KILLED, SIGNALS = -int(signal.SIGKILL), (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
WORDS = ["models", "--json"]
"""The command in whose place a run is written."""
DEMO = Path(cli.__file__).parent / "clip" / "double.json"
"""The true motion of the clip that is installed with the program."""


# one process that is killed at one of its lines


def written(path: Path, name: str) -> None:
    """Write a run as the commands do.

    Args:
        path: Its folder.
        name: Which of ``RUNS``.
    """
    folder = RunFolder(path, force=True, kind=KIND)
    with recorded(folder, RunLog(name, {}, {})):
        for file in RUNS[name]:
            folder.write_text(file, name)


def ended_at(
    step: int, number: signal.Signals, begins: str, job: Callable[[], None], path: Path, inside: bool
) -> int:
    """Run a job in a process of its own that gets a signal at one of its lines.

    Args:
        step: Which line, counted from 1.
        number: The signal.
        begins: Function in one of the watched files with which the count begins.
        job: What is done.
        path: The folder.
        inside: Do it with the folder as the working folder, which then cannot go.

    Returns:
        The exit code, negative where the signal ended it.
    """
    process = os.fork()
    if process:
        return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    if inside:
        os.chdir(path)
    left, counting = step, False

    def traced(frame: FrameType, event: str, _: Any) -> Any:
        nonlocal left, counting
        code = frame.f_code
        if code.co_filename not in WATCHED:
            return None
        counting = counting or code.co_name == begins
        if counting and event == "line":
            left -= 1
            if left == 0:
                sys.settrace(None)
                os.kill(os.getpid(), number)
        return traced

    show.show_models = lambda **_: job() or 0
    sys.settrace(traced)
    code = cli.main(WORDS)
    # a job that ends before that line
    os._exit(77 if left > 0 else code)


def read(path: Path) -> str:
    """Return which run a folder holds, ``mixed``, or ``nothing``; what else was in it must be there.

    Args:
        path: The folder.
    """
    for name, text in FOREIGN.items():
        if not (path / name).is_file() or (path / name).read_text() != text:
            return f"lost {name}"
    found = {name: (path / name).read_text() for name in KIND.files if (path / name).exists()}
    for run, files in RUNS.items():
        said = json.loads(found.get("run.json", "{}"))
        whole = {name: text for name, text in found.items() if name != "run.json"} == dict.fromkeys(
            files, run
        )
        if whole and said.get("command") == run and said["status"] == "done":
            return run
    return "mixed" if found else "nothing"


def beside(path: Path) -> list[str]:
    """Name what is beside a folder that should be alone, and what of ours is hidden or only a link in it.

    Args:
        path: The folder.
    """
    links = [name for name in FOREIGN if (path / name.split("/")[0]).is_symlink()]
    ours = [place.name for place in path.glob(".monodyn*")]
    return [place.name for place in path.parent.iterdir() if place != path] + ours + links


def prepared(path: Path) -> None:
    """Make a folder with the old run and what else is in it.

    Args:
        path: The folder.
    """
    shutil.rmtree(path.parent, ignore_errors=True)
    path.mkdir(parents=True)
    written(path, "old")
    (path / "notes").mkdir()
    for name, text in FOREIGN.items():
        (path / name).write_text(text)


def next_start(path: Path, expected: str) -> list[str]:
    """Return what is wrong with what the next run finds in a folder.

    Args:
        path: The folder.
        expected: Which run has to be there.
    """
    try:
        folder = RunFolder(path, force=True, kind=KIND)
    except SettingsError as error:
        return [f"refused: {error}"]
    folder.close()
    wrong = [] if (found := read(path)) == expected else [f"{found} after the next start"]
    # a complete run that did not come into its place is kept and named
    kept = list(path.glob("unfinished_*"))
    if bool(kept) != bool(folder.notes):
        wrong.append("something kept and not named")
    return wrong + [f"left {name}" for name in beside(path)]


@dataclass(frozen=True)
class Way:
    """How a swap goes.

    Attributes:
        name: For the table.
        inside: In the working folder, where the names cannot be exchanged.
    """

    name: str
    inside: bool


WAYS = (Way("one step", False), Way("the folder has to stay", True))


def swap(path: Path, signals: tuple[signal.Signals, ...] = SIGNALS, every: int = 1) -> Counter[str]:
    """Kill at every line from the moment at which a run is complete.

    Args:
        path: A folder that may be made and removed.
        signals: Which signals.
        every: Of so many lines one.

    Returns:
        How often each was found, by way and signal.
    """
    counts: Counter[str] = Counter()
    for way in WAYS:
        for number in signals:
            key, step = f"{way.name}, {number.name}", 1
            while True:
                prepared(path)
                code = ended_at(step, number, "finish", lambda: written(path, "new"), path, way.inside)
                if code == 77:
                    break
                counts[f"{key}: steps"] += 1
                found = read(path)
                right = {KILLED} if number == signal.SIGKILL else {128 + number, 0}
                bad = [] if code in right else [f"exit {code}"]
                if found not in RUNS:
                    # the folder that has to stay is whole again when the program comes to it next
                    if not way.inside or number != signal.SIGKILL:
                        bad.append(found)
                    counts[f"{key}: whole from the next start on"] += way.inside
                folder_module.recover(path)
                counts[f"{key}: {read(path)}"] += 1
                bad += next_start(path, read(path) if found not in RUNS else found)
                counts[f"{key}: bad"] += bool(bad)
                for what in bad:
                    counts[f"{key}: {what}"] += 1
                step += every
    return counts


def recovery(path: Path, every: int = 1) -> Counter[str]:
    """Kill at every line with which the next run begins where a swap was killed, and then at its swap.

    Args:
        path: A folder that may be made and removed.
        every: Of so many lines at which each is killed one.

    Returns:
        How often each was found, by way.
    """
    counts: Counter[str] = Counter()
    crashed = path.parent.with_name("crashed")
    for way in WAYS:
        first = 1
        while True:
            prepared(path)
            code = ended_at(first, signal.SIGKILL, "finish", lambda: written(path, "new"), path, way.inside)
            if code == 77:
                break
            shutil.rmtree(crashed, ignore_errors=True)
            shutil.copytree(path.parent, crashed, symlinks=True)
            second = 1
            while True:
                shutil.rmtree(path.parent)
                shutil.copytree(crashed, path.parent, symlinks=True)
                begin = lambda: RunFolder(path, force=True, kind=KIND).close()  # noqa: E731
                code = ended_at(second, signal.SIGKILL, "settle", begin, path, way.inside)
                counts[f"{way.name}: steps"] += code != 77
                folder = RunFolder(path, force=True, kind=KIND)
                folder.close()
                bad = ([] if read(path) in RUNS else [read(path)]) + beside(path)
                counts[f"{way.name}: bad"] += bool(bad)
                for what in bad:
                    counts[f"{way.name}: {what}"] += 1
                if code == 77:
                    break
                second += every
            first += every
    shutil.rmtree(crashed, ignore_errors=True)
    return counts


# whole commands


def table(path: Path, rows: int) -> Path:
    """Write the first rows of the true motion of the installed clip as a table, and return its path.

    Args:
        path: The table.
        rows: How many.

    Returns:
        The path.
    """
    motion = json.loads(DEMO.read_text())
    lines = [f"{t},{a},{b}" for t, (a, b) in zip(motion["times"][:rows], motion["q"], strict=False)]
    path.write_text("\n".join(["time,joint1,joint2", *lines]) + "\n")
    return path


def command(*words: str | Path, **environment: str) -> subprocess.Popen[str]:
    """Return the command line, started.

    Args:
        *words: The words after the name of the program.
        **environment: Further variables.
    """
    return subprocess.Popen(
        [sys.executable, "-m", "monodyn", *map(str, words)],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env={**os.environ, **environment},
    )  # fmt: skip


def digests(path: Path) -> dict[str, bytes]:
    """Return the files of a run that are the same each time.

    Args:
        path: The folder.
    """
    return {
        name: (path / name).read_bytes() for name in ("states.csv", "prediction.csv", "model.xml", "fit.json")
    }


def together(root: Path, rounds: int = 20) -> Counter[str]:
    """Count how two runs into one folder end, the second begun a little later.

    Args:
        root: A folder for what is made.
        rounds: How often.
    """
    counts: Counter[str] = Counter()
    wanted, words = {}, {}
    for name, rows in (("one", 60), ("other", 75)):
        words[name] = (
            "identify",
            table(root / f"{name}.csv", rows),
            "--model",
            "double",
            "--quiet",
            "--ensemble",
            "2",
        )
        command(*words[name], "--out", root / f"alone {name}").communicate()
        wanted[name] = digests(root / f"alone {name}")
    out, force = root / "run", []
    for number in range(rounds):
        # the first half of the rounds into new folders, the others over the run that is there
        if number <= rounds // 2:
            shutil.rmtree(out, ignore_errors=True)
        force = [] if number < rounds // 2 else ["--force"]
        before = digests(out) if force and out.exists() else None
        first = command(*words["one"], "--out", out, *force)
        time.sleep(random.Random(number).uniform(0.0, 0.5))
        second = command(*words["other"], "--out", out, *force)
        said = [process.communicate()[1] for process in (first, second)]
        codes = [process.returncode for process in (first, second)]
        refused = [k for k in (0, 1) if codes[k] == 2]
        named = [k for k in refused if "in use by process" in said[k] or "it holds" in said[k]]
        done = [name for name, code in zip(words, codes, strict=True) if code in (0, 1)]
        found = digests(out)
        counts["rounds"] += 1
        counts["second refused at once, its holder named"] += any(
            "in use by process" in said[k] for k in refused
        )
        counts["one after the other"] += not refused
        counts["mixed"] += all(found != wanted[name] for name in words)
        # what was done is there, unless the other one was allowed to replace it after it
        counts["lost"] += not done or (len(done) == 1 and found != wanted[done[0]])
        counts["refused otherwise"] += refused != named
        counts["left behind"] += bool(list(out.glob(".monodyn*")) + list(out.glob("unfinished*")))
        counts["old run lost"] += before is not None and not done
    return counts


BAD = ("mixed", "lost", "refused otherwise", "left behind", "old run lost", "bad")


def interrupted(root: Path, rounds: int = 30) -> Counter[str]:
    """Count how commands end at random times: while they load, while they compile, while they work.

    Args:
        root: A folder for what is made.
        rounds: How often for each.
    """
    counts: Counter[str] = Counter()
    poses, draw = table(root / "poses.csv", 75), random.Random(0)
    out = root / "run"
    words = ("identify", poses, "--model", "double", "--quiet", "--out", out, "--force")
    began = time.perf_counter()
    command(*words).communicate()
    warm = time.perf_counter() - began
    old = digests(out)
    for kind, longest in (("loaded and working", warm), ("compiled", 20.0)):
        for number in range(rounds):
            sent = (signal.SIGINT, signal.SIGTERM)[number % 2]
            cache = {} if kind != "compiled" else {"NUMBA_CACHE_DIR": str(root / f"cache{number}")}
            process = command(*words, **cache)
            time.sleep(draw.uniform(0.15, longest))
            process.send_signal(sent)
            began = time.perf_counter()
            said = process.communicate()[1]
            took, code = time.perf_counter() - began, process.returncode
            key = f"{kind}, {sent.name}"
            counts[f"{key}: rounds"] += 1
            # before its first line it ends as any program of Python, after its last one it is done
            counts[f"{key}: before the program began"] += code == -sent
            counts[f"{key}: done before"] += code in (0, 1)
            swallowed = code not in (128 + sent, -sent) and not (code in (0, 1) and took < 1.0)
            bad = swallowed or digests(out) != old or (code == 128 + sent and said.count("\n") != 1)
            counts[f"{key}: bad"] += bad
            if bad:
                print(f"{key}: exit {code} after {took:.1f} s: {said}", file=sys.stderr)
            counts[f"{key}: seconds to the end, at most"] = max(
                counts[f"{key}: seconds to the end, at most"], math.ceil(took)
            )
            shutil.rmtree(root / f"cache{number}", ignore_errors=True)
    return counts


def main() -> int:
    """Return 1 where something is not as it has to be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("swap", "recovery", "together", "interrupted"))
    parser.add_argument("--every", type=int, default=1, help="of so many lines one")
    parser.add_argument("--rounds", type=int, help="how often")
    given = parser.parse_args()
    # what is loaded before the first process is forked is loaded once
    with contextlib.redirect_stdout(io.StringIO()):
        cli.main(WORDS)
    with tempfile.TemporaryDirectory(prefix="monodyn-") as spare:
        root = Path(spare)
        if given.what in ("swap", "recovery"):
            at = root / "within" / "run"
            counts = swap(at, every=given.every) if given.what == "swap" else recovery(at, every=given.every)
        else:
            job = together if given.what == "together" else interrupted
            counts = job(root, **({} if given.rounds is None else {"rounds": given.rounds}))
    for what, count in counts.items():
        print(f"{count:8} {what}")
    return int(any(count for what, count in counts.items() if what.split(": ")[-1] in BAD))


if __name__ == "__main__":
    sys.exit(main())
