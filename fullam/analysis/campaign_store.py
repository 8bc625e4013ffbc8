"""Where a campaign's rows are kept: part files while it flies, one Parquet file in the end.

A Parquet file cannot be appended to. So every finished batch becomes a small Parquet file of its
own in the folder `NAME.parts` beside the result, moved there whole; a campaign that is interrupted
or killed loses the batches in the air and nothing else. When every row is there, all of them are
written to `NAME` in canonical order in one move, and the parts are removed. The bytes of the result
depend on the campaign alone: not on how many jobs flew it, nor on how often it was stopped.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.metrics import AxisMetrics, Metrics
from fullam.exceptions import CampaignError, MissingDependency
from fullam.files import atomic_path
from fullam.simulation.scenario import AXES

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ImportError as error:  # pragma: no cover - depends on the installation
    raise MissingDependency("a campaign's result file", "pyarrow", "campaign") from error

Array = NDArray[np.float64]
Key = tuple[str, str, int]
"""(scenario, contender, seed): what names a row."""

FORMAT = "fullam-campaign-1"
METADATA = b"fullam"
ROW_GROUP = 4096

_TEXTS = ("scenario", "contender", "controller", "estimator", "outcome", "reason")
_FLAGS = ("settled", "diverged")
_NOT_FIGURES = {"axes", *_FLAGS}


def _schema() -> pa.Schema:
    fields = [pa.field(name, pa.string()) for name in _TEXTS]
    fields.insert(4, pa.field("seed", pa.int64()))
    fields += [pa.field(name, pa.bool_()) for name in _FLAGS]
    figures = [name for name in Metrics.__dataclass_fields__ if name not in _NOT_FIGURES]
    fields += [pa.field(name, pa.float64()) for name in figures]
    for i, axis in enumerate(AXES):
        blank = AxisMetrics("mm" if i < 3 else "deg", *[0.0] * 11).to_dict()
        fields += [pa.field(f"{axis}_{name}", pa.float64()) for name in blank]
    fields.append(pa.field("trace", pa.list_(pa.field("element", pa.float32()))))
    return pa.schema(fields)


SCHEMA = _schema()
"""Columns of a result: names, weather seed, outcome, every figure of `measure`; those of an axis
carry its name, as in `z_rms_mm`. `trace` is empty unless the campaign keeps traces."""


def flatten(metrics: Metrics) -> dict[str, Any]:
    """The figures of a flight as one flat row."""
    row = metrics.to_dict()
    for axis, figures in row.pop("axes").items():
        row |= {f"{axis}_{name}": value for name, value in figures.items()}
    return row


def canonical_json(value: Any) -> str:
    """JSON with sorted keys: equal data give equal text."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"))


def fingerprint(value: Any) -> str:
    """Short digest of JSON-able data."""
    return hashlib.sha256(canonical_json(value).encode()).hexdigest()[:16]


class CampaignTable:
    """Rows of a campaign, in canonical order.

    Attributes:
        rows: The pyarrow table.
        identity: What was flown: scenarios, contenders, weather, simulation, engine, code.
    """

    def __init__(self, rows: pa.Table, identity: Mapping[str, Any]) -> None:
        """Own the rows."""
        self.rows, self.identity = rows, dict(identity)
        names = ("scenario", "contender")
        self._labels = {name: np.array(rows.column(name).to_pylist(), object) for name in names}

    def __len__(self) -> int:
        """Number of flights."""
        return self.rows.num_rows

    def _where(self, scenario: str | None, contender: str | None) -> NDArray[np.bool_]:
        mask = np.ones(len(self), dtype=bool)
        for name, wanted in (("scenario", scenario), ("contender", contender)):
            if wanted is not None:
                mask &= self._labels[name] == wanted
        return mask

    def column(
        self, name: str, scenario: str | None = None, contender: str | None = None
    ) -> NDArray[Any]:
        """One column of the rows that fit; what could not be measured is NaN.

        Raises:
            CampaignError: There is no such column.
        """
        if name not in self.rows.column_names:
            raise CampaignError("campaign", name, "is no column", f"see {', '.join(SCHEMA.names)}")
        column = self.rows.column(name)
        if pa.types.is_floating(column.type):
            values = np.array(column.fill_null(float("nan")).to_numpy(), dtype=float)
        else:
            values = np.array(column.to_pylist(), dtype=object)
            if name == "seed":
                values = values.astype(int)
            elif name in _FLAGS:
                values = np.array([bool(v) for v in values])
        return values[self._where(scenario, contender)]

    def traces(self, scenario: str | None = None, contender: str | None = None) -> Array:
        """Kept motions, shape (flights, samples, 6) [mm, deg]; NaN after a flight ended early."""
        mask = self._where(scenario, contender)
        kept = [
            np.asarray(v or [], float) for v in self.rows.column("trace").filter(mask).to_pylist()
        ]
        longest = max((v.size for v in kept), default=0)
        out = np.full((len(kept), longest), np.nan)
        for i, values in enumerate(kept):
            out[i, : values.size] = values
        return out.reshape(len(kept), -1, 6)


