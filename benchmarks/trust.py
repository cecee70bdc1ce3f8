"""Print how often a verdict can be relied on: wrong models, damaged records, right ones.

Run: ``MONODYN_DATA=<folder> python benchmarks/trust.py [--only GROUP ...] [--json FILE] [--gate]``.
No fit may be called trusted with a parameter more than four standard deviations from its truth, or with a
held-out error of more than three bands; right models are to be called trusted; ``films`` are the real ones.
``carts`` are drawn clips by turned cameras. Then come the figures of the scripts that measure what a verdict
rests on (``ALSO``), whose own options say more. ``--runs`` keeps the folders of clips, and a pair that is
there already is not run again.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import monodyn
from clips import cached
from damaged import DAMAGES, Record, drawn
from figures import Figure, command_line, figures_of, finish, say, table
from filmed import MECHANISMS
from monodyn.pipeline import identify_tables
from monodyn.vision.drawing.camera import CAMERA_STD, CAMERA_TURNS
from spec import Case
from windows import real_films

KINDS = ("single", "bob", "double_a", "triple", "cartpole", "double_ell", "ball_above")
"""Clips whose models are tried on one another."""
ALIKE = {frozenset({"bob", "ball_above"}), frozenset({"double_a", "double_ell"})}
"""Mechanisms that a model of the other may well describe."""
ENCODED = 14
"""Windows of encoders that are run with free bodies."""
CARTS, CART_SEED = 12, 900
"""Drawn clips of cart-poles, and the seed of the first."""
DRAWN = 200
"""Records of right models."""
SEEDS = 3
"""Records of each damage."""
ALSO = {
    "coverage": ("intervals.py",),
    "lacking": ("lacking.py",),
    "filmed": ("clip_intervals.py",),
    "ratios": ("encoders.py", "--only", "alone", "together", "units"),
    "torque": ("torque_kinds.py",),
    "known": ("torques.py",),
    "alarms": ("alarms.py",),
}
"""Other scripts, with their arguments, by what they measure."""
MOST_STD, MOST_BANDS = 4.0, 3.0
"""Standard deviations beyond which a parameter is wrong, and a prediction."""


@dataclass(frozen=True)
class Verdict:
    """What one run said, and whether it was so.

    Attributes:
        case: What was run.
        grade: Its grade; ``stopped`` where there was no fit.
        wrong: What was off by too much, as words.
        reason: What spoke against it, or its status.
        seconds: Wall time [s].
    """

    case: str
    grade: str
    wrong: tuple[str, ...]
    reason: str
    seconds: float

    @property
    def misled(self) -> bool:
        """Whether it was called trusted and is not."""
        return self.grade == "trusted" and bool(self.wrong)


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 when the data are missing.
    """
    groups = {
        "models": models,
        "clips": clips,
        "carts": carts,
        "tables": tables,
        "encoders": encoders,
        "drawn": right,
    }
    parser = command_line(__doc__, (*groups, "films", *ALSO))
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="keep the run folders there")
    options = parser.parse_args()
    data = Path(os.environ.get("MONODYN_DATA") or "missing")
    if not (data / "rendered").is_dir():
        print("MONODYN_DATA: expected the folder that holds rendered/; set the variable.", file=sys.stderr)
        return 2
    figures: list[Figure] = []
    with tempfile.TemporaryDirectory() as temporary:
        runs = options.runs or Path(temporary)
        runs.mkdir(parents=True, exist_ok=True)
        for group in options.only or (*groups, "films", *ALSO):
            if group in ALSO:
                figures += figures_of(*ALSO[group])
                continue
            if group == "films":
                figures += real_films(data, runs)
                continue
            verdicts = []
            for verdict in groups[group](data, runs):
                verdicts.append(verdict)
                mark = "MISLED " if verdict.misled else ""
                off = f" [{', '.join(verdict.wrong)}]" if verdict.wrong else ""
                say(f"{mark}{verdict.case}: {verdict.grade}, {verdict.seconds:.0f} s: {verdict.reason}{off}")
            figures += counted(group, verdicts)
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def counted(group: str, verdicts: Sequence[Verdict]) -> list[Figure]:
    """Return the figures of one group.

    Args:
        group: Its name.
        verdicts: What its runs said.

    Returns:
        How many there were, how many were trusted and wrong, the longest, and the share of each grade.
    """
    count = max(1, len(verdicts))
    figures = [
        Figure(group, "runs", len(verdicts), ""),
        Figure(group, "trusted and wrong", sum(v.misled for v in verdicts), "", 0.0),
        Figure(group, "longest", max((v.seconds for v in verdicts), default=0.0), "s"),
    ]
    for grade in ("trusted", "approximate", "refused", "stopped"):
        share = 100.0 * sum(v.grade == grade for v in verdicts) / count
        wanted = grade == "trusted" and group in ("clips", "encoders", "drawn")
        figures.append(Figure(group, grade, share, "%", 95.0 if wanted else None, least=True))
    return figures


