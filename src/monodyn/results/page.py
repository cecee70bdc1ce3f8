"""A fit and its motion as one self-contained page: advice first, then angles, pictures and tables.

The page needs no network: the plotting script of the installed plotly package is written into it.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.results.export import Trace, frames_of
from monodyn.results.log import RunLog
from monodyn.types import Camera

if TYPE_CHECKING:
    from jinja2 import Template

    from monodyn.estimation.fit import Estimate, Fit


@dataclass(frozen=True, eq=False)
class Page:
    """What the report says beside the fit.

    Attributes:
        title: Heading.
        subtitle: One line under it.
        notes: Sentences after the fit's own advice (from the clip, the camera, the tracking).
        pictures: JPEG files with a caption each.
        camera: Camera in metres of the identified scale.
        log: Settings, versions and seconds of the run, or None.
    """

    title: str
    subtitle: str = ""
    notes: Sequence[str] = ()
    pictures: Sequence[tuple[bytes, str]] = ()
    camera: Camera | None = None
    log: RunLog | None = None


def page_text(fit: Fit, traces: Sequence[Trace], page: Page) -> str:
    """Return the report as HTML text.

    Args:
        fit: The fit.
        traces: The records beside their motion under the identified dynamics.
        page: What is said beside the fit.
    """
    from markupsafe import Markup

    several = len(traces) > 1
    plots = [plot for trace in traces for plot in _plots(fit, trace, several=several)]
    torques = [plot for trace in traces for plot in _torque_plots(fit, trace, several=several)]
    return template("monodyn.results", "report.html.j2").render(
        title=page.title,
        subtitle=page.subtitle,
        status=str(fit.status),
        ok=bool(fit.ok),
        advice=[*fit.advice, *page.notes],
        facts=_facts(fit, traces, page),
        plots=plots,
        torques=torques,
        with_friction=not any(
            value for name, value in fit.mechanism.values.items() if name.endswith((".damping", ".friction"))
        ),
        pictures=[
            {"data": base64.b64encode(data).decode("ascii"), "caption": caption}
            for data, caption in page.pictures
        ],
        parameters=[_parameter(row) for row in fit.parameters if listed(fit, row)],
        others=[_parameter(row) for row in fit.parameters if not row.free and not listed(fit, row)],
        combinations=[
            {"name": c.name, "value": number(c.value, c.std), "std": short(c.std)} for c in fit.combinations
        ],
        cards=_cards(fit, page),
        plotly=Markup(plotting_script() if plots else ""),
    )


def template(package: str, name: str) -> Template:
    """Load a template of a page; what is put into it is escaped, and a name that it lacks raises.

    Args:
        package: Where the template is.
        name: Its file name.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader(package, "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    return environment.get_template(name)


def plotting_script() -> str:
    """Return plotly's script; a closing tag inside it would end the page's script element."""
    from importlib.resources import files

    return (
        (files("plotly") / "package_data" / "plotly.min.js")
        .read_text(encoding="utf-8")
        .replace("</script", "<\\/script")
    )


def number(value: float | None, std: float | None = None) -> str:
    """Write a number with the digits that its standard deviation leaves, five without one.

    Args:
        value: The number; None is unknown.
        std: Its standard deviation, when known.
    """
    if value is None or math.isnan(value):
        return "unknown"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if std is None or not math.isfinite(std) or std <= 0 or value == 0:
        return f"{value:.5g}".replace("-", "−")
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(std)) + 2
    return f"{value:.{min(max(digits, 2), 8)}g}".replace("-", "−")


def short(value: float) -> str:
    """Write a standard deviation with two digits.

    Args:
        value: The standard deviation.
    """
    return f"{value:.2g}" if math.isfinite(value) else number(value)


def _parameter(row: Any) -> dict[str, Any]:
    """Return one line of the parameter table."""
    if row.at_bound:
        source, flag = "at its bound", True
    elif not row.free and not row.identifiable:
        source, flag = "held", True
    elif not row.identifiable:
        source, flag = "not determined by this motion", True
    else:
        source, flag = "estimated", False
    lower, upper = number(row.lower, row.std), number(row.upper, row.std)
    interval = (
        "unbounded" if not (math.isfinite(row.lower) or math.isfinite(row.upper)) else f"{lower} to {upper}"
    )
    return {
        "name": row.name,
        "value": number(row.value, row.std),
        "interval": interval,
        "unit": row.unit,
        "free": row.free,
        "source": source,
        "flag": flag,
    }


def _facts(fit: Fit, traces: Sequence[Trace], page: Page) -> list[dict[str, str]]:
    """Return the few numbers under the heading."""
    facts = []
    if traces:
        seen = sum(int(np.sum(trace.poses.seen)) for trace in traces)
        total = sum(len(trace.poses) for trace in traces)
        facts.append(
            {"value": f"{seen} of {total}", "label": "frames tracked" if page.camera else "samples measured"}
        )
    if len(traces) == 1:
        first, stop = frames_of(traces[0])
        facts.append({"value": f"{first} to {stop - 1}", "label": "frames used for the fit"})
        joints = fit.mechanism.joints
        facts.append({"value": _sizes(joints, fit.rms), "label": "fit error, rms by joint"})
        heldout = traces[0].heldout()
        if any(value is not None for value in heldout.values()):
            facts.append({"value": _sizes(joints, heldout), "label": "prediction error, rms by joint"})
    if page.log is not None:
        facts.append({"value": f"{sum(page.log.seconds.values()):.1f} s", "label": "computing time"})
    return facts


