"""Where packages of robots keep their files."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path


def package_roots(package: str) -> list[Path]:
    """Folders under which an installed package may have its `share`, likeliest first.

    Wheels made by cmeel, as example-robot-data's, have one of their own; conda and system packages
    share the environment's.
    """
    from importlib.metadata import PackageNotFoundError, distribution  # slow to import

    roots = [Path(sys.prefix)]
    with contextlib.suppress(PackageNotFoundError):  # conda and system packages have no metadata
        roots.insert(0, Path(str(distribution(package).locate_file("cmeel.prefix"))))
    return roots
