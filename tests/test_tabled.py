"""Tables of joint positions without a model: their columns and the motion decide."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from monodyn.errors import MechanismError, SettingsError
from monodyn.estimation.record.tables import write_poses
from monodyn.mechanism import load
from monodyn.mechanism.simulate import simulate
from monodyn.pipeline import identify_tables
from monodyn.settings import RunSettings
from monodyn.tabled import tabled
from support import refuses
from swings import TIMES, motion, record


def written(folder: Path, model: str, start: list[float], names: tuple[str, ...]) -> Path:
    """Write the simulated motion of a bundled mechanism under other names of its joints."""
    mechanism = load(model)
    swing = motion(mechanism, TIMES, start, [0.0] * len(start))
    path = folder / "swing.csv"
    # a slide of a few centimetres is measured to a tenth of a millimetre
    poses = record(mechanism, TIMES, swing, noise=1e-4)
    write_poses(replace(poses, joints=names), path)
    return path


def joints(count: int) -> tuple[str, ...]:
    return tuple(f"joint{k + 1}" for k in range(count))


@pytest.mark.slow
@pytest.mark.parametrize(("model", "start"), [("double", [-0.9, 0.6]), ("cartpole", [0.0, -0.4])])
def test_two_columns_are_a_double_pendulum_or_a_cart_as_the_motion_has_it(
    model: str, start: list[float], tmp_path: Path
) -> None:
    table = written(tmp_path, model, start, joints(2))
    document = identify_tables([table], "auto", tmp_path / "fit").document
    rows = document["comparison"]
    assert [row["model"] for row in rows if row["chosen"]] == [model]
    assert {row["model"] for row in rows} == {"double", "cartpole"}
    assert rows[0]["grade"] == document["grade"] != "refused"
    page = (tmp_path / "fit" / "report.html").read_text(encoding="utf-8")
    assert f"<h2>Why {model}</h2>" in page


@pytest.mark.slow
def test_a_single_joint_is_the_simpler_mechanism(tmp_path: Path) -> None:
    table = written(tmp_path, "single", [0.5], joints(1))
    rows = identify_tables([table], "auto").document["comparison"]
    assert (rows[0]["model"], len(rows)) == ("single", 1)
    said = re.fullmatch(r"fit trusted, residuals of (.*) times the noise, (\d+) unknowns\.", rows[0]["said"])
    assert said
    assert rows[0]["said"] == f"fit trusted, residuals of {said[1]} times the noise, {said[2]} unknowns."
    # the noise is white and as stated
    assert 0.8 < float(said[1]) < 1.2


@pytest.mark.slow
def test_a_joint_that_was_hardly_measured_is_a_doubt(tmp_path: Path) -> None:
    mechanism, times = load("double"), np.arange(120) / 60.0
    poses = record(mechanism, times, motion(mechanism, times, [-0.9, 0.6], [0.0, 0.0]), noise=1e-3)
    for every, grade in ((20, "approximate"), (12, "trusted")):
        shown = np.column_stack([np.ones(120, dtype=bool), np.arange(120) % every == 0])
        table = tmp_path / f"{every}.csv"
        write_poses(replace(poses, joint_seen=shown, seen=shown.all(axis=1)), table)
        document = identify_tables([table], "double").document
        assert document["grade"] == grade
        hardly = [one for one in document["doubts"] if one["reason"].startswith("joint2 could be measured")]
        assert hardly == (
            []
            if grade == "trusted"
            else [
                {
                    "grade": "approximate",
                    "reason": "joint2 could be measured in at most 6 of the 120 rows in which another joint "
                    "was: so few do not show that the mechanism moves there as it was identified. Measure it "
                    "in more rows, or take a mechanism without it.",
                    "holds": None,
                }
            ]
        )


def test_the_columns_limit_what_is_tried(tmp_path: Path) -> None:
    four = written(tmp_path, "chain:4", [-0.9, 0.2, 0.1, 0.1], joints(4))
    chains = tabled([four], RunSettings())
    assert [one.model for one in chains] == ["chain:4"]
    carts = tabled([written(tmp_path, "cartpole", [0.0, -0.4], ("slide", "joint1"))], RunSettings())
    assert [one.model for one in carts] == ["cartpole"]
    with pytest.raises(MechanismError, match=r"link7\.length"):
        tabled([written(tmp_path, "single", [0.5], joints(1))], RunSettings(fix={"link7.length": 0.1}))


def test_columns_of_other_names_need_a_model(tmp_path: Path) -> None:
    table = tmp_path / "log.csv"
    table.write_text("time,hip\n" + "".join(f"{t:.2f},{np.sin(t):.4f}\n" for t in np.arange(20) / 20))
    with refuses(
        SettingsError,
        "model: expected the columns joint1, joint2, ... in 'log.csv', got time, hip; name the mechanism "
        "with --model.",
    ):
        tabled([table], RunSettings())


@pytest.mark.slow
def test_every_table_is_fitted_in_a_window_and_predicted_after_it(tmp_path):
    """Against the motion itself: what is predicted of each record has not been fitted."""
    mechanism, times = load("double"), np.arange(90) / 60.0
    tables = []
    for k, start in enumerate(([-1.2, 0.4], [0.3, -0.5])):
        q = simulate(mechanism, times, np.array(start), np.zeros(2)).position
        noisy = q + 1e-3 * np.random.default_rng(k).standard_normal(q.shape)
        rows = np.column_stack([times, noisy])
        tables.append(tmp_path / f"{k}.csv")
        text = "time,joint1,joint2\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist())
        tables[-1].write_text(text)
    settings = RunSettings(fit_frames=(10, 60), until=1.6)
    done = identify_tables(tables, "double", tmp_path / "out", settings)
    assert [trace.rows for trace in done.traces] == [(10, 60), (10, 60)]
    for trace in done.traces:
        assert trace.future.time[0] == pytest.approx(1.0)
        assert trace.future.time[-1] == pytest.approx(1.6)
        assert max(trace.heldout().values()) < 0.02
    assert len(done.document["heldout_rms"]) == len(done.document["horizon"]) == 2
    with refuses(
        SettingsError,
        "fit-frames: expected a range with at least two of the frames of '0.csv', 0 to 89, got 89:200; give "
        "another.",
    ):
        identify_tables(tables, "double", settings=RunSettings(fit_frames=(89, 200)))