def read_campaign(path: str | Path) -> CampaignTable:
    """Read a result file.

    Raises:
        CampaignError: It is missing, unreadable, or no result of this format.
    """
    where = str(path)
    if not Path(path).is_file():
        raise CampaignError(where, "file", "does not exist", "give the path of a sweep's result")
    try:
        table = pq.read_table(path)
    except (pa.ArrowInvalid, OSError) as error:
        raise CampaignError(where, "file", f"cannot be read ({error})", "sweep again") from error
    stamp = (table.schema.metadata or {}).get(METADATA)
    identity = json.loads(stamp) if stamp else {}
    if identity.get("format") != FORMAT:
        raise CampaignError(where, "format", "is none of a campaign", f"this reads '{FORMAT}'")
    return CampaignTable(table, identity)


class CampaignStore:
    """Keeps the rows of one campaign; see the module's text.

    Attributes:
        path: The result.
        parts: The folder of part files.
    """

    def __init__(self, path: str | Path, identity: Mapping[str, Any], overwrite: bool) -> None:
        """Find what earlier attempts left.

        Raises:
            CampaignError: Result or parts belong to another campaign and `overwrite` is False.
        """
        self.path = Path(path)
        if self.path.suffix != ".parquet":
            raise CampaignError(
                str(path), "name", "does not end in .parquet", "give it that suffix"
            )
        self.parts = self.path.with_name(self.path.name + ".parts")
        self._identity = json.loads(canonical_json(identity))
        self._stamp = {METADATA: canonical_json(self._identity).encode()}
        self._tables: list[pa.Table] = []
        if overwrite:
            self.discard()
        self._recall(self.path)
        # A kill can leave a hidden temporary behind, whole or not: its batch is flown again.
        for part in sorted(self.parts.glob("[!.]*.parquet")):
            self._recall(part)

    def _recall(self, path: Path) -> None:
        if not path.exists():
            return
        held = read_campaign(path)
        if held.identity != self._identity:
            differs = sorted(
                k
                for k in {*held.identity, *self._identity}
                if held.identity.get(k) != self._identity.get(k)
            )
            raise CampaignError(
                str(path),
                "rows",
                f"were flown under other conditions ({', '.join(differs)} differ)",
                "name another file, or overwrite it",
            )
        # Parquet comes back with details of its own (names of inner fields): one schema for all.
        self._tables.append(held.rows.cast(SCHEMA))

    @property
    def keys(self) -> set[Key]:
        """Rows that are kept already."""
        found: set[Key] = set()
        for table in self._tables:
            columns = (table.column(n).to_pylist() for n in ("scenario", "contender", "seed"))
            found.update(zip(*columns, strict=True))
        return found

    def append(self, rows: list[dict[str, Any]]) -> None:
        """Keep the rows of one batch, whole or not at all."""
        table = pa.Table.from_pylist(rows, SCHEMA).replace_schema_metadata(self._stamp)
        first = rows[0]
        name = fingerprint([first["scenario"], first["contender"], first["seed"], len(rows)])
        with atomic_path(self.parts / f"{name}.parquet") as temporary:
            pq.write_table(table, temporary)
        self._tables.append(table.cast(SCHEMA))

    def finish(self, order: Iterable[Key]) -> CampaignTable:
        """Write the result in canonical order and drop the parts.

        Args:
            order: The keys of all rows, in their order. Rows kept beyond these stay, behind them.

        Raises:
            CampaignError: A row is missing.
        """
        table = pa.concat_tables(self._tables) if self._tables else SCHEMA.empty_table()
        columns = (table.column(n).to_pylist() for n in ("scenario", "contender", "seed"))
        at = {key: i for i, key in enumerate(zip(*columns, strict=True))}
        wanted = list(order)
        missing = [key for key in wanted if key not in at]
        if missing:
            raise CampaignError(
                str(self.path), "rows", f"{len(missing)} are missing", "sweep again to add them"
            )
        chosen = set(wanted)
        rest = sorted(key for key in at if key not in chosen)
        table = table.take([at[key] for key in wanted + rest]).combine_chunks()
        table = table.replace_schema_metadata(self._stamp)
        with atomic_path(self.path) as temporary:
            pq.write_table(table, temporary, row_group_size=ROW_GROUP, compression="zstd")
        shutil.rmtree(self.parts, ignore_errors=True)
        return CampaignTable(table.slice(0, len(wanted)), self._identity)

    def discard(self) -> None:
        """Forget everything kept under this name."""
        self.path.unlink(missing_ok=True)
        shutil.rmtree(self.parts, ignore_errors=True)
        self._tables.clear()
