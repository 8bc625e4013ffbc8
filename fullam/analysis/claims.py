"""The paper's claims, as data: what is said, which figure judges it, in which scenarios.

A claim is judged by `evidence.judge` on the rows of a campaign. Three kinds of test:

- `Bound`: a quantile over seeds stays below a threshold, in the worst of the scenarios;
- `Paired`: in the same weather, one group of flights has less of a figure than another;
- `Proof`: no statistics at all; see `evidence.prove_no_tilted_hover`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

POSITION = tuple(f"position-{k}" for k in range(1, 5))
TILT = tuple(f"tilt-hover-{k}" for k in range(1, 5))
TASKS = ("task-1", "task-2")
SCENARIOS = (*POSITION, *TILT, *TASKS)
"""Every scenario of the fully actuated vehicle."""

QUADROTOR = "quadrotor-arm"

SUBJECT = "the controller judged"
"""Stands in a `Side` for the contender whose column of the report it is."""

RIVAL = "backstepping"
"""Name of the controller that the paper compares dc-PID with."""


@dataclass(frozen=True)
class Bound:
    """`quantile` of `figure` over seeds is below `threshold` in every scenario.

    Attributes:
        figure: Name in `evidence.FIGURES`.
        threshold: In `unit`.
        unit: "s", "%", "mm", "deg" or "" for a share.
        scenarios: Where.
        quantile: 0.5 is the median, 0.95 all but one flight in twenty; None a share of flights.
    """

    figure: str
    threshold: float
    unit: str
    scenarios: tuple[str, ...]
    quantile: float | None = 0.5


@dataclass(frozen=True)
class Side:
    """One side of a paired comparison: the mean over these scenarios, seed by seed.

    Attributes:
        scenarios: Where.
        contender: `SUBJECT`, or the name of a controller.
    """

    scenarios: tuple[str, ...]
    contender: str = SUBJECT


@dataclass(frozen=True)
class Paired:
    """The mean difference `more` - `less` of a figure, over seeds, is above 0.

    Attributes:
        figure: Name in `evidence.FIGURES`.
        unit: Its unit.
        more: The side that is claimed to have more of it.
        less: The side that is claimed to have less.
        tolerance: The claim is "no worse", and differences down to this are none; 0 for "better".
    """

    figure: str
    unit: str
    more: Side
    less: Side
    tolerance: float = 0.0


@dataclass(frozen=True)
class Proof:
    """Judged by linear algebra instead of flights."""


Test = Bound | Paired | Proof


@dataclass(frozen=True)
class Claim:
    """One row of the report.

    Attributes:
        key: Short name.
        says: What is claimed, in words.
        measured: What is measured for it, in words.
        test: How it is judged.
        source: Where the claim stands.
        remark: What a reader has to know before believing the verdict.
    """

    key: str
    says: str
    measured: str
    test: Test
    source: str = "paper"
    remark: str = field(default="")


_DURING_GUSTS = (
    "Noise-aware reading: 2 % of the step, but never less than twice the sensor's standard "
    "deviation, for 95 % of the time from then on."
)


def _against_rival(key: str, figure: str, unit: str, what: str, task: str) -> Claim:
    return Claim(
        f"{key}-{task}",
        f"dc-PID has less {what} than Backstepping in {task.replace('-', ' ')}",
        f"Backstepping minus it, {what}, same weather",
        Paired(figure, unit, Side((task,), RIVAL), Side((task,))),
        "section 5.3, Figs 6, 7",
    )


CLAIMS: tuple[Claim, ...] = (
    Claim(
        "settling",
        "Settles within 2 s in every arm configuration, six axes at once",
        "settling time of the slowest axis",
        Bound("settling", 2.0, "s", POSITION),
        "section 5.1, Fig. 4",
        _DURING_GUSTS,
    ),
    Claim(
        "overshoot-step",
        "Overshoot below 0.5 % (read as: of the step)",
        "largest overshoot of x, y, z, in % of the step",
        Bound("position overshoot", 0.5, "%", POSITION),
        "section 5.1, Fig. 4",
    ),
    Claim(
        "overshoot-setpoint",
        "Overshoot below 0.5 % (read as: of the set point)",
        "largest overshoot of x, y, z, in % of 10 m",
        Bound("set point overshoot", 0.5, "%", POSITION),
        "section 5.1, Fig. 4",
        "Of 10 m, 0.5 % is 50 mm: five times the sensor's standard deviation.",
    ),
    Claim(
        "tilt-settling",
        "Reaches the tilted hover within 2 s",
        "settling time of the slowest axis",
        Bound("settling", 2.0, "s", TILT),
        "section 5.2, Fig. 5",
        _DURING_GUSTS,
    ),
    Claim(
        "tilt-xy",
        "X and Y stay steady during the tilted hover",
        "largest excursion of x or y",
        Bound("xy excursion", 25.0, "mm", TILT),
        "section 5.2, Fig. 5",
        "The paper gives no number; that of Z is used.",
    ),
    Claim(
        "tilt-dip",
        "Z dips by less than 25 mm during the tilted hover",
        "largest excursion of z",
        Bound("z excursion", 25.0, "mm", TILT),
        "section 5.2, Fig. 5",
    ),
    Claim(
        "configuration-3-position",
        "Configuration 3 shakes more than the others (position)",
        "jitter above 2 Hz, configuration 3 minus the mean of 1, 2, 4",
        Paired(
            "position jitter",
            "mm",
            Side(("position-3",)),
            Side(("position-1", "position-2", "position-4")),
        ),
        "section 5.1, Fig. 4",
    ),
    Claim(
        "configuration-3-attitude",
        "Configuration 3 shakes more than the others (attitude)",
        "jitter above 2 Hz, configuration 3 minus the mean of 1, 2, 4",
        Paired(
            "attitude jitter",
            "deg",
            Side(("position-3",)),
            Side(("position-1", "position-2", "position-4")),
        ),
        "section 5.1, Fig. 4",
        "The arm stretched out is a larger inertia as well: the same noise turns it less.",
    ),
    *(
        _against_rival(key, figure, unit, what, task)
        for task in TASKS
        for key, figure, unit, what in (
            ("steady-z", "z steady error", "mm", "steady error of Z"),
            ("steady-phi", "phi steady error", "deg", "steady error of phi"),
            ("steady-psi", "psi steady error", "deg", "steady error of psi"),
            ("jitter", "attitude jitter", "deg", "attitude jitter"),
        )
    ),
    Claim(
        "no-degradation-position",
        "dc-PID does not degrade from task 1 to task 2 (position)",
        "RMS position error, task 1 minus task 2",
        Paired("position RMS", "mm", Side(("task-1",)), Side(("task-2",)), tolerance=1.0),
        "section 5.3",
        "A tenth of the sensor's standard deviation (1 mm) counts as no difference.",
    ),
    Claim(
        "no-degradation-attitude",
        "dc-PID does not degrade from task 1 to task 2 (attitude)",
        "RMS attitude error, task 1 minus task 2",
        Paired("attitude RMS", "deg", Side(("task-1",)), Side(("task-2",)), tolerance=0.1),
        "section 5.3",
        "A tenth of the sensor's standard deviation (0.1 deg) counts as no difference.",
    ),
    Claim(
        "quadrotor",
        "A conventional quadrotor keeps its attitude while its arm moves",
        "RMS attitude error over the steady part",
        Bound("attitude RMS", 3.0, "deg", (QUADROTOR,)),
        "section 6, Fig. 9",
        "The paper gives no number; 3 deg is its bound on the sensor's noise.",
    ),
    Claim(
        "no-tilted-hover",
        "A conventional platform cannot hold a tilted hover",
        "least force error of any allocation, in % of the weight",
        Proof(),
        "section 1",
    ),
)
"""The paper's claims, in its order."""

