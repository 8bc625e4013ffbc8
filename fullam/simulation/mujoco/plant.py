"""MuJoCo as a plant: the same vehicle, servos and encoders, moved by an engine of other people's.

Everything but the physics is the other plants': weather, rotor lags, goals of the servos and what
encoders or a twin tell of them. `spec` tells what the model is, `contact` what its
tool touches, `world_file` how a scene gets around it. Python alone flies these plants.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.link_rows import LinkRows
from fullam.dynamics.recursion import JointMotion
from fullam.dynamics.spatial import scale_spatial, subtract_spatial
from fullam.exceptions import SettingsError
from fullam.model.chain import LinkChain
from fullam.numbers.program import Stage
from fullam.numbers.records import Rows
from fullam.simulation.mujoco.engine import Engine, mean_square
from fullam.simulation.mujoco.spec import load_mujoco
from fullam.simulation.plants.kind import PythonStage, Surroundings
from fullam.simulation.plants.plant import State, follow
from fullam.simulation.plants.prescribed import PrescribedPlant
from fullam.simulation.plants.servo import ServoPlant, carrying
from fullam.simulation.plants.settings import MujocoSettings, plant_settings
from fullam.simulation.world.scene_joints import COLUMN, width_of

Array = NDArray[np.float64]


class MujocoView(NamedTuple):
    """What MuJoCo's stages are shown; `memory` is its state, which both rewrite.

    `goals` and `arm` are the servos', or `arm` the rows of a prescribed motion and `goals` nothing;
    `entries` the record of what touches, `moved` that of the scene's joints.
    """

    state: Any
    rotors: Any
    stepping: Any
    gusts: Any
    speeds: Any
    commands: Any
    goals: Any
    arm: Any
    memory: Any
    entries: Any
    moved: Any


class MujocoPlant(ServoPlant):
    """Joints on servos, contact and payloads, in MuJoCo."""

    name = "mujoco"

    def __init__(self, around: Surroundings) -> None:
        """Compile the model, make the rows."""
        load_mujoco()  # before anything else is asked of it
        super().__init__(around)
        plan, settings = around.tables.plan, self.settings
        assert isinstance(settings, MujocoSettings)
        self.engine = Engine(
            plan.true,
            plan.nominal.servos,
            plan.scenario,
            settings.integrator,
            plan.simulation.plant_period,
            settings.tool_radius,
        )
        self.memory = row_of(self.engine.size)
        self.scene = self.engine.joints
        if self.scene:
            self.moved = row_of(width_of(self.scene), around.kept)

    def stages(self) -> dict[str, Stage]:
        """See `Plant`: there are none."""
        raise not_compiled(self.name)

    def python_stages(self, look: Callable[[Any], Any]) -> dict[str, PythonStage]:
        """See `Plant`; by MuJoCo."""
        engine, plan, view = self.engine, self.around.tables.plan, look(self._mujoco_view())
        own = {name: (s.kernel, look(s.view)) for name, s in self._own_stages().items()}
        if self.loads is not None:
            frame = LinkRows.of(LinkChain.from_model(plan.nominal.model)).frames[-1]
            own["load"] = (carrying(engine, frame), own["load"][1])
        own.pop("record touch", None)
        if engine.touches and self.around.kept:
            own["record touch"] = (self._record_touch, view)
        return own | {"move": (self._move, view)}

    def remembered(self) -> Sequence[Rows]:
        """See `Plant`."""
        return *super().remembered(), self.memory

    def columns(self, rows: int, lane: int, copy: bool) -> dict[str, Array]:
        """See `Plant`: a servo plant's, and the scene's joints."""
        found = super().columns(rows, lane, copy)
        if self.moved is not None:
            found[COLUMN] = np.array(self.moved.array[:rows])
        return found

    def _mujoco_view(self) -> MujocoView:
        a = self.around
        return MujocoView(
            a.state,
            a.drawn.rotors,
            a.tables.stepping,
            a.drawn.gust,
            a.speeds,
            a.commands,
            self.goals,
            self.arm,
            self.memory,
            self.touches,
            self.moved,
        )

    def _enter(self, view: MujocoView, k: int) -> None:
        """The engine where the flight is: in its own state, at first in the flight's."""
        engine = self.engine
        if k == 0:
            load_mujoco().mj_resetData(engine.model, engine.data)
            engine.place(view.state[0].pose, view.state[0].twist, view.arm)
            view.memory[0] = engine.remember()
        else:
            engine.recall(view.memory[0])

    def _record_touch(self, view: MujocoView, k: int) -> None:
        """Write the force on the tool and the scene's joints in period k, before all moves on."""
        self._enter(view, k)
        engine = self.engine
        self._load_controls(view, k)
        engine.spin([speed * speed for speed in view.speeds])
        view.entries[k] = tuple(engine.tool_force().tolist())
        if view.moved is not None:
            view.moved[k] = engine.scene()

    def _load_controls(self, view: MujocoView, k: int) -> None:
        self.engine.push(view.gusts[k])
        self.engine.ask(view.goals)

    def _move(self, view: MujocoView, k: int) -> None:
        """Fly a control period."""
        engine, stepping = self.engine, view.stepping[0]
        self._enter(view, k)
        self._load_controls(view, k)
        for _ in range(int(stepping.substeps)):
            engine.spin(mean_squares(view))
            follow_step(view)
            engine.step()
        view.memory[0] = engine.remember()
        rate = 1.0 / (stepping.substeps * stepping.period)
        pose, twist = engine.state()
        change = subtract_spatial(twist, view.state[0].twist)
        for i, (position, speed) in enumerate(zip(*engine.arm(), strict=True)):
            before = view.arm[i].rate
            view.arm[i] = JointMotion(position, speed, rate * (speed - before))
        view.state[0] = State(pose, twist, scale_spatial(rate, change))


