"""The experiment as a whole: its folder, its command, and one run from the clip to the page."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from experiments import DESIGN, evidence, lost, moved, repetition
from monodyn.cli import main
from monodyn.errors import SettingsError, VideoError
from monodyn.reproduce.cases import rms
from monodyn.reproduce.claims import claims
from monodyn.reproduce.clip import ClipSettings
from monodyn.reproduce.evidence import Evidence
from monodyn.reproduce.experiment import (
    EXPERIMENT,
    EXPERIMENT_FILES,
    Experiment,
    ReproduceSettings,
    figures,
    reproduce,
)
from monodyn.reproduce.given import GivenClip, given_truth
from monodyn.reproduce.plans import Design, plans
from monodyn.reproduce.repetition import Trying
from monodyn.results.folder import RunFolder
from monodyn.results.run_toml import RUN_TOML
from monodyn.types import Camera
from support import command, refuses

CASE_FIGURES = ("Figure 6", "Figure 7", "Figure 8", "Figure 9")


def stopped(folder: RunFolder) -> None:
    """Write one file and be stopped."""
    folder.write_text("table.csv", "half")
    raise KeyboardInterrupt


def test_a_folder_is_filled_whole_or_not_at_all(tmp_path: Path) -> None:
    out, folder = tmp_path / "new" / "out", partial(RunFolder, kind=EXPERIMENT)
    with pytest.raises(SettingsError), folder(out).filling():
        raise SettingsError
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
    with pytest.raises(KeyboardInterrupt), again.filling():
        stopped(again)
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


def test_settings_out_of_range_are_refused() -> None:
    with refuses(SettingsError, "seeds: expected 1 to 20, got 0; give another number."):
        ReproduceSettings(seeds=0)
    with refuses(SettingsError, "seeds: expected 1 to 20, got 21; give another number."):
        ReproduceSettings(seeds=21)


def test_nothing_is_left_behind_by_input_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(VideoError):
        reproduce(tmp_path / "out", given=GivenClip(tmp_path / "none.mp4", "double"))
    assert not (tmp_path / "out").exists()


def test_the_command_says_what_is_wrong(tmp_path: Path) -> None:
    done = command("reproduce", "--out", tmp_path, "--seed", -1)
    assert (done.code, done.err) == (
        2,
        "monodyn: seed: expected 0 to 4294967295, got -1; give a whole number in between.\n",
    )
    done = command("reproduce", "--out", tmp_path, "--clip", "a.mp4")
    assert (done.code, done.err) == (
        2, "monodyn: reproduce: expected --clip and --model together, got --clip alone; add --model.\n"
    )  # fmt: skip


def test_figures_say_what_each_case_is() -> None:
    shown = figures([repetition(moved("I", 1e-3))])
    assert {figure.title: figure.caption for figure in shown if figure.title[:8] in CASE_FIGURES} == {
        "Figure 6: Case I with filtered states": (
            "As Figure 7, but fitted to the filtered states, which are shown in place of the poses, in both "
            "readings of the filter. The default method does not filter."
        ),
        "Figure 7: Case I, friction": (
            "The form of the friction torque is known. The frames after the shaded ones are predicted."
        ),
        "Figure 8: Case II, Fourier series": (
            "The torque of each joint is a Fourier series, whose period is estimated from the poses of the "
            "fitted frames alone. Published form: the series alone; the default method's: with friction in "
            "addition to it."
        ),
        "Figure 9: Case III, free torque": (
            "One torque for each joint and time stamp. After the fitted frames none acts, because nothing "
            "determines it there. Published form: the torques alone; the default method's: with friction in "
            "addition to them."
        ),
    }


def test_figure_six_shows_the_states_that_were_fitted() -> None:
    cases = moved("I", 1e-3, method="paper"), moved("I", 1e-2, method="paper", compared="consistent")
    shown = figures([repetition(published=evidence(*cases, method="paper"))])
    six = next(figure for figure in shown if figure.title.startswith("Figure 6"))
    assert [panel["title"] for panel in six.panels][:2] == [
        "published, consistent: θ1",
        "published, consistent: θ2",
    ]
    assert len(six.panels[0]["series"][1]["x"]) == 40


def test_the_page_says_what_the_clips_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = {"paper": lost(), "fast": lost("fast")}

    def tried(trying: Trying, progress: object) -> Evidence:
        return nothing[trying.method]

    monkeypatch.setattr("monodyn.reproduce.experiment.tried", tried)
    monkeypatch.setattr("monodyn.reproduce.experiment.csv_text", lambda found: "")
    small = ClipSettings(camera=Camera(72, 48, 70.0, 0.03, -0.17, 1.15), frames=46)
    made = reproduce(tmp_path, ReproduceSettings(small, DESIGN, seeds=2))
    assert [each.name.split(":")[0] for each in made.repetitions] == [
        "pendulum 0, the usual one",
        "pendulum 1",
    ]
    assert (
        "2 clips of 46 frames of 72 × 48 px over 1.50 s: aluminium double pendulums of known truth, made by "
        "MuJoCo. Frames 0 to 39 are fitted, the next 40 predicted, by the published and by the default "
        "method. Figures show pendulum 0 where they do not name others; tables and verdicts all."
    ) in (tmp_path / "reproduce.html").read_text(encoding="utf-8")
    # the command has no options for such a clip
    assert {path.name for path in tmp_path.iterdir()} == set(EXPERIMENT_FILES) - {RUN_TOML}


def test_a_given_clip_is_tried_again_with_the_settings_file(
    make_clip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = make_clip(count=90)
    monkeypatch.setattr("monodyn.reproduce.experiment.tried", lambda trying, progress: lost(trying.method))
    monkeypatch.setattr("monodyn.reproduce.experiment.csv_text", lambda found: "")
    words = ["reproduce", "--clip", str(clip), "--model", "double", "--seed", "3", "--quiet"]
    assert main([*words, "--out", str(tmp_path / "a")]) == 0
    again = ["reproduce", "--config", str(tmp_path / "a" / RUN_TOML), "--quiet", "--out", str(tmp_path / "b")]
    assert main(again) == 0
    texts = [(tmp_path / name / RUN_TOML).read_text(encoding="utf-8") for name in "ab"]
    assert texts[0] == texts[1]
    assert "seed = 3" in texts[0]


@pytest.mark.slow
def test_the_experiment_runs_from_the_clips_to_the_page(tmp_path: Path) -> None:
    design = Design(ahead=20, lengths=(20, 30, 40), periods=(40,), starts=2)
    settings = ReproduceSettings(ClipSettings(frames=90), design, seeds=2, processes=2)
    made = reproduce(tmp_path, settings)
    assert {path.name for path in tmp_path.iterdir()} == set(EXPERIMENT_FILES) - {RUN_TOML}
    for own in made.repetitions:
        for method, found in own.evidence.items():
            one_way = replace(design, both_ways=False) if own is not made.repetitions[0] else design
            assert len(found.cases) == len(plans(one_way, 90, method))
            usual = found.case()
            assert usual is not None
            # 1 deg for the published poses, and for what both methods predict in Case I from 40 frames
            # of them
            for error in (found.overall(usual.residual), found.overall(usual.ahead)):
                assert error is not None
                assert error < np.radians(1.0)
        published, default = (own.evidence[method] for method in ("paper", "fast"))
        for found, most in ((default, 0.1), (published, 1.0)):
            assert found.seen.errors is not None
            error = found.overall(rms(found.seen.errors))
            assert error is not None
            assert error < np.radians(most)
        # in the published form, torques over time alone: seven terms a joint, and two a time stamp
        fits = [published.case(name) for name in ("I", "II", "III")]
        assert [None if case is None else case.unknowns for case in fits] == [6, 34, 84]
        assert published.pose_starts is not None
    truth = json.loads((tmp_path / "truth.json").read_text())
    assert np.array(truth["q"]).shape == (90, 2)
    # the truth that was written is read as that of a given clip
    given = GivenClip(tmp_path / "clip.mp4", tmp_path / "start.xml", tmp_path / "truth.json")
    again = given_truth(given)
    assert again is not None
    assert again.position == pytest.approx(np.array(truth["q"]))


def test_the_command_prints_cases_and_verdicts(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = repetition(moved("I", 1e-3), moved("III", 5e-3))
    made = Experiment(tmp_path, [found], claims([found.evidence]), 2.4)
    monkeypatch.setattr("monodyn.reproduce.experiment.reproduce", lambda *args, **settings: made)
    assert main(["reproduce", "--out", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "pendulum 0, the usual one"
    assert lines[2].split()[:4] == ["I", "default", "6", "7"]
    assert lines[2].endswith("0.0573 · 0.0573")
    assert lines[-1] == f"2 s. page: {tmp_path / 'reproduce.html'}"
    close = next(line for line in lines if line.startswith("The estimated pose is very close"))
    assert close.split("  ")[-2:] == ["no verdict", "held in 1 of 1"] or close.endswith("held in 1 of 1")
    assert main(["reproduce", "--out", str(tmp_path), "--quiet"]) == 0
    assert capsys.readouterr().out == ""
