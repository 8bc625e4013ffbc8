"""The record of a flight: columns with units, and all it takes to fly it again."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, shown
from fullam.dynamics.pose_space import euler_from_pose
from fullam.exceptions import RunFileError, UnknownName
from fullam.files import atomic_path
from fullam.model.vehicle import Vehicle
from fullam.simulation.record import export as run_export
from fullam.simulation.record import run_file
from fullam.simulation.record import tables as run_tables
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.weather import Weather
from fullam.simulation.world.scene_joints import COLUMN, SceneJoint, part_of, read_joints

if TYPE_CHECKING:
    import pandas
    import xarray

Array = NDArray[Any]

FORMAT = "fullam-run-2"
"""Stands in every run file; another value is refused."""

METADATA = (
    *("scenario", "vehicle", "controller", "settings", "simulation", "weather", "seed"),
    *("outcome", "reason", "driver", "versions"),
)
"""What a run's metadata hold beside the format."""


@dataclass(frozen=True)
class Column:
    """One column of the record: its width, unit and meaning.

    `width` is a number, "arm" (joints) or "rotors".
    """

    width: int | str
    unit: str
    meaning: str


COLUMNS: dict[str, Column] = {
    "t": Column(0, "s", "time of the controller tick"),
    "pose": Column(7, "m, quaternion xyzw", "true pose of {A} in {W}"),
    "velocity": Column(6, "m/s, rad/s", "true [dp, w] in world axes"),
    "arm": Column("arm", "rad", "joint positions; [m] of prismatic joints"),
    "arm_rate": Column("arm", "rad/s", "joint rates; [m/s] of prismatic joints"),
    "measured_pose": Column(7, "m, quaternion xyzw", "pose the controller was told: the estimate"),
    "measured_velocity": Column(6, "m/s, rad/s", "[dp, w] it was told, world axes"),
    "reference_pose": Column(7, "m, quaternion xyzw", "pose asked for by the scenario"),
    "u_pid": Column(6, "m/s^2, rad/s^2", "commanded acceleration, eq. (19), world axes"),
    "u_dc": Column(6, "N, N m", "compensation wrench, eq. (20), world axes"),
    "command": Column(6, "N, N m", "commanded wrench, eq. (26), world axes at {A}"),
    "delivered": Column(6, "N, N m", "wrench of the allocated speeds, world axes at {A}"),
    "residual": Column(6, "N, N m", "delivered minus commanded, {A} axes; 0 in reach"),
    "saturated": Column(0, "", "whether a bound kept the allocation from the command"),
    "given_up": Column(0, "", "share of the target's tilt that the governor took back"),
    "rotor_commands": Column("rotors", "rad/s", "speeds asked of the rotors"),
    "rotor_speeds": Column("rotors", "rad/s", "true speeds"),
    "rotor_wrench": Column(6, "N, N m", "true wrench of the rotors, world axes at {A}"),
    "disturbance": Column(6, "N, N m", "gust on the platform, world axes at {A}"),
}
"""Every column of a run, in order."""

SERVO_COLUMNS: dict[str, Column] = {
    "arm_goal": Column("arm", "rad", "goals of the servos; [m] of prismatic joints"),
    "arm_torque": Column("arm", "N m", "torques at the joints; [N] of prismatic joints"),
    "measured_arm": Column("arm", "rad", "joints that the law was told of; [m] of prismatic ones"),
    "measured_arm_rate": Column("arm", "rad/s", "their rates; [m/s] of prismatic joints"),
    "contact_force": Column(3, "N", "force of the world on the tool, world axes"),
}

PLANT_COLUMNS: dict[str, dict[str, Column]] = {"servo": SERVO_COLUMNS, "mujoco": SERVO_COLUMNS}
"""More columns of runs of a plant, by its name."""


SCENE = "coordinates of the scene's joints, side by side; see `Run.scene_joints`"
"""What the column `scene` is, of runs in a scene whose joints move."""


def columns_of(plant: str) -> dict[str, Column]:
    """Every column of a run of a plant, in order."""
    return COLUMNS | PLANT_COLUMNS.get(plant, {})


LOGGED = (
    *("pose", "velocity", "measured_pose", "measured_velocity", "u_pid", "u_dc", "command"),
    *("residual", "saturated", "given_up", "rotor_commands", "rotor_speeds"),
)
"""Columns that are written tick by tick; the others follow from them and the plan."""


def allocate_columns(
    rows: int, n_arm: int, n_rotors: int, names: Iterable[str] = LOGGED
) -> dict[str, Array]:
    """Preallocated columns of a run, zero, shape (rows,) or (rows, width)."""
    widths: dict[int | str, tuple[int, ...]] = {"arm": (n_arm,), "rotors": (n_rotors,), 0: ()}
    columns = {}
    for name in names:
        width = COLUMNS[name].width
        shape = (rows, *widths.get(width, (width,)))
        columns[name] = np.zeros(shape, dtype=bool if name == "saturated" else float)
    return columns


