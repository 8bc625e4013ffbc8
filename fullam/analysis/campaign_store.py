"""Where a campaign's rows are kept: part files while it flies, one Parquet file in the end.

A Parquet file cannot be appended to. So what has been flown becomes, before it is half a second
old, a small Parquet file of its own in the folder `NAME.parts` beside the result, moved there whole
and synced to the disk; a campaign that is interrupted or killed loses the flights in the air and
nothing older than that. Rows are written as others come; a thread sees to those whose successors
take longer than was thought. When there are many parts, they become one. When every row is there,
all of them are written to `NAME` in canonical order in one move, and the parts are removed. The
bytes of the result depend on the campaign alone: not on how many jobs flew it, nor on how often it
was stopped.

One process writes at a time.
"""

from __future__ import annotations

import json
import shutil
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fullam.analysis.arrow import pa, pq
from fullam.analysis.campaign_table import (
    SCHEMA,
    CampaignTable,
    Cells,
    Key,
    read_campaign,
    table_of,
    table_stamp,
)
from fullam.analysis.provenance import canonical_json, fingerprint
from fullam.exceptions import CampaignError
from fullam.files import atomic_path, locked

ROW_GROUP = 4096
"""Rows in a group of the result file."""

FLUSH = 0.5
"""Rows older than this are in a part file [s], a disk of ordinary speed provided."""

MOST_PARTS = 64
"""As many small parts become one: a long campaign shall not leave a hundred thousand files."""


@contextmanager
def open_store(
    path: str | Path, identity: Mapping[str, Any], overwrite: bool
) -> Iterator[CampaignStore]:
    """The store of a campaign, locked; rows that come are written meanwhile and when it ends.

    Raises:
        CampaignError: Another process writes there, or as in `CampaignStore`.
        OSError: Rows cannot be written; the next `append` says so.
    """
    CampaignStore.check_name(path)
    with locked(path):
        store = CampaignStore(path, identity, overwrite)
        pa.array([0.0])  # brings in pandas, half a second: not while rows wait
        ended = threading.Event()
        writer = threading.Thread(target=_write_on, args=(store, ended), daemon=True)
        writer.start()
        try:
            yield store
        finally:
            ended.set()
            store.flush()
            writer.join()


def _write_on(store: CampaignStore, ended: threading.Event) -> None:
    """Write what waits too long, until the end or the first failure."""
    try:
        while not ended.wait(FLUSH / 8):
            if store.age > 0.75 * FLUSH:
                store.flush()
    except Exception as error:  # noqa: BLE001 - raised where rows are handed over
        store.failure = error


def _differing(one: Mapping[str, Any], other: Mapping[str, Any], depth: int = 2) -> list[str]:
    """Names of the entries in which two identities differ, "registered (controller my-law)"."""
    names = []
    for name in sorted({*one, *other}):
        a, b = one.get(name), other.get(name)
        if a != b:
            parts = []
            if isinstance(a, Mapping) and isinstance(b, Mapping) and depth > 1:
                parts = _differing(a, b, depth - 1)
            names.append(f"{name} ({', '.join(parts)})" if parts else name)
    return names


class CampaignStore:
    """Keeps the rows of one campaign; see the module's text.

    Attributes:
        path: The result.
        parts: The folder of part files.
        failure: Why rows could not be written; raised by the next `append`.
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
        self._buffer: list[Cells] = []
        self._since = self._came = 0.0
        self._writing = threading.Lock()
        self.failure: Exception | None = None
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
            differs = _differing(held.identity, self._identity)
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

    def append(self, cells: Cells) -> None:
        """Keep the rows of some flights: at once, or with others before they are `FLUSH` old.

        Raises:
            Exception: What kept earlier ones from being written.
        """
        if self.failure is not None:
            raise self.failure
        before, now = self._came, time.monotonic()
        self._came = now
        if not self._buffer:
            self._since = before = now
        self._buffer.append(cells)
        # If the next rows take as long as these did, will the oldest be too old then? While Python
        # flies, here are written in 10 ms what another thread, waiting for its turns, does in 3 s.
        if self.age + (now - before) >= FLUSH:
            self.flush()

    @property
    def age(self) -> float:
        """Of the oldest row that is in no file [s]."""
        return time.monotonic() - self._since if self._buffer else 0.0

    def flush(self) -> None:
        """Write what is not yet in a file, whole or not at all."""
        with self._writing:
            if waiting := self._buffer[:]:
                table = table_of(waiting)
                self._write_part(table, "part")
                self._tables.append(table)
                # Last of all: what interrupts this is followed by another flush.
                del self._buffer[: len(waiting)]
                self._gather()

    def _gather(self) -> None:
        """Make one part of many small ones."""
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