def _sizes(joints: Sequence[Any], values: Mapping[str, float | None]) -> str:
    """Write one error per joint: degrees for a hinge, millimetres for a slide."""
    parts = []
    for joint in joints:
        value = values[joint.name]
        if value is None:
            parts.append("–")
        elif joint.kind == "hinge":
            parts.append(f"{math.degrees(value):.3g}°")
        else:
            parts.append(f"{1000 * value:.3g} mm")
    return " · ".join(parts)


def _plots(fit: Fit, trace: Trace, *, several: bool) -> list[dict[str, Any]]:
    """Return the data of one figure per joint."""
    poses, states = trace.poses, trace.states
    first, stop = trace.rows
    plots = []
    for dof, joint in enumerate(fit.mechanism.joints):
        scale = 180.0 / math.pi if joint.kind == "hinge" else 1000.0
        observed = np.where(poses.seen, poses.position[:, dof], np.nan) * scale
        whole = {
            "time": states.time,
            "value": states.position[:, dof] * scale,
            "std": states.std[:, dof] * scale,
            "error_time": poses.time,
            "error": states.position[:, dof] * scale - observed,
        }
        fitted = {name: values[:stop] for name, values in whole.items()}
        late = {name: whole[name][stop:] for name in ("error_time", "error")}
        plots.append(
            {
                "title": f"{trace.name}: {joint.name}" if several else joint.name,
                "unit": "deg" if joint.kind == "hinge" else "mm",
                "time": _list(poses.time),
                "observed": _list(observed),
                "window": [float(poses.time[first]), float(poses.time[stop - 1])],
                "fitted": _band(**fitted),
                "predicted": _predicted(trace, dof, scale, late),
            }
        )
    return plots


def _torque_plots(fit: Fit, trace: Trace, *, several: bool) -> list[dict[str, Any]]:
    """Return the data of one figure per joint for the torques besides friction; none without a drive."""
    found = trace.torques
    if found is None:
        return []
    first, stop = trace.rows
    nothing = np.zeros(0)
    until = stop if fit.torque == "free" else len(found.time)
    rows = slice(first if fit.torque == "free" else 0, until)
    plots = []
    for dof, joint in enumerate(fit.mechanism.joints):
        curve = _band(found.time[rows], found.torque[rows, dof], found.std[rows, dof], nothing, nothing)
        plots.append(
            {
                "title": f"{trace.name}: torque at {joint.name}" if several else f"torque at {joint.name}",
                "unit": "N m" if joint.kind == "hinge" else "N",
                "time": [],
                "observed": [],
                "window": [float(found.time[first]), float(found.time[stop - 1])],
                "fitted": curve,
                "predicted": None,
                "alone": True,
            }
        )
    return plots


def listed(fit: Fit, row: Estimate) -> bool:
    """True for a parameter of the first table: an estimated one, or one that is held beside free torques.

    Torques at single time stamps, of which there are hundreds, have a figure and a file of their own.

    Args:
        fit: The fit.
        row: One of its parameters.
    """
    if fit.torque != "free":
        return row.free
    if row.name.rpartition(".")[0].endswith(".torque"):
        return False
    seen_only = row.name.endswith(".offset")
    return row.free or (not row.identifiable and row.unit in ("m", "kg", "kg m^2") and not seen_only)


def _predicted(trace: Trace, dof: int, scale: float, late: dict[str, np.ndarray]) -> dict[str, Any] | None:
    """Return the curve of the prediction with its error where the record goes on."""
    future = trace.future
    if future is None or not len(future.time):
        return None
    return _band(future.time, future.position[:, dof] * scale, future.std[:, dof] * scale, **late)


def _band(
    time: np.ndarray, value: np.ndarray, std: np.ndarray, error_time: np.ndarray, error: np.ndarray
) -> dict[str, Any]:
    half = 1.96 * np.where(np.isfinite(std), std, 0.0)
    return {
        "time": _list(time),
        "value": _list(value),
        "lower": _list(value - half),
        "upper": _list(value + half),
        "error_time": _list(error_time),
        "error": _list(error),
    }


def _list(values: np.ndarray) -> list[float | None]:
    """Return numbers short enough for a figure; unknown ones as null."""
    return [float(f"{v:.6g}") if math.isfinite(v) else None for v in np.asarray(values, dtype=float).tolist()]


def _cards(fit: Fit, page: Page) -> list[dict[str, Any]]:
    """Return the small tables at the end."""
    cards = []
    if page.camera is not None:
        camera = page.camera
        rows = [
            ("picture", f"{camera.width} × {camera.height} px"),
            ("focal length", f"{camera.focal:.1f} px"),
            ("position", f"{camera.x:.4f} m right, {camera.y:.4f} m up"),
            ("distance", f"{camera.depth:.4f} m"),
            (
                "turn",
                ", ".join(f"{n} {math.degrees(getattr(camera, n)):.2f}°" for n in ("roll", "pitch", "yaw")),
            ),
        ]
        cards.append({"title": "Camera", "rows": rows})
    for i, start in enumerate(fit.starts):
        title = "Start state" if len(fit.starts) == 1 else f"Start state of record {i + 1}"
        rows = [("time", f"{start.time:.4f} s")]
        for dof, joint in enumerate(fit.mechanism.joints):
            unit = "rad" if joint.kind == "hinge" else "m"
            rows.append((joint.name, f"{start.position[dof]:.5g} {unit}, {start.velocity[dof]:.5g} {unit}/s"))
        cards.append({"title": title, "rows": rows})
    if page.log is not None:
        seconds = [(name, f"{value:.2f}") for name, value in page.log.seconds.items()]
        cards.append({"title": "Seconds by stage", "rows": seconds})
        cards.append({"title": "Settings", "rows": list(flat(page.log.settings).items())})
        cards.append({"title": "Versions", "rows": list(page.log.versions.items())})
    return cards


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
