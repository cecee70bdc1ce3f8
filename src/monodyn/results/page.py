"""A fit and its motion as one self-contained page: advice first, then angles, pictures and tables.

The page needs no network: the plotting script in ``plotly-basic``, the smallest build of plotly.js as it is
published, is written into it.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.mechanism.tree import BRAKES
from monodyn.numbers import number, short, shown_in
from monodyn.results.curves import camera_curves, motion_curves, torque_curves
from monodyn.results.findings import REFUSED, Findings, frames_of, listed_rows, openness
from monodyn.results.gaps import how_filled
from monodyn.results.horizon import Horizon, allowed, horizon_said, lasts
from monodyn.results.next_steps import Step, next_steps

if TYPE_CHECKING:
    from jinja2 import Template

    from monodyn.estimation.fit import Estimate, Fit
    from monodyn.mechanism import Joint
    from monodyn.results.filmed import Filmed
    from monodyn.results.log import RunLog


MEANINGS = {
    "length": "from its hinge to the next one, or to its end",
    "width": "across, in the picture",
    "thickness": "along the line of sight; stands for a mass",
    "tail": "how far it reaches back beyond its own hinge",
    "tip": "how far it reaches beyond the next hinge",
    "extent": "of a further part, along its own direction",
    "along": "middle of a further part, along the body",
    "across": "middle of a further part, across the body",
    "turn": "of a further part against the body",
    "offset": "how far it stands before its parent body",
    "density": "mass by volume",
    "mass": "of the body",
    "com_x": "centre of mass from its hinge, along the body",
    "com_y": "centre of mass from its hinge, across the body",
    "inertia": "about its centre of mass",
    "damping": "viscous friction: torque by rate",
    "friction": "dry friction: the same at all rates",
    "drag": "friction by the square of the rate",
    "air": "drag of the air on its link",
    "lead": "time by which dry friction turns ahead of the rate",
    "stiffness": "of a spring at the joint",
    "rest": "where that spring is slack",
    "armature": "inertia of a rotor at the joint",
    "period": "of the torque",
    "torque": "coefficient of the torque",
    "lag": "how much later than in their log torques act",
    "gravity": "downward",
    "time_scale": "true time by stamped time",
    "roll": "turn of the camera about its axis",
}
"""What parameters are, by their kind."""
OPEN = {
    "factor": "known up to the factor of all masses",
    "combined": "known in combinations alone",
    "open": "not determined by this motion",
    "held": "held: torques would make up for any other",
}
"""What is left open of parameters that are not known."""
REPORT = ("monodyn.results", "report.html.j2")
"""The template of the report: where it is, and its name."""


def page_text(
    findings: Findings,
    pictures: Sequence[tuple[bytes, str]] = (),
    diagnosis: bytes | None = None,
    files: Sequence[str] = (),
    steps: Sequence[Step] | None = None,
) -> str:
    """Return the report as HTML text.

    Args:
        findings: The fit, its records and what else is reported about it.
        pictures: JPEG files with a caption each.
        diagnosis: What was seen of the clip, a JPEG file; None leaves it out.
        files: Names of the files that stand next to the page.
        steps: What one can do next, from ``next_steps``; None works it out.
    """
    from markupsafe import Markup

    fit, traces = findings.fit, findings.traces
    several = len(traces) > 1
    # the motion of a refused fit stands for nothing that was hidden
    motions = findings.motions if fit.ok else [None] * len(traces)
    pairs = zip(traces, motions, strict=True)
    plots = [plot for pair in pairs for plot in motion_curves(fit, *pair, several=several)]
    filmed = findings.filmed
    camera = [] if filmed is None else camera_curves(filmed.video.times, filmed.camera_path)
    listed = listed_rows(fit)
    kinds = {parameter.name: parameter.kind for parameter in fit.mechanism.parameters}
    open_ways = openness(fit)
    # the rest goes into a part of the page that is folded up
    others = [row for row in fit.parameters if not row.free and row not in listed]
    return template(*REPORT).render(
        title=findings.title,
        subtitle=findings.subtitle,
        status=str(fit.status),
        grade=fit.grade,
        refused=REFUSED,
        advice=findings.advice,
        comparison=findings.comparison,
        tried_torques=findings.fit.tried_torques,
        facts=_facts(findings),
        plots=plots,
        torques=[plot for trace in traces for plot in torque_curves(fit, trace, several=several)],
        camera=camera,
        # free torques contain the friction that the mechanism has no parameters for
        any_filled=any(plot["filled"] and plot["filled"]["time"] for plot in plots),
        motion_band=any(np.isfinite(t.states.std).any() for t in traces),
        torque_band=any(t.torques is not None and np.isfinite(t.torques.std).any() for t in traces),
        with_friction=not any(row.value for row in fit.mechanism.parameters if row.kind in BRAKES),
        pictures=[
            {"data": base64.b64encode(data).decode("ascii"), "caption": caption} for data, caption in pictures
        ],
        diagnosis="" if diagnosis is None else base64.b64encode(diagnosis).decode("ascii"),
        known=[_parameter(row, kinds) for row in listed if row.identifiable],
        unknown=[_parameter(row, kinds, open_ways) for row in listed if not row.identifiable],
        others=[_parameter(row, kinds) for row in others],
        combinations=[
            {"name": c.name, "value": number(c.value, c.std), "std": short(c.std), "unit": c.unit}
            for c in fit.combinations
        ],
        horizons=[_trusted(findings, number, found) for number, found in enumerate(findings.horizons)],
        steps=next_steps(findings) if steps is None else steps,
        files=files,
        cards=_cards(findings),
        plotly=Markup(plotting_script() if plots or camera else ""),
    )


@cache
def template(package: str, name: str) -> Template:
    """Return a template of a page, which escapes what is put into it and raises at a name without value.

    It is read and compiled once.

    Args:
        package: Where the template is.
        name: Its file name.
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    # what all pages have in common stands next to this module
    folders = dict.fromkeys((package, "monodyn.results"))
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(folder, ".") for folder in folders]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    return environment.get_template(name)


