"""The repeated experiment: its fits, verdicts, page, tables, folder and command."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monodyn.cli import main
from monodyn.errors import MechanismError, SettingsError, VideoError
from monodyn.mechanism import load
from monodyn.paper.filter import Gains, filtered
from monodyn.reproduce.cases import (
    CASE_TORQUES,
    Case,
    Design,
    FitPlan,
    parameter_errors,
    plans,
    rms,
    run_case,
    started,
)
from monodyn.reproduce.claims import Evidence, claims, filtered_is_worse, overall
from monodyn.reproduce.clip import (
    ClipSettings,
    Pendulum,
    make_clip,
    simulated,
)
from monodyn.reproduce.experiment import (
    EXPERIMENT,
    EXPERIMENT_FILES,
    START,
    Experiment,
    ReproduceSettings,
    figures,
    opened,
    reproduce,
)
from monodyn.reproduce.page import PageContent, Table, page_text, picture_rows
from monodyn.reproduce.tables import case_row, csv_text, document, gain_row, main_cases, plain_rows
from monodyn.reproduce.vision import Seen, aligned
from monodyn.results.fill import States
from monodyn.results.folder import RunFolder
from monodyn.types import Frame, Poses

NOISE = np.radians(0.2)
DESIGN = Design(lengths=(20, 30, 40), starts=2)


@lru_cache
def seen() -> Seen:
    """Return what a method would have seen: the truth with noise, and turned by a whole turn."""
    settings = ClipSettings(frames=90)
    truth = simulated(settings)
    noise = NOISE * np.random.default_rng(2).standard_normal(truth.position.shape)
    position = truth.position + noise + [0.0, 2.0 * np.pi]
    count = len(truth.time)
    covariance = np.tile(NOISE**2 * np.eye(2), (count, 1, 1))
    names = ("joint1", "joint2")
    poses = Poses(names, np.arange(count), truth.time, position, covariance, np.ones(count, bool))
    scene: Any = SimpleNamespace(mechanism=mechanism(), camera=settings.camera)
    states = filtered(poses.time, poses.position, Gains(), poses.covariance)
    return Seen("fast", "done", scene, poses, 1.0, 0.5, states, noise)


@lru_cache
def mechanism():
    """Load the mechanism file that the methods are given."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "start.xml"
        path.write_text(START)
        return load(path)


def moved(case: str, error: float, states: str = "measured", frames: int = 40, noise: float = 0.0) -> Case:
    """Return a fit whose motion is off by ``error`` [rad] and by a share of the noise."""
    found = seen()
    assert found.poses is not None
    assert found.errors is not None
    true = found.poses.position - found.errors
    position = true + error + noise * found.errors
    motion = States(found.poses.time, position, 0.0 * position, 0.0 * position)
    fit: Any = SimpleNamespace(
        names=(*"abcdef", *("",) * 4),
        starts=(None,),
        mechanism=mechanism(),
        evaluations=7,
        ok=True,
        parameters=(),
        advice=(),
    )
    return Case(
        FitPlan("fast", case, states, frames),
        "made",
        fit,
        motion,
        rms((position - found.poses.position)[:frames]),
        rms((position - true)[:frames]),
        rms((position - true)[frames:]),
        rms((position - true)[frames:]),
    )


def verdicts(*cases: Case) -> dict[str, Any]:
    """Judge made fits of the default method."""
    found = claims({"fast": seen(), "paper": Seen("paper", "failed: x")}, cases, DESIGN)
    assert all(claim.verdicts["paper"].held is None for claim in found)
    return {claim.text.split()[0] + " " + claim.text.split()[1]: claim.verdicts["fast"] for claim in found}


def test_true_angles_are_turned_to_the_measured_ones() -> None:
    found = seen()
    truth = simulated(ClipSettings(frames=90)).position
    assert aligned(truth, found.poses.position) == pytest.approx(truth + np.array([0.0, 2.0 * np.pi]))


def test_every_fit_is_planned_once() -> None:
    found = plans(Design(), 140)
    assert len(found) == len(set(found)) == 2 * (3 + 4 + 4) + 1
    assert FitPlan("fast", "I", "measured", 60) in found
    assert FitPlan("fast", "I", "measured", 60) not in plans(Design(), 99)


