"""Plugins on their way to another process: as their text, or as the name of a package.

A worker, on this machine or another one, has to know what its work is about before it unpacks the
work; so what travels begins with the plugins that are loaded here, which load themselves there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fullam.ownership import LOADED, Plugin
from fullam.plugins import load_module, load_text


@dataclass(frozen=True)
class Luggage:
    """A plugin on its way: where it arrives it is loaded, from its text or by its name."""

    source: str
    name: str
    text: bytes

    def load(self) -> Plugin:
        """The plugin, loaded.

        Raises:
            PluginError: A package is not installed here, or what the file imports is not.
        """
        return load_text(self.source, self.text, self.name) if self.text else load_module(self.name)


def equipped(work: Callable[..., Any]) -> Callable[..., Any]:
    """Work that, in another process, begins with the plugins of this one.

    Those of installed packages stay here: where they are installed, they are found.
    """
    carried = tuple(
        Luggage(plugin.source, plugin.module.__name__, plugin.text)
        for plugin in LOADED.values()
        if not plugin.installed
    )
    return _Equipped(carried, work) if carried else work


class _Equipped:
    """See `equipped`."""

    def __init__(self, carried: tuple[Luggage, ...], work: Callable[..., Any]) -> None:
        self.carried, self.work = carried, work

    def __call__(self, *items: Any) -> Any:
        return self.work(*items)

    def __reduce__(self) -> tuple[Any, ...]:
        # A pickle is read from its front: what stands behind may name classes of the plugins.
        return _arrived, (tuple(_Loaded(one) for one in self.carried), self.work)


class _Loaded:
    """A piece of luggage that unpacks itself."""

    def __init__(self, luggage: Luggage) -> None:
        self.luggage = luggage

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpacked, (self.luggage,)


def _unpacked(luggage: Luggage) -> Luggage:
    luggage.load()
    return luggage


def _arrived(carried: tuple[Luggage, ...], work: Callable[..., Any]) -> _Equipped:
    return _Equipped(carried, work)
