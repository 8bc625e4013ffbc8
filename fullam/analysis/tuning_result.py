"""What a tuning found: the settings, and where they come from, as a file that every verb reads."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fullam.analysis.tuned_gains import contender_name
from fullam.analysis.tuning_flights import TuningFlights
from fullam.files import atomic_path
from fullam.model.writing import toml_text
from fullam.ownership import owner_of
from fullam.version import __version__


@dataclass(frozen=True)
class Costs:
    """Mean costs over some flights.

    Attributes:
        before: Of the settings that the search started from.
        after: Of its result.
    """

    before: float
    after: float

    def __str__(self) -> str:
        """As a line shows it."""
        return f"{self.before:.3f} -> {self.after:.3f}"

    def to_dict(self) -> dict[str, float]:
        """To four decimals."""
        return {"before": round(self.before, 4), "after": round(self.after, 4)}


@dataclass(frozen=True)
class Tuning:
    """What a tuning found.

    Attributes:
        controller: Name of the controller.
        estimator: The estimator that it was tuned with.
        start: The tuned fields before.
        settings: The tuned fields, with their values.
        kept: Fields that are not tuned and differ from the defaults, as they were flown.
        cost: On the training flights.
        evaluations: Candidates flown.
        budget: Candidates allowed.
        seed: Seed of the optimiser.
        flights: What was flown.
        vehicles: Name -> digest of the vehicles that flew.
        origin: The file that the search started from; None for the defaults.
        validation: On the validation flights; None while the search goes on.
        unsafe: Which loop of the result has no margin; None if all have one, or if it is not known.
    """

    controller: str
    estimator: str
    start: dict[str, Any]
    settings: dict[str, Any]
    kept: dict[str, Any]
    cost: Costs
    evaluations: int
    budget: int
    seed: int
    flights: TuningFlights
    vehicles: Mapping[str, str]
    origin: str | None = None
    validation: Costs | None = None
    unsafe: str | None = None

    @property
    def name(self) -> str:
        """The contender: its argument of `fullam tune`."""
        return contender_name(self.controller, self.estimator)

    @property
    def improved(self) -> bool:
        """Whether anything better than the start was found."""
        return self.cost.after < self.cost.before

    @property
    def remark(self) -> str | None:
        """What whoever flies the result should know; None if all is well."""
        if self.unsafe is not None:
            return f"{self.unsafe}; nothing was found that has one"
        if not self.improved:
            return (
                f"nothing better than the start was found in {self.evaluations} candidates; give "
                "a larger --budget, another --seed, or other ranges where the law declares them"
            )
        if self.validation is not None and self.validation.after >= self.validation.before:
            return (
                "better on the training flights alone: what was found is luck; train on more "
                "--seeds or scenarios"
            )
        return None

    @property
    def command(self) -> str:
        """The command that finds it again."""
        words = ["fullam", "tune", self.name, *self.flights.arguments()]
        plugin = owner_of("controller", self.controller)
        if plugin is not None:
            words += ["--plugin", plugin.name]
        if self.origin is not None:
            words += ["--settings", self.origin]
        return shlex.join([*words, "--budget", str(self.budget), "--seed", str(self.seed)])

    def to_dict(self) -> dict[str, Any]:
        """What stands in the file, and the remark, as JSON values."""
        return {**self._document(), "improved": self.improved, "remark": self.remark}

    def to_toml(self) -> str:
        """The result as a TOML document; see `fullam.control.settings_file`."""
        return toml_text(self._document())

    def _document(self) -> dict[str, Any]:
        tuning: dict[str, Any] = {
            "command": self.command,
            "fullam": __version__,
            "scenarios": [s.name for s in self.flights.flown],
            "vehicles": self.vehicles,
            "seeds": list(self.flights.seeds),
            "budget": self.budget,
            "evaluations": self.evaluations,
            "cost": self.cost.to_dict(),
        }
        if self.validation is not None:
            tuning["validation_seeds"] = list(self.flights.validation_seeds)
            tuning["validation"] = self.validation.to_dict()
        head = {"controller": self.controller, "estimator": self.estimator}
        return {**head, "settings": {**self.kept, **self.settings}, "tuning": tuning}

    def save(self, path: str | Path) -> None:
        """Write the TOML document, atomically."""
        with atomic_path(path) as temporary:
            temporary.write_text(self.to_toml(), encoding="utf-8")
