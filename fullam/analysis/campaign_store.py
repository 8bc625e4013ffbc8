"""Where a campaign's rows are kept: part files while it flies, one Parquet file in the end.

A Parquet file cannot be appended to. So what has been flown becomes, twice a second, a small
Parquet file of its own in the folder `NAME.parts` beside the result, moved there whole and synced
to the disk; a campaign that is interrupted or killed loses the flights in the air and nothing older
than that. When there are many parts, they become one. When every row is there, all of them are
written to `NAME` in canonical order in one move, and the parts are removed. The bytes of the result
depend on the campaign alone: not on how many jobs flew it, nor on how often it was stopped.

Pages carry checksums and the stamp a digest of itself and all rows, which are verified on reading;
what is read must have all columns of `SCHEMA`, in their types. One process writes at a time.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.journal import canonical_json
from fullam.analysis.metrics import AxisMetrics, Metrics
from fullam.analysis.provenance import short_digest
from fullam.analysis.table_digest import table_digest
from fullam.exceptions import CampaignError, MissingDependency
from fullam.files import atomic_path, locked
from fullam.simulation.scenario import AXES

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ImportError as error:  # pragma: no cover - depends on the installation
    raise MissingDependency("a campaign's result file", "pyarrow", "campaign") from error

Array = NDArray[np.float64]
Key = tuple[str, str, int]
"""(scenario, contender, seed): what names a row."""

FORMAT = "fullam-campaign-2"
METADATA, DIGEST = b"fullam", b"fullam-digest"
ROW_GROUP = 4096

FLUSH = 0.5
"""Rows older than this are in a part file [s]."""

MOST_PARTS = 64
"""As many small parts become one: a long campaign shall not leave a hundred thousand files."""

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


def fingerprint(value: Any) -> str:
    """Short digest of JSON-able data."""
    return short_digest(canonical_json(value).encode())


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
        CampaignError: It is missing, unreadable, damaged, or no result of this format.
    """
    where = str(path)
    if not Path(path).is_file():
        raise CampaignError(where, "file", "does not exist", "give the path of a sweep's result")
    try:
        # Nothing is read before the footer has said that it is what is wanted.
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            identity = _identity(file.schema_arrow, where)
            table = file.read()
    except (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError) as error:
        raise CampaignError(
            where, "file", f"cannot be read ({error})", "remove it and sweep again"
        ) from error
    # Parquet comes back with details of its own (names of inner fields): one schema for all.
    table = table.cast(SCHEMA)
    stamp = table_stamp(table, identity)
    if stamp[DIGEST] != (file.schema_arrow.metadata or {}).get(DIGEST):
        raise CampaignError(
            where, "digest", "is not that of stamp and rows", "it is damaged: sweep again"
        )
    for name in ("scenario", "contender", "seed", "outcome"):
        if table.column(name).null_count:
            raise CampaignError(where, name, "is empty in some rows", "remove it and sweep again")
    return CampaignTable(table.replace_schema_metadata(stamp), identity)


def _identity(schema: pa.Schema, where: str) -> dict[str, Any]:
    """What a file's stamp says, once its columns are those of `SCHEMA`."""
    stamp = (schema.metadata or {}).get(METADATA)
    try:
        identity = json.loads(stamp) if stamp else {}
    except (ValueError, RecursionError) as error:
        raise CampaignError(where, "stamp", f"is no JSON ({error})", "sweep again") from error
    found = identity.get("format") if isinstance(identity, dict) else None
    if found != FORMAT:
        raise CampaignError(
            where, "format", f"is {str(found)[:40]!r}, none of a campaign", f"this reads '{FORMAT}'"
        )
    types = {field.name: field.type for field in schema}
    missing = [name for name in SCHEMA.names if name not in types]
    strange = [name for name in types if name not in SCHEMA.names]
    wrong = [f.name for f in SCHEMA if f.name in types and not _same(types[f.name], f.type)]
    for names, problem in ((missing, "missing"), (strange, "not known"), (wrong, "of other types")):
        if names:
            raise CampaignError(
                where, "columns", f"{', '.join(names[:5])}: {problem}", "sweep again"
            )
    if len(schema.names) != len(SCHEMA.names):
        raise CampaignError(where, "columns", "some are there twice", "sweep again")
    return dict(identity)


def _same(found: pa.DataType, wanted: pa.DataType) -> bool:
    if pa.types.is_list(wanted):
        return bool(pa.types.is_list(found) and found.value_type == wanted.value_type)
    return bool(found == wanted)


