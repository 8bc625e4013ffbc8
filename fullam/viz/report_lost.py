"""The report's section on flights that were lost."""

from __future__ import annotations

from html import escape

from fullam.analysis.lost import LostFlight, lost_flights
from fullam.analysis.reproduce import CONDITIONS, Reproduction


def lost_section(result: Reproduction) -> str:
    """How many flights were lost under each condition, and why the first of them were."""
    text = ""
    for condition in CONDITIONS:
        for table in (result.tables[condition.key], result.quadrotor[condition.key]):
            count, flights = lost_flights(table)
            if count:
                text += (
                    f"<p><b>{count} of {len(table)} flights</b> {escape(condition.short)} were "
                    f"lost; why, of the first {len(flights)}:</p>"
                    f"<ul>{''.join(_line(flight) for flight in flights)}</ul>"
                )
    return text or "<p>None.</p>"


def _line(flight: LostFlight) -> str:
    found = "".join(f"<li>{escape(str(finding))}</li>" for finding in flight.findings)
    return (
        f"<li>{escape(flight.contender)}, {escape(flight.scenario)}, seed {flight.seed}: "
        f"{escape(flight.reason)}<ul>{found}</ul></li>"
    )
