"""What a hand may do to a flight, as data: checked where it comes in, kept in the record.

An intervention has a kind, values of that kind, and the control period before which it happens.
The interventions of a flight are its *script*; with the script, a record flies again bit for bit.
They come from Python, from a page, or from a file, so every value is checked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fullam.checks import Checker, positive, shown, within
from fullam.control.controllers import make_settings, plain_settings
from fullam.control.estimators import make_estimator_settings, plain_estimator_settings
from fullam.exceptions import InvalidInput
from fullam.simulation.hands.force import POINTS
from fullam.simulation.settings import MOST_TICKS
from fullam.simulation.weather import Weather
from fullam.simulation.weather import weather as named_weather

FAR = within(1e4, "m")
STRONG, TWISTED = within(1e3, "N"), within(1e3, "N m")
LONGEST_PUSH = positive(60.0, "s")
TURNED = within(1e3, "rad or m")
MOST_INTERVENTIONS = 500_000
"""Longer scripts are not read: two hours of a hand that never rests."""

Values = dict[str, Any]


@dataclass(frozen=True)
class Intervention:
    """One thing that a hand did.

    Attributes:
        period: The control period before which it happened.
        kind: One of `KINDS`.
        values: As `KINDS[kind]` returns them: JSON values.
    """

    period: int
    kind: str
    values: Values

    def to_dict(self) -> Values:
        """JSON values."""
        return {"period": self.period, "kind": self.kind, **self.values}


def _target(check: Checker, values: Values) -> Values:
    attitude = np.array(check.vector("attitude", values.get("attitude"), 4, within(2.0)))
    length = float(np.linalg.norm(attitude))
    if not length > 0.5:
        raise check.refuse("attitude", f"is {shown(attitude.tolist())}", "give a unit quaternion")
    if abs(length - 1.0) > 1e-12:  # a record's own shall come back to the last bit
        attitude = attitude / length
    position = check.vector("position", values.get("position"), 3, FAR)
    return {"position": list(position), "attitude": attitude.tolist()}


def _push(check: Checker, values: Values) -> Values:
    return {
        "force": list(check.vector("force", values.get("force"), 3, STRONG)),
        "moment": list(check.vector("moment", values.get("moment", (0.0, 0.0, 0.0)), 3, TWISTED)),
        "at": _point(check, values),
        "duration": check.number("duration", values.get("duration"), LONGEST_PUSH),
    }


def _pull(check: Checker, values: Values) -> Values:
    hand = check.vector("hand", values.get("hand"), 3, FAR)
    return {"hand": list(hand), "at": _point(check, values)}


def _point(check: Checker, values: Values) -> str:
    return _choice(check, "at", values.get("at", "tool"), POINTS)


def _choice(check: Checker, field: str, value: Any, known: tuple[str, ...]) -> str:
    if not isinstance(value, str) or value not in known:
        raise check.refuse(field, f"is {shown(value)}", f"give one of {', '.join(known)}")
    return value


def _arm(check: Checker, values: Values) -> Values:
    return {"positions": list(check.vector("positions", values.get("positions"), None, TURNED))}


def _named(
    make: Callable[[str, Values], Any], plain: Callable[[str, Any], Values]
) -> Callable[[Checker, Values], Values]:
    def read(check: Checker, values: Values) -> Values:
        name = check.text("name", values.get("name"))
        settings = check.table("settings", values.get("settings") or {})
        return {"name": name, "settings": plain(name, make(name, settings))}

    return read


def _weather(check: Checker, values: Values) -> Values:
    given = values.get("weather")
    if isinstance(given, str):
        given = named_weather(given).to_dict()
    elif isinstance(given, Weather):
        given = given.to_dict()
    return {"weather": Weather.from_dict(check.table("weather", given)).to_dict()}


def _rotor(check: Checker, values: Values) -> Values:
    return {
        "index": check.whole("index", values.get("index"), 0, 1000),
        "fails": check.flag("fails", values.get("fails", True)),
        "known": check.flag("known", values.get("known", False)),
    }


KINDS: Mapping[str, Callable[[Checker, Values], Values]] = {
    "target": _target,
    "push": _push,
    "pull": _pull,
    "release": lambda check, values: {},
    "arm": _arm,
    "controller": _named(make_settings, plain_settings),
    "estimator": _named(make_estimator_settings, plain_estimator_settings),
    "weather": _weather,
    "rotor": _rotor,
}
"""What can be done; each checks its values and gives them back as JSON values.

    target      goal of the platform: `position` [m], `attitude` (quaternion xyzw)
    push        `force` [N] and `moment` [N m] in world axes, `at` "platform" or "tool",
                for `duration` [s]
    pull        a spring from there to the `hand` [m], until another pull or a release
    release     let go of the spring; pushes end by themselves
    arm         goal of the joints: `positions` [rad or m]
    controller  another law: `name`, `settings` (a mapping of what differs from the defaults)
    estimator   another estimator, in the same way
    weather     another `weather`, a name or its fields; the true vehicle stays
    rotor       `fails` or works again: `index` from 0, `known` to the allocation or not
"""


def intervention(period: int, kind: Any, values: Mapping[str, Any]) -> Intervention:
    """An intervention whose values are checked.

    Raises:
        InvalidInput: No such kind, or values that it does not take.
        UnknownName: No such controller, estimator or weather.
    """
    check = Checker("intervention", InvalidInput)
    kind = _choice(check, "kind", kind, tuple(KINDS))
    check = Checker(f"intervention '{kind}'", InvalidInput)
    return Intervention(period, kind, KINDS[kind](check, dict(values)))


def read_script(data: Any) -> list[Intervention]:
    """The interventions of a record, in order.

    Raises:
        InvalidInput: They are none, or not in the order of their periods.
    """
    check = Checker("script", InvalidInput)
    if not isinstance(data, list) or len(data) > MOST_INTERVENTIONS:
        raise check.refuse("interventions", f"are {shown(data)}", "give a list of tables")
    found: list[Intervention] = []
    for entry in data:
        values = check.table("intervention", entry)
        least = found[-1].period if found else 0
        period = check.whole("period", values.pop("period", None), least, MOST_TICKS)
        found.append(intervention(period, values.pop("kind", None), values))
    return found
