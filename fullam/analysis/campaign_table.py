"""The rows of a campaign: columns of a Parquet file, made of judged flights and read back.

Pages carry checksums and the stamp, which says what was flown, a digest of itself and all rows;
both are verified on reading. What is read must have all columns of `SCHEMA`, in their types.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.arrow import pa, pq
from fullam.analysis.judge import COLUMN
from fullam.analysis.judged import Judged
from fullam.analysis.metrics import AXIS_FIGURES, FLIGHT_FIGURES, UNITS, Metrics, axis_key
from fullam.analysis.provenance import canonical_json
from fullam.analysis.table_digest import table_digest
from fullam.exceptions import CampaignError, MissingDependency
from fullam.simulation.scenarios.scenario import AXES

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]
Key = tuple[str, str, int]
"""(scenario, contender, seed): what names a row."""

FORMAT = "fullam-campaign-3"
METADATA, DIGEST = b"fullam", b"fullam-digest"
_TEXTS = ("scenario", "contender", "controller", "estimator", "outcome", "reason")
_FLAGS = ("settled", "diverged")

_OF_FLIGHT = {name: COLUMN[name] for name in FLIGHT_FIGURES if name not in _FLAGS}
_OF_AXES = [
    {f"{axis}_{axis_key(name, unit)}": COLUMN[f"{axis}_{name}"] for name in AXIS_FIGURES}
    for axis, unit in zip(AXES, UNITS, strict=True)
]
"""Names of columns, and where `judge.Figures` have their numbers."""


def _schema() -> pa.Schema:
    fields = [pa.field(name, pa.string()) for name in _TEXTS]
    fields.insert(4, pa.field("seed", pa.int64()))
    fields += [pa.field(name, pa.bool_()) for name in _FLAGS]
    for names in (_OF_FLIGHT, *_OF_AXES):
        fields += [pa.field(name, pa.float64()) for name in names]
    fields.append(pa.field("trace", pa.list_(pa.field("element", pa.float32()))))
    return pa.schema(fields)


SCHEMA = _schema()
"""Columns of a result: names, weather seed, outcome, every figure of `measure`; those of an axis
carry its name, as in `z_rms_mm`. `trace` is empty unless the campaign keeps traces."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Judged flights of one contender in one scenario.

    Attributes:
        scenario: Name of the scenario.
        contender: Label of the contender.
        controller: Its controller.
        estimator: Its estimator.
        flights: What stays of the flights.
    """

    scenario: str
    contender: str
    controller: str
    estimator: str
    flights: Judged

    def __len__(self) -> int:
        """Number of flights."""
        return len(self.flights)


def table_of(batches: Sequence[Cells]) -> pa.Table:
    """Rows of flights, in their order."""
    flights = [batch.flights for batch in batches]
    columns: dict[str, Any] = {
        name: [getattr(batch, name) for batch in batches for _ in batch.flights.seeds]
        for name in ("scenario", "contender", "controller", "estimator")
    }
    columns["seed"] = [seed for some in flights for seed in some.seeds]
    columns["outcome"] = [outcome for some in flights for outcome in some.outcomes]
    columns["reason"] = [reason for some in flights for reason in some.reasons]
    numbers = np.concatenate([some.figures.numbers for some in flights])
    controlled = np.concatenate(
        [np.tile(some.figures.controlled, (len(some), 1)) for some in flights]
    )
    failed = np.array([outcome == "failed" for outcome in columns["outcome"]])
    for name in _FLAGS:
        columns[name] = pa.array(numbers[:, COLUMN[name]] > 0.0, mask=failed)
    for names, counts in ((_OF_FLIGHT, None), *zip(_OF_AXES, controlled.T, strict=True)):
        for name, k in names.items():
            values = numbers[:, k] if counts is None else np.where(counts, numbers[:, k], np.nan)
            columns[name] = pa.array(values, from_pandas=True)  # NaN is null
    columns["trace"] = [
        None if some.traces is None else some.traces[i].ravel()
        for some in flights
        for i in range(len(some))
    ]
    return pa.table(columns, SCHEMA)


def flatten(metrics: Metrics) -> dict[str, Any]:
    """The figures of a flight as one flat row."""
    row = metrics.to_dict()
    for axis, figures in row.pop("axes").items():
        row |= {f"{axis}_{name}": value for name, value in figures.items()}
    return row


class CampaignTable:
    """Rows of a campaign, in canonical order.

    Attributes:
        rows: The pyarrow table.
        identity: What was flown: scenarios, contenders, weather, simulation, drivers, code.
    """

    def __init__(self, rows: pa.Table, identity: Mapping[str, Any]) -> None:
        """Own the rows."""
        self.rows, self.identity = rows, dict(identity)
        names = ("scenario", "contender")
        self._labels = {name: np.array(rows.column(name).to_pylist(), object) for name in names}

    def __len__(self) -> int:
        """Number of flights."""
        return self.rows.num_rows

    def __repr__(self) -> str:
        """How many flights of what, and how they ended."""
        outcomes = Counter(self.rows.column("outcome").to_pylist())
        ended = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.items())
        what = " x ".join(
            f"{len(set(labels))} {name}s" for name, labels in self._labels.items() if len(labels)
        )
        return f"<CampaignTable of {len(self)} flights ({what}): {ended}; .to_pandas()>"

    def to_pandas(self) -> pandas.DataFrame:
        """The rows as a table of pandas, a flight each; what could not be measured is NaN.

        Raises:
            MissingDependency: pandas is not installed.
        """
        rows = self.rows.replace_schema_metadata(None)
        if rows.column("trace").null_count == len(self):
            rows = rows.drop_columns(["trace"])
        try:
            return rows.to_pandas()
        except ImportError as error:
            raise MissingDependency("a campaign as a table", "pandas", "export") from error

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
    if schema.names != SCHEMA.names:
        problem = "some are there twice, or in another order"
        raise CampaignError(where, "columns", problem, "sweep again")
    return dict(identity)


def _same(found: pa.DataType, wanted: pa.DataType) -> bool:
    if pa.types.is_list(wanted):
        return bool(pa.types.is_list(found) and found.value_type == wanted.value_type)
    return bool(found == wanted)


def table_stamp(rows: pa.Table, identity: Mapping[str, Any]) -> dict[bytes, bytes]:
    """Metadata of a file: what was flown, and a digest of that and of all rows."""
    stamp = canonical_json(identity).encode()
    return {METADATA: stamp, DIGEST: table_digest(rows, stamp).encode()}
