"""The tables of the report, as HTML."""

from __future__ import annotations

from html import escape

from fullam.analysis.claims import CLAIMS, TARGETS, Bound, Claim, Paired, Proof
from fullam.analysis.evidence import FAILS, HOLDS, UNDECIDED, Finding, TiltProof
from fullam.analysis.recorded import MEASURED, READINGS, STATED, STATED_WITH_GUSTS
from fullam.analysis.reproduce import CONDITIONS, Entry, RecordedRow, Reproduction, command
from fullam.analysis.statistics import Interval

AXES = ("x", "y", "z", "φ", "ψ", "γ")


def number(value: float, unit: str = "") -> str:
    """Three digits at most; infinity is "never" in seconds, NaN a dash."""
    if value != value:
        return "–"
    if value in (float("inf"), float("-inf")):
        return "never" if unit == "s" else "∞"
    size = abs(value)
    if size < 0.00095:
        return f"{value:.0e}".replace("-", "−") if size else "0"
    digits = 0 if size >= 100 else 1 if size >= 10 else 2 if size >= 0.095 else 3
    return f"{value:.{digits}f}".replace("-", "−")


def interval_text(interval: Interval, unit: str) -> str:
    """Estimate, unit and [low, high]."""
    share = 100.0 if unit == "" else 1.0
    shown = "%" if unit == "" else unit
    ends = f"{number(share * interval.low, unit)}, {number(share * interval.high, unit)}"
    value = number(share * interval.estimate, unit)
    spaced = f"{value} {shown}" if value not in ("never", "–") else value
    return f"<b>{spaced}</b> <small>[{ends}]</small>"


def chip(verdict: str) -> str:
    """A coloured verdict."""
    return f'<span class="chip {verdict}">{verdict}</span>'


def asked(claim: Claim) -> str:
    """What the figure has to do, in symbols."""
    test = claim.test
    if isinstance(test, Bound):
        return f"&lt; {number(test.threshold)} {test.unit}" if test.quantile is not None else "= 0"
    if isinstance(test, Paired):
        return f"&gt; {'−' + number(test.tolerance) if test.tolerance else '0'} {test.unit}"
    return "&gt; 0"


def tally(result: Reproduction, entry: Entry, condition: str) -> dict[str, int]:
    """How many of the paper's claims hold, fail and stay undecided."""
    counts = dict.fromkeys((HOLDS, FAILS, UNDECIDED), 0)
    for claim in CLAIMS:
        found = result.findings.get((claim.key, entry.contender.label, condition))
        if found is not None:
            counts[found.verdict] += 1
    return counts


def claims_table(result: Reproduction) -> str:
    """One row per claim of the paper."""
    return _claims(result, CLAIMS, result.judged)


def targets_table(result: Reproduction) -> str:
    """One row per target of this project; the last of the judged contenders is meant."""
    return _claims(result, TARGETS, result.judged)


def _claims(result: Reproduction, claims: tuple[Claim, ...], judged: tuple[Entry, ...]) -> str:
    columns = [(entry, condition) for entry in judged for condition in CONDITIONS]
    head = "".join(
        f'<th class="group" colspan="{len(CONDITIONS)}">{escape(entry.title)}</th>'
        for entry in judged
    )
    second = "".join(f"<th>{escape(condition.title)}</th>" for _, condition in columns)
    rows = [f"<tr><th rowspan=2>claimed</th><th rowspan=2>asked</th>{head}</tr><tr>{second}</tr>"]
    for claim in claims:
        remark = f"<small>{escape(claim.remark)}</small>" if claim.remark else ""
        where = (
            f'<td class="claim">{escape(claim.says)}<small>{escape(claim.source)}. Measured: '
            f"{escape(claim.measured)}.</small>{remark}{_commands(claim, result)}</td>"
        )
        if isinstance(claim.test, Proof):
            cells = f'<td colspan="{len(columns)}">{_proof_text(result.proofs)}</td>'
        else:
            cells = "".join(
                _cell(result.findings[claim.key, entry.contender.label, condition.key], claim)
                for entry, condition in columns
            )
        rows.append(f'<tr>{where}<td class="asked">{asked(claim)}</td>{cells}</tr>')
    return f'<div class="scroll"><table>{"".join(rows)}</table></div>'


def _commands(claim: Claim, result: Reproduction) -> str:
    lines = "<br>".join(
        f"<code>{escape(line)}</code>"
        for line in dict.fromkeys(
            command(claim, entry, condition, result.runs)
            for entry in result.judged
            for condition in CONDITIONS
        )
    )
    return f"<details><summary>command</summary>{lines}</details>"


