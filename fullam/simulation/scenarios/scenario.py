"""A scenario: who flies, from where, to where, with which arm motion, in which weather."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, positive, read_toml, shown
from fullam.dynamics.pose_space import pose_from_euler
from fullam.exceptions import InvalidInput, ScenarioError, UnknownName
from fullam.model.vehicle import Vehicle
from fullam.plugins import discover
from fullam.registry import Registry
from fullam.simulation.motions import arm_motion, references
from fullam.simulation.motions.arm_motion import ArmMotion, HoldArm
from fullam.simulation.motions.arm_table import ArmTable
from fullam.simulation.motions.joint_trajectory import JointTrajectory
from fullam.simulation.motions.motion_files import with_files_read
from fullam.simulation.motions.motion_rows import ArmRows, ReferenceRows
from fullam.simulation.motions.reference_table import Reference, ReferenceTable, name_of
from fullam.simulation.motions.references import Step
from fullam.simulation.motions.shaping import SHAPED, Shaping
from fullam.simulation.payloads.payload import Payload
from fullam.simulation.tool.follows import FollowsTool
from fullam.simulation.tool.task import ToolTask
from fullam.simulation.weather import PAPER, Weather
from fullam.simulation.weather import weather as named_weather
from fullam.simulation.world.surfaces import Surface, surface
from fullam.simulation.world.world_file import WorldFile

Array = NDArray[np.float64]

HOVER: Reference = Step((0.0, 0.0, 1.0))
"""Where the platform should be if nothing is said about it."""

LONGEST = 1e4
"""Longest flight [s]: at 1 kHz its tables take about a gigabyte."""

AXES = ("x", "y", "z", "phi", "psi", "gamma")
"""Names of the six axes: position, then x-y-z Euler angles (or the moments about x, y, z)."""


@dataclass(frozen=True)
class Scenario:
    """One experiment, as data.

    Attributes:
        name: Short name.
        description: One sentence.
        vehicle: Name of a vehicle, or path of its TOML.
        controller: The law that it is made for, which flies it if no other is named.
        initial_position: Position of {A} at the start [m].
        initial_euler_deg: x-y-z Euler angles at the start [deg].
        initial_arm_deg: Joint positions at the start: degrees of a revolute joint, METRES of a
            prismatic one; empty means where a `JointTrajectory` begins, and else at rest, 0 or
            the limit nearest to it.
        reference: Where the platform should be: any `motions.reference_table.Reference`.
        arm_motion: How the arm moves: any `motions.arm_motion.ArmMotion`.
        duration: Length of the flight [s].
        axes: The controlled axes, out of `AXES`: of the world for the law, of {A} for the
            allocation. A platform that cannot control them all is meant to stay near level.
        weather: What spoils the flight unless the caller says otherwise.
        shaping: How the reference is blended and anticipated before the law sees it.
        tool: What the tool should do. Where `reference` is left out, the motions of platform and
            arm follow from it; else the tool is only measured against it.
        world: What the tool may touch.
        payloads: What the tool picks up.
        world_file: A scene in MJCF around all this, for the plant "mujoco": a `WorldFile`, or the
            path of one (in a scenario's file, from its folder on).
    """

    name: str
    reference: Reference = HOVER
    description: str = ""
    vehicle: str = "fullam"
    controller: str = "dc-pid"
    initial_position: tuple[float, float, float] = (0.0, 0.0, 1.0)
    initial_euler_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    initial_arm_deg: tuple[float, ...] = ()
    arm_motion: ArmMotion | JointTrajectory = field(default_factory=HoldArm)
    duration: float = 6.0
    axes: tuple[str, ...] = AXES
    weather: Weather = PAPER
    shaping: Shaping = SHAPED
    tool: ToolTask | None = None
    world: tuple[Surface, ...] = ()
    payloads: tuple[Payload, ...] = ()
    world_file: WorldFile | None = None

    def __post_init__(self) -> None:
        """Check everything; lists become tuples.

        Raises:
            ScenarioError: Naming the scenario, the field and what would be right.
        """
        check = Checker(f"scenario {shown(self.name)}", ScenarioError)
        check.text("name", self.name)
        check.text("vehicle", self.vehicle)
        check.text("controller", self.controller)
        check.text("description", self.description, prose=True)
        for name, size, numbers in (
            ("initial_position", 3, references.FAR),
            ("initial_euler_deg", 3, references.TURNED),
            ("initial_arm_deg", None, references.TURNED),
        ):
            object.__setattr__(self, name, check.vector(name, getattr(self, name), size, numbers))
        duration = check.number("duration", self.duration, positive(LONGEST, "s"))
        object.__setattr__(self, "duration", duration)
        self._follow_tool(check)
        for name in ("reference", "arm_motion"):  # a user may bring a class of another kind
            value = getattr(self, name)
            if isinstance(value, type) or not callable(getattr(value, "tabulate", None)):
                remedy = "give an object with the method tabulate, as a Step or a HoldArm is"
                raise check.refuse(name, f"is {shown(value)}", remedy)
        check.instance("weather", self.weather, Weather)
        check.instance("shaping", self.shaping, Shaping)
        for name, cls in (("world", Surface), ("payloads", Payload)):
            things = getattr(self, name)
            if not isinstance(things, list | tuple):
                raise check.refuse(name, f"is {shown(things)}", "give a list")
            for thing in things:
                check.instance(name, thing, cls)
            object.__setattr__(self, name, tuple(things))
        if isinstance(self.world_file, str | Path):
            object.__setattr__(self, "world_file", WorldFile.read(self.world_file))
        check.instance("world_file", self.world_file, (WorldFile, type(None)))
        axes = (self.axes,) if isinstance(self.axes, str) else self.axes
        if not isinstance(axes, list | tuple) or not all(isinstance(a, str) for a in axes):
            raise check.refuse("axes", f"is {shown(axes)}", f"choose from {', '.join(AXES)}")
        if not axes or set(axes) - set(AXES):
            raise check.refuse("axes", f"is {shown(tuple(axes))}", f"choose from {', '.join(AXES)}")
        object.__setattr__(self, "axes", tuple(a for a in AXES if a in axes))

    def _follow_tool(self, check: Checker) -> None:
        """Have both motions follow from the tool's, unless the reference is given."""
        if self.tool is not None:
            check.instance("tool", self.tool, ToolTask)
            if self.reference is HOVER:
                if not isinstance(self.arm_motion, HoldArm | FollowsTool):
                    problem = "is given, and follows from the tool's path"
                    raise check.refuse("arm_motion", problem, "leave it out, or give a reference")
                for name in ("reference", "arm_motion"):
                    object.__setattr__(self, name, FollowsTool())
        followers = [isinstance(m, FollowsTool) for m in (self.reference, self.arm_motion)]
        if any(followers) and not (all(followers) and self.tool is not None):
            problem = "follows a tool that has no task, or alone"
            raise check.refuse("reference", problem, "give tool, and leave both motions out")

    @property
    def axes_mask(self) -> tuple[bool, ...]:
        """Which of the six axes are controlled."""
        return tuple(a in self.axes for a in AXES)

    @property
    def plant(self) -> str:
        """The plant that it needs: what touches something has joints that yield."""
        if self.world_file is not None:
            return "mujoco"
        return "servo" if self.world or self.payloads else "prescribed"

    def check_plant(self, plant: str) -> None:
        """Refuse a plant in which nothing can be touched or carried, if something is to be.

        Raises:
            ScenarioError: Joints that follow their motion exactly yield to nothing; or there is a
                scene in MJCF for another plant than MuJoCo.
        """
        where, remedy = f"scenario '{self.name}'", f"leave plant out, or choose '{self.plant}'"
        if self.world_file is not None and plant != "mujoco":
            problem = f"is for MuJoCo, and the plant is '{plant}'"
            raise ScenarioError(where, "world_file", problem, remedy)
        if plant in ("prescribed", "mujoco-prescribed") and self.plant != "prescribed":
            what = "world" if self.world else "payloads"
            problem = f"needs joints that yield, and the plant is '{plant}'"
            raise ScenarioError(where, what, problem, remedy)

    @property
    def initial_pose(self) -> Array:
        """[p, quaternion xyzw] at the start, shape (7,)."""
        return pose_from_euler(
            np.array(self.initial_position), np.radians(np.array(self.initial_euler_deg))
        )

    def initial_arm(self, vehicle: Vehicle) -> Array:
        """Joint positions at the start, shape (n,) [rad or m].

        Raises:
            ScenarioError: They do not fit the vehicle's arm, or are beyond a joint's limits.
        """
        joints, typed = vehicle.joints, self.initial_arm_deg
        if typed and len(typed) != vehicle.n_arm:
            raise ScenarioError(
                f"scenario '{self.name}'",
                "initial_arm_deg",
                f"has {len(typed)} positions",
                f"the arm of '{vehicle.name}' has {vehicle.n_arm} joints [{joints.unit_list}]",
            )
        positions = joints.from_typed(typed) if typed else joints.rest
        if not typed and isinstance(self.arm_motion, JointTrajectory):
            positions = self.arm_motion.start(joints)
        problem = joints.position_problem(positions)
        if problem is not None:
            raise ScenarioError(
                f"scenario '{self.name}'",
                "initial_arm_deg",
                problem,
                f"stay within the limits of '{vehicle.name}' [{joints.unit_list}]",
            )
        return positions

    def with_rows(self, asked: ReferenceTable, arm: ArmTable, half_step: float) -> Scenario:
        """The same with motions of one's own replaced by their rows, which a record can keep.

        Args:
            asked: The reference on the control grid.
            arm: The arm's motion on the plant's half steps.
            half_step: Time between those [s].

        Raises:
            ScenarioError: The flight is too long for a record to keep them.
        """
        rows: dict[str, Any] = {}
        if not references.is_kind(self.reference, references.KINDS):
            rows["reference"] = ReferenceRows.of(asked, name_of(self.reference))
        if not references.is_kind(self.arm_motion, arm_motion.KINDS):
            rows["arm_motion"] = ArmRows.of(arm, half_step, name_of(self.arm_motion))
        return replace(self, **rows) if rows else self

    def to_dict(self) -> dict[str, Any]:
        """JSON values; `from_dict` is the inverse.

        Raises:
            ScenarioError: A motion is an object of one's own; in a plan's scenario it is rows.
        """
        data = {f.name: getattr(self, f.name) for f in fields(self)}
        for name, kinds in (("reference", references.KINDS), ("arm_motion", arm_motion.KINDS)):
            if not references.is_kind(data[name], kinds):
                raise ScenarioError(
                    f"scenario '{self.name}'",
                    name,
                    f"'{name_of(data[name])}' is no kind that a file can name",
                    "take the scenario of a plan, prepare(...).scenario, which holds its rows",
                )
            data[name] = references.to_dict(data[name])
        data["weather"] = self.weather.to_dict()
        data["shaping"] = self.shaping.to_dict()
        if self.tool is None:
            del data["tool"]
        else:
            data["tool"] = self.tool.to_dict()
        for name in ("world", "payloads"):
            data[name] = [thing.to_dict() for thing in getattr(self, name)]
        data["world_file"] = self.world_file and self.world_file.to_dict()
        return data

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Scenario:
        """Build a scenario from plain data.

        `weather` may be a name ("calm", "recorded", "paper", "sold") or a table of its fields.

        Raises:
            ScenarioError: An unknown field, or a value that does not fit.
        """
        values = Checker("scenario", ScenarioError).table("table", data)
        check = Checker(f"scenario {shown(values.get('name', '?'))}", ScenarioError)
        check.known(values, tuple(f.name for f in fields(cls)))
        if "name" not in values:
            raise check.refuse("name", "is missing", "give it a name")
        return cls(**cls._values(values))

    @staticmethod
    def _values(values: dict[str, Any]) -> dict[str, Any]:
        """The fields with their tables turned into objects."""
        for name, what, kinds in (
            ("reference", "reference", references.KINDS),
            ("arm_motion", "arm motion", arm_motion.KINDS),
        ):
            if name in values and not callable(getattr(values[name], "tabulate", None)):
                values[name] = references.from_dict(kinds, what, values[name])
        if isinstance(values.get("weather"), str):
            values["weather"] = named_weather(values["weather"])
        elif "weather" in values:
            values["weather"] = Weather.from_dict(values["weather"])
        if "shaping" in values:
            values["shaping"] = Shaping.from_dict(values["shaping"])
        if values.get("tool") is not None:
            values["tool"] = ToolTask.from_dict(values["tool"])
        for name, read in (("world", surface), ("payloads", Payload.from_dict)):
            if isinstance(values.get(name), list | tuple):
                values[name] = tuple(read(table) for table in values[name])
        if not isinstance(values.get("world_file"), WorldFile | None):
            values["world_file"] = WorldFile.from_dict(values["world_file"])
        return values


_REGISTRY: Registry[Scenario] = Registry("scenario")


def register_scenario(scenario: Scenario) -> Scenario:
    """Make a scenario known under its name."""
    Checker("register_scenario", ScenarioError).instance("scenario", scenario, Scenario)
    _REGISTRY[scenario.name] = scenario
    return scenario


def scenario_names() -> tuple[str, ...]:
    """Names of the registered scenarios, in the order of registration; those of plugins too."""
    discover()
    return tuple(_REGISTRY)


def load_scenario(name_or_path: str | Path) -> Scenario:
    """The registered scenario of that name, or one read from a TOML file.

    Its motions may be those of CSV files, {kind = "csv", path = ...}, with paths that begin at the
    TOML's folder.

    Raises:
        UnknownName: Neither a registered name nor an existing file.
        ScenarioError: The file is no TOML, or does not describe a scenario; names file and field.
    """
    if not isinstance(name_or_path, str | Path):
        raise ScenarioError(
            "load_scenario",
            "name_or_path",
            f"is {shown(name_or_path)}",
            f"give the path of a TOML, or one of {', '.join(_REGISTRY)}",
        )
    path = Path(name_or_path)
    if path.suffix != ".toml" or not _exists(path):
        return _REGISTRY[str(name_or_path)]
    data = read_toml(path, Checker(str(path), ScenarioError))
    try:
        return Scenario.from_dict(with_files_read(data, path.parent))
    except InvalidInput as error:
        raise ScenarioError(
            f"{path}: {error.where}", error.field, error.problem, error.remedy
        ) from error
    except UnknownName as error:
        raise ScenarioError(
            str(path), error.kind, f"'{error.name}' is unknown", f"choose {', '.join(error.known)}"
        ) from error


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that no file can have
        return False