def test_a_fit_is_measured_against_the_truth() -> None:
    rods = Pendulum()
    truth = simulated(ClipSettings(frames=90))
    case = run_case(FitPlan("fast", "I", "measured", 40), seen(), truth, DESIGN)
    assert case.fit is not None
    assert case.fit.ok
    # the noise of the poses stays in the residual; the fitted motion is well below it
    assert overall(case.residual) == pytest.approx(NOISE, rel=0.25)
    # 12 unknowns from 80 angles carry sqrt(12 / 80) of the noise into the motion; twice that at most
    assert overall(case.error) < 2.0 * np.sqrt(12 / 80) * NOISE
    assert overall(case.ahead) < 2.0 * NOISE
    assert case.parameters is not None
    assert abs(case.parameters["l1"]) < 0.01
    assert abs(case.parameters["l2"]) < 0.01
    values = case.fit.mechanism.values
    share = values["link2.mass"] / values["link1.mass"] / (0.19 * 0.026 * 0.005 / (0.24 * 0.030 * 0.006))
    assert case.parameters["m2/m1"] == pytest.approx(share - 1.0, abs=1e-9)
    assert set(parameter_errors(replace(case, plan=replace(case.plan, case="III")), rods)) == {
        "l1", "l2", "m2/m1"
    }  # fmt: skip


def test_a_fit_that_fails_has_a_status() -> None:
    case = run_case(FitPlan("paper", "I", "measured", 40), Seen("paper", "failed: lost"), None, DESIGN)
    assert case.status == "no poses: failed: lost"
    assert case.fit is None
    row = case_row(case, ("joint1", "joint2"))
    assert row["unknowns"] is None
    assert row["residual_joint1_deg"] is None


def test_other_starts_have_other_values_within_the_factors() -> None:
    first = mechanism().values
    for number in (1, 2):
        other = started(mechanism(), number, 0).values
        scale = other["link1.length"] / first["link1.length"]
        assert other["link2.width"] == pytest.approx(scale * first["link2.width"])
        factors = [
            other[name] / first[name] for name in ("link1.thickness", "joint1.damping", "link2.length")
        ]
        assert all(0.4 <= factor <= 2.5 for factor in factors)
        assert len({round(factor, 6) for factor in factors}) == 3
    assert started(mechanism(), 0, 0).values == first


def test_filtered_states_are_judged_by_the_prediction() -> None:
    def judged(*cases: Case) -> Any:
        return filtered_is_worse(Evidence(replace(seen(), method="paper"), cases, DESIGN))

    worse = judged(moved("I", 1e-3), moved("I", 2e-3, "filtered"))
    assert worse.held is True
    assert worse.numbers == "prediction error 0.115° from filtered states, 0.0573° from unfiltered"
    assert judged(moved("I", 2e-3), moved("I", 1e-3, "filtered")).held is False
    assert judged(moved("I", 1e-3)).held is None
    default = verdicts(moved("I", 1e-3), moved("I", 2e-3, "filtered"))["Filtered states"]
    assert default.held is None
    assert "does not filter" in default.numbers


def test_a_fit_that_does_not_follow_its_states_is_named_in_the_verdict() -> None:
    lost = moved("I", 2e-3, "filtered")
    assert lost.fit is not None
    bad: Any = SimpleNamespace(**{**vars(lost.fit), "ok": False})
    evidence = Evidence(replace(seen(), method="paper"), [moved("I", 1e-3), replace(lost, fit=bad)], DESIGN)
    verdict = filtered_is_worse(evidence)
    assert verdict.held is True
    assert verdict.numbers == (
        "prediction error 0.115° from filtered states, 0.0573° from unfiltered; "
        "the fit to filtered states does not follow them"
    )


def test_a_verdict_that_is_missing_says_what_is_missing() -> None:
    untold = {"fast": replace(seen(), errors=None), "paper": Seen("paper", "failed: x")}
    found = claims(untold, [moved("I", 1e-3), moved("III", 1e-3)], DESIGN)
    told = {claim.text.split()[1]: claim.verdicts["fast"].numbers for claim in found}
    assert told["fit"] == "the truth of this clip is not known"
    assert told["III"] == "the truth of this clip is not known"
    assert told["II"] == "a fit that it needs is missing"
    assert all(claim.verdicts["paper"].numbers == "a fit that it needs is missing" for claim in found)


