"""Print what becomes of the program under bad input, signals, full disks and two runs at once.

Run: ``python benchmarks/fuzz.py [--cases N] [--seconds S] [--seed K] [--only KIND ...] [--jobs J]
[--keep FOLDER] [--json FILE] [--gate]``. Each case is drawn from its own seed and runs the program as a user
does, in a process and a folder of its own; ``--only-case KIND:SEED`` runs one again and prints all that it
said. Counted are tracebacks, hangs, exit codes that are not documented, numbers that are trusted and wrong,
files lost or mixed, and lines that no part of the program meant to print.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import monodyn
import mutations
from damaged import DAMAGES, drawn
from figures import Figure, command_line, finish, say, table
from monodyn.reproduce.clip import ClipSettings, make_clip
from trust import MOST_STD

LONGEST = 120.0
"""Seconds after which a case hangs."""
CODES = (0, 1, 2, 130, 143)
"""Documented exit codes."""
FORBIDDEN = re.compile(
    r"Traceback|Warning:|RuntimeWarning|libpng|\[(h264|mov|png|mpeg4|mp4|matroska|avi|swscaler)[^\]]* @ |"
    r"MUJOCO_LOG|Exception ignored|Segmentation fault|core dumped|_ArrayMemoryError"
)
"""What no part of the program means to print."""
REMAINS = ("out/unfinished", "out/.")
"""Where the files of a run that was stopped are, and what marks a folder that is written to."""
LONG = 2000
"""Characters of a message from which on a list in it was not shortened."""


@dataclass(frozen=True)
class Good:
    """What is right, before anything is done to it.

    Attributes:
        clip: A clip of a double pendulum.
        lengths: Its true lengths by name [m].
        run: The folder of a run of it.
        models: Texts of mechanism files.
    """

    clip: Path
    lengths: dict[str, float]
    run: Path
    models: tuple[str, ...]


@dataclass(frozen=True)
class Case:
    """One call of the program.

    Attributes:
        words: Its arguments.
        lengths: True lengths by name [m], where what was done leaves them true; else empty.
        stop: Signal and the seconds after which it is sent, or None.
        room: Largest file that the system writes [bytes], None for any.
        beside: Arguments of a second call at the same time, none for no such call.
        columns: Width of the terminal, as the environment has it.
    """

    words: tuple[str, ...]
    lengths: dict[str, float] = field(default_factory=dict)
    stop: tuple[signal.Signals, float] | None = None
    room: int | None = None
    beside: tuple[str, ...] = ()
    columns: str = "80"


@dataclass(frozen=True)
class Found:
    """What became of a case.

    Attributes:
        name: Its kind and seed.
        faults: What was wrong, by kind of fault, each with a word on it.
        said: What the program printed.
        code: Its exit code; None where it was killed for time.
        seconds: Wall time [s].
    """

    name: str
    faults: tuple[tuple[str, str], ...]
    said: str
    code: int | None
    seconds: float


FAULTS = ("traceback", "hang", "exit code", "trusted and wrong", "lost or mixed", "noise", "long message")
"""Kinds of faults."""


def main() -> int:
    """Run the cases and print the counts.

    Returns:
        The exit code: 1 when there is a fault under ``--gate``.
    """
    options = arguments()
    with tempfile.TemporaryDirectory() as temporary:
        home = options.keep or Path(temporary)
        home.mkdir(parents=True, exist_ok=True)
        good = prepared(home / "good")
        if options.only_case:
            kind, seed = options.only_case.split(":")
            found = tried(kind, int(seed), good, home)
            print(f"{found.said}\nexit code {found.code}, {found.seconds:.1f} s, faults: {found.faults}")
            return int(bool(found.faults))
        cases = list(drawn_cases(options.cases, options.seed, options.only or tuple(KINDS)))
        results, ends = [], time.monotonic() + options.seconds
        with ThreadPoolExecutor(options.jobs) as threads:
            jobs = [threads.submit(_in_time, ends, kind, seed, good, home) for kind, seed in cases]
            for job in jobs:
                try:
                    found = job.result()
                except BaseException:
                    # a case that cannot be made ends it all at once, not when the others are done
                    threads.shutdown(wait=False, cancel_futures=True)
                    raise
                if found is None:
                    continue
                results.append(found)
                for fault, word in found.faults:
                    say(f"{found.name}: {fault}: {word}")
                if len(results) % 50 == 0:
                    say(f"{len(results)} of {len(cases)} cases")
    figures = counted(results)
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def arguments() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = command_line(__doc__, tuple(KINDS))
    parser.add_argument("--cases", type=int, default=1000, metavar="N", help="how many (1000)")
    parser.add_argument("--seconds", type=float, default=7200.0, metavar="S", help="stop after that (7200)")
    parser.add_argument("--seed", type=int, default=0, metavar="K", help="of the first case (0)")
    parser.add_argument("--jobs", type=int, default=2, metavar="J", help="cases at a time (2)")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep what the cases leave there")
    parser.add_argument("--only-case", metavar="KIND:SEED", help="run one again")
    return parser.parse_args()


def counted(results: list[Found]) -> list[Figure]:
    """Return the counts of faults, and how the cases ended.

    Args:
        results: What became of each case.
    """
    faults = Counter(fault for found in results for fault, _ in found.faults)
    ends = Counter(str(found.code) for found in results)
    figures = [Figure("cases", "run", len(results), "")]
    figures += [Figure("cases", fault, faults[fault], "", 0) for fault in FAULTS]
    figures += [Figure("ends", f"exit code {code}", count, "") for code, count in sorted(ends.items())]
    return [*figures, Figure("cases", "longest", max((f.seconds for f in results), default=0.0), "s")]


def drawn_cases(count: int, seed: int, kinds: tuple[str, ...]) -> Iterator[tuple[str, int]]:
    """Yield kinds and seeds, as often as each kind weighs.

    Args:
        count: How many.
        seed: Of the first.
        kinds: Which kinds.
    """
    weights = np.array([KINDS[kind][1] for kind in kinds], dtype=float)
    for k in range(seed, seed + count):
        yield str(np.random.default_rng([k, 1]).choice(kinds, p=weights / weights.sum())), k


def prepared(home: Path) -> Good:
    """Return what is right: a clip, the folder of its run, models.

    Args:
        home: Where it goes; what is there already is taken.
    """
    home.mkdir(parents=True, exist_ok=True)
    usual = ClipSettings()
    camera = replace(usual.camera, width=240, height=160, focal=700.0 / 3.0)
    settings = replace(usual, camera=camera, frames=90, noise=1.5)
    path, run = home / "clip.mp4", home / "run"
    if not path.is_file():
        make_clip(path, settings)
    if not (run / "fit.json").is_file():
        monodyn.run(path, "double", run, force=True)
    lengths = {f"link{k + 1}.length": value for k, value in enumerate(settings.pendulum.length)}
    folder = Path(monodyn.__file__).parent / "mechanism" / "models"
    models = tuple(file.read_text(encoding="utf-8") for file in sorted(folder.glob("*.xml")))
    return Good(path, lengths, run, (*models, (run / "model.urdf").read_text(encoding="utf-8")))


def _of_clip(rng: np.random.Generator, good: Good, home: Path) -> Case:
    """Run or track a damaged clip."""
    path = mutations.clip(rng, good.clip, home)
    command = str(rng.choice(["run", "run", "track"]))
    return Case((command, str(path), "--model", "double", "--out", str(home / "out")))


def _of_model(rng: np.random.Generator, good: Good, home: Path) -> Case:
    """Identify a table, or run a clip, with a damaged model."""
    path = mutations.model(rng, str(rng.choice(good.models)), home)
    if rng.random() < 0.2:
        return Case(("run", str(good.clip), "--model", str(path), "--out", str(home / "out")))
    poses = str(good.run / "poses.csv")
    return Case(("identify", poses, "--model", str(path), "--out", str(home / "out")))


def _of_table(rng: np.random.Generator, good: Good, home: Path) -> Case:
    """Identify from a table to which something was done."""
    if rng.random() < 0.25:
        record = DAMAGES[str(rng.choice(list(DAMAGES)))](rng)
        path = home / "poses.csv"
        path.write_text(record.text(), encoding="utf-8")
        choices = [("--fix", f"{name}={value!r}") for name, value in record.fix.items()]
        words = ("identify", str(path), "--model", record.model, "--out", str(home / "out"))
        return Case((*words, *(word for pair in choices for word in pair)), record.lengths)
    text = drawn(rng).text() if rng.random() < 0.5 else (good.run / "poses.csv").read_text(encoding="utf-8")
    path = mutations.table(rng, text, home)
    return Case(("identify", str(path), "--model", "double", "--out", str(home / "out")))


def _of_words(rng: np.random.Generator, good: Good, home: Path) -> Case:
    """Call any command with options that are not right, or not for it."""
    command = str(
        rng.choice(["run", "track", "identify", "predict", "control", "live", "models", "warm", "nothing"])
    )
    sources = [str(good.clip), str(good.run), str(good.run / "poses.csv"), "missing", "", "-", "0:3", "auto"]
    words = [command] if rng.random() < 0.95 else []
    words += [str(rng.choice(sources)) for _ in range(int(rng.integers(0, 3)))]
    for _ in range(int(rng.integers(0, 5))):
        value = str(rng.choice([*mutations.ODD_NUMBERS, *VALUES, *sources]))
        words += [str(rng.choice(OPTIONS)), *([value] if rng.random() < 0.9 else [])]
    if rng.random() < 0.6:
        words += ["--out", str(home / "out")]
    columns = str(rng.choice(["0", "1", "5", "20", "40", "80", "200", "-3", "abc", ""]))
    return Case(tuple(word.replace("\x00", "") for word in words), columns=columns)


OPTIONS = (
    "--model", "--fix", "--free", "--bounds", "--fit-frames", "--until", "--torques", "--force", "--json",
    "--quiet", "--seed", "--ensemble", "--tolerance", "--uncertainty", "--method", "--locate.focal",
    "--from", "--at", "--actuated", "--points", "--masks", "--background", "--film", "--help",
    "--identify.starts", "--segment.roi", "--track.method", "--nothing", "-x", "--modle",
)  # fmt: skip
VALUES = (
    "double", "single", "chain:3", "chain:0", "chain:99999", "gravity=9.81", "gravity=abc",
    "link1.length=0.2", "link1.lenght=0.2", "joint1=0.5,joint2=0", "joint1=0.5", "0:40", "40:0",
    "0:1000000", "5:", ":", "linear", "paper", "5deg,2cm", "5", "camera.roll", "link1.length=0.3:0.1",
    "link1.length=0.1:0.3", "0,0,10,10", "time_scale",
)  # fmt: skip
"""Options, and values of some of them."""


def _of_folder(rng: np.random.Generator, good: Good, home: Path) -> Case:
    """Predict from, control or go on with a folder of a run that was changed."""
    folder = str(mutations.run_folder(rng, good.run, home))
    out = str(home / "out")
    return Case(
        (
            ("predict", folder, "--until", "5", "--out", out),
            ("control", folder, "--at", "joint1=1.5708,joint2=0", "--out", out),
            ("identify", str(Path(folder) / "poses.csv"), "--model", folder, "--out", out),
        )[int(rng.integers(3))]
    )


def _of_signal(rng: np.random.Generator, good: Good, home: Path) -> Case:
    """Stop a run at any moment."""
    what = signal.Signals(int(rng.choice([signal.SIGINT, signal.SIGTERM, signal.SIGKILL])))
    return replace(_over_another(rng, good, home), stop=(what, float(rng.uniform(0.0, 7.0))))


def _of_disk(rng: np.random.Generator, good: Good, home: Path) -> Case:
    """Run where the system refuses files beyond a size."""
    return replace(_over_another(rng, good, home), room=int(10 ** rng.uniform(1.0, 6.0)))


def _of_two(rng: np.random.Generator, good: Good, home: Path) -> Case:
    """Run two commands at once into one folder."""
    first, other = _over_another(rng, good, home), _over_another(rng, good, home, begun=False)
    # both may replace what is there, or neither
    force = rng.random() < 0.5
    words = [case.words if force else case.words[:-1] for case in (first, other)]
    return replace(first, words=words[0], beside=words[1])


def _over_another(rng: np.random.Generator, good: Good, home: Path, *, begun: bool = True) -> Case:
    """Return a good command that may replace a run which is there; of which one may have ``begun``."""
    words = (
        ("run", str(good.clip), "--model", "double"),
        ("identify", str(good.run / "poses.csv"), "--model", "double"),
        ("predict", str(good.run), "--until", "5"),
        ("track", str(good.clip), "--model", "double"),
    )[int(rng.integers(4))]
    out = home / "out"
    if begun and rng.random() < 0.5:
        subprocess.run(
            [sys.executable, "-m", "monodyn", *words, "--out", str(out), "--quiet"], check=False,
            capture_output=True, timeout=LONGEST,
        )  # fmt: skip
    return Case((*words, "--out", str(out), "--force"))


KINDS: dict[str, tuple[Callable[[np.random.Generator, Good, Path], Case], float]] = {
    "clip": (_of_clip, 20),
    "model": (_of_model, 22),
    "table": (_of_table, 22),
    "words": (_of_words, 18),
    "folder": (_of_folder, 7),
    "signal": (_of_signal, 6),
    "disk": (_of_disk, 3),
    "two": (_of_two, 2),
}
"""Kinds of cases, and how often each is drawn."""


def _in_time(ends: float, kind: str, seed: int, good: Good, home: Path) -> Found | None:
    """Try a case; None where the time is over."""
    return None if time.monotonic() > ends else tried(kind, seed, good, home)


def tried(kind: str, seed: int, good: Good, home: Path) -> Found:
    """Return what became of a case that is drawn from a seed.

    Args:
        kind: Its kind.
        seed: Its seed.
        good: What is right.
        home: Where its folder goes.
    """
    with tempfile.TemporaryDirectory(dir=home, prefix=f"{kind}-{seed}-") as name:
        folder = Path(name)
        (folder / "work").mkdir()
        case = KINDS[kind][0](np.random.default_rng(seed), good, folder)
        before = snapshot(folder)
        began = time.monotonic()
        code, said = run(case, folder / "work")
        seconds = time.monotonic() - began
        faults = [*judged(case, code, said), *lost(case, before, folder), *misled(case, folder / "out")]
    return Found(f"{kind}:{seed}", tuple(faults), said, code, seconds)


def run(case: Case, where: Path) -> tuple[int | None, str]:
    """Return the exit code of a case that is run, None where it hangs, and what it printed.

    Args:
        case: What is run.
        where: Working folder.
    """
    calls = [words for words in (case.words, case.beside) if words]
    environment = {**os.environ, "COLUMNS": case.columns}
    room = case.room

    def limited() -> None:
        if room is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))

    processes = [
        subprocess.Popen(
            [sys.executable, "-m", "monodyn", *words], cwd=where, env=environment, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", preexec_fn=limited,
        )
        for words in calls
    ]  # fmt: skip
    first = processes[0]
    if case.stop is not None:
        try:
            first.wait(case.stop[1])
        except subprocess.TimeoutExpired:
            first.send_signal(case.stop[0])
    said, codes = [], []
    for process in processes:
        try:
            text, _ = process.communicate(timeout=LONGEST)
            said.append(text)
            codes.append(process.returncode)
        except subprocess.TimeoutExpired:
            process.kill()
            said.append(process.communicate()[0])
            codes.append(None)
    return (None if None in codes else max(codes, key=abs)), "\n".join(said)


def judged(case: Case, code: int | None, said: str) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with what a case said, and how it ended.

    Args:
        case: The case.
        code: Its exit code.
        said: What it printed.
    """
    if code is None:
        yield "hang", f"over {LONGEST:.0f} s"
    elif code not in CODES and not (case.stop is not None and -code == case.stop[0]):
        yield "exit code", str(code)
    odd = FORBIDDEN.search(said)
    if odd is not None:
        line = next(line for line in said.splitlines() if odd[0] in line)
        yield "traceback" if odd[0] == "Traceback" else "noise", line[:150]
    # a refusal is one line of its own
    for line in said.splitlines():
        if line.startswith("monodyn: ") and len(line) > LONG:
            yield "long message", line[:150]


