"""The TOML files that fullam reads, key by key."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from fullam.control.governor import Governor
from fullam.model import definition_keys as keys
from fullam.model.definition_keys import Key
from fullam.model.design import VehicleDesign
from fullam.model.loading import vehicle_path
from fullam.model.perturbation import DEFAULT_PARAMETERS, PARAMETERS, Uncertainty
from fullam.simulation.motions import arm_motion, references
from fullam.simulation.motions.joint_trajectory import JointTrajectory
from fullam.simulation.motions.shaping import Shaping
from fullam.simulation.motions.trajectory import Trajectory
from fullam.simulation.payloads.payload import Payload
from fullam.simulation.scenarios.scenario import AXES, Scenario
from fullam.simulation.sensor_errors import SensorErrors
from fullam.simulation.settings import SimulationSettings
from fullam.simulation.tool import task as tool_task
from fullam.simulation.tool.task import ToolTask
from fullam.simulation.weather import WEATHERS, Weather
from fullam.simulation.world import surfaces as world
from fullam_book.tables import markdown, of_dataclass, of_keys, of_maker, summary

VEHICLE_TABLES = (
    ("The file", "", keys.VEHICLE),
    ("`urdf`", "As a table, `urdf = { package = ..., path = ... }`.", keys.URDF),
    (
        "`[arm]`",
        "As a table; the keys but `joints` are for an arm whose URDF is another file than the "
        "platform's.",
        keys.ARM,
    ),
    ("`[arm.mount]`", "Where an arm with a URDF of its own is fixed.", keys.MOUNT),
    ("`[rotor_defaults]`", "What a `[[rotor]]` does not state itself.", keys.ROTOR_DEFAULTS),
    (
        "`[[rotor]]`",
        "One a rotor: either `frame`, or `position` and `axis`. The numbers of "
        "`[rotor_defaults]` may stand here, too, and win.",
        keys.ROTOR,
    ),
    (
        "`[servo]`",
        "Of all joints; a table `[servo.joints.NAME]` states what is different at one of them. The "
        'defaults are an AX-12A\'s. They count where joints are free, `plant = "servo"`.',
        keys.SERVO,
    ),
    (
        "`[[body]]`",
        "One a body that was measured; `fullam.calibrate` writes them.",
        keys.BODY,
    ),
)
"""Heading, lead and keys of the tables of a vehicle's TOML, but for [design]."""


def pages() -> dict[str, str]:
    """The reference of the TOML files."""
    return {"reference/vehicle_toml": vehicle(), "reference/scenario_toml": scenario()}


def section(heading: str, lead: str, table: str, depth: int = 2) -> str:
    """A heading, a sentence, a table."""
    return f"{'#' * depth} {heading}\n\n{lead}\n\n{table}\n"


def key_sections(tables: Iterable[tuple[str, str, tuple[Key, ...]]]) -> str:
    """The sections of tables of keys."""
    return "\n".join(section(head, lead, markdown(of_keys(t))) for head, lead, t in tables)


def vehicle() -> str:
    """The page on a vehicle's TOML."""
    design = section(
        "`[design]`",
        "The parameters from which fullam writes the URDF of a vehicle with a ring of rotors and a "
        'Craig chain: `fullam.design_vehicle("fullam", rotor_count=6)` changes some of them. '
        "A vehicle that has a URDF needs none of this.",
        markdown(of_dataclass(VehicleDesign, without=("where",))),
    )
    example = vehicle_path("hextilt").read_text(encoding="utf-8")
    return f"""# Vehicle file

A vehicle is a URDF and one TOML beside it. The URDF holds bodies and joints and has its root at
the platform, without a floating joint; the TOML says which link carries the rotors, which joints
are the arm's, and what the rotors do. How to write one is told in
[your own vehicle](../howto/vehicle.md). A key that is not in these tables is refused, by name.

{key_sections(VEHICLE_TABLES)}
{design}
## A whole one

`urdf/hextilt.toml`, whose URDF comes with the package `example-robot-data`:

```toml
{example.rstrip()}
```
"""


def scenario() -> str:
    """The page on a scenario's TOML."""
    weathers = ", ".join(f"`{name}`" for name in WEATHERS)
    return f"""# Scenario file

{summary(Scenario)} `fullam run my_scenario.toml` flies it, `fullam.load_scenario` reads it.
A key that is not in these tables is refused, by name.

{section("The file", f"The axes are {', '.join(AXES)}.", markdown(of_dataclass(Scenario)))}
{kinds("reference", "reference", references.KINDS | {"csv": Trajectory.from_csv})}
{kinds("arm_motion", "arm motion", arm_motion.KINDS | {"csv": JointTrajectory.from_csv})}
{section("`[weather]`", f"A name, one of {weathers}, or a table.", markdown(of_dataclass(Weather)))}
{
        section(
            "`[weather.uncertainty]`",
            f"Parameters: {', '.join(PARAMETERS)}; by default {', '.join(DEFAULT_PARAMETERS)}.",
            markdown(of_dataclass(Uncertainty)),
        )
    }
{section("`[weather.sensors]`", summary(SensorErrors), markdown(of_dataclass(SensorErrors)))}
{section("`[shaping]`", summary(Shaping), markdown(of_dataclass(Shaping)))}
{section("`[tool]`", summary(ToolTask), markdown(of_dataclass(ToolTask)))}
{kinds("tool.path", "path", tool_task.PATHS)}
{kinds("[world]", "surface", world.KINDS)}
{section("`[[payloads]]`", summary(Payload), markdown(of_dataclass(Payload)))}
## Beside the scenario

Rates, sensors and governor belong to the flight, not to the scenario: `fullam run` has options for
them, and `fullam.simulate(..., simulation=...)` takes them as a `SimulationSettings` or as a
mapping of these keys.

{
        section(
            "Simulation settings",
            summary(SimulationSettings),
            markdown(of_dataclass(SimulationSettings)),
            3,
        )
    }
{section("Governor", summary(Governor), markdown(of_dataclass(Governor)), 3)}
"""


def kinds(key: str, what: str, classes: Mapping[str, Any]) -> str:
    """The section of a table whose `kind` says what else it has."""
    parts = [f"## `[{key}]`\n\n`kind` says which {what}, and with it which further keys.\n"]
    for name, cls in classes.items():
        rows = of_maker(cls)
        table = markdown(rows) if rows else ""
        parts.append(section(f'`[{key}]`, `kind = "{name}"`', summary(cls), table, 3))
    return "\n".join(parts)
