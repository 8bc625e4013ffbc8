"""What one can do to a flight from Python, each of it an intervention."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fullam.dynamics.pose_space import pose_from_euler
from fullam.exceptions import InvalidInput
from fullam.numbers.records import flat
from fullam.simulation.flight import Flight
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.hands.interventions import Intervention
from fullam.simulation.hands.state import Hands

Array = NDArray[np.float64]


class Touch(ABC):
    """The hand's side of a flight.

    Attributes:
        plan: What is flown.
        flight: Who flies it.
        script: All interventions, in order.
        hands: What they have come to so far.
    """

    plan: FlightPlan
    flight: Flight
    script: list[Intervention]
    hands: Hands

    @abstractmethod
    def do(self, kind: str, values: Mapping[str, Any]) -> Intervention:
        """Do something before the next period is flown; see `interventions.KINDS`.

        Raises:
            InvalidInput: It cannot be done.
            UnknownName: No such controller, estimator or weather.
        """

    @property
    def target(self) -> Array:
        """Where the target shall go, [p, quaternion xyzw]; set it, or its position alone."""
        for done in reversed(self.script[self.hands.done :]):
            if done.kind == "target":
                return np.array([*done.values["position"], *done.values["attitude"]])
        if self.hands.goal is not None:
            return np.array([*flat(self.hands.goal)])
        return np.array(self.plan.asked.pose[min(self.flight.ticks_flown, len(self.plan.t) - 1)])

    @target.setter
    def target(self, pose: ArrayLike) -> None:
        numbers = np.asarray(pose, dtype=float)
        if numbers.shape not in ((3,), (7,)):
            remedy = "give a position, or [p, quaternion xyzw]"
            raise InvalidInput("flight", "target", f"has shape {numbers.shape}", remedy)
        attitude = numbers[3:] if numbers.size == 7 else self.target[3:]
        self.do("target", {"position": numbers[:3], "attitude": attitude})

    def aim(
        self, position: ArrayLike | None = None, euler_deg: ArrayLike = (0.0, 0.0, 0.0)
    ) -> None:
        """Set the target by its position [m] (as it is if None) and x-y-z Euler angles [deg]."""
        place = self.target[:3] if position is None else np.asarray(position, dtype=float)
        self.target = pose_from_euler(place, np.radians(np.asarray(euler_deg, dtype=float)))

    def push(
        self,
        force: ArrayLike,
        moment: ArrayLike = (0.0, 0.0, 0.0),
        at: str = "tool",
        duration: float = 1.0,
    ) -> None:
        """Push with a force [N] and a moment [N m], world axes, at "tool" or "platform"."""
        values = {"force": np.asarray(force), "moment": np.asarray(moment)}
        self.do("push", {**values, "at": at, "duration": duration})

    def pull(self, hand: ArrayLike, at: str = "tool") -> None:
        """Hang a spring between a point of the world [m] and the "tool" or the "platform"."""
        self.do("pull", {"hand": np.asarray(hand), "at": at})

    def release(self) -> None:
        """Let go of the spring."""
        self.do("release", {})

    def move_arm(self, arm_deg: ArrayLike) -> None:
        """Send the joints somewhere [deg; m of a prismatic joint], as fast as their servos can."""
        self.do("arm", {"positions": self.plan.nominal.joints.from_typed(arm_deg)})

    def switch(
        self,
        controller: str | None = None,
        settings: Mapping[str, Any] | None = None,
        estimator: str | None = None,
        weather: Any = None,
    ) -> None:
        """Fly on under another law (`settings`: of it), with another estimator, in other weather.

        Laws and estimators begin afresh. The true vehicle stays the one that took off.
        """
        if controller is not None or settings is not None:
            name = controller or self.flight.controller.name
            self.do("controller", {"name": name, "settings": dict(settings or {})})
        if estimator is not None:
            self.do("estimator", {"name": estimator})
        if weather is not None:
            self.do("weather", {"weather": weather})

    def fail_rotor(self, index: int, known: bool = False) -> None:
        """Stop a rotor (from 0); if `known`, the allocation does without it from then on."""
        self.do("rotor", {"index": index, "fails": True, "known": known})

    def repair_rotor(self, index: int) -> None:
        """Let a rotor work again."""
        self.do("rotor", {"index": index, "fails": False})
