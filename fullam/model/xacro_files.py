"""xacro files, the macros that many URDFs are generated from; with the optional `xacrodoc`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.parsers.expat import ExpatError

from fullam.exceptions import MissingDependency, VehicleError


def expand_xacro(path: Path, arguments: Mapping[str, Any], where: str) -> str:
    """The URDF that a xacro file stands for.

    Files that it includes are looked for beside it, packages (`$(find name)`) in the environment
    and in the folders above it; no ROS is needed.

    Args:
        path: The xacro file.
        arguments: Values of its `<xacro:arg>`s.
        where: What an error message names as its source.

    Raises:
        MissingDependency: `xacrodoc` is not installed.
        VehicleError: The file cannot be read or expanded.
    """
    try:
        import xacro
        from xacrodoc import packages
    except ImportError as error:
        raise MissingDependency(f"the xacro file '{path.name}'", "xacrodoc", "xacro") from error
    packages.walk_up_from(path)
    mappings = {name: str(value) for name, value in arguments.items()}
    try:
        document = xacro.process_file(str(path), mappings=mappings)
    except (xacro.XacroException, packages.PackageNotFoundError, ExpatError, OSError) as error:
        raise VehicleError(
            where, "urdf", f"'{path}' cannot be expanded ({error})", "mend it, or give it its args"
        ) from error
    return str(document.documentElement.toxml())
