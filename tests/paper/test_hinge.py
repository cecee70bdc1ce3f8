"""The place of the first hinge along its body, from frames in which the body has turned."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import monodyn
from chains import CAMERA, chain
from monodyn.mechanism import Mechanism
from monodyn.paper.hinge import along_first_body
from monodyn.paper.sequential import strict
from monodyn.paper.silhouettes import SilhouetteFrame
from monodyn.paper.start_model import StartModel
from monodyn.paper.subproblems import camera_placed, mismatch
from monodyn.paper.together import fit_together
from monodyn.paper.view import CAMERA_HELD, ModelView, model_view, silhouette_image
from monodyn.types import FULL, Camera, Frame
from monodyn.vision.drawing.camera import DEPTH, X, Y
from monodyn.vision.drawing.outline import covered_pixels
from support import slow

POSES = np.array([[-0.8, 0.7], [-2.2, -0.4], [0.1, 0.9], [-1.5, 1.6], [-2.8, -1.0]])


def shown(mechanism: Mechanism, camera: Camera) -> list[SilhouetteFrame]:
    """Draw the mechanism in a few poses."""
    frames = []
    for k, q in enumerate(POSES):
        picture = covered_pixels(mechanism, camera, q, margin=0.0).astype(np.uint8) * np.uint8(FULL)
        frames.append(SilhouetteFrame(Frame(k, k / 30, picture), silhouette_image(picture), picture))
    return frames


def displaced(mechanism: Mechanism, shift: float, free: bool) -> ModelView:
    """Return the mechanism with its hinge moved along the first body, before a camera that shows the same."""
    values = {name: mechanism.values[f"link1.{name}"] for name in ("length", "tail")}
    length, tail = values["length"] - shift, values["tail"] + shift
    factor = values["length"] / length if free else 1.0
    sizes = {p.name: factor * p.value for p in mechanism.parameters if p.free and p.kind in SIZES}
    sizes |= {"link1.length": factor * length, "link1.tail": factor * tail}
    q = POSES[0]
    along = np.array([np.cos(q[0]), np.sin(q[0])])
    x, y = factor * (np.array([CAMERA.x, CAMERA.y]) - shift * along)
    camera = Camera(CAMERA.width, CAMERA.height, CAMERA.focal, x=x, y=y, depth=factor * CAMERA.depth)
    model = StartModel(mechanism, CAMERA, ())
    return model_view(mechanism.with_values(sizes), camera, q, model.camera_free(slide=False))


SIZES = ("length", "width", "tail", "tip")


@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.05, slow(-0.01)])
def test_the_hinge_is_moved_to_its_place(shift: float) -> None:
    """Its picture is the same before and after; the ratios of the sizes come out to a pixel."""
    mechanism = monodyn.load("double")
    frames = shown(mechanism, CAMERA)
    view = displaced(mechanism, shift, free=True)
    first = frames[0].image
    assert mismatch(first, view.rig, view.position) < 0.1 * first.area
    found, drawn = along_first_body(view, StartModel(mechanism, CAMERA, ()), frames[0], frames)
    assert drawn > 1000
    assert mismatch(first, found.rig, found.position) < 0.1 * first.area
    sizes = dict(zip(found.names, found.sizes, strict=True))
    px = CAMERA.focal / CAMERA.depth
    for name in ("link1.tail", "link2.length", "link1.width"):
        assert abs(sizes[name] - mechanism.values[name]) * px < 2.0


@pytest.mark.slow
def test_the_line_of_the_body_does_not_miss_what_the_silhouette_lacks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Equal areas and centroids have the camera beside it, and Fig. 2 ends there."""
    mechanism = monodyn.load("double")
    frames = shown(mechanism, CAMERA)
    true = displaced(mechanism, 0.0, free=True)
    hinge = np.array([(CAMERA.width - 1) / 2, (CAMERA.height - 1) / 2])
    hinge += np.array([-CAMERA.x, CAMERA.y]) * CAMERA.focal / CAMERA.depth
    y, x = np.mgrid[: CAMERA.height, : CAMERA.width]
    picture = np.where(np.hypot(x - hinge[0], y - hinge[1]) < 12.0, np.uint8(0), frames[0].silhouette)
    frames[0] = SilhouetteFrame(frames[0].frame, silhouette_image(picture), picture)
    image = frames[0].image
    beside, _ = strict(image, camera_placed(image, camera_placed(image, true)))
    model, own = StartModel(mechanism, CAMERA, ()), frames[0]
    found, drawn = along_first_body(beside, model, own, frames)
    together, history = fit_together(image, beside)
    many = replace(history, evaluations=10_000_000 + history.evaluations)
    monkeypatch.setattr("monodyn.paper.hinge.fit_together", lambda *_: (together, many))
    assert along_first_body(beside, model, own, frames)[1] == drawn + 10_000_000
    for view, least, most in ((beside, 1.5, 2.0), (found, 0.0, 0.3)):
        camera = view.base.camera
        off = -camera[X : Y + 1] / camera[DEPTH] - [-CAMERA.x / CAMERA.depth, -CAMERA.y / CAMERA.depth]
        across = np.array([-np.sin(POSES[0, 0]), np.cos(POSES[0, 0])])
        assert least < abs(off @ across) * CAMERA.focal < most


@pytest.mark.parametrize("pinned", [("camera.x",), ("camera.x", "camera.y", "camera.depth")])
def test_a_camera_that_is_known_leaves_nothing_open(pinned: tuple[str, ...]) -> None:
    mechanism = monodyn.load("double")
    model = StartModel(mechanism, CAMERA, pinned)
    view = model_view(mechanism, CAMERA, POSES[0], model.camera_free(slide=False))
    frames = shown(mechanism, CAMERA)
    found, drawn = along_first_body(view, model, frames[0], frames)
    assert found is view
    assert drawn == 0


def test_a_body_that_ends_at_its_hinge_stays(tmp_path: Path) -> None:
    mechanism = chain(tmp_path)
    view = model_view(mechanism, CAMERA, POSES[0], CAMERA_HELD)
    frames = shown(mechanism, CAMERA)
    assert along_first_body(view, StartModel(mechanism, CAMERA, ()), frames[0], frames) == (view, 0)