def models(data: Path, runs: Path) -> Iterator[Verdict]:
    """Run every clip with the models of the others.

    Args:
        data: The folder of clips.
        runs: Where the run folders go.

    Yields:
        What each run said, and whether it was so.
    """
    for clip in KINDS:
        for model in KINDS:
            if clip != model and frozenset({clip, model}) not in ALIKE:
                yield filmed(data, clip, model, runs)


def clips(data: Path, runs: Path) -> Iterator[Verdict]:
    """Run every clip with its own model.

    Args:
        data: The folder of clips.
        runs: Where the run folders go.

    Yields:
        What each run said, and whether it was so.
    """
    for clip in sorted((data / "rendered").glob("*.mp4")):
        yield filmed(data, clip.stem, clip.stem, runs)


def filmed(data: Path, clip: str, model: str, runs: Path) -> Verdict:
    """Run one clip with a model, and compare the lengths with the truth.

    Args:
        data: The folder of clips.
        clip: Name of the clip.
        model: Name of the model.
        runs: Where the run folder goes.

    Returns:
        What it said, and whether it was so.
    """
    folder = data / "rendered"
    truth = json.loads((folder / f"{clip}.json").read_text(encoding="utf-8"))["truth"]
    known = {f"link{i}.length": link[0] for i, link in enumerate(truth["links"], start=1)}
    out = runs / f"{clip}_with_{model}"
    return run(f"{clip} with {model}", folder / f"{clip}.mp4", folder / f"{model}.xml", out, known)


def carts(data: Path, runs: Path) -> Iterator[Verdict]:
    """Run drawn clips of cart-poles by cameras that are turned as far as is assumed of any.

    Args:
        data: Not used.
        runs: Where the run folders go.

    Yields:
        What each run said, and whether it was so.
    """
    for seed in range(CARTS):
        case = drawn_cart(np.random.default_rng(CART_SEED + seed), seed)
        clip = cached(case)
        values = monodyn.load(clip.truth).values
        known = {name: values[name] for name in ("cart.length", "link1.length")}
        yield run(case.name, clip.video, clip.model, runs / case.name, known)


def drawn_cart(rng: np.random.Generator, seed: int) -> Case:
    """Draw a cart-pole, its picture and the camera before it.

    Args:
        rng: Where they come from.
        seed: Of the noise.

    Returns:
        The clip to make.
    """
    usual = MECHANISMS["cart"]
    cart, pole = usual.parts
    cart = replace(
        cart, length=float(rng.uniform(0.08, 0.16)), width=float(rng.uniform(0.04, 0.08)),
        mass=float(rng.uniform(0.2, 0.5)),
    )  # fmt: skip
    pole = replace(pole, length=float(rng.uniform(0.18, 0.32)), width=float(rng.uniform(0.016, 0.03)))
    roll, pitch, yaw = (float(np.degrees(CAMERA_STD[name] * rng.normal())) for name in CAMERA_TURNS)
    return replace(
        usual, name=f"cart_{seed}", parts=(cart, pole), turned=(roll, pitch, yaw), seconds=6.0, seed=seed,
        fovy=float(rng.uniform(30.0, 55.0)), noise=float(rng.uniform(1.0, 4.0)),
        wall=str(rng.choice(["plain", "mottled", "checker", "stripes"])),  # pyright: ignore
    )  # fmt: skip


def run(case: str, video: Path, model: Path, out: Path, known: Mapping[str, float]) -> Verdict:
    """Run a clip, where that is not done, and compare parameters with their true values.

    Args:
        case: What it is called.
        video: The clip.
        model: The mechanism file.
        out: The run folder.
        known: True values by name.

    Returns:
        What it said, and whether it was so.
    """
    began = time.perf_counter()
    if not (out / "fit.json").is_file():
        try:
            monodyn.run(video, model, out, force=True)
        except monodyn.MonodynError as error:
            return Verdict(case, "stopped", (), str(error)[:100], time.perf_counter() - began)
    document = json.loads((out / "fit.json").read_text(encoding="utf-8"))
    return judged(case, document, known, time.perf_counter() - began, beyond_frames(out))


def beyond_frames(out: Path) -> dict[str, float]:
    """Return by how many bands the frames that were held out lie beside their prediction, by joint.

    Args:
        out: A run folder.
    """
    if not (out / "prediction.csv").is_file():
        return {}
    poses, future = _columns(out / "poses.csv"), _columns(out / "prediction.csv")
    _, rows, places = np.intersect1d(future["frame"], poses["frame"], return_indices=True)
    found = {}
    for joint in (name.removesuffix("_seen") for name in poses if name.endswith("_seen")):
        off = future[joint][rows] - poses[joint][places]
        std = np.hypot(future[f"{joint}_std"][rows], poses[f"{joint}_std"][places])
        use = (poses[f"{joint}_seen"][places] == 1) & np.isfinite(off)
        if use.any():
            found[joint] = bands_off(off[use], std[use])
    return found