def plotting_script() -> str:
    """Return plotly's script; a closing tag inside it would end the page's script element."""
    script = Path(__file__).parent / "plotly-basic" / "plotly-basic.min.js"
    return script.read_text(encoding="utf-8").replace("</script", "<\\/script")


def _trusted(findings: Findings, number: int, found: Horizon) -> str:
    """Say how long the prediction of a record holds."""
    said = horizon_said(findings.fit, found, findings.tolerance)
    return f"{findings.traces[number].name}: {said}" if len(findings.traces) > 1 else said


def _parameter(
    row: Estimate, kinds: Mapping[str, str], ways: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return one line of a parameter table; ``ways`` tells what is left open of those that are not known."""
    # the first that applies counts: at a bound the estimate is the bound, whatever else is known
    if row.at_bound:
        source = "at its bound"
    elif not row.identifiable:
        source = OPEN[(ways or {}).get(row.name, "held")]
    else:
        source = "estimated"
    return {
        "name": row.name,
        "value": number(row.value, row.std),
        "interval": f"{number(row.lower, row.std)} to {number(row.upper, row.std)}",
        "unit": row.unit,
        "free": row.free,
        "source": source,
        "flag": row.at_bound,
        "meaning": MEANINGS.get(kinds.get(row.name, ""), ""),
    }


def _facts(findings: Findings) -> list[dict[str, str]]:
    """Return the few numbers under the heading."""
    fit, traces = findings.fit, findings.traces
    facts = []
    if traces:
        seen = sum(int(np.sum(trace.poses.seen)) for trace in traces)
        total = sum(len(trace.poses) for trace in traces)
        what = "samples measured" if findings.filmed is None else "frames tracked"
        facts.append({"value": f"{seen} of {total}", "label": what})
        known = how_filled(traces, findings.motions)
        if known.frames and fit.ok:
            band = dict(zip(traces[0].poses.joints, known.band.tolist(), strict=True))
            joints = [joint for joint in fit.mechanism.joints if math.isfinite(band[joint.name])]
            facts.append(
                {"value": f"{known.frames}", "label": f"frames filled, within {_errors(joints, band)} (95 %)"}
            )
    if len(traces) == 1:
        first, stop = frames_of(traces[0])
        facts.append({"value": f"{first} to {stop - 1}", "label": "frames used for the fit"})
        joints = fit.mechanism.joints
        facts.append({"value": _errors(joints, fit.rms), "label": "fit error, rms by joint"})
        heldout = traces[0].heldout()
        if any(value is not None for value in heldout.values()):
            facts.append({"value": _errors(joints, heldout), "label": "prediction error, rms by joint"})
        if findings.horizons:
            within = allowed(fit.mechanism, findings.tolerance)
            facts.append({"value": lasts(findings.horizons[0]), "label": f"prediction within {within}"})
    if findings.log is not None:
        facts.append({"value": f"{sum(findings.log.seconds.values()):.1f} s", "label": "computing time"})
    return facts


def _errors(joints: Sequence[Joint], values: Mapping[str, float | None]) -> str:
    """Write one error per joint: degrees for a hinge, millimetres for a slide."""
    parts = []
    for joint in joints:
        value, (scale, unit) = values[joint.name], shown_in(joint)
        if value is None or not math.isfinite(value):
            parts.append("–")
        else:
            # both joints of a double pendulum in one line
            size = value * scale
            parts.append(f"{size:.{2 if size < 10.0 else 3}g}{'°' if unit == 'deg' else ' mm'}")
    return " · ".join(parts)


def _cards(findings: Findings) -> list[dict[str, Any]]:
    """Return the small tables at the end."""
    cards = [] if findings.filmed is None else [_camera_card(findings.filmed)]
    cards += _start_cards(findings.fit)
    if findings.log is not None:
        cards += _run_cards(findings.log)
    return cards


def _camera_card(filmed: Filmed) -> dict[str, Any]:
    camera, shutter = filmed.camera, filmed.shutter
    turns = ", ".join(
        f"{name} {math.degrees(getattr(camera, name)):z.2f}°" for name in ("roll", "pitch", "yaw")
    )
    rows = [
        ("picture", f"{camera.width} × {camera.height} px"),
        ("focal length", f"{camera.focal:.1f} px"),
        ("position", f"{camera.x:z.4f} m right, {camera.y:z.4f} m up".replace("-", "−")),
        ("distance", f"{camera.depth:.4f} m"),
        ("turn", turns),
    ]
    if shutter is not None:
        known = f" ± {1000.0 * shutter.std:.2g}" if shutter.std else ""
        rows.append(("exposure", f"{1000.0 * shutter.exposure:.3g}{known} ms"))
        rows += [("readout", f"{1000.0 * shutter.readout:.3g} ms")] if shutter.readout else []
    return {"title": "Camera", "rows": rows, "folded": False}


def _start_cards(fit: Fit) -> list[dict[str, Any]]:
    cards = []
    for i, start in enumerate(fit.starts):
        rows = [("time", f"{start.time:.4f} s")]
        for dof, joint in enumerate(fit.mechanism.joints):
            unit = "rad" if joint.kind == "hinge" else "m"
            rows.append((joint.name, f"{start.position[dof]:.5g} {unit}, {start.velocity[dof]:.5g} {unit}/s"))
        title = "Start state" if len(fit.starts) == 1 else f"Start state of record {i + 1}"
        cards.append({"title": title, "rows": rows, "folded": False})
    return cards


def _run_cards(log: RunLog) -> list[dict[str, Any]]:
    return [
        {
            "title": "Seconds by stage",
            "rows": [(name, f"{value:.2f}") for name, value in log.seconds.items()],
            "folded": True,
        },
        {"title": "Settings", "rows": list(flat(log.settings).items()), "folded": True},
        {"title": "Versions", "rows": list(log.versions.items()), "folded": True},
    ]


def flat(settings: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """Return nested settings as dotted names and texts.

    Args:
        settings: The settings.
        prefix: Put before every name.
    """
    found: dict[str, str] = {}
    for name, value in settings.items():
        if isinstance(value, Mapping) and value:
            found.update(flat(value, f"{prefix}{name}."))
        else:
            found[f"{prefix}{name}"] = "–" if value in (None, "", [], {}, ()) else str(value)
    return found
