"""Reading run files: what is in them is checked before it is read, and again after.

A run file is a zip of NumPy arrays and one JSON text, and may come from anywhere. So names, sizes,
shapes and types are taken from the headers first; only entries that belong to a run are read, and
none that is larger than a run can be. Nothing is unpickled.
"""

from __future__ import annotations

import json
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from fullam.checks import Checker, Range, shown
from fullam.exceptions import FullamError, RunFileError, UnknownName
from fullam.model.vehicle import Vehicle
from fullam.simulation.hands.interventions import read_script
from fullam.simulation.record.flown_plugins import check_plugins, require_plugins
from fullam.simulation.scenarios.scenario import LONGEST, Scenario
from fullam.simulation.settings import MOST_TICKS, SimulationSettings
from fullam.simulation.weather import Weather
from fullam.simulation.world.scene_joints import COLUMN, quaternions_of, read_joints, width_of

Array = NDArray[Any]

MOST_BYTES = 4 << 30
"""All columns of the largest run together."""

MOST_METADATA = 256 << 20
"""The metadata of a run; ours have some ten thousand characters, of four bytes each, and up to
48 millions with the rows of motions of one's own."""

UNIT_QUATERNION = 1e-3
"""How far a quaternion may be from unit length; what is recorded is normalised to 1e-9."""

MOST_NUMBER, MOST_LAST_NUMBER = 1e9, 1e100
"""The largest number of a record, and of the tick at which a flight has diverged."""

MOST_WORDS = 300
"""Characters of what a library says of a damaged file, which may quote all of it."""

UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, ValueError, EOFError, OSError, KeyError, TypeError),
    *(AttributeError, NotImplementedError, MemoryError, SyntaxError, tokenize.TokenError),
    *(RuntimeError, OverflowError, RecursionError),
)
"""What zipfile, zlib, NumPy (its header is Python text) and JSON raise on a damaged file."""

TABLES = ("scenario", "vehicle", "settings", "simulation", "weather", "versions")
OUTCOMES = ("completed", "oscillating", "diverged")
QUATERNIONS = ("pose", "measured_pose", "reference_pose")


@dataclass(frozen=True)
class Format:
    """What a run file must hold.

    Attributes:
        name: Its "format" entry.
        widths: Column -> 0 for a plain column, a number, "arm" (joints) or "rotors".
        metadata: Names of the metadata beside the format.
        of_plants: More columns of runs of a plant, by its name.
    """

    name: str
    widths: Mapping[str, int | str]
    metadata: tuple[str, ...]
    of_plants: Mapping[str, Mapping[str, int | str]] = field(default_factory=dict)

    def widths_of(self, metadata: Mapping[str, Any], check: Checker) -> dict[str, int | str]:
        """Columns of the run with these metadata, which may have joints of a scene."""
        simulation = metadata.get("simulation")
        plant = simulation.get("plant") if isinstance(simulation, Mapping) else None
        more = self.of_plants.get(plant, {}) if isinstance(plant, str) else {}
        width = width_of(read_joints(metadata, check))
        return {**self.widths, **more, **({COLUMN: width} if width else {})}


def read(path: Path, format: Format) -> tuple[dict[str, Array], dict[str, Any]]:
    """Columns and metadata of a run file.

    Raises:
        RunFileError: It is missing, truncated, damaged, no run of this format, or holds what no
            flight can have recorded. The message names the entry.
        PluginError: An estimator, or what hands put in, is of a plugin that is not loaded.
    """
    check = Checker(str(path), RunFileError)
    try:
        if not path.is_file():
            raise check.refuse("file", "does not exist", "give the path of a saved run")
        with zipfile.ZipFile(path) as archive:
            metadata = _metadata(archive, check, format)
            arrays = _columns(archive, check, format.widths_of(metadata, check))
    except UNREADABLE as error:
        raise check.refuse(
            "file",
            f"cannot be read as a run ({type(error).__name__}: {str(error)[:MOST_WORDS]})",
            "give a file written by Run.save; this one is truncated, damaged or another's",
        ) from error
    _check_metadata(metadata, arrays, check)
    _check_numbers(metadata, arrays, check)
    return arrays, metadata


