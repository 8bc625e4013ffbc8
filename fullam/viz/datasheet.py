"""The datasheet as one page that loads nothing from elsewhere: to read, print and pin up."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.datasheet import Datasheet, rotor_rows
from fullam.analysis.statistics import Interval
from fullam.files import atomic_path
from fullam.viz import datasheet_figures as draw

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fullam.analysis.atlas.envelope import Envelope

Array = NDArray[np.float64]

NONE = "–"
"""What stands where there is no figure."""

FIGURES = (
    "tilt worst [deg]", "tilt best [deg]", "thrust / weight", "level force [N]", "push [N]",
    "moment [N&nbsp;m]", "margin [N]", "payload [kg]",
)  # fmt: skip
"""Heads of the columns that `_figures` fills."""

STYLE = "th.number { white-space: normal; } td:first-child { min-width: 9.5rem; } \
.tally { grid-template-columns: repeat(3, 1fr); }"
"""What this page needs beside the report's style sheet."""


def write_datasheet(sheet: Datasheet, path: str | Path) -> Path:
    """Write the page.

    Args:
        sheet: What stands on it.
        path: The file, .html.

    Returns:
        The file.
    """
    path = Path(path)
    with atomic_path(path) as temporary:
        temporary.write_text(page(sheet), encoding="utf-8")
    return path


