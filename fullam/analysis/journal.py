"""Results that are kept one by one as they come, in a file that only grows.

Every line is a checksum and a JSON text, synced to the disk: a kill loses nothing but a torn last
line, which is not taken for a result. The first line says under which conditions all of them came.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from fullam.analysis.provenance import canonical_json, short_digest
from fullam.exceptions import CampaignError
from fullam.files import locked

MOST_BYTES = 1 << 28
"""A journal is read whole; nothing here writes a larger one."""


def _write(file: IO[bytes], value: Any) -> None:
    text = canonical_json(value).encode()
    file.write(short_digest(text).encode() + b" " + text + b"\n")
    file.flush()
    os.fsync(file.fileno())


def _read(path: Path) -> tuple[list[Any], int]:
    """Values of the whole lines, up to the first that is damaged, and how many bytes they take."""
    if path.stat().st_size > MOST_BYTES:
        raise CampaignError(str(path), "file", "is no journal of this package", "remove it")
    values, size = [], 0
    for line in path.read_bytes().splitlines(keepends=True):
        digest, _, text = line.partition(b" ")
        if not line.endswith(b"\n") or short_digest(text[:-1]).encode() != digest:
            break
        values.append(json.loads(text))
        size += len(line)
    return values, size


class Journal:
    """Results by key; see the module's text.

    Attributes:
        path: The file.
    """

    def __init__(self, path: str | Path, file: IO[bytes], found: dict[str, Any]) -> None:
        """Take an open file and what it holds; `open_journal` gives one."""
        self.path, self._file, self._found = Path(path), file, found

    def __len__(self) -> int:
        """Number of results."""
        return len(self._found)

    def get(self, key: Any) -> Any:
        """What is kept under a key; None if nothing is."""
        return self._found.get(canonical_json(key))

    def put(self, key: Any, value: Any) -> None:
        """Keep a result, on the disk when this returns."""
        self._found[canonical_json(key)] = value
        _write(self._file, [key, value])

    def once(self, key: Any, work: Callable[[], Any]) -> Any:
        """What is kept under a key, or else the result of `work`, which is kept."""
        if self.get(key) is None:
            self.put(key, work())
        return self.get(key)


@contextmanager
def open_journal(
    path: str | Path, conditions: Mapping[str, Any], start_over: bool = False
) -> Iterator[Journal]:
    """A journal, locked while the block runs.

    Args:
        path: The file; it is made if it does not exist.
        conditions: What its results depend on, as JSON values.
        start_over: Drop results that came under other conditions instead of refusing them.

    Raises:
        CampaignError: Another process writes there, or the results came under other conditions.
    """
    path, wanted = Path(path), json.loads(canonical_json(conditions))
    with locked(path):
        path.touch()
        values, size = _read(path)
        if values and values[0] != wanted:
            if not start_over:
                differing = _differing(values[0], wanted)
                raise CampaignError(
                    str(path),
                    "results",
                    f"came under other conditions ({differing})",
                    "remove it, or name another file",
                )
            values, size = [], 0
        with path.open("r+b") as file:
            file.truncate(size)  # nothing shall follow a torn line
            file.seek(size)
            if not values:
                _write(file, wanted)
            found = {canonical_json(key): value for key, value in values[1:]}
            yield Journal(path, file, found)


def _differing(one: Any, other: Mapping[str, Any]) -> str:
    if not isinstance(one, dict):
        return "of another kind"
    names = sorted(k for k in {*one, *other} if one.get(k) != other.get(k))
    return f"{', '.join(names)} differ"