def bands_off(off: np.ndarray, std: np.ndarray) -> float:
    """Return the size of errors in units of their standard deviations, both rms.

    Args:
        off: Errors, (frame,).
        std: Their standard deviations, (frame,).
    """
    return float(np.sqrt(np.mean(off**2) / np.mean(std**2)))


def beyond_record(fit: monodyn.Fit | None, record: Record) -> dict[str, float]:
    """Return by how many bands the motion after a record lies beside its prediction, by joint.

    Args:
        fit: What was identified.
        record: The record, and how it went on.
    """
    if record.ahead is None or fit is None or not fit.ok:
        return {}
    time, position = record.ahead
    future = monodyn.predict(fit, times=time)
    return {
        joint: bands_off(future.position[:, j] - position[:, j], future.std[:, j])
        for j, joint in enumerate(record.joints)
    }


def _columns(path: Path) -> dict[str, np.ndarray]:
    table = np.genfromtxt(path, delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names or ()}


def judged(
    case: str,
    document: dict[str, Any],
    known: dict[str, float],
    seconds: float,
    beyond: Mapping[str, float] | None = None,
) -> Verdict:
    """Compare what a run said with what is known.

    Args:
        case: What was run.
        document: The content of ``fit.json``.
        known: True values by name.
        seconds: Wall time [s].
        beyond: By how many bands what it did not see lies beside the prediction, by joint.

    Returns:
        What it said, and whether it was so.
    """
    wrong = [f"{joint} {bands:.1f} bands" for joint, bands in (beyond or {}).items() if bands > MOST_BANDS]
    for row in document["parameters"]:
        std = row["std"]
        if row["name"] in known and row["free"] and std is not None and np.isfinite(std) and std > 0.0:
            # the interval is that of a logarithm for what cannot be negative
            off = abs(np.log(max(row["value"], 1e-12) / known[row["name"]])) / (std / row["value"])
            if off > MOST_STD:
                wrong.append(f"{row['name']} {off:.1f} std")
    reason = document["doubts"][0]["reason"] if document["doubts"] else document["status"]
    return Verdict(case, document["grade"], tuple(wrong), reason[:100], seconds)


def tables(data: Path, runs: Path) -> Iterator[Verdict]:
    """Identify records to which something was done, or of another mechanism than the model's.

    Args:
        data: Not used.
        runs: Where the tables go.

    Yields:
        What each run said, and whether it was so.
    """
    for name, damage in DAMAGES.items():
        for seed in range(SEEDS):
            record = damage(np.random.default_rng(seed))
            yield identified(f"{name} {seed}", record, runs)


def right(data: Path, runs: Path) -> Iterator[Verdict]:
    """Identify records of the model's own mechanism.

    Args:
        data: Not used.
        runs: Where the tables go.

    Yields:
        What each run said, and whether it was so.
    """
    for seed in range(DRAWN):
        yield identified(f"drawn {seed}", drawn(np.random.default_rng(1000 + seed)), runs)


def identified(case: str, record: Record, runs: Path) -> Verdict:
    """Identify one record and compare with the truth.

    Args:
        case: What it is called.
        record: The record.
        runs: Where the table goes.

    Returns:
        What it said, and whether it was so.
    """
    path = runs / f"{case.replace(' ', '_')}.csv"
    path.write_text(record.text(), encoding="utf-8")
    began = time.perf_counter()
    settings = monodyn.RunSettings(fix=dict(record.fix), free=list(record.free))
    try:
        outcome = identify_tables([path], record.model, settings=settings)
    except monodyn.MonodynError as error:
        return Verdict(case, "stopped", (), str(error)[:100], time.perf_counter() - began)
    seconds, beyond = time.perf_counter() - began, beyond_record(outcome.fit, record)
    return judged(case, outcome.document, record.lengths, seconds, beyond)


def encoders(data: Path, runs: Path) -> Iterator[Verdict]:
    """Identify windows of encoders with free bodies, whose motion noise alone does not explain.

    Args:
        data: The folder of records.
        runs: Not used.

    Yields:
        What each run said, and whether it was so.
    """
    for path in sorted((data / "encoders").glob("double_*.csv"))[:ENCODED]:
        began = time.perf_counter()
        settings = monodyn.RunSettings(identify=monodyn.IdentifySettings(bodies="free"))
        outcome = identify_tables([path], "double", settings=settings)
        yield judged(path.stem, outcome.document, {"link1.length": 0.1727}, time.perf_counter() - began)


if __name__ == "__main__":
    raise SystemExit(main())