class MujocoPrescribedPlant(PrescribedPlant):
    """The joints on rails, in MuJoCo: torques at them give the accelerations of their motion.

    For comparisons with the plant "prescribed"; nothing can be touched or carried.
    """

    name = "mujoco-prescribed"

    def __init__(self, around: Surroundings) -> None:
        """Compile the model, make the rows."""
        super().__init__(around)
        plan = around.tables.plan
        settings = plant_settings(self.name, plan.simulation.plant_settings)
        self.engine = Engine(
            plan.true, None, plan.scenario, settings.integrator, plan.simulation.plant_period
        )
        self.memory = row_of(self.engine.size)

    def stages(self) -> dict[str, Stage]:
        """See `Plant`: there are none."""
        raise not_compiled(self.name)

    def python_stages(self, look: Callable[[Any], Any]) -> dict[str, PythonStage]:
        """See `Plant`; by MuJoCo."""
        a = self.around
        view = MujocoView(
            a.state,
            a.drawn.rotors,
            a.tables.stepping,
            a.drawn.gust,
            a.speeds,
            a.commands,
            (),
            self.seen.motions,
            self.memory,
            (),
            None,
        )
        return {"move": (self._move, look(view))}

    def remembered(self) -> Sequence[Rows]:
        """See `Plant`."""
        return (self.memory,)

    def _move(self, view: MujocoView, k: int) -> None:
        """Fly a control period."""
        engine, stepping, gust = self.engine, view.stepping[0], view.gusts[k]
        stride, substeps = int(stepping.arm_stride), int(stepping.substeps)
        if k > 0:
            engine.recall(view.memory[0])
        engine.place(view.state[0].pose, view.state[0].twist, view.arm[2 * stride * k * substeps])
        engine.push(gust)
        mujoco, (_, twist) = load_mujoco(), engine.state()
        half_step, before = 0.5 * stepping.period, twist
        for i in range(substeps):
            squares, row = mean_squares(view), 2 * stride * (k * substeps + i)
            follow_step(view)
            engine.spin(squares)
            engine.place_arm(view.arm[row])
            engine.data.time = 0.0  # a stage of the step tells by it which row is its

            def drive(
                model: Any, data: Any, row: int = row, squares: list[float] = squares
            ) -> None:
                half = round(data.time / half_step)
                motions = view.arm[row + half * stride]
                wrench = engine.wrench(squares, gust)
                engine.drive(wrench, [motion.acceleration for motion in motions])

            mujoco.set_mjcb_control(drive)
            try:
                engine.step()
            finally:
                mujoco.set_mjcb_control(None)
            before, (pose, twist) = twist, engine.state()
        view.memory[0] = engine.remember()
        change = subtract_spatial(twist, before)
        view.state[0] = State(pose, twist, scale_spatial(1.0 / stepping.period, change))


def row_of(size: int, count: int = 1) -> Rows:
    """Rows of so many numbers each."""
    return Rows.empty(tuple[(float,) * size], count)  # type: ignore[misc]


def mean_squares(view: MujocoView) -> list[float]:
    """Mean squared speeds of the rotors over the coming step."""
    return [
        mean_square(speed, command, rotor.half_decay)
        for rotor, speed, command in zip(view.rotors, view.speeds, view.commands, strict=True)
    ]


def follow_step(view: MujocoView) -> None:
    """The rotors' speeds a step on, by the kernels of the other plants."""
    for _ in range(2):
        follow(view.rotors, view.speeds, view.commands)


def not_compiled(name: str) -> SettingsError:
    """What a fused driver is told."""
    return SettingsError(
        f"plant '{name}'", "driver", "is 'fused', and MuJoCo is no kernel", "fly it by 'python'"
    )
