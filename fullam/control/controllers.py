"""The controllers by name: those that come with fullam, and those that users `register`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from fullam.checks import Checker, positive, shown
from fullam.control.admittance import Admittance
from fullam.control.backstepping import Backstepping
from fullam.control.computed_wrench import ComputedWrench
from fullam.control.controller import ALL_AXES, Controller
from fullam.control.dc_pid import DcPid
from fullam.control.dc_pid_plus import DcPidPlus
from fullam.control.estimators import estimator_class
from fullam.control.hybrid_force import HybridForce
from fullam.control.pid import Pid
from fullam.control.settings_file import SettingsFile, read_settings
from fullam.exceptions import SettingsError
from fullam.model.vehicle import Vehicle
from fullam.plain_values import from_plain, to_plain
from fullam.plugins import discover
from fullam.registry import Registry, check_class, made

LAWS: tuple[type[Controller], ...] = (
    Pid,
    DcPid,
    DcPidPlus,
    HybridForce,
    Admittance,
    Backstepping,
    ComputedWrench,
)
"""Those that come with fullam."""

CONTROLLERS: Registry[type[Controller]] = Registry("controller", {law.name: law for law in LAWS})
"""All of them by name."""

ControllerType = TypeVar("ControllerType", bound=type[Controller])


def register(name: str) -> Callable[[ControllerType], ControllerType]:
    """Class decorator: make a controller known under `name`.

    Raises:
        SettingsError: What it decorates is no whole `Controller`, or its settings lack a default.
    """

    def add(cls: ControllerType) -> ControllerType:
        check_class(cls, Controller, f"controller '{name}'")
        Checker(f"controller '{name}'", SettingsError).text("estimator", cls.estimator)
        CONTROLLERS[name] = cls
        cls.name = name
        return cls

    return add


def controller_names() -> tuple[str, ...]:
    """Names of the registered controllers, sorted; those of installed plugins too."""
    discover()
    return tuple(sorted(CONTROLLERS))


def controller_class(name: str) -> type[Controller]:
    """The class registered under `name`.

    Raises:
        UnknownName: No such controller; the message lists the known ones.
    """
    return CONTROLLERS[name]


def recommended_estimator(name: str) -> str:
    """Name of the estimator that the controller `name` is made for.

    Raises:
        UnknownName: No such controller; the message lists the known ones.
    """
    return controller_class(name).estimator


def suits(name: str, estimator: str) -> bool:
    """Whether the controller `name` is made for an estimator, or for one that it stands for.

    Raises:
        UnknownName: No such controller, or estimator.
    """
    return recommended_estimator(name) in (estimator, estimator_class(estimator).stands_for)


def make_settings(name: str, changes: Mapping[str, Any] | None = None) -> Any:
    """Settings of the controller `name`, its defaults with some of them changed.

    Raises:
        UnknownName: No such controller.
        SettingsError: A setting that the controller does not have (the message lists its own), or
            one of the wrong type; or a file with the settings of another controller.
    """
    if isinstance(changes, SettingsFile):
        return changes.settings_of(name, controller_class(name).Settings)
    check = Checker(f"controller '{name}'", SettingsError)
    return from_plain(controller_class(name).Settings, changes, check)


def plain_settings(name: str, settings: Any) -> dict[str, Any]:
    """Settings of the controller `name` as JSON values; `make_settings` is the inverse.

    Raises:
        SettingsError: A value that cannot be saved; the message names the field and what can.
    """
    return to_plain(settings, Checker(f"controller '{name}'", SettingsError))


def load_settings(path: str | Path) -> SettingsFile:
    """Settings that `fullam tune` wrote, or anybody else, for `simulate(settings=...)`.

    `fullam.control.settings_file` says what stands in such a file.

    Raises:
        SettingsError: No such file; a controller that is not registered, a setting that it does not
            have, or one of the wrong type.
    """
    file = read_settings(path)
    if file.controller is not None:
        if file.controller not in (known := controller_names()):
            raise SettingsError(
                file.path,
                "controller",
                f"'{file.controller}' is not known",
                f"bring your own along (--plugin FILE.py); known are {', '.join(known)}",
            )
        make_settings(file.controller, file)
    return file


def make_controller(
    name: str,
    vehicle: Vehicle,
    period: float = 0.01,
    axes: tuple[bool, ...] = ALL_AXES,
    **settings: Any,
) -> Controller:
    """Build the controller `name` for a nominal vehicle; keywords change its settings.

    Raises:
        UnknownName: No such controller.
        SettingsError: A setting that it does not have, no vehicle, or a period that is none.
    """
    check = Checker(f"controller {shown(name)}", SettingsError)
    check.instance("vehicle", vehicle, Vehicle)
    check.number("period", period, positive(1e3, "s"))
    return made(controller_class(name), vehicle, make_settings(name, settings), period, axes)
