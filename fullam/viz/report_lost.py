"""The report's section on flights that were lost, or that swing about their target."""

from __future__ import annotations

from html import escape

from fullam.analysis.judged import LOST
from fullam.analysis.lost import MOST, OSCILLATING, LostFlight, lost_flights
from fullam.analysis.reproduce import CONDITIONS, Reproduction

KINDS = ((LOST, "were lost"), (OSCILLATING, "swing about their target"))
"""Outcomes that are no good ones, and how they are told."""


def lost_section(result: Reproduction) -> str:
    """How many flights were lost or swing under each condition, and why the first of them do."""
    text = ""
    for condition in CONDITIONS:
        for table in (result.tables[condition.key], result.quadrotor[condition.key]):
            for outcomes, told in KINDS:
                count, flights = lost_flights(table, MOST, outcomes)
                if count:
                    text += (
                        f"<p><b>{count} of {len(table)} flights</b> {escape(condition.short)} "
                        f"{told}; why, of the first {len(flights)}:</p>"
                        f"<ul>{''.join(_line(flight) for flight in flights)}</ul>"
                    )
    return text or "<p>None.</p>"


def _line(flight: LostFlight) -> str:
    found = "".join(f"<li>{escape(str(finding))}</li>" for finding in flight.findings)
    return (
        f"<li>{escape(flight.contender)}, {escape(flight.scenario)}, seed {flight.seed}: "
        f"{escape(flight.reason)}<ul>{found}</ul></li>"
    )
