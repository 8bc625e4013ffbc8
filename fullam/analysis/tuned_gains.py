"""The committed tuned settings: one TOML a contender, found by `fullam tune`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fullam.control.controllers import recommended_estimator
from fullam.control.settings_file import read_settings
from fullam.exceptions import UnknownName

TUNED = Path(__file__).parent / "tuned"
"""Their folder."""


def contender_name(controller: str, estimator: str | None) -> str:
    """CONTROLLER with the estimator that it is made for, else CONTROLLER@ESTIMATOR."""
    own = recommended_estimator(controller)
    return controller if estimator in (None, own) else f"{controller}@{estimator}"


def tuned_names() -> tuple[str, ...]:
    """Contenders whose tuned settings come with the package."""
    return tuple(sorted(path.stem for path in TUNED.glob("*.toml")))


def tuned_settings(controller: str, estimator: str | None = None) -> dict[str, Any]:
    """The committed tuned settings of a controller, for the estimator that it flies with.

    Raises:
        UnknownName: There are none; the message lists those that there are.
    """
    name = contender_name(controller, estimator)
    path = TUNED / f"{name}.toml"
    if not path.is_file():
        raise UnknownName("tuned controller", name, tuned_names())
    return dict(read_settings(path))
