"""pyarrow, which keeps the rows of campaigns, or the error that says how to get it."""

from fullam.exceptions import MissingDependency

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ImportError as error:  # pragma: no cover - depends on the installation
    raise MissingDependency("a campaign", "pyarrow", "campaign") from error

__all__ = ["pa", "pq"]
