"""What the tool did to the world: how long, how hard, and whether the law knew of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fullam.analysis.metrics import Metrics
from fullam.control.admittance import Admittance
from fullam.control.controllers import CONTROLLERS
from fullam.control.hybrid_force import HybridForce
from fullam.simulation.record.run import Run

GAP = 0.1
"""A contact that is lost for less than this is one contact [s]."""


@dataclass(frozen=True)
class Contact:
    """Force of the world on the tool over a flight.

    Attributes:
        first: When it touched first [s].
        time: How long it touched [s].
        share: Of the time from the first touch on.
        mean: Size of the force while it touched [N].
        largest: Its largest size [N].
        touches: How often it touched anew, gaps below 0.1 s left out.
    """

    first: float
    time: float
    share: float
    mean: float
    largest: float
    touches: int

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return asdict(self)

    def __str__(self) -> str:
        """In a line."""
        return (
            f"touched from {self.first:.2f} s on for {self.time:.2f} s ({100 * self.share:.0f} %), "
            f"{self.mean:.2f} N in the mean, {self.largest:.2f} N at most"
        )


def contact_of(run: Run) -> Contact | None:
    """The contact of a flight; None if it touched nothing, or nothing can be touched."""
    forces = run.columns.get("contact_force")
    if forces is None or len(run) < 2:
        return None
    size = np.linalg.norm(forces, axis=1)
    touching = np.flatnonzero(size > 0.0)
    if not touching.size:
        return None
    period = float(run.t[1] - run.t[0])
    gaps = np.diff(touching) * period > GAP
    return Contact(
        first=float(run.t[touching[0]]),
        time=float(touching.size * period),
        share=float(touching.size / (len(run) - touching[0])),
        mean=float(size[touching].mean()),
        largest=float(size.max()),
        touches=1 + int(gaps.sum()),
    )


def pushed_axes(run: Run) -> tuple[str, ...]:
    """Position axes that the law gave up to push along them; none if it does not push, or missed.

    An axis counts if the law's normal has more than a tenth of its length along it.
    """
    law = CONTROLLERS.get(run.controller)
    if law is None or not law.touches or contact_of(run) is None:
        return ()
    n = np.abs(np.asarray(run.settings["normal"], dtype=float))
    along = n > 0.1 * np.linalg.norm(n)
    return tuple(name for name, pushed in zip("xyz", along, strict=True) if pushed)


def unsettled_axes(run: Run, metrics: Metrics) -> tuple[str, ...]:
    """Axes that did not settle although the law was to hold them."""
    late = (name for name, axis in metrics.axes.items() if axis.settling_time_s is None)
    return tuple(name for name in late if name not in pushed_axes(run))


def contact_warning(run: Run) -> str | None:
    """That a law touched something without knowing of contacts, in a line; else None.

    What a scenario is made for is no accident.
    """
    found = contact_of(run)
    law = CONTROLLERS.get(run.controller)
    meant = run.controller == run.scenario.controller
    if found is None or law is None or law.touches or meant:
        return None
    return (
        f"{run.controller} {found}; it holds its position against what it touches and winds up: "
        f"{HybridForce.name} and {Admittance.name} push with a force (--set force=3 "
        "--set normal=[1,0,0])"
    )