def test_a_period_of_the_whole_clip_is_marked_wherever_the_case_stands() -> None:
    found = seen()
    # 20 frames are not much more than half a period of this motion
    case = run_case(FitPlan("fast", "II", "measured", 20), found, None, DESIGN)
    assert case.fit is not None
    assert case.clip_period
    joints = ("joint1", "joint2")
    assert case_row(case, joints)["period_from"] == "whole clip"
    marked = replace(moved("II", 5e-3), clip_period=True)
    assert "the period is from the whole clip" in verdicts(moved("I", 1e-3), marked)["Case II"].numbers
    assert "whole clip" not in verdicts(moved("I", 1e-3), moved("II", 5e-3))["Case II"].numbers
    assert plain_rows([marked], joints)[1][0][0] == "II*"
    both = {"fast": found, "paper": Seen("paper", "failed: x")}
    assert "period from<br>the whole clip" in page_text(PageContent("", both, [marked], [], [], [], joints))


@pytest.mark.parametrize(
    ("errors", "held"), [((4e-3, 2e-3, 1e-3), True), ((1e-3, 2e-3, 4e-3), False), ((1e-3, 1e-3, 1e-3), False)]
)
def test_the_number_of_frames_is_judged_on_the_same_late_frames(errors: tuple, held: bool) -> None:
    cases = [moved("I", error, frames=n) for n, error in zip(DESIGN.lengths, errors, strict=True)]
    assert verdicts(*cases)["Accuracy grows"].held is held


def test_cases_two_and_three_are_judged() -> None:
    good = verdicts(moved("I", 1e-3), moved("II", 5e-3), moved("III", 0.0, noise=1.0))
    assert good["Case II"].held is True
    assert good["Case III"].held is True
    assert "correlation 1.00" in good["Case III"].numbers
    bad = verdicts(moved("I", 5e-3), moved("II", 1e-3), moved("III", 0.0))
    assert bad["Case II"].held is False
    assert bad["Case III"].held is False


def test_unknowns_are_compared_with_the_printed_ones() -> None:
    found = verdicts(moved("I", 0.0), moved("II", 0.0), moved("III", 0.0))["There are"]
    assert found.held is None
    assert found.numbers.startswith("Case I 6, Case II 6, Case III 6: ")
    fits = [
        replace(c, plan=replace(c.plan, method="paper")) for c in map(partial(moved, error=0.0), CASE_TORQUES)
    ]
    claim = claims({"fast": seen(), "paper": replace(seen(), method="paper")}, fits, DESIGN)[-1]
    assert claim.verdicts["paper"].held is False
    assert claim.verdicts["paper"].numbers == "Case I 6, Case II 6, Case III 6 with k = 40"


def test_the_page_shows_tables_figures_and_pictures_without_a_network() -> None:
    truth = simulated(ClipSettings(frames=90))
    both = {"fast": seen(), "paper": Seen("paper", "failed: <lost>")}
    failed = Case(FitPlan("paper", "II", "measured", 40), "failed: no period")
    cases = [moved("I", 1e-3), moved("I", 2e-3, "filtered"), moved("II", 5e-3), failed, moved("III", 0.0)]
    cases += [moved("I", 1e-3, frames=n) for n in (20, 30)]
    joints = ("joint1", "joint2")
    shown = figures(both, cases, truth, DESIGN)
    frame = Frame(0, 0.0, np.full((480, 720), 90, np.uint8))
    content = PageContent(
        "About.", both, cases, claims(both, cases, DESIGN), shown, picture_rows([frame], both), joints
    )
    text = page_text(content)
    own = re.sub(r"<script>.*?</script>", "", text, flags=re.S)
    assert not re.search(r"(src|href)=.?(http|//)", own)
    assert "failed: &lt;lost&gt;" in own
    assert "failed: no period" in own
    assert re.findall(r"<h2>Figure (\d):", own) == ["3", "5", "6", "7", "8", "9"]
    alone = next(figure for figure in shown if figure.title.startswith("Figure 6"))
    assert "simulated, published method" not in [text for _, _, text in alone.legend]
    assert ("box", "fitted", "fitted frames") in alone.legend
    assert own.count("data:image/jpeg;base64,") == 2
    data = json.loads(re.search(r"const FIGURES = (.*?);\n", text)[1])
    assert [len(figure["panels"]) for figure in data] == [4, 3, 3, 3, 3, 2, 1]
    simulated_ = data[2]["panels"][0]["series"][-1]
    assert simulated_["y"][0] == pytest.approx(np.degrees(-0.3 + 1e-3), abs=1e-3)


