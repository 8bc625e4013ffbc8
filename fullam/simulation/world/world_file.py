"""A world in MuJoCo's own format, MJCF, around a flight: anybody's scene from a file.

What a flight adds to it is the vehicle; see `mujoco.spec` for what of the scene it overrides. A
body named "tool" is no part of the scene: it is mounted on the vehicle's tool, its origin at the
tool's point and its axes along the tool's, in the place of the small ball that touches otherwise.
It weighs what it weighs there, which the law is not told.

The least that somebody else's vehicle in somebody else's scene takes is their URDF, a vehicle's
TOML that names `platform`, `arm` and `tool` and has a `[[rotor]]` table a rotor (position, axis,
spin, k_f, k_tau, max_speed; see `model.definition`), their MJCF, and a scenario's TOML:

    name = "room"
    vehicle = "vehicle.toml"
    world_file = "scene.xml"

Its joints are in the record: `run.scene_joints` names them, `run.moved("door")` tells what one did.

A record holds the scene's text. Meshes, textures and parts of it that stand in other files it holds
by a digest alone: to fly again, they must be where they were, and unchanged.
"""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from fullam.checks import MOST_FILE_BYTES, Checker, read_text
from fullam.exceptions import ScenarioError

FOLDERS = ("meshdir", "texturedir", "assetdir")
"""Where a scene's compiler may look for its files."""

MOST_ASSET_BYTES = 256 << 20
"""A mesh that is larger is not read."""


@dataclass(frozen=True)
class WorldFile:
    """A scene.

    Attributes:
        path: The file it was read from, or a name for a text of one's own.
        text: Its MJCF.
        digest: SHA-256 of all files that it names; empty if it names none.
    """

    path: str
    text: str
    digest: str = ""

    def __post_init__(self) -> None:
        """Check the texts."""
        check = Checker("world_file", ScenarioError)
        check.text("path", self.path)
        check.text("digest", self.digest, prose=True)
        if isinstance(self.text, str) and len(self.text) > MOST_FILE_BYTES:
            raise check.refuse("text", f"has {len(self.text)} characters", "split the scene")
        if not isinstance(self.text, str) or _root(self.text, self.path).tag != "mujoco":
            raise ScenarioError(
                f"world_file '{self.path}'", "text", "is no MJCF", "its root element is <mujoco>"
            )

    @classmethod
    def read(cls, path: str | Path) -> WorldFile:
        """Read a scene.

        Raises:
            ScenarioError: There is no such file, it is no MJCF, or a file that it names is missing.
        """
        path = Path(path)
        text = read_text(path, Checker(str(path), ScenarioError))
        return cls(str(path), text, _digest(text, path))

    def check_files(self) -> None:
        """See whether the files that the scene names are still what they were.

        Raises:
            ScenarioError: One of them is missing, or something in them has changed; or it names
                some and nobody has seen what they were.
        """
        where = f"world_file '{self.path}'"
        if not self.digest:
            if any(_files_of(element) for element in _root(self.text, self.path).iter()):
                remedy = "give the scene's path, not its text"
                raise ScenarioError(where, "digest", "is missing, and it names files", remedy)
            return
        remedy = "put the scene's files back where they were; a record holds their digest alone"
        if not Path(self.path).is_file():
            raise ScenarioError(where, "file", "is missing, and names others", remedy)
        if WorldFile.read(self.path) != self:
            raise ScenarioError(where, "digest", "is another than that of its files now", remedy)

    def to_dict(self) -> dict[str, Any]:
        """JSON values; `from_dict` is the inverse."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Any) -> WorldFile:
        """The inverse of `to_dict`. A path is no such thing: a record opens no files.

        Raises:
            ScenarioError: A field that it does not have, or one that is missing.
        """
        check = Checker("world_file", ScenarioError)
        values = check.table("table", data)
        check.known(values, tuple(f.name for f in fields(cls)))
        for name in ("path", "text"):
            check.text(name, values.get(name), prose=True)
        return cls(**values)


def _root(text: str, path: str) -> ET.Element:
    where = f"world_file '{path}'"
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ScenarioError(where, "XML", "has a document type", "give plain MJCF")
    try:
        return ET.fromstring(text)
    except (ET.ParseError, ValueError) as error:
        raise ScenarioError(where, "XML", str(error), "give well-formed MJCF") from error


def _digest(text: str, path: Path) -> str:
    """SHA-256 of the files that a scene names; empty if it names none."""
    hashed, some = hashlib.sha256(), False
    for file in _named(text, path, set()):
        hashed.update(file.read_bytes())
        some = True
    return hashed.hexdigest() if some else ""


def _named(text: str, path: Path, seen: set[Path]) -> Iterator[Path]:
    """The files that a scene names, those that they name in turn behind them."""
    root = _root(text, str(path))
    folders = [path.parent]
    for compiler in root.iter("compiler"):
        folders += [path.parent / compiler.get(key, "") for key in FOLDERS if compiler.get(key)]
    where = f"world_file '{path}'"
    for element, name in ((e, name) for e in root.iter() for name in _files_of(e)):
        found = next((f for f in (folder / name for folder in folders) if f.is_file()), None)
        if found is None:
            raise ScenarioError(where, f"<{element.tag}>", f"'{name}' is missing", "put it there")
        if found in seen:
            continue
        if found.stat().st_size > MOST_ASSET_BYTES:
            raise ScenarioError(where, f"<{element.tag}>", f"'{name}' is too large", "simplify it")
        seen.add(found)
        yield found
        if found.suffix == ".xml":
            yield from _named(read_text(found, Checker(where, ScenarioError)), found, seen)


def _files_of(element: ET.Element) -> list[str]:
    """What an element names as a file; a texture may have six of them, `fileup` and so on."""
    return [text for name, text in element.attrib.items() if name.startswith("file") and text]