def _metadata(archive: zipfile.ZipFile, check: Checker, format: Format) -> dict[str, Any]:
    """The JSON text, with all its entries there."""
    text = _array(archive, "metadata", check, "U", MOST_METADATA)
    if text.shape:
        raise check.refuse("metadata", f"has shape {text.shape}", "it is one text")
    metadata = json.loads(str(text))
    found = metadata.get("format") if isinstance(metadata, dict) else None
    if found != format.name:
        raise check.refuse(
            "format",
            f"is {shown(found)}",
            f"this version reads '{format.name}'; read it with the version that wrote it, or fly "
            "the scenario again",
        )
    names = {info.filename for info in archive.infolist()}
    missing = [name for name in format.widths_of(metadata, check) if f"{name}.npy" not in names]
    missing += [name for name in format.metadata if name not in metadata]
    if missing:
        raise check.refuse("contents", f"{', '.join(missing)} missing", "save it again")
    return dict(metadata)


def _columns(
    archive: zipfile.ZipFile, check: Checker, wanted_widths: Mapping[str, int | str]
) -> dict[str, Array]:
    """The columns, all of one length; entries that no run has are left unread."""
    arrays: dict[str, Array] = {}
    widths: dict[int | str, int] = {}
    room = MOST_BYTES
    for name, width in wanted_widths.items():
        array = _array(archive, name, check, "b" if name == "saturated" else "f", room)
        room -= array.nbytes
        rows = arrays["t"].shape[0] if arrays else (array.shape or (0,))[0]
        columns = widths.setdefault(width, array.shape[-1] if array.ndim == 2 else 0)
        wanted = (rows,) if width == 0 else (rows, width if isinstance(width, int) else columns)
        if array.shape != wanted:
            raise check.refuse(
                name, f"has shape {array.shape}", f"this run's has {wanted}; save the run again"
            )
        arrays[name] = array
    return arrays


def _array(
    archive: zipfile.ZipFile, name: str, check: Checker, kind: str, most: int
) -> NDArray[Any]:
    """One array of the archive, once its header has said that it is what is wanted."""
    info = archive.getinfo(f"{name}.npy")
    if info.file_size > most:
        problem = f"unpacks to {info.file_size / 2**20:.0f} MiB"
        raise check.refuse(name, problem, f"a run's has at most {most / 2**20:.0f} MiB")
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise check.refuse(name, "is packed in a way that is not read", "save it with Run.save")
    with archive.open(info) as file:
        shape, dtype, size = _header(file)
        right = {"f": dtype == np.float64, "b": dtype == np.bool_, "U": dtype.kind == "U"}[kind]
        if not right:
            raise check.refuse(name, f"is of type {dtype}", "a run's numbers are float64")
        if shape and shape[0] > MOST_TICKS + 1:
            raise check.refuse(name, f"has {shape[0]} rows", f"at most {MOST_TICKS} are read")
        if size + dtype.itemsize * int(np.prod(shape, dtype=object)) != info.file_size:
            raise check.refuse(name, "is not as long as its header says", "save the run again")
    with archive.open(info) as file:
        array = np.lib.format.read_array(file, allow_pickle=False)
        file.read(1)  # at its end the archive compares the checksum
    return np.ascontiguousarray(array) if array.ndim else array


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any], int]:
    """Shape, type and length of an array's header."""
    version = np.lib.format.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        raise ValueError(f"array format {version} is not read")
    reader = (
        np.lib.format.read_array_header_1_0
        if version == (1, 0)
        else np.lib.format.read_array_header_2_0
    )
    shape, _, dtype = reader(file)
    return shape, dtype, file.tell()


