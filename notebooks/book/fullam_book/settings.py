"""Settings of every controller and estimator, with defaults and units."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from fullam.control.controllers import LAWS
from fullam.control.estimator import Estimator
from fullam.control.first_order import FirstOrder
from fullam.control.kalman import Kalman
from fullam.control.truth import Truth
from fullam_book.tables import inline, markdown, of_dataclass, summary

OWN: tuple[type[Estimator], ...] = (FirstOrder, Kalman, Truth)
"""The estimators that come with fullam."""


def pages() -> dict[str, str]:
    """One page for controllers, one for estimators."""
    return {
        "reference/controllers": page(
            "Controllers",
            "A controller is told where the platform is and where it should be, and answers with a "
            "wrench. `fullam run SCENARIO --controller NAME --set KEY=VALUE` changes a setting, as "
            '`fullam.simulate(SCENARIO, NAME, settings={"KEY": VALUE})` does. Each flies with the '
            "estimator that it is made for unless another one is asked for.",
            LAWS,
        ),
        "reference/estimators": page(
            "Estimators",
            "An estimator makes the platform's pose and velocity of what the sensors give. "
            "`fullam run SCENARIO --estimator NAME` chooses one; "
            '`simulation={"estimator": NAME, "estimator_settings": {...}}` changes its settings.',
            OWN,
        ),
    }


def page(title: str, lead: str, classes: Iterable[type[Any]]) -> str:
    """A page with a section for each class."""
    return f"# {title}\n\n{lead}\n\n" + "\n".join(section(cls) for cls in classes)


def section(cls: type[Any]) -> str:
    """Name, what it is, and its settings."""
    lines = [f"## `{cls.name}`", f"{summary(cls)} {home(cls)}"]
    if issubclass(cls, Estimator):
        lines.append("Reads gyroscope and accelerometer." if cls.needs_inertial else "")
    else:
        lines.append(f"Made for the estimator `{cls.estimator}`.")
    rows = of_dataclass(cls.Settings)
    if rows:
        own = inline(" ".join((cls.Settings.__doc__ or "").split("\n\n")[0].split()))
        lines += [own, markdown(rows, "setting")]
    else:
        lines.append("It has no settings.")
    return "\n\n".join(line for line in lines if line) + "\n"


def home(cls: type[Any]) -> str:
    """A link to the class in the API."""
    return f"See {{py:class}}`{cls.__module__}.{cls.__qualname__}`."