def snapshot(folder: Path) -> dict[str, str]:
    """Return a digest of every file under a folder, by its path.

    Args:
        folder: The folder.
    """
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.is_symlink()
    }


def lost(case: Case, before: dict[str, str], folder: Path) -> Iterator[tuple[str, str]]:
    """Yield what was lost of the files that were there, or mixed, or left where nothing should be.

    Args:
        case: The case.
        before: What was there.
        folder: Folder of the case.
    """
    after = snapshot(folder)
    kept = {name: digest for name, digest in before.items() if not name.startswith("out/")}
    for name, digest in kept.items():
        if after.get(name) != digest:
            yield "lost or mixed", f"{name} is changed"
    for name in after:
        if name not in before and name.startswith("work/") and "--out" in case.words:
            yield "lost or mixed", f"{name} was left in the working folder"
    old, new = (
        {name: digest for name, digest in files.items() if name.startswith("out/") and not _remains(name)}
        for files in (before, after)
    )
    # a prediction has no such file, and is looked at where an old one was there
    if (old and old != new) or (not old and "out/run.json" in new):
        problem = mixed(folder / "out", old, new)
        if problem:
            yield "lost or mixed", problem


def _remains(name: str) -> bool:
    """Return whether a file is what a run that was stopped leaves beside the results."""
    return name.startswith(REMAINS)


