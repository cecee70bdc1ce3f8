"""Numbers that are infinite, unknown or not there, taken through all that writes and shows a result."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import monodyn
from fits import made_fit, record
from monodyn.cli.show import show
from monodyn.estimation.fit import Doubt, Fit
from monodyn.estimation.parts import Combination, Unmodelled
from monodyn.estimation.settings import IdentifySettings
from monodyn.pipeline import Outcome
from monodyn.results.filmed import filmed_of
from monodyn.results.findings import Findings, fit_document
from monodyn.results.folder import RunFolder
from monodyn.results.opened import open_run
from monodyn.results.predict import predict
from monodyn.results.report import write_results
from monodyn.results.trace import Trace, trace_of
from monodyn.types import Poses
from monodyn.vision.locating.scene import Scene

INF, NAN = math.inf, math.nan
NO_NUMBER = re.compile(r"(?<![\w.<])(?:nan|inf|None|NaN|Infinity)(?![\w(])")
"""What Python, and JavaScript, call what is no number; in no text for a user."""
LENGTH, DAMPING, GRAVITY = made_fit().parameters


def two_records() -> Fit:
    """Return a fit of two records whose predictions stay in their tolerance as far as is looked."""
    fit = made_fit()
    states = np.diag(fit.covariance)[-2:]
    covariance = np.diag(np.concatenate((np.diag(fit.covariance), states)))
    return replace(
        fit, starts=fit.starts * 2, time=fit.time * 2, residual=fit.residual * 2, covariance=covariance
    )


UNKNOWN: dict[str, Callable[[], Fit]] = {
    "two horizons beyond what is looked at": two_records,
    "a combination without an error": lambda: made_fit(
        combinations=(Combination("joint1.damping / link1.J", 0.1, INF, -INF, INF),)
    ),
    "a combination that is none": lambda: made_fit(combinations=(Combination("a / b", NAN, NAN, NAN, NAN),)),
    "no combination": lambda: made_fit(combinations=()),
    "a joint that was never measured": lambda: made_fit(rms={"joint1": NAN}),
    "a motion beyond all numbers": lambda: made_fit(rms={"joint1": INF}),
    "an interval without ends": lambda: made_fit(
        parameters=(replace(LENGTH, std=INF, lower=-INF, upper=INF, identifiable=False), DAMPING, GRAVITY)
    ),
    "an interval with one end": lambda: made_fit(
        parameters=(replace(LENGTH, std=INF, lower=0.1, upper=INF), DAMPING, GRAVITY)
    ),
    "nothing estimated": lambda: replace(
        made_fit(), parameters=(GRAVITY,), covariance=made_fit().covariance[-2:, -2:]
    ),
    "no intervals": lambda: replace(made_fit(), covariance=np.full((4, 4), NAN)),
    "an unknown lack": lambda: replace(
        made_fit(), unmodelled=Unmodelled(np.array([INF]), np.full((2, 2), NAN))
    ),
    "nothing identified": lambda: monodyn.identify(
        replace(record(made_fit()), covariance=np.full((30, 1, 1), 1e-6))[:2], made_fit().mechanism
    ),
}


def set_beside(fit: Fit, poses: Poses) -> list[Trace]:
    """Return the records of a fit with their predictions, of which the last one has no number at its end."""
    traces = []
    for k in range(len(fit.starts)):
        after = poses.time[len(fit.time[k]) :]
        future = predict(fit, times=after, record=k) if len(after) else None
        traces.append(trace_of(fit, poses, future, record=k, name=f"record {k}"))
    if traces and traces[-1].future is not None:
        position = traces[-1].future.position.copy()
        position[-1] = INF
        traces[-1] = replace(traces[-1], future=replace(traces[-1].future, position=position))
    return traces


def shown(outcome: Outcome, capsys: pytest.CaptureFixture[str]) -> str:
    """Return what the terminal says of an outcome; as JSON it has to be readable."""
    show(outcome, as_json=True, quiet=False)
    json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    show(outcome, as_json=False, quiet=False)
    return capsys.readouterr().out


def check_texts(texts: Sequence[str]) -> None:
    for text in texts:
        assert not NO_NUMBER.findall(text), NO_NUMBER.search(text)


def check_folder(folder: Path) -> None:
    """Read every file of a run folder for what is no number."""
    json.loads((folder / "fit.json").read_text(), parse_constant=pytest.fail)
    # before the scripts, which have their own names for it
    page = (folder / "report.html").read_text(encoding="utf-8").split("<script>")[0]
    check_texts([re.sub(r"<style>.*?</style>", "", page, flags=re.DOTALL)])
    data = re.search(r"const PLOTS = (.*);", (folder / "report.html").read_text(encoding="utf-8"))
    if data:
        json.loads(data[1], parse_constant=pytest.fail)
    for table in folder.glob("*.csv"):
        with table.open(encoding="utf-8") as file:
            check_texts([" ".join(row) for row in csv.reader(file)])
    for model in ("model.xml", "model.urdf"):
        check_texts([(folder / model).read_text(encoding="utf-8")])
    monodyn.load(folder / "model.xml")


@pytest.mark.parametrize("unknown", UNKNOWN)
def test_what_is_no_number_goes_through_every_renderer(
    unknown: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fit, poses = UNKNOWN[unknown](), record(made_fit())
    traces = set_beside(fit, poses)
    findings = Findings(fit, traces, "t", record=poses if len(traces) == 1 else None)
    folder = RunFolder(tmp_path / "run")
    written = write_results(folder, findings)
    folder.finish()
    check_folder(tmp_path / "run")
    # what was written and what was not are shown alike
    said = [
        shown(Outcome(None, document, poses, fit, traces), capsys)
        for document in (fit_document(findings), written)
    ]
    check_texts([*said, repr(fit), fit._repr_html_()])
    assert said[0] == said[1]
    back = open_run(tmp_path / "run")
    check_texts([repr(back), back._repr_html_()])
    assert (back.status, back.grade) == (fit.status, fit.grade)


def test_of_several_records_the_shortest_horizon_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    fit, poses = two_records(), record(made_fit())
    document = fit_document(Findings(fit, set_beside(fit, poses)))
    seconds = [row["seconds"] for row in document["horizon"]]
    # the last row of the second one has no number, which is seen to be off
    assert seconds[0] is None
    assert seconds[1] == pytest.approx(8 / 30 + 1 / 30)
    assert f"Of 2 records the shortest: {document['horizon'][1]['said']}" in shown(
        Outcome(None, document, poses, fit), capsys
    )
    calm = fit_document(Findings(fit, [trace_of(fit, poses, record=k) for k in range(2)]))
    assert [row["seconds"] for row in calm["horizon"]] == [None, None]
    assert "Of 2 records the shortest: Predictions stay within 5 deg over all of the 60 s" in shown(
        Outcome(None, calm, poses, fit), capsys
    )


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["approximate", "refused"])
def test_what_is_no_number_is_drawn(
    grade: str, filmed: tuple[Scene, Poses], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Film, diagnosis and page of a clip whose camera and joints are not known."""
    scene, poses = filmed
    quick = IdentifySettings(torque="friction", starts=1)
    fit = monodyn.identify(poses[:20], scene.mechanism, quick)
    rows = tuple(replace(p, std=INF, lower=-INF, upper=INF, identifiable=False) for p in fit.parameters)
    fit = replace(
        fit, parameters=rows, rms=dict.fromkeys(fit.rms, NAN), doubts=(), covariance=fit.covariance * NAN
    ).doubted([Doubt(grade, "Nothing is known.")])  # type: ignore[arg-type]
    wide = replace(scene, camera_std={"camera.depth": INF, "camera.roll": NAN})
    traces = set_beside(fit, poses)
    findings = Findings(fit, traces, "t", record=poses, filmed=filmed_of(fit, wide, traces[0].poses))
    folder = RunFolder(tmp_path / "run")
    document = write_results(folder, findings)
    folder.finish()
    check_folder(tmp_path / "run")
    assert {"overlay.mp4", "diagnosis.png"} <= {path.name for path in (tmp_path / "run").iterdir()}
    assert document["camera"]["std"] == {"camera.depth": None, "camera.roll": None}
    check_texts([shown(Outcome(None, document, poses, fit, traces), capsys)])
