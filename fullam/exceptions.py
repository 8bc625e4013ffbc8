"""Every error that fullam raises on purpose, each carrying its evidence.

All of them derive from `FullamError`, so one `except` separates "you asked for something
impossible" from a bug. A message says what is wrong, where, and what would be right.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

LONGEST_NAME = 200
"""More of an unknown name than this is not shown."""


class FullamError(Exception):
    """Base of all errors raised on purpose by fullam."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy by message and evidence: `args` hold what `__init__` made of its arguments.

        Without it an error raised in a worker process arrives as a TypeError.
        """
        return _rebuild, (type(self), self.args), self.__dict__


def _rebuild(cls: type[FullamError], args: tuple[Any, ...]) -> FullamError:
    """An error with these `args`, its `__init__` not called."""
    return cls.__new__(cls, *args)


class FullamWarning(UserWarning):
    """What works, but not as its caller may believe."""


class UnknownName(FullamError):
    """A name that is not registered; the message lists the known ones.

    Attributes:
        kind: What was looked up: "scenario", "controller", "vehicle", ...
        name: The name asked for.
        known: The names that exist.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        """Compose the message, with the closest known name first if one is near."""
        name = name if isinstance(name, str) else repr(name)  # what is no text is no name
        self.kind, self.name, self.known = kind, name, tuple(known)
        near = difflib.get_close_matches(name[:LONGEST_NAME], self.known, n=1)
        hint = f" Did you mean '{near[0]}'?" if near else ""
        shown = name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."
        super().__init__(f"unknown {kind} '{shown}'.{hint} Known: {', '.join(self.known)}.")


class InvalidInput(FullamError):
    """A value that cannot be used, with its place and the remedy.

    Attributes:
        where: File, object or argument that holds the value.
        field: Name of the value inside it.
        problem: What is wrong with it.
        remedy: What would be right.
    """

    def __init__(self, where: str, field: str, problem: str, remedy: str) -> None:
        """Compose "where: field: problem; remedy"."""
        self.where, self.field, self.problem, self.remedy = where, field, problem, remedy
        super().__init__(f"{where}: {field}: {problem}; {remedy}.")


class VehicleError(InvalidInput):
    """A vehicle's URDF or TOML that does not describe a physical, complete vehicle."""


class ScenarioError(InvalidInput):
    """A scenario, reference, arm motion or simulation setting that cannot be flown."""


class SettingsError(InvalidInput):
    """A setting that its owner (controller, allocator, estimator) does not accept."""


class RunFileError(InvalidInput):
    """A run file that is missing, truncated or not a run of this package."""


class CampaignError(InvalidInput):
    """A campaign, its result file or its workers that do not fit together."""


class KernelError(InvalidInput):
    """A kernel that machine code cannot be made of."""


class PluginError(InvalidInput):
    """A plugin that cannot be loaded, or is not there where it is needed."""


class NotFullyActuated(FullamError):
    """Control of more axes was asked for than the rotors can produce.

    Attributes:
        vehicle: Name of the vehicle.
        rank: Rank of the coupling matrix on the axes asked for.
        asked: Number of axes asked for.
    """

    def __init__(self, vehicle: str, rank: int, asked: int, remedy: str) -> None:
        """Compose the message with both numbers and the remedy."""
        self.vehicle, self.rank, self.asked = vehicle, rank, asked
        super().__init__(
            f"vehicle '{vehicle}': the coupling matrix has rank {rank} on the {asked} axes asked "
            f"for, so they cannot be controlled independently; {remedy}."
        )


class NonFiniteWrench(FullamError):
    """A wrench with NaN or infinity, refused before it reaches a solver.

    Attributes:
        wrench: The offending wrench, force [N] then moment [N m].
    """

    def __init__(self, wrench: Any) -> None:
        """Keep the wrench; the message shows it."""
        self.wrench = wrench
        super().__init__(
            f"wrench {[float(x) for x in wrench]} is not finite; check the measurement and the "
            "reference that the controller was given."
        )


class NonFiniteCenter(NonFiniteWrench):
    """A centre of mass with NaN or infinity: no moment about it is finite.

    Attributes:
        wrench: The wrench that was to be allocated about it, force [N] then moment [N m].
        center: The offending centre in {A} [m].
    """

    def __init__(self, wrench: Any, center: Any) -> None:
        """Keep both; the message shows the centre, which is the culprit."""
        self.wrench, self.center = wrench, center
        FullamError.__init__(
            self,
            f"centre of mass {[float(x) for x in center]} is not finite; check the arm angles of "
            "the measurement.",
        )


class AllocationFailed(FullamError):
    """A solver that stopped without an answer; it carries the problem and the status.

    Attributes:
        wrench: The wrench asked for, force [N] then moment [N m], in {A}.
        status: What the solver said.
        problem: The data of the quadratic program, enough to solve it elsewhere.
    """

    def __init__(self, wrench: Any, status: str, problem: dict[str, Any]) -> None:
        """Keep the evidence; the message names the status and the wrench."""
        self.wrench, self.status, self.problem = wrench, status, problem
        super().__init__(
            f"allocation of wrench {[float(x) for x in wrench]} failed: solver status {status}."
        )


class Diverged(FullamError):
    """A flight that left the bounds of sense; the run up to then is kept.

    Attributes:
        run: The partial run.
        reason: Which bound was left, when, by how much.
    """

    def __init__(self, run: Any, reason: str) -> None:
        """Keep the partial run; the message is the reason."""
        self.run, self.reason = run, reason
        super().__init__(
            f"the flight diverged: {reason}. What was in its way: fullam.diagnose(error.run)."
        )


class MissingDependency(FullamError):
    """An optional package that a feature needs.

    Attributes:
        feature: What was asked for.
        package: The package that is missing.
        extra: The extra of fullam that installs it.
    """

    def __init__(self, feature: str, package: str, extra: str) -> None:
        """Compose the message with the command that installs it."""
        self.feature, self.package, self.extra = feature, package, extra
        super().__init__(
            f"{feature} needs '{package}', which is not installed; "
            f"pip install 'fullam[{extra}]' brings it."
        )
