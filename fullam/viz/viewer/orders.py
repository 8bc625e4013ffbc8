"""What pages ask of a live flight, and what they are told of it.

A page sends small JSON tables. Those with "do" steer the clock,

    play, pause, step, speed (value), scrub (time), restart (seed), leave

and those with "act" are interventions (`simulation.hands.interventions`), to which "settings"
of the present law and "pull"s are added. They are put in a queue by the server's thread and
obeyed by the flight's; an order that makes no sense is answered by a note and changes nothing.
"""

from __future__ import annotations

import queue
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fullam.checks import Checker, Range
from fullam.control.controllers import controller_names, plain_settings
from fullam.control.dc_pid import COMPENSATIONS
from fullam.control.estimators import estimator_names
from fullam.exceptions import FullamError, InvalidInput
from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.weather import WEATHERS, Weather

if TYPE_CHECKING:
    from fullam.viz.viewer.live import LiveFlight

CHECK = Checker("page", InvalidInput)
SPEEDS = Range(0.1, 4.0, "times")
MOST_WAITING = 2000
"""Orders in the queue; what comes beyond them is forgotten."""


@dataclass
class Transport:
    """The tape deck.

    Attributes:
        playing: Whether it flies on by the clock.
        speed: Seconds of flight in a second.
        past: Period of the past that is looked at; None for now.
        quit: Whether all shall end.
    """

    playing: bool = True
    speed: float = 1.0
    past: int | None = None
    quit: bool = False


class Orders:
    """The queue of a live flight, and who empties it."""

    def __init__(self, live: LiveFlight) -> None:
        """Bind the flight."""
        self._live = live
        self._waiting: queue.Queue[dict[str, Any]] = queue.Queue(MOST_WAITING)
        self._holder: Any = None

    def hear(self, message: dict[str, Any], who: Any = None) -> None:
        """Put an order in the queue; from any thread, without waiting."""
        try:
            self._waiting.put_nowait({**message, "who": who})
        except queue.Full:
            return

    def obey(self, server: Any, pace: Any) -> None:
        """Do what is in the queue; in the flight's thread, between two control periods."""
        told = False
        while not self._waiting.empty():
            order = self._waiting.get_nowait()
            try:
                told = self._obey(order, server, pace) or told
            except FullamError as error:
                server.tell({"note": str(error)})
        if told:
            server.tell(self.status())

    def _obey(self, order: dict[str, Any], server: Any, pace: Any) -> bool:
        """Do one thing; whether pages have to be told at once."""
        if "act" in order:
            return self._act(order, server)
        transport, flight, what = self._live.transport, self._live.flight, order.get("do")
        if what == "leave":
            return self._let_go(order["who"])
        if what in ("play", "step"):
            self._back_to_present(server)
            transport.playing = what == "play"
            if what == "step":
                flight.step()
            pace.shown = -1
        elif what == "pause":
            transport.playing = False
        elif what == "speed":
            transport.speed = CHECK.number("speed", order.get("value"), SPEEDS)
        elif what == "scrub":
            time = CHECK.number("time", order.get("time"), Range(0.0, flight.time, "s"))
            transport.playing = False
            transport.past = round(time / flight.plan.simulation.control_period)
            pace.shown = -1
        elif what == "restart":
            plan = flight.plan.with_seed(CHECK.whole("seed", order.get("seed")))
            transport.past = None
            self._live.take(type(flight)(plan))
            self._live.show(server, keep_camera=True)
        else:
            raise CHECK.refuse("do", f"is {what!r}", "give an order that is known")
        pace.rebase()
        return True

    def _back_to_present(self, server: Any) -> None:
        """From a moment of the past one flies on otherwise: what came after it is forgotten."""
        transport, flight = self._live.transport, self._live.flight
        if transport.past is not None:
            past, transport.past = transport.past, None
            if past < flight.period:
                flight.rewind(past * flight.plan.simulation.control_period)
                server.forget_after(flight.time)

    def _act(self, order: dict[str, Any], server: Any) -> bool:
        kind, flight = order["act"], self._live.flight
        self._back_to_present(server)
        values = {k: v for k, v in order.items() if k not in ("act", "who")}
        if kind == "pull":
            self._holder = order["who"]
        if kind == "compensation":
            law: Any = flight.flight.controller
            settings = plain_settings(law.name, law.settings) | {"compensation": values.get("name")}
            kind, values = "controller", {"name": law.name, "settings": settings}
        if kind == "typed arm":
            typed = CHECK.vector("positions", values.get("positions"), flight.plan.nominal.n_arm)
            positions = flight.plan.nominal.joints.from_typed(typed)
            kind, values = "arm", {"positions": positions}
        flight.do(kind, values)
        return kind not in ("pull", "target")

    def _let_go(self, who: Any) -> bool:
        """A page that went holds nothing any more."""
        if who is None or who is not self._holder:
            return False
        self._holder = None
        self._live.flight.release()
        return True

    def choices(self) -> dict[str, Any]:
        """What a page may choose from."""
        vehicle = self._live.flight.plan.nominal
        joints = vehicle.joints
        limits = np.clip([joints.lower, joints.upper], -np.pi, np.pi)
        low, high = joints.to_typed(limits[0]), joints.to_typed(limits[1])
        return {
            "controllers": list(controller_names()),
            "compensations": list(COMPENSATIONS),
            "estimators": list(estimator_names()),
            "weathers": list(WEATHERS),
            "rotors": list(vehicle.rotors.names),
            "joints": [
                {"name": name, "unit": unit, "low": float(a), "high": float(b)}
                for name, unit, a, b in zip(joints.names, joints.units, low, high, strict=True)
            ],
            "duration": self._live.flight.plan.scenario.duration,
        }

    def status(self) -> dict[str, Any]:
        """How things stand."""
        live = self._live
        flight, transport = live.flight, live.transport
        crew, period = flight.hands.crew, flight.plan.simulation.control_period
        arm = flight.arm[0] if flight.hands.arm is None else flight.hands.arm.goals
        law = flight.flight.controller
        return {
            "status": {
                "playing": transport.playing,
                "past": None if transport.past is None else transport.past * period,
                "flown": flight.time,
                "speed": transport.speed,
                "seed": flight.plan.seed,
                "outcome": flight.outcome,
                "reason": flight.flight.reason,
                "trim": None if flight.trim is None else str(flight.trim),
                "controller": law.name,
                "compensation": getattr(law.settings, "compensation", None),
                "estimator": flight.flight.estimator.name,
                "weather": _weather_name(flight),
                "rotors": [i not in crew.failed for i in range(flight.plan.nominal.rotors.count)],
                "arm": [float(x) for x in flight.plan.nominal.joints.to_typed(np.array(arm))],
                "script": len(flight.script),
            }
        }


def _weather_name(flight: InteractiveFlight) -> str:
    chosen = flight.hands.crew.weather
    weather = flight.plan.weather
    if chosen is not None:
        weather = Weather.from_dict(chosen.values["weather"])
    return next((name for name, known in WEATHERS.items() if known == weather), "own")
