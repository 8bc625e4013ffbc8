"""What decides a row, as digests: our sources, versions, vehicles, and what a user registered.

A row may be continued, or come from another process, only where all of these are the same.
"""

from __future__ import annotations

import dis
import functools
import hashlib
import importlib.metadata
import json
import platform
import sys
import sysconfig
import types
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from fullam.model.loading import read_definition, read_urdf, vehicle_path
from fullam.model.vehicle import Vehicle
from fullam.version import __version__

DECISIVE = ("pin", "numpy", "scipy", "proxsuite", "numba", "llvmlite")
"""Packages that decide the last bits of a flight; those that are not installed decide nothing."""


def short_digest(data: bytes) -> str:
    """Sixteen hexadecimal digits of SHA-256."""
    return hashlib.sha256(data).hexdigest()[:16]


def canonical_json(value: Any) -> str:
    """JSON with sorted keys: equal data give equal text."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"))


def fingerprint(value: Any) -> str:
    """Short digest of JSON-able data."""
    return short_digest(canonical_json(value).encode())


@functools.cache
def versions() -> dict[str, str]:
    """Versions of fullam, Python and the packages that decide a flight's last bits."""
    found = {"fullam": __version__, "python": platform.python_version()}
    for name in DECISIVE:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


ROOMS = ("numbers", "model", "dynamics", "control", "simulation")
FIGURES = (
    *("asked_motion", "deviation", "figure_records", "figures", "high_pass", "judge", "judged"),
    *("metrics", "response"),
)
"""Rooms and files of this room whose code decides what a row says."""


def _sources() -> Iterable[Path]:
    root = Path(__file__).parents[1]
    for room in ROOMS:
        yield from sorted((root / room).rglob("*.py"))
    yield from (root / "analysis" / f"{name}.py" for name in FIGURES)


@functools.cache
def code_digest() -> str:
    """Digest of the sources that decide what a row says, so that stale rows are never reused."""
    return short_digest(b"".join(source.read_bytes() for source in _sources()))


def vehicle_digest(vehicle: Vehicle) -> str:
    """Digest of a vehicle's data: the same name may be another vehicle tomorrow."""
    return vehicle.digest()


def cached_vehicle(name: str) -> Vehicle:
    """The vehicle of that name, built once a process for each state of its files."""
    path = vehicle_path(name)
    definition = read_definition(path)
    urdf = read_urdf(definition, path)
    return _built(json.dumps(definition, sort_keys=True, default=str), urdf, path)


@functools.lru_cache(maxsize=8)
def _built(definition: str, urdf: str, path: Path) -> Vehicle:
    return Vehicle.from_definition(json.loads(definition), urdf, str(path))


def is_ours(cls: type) -> bool:
    """Whether a class comes with fullam, so that `code_digest` covers it."""
    return _package(cls) == "fullam"


def class_digest(cls: type) -> str:
    """Digest of what a class does, as it is loaded now: methods, settings, helpers.

    It follows the names that the code uses through functions, classes, constants and modules of
    the user's own; comments and line numbers do not count. What the standard library and installed
    packages bring stands with its name alone, but for the package that the class itself is of.
    """
    walk = _Walk(_package(cls))
    walk.visit(cls)
    return walk.digest.hexdigest()[:16]


def _package(thing: Any) -> str:
    return str(getattr(thing, "__module__", None) or "").partition(".")[0]


@functools.cache
def _installed(package: str) -> bool:
    """Whether a top-level package is the standard library's or an installed one."""
    if package in sys.stdlib_module_names or package in ("builtins", "fullam"):
        return True
    file = getattr(sys.modules.get(package), "__file__", None)
    if file is None:
        return False
    folders = {sysconfig.get_path(name) for name in ("purelib", "platlib")}
    return any(Path(file).is_relative_to(folder) for folder in folders if folder)


