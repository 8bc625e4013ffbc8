"""Whose a registered name is: what a plugin registers is its own, and nobody takes it over."""

from __future__ import annotations

import types
from dataclasses import dataclass, field
from typing import Any, TypeVar

from fullam.exceptions import PluginError

Thing = TypeVar("Thing")


class Names(dict[str, Thing]):
    """A registry, as plugins see it: things by their names, all of one kind."""

    kind: str


@dataclass(frozen=True, eq=False)
class Plugin:
    """What was loaded.

    Attributes:
        name: The file's name, or the package's.
        module: The module.
        source: What it was loaded from: the path of a file; the name of a package.
        text: The file as it was read; empty for a package.
        digest: Of the file, or of a package's files: 16 hexadecimal digits.
        installed: Whether it was found by its entry point, as it will be elsewhere.
        claims: What it registered: registries and names.
    """

    name: str
    module: types.ModuleType
    source: str
    text: bytes
    digest: str
    installed: bool = False
    claims: list[tuple[Names[Any], str]] = field(default_factory=list)

    @property
    def names(self) -> tuple[str, ...]:
        """What it registered, "controller my-law"."""
        return tuple(dict.fromkeys(f"{registry.kind} {name}" for registry, name in self.claims))

    def to_dict(self) -> dict[str, str]:
        """What a record says of it: name and digest."""
        return {"name": self.name, "digest": self.digest}


LOADED: dict[str, Plugin] = {}
"""Plugins by their source."""

OWNERS: dict[tuple[str, str], Plugin] = {}
"""(kind, name) of what plugins registered -> whose it is."""

LOADING: list[Plugin] = []
"""The plugin that is being loaded, if one is; it may load another."""

REGISTRIES: list[Names[Any]] = []
"""All registries, for what was registered before it was loaded as a plugin."""


def owner_of(kind: str, name: str | None) -> Plugin | None:
    """The plugin that registered a name; None if none did."""
    return OWNERS.get((kind, str(name)))


def know(registry: Names[Any]) -> None:
    """Look after a registry from now on."""
    REGISTRIES.append(registry)


def claim(registry: Names[Any], name: str, thing: Any) -> None:
    """A name is about to be registered.

    Raises:
        PluginError: By a plugin, and it is somebody else's.
    """
    key = (registry.kind, name)
    if not LOADING:
        if registry.get(name) is not thing:
            OWNERS.pop(key, None)
        return
    loading, owner = LOADING[-1], OWNERS.get(key)
    if name in registry and owner is not loading:
        home = str(getattr(registry[name], "__module__", "somebody who registered it before"))
        whose = "fullam" if home.startswith("fullam.") else home if owner is None else owner.source
        problem = f"{key[0]} '{name}' is taken: it belongs to {whose}"
        raise PluginError(loading.source, "register", problem, "register it under another name")
    OWNERS[key] = loading
    loading.claims.append((registry, name))


Taken = list[tuple[Names[Any], str, Any]]
"""What was taken out of registries."""


def withdraw(plugin: Plugin) -> Taken:
    """Forget what a plugin registered; gives back what that was."""
    taken = []
    for registry, name in plugin.claims:
        if OWNERS.get((registry.kind, name)) is plugin:
            del OWNERS[registry.kind, name]
            taken.append((registry, name, registry.pop(name)))
    return taken


def restore(plugin: Plugin | None, taken: Taken) -> None:
    """Put back what was taken out, as the plugin's."""
    for registry, name, thing in taken:
        registry[name] = thing
        if plugin is not None:
            OWNERS[registry.kind, name] = plugin


def classes_of(package: str) -> list[tuple[Names[Any], str]]:
    """What the classes of a module, or of a package's modules, are registered as."""
    found = []
    for registry in REGISTRIES:
        for name, thing in registry.items():
            module = str(getattr(thing, "__module__", ""))
            if module == package or module.startswith(f"{package}."):
                found.append((registry, name))
    return found