def _check_metadata(metadata: dict[str, Any], arrays: dict[str, Array], check: Checker) -> None:
    """The metadata rebuild scenario, weather, settings and vehicle, and the columns fit them."""
    for name in TABLES:
        check.table(name, metadata[name])
    for name in ("controller", "driver"):
        check.text(name, metadata[name])
    check.text("reason", metadata["reason"], prose=True)
    check.whole("seed", metadata["seed"])
    check_plugins(metadata.get("plugins", []), check)
    trim = check.table("trim", metadata.get("trim", {"says": ""}))
    check.text("trim", trim.get("says"), prose=True)
    if metadata["outcome"] not in OUTCOMES:
        problem = f"is {shown(metadata['outcome'])}"
        raise check.refuse("outcome", problem, f"a flight is one of {', '.join(OUTCOMES)}")
    try:
        scenario = Scenario.from_dict(metadata["scenario"])
        simulation = SimulationSettings.from_dict(metadata["simulation"])
        Weather.from_dict(metadata["weather"])
        vehicle = Vehicle.from_data(metadata["vehicle"])
    except FullamError as error:
        raise _refused("metadata", error, metadata, check) from error
    if "script" in metadata:
        _check_script(metadata, scenario.duration, check)
    rows = arrays["t"].size
    for name, width, count in (
        ("arm", vehicle.n_arm, arrays["arm"].shape[1]),
        ("rotor_speeds", vehicle.rotors.count, arrays["rotor_speeds"].shape[1]),
    ):
        if width != count:
            raise check.refuse(name, f"has {count} columns", f"the vehicle has {width}")
    ticks = round(scenario.duration / simulation.control_period) + 1
    if rows > ticks or (rows < ticks and metadata["outcome"] != "diverged"):
        raise check.refuse("t", f"has {rows} rows", f"the whole flight has {ticks} ticks")
    # Times are k times the period, to the last bit but one.
    due = np.arange(rows) * simulation.control_period
    if not np.allclose(arrays["t"], due, rtol=1e-12, atol=0.0):
        raise check.refuse("t", "does not go in steps of control_period", "save the run again")


def _refused(
    field: str, error: FullamError, metadata: dict[str, Any], check: Checker
) -> FullamError:
    """The error for metadata that make none of our objects; of a name, whose plugin is not here."""
    if isinstance(error, UnknownName):
        require_plugins(metadata.get("plugins", []), check.where)
    return check.refuse(field, str(error).rstrip("."), "save the run again")


def _check_script(metadata: dict[str, Any], duration: float, check: Checker) -> None:
    """What hands did is in order, and the flight was meant to last as long at least."""
    table = check.table("script", metadata["script"])
    check.known(table, ("horizon", "interventions"))
    check.number("horizon", table.get("horizon"), Range(duration, LONGEST, "s"))
    try:
        read_script(table.get("interventions"))
    except FullamError as error:
        raise _refused("script", error, metadata, check) from error


def _check_numbers(metadata: dict[str, Any], arrays: dict[str, Array], check: Checker) -> None:
    """Numbers are finite, up to where a flight diverged, and quaternions are of unit length."""
    rows = max(0, arrays["t"].size - (metadata["outcome"] == "diverged"))
    for name, array in arrays.items():
        if not np.isfinite(array[:rows]).all():
            raise check.refuse(name, "is not finite", "a flight records finite numbers")
        for part, most in ((array[:rows], MOST_NUMBER), (array[rows:], MOST_LAST_NUMBER)):
            if (np.abs(part[np.isfinite(part)], dtype=float) > most).any():
                raise check.refuse(name, "holds numbers beyond sense", f"at most {most:g} are read")
    quaternions = [(name, slice(3, 7)) for name in QUATERNIONS]
    quaternions += [(COLUMN, four) for four in quaternions_of(read_joints(metadata, check))]
    for name, four in quaternions:
        with np.errstate(over="ignore"):
            lengths = np.linalg.norm(arrays[name][:rows, four], axis=1)
        if (np.abs(lengths - 1.0) > UNIT_QUATERNION).any():
            raise check.refuse(name, "holds no unit quaternions", "save the run again")