def table_stamp(rows: pa.Table, identity: Mapping[str, Any]) -> dict[bytes, bytes]:
    """Metadata of a file: what was flown, and a digest of that and of all rows."""
    stamp = canonical_json(identity).encode()
    return {METADATA: stamp, DIGEST: table_digest(rows, stamp).encode()}


@contextmanager
def open_store(
    path: str | Path, identity: Mapping[str, Any], overwrite: bool
) -> Iterator[CampaignStore]:
    """The store of a campaign, locked; rows not yet in a file are written when the block ends.

    Raises:
        CampaignError: Another process writes there, or as in `CampaignStore`.
    """
    CampaignStore.check_name(path)
    with locked(path):
        store = CampaignStore(path, identity, overwrite)
        try:
            yield store
        finally:
            store.flush()


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
        self.check_name(path)
        self.path = Path(path)
        self.parts = self.path.with_name(self.path.name + ".parts")
        self._identity = json.loads(canonical_json(identity))
        self._tables: list[pa.Table] = []
        self._buffer: list[dict[str, Any]] = []
        self._since = self._last = 0.0
        if overwrite:
            self.discard()
        self._recall(self.path)
        # A kill can leave a hidden temporary behind, whole or not: its batch is flown again.
        for part in sorted(self.parts.glob("[!.]*.parquet")):
            self._recall(part)

    @staticmethod
    def check_name(path: str | Path) -> None:
        """Refuse a name that is none of a Parquet file.

        Raises:
            CampaignError: It does not end in .parquet.
        """
        if Path(path).suffix != ".parquet":
            raise CampaignError(
                str(path), "name", "does not end in .parquet", "give it that suffix"
            )

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
        self._tables.append(held.rows.replace_schema_metadata(None))

    @property
    def keys(self) -> set[Key]:
        """Rows that are kept already."""
        found: set[Key] = set()
        for table in self._tables:
            columns = (table.column(n).to_pylist() for n in ("scenario", "contender", "seed"))
            found.update(zip(*columns, strict=True))
        return found

    def append(self, rows: list[dict[str, Any]]) -> None:
        """Keep the rows of some flights: at once, or with others before they are `FLUSH` old."""
        now = time.monotonic()
        if not self._buffer:
            self._since = self._last = now
        self._buffer += rows
        # If the next rows take as long as these did, will the oldest be too old then?
        if now + (now - self._last) - self._since >= FLUSH:
            self.flush()
        self._last = now

    def flush(self) -> None:
        """Write what is not yet in a file, whole or not at all."""
        if not self._buffer:
            return
        rows, self._buffer = self._buffer, []
        table = pa.Table.from_pylist(rows, SCHEMA)
        self._tables.append(table)
        self._write_part(table, "part")
        small = sorted(self.parts.glob("part-*.parquet"))
        if len(small) >= MOST_PARTS:
            tables = [read_campaign(part).rows.replace_schema_metadata(None) for part in small]
            self._write_part(pa.concat_tables(tables).combine_chunks(), "many")
            for part in small:  # a kill before this leaves rows twice, which costs nothing
                part.unlink()

    def _write_part(self, table: pa.Table, kind: str) -> None:
        names = (table.column(n).to_pylist() for n in ("scenario", "contender", "seed"))
        name = fingerprint([list(key) for key in zip(*names, strict=True)])
        with atomic_path(self.parts / f"{kind}-{name}.parquet") as temporary:
            stamped = table.replace_schema_metadata(table_stamp(table, self._identity))
            pq.write_table(stamped, temporary, write_page_checksum=True)

    def finish(self, order: Iterable[Key]) -> CampaignTable:
        """Write the result in canonical order and drop the parts.

        Args:
            order: The keys of all rows, in their order. Rows kept beyond these stay, behind them.

        Raises:
            CampaignError: A row is missing.
        """
        self.flush()
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
        table = table.replace_schema_metadata(table_stamp(table, self._identity))
        with atomic_path(self.path) as temporary:
            pq.write_table(
                table,
                temporary,
                row_group_size=ROW_GROUP,
                compression="zstd",
                write_page_checksum=True,
            )
        shutil.rmtree(self.parts, ignore_errors=True)
        return CampaignTable(table.slice(0, len(wanted)), self._identity)

    def discard(self) -> None:
        """Forget everything kept under this name."""
        self.path.unlink(missing_ok=True)
        shutil.rmtree(self.parts, ignore_errors=True)
        self._tables.clear()
