"""Records as files of other tools: Parquet for tables, MCAP for Foxglove and PlotJuggler."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fullam.exceptions import MissingDependency
from fullam.files import atomic_path
from fullam.simulation.record.tables import (
    EXTRA,
    Part,
    checked,
    columns_of,
    identity_of,
    parts_of,
    plain,
    to_csv,
    units_of,
)
from fullam.version import __version__

if TYPE_CHECKING:
    from fullam.simulation.record.run import Run

NANOSECONDS = 1e9

FRAMES = {"pose": "platform", "measured_pose": "estimate", "reference_pose": "reference"}
"""Frames that an MCAP file moves in the frame "world", by the column that says where they are."""

TRANSFORM = {
    "type": "object",
    "title": "foxglove.FrameTransform",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "parent_frame_id": {"type": "string"},
        "child_frame_id": {"type": "string"},
        "translation": {
            "type": "object",
            "properties": {name: {"type": "number"} for name in "xyz"},
        },
        "rotation": {"type": "object", "properties": {name: {"type": "number"} for name in "xyzw"}},
    },
}
"""Foxglove's own schema of a frame, by whose title its 3D panel knows it."""


def to_parquet(run: Run, path: str | Path) -> Path:
    """The record as a Parquet file; see `Run.to_parquet`."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise MissingDependency("a record as a Parquet file", "pyarrow", EXTRA) from error
    path = checked(path, ".parquet")
    units, columns = units_of(run), columns_of(run)
    fields = [
        pa.field(name, pa.from_numpy_dtype(values.dtype), metadata={"units": units[name]})
        for name, values in columns.items()
    ]
    arrays = [pa.array(np.ascontiguousarray(values)) for values in columns.values()]
    schema = pa.schema(fields, metadata={"fullam-run": json.dumps(run.metadata)})
    with atomic_path(path) as temporary:
        pq.write_table(pa.table(arrays, schema=schema), temporary, compression="zstd")
    return path


def to_mcap(run: Run, path: str | Path) -> Path:
    """The record as an MCAP file; see `Run.to_mcap`."""
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise MissingDependency("a record as an MCAP file", "mcap", EXTRA) from error
    path = checked(path, ".mcap")
    times = np.rint(run.t * NANOSECONDS).astype(np.int64).tolist()
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library=f"fullam {__version__}")
        for topic, schema, messages in _topics(run, times):
            text = json.dumps(schema).encode()
            kind = writer.register_schema(schema["title"], "jsonschema", text)
            channel = writer.register_channel(topic, "json", kind)
            for sequence, (time, message) in enumerate(zip(times, messages, strict=True)):
                data = json.dumps(message, allow_nan=False).encode()
                writer.add_message(channel, time, data, time, sequence)
        writer.add_metadata("fullam", {k: str(v) for k, v in identity_of(run).items()})
        writer.add_metadata("fullam-run", {"metadata": json.dumps(run.metadata)})
        writer.finish()
    return path


FORMATS = {"mcap": to_mcap, "csv": to_csv, "parquet": to_parquet}
"""Name of a format, which is its file's suffix, and what writes it."""


def _topics(
    run: Run, times: list[int]
) -> Iterator[tuple[str, dict[str, Any], Iterator[dict[str, Any]]]]:
    """Name, schema and messages of each topic: a column of the record, or a frame."""
    for part in parts_of(run):
        if part.name == "t":
            continue
        names = part.components or ("value",)
        yield f"/{part.name}", _schema(part, names), _messages(part, names)
    for column, frame in FRAMES.items():
        yield f"/frames/{frame}", TRANSFORM, _transforms(run.columns[column], times, frame)
    for joint in run.scene_joints:
        if joint.kind == "free":
            frame = f"scene/{joint.name}"
            yield f"/frames/{frame}", TRANSFORM, _transforms(run.moved(joint.name), times, frame)


def _schema(part: Part, names: tuple[str, ...]) -> dict[str, Any]:
    kind = "boolean" if part.values.dtype == bool else "number"
    properties = {
        name: {"type": kind, "description": unit}
        for name, unit in zip(names, part.units, strict=True)
    }
    schema = {"type": "object", "title": f"fullam.{part.name}", "description": part.meaning}
    return schema | {"properties": properties}


def _messages(part: Part, names: tuple[str, ...]) -> Iterator[dict[str, Any]]:
    rows = part.values.reshape(len(part.values), -1)
    return (dict(zip(names, plain(row), strict=True)) for row in rows)


def _transforms(poses: Any, times: list[int], frame: str) -> Iterator[dict[str, Any]]:
    for pose, time in zip(poses, times, strict=True):
        numbers, (seconds, rest) = plain(pose), divmod(time, int(NANOSECONDS))
        yield {
            "timestamp": {"sec": seconds, "nsec": rest},
            "parent_frame_id": "world",
            "child_frame_id": frame,
            "translation": dict(zip("xyz", numbers[:3], strict=True)),
            "rotation": dict(zip("xyzw", numbers[3:], strict=True)),
        }
