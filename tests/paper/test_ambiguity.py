"""The budget of a search, and the choice between the interpretations of one picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from chains import CAMERA, POSE, chain, silhouette_of, view_of
from monodyn.paper import ambiguity
from monodyn.paper.ambiguity import MOST_PICTURES, DrawingBudget, cross_mismatch, interpret
from monodyn.paper.settings import PaperLocateSettings
from monodyn.paper.silhouettes import SilhouetteFrame
from monodyn.paper.start_model import StartModel
from monodyn.paper.subproblems import History, mismatch
from monodyn.paper.view import CAMERA_HELD, ModelView
from monodyn.types import Frame

TURNS = ((0.6, 0.2), (-0.7, 0.9), (0.3, -1.2))
"""How far the chain has turned in other frames [rad]."""


def shown(pose: np.ndarray) -> SilhouetteFrame:
    """Return a frame that shows the chain in a pose."""
    blank = np.zeros((4, 4), np.uint8)
    return SilhouetteFrame(Frame(0, 0.0, blank), silhouette_of(pose), blank)


def test_a_budget_counts_drawings_and_reports_steps() -> None:
    told: list[tuple[str, int, int | None]] = []
    budget = DrawingBudget(100, lambda *words: told.append(words))
    budget.expect(3)
    budget.step(60)
    assert not budget.over()
    assert not budget.cut
    assert budget.over(50)
    assert budget.cut
    budget.step(60)
    assert budget.over()
    # the third step was left out: the next part begins where the first one would have ended
    budget.expect(2)
    assert told == [("locate", done, total) for done, total in ((0, 3), (1, 3), (2, 3), (3, 5))]


def test_other_frames_decide_which_end_of_a_chain_is_the_hinge(tmp_path: Path) -> None:
    """Read from its other end the chain fits its own picture, but there its first hinge moves."""
    view = view_of(chain(tmp_path), free=CAMERA_HELD)
    others = [shown(POSE + turn) for turn in TURNS]
    share, drawings = cross_mismatch(view, others)
    # the true chain leaves the pixels that its outline cuts, and in no pose less than the best one found
    cut = np.mean(
        [
            mismatch(own.image, view.rig, POSE + turn) / own.image.area
            for own, turn in zip(others, TURNS, strict=True)
        ]
    )
    assert share < cut + 0.01
    assert drawings > 100
    moved = view.base.camera.copy()
    moved[9] += 0.1  # the hinge is taken to be elsewhere
    assert cross_mismatch(view.before(moved), others)[0] > 0.2


def test_the_worst_quarter_of_the_frames_does_not_count(tmp_path: Path) -> None:
    view = view_of(chain(tmp_path), free=CAMERA_HELD)
    hidden = shown(POSE)
    hidden = SilhouetteFrame(hidden.frame, silhouette_of(POSE, widths=(0.2, 0.2)), hidden.silhouette)
    good = [shown(POSE)] * 3
    assert cross_mismatch(view, [*good, hidden])[0] == pytest.approx(cross_mismatch(view, good)[0])


@pytest.mark.parametrize("spread_leads_there", [True, False])
def test_an_evolution_begins_where_spread_poses_lead_nowhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, spread_leads_there: bool
) -> None:
    """With the true scene from the first picture nothing else is tried; with a wrong one from all of them."""
    mechanism = chain(tmp_path)
    model = StartModel(mechanism, CAMERA, ("camera.x", "camera.y", "camera.depth"))
    right = view_of(mechanism, free=CAMERA_HELD)
    camera = right.base.camera.copy()
    camera[9] += 0.1  # the hinge is taken to be elsewhere
    wrong, begun = right.before(camera), []

    def given(
        _own: SilhouetteFrame, _start: ModelView, settings: PaperLocateSettings, *_rest: object
    ) -> list[tuple[ModelView, tuple[History, ...]]]:
        begun.append(settings.start)
        found = right if spread_leads_there or settings.start == "evolution" else wrong
        return [(found, ())]

    monkeypatch.setattr(ambiguity, "_interpretations", given)
    frames = [shown(POSE + turn) for turn in ((0.0, 0.0), (0.6, 0.2), (-0.7, 0.9), (0.3, -1.2))]
    best = interpret(frames, model, PaperLocateSettings(method="paper"), DrawingBudget(1_000_000), shrink=1)
    assert best.view is right
    assert begun == (["spread"] if spread_leads_there else [*["spread"] * MOST_PICTURES, "evolution"])
