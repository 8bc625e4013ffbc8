"""Scenarios in which the tool touches and carries things; they fly on servos.

The default vehicle's arm is stretched ahead, along +x: its tool is 0.6 m from the origin of {A},
beyond the propellers, and 60 mm below. Walls are for `hybrid-force`, which pushes along +x with
3 N; other laws hold their position against them, and wind up.
"""

from __future__ import annotations

from fullam.simulation.motions.references import Step
from fullam.simulation.motions.trajectory import Trajectory
from fullam.simulation.payloads.payload import Payload
from fullam.simulation.scenarios.scenario import Scenario, register_scenario
from fullam.simulation.world.surfaces import Box, Plane

AHEAD_DEG = (0.0, 0.0, -90.0, 0.0)
"""The arm stretched out level, its last links along the first."""

YAW_DEG = (0.0, 0.0, -45.0)
"""The arm leaves the platform along its diagonal; so turned, it points along +x."""

HOME = (0.0, 0.0, 1.0)
WALL = Plane((0.65, 0.0, 0.0), (-1.0, 0.0, 0.0))
"""50 mm ahead of the tool."""

KNOTS = tuple(0.5 * k for k in range(24))
SLIDE = Trajectory(
    times=KNOTS,
    positions=tuple((0.0, min(max(0.0, 0.1 * t - 0.625), 0.5), 1.0) for t in KNOTS),
    velocities=tuple((0.0, 0.1 if 6.5 <= t <= 11.0 else 0.0, 0.0) for t in KNOTS),
    quaternions=((0.0, 0.0, -0.3826834323650898, 0.9238795325112867),) * len(KNOTS),
)
"""Half a metre sideways at 0.1 m/s, once the wall is touched. Knots are even: through uneven ones a
spline with these velocities swings by a quarter of a metre before it begins."""

register_scenario(
    Scenario(
        name="push-wall",
        description="Approach a wall and push it with 3 N",
        controller="hybrid-force",
        initial_position=HOME,
        initial_euler_deg=YAW_DEG,
        initial_arm_deg=AHEAD_DEG,
        reference=Step(HOME, YAW_DEG),
        duration=10.0,
        world=(WALL,),
    )
)

register_scenario(
    Scenario(
        name="slide-wall",
        description="Push a wall with 3 N and slide half a metre along it",
        controller="hybrid-force",
        initial_position=HOME,
        initial_euler_deg=YAW_DEG,
        initial_arm_deg=AHEAD_DEG,
        reference=SLIDE,
        duration=13.0,
        world=(WALL,),
    )
)

register_scenario(
    Scenario(
        name="pick-and-place",
        description="Pick up 0.2 kg that nobody weighed, carry it a metre, put it down",
        controller="dc-pid-plus",
        initial_position=HOME,
        initial_arm_deg=(-90.0, 0.0, -45.0, 0.0),
        reference=Trajectory.minimum_snap(
            ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 1.3), (1.0, 0.0, 1.3)),
            times=(0.0, 4.0, 7.0, 11.0),
        ),
        duration=11.0,
        payloads=(Payload(0.2, picked_up=2.0, dropped=9.0),),
        world=(Box((0.0, 0.0, 0.2), (0.6, 0.6, 0.2)), Box((1.0, 0.0, 0.5), (0.6, 0.6, 0.2))),
    )
)
