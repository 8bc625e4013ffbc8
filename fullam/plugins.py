"""Plugins: files and packages that register laws, estimators or scenarios of one's own.

A plugin is one Python file, or a package that can be imported; what it registers while it is loaded
is known by name from then on, as if it came with fullam:

    fullam.load_plugin("my_law.py")            # in Python
    fullam run task-2 --plugin my_law.py       # on the command line, with every verb

    [project.entry-points."fullam.plugins"]    # in the pyproject.toml of a package; it is imported
    my-laws = "my_laws"                        # when a name is asked for that nobody knows

A file is read once: what was loaded is what is digested, noted in records and sent to workers, as
text and not as a path. It may import what stands beside it; a worker on another machine has that
file only if it is installed there.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import sys
import sysconfig
import traceback
import types
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fullam.checks import MOST_FILE_BYTES, shown
from fullam.exceptions import FullamWarning, PluginError
from fullam.ownership import LOADED, LOADING, OWNERS, Plugin, classes_of, restore, withdraw

GROUP = "fullam.plugins"
"""Entry points of installed packages under this name are plugins."""

HERE = Path(__file__).parent

NOTHING = (
    'decorate its law with @fullam.register("my-law"); `fullam new controller my_law.py` writes '
    "one that flies"
)


def load_plugin(source: str | Path) -> types.ModuleType:
    """Load a plugin: its laws, estimators and scenarios are then known by name.

    Twice the same file is one module; a file that has changed meanwhile is loaded anew, and its
    names are what the new text makes of them.

    Args:
        source: Path of a Python file, or name of a module that can be imported.

    Raises:
        PluginError: It does not exist, raises, registers nothing, or registers a name that belongs
            to somebody else; nothing of it is known then. The message has file, line and remedy.
    """
    if not isinstance(source, str | Path) or not str(source).strip():
        remedy = "give the path of a Python file, or the name of a module"
        raise PluginError("load_plugin", "source", f"is {shown(source)}", remedy)
    if isinstance(source, Path) or source.endswith(".py") or "/" in source or "\\" in source:
        return _load_file(Path(source)).module
    return load_module(source).module


def discover() -> None:
    """Load the plugins of installed packages, once a process; one that fails is a warning.

    Warns:
        FullamWarning: One cannot be loaded.
    """
    if _DISCOVERED:
        return
    _DISCOVERED.append(True)
    from importlib.metadata import entry_points

    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        try:
            load_module(entry.module, installed=True)
        except PluginError as error:
            text = f"the installed plugin '{entry.name}' is left out: {error}"
            warnings.warn(text, FullamWarning, stacklevel=2)


_DISCOVERED: list[bool] = []
"""Whether `discover` was called."""


# Files.


def _load_file(path: Path, name: str = "") -> Plugin:
    remedy = "give a Python file; `fullam new controller my_law.py` writes one that flies"
    try:
        if not path.is_file():
            problem = "is no file" if path.exists() else "does not exist"
            raise PluginError(str(path), "plugin", problem, remedy)
        if path.stat().st_size > MOST_FILE_BYTES:
            raise PluginError(str(path), "plugin", "is too large to be a program", remedy)
        source, text = str(path.resolve()), path.read_bytes()
    except (OSError, ValueError) as error:
        raise PluginError(str(path), "plugin", f"cannot be read ({error})", remedy) from error
    return load_text(source, text, name)


def load_text(source: str, text: bytes, name: str = "") -> Plugin:
    """Load a file's text, as it was read here or came from elsewhere."""
    if any(plugin.source == source for plugin in LOADING):
        raise PluginError(source, "plugin", "loads itself", "leave that out")
    digest, old = _digest(text), LOADED.get(source)
    if old is not None and old.digest == digest:
        return old
    name = old.module.__name__ if old else name or _module_name(Path(source))
    before = sys.modules.get(name)
    if old is None and before is not None and _file_of(before) == source:
        module = before  # imported, but not as a plugin: what it holds may be of an older text
        taken = [(registry, key, registry.pop(key)) for registry, key in classes_of(name)]
    else:
        module = types.ModuleType(name)
        module.__file__ = source
        taken = [] if old is None else withdraw(old)
    plugin = Plugin(Path(source).name, module, source, text, digest)

    def execute() -> None:
        sys.modules[name] = module
        exec(compile(text, source, "exec"), module.__dict__)

    try:
        with _beside(source):
            return _register(plugin, execute)
    except BaseException:
        if before is None:
            sys.modules.pop(name, None)
        else:
            sys.modules[name] = before
        restore(old, taken)
        raise


def _register(plugin: Plugin, execute: Callable[[], Any]) -> Plugin:
    """Load a plugin by `execute`; all of it, or nothing."""
    LOADING.append(plugin)
    try:
        execute()
        if not plugin.claims:
            raise PluginError(plugin.source, "plugin", "registers nothing", NOTHING)
    except (Exception, SystemExit) as error:  # whatever it raises is its author's to mend
        withdraw(plugin)
        raise _told(plugin, error) from error
    except BaseException:
        withdraw(plugin)
        raise
    finally:
        LOADING.pop()
    LOADED[plugin.source] = plugin
    return plugin


