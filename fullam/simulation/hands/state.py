"""What hands have done to a flight so far: the state that interventions change."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from fullam.control.signals import Target
from fullam.dynamics.spatial import Pose
from fullam.model.joints import ArmJoints
from fullam.simulation.hands.crew import Crew
from fullam.simulation.hands.force import HandForce, Push
from fullam.simulation.hands.interventions import Intervention
from fullam.simulation.hands.reference_model import Bounds, follow_goal
from fullam.simulation.hands.servos import ArmState, next_period, started

LINEAR, ANGULAR = Bounds(2.6, 2.0), Bounds(8.0, 2.5)
"""Bounds of a hand-held target's motion: accelerations as of a blended jump, and speeds."""


class Now(NamedTuple):
    """Where a flight stands: period, target, arm's motion; its joints, the length of a period."""

    k: int
    target: Target
    motions: Any
    joints: ArmJoints
    step: float


@dataclass(frozen=True)
class Hands:
    """Replaced, never changed.

    Attributes:
        goal: Where the target shall go; None while the plan's reference holds.
        target: Where it is, if it has a goal.
        force: Pushes and pull.
        arm: The arm under its servos; None while the plan's motion holds.
        crew: Who flies, in what, on which rotors.
        done: Interventions of the script that have happened.
    """

    goal: Pose | None = None
    target: Target | None = None
    force: HandForce = field(default_factory=HandForce)
    arm: ArmState | None = None
    crew: Crew = field(default_factory=Crew)
    done: int = 0

    def after(self, done: Intervention, now: Now) -> Hands:
        """The hands after an intervention."""
        values, after = done.values, replace(self, done=self.done + 1)
        if done.kind == "target":
            goal = Pose(tuple(values["position"]), tuple(values["attitude"]))
            return replace(after, goal=goal, target=now.target)
        if done.kind == "arm":
            goals = np.array(values["positions"])
            return replace(after, arm=started(now.motions, goals, now.joints, now.k, now.step))
        if done.kind in ("push", "pull", "release"):
            return replace(after, force=force_after(self.force, done, now.k, now.step))
        return replace(after, crew=self.crew.after(done))

    def next_period(self, joints: ArmJoints, step: float) -> Hands:
        """Target and arm one control period on."""
        hands = self
        if hands.goal is not None and hands.target is not None:
            target = follow_goal(hands.target, hands.goal, LINEAR, ANGULAR, step)
            hands = replace(hands, target=target)
        if hands.arm is not None:
            hands = replace(hands, arm=next_period(hands.arm, joints, step))
        return hands


def force_after(force: HandForce, done: Intervention, k: int, step: float) -> HandForce:
    """Pushes and pull after an intervention before period k; periods are of `step` seconds."""
    values = done.values
    if done.kind == "release":
        return force._replace(hand=None)
    if done.kind == "pull":
        return force._replace(hand=tuple(values["hand"]), at=values["at"])
    end = k + max(1, round(values["duration"] / step))
    push = Push(tuple(values["force"]), tuple(values["moment"]), values["at"], end)
    return force._replace(pushes=(*force.pushes, push))
