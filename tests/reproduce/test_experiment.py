"""The experiment as a whole: its folder, its command, and one run from the clip to the page."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from experiments import DESIGN, FAILED, JOINTS, moved, seen
from monodyn.cli import main
from monodyn.errors import MechanismError, SettingsError, VideoError
from monodyn.reproduce.cases import Case, Design, FitPlan, plans, rms
from monodyn.reproduce.claims import claims, overall
from monodyn.reproduce.clip import ClipSettings, make_clip
from monodyn.reproduce.experiment import (
    EXPERIMENT,
    EXPERIMENT_FILES,
    Experiment,
    ReproduceSettings,
    figures,
    opened,
    reproduce,
)
from monodyn.reproduce.tables import main_cases
from monodyn.reproduce.vision import Seen
from monodyn.results.folder import RunFolder
from monodyn.types import Camera
from support import command, refuses

CASE_FIGURES = ("Figure 6", "Figure 7", "Figure 8", "Figure 9")


def stopped(folder: RunFolder) -> None:
    """Write one file and be stopped."""
    folder.write_text("table.csv", "half")
    raise KeyboardInterrupt


def test_a_folder_is_filled_whole_or_not_at_all(tmp_path: Path) -> None:
    out, folder = tmp_path / "new" / "out", partial(RunFolder, kind=EXPERIMENT)
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
    with refuses(
        SettingsError, "reproduce: expected --clip and --model together, got --clip alone; add --model."
    ):
        reproduce(tmp_path / "out", clip="a.mp4")
    with refuses(
        SettingsError, "reproduce: expected --clip and --model together, got --model alone; add --clip."
    ):
        reproduce(tmp_path / "out", model="double")
    clip = tmp_path / "short.mp4"
    make_clip(clip, ClipSettings(camera=Camera(72, 48, 70.0, 0.03, -0.17, 1.15), frames=20))
    with refuses(VideoError, f"clip '{clip}': expected more than 40 frames, got 20; give a longer clip."):
        opened(clip, "double", Design())
    with refuses(
        MechanismError,
        "mechanism 'cartpole': expected hinges alone, got the slide 'slide'; use monodyn run --method paper.",
    ):
        opened(clip, "cartpole", Design())
    with pytest.raises(VideoError):
        reproduce(tmp_path / "out", clip=tmp_path / "none.mp4", model="double")
    assert not (tmp_path / "out").exists()


def test_the_command_says_what_is_wrong(tmp_path: Path) -> None:
    done = command("reproduce", "--out", tmp_path, "--seed", -1)
    assert (done.code, done.err) == (2, "monodyn: seed: expected 0 or more, got -1; give a whole number.\n")
    done = command("reproduce", "--out", tmp_path, "--clip", "a.mp4")
    assert (done.code, done.err) == (
        2, "monodyn: reproduce: expected --clip and --model together, got --clip alone; add --model.\n"
    )  # fmt: skip


def test_figures_say_what_each_case_is() -> None:
    shown = figures({"fast": seen(), "paper": FAILED}, [moved("I", 1e-3)], None, DESIGN)
    assert {figure.title: figure.caption for figure in shown if figure.title[:8] in CASE_FIGURES} == {
        "Figure 6: Case I with filtered states": (
            "As Figure 7, but fitted to the filtered states; the default method does not filter."
        ),
        "Figure 7: Case I, friction": (
            "The form of the friction torque is known. The frames after the shaded ones are predicted."
        ),
        "Figure 8: Case II, Fourier series": (
            "The torque of each joint is a Fourier series. Its period is estimated from the poses "
            "beforehand: from those of the whole clip where the fitted frames are too few."
        ),
        "Figure 9: Case III, free torque": (
            "One torque for each joint and time stamp. After the fitted frames none acts, because nothing "
            "determines it there."
        ),
    }


def test_the_page_says_what_the_clip_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lost = {method: Seen(method, "failed: lost") for method in ("fast", "paper")}
    failed = Case(FitPlan("fast", "I", "measured", 40), "failed: lost")
    monkeypatch.setattr("monodyn.reproduce.experiment._run", lambda *args: (lost, [failed]))
    small = ClipSettings(camera=Camera(72, 48, 70.0, 0.03, -0.17, 1.15), frames=46)
    reproduce(tmp_path, ReproduceSettings(small, DESIGN))
    assert (
        "46 frames of 72 × 48 px over 1.50 s: an aluminium double pendulum of known truth, made by MuJoCo. "
        "Frames 0 to 39 are fitted, the next 40 predicted, by the published and by the default method."
    ) in (tmp_path / "reproduce.html").read_text(encoding="utf-8")


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
    made = Experiment(tmp_path, both, cases, claims(both, cases, DESIGN), JOINTS, 2.4)
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