def _told(plugin: Plugin, error: BaseException) -> PluginError:
    """An error of a plugin, with the line of the plugin that it came from."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith((str(HERE), "<frozen"))
    ]
    # Of a file its own line; of a package, which has many files, the innermost.
    own = [frame for frame in frames if frame.filename == plugin.source] if plugin.text else frames
    where = f"{own[-1].filename}, line {own[-1].lineno}" if own else plugin.source
    if isinstance(error, SyntaxError) and error.filename:
        where = f"{error.filename}, line {error.lineno}"
    if isinstance(error, PluginError):
        if error.where != plugin.source:
            return error  # of another plugin, which this one loads
        return PluginError(where, error.field, error.problem, error.remedy)
    remedy = "mend it there"
    if isinstance(error, ModuleNotFoundError):
        remedy = f"install '{error.name}' here, or do without it"
    return PluginError(where, type(error).__name__, str(error).rstrip(".") or "was raised", remedy)


def blamed(error: BaseException) -> PluginError | None:
    """An error as that of the plugin whose code raised it, or called what did; None if none."""
    files = {frame.filename for frame in traceback.extract_tb(error.__traceback__)}
    for plugin in LOADED.values():
        if plugin.text and plugin.source in files:
            return _told(plugin, error)
    return None


def _module_name(path: Path) -> str:
    """The file's own name, unless a module of that name is another one."""
    name = path.stem
    taken = sys.modules.get(name)
    if taken is not None:
        free = _file_of(taken) == str(path)
    else:
        spec = importlib.util.find_spec(name) if name.isidentifier() else None
        free = spec is None or spec.origin == str(path)
    return name if free and name.isidentifier() else f"{name}_{_digest(str(path).encode())[:8]}"


def _file_of(module: types.ModuleType) -> str | None:
    file = getattr(module, "__file__", None)
    return None if file is None else str(Path(file).resolve())


@contextmanager
def _beside(source: str) -> Iterator[None]:
    """While a file is loaded it may import what stands beside it, behind all that is installed."""
    folder = str(Path(source).parent)
    sys.path.append(folder)
    try:
        yield
    finally:
        sys.path.reverse()  # the last one is ours
        sys.path.remove(folder)
        sys.path.reverse()


# Modules that can be imported.


def load_module(name: str, installed: bool = False) -> Plugin:
    """Load a module by its name; `installed` if its entry point told of it."""
    if name in LOADED:
        return LOADED[name]
    spec = _spec_of(name)
    origin = spec.origin or ""
    if origin.endswith(".py") and "." not in name and not (installed or _is_installed(spec)):
        return _load_file(Path(origin), name)
    files = sorted(p for f in spec.submodule_search_locations or () for p in Path(f).rglob("*.py"))
    files = files or ([Path(origin)] if origin.endswith(".py") else [])
    digest = _digest(b"\0".join(p.name.encode() + b"\0" + p.read_bytes() for p in files))
    module = sys.modules.get(name, types.ModuleType(name))
    plugin = Plugin(name, module, name, b"", digest, installed)

    def execute() -> None:
        if name in sys.modules:  # imported already: what its classes are registered as is its own
            for registry, key in classes_of(name):
                OWNERS[registry.kind, key] = plugin
                plugin.claims.append((registry, key))
            return
        object.__setattr__(plugin, "module", importlib.import_module(name))

    return _register(plugin, execute)


def _spec_of(name: str) -> Any:
    """Where a module is.

    Raises:
        PluginError: There is none, or the package that it is of raises.
    """
    remedy = "install it, or give the path of a file"
    if not all(part.isidentifier() for part in name.split(".")):
        raise PluginError(shown(name), "plugin", "is neither a .py file nor a module", remedy)
    if name.partition(".")[0] == "fullam":
        raise PluginError(name, "plugin", "comes with fullam", "leave it out")
    try:
        spec = importlib.util.find_spec(name)
    except (ModuleNotFoundError, ValueError):
        spec = None
    except Exception as error:  # of the package around it, which is imported to look into it
        raise PluginError(name, type(error).__name__, str(error), "mend it there") from error
    if spec is None:
        with contextlib.suppress(OSError):
            remedy = f"give {name}.py" if Path(f"{name}.py").is_file() else remedy
        raise PluginError(shown(name), "plugin", "is no module that can be imported", remedy)
    return spec


def _is_installed(spec: Any) -> bool:
    """Whether it is a package of several files, or lies where packages are installed."""
    folders = {sysconfig.get_path(kind) for kind in ("purelib", "platlib")}
    in_folder = any(Path(spec.origin).is_relative_to(folder) for folder in folders if folder)
    return spec.submodule_search_locations is not None or in_folder


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
