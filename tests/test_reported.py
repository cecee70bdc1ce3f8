"""A fit that a program made is judged and written as the command line does it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import monodyn
from fits import identified, made_fit, record
from monodyn.errors import MonodynError, SettingsError
from monodyn.estimation.fit import Doubt
from monodyn.mechanism import load
from monodyn.mechanism.simulate import simulate
from monodyn.pipeline import identify_tables
from monodyn.results.lock import FolderLock
from monodyn.results.trace import fitted_poses
from monodyn.types import Poses
from support import refuses

NOISE = 1e-3


def swung(count: int, begin: float, *, kicked: int | None = None, kick: float = 4.0, seed: int = 3) -> Poses:
    """Record a single pendulum, which is kicked [rad/s] at a frame."""
    time = np.arange(count) / 30.0
    position = simulate(load("single"), time, np.array([begin]), np.array([0.5])).position.copy()
    at = count if kicked is None else kicked
    position[at:, 0] += kick * (time[at:] - time[at - 1])
    position += NOISE * np.random.default_rng(seed).standard_normal((count, 1))
    covariance = np.full((count, 1, 1), NOISE**2)
    return Poses(("joint1",), np.arange(count), time, position, covariance, np.ones(count, dtype=bool))


def both(tmp_path: Path, records: list[Poses], stop: int) -> tuple[dict, dict]:
    """Identify the first frames of records by the command line and in Python; return both ``fit.json``."""
    tables = [tmp_path / f"{k}.csv" for k in range(len(records))]
    for one, table in zip(records, tables, strict=True):
        monodyn.write_poses(one, table)
    settings = monodyn.RunSettings(fit_frames=(0, stop), tolerance=monodyn.Tolerance(angle=0.02))
    identify_tables(tables, "single", tmp_path / "cli", settings)
    mechanism = load("single")
    again = [monodyn.read_poses(table, mechanism) for table in tables]
    fit = monodyn.identify([one[:stop] for one in again], mechanism)
    monodyn.report(fit, to=tmp_path / "python", poses=again, settings=settings)
    found = tuple(json.loads((tmp_path / name / "fit.json").read_text()) for name in ("cli", "python"))
    return found[0], found[1]


@pytest.mark.slow
def test_all_records_are_written_as_by_the_command_line(tmp_path: Path) -> None:
    there, here = both(tmp_path, [swung(80, -1.0), swung(70, -0.6, seed=4)], 50)
    for table in ("states.csv", "prediction.csv"):
        texts = [(tmp_path / name / table).read_text() for name in ("cli", "python")]
        assert texts[0] == texts[1]
        assert {row.rpartition(",")[2] for row in texts[1].splitlines()[1:]} == {"0", "1"}
    assert len(here["initial_state"]) == len(here["heldout_rms"]) == len(here["horizon"]) == 2
    assert here["horizon"][0]["tolerance"] == {"joint1": 0.02}
    for field in ("heldout_rms", "horizon", "grade", "status", "doubts", "parameters", "initial_state"):
        assert here[field] == there[field], field


def test_frames_after_the_fitted_ones_judge_it(tmp_path: Path) -> None:
    there, here = both(tmp_path, [swung(80, -1.0, kicked=50)], 50)
    assert here["heldout_rms"][0]["joint1"] > 1.0
    assert here["grade"] == "refused"
    assert here["status"].startswith("The motion does not go on as identified: within ")
    assert here["doubts"] == there["doubts"]


@pytest.mark.slow
def test_where_none_are_left_the_last_fifth_judges_it(tmp_path: Path) -> None:
    """The fit alone is trusted: a small kick at its end is within what its residuals may be."""
    kicked = swung(80, -1.0, kicked=72, kick=0.1)
    assert monodyn.identify(kicked, load("single")).grade == "trusted"
    there, here = both(tmp_path, [kicked], 80)
    assert here["grade"] == there["grade"] == "approximate"
    for found in (there, here):
        (doubt,) = found["doubts"]
        assert doubt["reason"].startswith("Identified without the last 0.53 s of the record: ")


def test_what_was_judged_is_not_judged_twice(tmp_path: Path) -> None:
    """As the fit of a run was."""
    monodyn.write_poses(swung(80, -1.0, kicked=50), tmp_path / "0.csv")
    done = identify_tables([tmp_path / "0.csv"], "single", settings=monodyn.RunSettings(fit_frames=(0, 50)))
    assert done.fit is not None
    poses = monodyn.read_poses(tmp_path / "0.csv", load("single"))
    monodyn.report(done.fit, to=tmp_path / "again", poses=poses)
    again = json.loads((tmp_path / "again" / "fit.json").read_text())
    assert again["doubts"] == done.document["doubts"]


def test_a_run_that_was_read_back_is_not_written_again(tmp_path: Path) -> None:
    monodyn.report(identified(), to=tmp_path / "run", poses=record(identified()))
    back = monodyn.open_run(tmp_path / "run")
    said = (
        "report: expected a fit with its residuals, got one that was read back from a run folder, which does "
        "not keep them; copy that folder, or identify the record again."
    )
    with refuses(SettingsError, said):
        monodyn.report(back, to=tmp_path / "again", poses=record(back))


def test_predictions_and_models_are_those_that_are_asked_for(tmp_path: Path) -> None:
    records = [swung(30, -1.0), swung(30, -0.6)]
    fit = monodyn.identify(records, load("single"))
    ahead = [monodyn.predict(fit, until=1.5, record=k) for k in range(2)]
    monodyn.report(fit, ahead, to=tmp_path / "run", settings=monodyn.RunSettings(ensemble=3))
    rows = (tmp_path / "run" / "prediction.csv").read_text().splitlines()[1:]
    assert [row.rpartition(",")[2] for row in rows].count("1") == len(ahead[1].time) > 0
    assert len(list((tmp_path / "run").glob("ensemble_*.xml"))) == 3
    # the fitted frames of each come back from the residuals
    for k in range(2):
        np.testing.assert_allclose(
            fitted_poses(fit, record=k).position, records[k].position, rtol=0.0, atol=1e-6
        )


def test_a_fit_without_a_motion_is_written_too(tmp_path: Path) -> None:
    refused = made_fit(starts=()).doubted([Doubt("refused", "Nothing moves.")])
    monodyn.report(refused, to=tmp_path / "run", poses=record(made_fit()))
    assert json.loads((tmp_path / "run" / "fit.json").read_text())["status"] == "Nothing moves."
    assert len((tmp_path / "run" / "poses.csv").read_text().splitlines()) == 31


def test_another_number_of_records_is_refused(tmp_path: Path) -> None:
    fit = identified()
    said = (
        "poses: expected one record for each of the 1 that were fitted, got 2; pass them in the order of the "
        "records."
    )
    with refuses(SettingsError, said):
        monodyn.report(fit, to=tmp_path / "run", poses=[record(fit), record(fit)])
    with refuses(SettingsError, said.replace("poses", "future").replace("one record", "one prediction")):
        monodyn.report(fit, [None, None], to=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_record_of_another_length_is_not_taken_for_the_fitted_one(tmp_path: Path) -> None:
    fit = identified()
    longer = replace(record(fit), time=record(fit).time + 1.0)
    with pytest.raises(monodyn.VideoError, match="expected the record that was fitted"):
        monodyn.report(fit, to=tmp_path / "run", poses=longer)


def test_the_file_of_the_mechanism_is_not_replaced(tmp_path: Path) -> None:
    fit, file = identified(), tmp_path / "model.xml"
    monodyn.write_mjcf(fit.mechanism, file)
    read = replace(fit, mechanism=replace(fit.mechanism, source=str(file)))
    said = (
        f"out '{tmp_path}': expected another folder than that of the inputs, got the one of '{file}', which "
        "the run would replace; give another with --out."
    )
    with refuses(SettingsError, said):
        monodyn.report(read, to=tmp_path, force=True)


def test_a_folder_that_is_in_use_or_taken_is_refused_before_the_fits_that_judge(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def worked(*_: object, **__: object) -> None:
        raise AssertionError("began to work")

    fit = made_fit()
    monodyn.report(fit, to=tmp_path / "taken")
    monkeypatch.setattr("monodyn.reported.fitted_poses", worked)
    monkeypatch.setattr("monodyn.reported._judged", worked)
    with pytest.raises(SettingsError, match=r"it holds states.csv; give another folder, or --force"):
        monodyn.report(fit, to=tmp_path / "taken")
    lock = FolderLock(tmp_path / "held")
    with pytest.raises(SettingsError, match="got one in use by process"):
        monodyn.report(fit, to=tmp_path / "held", force=True)
    lock.release()


def test_what_is_refused_by_its_records_leaves_no_folder(tmp_path: Path) -> None:
    with pytest.raises(MonodynError, match="expected"):
        monodyn.report(made_fit(), [None, None], to=tmp_path / "new")
    assert not (tmp_path / "new").exists()
