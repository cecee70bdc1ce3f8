"""Where along the first body its hinge lies, which one picture does not show.

A body that reaches beyond its hinges by unknown lengths looks the same wherever its first hinge is: moved
along the body, with the camera, it leaves the picture as it was. In other frames the body has turned about
the true hinge. So the place of the least mismatch there is searched, with the pose alone found anew. The line
of the body comes from camera, pose and sizes together: by equal areas and centroids it would lie beside the
body where the silhouette lacks a part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism.tree import HINGE
from monodyn.optimize.bracket import golden_section
from monodyn.paper.silhouettes import SilhouetteFrame
from monodyn.paper.start_model import StartModel
from monodyn.paper.starts import pose_by_beam
from monodyn.paper.subproblems import mismatch
from monodyn.paper.together import fit_together
from monodyn.paper.view import ModelView
from monodyn.vision.drawing.camera import DEPTH, FOCAL, X, Y
from monodyn.vision.drawing.silhouette import LINK_ANGLE, LINK_X, LINK_Y, link_frames

OUTSIDE, INSIDE = 0.5, 0.9
"""How far the hinge is sought, as shares of the first length: beyond the body's near end, and from the hinge
to the far one."""
PLACES = 11
"""Places that are tried, evenly spaced."""
FRAMES = 4
"""Frames by which a place is judged, at most."""
HOPELESS = 0.5
"""Share of mismatch from which neither the line of a body is worth to be found, in its own picture, nor the
best place on it exactly, in the mean of the others: the mechanism is another."""
NEAR_PX = 0.5
"""How exactly the best place is found [px]."""


@dataclass(frozen=True, eq=False)
class _Body:
    """The first body of a mechanism whose hinge may be moved along it.

    Attributes:
        length: Place of its length among the sizes, or None where it is the reference and stays.
        tail: Place of its tail among the sizes.
        value: Its length [m].
        direction: From the hinge along the body, in the plane, (2,).
        hinge: Place of the hinge in the plane [m], (2,).
    """

    length: int | None
    tail: int
    value: float
    direction: np.ndarray
    hinge: np.ndarray


def along_first_body(
    view: ModelView, model: StartModel, own: SilhouetteFrame, shown: list[SilhouetteFrame]
) -> tuple[ModelView, int]:
    """Move the first hinge along its body to where other frames are explained best.

    Args:
        view: The mechanism as it was found in one picture.
        model: The mechanism and the camera that the search started with.
        own: That picture.
        shown: Frames with a silhouette, that picture among them.

    Returns:
        The mechanism, and the number of silhouettes drawn; unchanged where nothing is open: no free tail, a
        first joint that slides, or a camera whose place is known.
    """
    drawn = 0
    if _first_body(view, model) is None:
        return view, drawn
    if mismatch(own.image, view.rig, view.position) < HOPELESS * own.image.area:
        view, history = fit_together(own.image, view)
        drawn = int(history.evaluations[-1])
    body = _first_body(view, model)
    assert body is not None, "what was open stays so"

    def gap(shift: float) -> float:
        nonlocal drawn
        moved = model.released(_shifted(view, body, shift))
        total = 0.0
        for judge in judges:
            _, left, drawings = pose_by_beam(judge.image, moved)
            total += left / judge.image.area
            drawn += drawings
        return total / len(judges)

    judges = shown[:: -(-len(shown) // FRAMES)]
    tail = float(view.sizes[body.tail])
    shifts = np.linspace(-tail - OUTSIDE * body.value, INSIDE * body.value, PLACES)
    gaps = [gap(float(shift)) for shift in shifts]
    best = int(np.argmin(gaps))
    if gaps[best] > HOPELESS:
        return view, drawn
    ends = float(shifts[max(best - 1, 0)]), float(shifts[min(best + 1, PLACES - 1)])
    near = NEAR_PX * float(view.base.camera[DEPTH] / view.base.camera[FOCAL])
    found = golden_section(gap, ends, near, inside=(float(shifts[best]), gaps[best]))
    # the place that one picture gave stays where no other explains the frames better
    return (_shifted(view, body, found.x) if found.value < gap(0.0) else view), drawn


def _first_body(view: ModelView, model: StartModel) -> _Body | None:
    """Return the first body where its hinge may be moved along it."""
    first = model.mechanism.joints[0].body
    names = list(view.names)
    open_place = view.free.x and view.free.y and view.base.kind[0] == HINGE
    if not open_place or f"{first}.tail" not in names:
        return None
    name = f"{first}.length"
    if name not in names and (view.reference is None or view.reference.name != name):
        return None
    place = names.index(f"{first}.tail")
    # the points that a longer tail moves show the direction of the body
    slope = view.slopes[1][place][:, :2]
    back = slope[int(np.argmax(np.linalg.norm(slope, axis=1)))]
    frame = link_frames(view.rig, view.position)[0]
    c, s = np.cos(frame[LINK_ANGLE]), np.sin(frame[LINK_ANGLE])
    direction = np.array([[c, -s], [s, c]]) @ (-back / np.linalg.norm(back))
    length = names.index(name) if name in names else None
    value = model.mechanism.values[name] if length is None else float(view.sizes[length])
    return _Body(length, place, float(value), direction, frame[[LINK_X, LINK_Y]])


def _shifted(view: ModelView, body: _Body, shift: float) -> ModelView:
    """Return nearly the same picture with the hinge moved along the body [m], away from its near end."""
    sizes, camera = view.sizes.copy(), view.base.camera.copy()
    left = body.value - shift
    sizes[body.tail] = max(sizes[body.tail] + shift, 0.0)
    # the hinge stays where it is in the plane: body and camera move the other way
    camera[[X, Y]] -= shift * body.direction
    if body.length is None:
        # the first length is the unit and stays, so that everything else becomes larger, seen from the hinge
        factor = body.value / left
        sizes *= factor
        camera[[X, Y]] = body.hinge + factor * (camera[[X, Y]] - body.hinge)
        camera[DEPTH] *= factor
    else:
        sizes[body.length] = left
    return replace(view, sizes=np.clip(sizes, view.lower, view.upper)).before(camera)