def page(sheet: Datasheet) -> str:
    """The page as text."""
    css = resources.files("fullam.viz").joinpath("report.css").read_text(encoding="utf-8")
    name = escape(sheet.vehicle.name)
    versions = " · ".join(f"{escape(k)} {escape(v)}" for k, v in sheet.versions.items())
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Datasheet: {name}</title><style>{css}{STYLE}</style></head><body><main>
<h1>{name}</h1>
<p class="lead">{escape(sheet.vehicle.description)}</p>
<p>Datasheet of {escape(sheet.date)} · <code>fullam datasheet {name}</code> · {versions}</p>
{"".join(_sections(sheet))}
<footer>Wrenches and directions are in the platform’s frame {{A}}. Tilts, forces, moments, margins
and payloads are exact for rotors that reach their largest speed: read off the facets of the
attainable wrenches, not sampled. They leave nothing for control or gusts; the suggested limits
do. Hover tilt is the first exit from level.</footer>
</main></body></html>
"""


def _sections(sheet: Datasheet) -> Iterator[str]:
    yield _headline(sheet)
    yield "<h2>The vehicle</h2>" + _picture(
        draw.figure_drawing(sheet),
        "Discs are the rotors (blue: the drag torque turns left), the short lines their thrust "
        "axes, the black line the arm at rest, grey the other poses below, + the centre of mass.",
    )
    yield _masses(sheet) + _rotors(sheet)
    yield "<h2>What it can do, by arm pose</h2>" + _poses(sheet)
    if sheet.capability.can_hover:
        yield from _pictures(sheet)
    yield "<h2>When a rotor stops</h2>" + _failures(sheet)
    yield "<h2>Suggested limits</h2>" + _limits(sheet)
    yield "<h2>Does it fly</h2>" + _trial(sheet)
    yield "<h2>Can the dynamics be trusted</h2>" + _agreement(sheet)


def _pictures(sheet: Datasheet) -> Iterator[str]:
    survey, leans = sheet.survey, (sheet.capability.best_hover_tilt or 0.0) > 0.0
    if leans:
        yield _picture(
            draw.figure_roses(sheet),
            "Left: hover tilt [deg] over the azimuth it leans to, with the worst azimuth as a dot. "
            f"Right: the worst tilt over {len(survey.tilts)} arm poses within the joints’ limits; "
            f"{100.0 * survey.hovering:.1f} % of them can hover.",
        )
    else:
        yield "<p>It hovers level and in no other attitude.</p>"
    yield "<h3>Force and moment beside the weight</h3>" + _picture(
        draw.figure_slices(sheet),
        "While level, the arm at rest: forces through the centre of mass without turning, moments "
        "without a change of force; + is hover.",
    )
    if leans:
        yield "<h3>Push of the tool</h3>" + _picture(
            draw.figure_push(sheet),
            f"Largest force on the world at {draw.tool_point(sheet.poses[0].envelope)}, the arm "
            f"at rest; × is the weakest direction drawn. In every direction it is "
            f"{sheet.capability.push:.2f} N.",
        )
        yield "<h3>Payload</h3>" + _picture(
            draw.figure_payload(sheet),
            f"Level hover ends at {sheet.capability.payload:.2f} kg.",
            half=True,
        )


def _headline(sheet: Datasheet) -> str:
    found = sheet.capability
    if not found.can_hover:
        reasons = "; ".join(found.limits)
        text = f"<b>Grounded:</b> it {escape(reasons)}. What needs hover is left out below."
        return f'<p class="warning">{text}</p>'
    boxes = [
        (f"{_degrees(found.worst_hover_tilt)}°", "of tilt towards anywhere, arm at rest"),
        (f"{found.thrust_to_weight:.2f}", "thrust to weight, straight up"),
        (f"{found.level_force:.1f} N", "level force in any direction"),
        (f"{found.push:.1f} N", "push of the tool in any direction"),
        (f"{found.payload:.2f} kg", "at the tool end hover"),
        (f"{100.0 * found.hover_efficiency:.0f} %", "hover efficiency, weight over thrusts"),
    ]
    notes = "".join(f'<p class="warning">Note: {escape(text)}.</p>' for text in found.limits)
    inner = "".join(f"<div><b>{value}</b><span>{text}</span></div>" for value, text in boxes)
    return f'<div class="tally">{inner}</div>{notes}'


def _masses(sheet: Datasheet) -> str:
    vehicle = sheet.vehicle
    bodies = vehicle.model.inertias
    names = [vehicle.platform, *vehicle.arm_joints]
    rows = [
        [escape(name), f"{body.mass:.4f}", *(f"{1000.0 * x:.1f}" for x in body.lever)]
        for name, body in zip(names, list(bodies)[1:], strict=True)
    ]
    center = sheet.poses[0].envelope.load.center
    rows.append(["<b>all, arm at rest</b>", f"<b>{vehicle.mass:.4f}</b>",
                 *(f"{1000.0 * x:.1f}" for x in center)])  # fmt: skip
    head = ["Body, by its joint", "mass [kg]", "com x [mm]", "com y [mm]", "com z [mm]"]
    note = "<p>Centres of mass are in the body’s own frame, the last one in {A}.</p>"
    return "<h3>Masses</h3>" + _table(head, rows) + note


def _rotors(sheet: Datasheet) -> str:
    rows = [
        [
            f"{k + 1} {escape(r['name'])}",
            " ".join(f"{1000.0 * x:.0f}" for x in r["position_m"]),
            f"{r['cant_deg']:.2f}",
            f"{r['spin']:+d}",
            f"{r['k_f']:.4g}",
            f"{r['k_tau']:.4g}",
            f"{r['min_speed_rad_s']:.0f} – {r['max_speed_rad_s']:.0f}",
            f"{r['max_thrust_N']:.2f}",
        ]
        for k, r in enumerate(rotor_rows(sheet.vehicle))
    ]
    head = ["Rotor", "position [mm]", "cant [deg]", "spin", "k_f [N s²]", "k_tau [N m s²]",
            "speeds [rad/s]", "thrust [N]"]  # fmt: skip
    return "<h3>Rotors</h3>" + _table(head, rows)


def _poses(sheet: Datasheet) -> str:
    rows = []
    for pose in sheet.poses:
        e = pose.envelope
        rows.append([f"{escape(pose.name)}<small>{_arm(sheet, pose.theta)}</small>", *_figures(e)])
    head = ["Arm", *FIGURES]
    length = sheet.poses[0].envelope.length
    note = (
        "<p>Forces, pushes and moments are those of the weakest direction. The margin is the "
        "largest ball of wrenches about level hover, moments divided by "
        f"{length:.3f} m, the mean distance of the hubs.</p>"
    )
    return _table(head, rows) + note


def _arm(sheet: Datasheet, theta: Array) -> str:
    joints = sheet.vehicle.joints
    typed = zip(joints.to_typed(theta), joints.units, strict=True)
    return ", ".join(f"{x:.0f}°" if unit == "deg" else f"{x:.2f} m" for x, unit in typed)


def _figures(e: Envelope) -> list[str]:
    best, worst = e.best_tilt, e.worst_tilt
    return [
        NONE if worst is None else _degrees(worst[0], 2),
        NONE if best is None else _degrees(best[0], 2),
        f"{e.thrust_to_weight:.2f}",
        *(_number(x, 2) for x in (e.least_level_force, e.least_push, e.least_moment)),
        _number(e.margin.value if e.can_hover else float("nan"), 2),
        _number(e.payload, 2),
    ]


def _failures(sheet: Datasheet) -> str:
    rows = []
    for name, e in zip(sheet.vehicle.rotors.names, sheet.failures, strict=True):
        verdict = "holds" if e.can_hover else "fails"
        text = "hovers" if e.can_hover else "falls"
        rows.append(
            [escape(name), f'<span class="chip {verdict}">{text}</span>', *_figures(e)]
        )  # fmt: skip
    head = ["Stopped", "level hover", *FIGURES]
    kept = sum(e.can_hover for e in sheet.failures)
    text = (
        f"<p>The arm at rest. {kept} of {len(sheet.failures)} single failures leave level hover; "
        "thrust to weight is 0 where the other rotors cannot balance the weight at all.</p>"
    )
    return text + _table(head, rows)


def _limits(sheet: Datasheet) -> str:
    found = sheet.limits
    if found.hover_thrust is None:
        return "<p>None: it cannot hover with its arm at rest.</p>"
    rows = [
        ["largest tilt of the set point", _number(found.tilt_deg, 1), "deg", "any arm pose tried"],
        ["horizontal acceleration", _number(found.acceleration, 2), "m/s²", "level, any direction"],
        ["acceleration up", _number(found.up, 2), "m/s²", "level"],
        ["acceleration down", _number(found.down, 2), "m/s²", "level"],
        ["angular acceleration", _number(found.angular_acceleration, 1), "rad/s²", "any axis"],
        ["payload", _number(found.payload, 2), "kg", "at the tool, arm at rest"],
        ["horizontal force over weight", _number(found.lateral_ratio, 3), "",
         "exact, no reserve: MPC_FA_XY_RATIO and the like"],
        ["hover thrust", _number(found.hover_thrust, 3), "", "of the largest: MPC_THR_HOVER"],
    ]  # fmt: skip
    text = (
        f"<p>{100.0 * found.share:.0f} % of what is there; the rest is for control and gusts. "
        "Taken together they do not all hold at once: a push uses up tilt.</p>"
    )
    return text + _table(["Limit", "value", "unit", "where"], rows, left=(0, 2, 3))


def _trial(sheet: Datasheet) -> str:
    trial = sheet.trial
    if trial.problem:
        return f"<p>Not flown: {escape(trial.problem)}.</p>"
    rows = [
        ["RMS position error", _interval(trial.position_mm, 1), "mm"],
        ["RMS attitude error", _interval(trial.attitude_deg, 2), "deg"],
        ["settling time (2 %)", _interval(trial.settling_s, 2), "s"],
        ["flights lost", f"{trial.lost} of {trial.flights}", ""],
    ]
    text = (
        f"<p><code>{escape(trial.controller)}</code> with the <code>{escape(trial.estimator)}"
        f"</code> estimator, {escape(trial.text)}. Medians with 95 % intervals.</p>"
    )
    return text + _table(["Figure", "value", "unit"], rows, left=(0, 2))


def _agreement(sheet: Datasheet) -> str:
    table = sheet.agreement
    if table is None:
        return "<p>The paper’s equations do not hold for this arm; Pinocchio’s do.</p>"
    rows = [
        [escape(row.quantity), f"{row.recursion_pinocchio:.1e}", f"{row.matrix_pinocchio:.1e}",
         f"{row.recursion_matrix:.1e}"]
        for row in table.rows
    ]  # fmt: skip
    text = (
        f"<p>Largest relative differences over {table.samples} random states between the paper’s "
        "recursion, its matrix system and Pinocchio.</p>"
    )
    head = ["Quantity", "recursion – Pinocchio", "matrix – Pinocchio", "recursion – matrix"]
    return text + _table(head, rows)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[int] = (0,)) -> str:
    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(
            f"<{tag}{'' if k in left else ' class=number'}>{cell}</{tag}>"
            for k, cell in enumerate(row)
        )

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f'<div class="scroll"><table><tr>{cells("th", head)}</tr>{body}</table></div>'


def _picture(figure: Figure, caption: str, half: bool = False) -> str:
    memory = io.BytesIO()
    figure.savefig(memory, format="svg", metadata={"Date": None})
    data = base64.b64encode(memory.getvalue()).decode()
    width = ' style="max-width: 560px"' if half else ""
    return (
        f'<figure{width}><img alt="{escape(caption)}" src="data:image/svg+xml;base64,{data}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def _number(value: float | None, digits: int) -> str:
    return NONE if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def _degrees(angle: float | None, digits: int = 1) -> str:
    return NONE if angle is None else f"{np.rad2deg(angle):.{digits}f}"


def _interval(found: Interval | None, digits: int) -> str:
    if found is None:
        return NONE
    ends = (found.estimate, found.low, found.high)
    middle, low, high = ("never" if np.isinf(x) else f"{x:.{digits}f}" for x in ends)
    return f"{middle} ({low} – {high})"
