"""The estimators that can be had by name: those that come with fullam, and the users' own."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from fullam.control.estimator import Estimator
from fullam.control.first_order import FirstOrder
from fullam.control.kalman import Kalman
from fullam.control.truth import Truth
from fullam.registry import Registry

EstimatorType = TypeVar("EstimatorType", bound=type[Estimator])

_REGISTRY: Registry[type[Estimator]] = Registry(
    "estimator", {cls.name: cls for cls in (FirstOrder, Kalman, Truth)}
)


def register_estimator(name: str) -> Callable[[EstimatorType], EstimatorType]:
    """Class decorator: make an estimator known under `name`."""

    def add(cls: EstimatorType) -> EstimatorType:
        cls.name = name
        _REGISTRY[name] = cls
        return cls

    return add


def estimator_names() -> tuple[str, ...]:
    """Names of the registered estimators, sorted."""
    return tuple(sorted(_REGISTRY))


def estimator_class(name: str) -> type[Estimator]:
    """The class registered under `name`.

    Raises:
        UnknownName: No such estimator; the message lists the known ones.
    """
    return _REGISTRY[name]