def test_the_table_holds_every_fit() -> None:
    cases = [moved("III", 0.0), moved("I", 1e-3), moved("I", 2e-3, "filtered"), moved("II", 5e-3)]
    rows = list(csv.DictReader(csv_text(cases, ("joint1", "joint2")).splitlines()))
    assert [row["case"] for row in rows] == ["III", "I", "I", "II"]
    assert float(rows[1]["error_joint1_deg"]) == pytest.approx(np.degrees(1e-3), rel=1e-5)
    assert [case.plan.case for case in main_cases(cases)] == ["I", "I", "II", "III"]
    columns, plain = plain_rows(cases, ("joint1", "joint2"))
    assert len(columns) == len(plain[0])
    assert plain[0][:4] == ["I", "measured", "default", "6"]
    made = document({"fast": seen(), "paper": Seen("paper", "failed: x")}, cases, [], ("joint1", "joint2"))
    assert made["poses"][1]["error_joint1_deg"] == pytest.approx(np.degrees(NOISE), rel=0.2)
    assert made["poses"][0]["status"] == "failed: x"


def test_the_table_says_by_how_much_the_default_method_is_better() -> None:
    joints = ("joint1", "joint2")
    default = replace(moved("I", 1e-3), seconds=0.5)
    published = replace(moved("I", 4e-3), plan=replace(default.plan, method="paper"), seconds=0.25)
    cases = [default, published, moved("II", 0.0)]
    gain = gain_row(case_row(published, joints), case_row(default, joints))
    assert gain["error_joint1_deg"] == pytest.approx(4.0, rel=1e-5)
    assert gain["ahead_joint2_deg"] == pytest.approx(4.0, rel=1e-5)
    assert gain["seconds"] == pytest.approx(0.5)
    assert plain_rows(cases, joints)[1][2][2:6] == ["published / default", "–", "1", "0.5"]
    both = {"fast": seen(), "paper": replace(seen(), method="paper", seconds_locate=3.0)}
    text = page_text(PageContent("", both, cases, [], [], [], joints))
    row = re.search(r"<td class=\"text\">ratio</td>(.*?)</tr>", text, flags=re.S)[1]
    assert re.findall(r"[\d.]+×", row)[:2] == ["1×", "0.5×"]
    assert row.count("<td>4× · 4×</td>") == 2
    assert text.count('<td class="text">ratio</td>') == 2
    assert ">3×<" in text
    assert "not counted" in text
    made = document(both, cases, [], joints)["published_over_default"]
    assert made["poses"]["seconds_locate"] == 3.0
    assert [row["case"] for row in made["fits"]] == ["I"]


def test_columns_without_a_number_are_left_out() -> None:
    table = Table.of(["method", "truth", "l1"], [("", ["a", "–", "1"]), ("last", ["b", "–", "–"])])
    assert table.head == ["method", "l1"]
    assert table.rows == [("", ["a", "1"]), ("last", ["b", "–"])]
    untold = {"fast": replace(seen(), errors=None), "paper": Seen("paper", "failed: x")}
    cases = [replace(moved(name, 1e-3), error=None) for name in ("I", "II")]
    text = page_text(PageContent("", untold, cases, [], [], [], ("joint1", "joint2")))
    assert "truth [°]" not in text
    assert "l1 [%]" not in text
    columns, rows = plain_rows(cases, ("joint1", "joint2"))
    assert "against truth [deg]" not in columns
    assert len(rows[0]) == len(columns)


def stopped(folder: RunFolder) -> None:
    """Write one file and be stopped."""
    folder.write_text("table.csv", "half")
    raise KeyboardInterrupt


def test_a_folder_is_filled_whole_or_not_at_all(tmp_path: Path) -> None:
    out, folder = tmp_path / "new" / "out", partial(RunFolder, content=EXPERIMENT)
    with pytest.raises(RuntimeError), folder(out).filling():
        raise RuntimeError
    assert not (tmp_path / "new").exists()
    first = folder(out)
    with pytest.raises(KeyboardInterrupt), first.filling():
        stopped(first)
    assert not (tmp_path / "new").exists()
    first = folder(out)
    with first.filling():
        first.write_text("table.csv", "first")
        first.write_text("truth.json", "{}")
        assert not (out / "table.csv").exists()
    assert sorted(path.name for path in out.iterdir()) == ["table.csv", "truth.json"]
    (out / "mine.txt").write_text("kept")
    (out / "poses.csv").write_text("a run of another kind")
    with pytest.raises(SettingsError) as refused:
        folder(out)
    assert str(refused.value) == (
        f"out '{out}': expected a folder without an experiment, it holds truth.json; "
        "give another folder, or --force to replace the experiment."
    )
    again = folder(out, force=True)
    with pytest.raises(ZeroDivisionError), again.filling():
        again.write_text("table.csv", f"second {1 / 0}")
    assert (out / "table.csv").read_text() == "first"
    again = folder(out, force=True)
    with again.filling():
        again.write_text("table.csv", "second")
    assert sorted(path.name for path in out.iterdir()) == ["mine.txt", "poses.csv", "table.csv"]
    assert (out / "table.csv").read_text() == "second"
    with pytest.raises(SettingsError, match="which the experiment would replace"):
        folder(out, force=True, inputs=(out / "table.csv",))
    with pytest.raises(SettingsError, match="expected a folder, got a file"):
        folder(out / "mine.txt")


