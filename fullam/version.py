"""The version of this package, and of others."""

from __future__ import annotations

__version__ = "0.1.0"
"""The build reads it from here: looking it up among the installed packages takes 20 ms."""


def version_of(package: str) -> str:
    """Version of an installed package.

    Raises:
        PackageNotFoundError: It is not installed.
    """
    from importlib.metadata import version  # slow to import

    return version(package)
