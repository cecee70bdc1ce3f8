"""A fit and its motion as one self-contained page: film and verdict first, then plots, then tables.

The page needs no network: the plotting script in ``plotly-basic``, the smallest build of plotly.js as it is
published, is written into it.
"""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.mechanism.tree import BRAKES
from monodyn.numbers import number, short, shown_in
from monodyn.results.curves import MOST, camera_curves, motion_curves, torque_curves
from monodyn.results.embedded import embedded
from monodyn.results.findings import REFUSED, Findings, listed_rows, openness
from monodyn.results.gaps import how_filled
from monodyn.results.horizon import Horizon, horizon_said
from monodyn.results.next_steps import Step, next_steps
from monodyn.results.summary import frictions, meanings, summary

if TYPE_CHECKING:
    from jinja2 import Template

    from monodyn.estimation.fit import Estimate, Fit
    from monodyn.estimation.parts import Combination
    from monodyn.mechanism import Joint
    from monodyn.results.filmed import Filmed
    from monodyn.results.log import RunLog


REPORT = ("monodyn.results", "report.html.j2")
"""The template of the report: where it is, and its name."""
FILM = "<!-- film -->"
"""Where the report has its film."""
LARGEST, AROUND = 8_000_000, 2_000
"""Letters of a page that a mailbox and a phone take; those of the film's part besides film and picture."""


def page_text(
    findings: Findings,
    film: tuple[Path, bytes] | None = None,
    diagnosis: bytes | None = None,
    files: Sequence[str] = (),
    steps: Sequence[Step] | None = None,
) -> str:
    """Return the report as HTML text.

    Args:
        findings: The fit, its records and what else is reported about it.
        film: The film of the clip and one of its pictures, a JPEG file; None has none.
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
    ratios = [row for rows in frictions(fit).items() for row in _ratios(fit, *rows)]
    page = template(*REPORT).render(
        title=findings.title,
        subtitle=findings.subtitle,
        status=str(fit.status),
        grade=fit.grade,
        refused=REFUSED,
        summary=summary(fit),
        advice=[sentence for sentence in findings.advice if sentence not in findings.premises],
        premises=findings.premises,
        comparison=findings.comparison,
        tried_torques=findings.fit.tried_torques,
        facts=_facts(findings),
        plots=plots,
        torques=[plot for trace in traces for plot in torque_curves(fit, trace, several=several)],
        camera=camera,
        # free torques contain the friction that the mechanism has no parameters for
        any_filled=any(plot["filled"] and plot["filled"]["time"] for plot in plots),
        thinned=MOST if any(len(trace.poses) > MOST for trace in traces) else 0,
        motion_band=any(np.isfinite(t.states.std).any() for t in traces),
        torque_band=any(t.torques is not None and np.isfinite(t.torques.std).any() for t in traces),
        with_friction=not any(row.value for row in fit.mechanism.parameters if row.kind in BRAKES),
        film=film is not None,
        diagnosis="" if diagnosis is None else _text_of(diagnosis),
        known=[_parameter(row, kinds) for row in listed if row.identifiable],
        frictions=ratios,
        sized="length" in kinds.values(),
        unknown=[_parameter(row, kinds, open_ways) for row in listed if not row.identifiable],
        others=[_parameter(row, kinds) for row in others],
        combinations=[
            {"name": c.name, "value": number(c.value, c.std), "std": short(c.std), "unit": c.unit}
            for c in fit.combinations
            if c.name not in {row["name"] for row in ratios}
        ],
        symbols=_symbols(fit),
        horizons=[_trusted(findings, number, found) for number, found in enumerate(findings.horizons)],
        steps=next_steps(findings) if steps is None else steps,
        files=files,
        cards=_cards(findings),
        plotly=Markup(plotting_script() if plots or camera else ""),
    )
    if film is None:
        return page
    # text of others cannot have the mark: it is escaped
    head, rest = page.split(FILM)
    return f"{head}{_film(*film, fit.grade, LARGEST - len((head + rest).encode()))}{rest}"


def _film(path: Path, poster: bytes, grade: str, room: int) -> str:
    """Return the film as a part of the page, of at most so many letters."""
    still = _text_of(poster)
    data, shown = embedded(path, max(0, (room - len(still) - AROUND) // 4 * 3))
    return template(REPORT[0], "film.html.j2").render(
        data=_text_of(data), poster=still, grade=grade, shown=shown
    )


def _text_of(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _ratios(
    fit: Fit, what: str, rows: Sequence[tuple[str, Estimate | Combination]]
) -> Iterator[dict[str, Any]]:
    """Yield the lines of a friction that is known against an inertia, for the table of what is known."""
    for joint, row in rows:
        if row in fit.combinations:
            interval = f"{number(row.lower, row.std)} to {number(row.upper, row.std)}"
            value = {"value": number(row.value, row.std), "interval": interval, "unit": row.unit}
            yield {"name": row.name, **value, "meaning": f"{what}, at {joint}"}


def _symbols(fit: Fit) -> dict[str, str]:
    """Return what the symbols of the combinations mean."""
    text = " ".join(one.name for one in fit.combinations)
    return {word: said for word, said in meanings()["symbols"].items() if re.search(rf"\.{word}\b", text)}


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
        source = meanings()["open"][(ways or {}).get(row.name, "held")]
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
        "meaning": meanings()["parameters"].get(kinds.get(row.name, ""), ""),
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
    heldout = traces[0].heldout() if len(traces) == 1 else {}
    if any(value is not None for value in heldout.values()):
        said = _errors(fit.mechanism.joints, heldout)
        facts.append({"value": said, "label": "prediction error, rms by joint"})
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