def _cell(finding: Finding, claim: Claim) -> str:
    assert not isinstance(claim.test, Proof)
    notes = [escape(text) for text in (finding.where, finding.note) if text]
    small = f"<small>{'; '.join(notes)}</small>" if notes else ""
    text = interval_text(finding.interval, claim.test.unit)
    return f'<td class="cell">{chip(finding.verdict)}<br>{text}{small}</td>'


def _proof_text(proofs: tuple[TiltProof, ...]) -> str:
    flat = [p for p in proofs if p.rank < 6]
    full = [p for p in proofs if p.rank == 6]
    holds = flat and all(p.missing_share > 1e-3 for p in flat)
    shares = ", ".join(f"{100.0 * p.missing_share:.1f} %" for p in flat)
    tilts = ", ".join(f"{p.tilt_deg:.1f}°" for p in flat)
    return (
        f"{chip(HOLDS if holds else FAILS)} Rank {flat[0].rank} of 6. At the four tilted hovers "
        f"({tilts}) every allocation misses at least <b>{shares}</b> of the weight: the sine of "
        "the tilt, since parallel rotors push nothing sideways. "
        f"<small>A convex problem, so its least error is the least of all. The vehicle here (rank "
        f"{full[0].rank}) misses at most {max(p.missing_share for p in full):.0e}.</small>"
    )


QUANTITIES = (
    ("RMS error", "rms", ("mm", "deg")),
    ("steady offset", "mean", ("mm", "deg")),
    ("settling, 5 %", "settling_s", ("s", "s")),
    ("overshoot", "overshoot_percent", ("%", "%")),
    ("noise of the command", "command_noise", ("N", "N m")),
)
"""Rows of the comparison: text, field of `Figures`, units of the two halves."""

READING_TITLES = {
    MEASURED: "ours, as the data show",
    STATED: "ours, as stated but for the gusts",
    STATED_WITH_GUSTS: "ours, as stated",
}


def recorded_table(rows: tuple[RecordedRow, ...]) -> str:
    """One table a task: theirs and each reading of ours, axes side by side."""
    return "".join(
        f"<h3>{escape(row.task.scenario.description)}</h3>"
        f'<div class="scroll"><table>{_recorded(row)}</table></div>'
        for row in rows
    )


def _recorded(row: RecordedRow) -> str:
    head = "".join(f'<th class="number">{axis}</th>' for axis in AXES)
    out = [f"<tr><th></th><th></th>{head}<th></th></tr>"]
    for text, name, units in QUANTITIES:
        theirs = getattr(row.published, name)
        if theirs is None:
            continue
        unit = " and ".join(dict.fromkeys(units[: 1 + (len(theirs) > 3)]))
        out.append(f'<tr class="section"><td colspan="9">{text} [{unit}]</td></tr>')
        out.append(_recorded_row("theirs", theirs, ""))
        for reading in READINGS:
            ours = getattr(row.ours[reading], name)
            judged = _agreement(name, ours, theirs) if reading is MEASURED else ""
            out.append(_recorded_row(READING_TITLES[reading], ours, judged))
    return "".join(out)


def _recorded_row(text: str, values: tuple[float, ...], verdict: str) -> str:
    cells = "".join(f'<td class="number">{number(v)}</td>' for v in values)
    blank = '<td class="number"></td>' * (6 - len(values))
    return f"<tr><td></td><td>{text}</td>{cells}{blank}<td>{verdict}</td></tr>"


def _agreement(name: str, ours: tuple[float, ...], theirs: tuple[float, ...]) -> str:
    """The verdict where this project asks for one, and by how much the worst axis differs."""
    if name == "rms":
        worst = max((a / b for a, b in zip(ours, theirs, strict=True)), key=lambda r: max(r, 1 / r))
        return (
            f"{chip(HOLDS if 1 / 1.5 < worst < 1.5 else FAILS)} × {worst:.2f} where it differs most"
        )
    if name == "settling_s":
        worst = max(abs(a - b) for a, b in zip(ours, theirs, strict=True))
        return f"{chip(HOLDS if worst < 0.2 else FAILS)} {worst:.2f} s apart at most"
    if name == "mean":
        return f"z: {number(ours[2] - theirs[2])} mm, ψ: {number(ours[4] - theirs[4])} deg"
    return ""