class _Walk:
    """Feeds everything that is reachable from a class to one digest, each thing once."""

    def __init__(self, own: str) -> None:
        self.own, self.digest = own, hashlib.sha256()
        self.seen: dict[int, Any] = {}  # holds the things, so that no id is used twice
        self.inside: list[int] = []

    def say(self, *texts: str) -> None:
        for text in texts:
            self.digest.update(text.encode(errors="surrogatepass") + b"\0")

    def _foreign(self, package: str) -> bool:
        return package != self.own and _installed(package)

    def visit(self, thing: Any) -> None:
        """Digest one thing and what it uses."""
        if thing is None or isinstance(thing, bool | float | complex | str | bytes):
            self.say(type(thing).__name__, repr(thing))
        elif isinstance(thing, int):
            self.say("int", hex(thing))
        elif isinstance(thing, np.ndarray):
            self.say("array", str(thing.dtype), str(thing.shape), repr(thing.tolist()))
        elif isinstance(thing, dict | list | tuple | set | frozenset):
            # Equal containers count alike, whether or not they are one object.
            if id(thing) not in self.inside:
                self.inside.append(id(thing))
                self._container(thing)
                self.inside.pop()
        else:
            self._once(thing)

    def _once(self, thing: Any) -> None:
        if id(thing) in self.seen:
            self.say("seen", type(thing).__name__)
            return
        self.seen[id(thing)] = thing
        if isinstance(thing, types.CodeType):
            self._code(thing)
        elif isinstance(thing, type):
            self._class(thing)
        elif isinstance(thing, types.ModuleType):
            self._module(thing)
        elif isinstance(thing, types.FunctionType):
            self._function(thing)
        else:
            self._object(thing)

    def _container(self, thing: Any) -> None:
        self.say(type(thing).__name__, str(len(thing)))
        if isinstance(thing, set | frozenset):
            self.say(*sorted(map(repr, thing)))
            return
        for value in thing.items() if isinstance(thing, dict) else thing:
            self.visit(value)

    def _code(self, code: types.CodeType) -> None:
        self.say("code", code.co_code.hex(), *code.co_names, *code.co_varnames, *code.co_freevars)
        for constant in code.co_consts:
            self.visit(constant)

    def _function(self, function: types.FunctionType) -> None:
        self.say("function", function.__qualname__)
        if self._foreign(_package(function)):
            return
        self.visit(function.__code__)
        self.visit(function.__defaults__)
        self.visit(function.__kwdefaults__)
        for cell in function.__closure__ or ():
            self.visit(cell)
        for name in sorted(_global_names(function.__code__)):
            if name in function.__globals__:
                self.say(name)
                self.visit(function.__globals__[name])
        self.visit(getattr(function, "__wrapped__", None))

    def _class(self, cls: type) -> None:
        self.say("class", cls.__qualname__)
        if self._foreign(_package(cls)):
            return
        for base in cls.__bases__:
            self.visit(base)
        for name, value in sorted(vars(cls).items()):
            if name not in IRRELEVANT:
                self.say(name)
                self.visit(value)

    def _module(self, module: types.ModuleType) -> None:
        name = module.__name__
        self.say("module", name)
        if self._foreign(name.partition(".")[0]):
            return
        for key, value in sorted(vars(module).items()):
            if not key.startswith("__"):
                self.say(key)
                self.visit(value)

    def _object(self, thing: Any) -> None:
        self.say(type(thing).__qualname__)
        if isinstance(thing, staticmethod | classmethod):
            self.visit(thing.__func__)
        elif isinstance(thing, property):
            self.visit(thing.fget)
        elif isinstance(thing, types.CellType):
            # A cell is empty while the function that fills it has not run.
            self.visit(getattr(thing, "cell_contents", None))
        elif isinstance(thing, functools.partial):
            self.visit((thing.func, thing.args, thing.keywords))
        else:
            # A compiled function keeps its Python source in `py_func`; a decorator's in
            # `__wrapped__`; an object of the user's own in its class and its fields.
            for name in ("py_func", "__wrapped__", "func"):
                self.visit(getattr(thing, name, None))
            if not self._foreign(_package(type(thing))):
                self.visit(type(thing))
                self.visit(dict(sorted(getattr(thing, "__dict__", {}).items())))


IRRELEVANT = frozenset(
    {
        *("__dict__", "__weakref__", "__doc__", "__module__", "__qualname__", "__firstlineno__"),
        *("_abc_impl", "__abstractmethods__", "__static_attributes__", "name"),
        *("__annotations__", "__annotations_cache__", "__annotate_func__", "__annotate__"),
    }
)
"""What a class holds that changes no flight, or differs between copies of it."""


def _global_names(code: types.CodeType) -> set[str]:
    """Names of globals that a function and the functions inside it use; no attributes."""
    found = {
        str(step.argval)
        for step in dis.get_instructions(code)
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME")
    }
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            found |= _global_names(constant)
    return found
