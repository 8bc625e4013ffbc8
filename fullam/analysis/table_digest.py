"""A digest of a table's content, whatever way it is laid out in memory or in a file.

Parquet's pages have checksums, its footer has none: a flipped bit there can rename a column, change
a count or what the stamp says. So the stamp carries a digest of itself and of all values.
"""

from __future__ import annotations

import hashlib
import json

from fullam.analysis.arrow import pa


def table_digest(rows: pa.Table, stamp: bytes) -> str:
    """Digest of a stamp, and of the names, types, nulls and values of all columns."""
    digest = hashlib.sha256(stamp)
    for field in rows.schema:
        digest.update(f"\0{field.name}\0{_kind(field.type)}\0".encode())
        _add(digest, rows.column(field.name).combine_chunks())
    return digest.hexdigest()[:32]


def _kind(kind: pa.DataType) -> str:
    """A type by name; that of a list without the name that its entries have inside the file."""
    return f"list<{kind.value_type}>" if pa.types.is_list(kind) else str(kind)


def _add(digest: hashlib._Hash, column: pa.Array) -> None:
    if isinstance(column, pa.ChunkedArray):  # of no rows
        column = pa.array([], column.type)
    digest.update(column.is_null().to_numpy(zero_copy_only=False).tobytes())
    if pa.types.is_list(column.type):
        lengths = column.value_lengths().fill_null(0)
        digest.update(lengths.to_numpy(zero_copy_only=False).tobytes())
        _add(digest, column.flatten())
    elif pa.types.is_floating(column.type):
        digest.update(column.fill_null(0.0).to_numpy(zero_copy_only=False).tobytes())
    else:
        digest.update(json.dumps(column.to_pylist()).encode())
