"""Settings of a law in a file: what `fullam tune` writes and every verb that flies reads.

    controller = "dc-pid"            # whose settings they are; may be left out
    estimator = "first-order"        # what they are made for; may be left out

    [settings]                       # those that differ from the defaults
    position_gains = [21.7, 19.9, 5.5]

    [tuning]                         # where they come from; may be left out
    vehicles = { hextilt = "5d0f6ab3c1e2f498" }    # on what they were tuned: name, digest

`fullam.load_settings` reads one, for `simulate(settings=...)`. The law flies with the estimator of
the file unless another one is asked for.
"""

from __future__ import annotations

import numbers
from collections.abc import Iterator, Mapping
from dataclasses import Field, dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fullam.checks import Checker, read_toml, shown
from fullam.exceptions import SettingsError
from fullam.model.vehicle import Vehicle
from fullam.plain_values import from_plain


@dataclass(frozen=True, eq=False)
class SettingsFile(Mapping[str, Any]):
    """What a settings file says: a mapping of the settings that differ from the defaults.

    Attributes:
        path: The file.
        changes: The settings.
        controller: Whose they are; None if the file does not say.
        estimator: The estimator that they are made for; None if the file does not say.
        vehicles: Name -> digest of the vehicles that they were tuned on; empty if unknown.
    """

    path: str
    changes: Mapping[str, Any]
    controller: str | None = None
    estimator: str | None = None
    vehicles: Mapping[str, str] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Any:
        """One setting."""
        return self.changes[name]

    def __iter__(self) -> Iterator[str]:
        """Names of the settings."""
        return iter(self.changes)

    def __len__(self) -> int:
        """Number of settings."""
        return len(self.changes)

    def changed(self, changes: Mapping[str, Any]) -> SettingsFile:
        """The same, with some settings more or otherwise."""
        return replace(self, changes={**self.changes, **changes})

    def settings_of(self, controller: str, cls: type) -> Any:
        """The settings of a controller, complete.

        Args:
            controller: Name of the controller that flies.
            cls: The class of its settings.

        Raises:
            SettingsError: They are another controller's; one is unknown or of the wrong type.
        """
        if self.controller not in (None, controller):
            raise SettingsError(
                self.path,
                "controller",
                f"is '{self.controller}', and '{controller}' is to fly",
                f"fly '{self.controller}', or give settings of '{controller}'",
            )
        check = Checker(f"{self.path}, settings of '{controller}'", SettingsError)
        known = {f.name: f for f in (fields(cls) if is_dataclass(cls) else ())}
        check.known(self.changes, tuple(known), "setting")
        values = {name: _fitting(check, known[name], v) for name, v in self.changes.items()}
        try:
            return from_plain(cls, values, check)
        except SettingsError as error:
            if error.where == check.where:
                raise
            where = f"{self.path}: {error.where}"
            raise SettingsError(where, error.field, error.problem, error.remedy) from error

    def differences(self, vehicle: Vehicle, estimator: str | None) -> list[str]:
        """In what a flight differs from what these settings were made for, in words.

        Args:
            vehicle: The nominal vehicle that flies.
            estimator: The estimator that was asked for; None if none was.
        """
        found = []
        if self.vehicles and vehicle.name not in self.vehicles:
            tuned = ", ".join(f"'{name}'" for name in self.vehicles)
            found.append(f"{self.path} was tuned on {tuned}, and '{vehicle.name}' flies with it")
        elif self.vehicles and self.vehicles[vehicle.name] not in ("", vehicle.digest()):
            found.append(f"'{vehicle.name}' is not what it was when {self.path} was tuned on it")
        if self.estimator is not None and estimator not in (None, self.estimator):
            found.append(
                f"{self.path} is made for the estimator '{self.estimator}', and '{estimator}' flies"
            )
        return found


def _fitting(check: Checker, setting: Field[Any], value: Any) -> Any:
    """A value as its default is: a float, a tuple, a text; refused if it cannot become that."""
    default, factory = setting.default, setting.default_factory
    if callable(factory):
        default = factory()
    if isinstance(default, bool):
        return check.flag(setting.name, value)
    if isinstance(default, str):
        return check.text(setting.name, value)
    if isinstance(value, list):
        value = tuple(value)
    if _is_number(default):
        if not _is_number(value):
            raise check.refuse(setting.name, f"is {shown(value)}", "give a number")
        return check.number(setting.name, value) if isinstance(default, float) else value
    if isinstance(default, tuple) and default and all(map(_is_number, default)):
        any_length = "..." in str(setting.type)
        good = isinstance(value, tuple) and all(map(_is_number, value))
        if not good or not (any_length or len(value) == len(default)):
            many = "numbers" if any_length else f"{len(default)} numbers"
            raise check.refuse(setting.name, f"is {shown(value)}", f"give {many}")
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool | np.bool_)


def read_settings(path: str | Path) -> SettingsFile:
    """A settings file as it stands; `fullam.load_settings` also asks the law whether it fits.

    Raises:
        SettingsError: No such file, no TOML, or something in it that is not understood.
    """
    path = Checker("settings", SettingsError).path("path", path)
    check = Checker(str(path), SettingsError)
    data = read_toml(path, check)
    check.known(data, ("controller", "estimator", "settings", "tuning"), "part")
    if "settings" not in data:
        raise check.refuse("[settings]", "is missing", "put the settings into a table of that name")
    names = {
        name: check.text(name, data[name]) for name in ("controller", "estimator") if name in data
    }
    tuning = check.table("tuning", data.get("tuning", {}))
    vehicles = check.table("tuning.vehicles", tuning.get("vehicles", {}))
    for name, digest in vehicles.items():
        check.text(f"tuning.vehicles.{name}", digest, prose=True)
    changes = check.table("settings", data["settings"])
    return SettingsFile(str(path), changes, vehicles=vehicles, **names)
