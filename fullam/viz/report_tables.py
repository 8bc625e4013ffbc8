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
    """Three digits at most; infinity is "never", NaN a dash."""
    if value != value:
        return "–"
    if value in (float("inf"), float("-inf")):
        return "never" if unit == "s" else "∞"
    size = abs(value)
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
        rows.append(f"<tr>{where}<td>{asked(claim)}</td>{cells}</tr>")
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


def recorded_table(rows: tuple[RecordedRow, ...]) -> str:
    """RMS, offset, settling, overshoot and command noise: theirs, ours, ratio or difference."""
    titles = {
        MEASURED: "as the data show: 50 Hz, 9/s, no gusts",
        STATED: "100 Hz, 18/s, no gusts",
        STATED_WITH_GUSTS: "as stated: 100 Hz, 18/s, gusts",
    }
    head = "".join(f'<th class="number">ours, {escape(titles[r])}</th>' for r in READINGS)
    out = [
        '<tr><th></th><th>axis</th><th class="number">theirs</th>'
        f'{head}<th class="number">first of ours against theirs</th><th></th></tr>'
    ]
    for row in rows:
        out.append(f'<tr class="section"><td colspan="7">{escape(row.task.scenario.description)}'
                   f"</td></tr>")  # fmt: skip
        for text, name, kind, units in (
            ("RMS error", "rms", "ratio", ("mm", "deg")),
            ("steady offset", "mean", "difference", ("mm", "deg")),
            ("settling, 5 %", "settling_s", "difference", ("s", "s")),
            ("overshoot", "overshoot_percent", "difference", ("%", "%")),
            ("noise of the command", "command_noise", "ratio", ("N", "N m")),
        ):
            theirs = getattr(row.published, name)
            if theirs is None:
                continue
            for i, value in enumerate(theirs):
                ours = [getattr(row.ours[r], name)[i] for r in READINGS]
                cells = "".join(f'<td class="number">{number(v)}</td>' for v in ours)
                compared, verdict = _compared(name, kind, ours[0], value)
                out.append(
                    f"<tr><td>{text if i == 0 else ''}</td><td>{AXES[i]} [{units[i // 3]}]</td>"
                    f'<td class="number">{number(value)}</td>{cells}'
                    f'<td class="number">{compared}</td><td>{verdict}</td></tr>'
                )
    return f'<div class="scroll"><table>{"".join(out)}</table></div>'


def _compared(name: str, kind: str, ours: float, theirs: float) -> tuple[str, str]:
    """Ratio or difference as text, and the verdict where this project asks for one."""
    if kind == "ratio":
        ratio = ours / theirs
        verdict = chip(HOLDS if 1.0 / 1.5 < ratio < 1.5 else FAILS) if name == "rms" else ""
        return f"× {ratio:.2f}", verdict
    difference = ours - theirs
    verdict = chip(HOLDS if abs(difference) < 0.2 else FAILS) if name == "settling_s" else ""
    return f"{difference:+.2f}".replace("-", "−"), verdict