def test_input_that_cannot_be_used_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"got --clip alone; add --model\."):
        reproduce(tmp_path / "out", clip="a.mp4")
    with pytest.raises(SettingsError, match=r"got --model alone; add --clip\."):
        reproduce(tmp_path / "out", model="double")
    make_clip(tmp_path / "short.mp4", ClipSettings(frames=20))
    with pytest.raises(VideoError, match="expected more than 40 frames, got 20"):
        opened(tmp_path / "short.mp4", "double", Design())
    with pytest.raises(MechanismError, match="expected hinges alone, got the slide"):
        opened(tmp_path / "short.mp4", "cartpole", Design())
    with pytest.raises(VideoError):
        reproduce(tmp_path / "out", clip=tmp_path / "none.mp4", model="double")
    assert not (tmp_path / "out").exists()


def test_the_command_says_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "--out", str(tmp_path), "--seed", "-1"]) == 2
    assert capsys.readouterr().err == "monodyn: seed: expected 0 or more, got -1; give a whole number.\n"
    assert main(["reproduce", "--out", str(tmp_path), "--clip", "a.mp4"]) == 2
    assert "got --clip alone; add --model." in capsys.readouterr().err


@pytest.mark.slow
def test_the_experiment_runs_from_the_clip_to_the_page(tmp_path: Path) -> None:
    design = Design(ahead=20, lengths=(20, 30, 40), starts=2)
    settings = ReproduceSettings(ClipSettings(frames=90), design)
    steps: list[str] = []
    made = reproduce(tmp_path, settings, progress=lambda step, done, total: steps.append(step))
    assert {path.name for path in tmp_path.iterdir()} == set(EXPERIMENT_FILES)
    assert dict.fromkeys(steps) == dict.fromkeys(["clip", "background", "locate", "track", "fits"])
    assert len(made.cases) == len(plans(design, 90))
    for case in made.cases:
        # 1 deg for the published poses, and for what both methods predict in Case I from 40 frames of them
        if case.plan.states == "measured" and case.plan.frames == 40:
            assert overall(case.residual) < np.radians(1.0), case
            assert case.plan.case != "I" or overall(case.ahead) < np.radians(1.0), case
    default, published = (made.seen[method].errors for method in ("fast", "paper"))
    assert overall(rms(default)) < 0.2 * overall(rms(published)) < np.radians(0.2)
    truth = json.loads((tmp_path / "truth.json").read_text())
    assert np.array(truth["q"]).shape == (90, 2)
    counts = {c.plan.case: c.unknowns for c in main_cases(made.cases) if c.plan.method == "paper"}
    assert counts == {"I": 6, "II": 36, "III": 84}


def test_the_command_prints_cases_and_verdicts(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    both = {"fast": seen(), "paper": Seen("paper", "failed: lost")}
    cases = [moved("I", 1e-3), moved("II", 5e-3)]
    made = Experiment(tmp_path, both, cases, claims(both, cases, DESIGN), ("joint1", "joint2"), 2.4)
    monkeypatch.setattr("monodyn.reproduce.experiment.reproduce", lambda *args, **settings: made)
    assert main(["reproduce", "--out", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[:5] == ["I", "measured", "default", "6", "7"]
    assert lines[1].endswith("0.0573 · 0.0573")
    assert lines[-1] == f"2 s. page: {tmp_path / 'reproduce.html'}"
    said = "Case II tracks the estimated poses but deviates. published no verdict, default held."
    assert said in lines
    assert main(["reproduce", "--out", str(tmp_path), "--quiet"]) == 0
    assert capsys.readouterr().out == ""