def mixed(out: Path, old: dict[str, str], new: dict[str, str]) -> str:
    """Return why a folder is neither the old run, a new one, nor one that says it was stopped; else nothing.

    Args:
        out: The folder.
        old: Digests of the files of the old run.
        new: Those of now.
    """
    if not new:
        return "the old run is gone, and no new one there"
    if not (out / "run.json").is_file():
        return f"no run.json beside {', '.join(sorted(new))[:80]}"
    try:
        document = json.loads((out / "run.json").read_text(encoding="utf-8"))
    except ValueError:
        return "run.json cannot be read"
    listed = {f"out/{name}" for name in document.get("files", [])}
    strange = sorted(set(new) - listed - {"out/run.json"})
    if strange:
        return f"{strange[0]} is not of the run that run.json tells of"
    missing = sorted(listed - set(new))
    if missing:
        return f"{missing[0]} is missing"
    same = [name for name in new if name in old and old[name] == new[name] and name.endswith("run.json")]
    if same and old != new:
        return "run.json is that of the old run, other files are not"
    return ""


def misled(case: Case, out: Path) -> Iterator[tuple[str, str]]:
    """Yield what is trusted and wrong.

    Args:
        case: The case, with what is true of it.
        out: Its run folder.
    """
    try:
        document = json.loads((out / "fit.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return
    if document.get("grade") != "trusted":
        return
    for parameter in document["parameters"]:
        true = case.lengths.get(parameter["name"])
        if true is None or not parameter["free"] or parameter["std"] is None:
            continue
        if abs(parameter["value"] - true) > MOST_STD * parameter["std"]:
            yield "trusted and wrong", f"{parameter['name']} {parameter['value']:.5g}, truly {true:.5g}"


if __name__ == "__main__":
    sys.exit(main())
