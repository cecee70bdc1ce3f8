"""Which assumptions of the paper hold for a clip: those about its film, and those that the dynamics show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from monodyn.paper.assumptions import Assumption
from monodyn.reproduce.case_claims import TRACKING
from monodyn.reproduce.evidence import Evidence, degrees
from monodyn.reproduce.plans import Design
from monodyn.reproduce.series_claims import SEVERAL
from monodyn.reproduce.vision import TITLES

POSES_OWN = 5.0
"""A published residual above so many times the default method's is not noise."""


def assumptions(evidence: Mapping[str, Evidence], *, given: bool) -> list[Assumption]:
    """Return whether the assumptions of the paper hold for a clip.

    Args:
        evidence: What each method found, by method.
        given: True where the clip is the user's, whose time stamps may not be those of the motion.
    """
    published = evidence["paper"]
    found = [_poses_found(published), *published.seen.film, _two_links(published), _as_many_frames(published)]
    found += [_known_dynamics(evidence), _several_periods(published)]
    if given:
        found.append(_time_stamps(published))
    return found


def _poses_found(published: Evidence) -> Assumption:
    """Return whether the published method has a pose in every frame."""
    seen, name = published.seen, "The silhouette shows the pose in every frame."
    if seen.poses is None:
        return Assumption(name, False, f"There are no poses: {seen.status}")
    count = int(seen.poses.seen.sum())
    return Assumption(name, count == len(seen.poses), f"{count} of {len(seen.poses)} frames have a pose.")


def _two_links(published: Evidence) -> Assumption:
    """Return whether the mechanism is the paper's."""
    joints = published.seen.joints
    hinges = len(published.seen.hinges)
    counts = [(hinges, "hinge"), (len(joints) - hinges, "slide")]
    told = "It has " + " and ".join(f"{n} {kind}{'s' * (n != 1)}" for n, kind in counts if n) + "."
    return Assumption("The mechanism is a double pendulum.", hinges == len(joints) == 2, told)


def _as_many_frames(published: Evidence) -> Assumption:
    """Return whether as many frames are fitted and predicted as in the paper."""
    design, usual = published.design, Design()
    return Assumption(
        f"{usual.frames} frames are fitted and as many predicted.",
        design.frames >= usual.frames and design.ahead >= usual.ahead,
        f"{design.frames} are fitted, {design.ahead} predicted.",
    )


def _known_dynamics(evidence: Mapping[str, Evidence]) -> Assumption:
    """Return whether Case I explains the motion."""
    name = "Uniform bars move under gravity and viscous friction alone (Case I)."
    told, held, advice, published, remark = [], None, "", None, ""
    for method, found in evidence.items():
        case = found.case()
        residual = None if case is None else found.overall(case.residual)
        if case is None or case.fit is None or residual is None:
            continue
        ahead = found.overall(case.ahead)
        predicted = "" if ahead is None else f", {degrees(ahead)} in the prediction"
        told.append(f"{degrees(residual)}{predicted} ({TITLES[method]})")
        # the paper's own method decides; the residual of the other is shown beside it
        if method == "paper":
            held, published = bool(residual < TRACKING and case.ok), residual
        elif published is not None and case.ok and published > POSES_OWN * residual:
            # the same motion is explained so much better that what is left is no noise
            remark = " The default method leaves so much less that the published residual is not noise: its "
            remark += "poses, sizes or masses are off."
        if not residual < TRACKING and case.fit.advice and not advice:
            advice = f" {case.fit.advice[0]}"
    if not told:
        return Assumption(name, None, "There is no fit of Case I to measured angles.")
    missing = " The published method has no fit, which would decide." if held is None else ""
    others = sorted(set(_shapes(evidence["paper"])) - {"box"})
    shapes = "" if not others else f" Not every body is a bar: the mechanism has {_listed(others)}."
    # whatever the residual, a ball is no bar
    held = False if others else held
    residuals = f"Case I leaves a residual of {'; '.join(told)}."
    return Assumption(name, held, f"{residuals}{remark}{shapes}{missing}{advice}")


def _shapes(found: Evidence) -> list[str]:
    """Return the kinds of the geoms that are seen."""
    scene = found.seen.scene
    solids = () if scene is None else scene.mechanism.plan.drawn
    return [solid.look.kind for solid in solids if solid.look is not None]


def _listed(kinds: Sequence[str]) -> str:
    """Write kinds of geoms with their articles."""
    words = dict.fromkeys(kinds, "another shape") | {k: f"a {k}" for k in ("sphere", "capsule", "cylinder")}
    return " and ".join(dict.fromkeys(words[kind] for kind in kinds))


def _several_periods(published: Evidence) -> Assumption:
    """Return whether the fitted frames hold several periods of the motion, as Case II requires."""
    name = "The motion is periodic, and the fitted frames hold multiple periods (Case II)."
    case = published.case("II")
    if case is None or case.period is None or case.periods is None:
        made = next((c.status for c in published.cases if c.plan.case == "II"), "There is no fit of Case II.")
        return Assumption(name, None, made)
    told = f"{case.plan.frames} frames hold {case.periods:.2g} of the poses' periods of {case.period:.3g} s."
    return Assumption(name, case.periods >= SEVERAL, told)


def _time_stamps(published: Evidence) -> Assumption:
    """Return that nothing shows whether the stamps of a given clip are those of the motion."""
    return Assumption(
        "The time stamps are those of the motion.",
        None,
        f"They are taken as they are, {1e3 * published.interval:.3g} ms apart. In a recording k times "
        "slower than life lengths come out k² times too long.",
    )