TARGETS: tuple[Claim, ...] = (
    Claim(
        "target-settling",
        "95 of 100 flights settle within 2 s",
        "95th percentile of the settling time",
        Bound("settling", 2.0, "s", SCENARIOS[:8], 0.95),
        "this project",
        _DURING_GUSTS,
    ),
    Claim(
        "target-overshoot",
        "Median overshoot below 0.5 % of the step",
        "largest overshoot of x, y, z",
        Bound("position overshoot", 0.5, "%", POSITION),
        "this project",
    ),
    Claim(
        "target-dip",
        "In 95 of 100 tilted hovers Z dips by less than 25 mm",
        "95th percentile of the largest excursion of z",
        Bound("z excursion", 25.0, "mm", TILT, 0.95),
        "this project",
    ),
    Claim(
        "target-divergence",
        "No flight diverges",
        "share of diverged flights, Wilson interval",
        Bound("diverged", 0.05, "", SCENARIOS, None),
        "this project",
        "Holds only if none did.",
    ),
    Claim(
        "target-z",
        "Tasks 1 and 2: RMS of z at most half of the recorded dc-PID's best (5.3 mm)",
        "RMS of z",
        Bound("z RMS", 5.27, "mm", TASKS),
        "this project",
    ),
    Claim(
        "target-psi",
        "Tasks 1 and 2: RMS of psi at most half of the recorded dc-PID's (0.48 deg)",
        "RMS of psi",
        Bound("psi RMS", 0.48, "deg", TASKS),
        "this project",
    ),
)
"""What this project asks of dc-PID+ with the Kalman filter, beyond the paper."""
