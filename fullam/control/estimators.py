"""The estimators that can be had by name: those that come with fullam, and the users' own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from fullam.checks import Checker
from fullam.control.estimator import Estimator
from fullam.control.first_order import FirstOrder
from fullam.control.kalman import Kalman
from fullam.control.kalman_bias import KalmanBias
from fullam.control.truth import Truth
from fullam.exceptions import SettingsError
from fullam.plain_values import from_plain, to_plain
from fullam.plugins import discover
from fullam.registry import Registry, check_class

EstimatorType = TypeVar("EstimatorType", bound=type[Estimator])

ESTIMATORS: Registry[type[Estimator]] = Registry(
    "estimator", {cls.name: cls for cls in (FirstOrder, Kalman, KalmanBias, Truth)}
)


def register_estimator(name: str) -> Callable[[EstimatorType], EstimatorType]:
    """Class decorator: make an estimator known under `name`.

    Raises:
        SettingsError: What it decorates is no whole `Estimator`, or its settings lack a default.
    """

    def add(cls: EstimatorType) -> EstimatorType:
        check_class(cls, Estimator, f"estimator '{name}'")
        ESTIMATORS[name] = cls
        cls.name = name
        return cls

    return add


def estimator_names() -> tuple[str, ...]:
    """Names of the registered estimators, sorted; those of installed plugins too."""
    discover()
    return tuple(sorted(ESTIMATORS))


def estimator_class(name: str) -> type[Estimator]:
    """The class registered under `name`.

    Raises:
        UnknownName: No such estimator; the message lists the known ones.
    """
    return ESTIMATORS[name]


def make_estimator_settings(name: str, changes: Mapping[str, Any] | None = None) -> Any:
    """Settings of the estimator `name`, its defaults with some of them changed.

    Raises:
        UnknownName: No such estimator.
        SettingsError: A setting that the estimator does not have (the message lists its own), or
            one of the wrong type.
    """
    check = Checker(f"estimator '{name}'", SettingsError)
    return from_plain(estimator_class(name).Settings, changes, check)


def plain_estimator_settings(name: str, settings: Any) -> dict[str, Any]:
    """Settings of the estimator `name` as JSON values; `make_estimator_settings` is the inverse.

    Raises:
        SettingsError: A value that cannot be saved; the message names the field and what can.
    """
    return to_plain(settings, Checker(f"estimator '{name}'", SettingsError))
