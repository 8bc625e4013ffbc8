"""The paper's experiments as registered scenarios, with the paper's numbers."""

from __future__ import annotations

from dataclasses import replace

from fullam.model.perturbation import Uncertainty
from fullam.simulation.motions.arm_motion import SineRate
from fullam.simulation.motions.references import Step
from fullam.simulation.scenarios.scenario import Scenario, register_scenario
from fullam.simulation.tool.paths import CirclePath
from fullam.simulation.tool.task import ToolTask
from fullam.simulation.weather import PAPER

CONFIGURATIONS = {
    1: (-90.0, -90.0, 0.0, 0.0),
    2: (-90.0, 0.0, 0.0, 0.0),
    3: (0.0, 0.0, -90.0, 0.0),
    4: (-90.0, 0.0, -90.0, 0.0),
}
"""The four arm configurations of Table 2 and Fig. 3 [deg]."""

INITIAL_EULER_DEG = {
    1: (-10.0, -10.0, -10.0),
    2: (15.0, -20.0, 10.0),
    3: (20.0, 10.0, -15.0),
    4: (-10.0, 20.0, 15.0),
}
"""Initial attitudes of the position test, Table 2 [deg]."""

TILT_EULER_DEG = {
    1: (10.0, 10.0, 10.0),
    2: (20.0, 20.0, 20.0),
    3: (15.0, 15.0, 0.0),
    4: (15.0, 15.0, 0.0),
}
"""Desired attitudes of the tilted hover, section 5.2 [deg]."""

HOME = (9.0, 9.0, 9.0)

for number, arm in CONFIGURATIONS.items():
    register_scenario(
        Scenario(
            name=f"position-{number}",
            description=f"Fig. 4: from (9, 9, 9) to (10, 10, 10) m, arm configuration {number}",
            initial_position=HOME,
            initial_euler_deg=INITIAL_EULER_DEG[number],
            initial_arm_deg=arm,
            reference=Step((10.0, 10.0, 10.0)),
        )
    )

for number, arm in CONFIGURATIONS.items():
    register_scenario(
        Scenario(
            name=f"tilt-hover-{number}",
            description=f"Fig. 5: hold the position while tilting, arm configuration {number}",
            initial_position=HOME,
            initial_arm_deg=arm,
            reference=Step(HOME, TILT_EULER_DEG[number]),
        )
    )

TASK_ARM_DEG = (-90.0, 0.0, -45.0, 0.0)

register_scenario(
    Scenario(
        name="task-1",
        description="Fig. 6: hold (9, 9, 9) m, level, while joint 3 moves",
        initial_position=HOME,
        initial_arm_deg=TASK_ARM_DEG,
        reference=Step(HOME),
        arm_motion=SineRate(joint=3, rate=0.5, frequency=1.0),
        duration=12.0,
    )
)

register_scenario(
    Scenario(
        name="task-2",
        description="Fig. 7: to (9.3, 9.3, 9.3) m and (20, 20, 0) deg while joint 3 moves",
        initial_position=HOME,
        initial_arm_deg=TASK_ARM_DEG,
        reference=Step((9.3, 9.3, 9.3), (20.0, 20.0, 0.0)),
        arm_motion=SineRate(joint=3, rate=0.5, frequency=1.0),
        duration=12.0,
    )
)

register_scenario(
    Scenario(
        name="quadrotor-arm",
        description="Fig. 9: a conventional quadrotor keeps its attitude while its arm moves",
        vehicle="quadrotor_arm",
        initial_position=HOME,
        initial_arm_deg=TASK_ARM_DEG,
        reference=Step(HOME),
        arm_motion=SineRate(joint=3, rate=0.5, frequency=1.0),
        duration=12.0,
        axes=("z", "phi", "psi", "gamma"),
    )
)

# Its yaw inertia is 0.003 kg m^2, a fifteenth of the paper's vehicle's: the paper's gusts would
# throw it, and +-10 % on every rotor's own k_f would turn it with 30 rad/s^2.
register_scenario(
    Scenario(
        name="hextilt-step",
        description="The hextilt hovers, then steps 1 m in x, y and z, its arm hanging",
        vehicle="hextilt",
        initial_position=(0.0, 0.0, 2.0),
        reference=Step((1.0, 1.0, 3.0), at=1.0),
        weather=replace(
            PAPER,
            force_disturbance=2.0,
            moment_disturbance=0.1,
            uncertainty=Uncertainty(share=0.02),
        ),
    )
)

register_scenario(
    Scenario(
        name="draw-circle",
        description="The tool draws a circle of 0.15 m radius in 8 s on an upright plane",
        initial_position=(0.0, 0.0, 2.0),
        initial_arm_deg=TASK_ARM_DEG,
        tool=ToolTask(CirclePath(radius=0.15, normal=(1.0, 0.0, 0.0), duration=8.0), at=1.0),
        duration=10.0,
    )
)
