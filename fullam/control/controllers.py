"""The controllers by name: those that come with fullam, and those that users `register`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from fullam.checks import Checker
from fullam.control.backstepping import Backstepping
from fullam.control.computed_wrench import ComputedWrench
from fullam.control.controller import ALL_AXES, Controller
from fullam.control.dc_pid import DcPid
from fullam.control.dc_pid_plus import DcPidPlus
from fullam.control.hybrid_force import HybridForce
from fullam.control.pid import Pid
from fullam.exceptions import SettingsError
from fullam.model.vehicle import Vehicle
from fullam.registry import Registry

LAWS: tuple[type[Controller], ...] = (
    Pid,
    DcPid,
    DcPidPlus,
    HybridForce,
    Backstepping,
    ComputedWrench,
)
"""Those that come with fullam."""

CONTROLLERS: Registry[type[Controller]] = Registry("controller", {law.name: law for law in LAWS})
"""All of them by name."""

ControllerType = TypeVar("ControllerType", bound=type[Controller])


def register(name: str) -> Callable[[ControllerType], ControllerType]:
    """Class decorator: make a controller known under `name`."""

    def add(cls: ControllerType) -> ControllerType:
        cls.name = name
        CONTROLLERS[name] = cls
        return cls

    return add


def controller_names() -> tuple[str, ...]:
    """Names of the registered controllers, sorted."""
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


def make_settings(name: str, changes: Mapping[str, Any] | None = None) -> Any:
    """Settings of the controller `name`, its defaults with some of them changed.

    Raises:
        UnknownName: No such controller.
        SettingsError: A setting that the controller does not have (the message lists its own), or
            one of the wrong type.
    """
    check = Checker(f"controller '{name}'", SettingsError)
    return check.settings(controller_class(name).Settings, changes)


def make_controller(
    name: str,
    vehicle: Vehicle,
    period: float = 0.01,
    axes: tuple[bool, ...] = ALL_AXES,
    **settings: Any,
) -> Controller:
    """Build the controller `name` for a nominal vehicle; keywords change its settings."""
    return controller_class(name)(vehicle, make_settings(name, settings), period, axes)