class Run:
    """A flight that has happened.

    Each column of `COLUMNS` is an attribute: `run.pose`, `run.rotor_speeds`, ...; a plant may add
    some of `PLANT_COLUMNS`. `units` names their units. The record carries the nominal vehicle, the
    scenario, the controller's settings, the weather, the seed, the driver and the versions; `refly`
    flies the same again from them. Where joints of a scene in MJCF move, `scene` has their
    coordinates, and `moved` those of one of them.

    Attributes:
        columns: Name to array, read-only, one row per controller tick.
        metadata: JSON values; see the properties.
    """

    def __init__(self, columns: dict[str, Array], metadata: dict[str, Any]) -> None:
        """Own the columns, which become read-only; metadata become what JSON makes of them."""
        self.columns = columns
        for name, array in columns.items():
            array.setflags(write=False)
            setattr(self, name, array)
        self.metadata: dict[str, Any] = json.loads(json.dumps(metadata))

    t: Array
    pose: Array
    velocity: Array
    arm: Array
    arm_rate: Array
    measured_pose: Array
    measured_velocity: Array
    reference_pose: Array
    u_pid: Array
    u_dc: Array
    command: Array
    delivered: Array
    residual: Array
    saturated: Array
    given_up: Array
    rotor_commands: Array
    rotor_speeds: Array
    rotor_wrench: Array
    disturbance: Array
    arm_goal: Array
    arm_torque: Array
    measured_arm: Array
    measured_arm_rate: Array
    contact_force: Array
    scene: Array

    def __len__(self) -> int:
        """Number of controller ticks."""
        return len(self.columns["t"])

    def __repr__(self) -> str:
        """Scenario, controller, seed, length, outcome."""
        return (
            f"<Run {self.scenario.name} / {self.controller} / seed {self.seed}: "
            f"{len(self)} ticks, {self.outcome}>"
        )

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column; joint by joint where the arm has prismatic ones, "m, rad"."""
        columns = columns_of(self.simulation.plant)
        units = {name: column.unit for name, column in columns.items()}
        prismatic = self.vehicle.joints.prismatic
        if prismatic.any():
            of_sliding = {"rad": "m", "rad/s": "m/s", "N m": "N"}
            for name, column in columns.items():
                if column.width == "arm":
                    turned, slid = column.unit, of_sliding[column.unit]
                    units[name] = ", ".join(slid if slides else turned for slides in prismatic)
        if self.scene_joints:
            units[COLUMN] = "; ".join(joint.unit for joint in self.scene_joints)
        return units

    @property
    def meanings(self) -> dict[str, str]:
        """What each column is."""
        columns = columns_of(self.simulation.plant)
        meanings = {name: column.meaning for name, column in columns.items()}
        return meanings | ({COLUMN: SCENE} if COLUMN in self.columns else {})

    @property
    def scene_joints(self) -> tuple[SceneJoint, ...]:
        """Names and kinds of the joints of the scene around it; none in most flights."""
        return read_joints(self.metadata, Checker("run", RunFileError))

    def moved(self, joint: str) -> Array:
        """What a joint of the scene did.

        Args:
            joint: Its name, one of `scene_joints`.

        Returns:
            Angle [rad] or way [m], shape (N,); quaternion xyzw of a ball joint, by which it has
            turned, shape (N, 4); [p, quaternion xyzw] of a free body in {W}, shape (N, 7).

        Raises:
            UnknownName: The scene has no such joint, or the record none of any.
        """
        joints = self.scene_joints
        part = part_of(joints, joint)
        if part is None:
            raise UnknownName("joint of the scene", joint, [known.name for known in joints])
        values = self.columns[COLUMN][:, part]
        return values[:, 0] if values.shape[1] == 1 else values

    @property
    def euler_xyz(self) -> Array:
        """True x-y-z Euler angles (phi, psi, gamma), eq. (2), shape (N, 3) [rad]."""
        return euler_from_pose(self.pose)

    @property
    def vehicle(self) -> Vehicle:
        """The nominal vehicle, rebuilt from the record alone."""
        return Vehicle.from_data(self.metadata["vehicle"])

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return Scenario.from_dict(self.metadata["scenario"])

    @property
    def weather(self) -> Weather:
        """The weather it flew in."""
        return Weather.from_dict(self.metadata["weather"])

    @property
    def simulation(self) -> SimulationSettings:
        """Rates, integrator and sensors."""
        return SimulationSettings.from_dict(self.metadata["simulation"])

    @property
    def controller(self) -> str:
        """Name of the controller."""
        return str(self.metadata["controller"])

    @property
    def settings(self) -> dict[str, Any]:
        """The controller's settings, all of them."""
        return dict(self.metadata["settings"])

    @property
    def trim(self) -> dict[str, Any] | None:
        """How it hovered without its failed rotors, see `Trim.to_dict`; None if none was known."""
        found = self.metadata.get("trim")
        return None if found is None else dict(found)

    @property
    def seed(self) -> int:
        """Seed of the weather."""
        return int(self.metadata["seed"])

    @property
    def outcome(self) -> str:
        """How it went: "completed", "oscillating" (see `oscillation`) or "diverged"."""
        return str(self.metadata["outcome"])

    @property
    def script(self) -> dict[str, Any] | None:
        """What hands did to it, if they did: "interventions", and the plan's "horizon" [s]."""
        return self.metadata.get("script")

    @property
    def plugins(self) -> list[dict[str, Any]]:
        """Plugins that flew: "name" and "digest" of each, and what of it "flew"; mostly none."""
        return list(self.metadata.get("plugins", []))

    @property
    def driver(self) -> str:
        """Who flew it: "python" or "fused"."""
        return str(self.metadata["driver"])

    @property
    def diverged(self) -> bool:
        """Whether the flight ended early because it left the bounds of sense."""
        return self.outcome == "diverged"

    @property
    def oscillating(self) -> bool:
        """Whether it came to its end swinging about what was asked of it."""
        return self.outcome == "oscillating"

    @property
    def well(self) -> bool:
        """Whether it completed, and did not swing."""
        return self.outcome == "completed"

    def save(self, path: str | Path) -> Path:
        """Write the run to one `.npz` file, atomically.

        The file is NumPy's: one array a column, and `metadata`, a JSON text.

        Raises:
            RunFileError: The name does not end in .npz.
        """
        path = run_tables.checked(path, ".npz")
        with atomic_path(path) as temporary:
            np.savez_compressed(
                temporary,
                allow_pickle=False,
                metadata=np.array(json.dumps(self.metadata)),
                **self.columns,
            )
        return path

    def to_pandas(self) -> pandas.DataFrame:
        """The record as a table of pandas: a row a control period, `t` [s] as index.

        Each component has a column, `pose_x`, `arm_joint_1`, `rotor_speeds_3`; `attrs["units"]` has
        their units, and `attrs` what was flown.

        Raises:
            MissingDependency: pandas is not installed.
        """
        return run_tables.to_pandas(self)

    def to_xarray(self) -> xarray.Dataset:
        """The record as arrays of xarray: one a column, over `t` and the names of its components.

        Each has `units` and `long_name`; the attributes of the whole say what was flown.

        Raises:
            MissingDependency: xarray is not installed.
        """
        return run_tables.to_xarray(self)

    def to_csv(self, path: str | Path) -> Path:
        """Write the table of `to_pandas`, `t` first, as text that reads back bit for bit.

        `saturated` is 0 or 1.

        Raises:
            RunFileError: The name does not end in .csv.
        """
        return run_tables.to_csv(self, path)

    def to_parquet(self, path: str | Path) -> Path:
        """Write the table of `to_pandas`, `t` first, to a Parquet file, with units.

        Raises:
            RunFileError: The name does not end in .parquet.
            MissingDependency: pyarrow is not installed.
        """
        return run_export.to_parquet(self, path)

    def to_mcap(self, path: str | Path) -> Path:
        """Write an MCAP file, for Foxglove or PlotJuggler: a topic a column, JSON messages.

        The frames "platform", "estimate" and "reference" move in "world", and so does "scene/box"
        for a body "box" that flies freely. Times are from the start of the flight; numbers that are
        not finite are null.

        Raises:
            RunFileError: The name does not end in .mcap.
            MissingDependency: mcap is not installed.
        """
        return run_export.to_mcap(self, path)

    @classmethod
    def load(cls, path: str | Path) -> Run:
        """Read a run written by `save`.

        Raises:
            RunFileError: The file is missing, truncated, or no run of this format; see `run_file`.
            PluginError: Its estimator is of a plugin that is not loaded; the message names it.
        """
        if not isinstance(path, str | Path):
            raise RunFileError("Run.load", "path", f"is {shown(path)}", "give a path")
        widths = {name: column.width for name, column in COLUMNS.items()}
        more = {
            plant: {name: column.width for name, column in columns.items()}
            for plant, columns in PLANT_COLUMNS.items()
        }
        return cls(*run_file.read(Path(path), run_file.Format(FORMAT, widths, METADATA, more)))
