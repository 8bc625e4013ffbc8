"""Reading a vehicle's definition: the parsed TOML, checked field by field.

Every reader names the file, the field and what would be right, because the reader of the message
is looking at the file and not at this code.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.checks import FINITE, Checker, Range, shown
from fullam.exceptions import VehicleError
from fullam.model.definition_keys import (
    ARM,
    ARM_IN_THE_URDF,
    REQUIRED,
    ROTOR,
    ROTOR_DEFAULTS,
    names_of,
)
from fullam.model.rotors import Rotors

Array = NDArray[np.float64]

ROTOR_NUMBERS = tuple(key.name for key in ROTOR_DEFAULTS if key.default is REQUIRED)
ROTOR_OPTIONS = {key.name: key.default for key in ROTOR_DEFAULTS if key.default is not REQUIRED}
"""Numbers of a rotor that need not be stated, and what they are then."""
MOST_ROTORS = 1000


def check_keys(table: Mapping[str, Any], known: Iterable[str], where: str, field: str) -> None:
    """Refuse keys that nobody reads: a typing error must not pass as a default.

    Raises:
        VehicleError: Naming the first unknown key and listing the known ones.
    """
    known = tuple(known)
    for key in table:
        if key not in known:
            raise VehicleError(
                where,
                f"{field}.{key}" if field else key,
                "is not a known key",
                f"known here: {', '.join(known)}",
            )


def text(table: Mapping[str, Any], key: str, where: str, default: str | None = None) -> str:
    """A string of the definition.

    Raises:
        VehicleError: If it is missing without a default, or not a string.
    """
    value = table.get(key, default)
    if value is None:
        raise VehicleError(where, key, "is missing", "give a string")
    return Checker(where, VehicleError).text(key, value, prose=default == "")


def number(value: Any, where: str, field: str, range: Range = FINITE) -> float:
    """A finite number of the definition.

    Raises:
        VehicleError: If it is not one, or beyond the range.
    """
    return Checker(where, VehicleError).number(field, value, range)


def vector(value: Any, where: str, field: str, range: Range = FINITE) -> Array:
    """A vector of three finite numbers.

    Raises:
        VehicleError: If it is not one.
    """
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise VehicleError(where, field, f"is {shown(value)}", "give three numbers [x, y, z]")
    return np.array([number(entry, where, field, range) for entry in value])


def names(table: Mapping[str, Any], key: str, where: str) -> tuple[str, ...]:
    """A list of strings of the definition; an absent one is empty.

    Raises:
        VehicleError: If it is not a list of strings.
    """
    value = table.get(key, [])
    if not isinstance(value, list | tuple) or not all(isinstance(entry, str) for entry in value):
        raise VehicleError(where, key, f"is {shown(value)}", "give a list of names")
    return tuple(value)


def subtable(table: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    """A table inside the definition; an absent one is empty.

    Raises:
        VehicleError: If it is not a table.
    """
    value = table.get(key, {})
    if not isinstance(value, Mapping):
        raise VehicleError(where, key, f"is {value!r}", "give a table, { name = value }")
    return value


def choice(table: Mapping[str, Any], key: str, options: tuple[str, ...], where: str) -> str:
    """One of a few words; the first of them when absent.

    Raises:
        VehicleError: If it is none of them.
    """
    value = table.get(key, options[0])
    if value not in options:
        raise VehicleError(where, key, f"is {value!r}", f"give one of {list(options)}")
    return str(value)


def arm_joints(definition: Mapping[str, Any], where: str) -> tuple[str, ...]:
    """Names of the arm's joints: `arm` is their list, or a table with `joints`.

    Raises:
        VehicleError: If it is neither, or has unknown keys.
    """
    arm = definition.get("arm", [])
    if isinstance(arm, Mapping):
        known = ARM if "urdf" in arm else ARM_IN_THE_URDF
        check_keys(arm, names_of(known), where, "arm")
        return names(arm, "joints", where)
    return names(definition, "arm", where)


def read_rotors(definition: Mapping[str, Any], model: pin.Model, where: str) -> Rotors:
    """The rotors that a definition states, in the platform's frame {A}.

    A rotor is either `frame`, a frame of the URDF fixed to the platform whose z is the thrust
    axis, or `position` and `axis` in {A}. Its own numbers win over `rotor_defaults`.

    Args:
        definition: The parsed TOML.
        model: Model whose joint 1 is the free flyer of the platform.
        where: What an error message names as the source.

    Raises:
        VehicleError: For a missing frame, number or table, or a value out of range.
    """
    defaults = definition.get("rotor_defaults", {})
    tables = definition.get("rotor", [])
    if not isinstance(defaults, Mapping):
        raise VehicleError(where, "rotor_defaults", "is not a table", "write [rotor_defaults]")
    if not isinstance(tables, list) or not all(isinstance(table, Mapping) for table in tables):
        raise VehicleError(where, "rotor", "is not a list of tables", "write [[rotor]] per rotor")
    columns = (*ROTOR_NUMBERS, *ROTOR_OPTIONS)
    check_keys(defaults, columns, where, "rotor_defaults")
    if len(tables) > MOST_ROTORS:
        raise VehicleError(
            where, "rotor", f"has {len(tables)} tables", f"give {MOST_ROTORS} or fewer"
        )
    labels: list[str] = []
    rows: list[tuple[Array, Array, float, list[float]]] = []
    for index, table in enumerate(tables):
        field = f"rotor[{index + 1}]"
        check_keys(table, names_of(ROTOR), where, field)
        position, axis = _pose(table, model, where, field)
        numbers = {**ROTOR_OPTIONS, **defaults, **table}
        for key in ("spin", *ROTOR_NUMBERS):
            if key not in numbers:
                place = "" if key == "spin" else " here or in [rotor_defaults]"
                raise VehicleError(where, f"{field}.{key}", "is missing", f"state it{place}")
        spin = number(numbers["spin"], where, f"{field}.spin")
        values = [number(numbers[key], where, f"{field}.{key}") for key in columns]
        rows.append((position, axis, spin, values))
        labels.append(text(table, "name", where, table.get("frame", f"rotor_{index + 1}")))
    if len(set(labels)) < len(labels):
        raise VehicleError(where, "rotor", f"has names {labels}", "name each rotor differently")
    numeric = np.array([row[3] for row in rows]).reshape(-1, len(columns))
    k_f, k_tau, max_speeds, lags, min_speeds = numeric.T
    return Rotors(
        names=tuple(labels),
        positions=np.array([row[0] for row in rows]),
        axes=np.array([row[1] for row in rows]),
        spins=np.array([row[2] for row in rows]),
        k_f=k_f,
        k_tau=k_tau,
        max_speeds=max_speeds,
        lags=lags,
        min_speeds=min_speeds,
        where=where,
    )


def _pose(
    table: Mapping[str, Any], model: pin.Model, where: str, field: str
) -> tuple[Array, Array]:
    if "frame" not in table:
        if "position" not in table or "axis" not in table:
            raise VehicleError(
                where,
                field,
                "has no place",
                "give `frame`, or `position` and `axis` in the platform's frame",
            )
        return (
            vector(table["position"], where, f"{field}.position"),
            vector(table["axis"], where, f"{field}.axis"),
        )
    if "position" in table or "axis" in table:
        raise VehicleError(
            where, field, "has a frame and a position or axis", "give one or the other"
        )
    name = text(table, "frame", where)
    frame = model.frames[frame_id(model, name, where, f"{field}.frame")]
    if frame.parentJoint != 1:
        raise VehicleError(
            where,
            f"{field}.frame",
            f"'{name}' moves with joint '{model.names[frame.parentJoint]}'",
            "a rotor is fixed to the platform",
        )
    return frame.placement.translation.copy(), frame.placement.rotation[:, 2].copy()


def frame_id(model: pin.Model, name: str, where: str, field: str) -> int:
    """Index of a frame of the URDF.

    Raises:
        VehicleError: If there is none of that name; the message lists the links.
    """
    for index, frame in enumerate(model.frames):
        if frame.name == name and frame.type == pin.FrameType.BODY:
            return index
    links = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY]
    raise VehicleError(
        where, field, f"'{name}' is not a link of the URDF", f"its links: {', '.join(links)}"
    )
