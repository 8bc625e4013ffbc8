"""Which plugins a record was flown with: noted when it ends, asked for when it is needed again."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

from fullam.checks import Checker
from fullam.control.controllers import controller_names
from fullam.control.estimators import estimator_names
from fullam.exceptions import FullamWarning, PluginError
from fullam.ownership import LOADED, owner_of

Entry = dict[str, Any]
"""Of one plugin: its "name", its "digest", and what of it "flew", a list."""


def plugins_of(
    controller: str, estimator: str | None, script: Mapping[str, Any] | None
) -> list[Entry]:
    """The plugins that flew, each with its digest and what of it flew; none if there are none.

    Args:
        controller: Name of the controller that flew.
        estimator: Name of the estimator.
        script: What hands did, who may have put another law or estimator in the place of the first.
    """
    flown = {("controller", controller), ("estimator", str(estimator))}
    for done in script["interventions"] if script else ():
        if done["kind"] in ("controller", "estimator"):
            flown.add((done["kind"], done["name"]))
    found: dict[str, Entry] = {}
    for kind, name in sorted(flown):
        plugin = owner_of(kind, name)
        if plugin is not None:
            entry = found.setdefault(plugin.source, {**plugin.to_dict(), "flew": []})
            entry["flew"].append(f"{kind} {name}")
    return [*found.values()]


def check_plugins(plugins: Any, check: Checker) -> None:
    """Each has a name, a digest, and a list of what of it flew."""
    for entry in check.instance("plugins", plugins, list):
        table = check.table("plugins", entry)
        check.known(table, ("name", "digest", "flew"))
        for name in ("name", "digest"):
            check.text(name, table.get(name))
        for thing in check.instance("flew", table.get("flew"), list):
            check.text("flew", thing)


def require_plugins(plugins: list[Entry], where: str) -> None:
    """See that the plugins that a record was flown with are here.

    Args:
        plugins: What the record says of them.
        where: What the message calls the record.

    Raises:
        PluginError: One is not; the message names it.

    Warns:
        FullamWarning: One is another than the one that flew.
    """
    for entry in plugins:
        name, digest = entry["name"], entry["digest"]
        if digest in {plugin.digest for plugin in LOADED.values()}:
            continue
        flew = [thing.split(" ", 1) for thing in entry["flew"]]
        here = {"controller": controller_names(), "estimator": estimator_names()}
        if all(thing in here.get(kind, ()) for kind, thing in flew):
            text = f"{name} is another one than the one that flew ({digest}): bits may differ"
            warnings.warn(text, FullamWarning, stacklevel=3)
            continue
        raise PluginError(
            where,
            ", ".join(entry["flew"]),
            f"flew from the plugin {name} (digest {digest}), which is not loaded",
            f'load it first: fullam.load_plugin("{name}"), or --plugin {name}',
        )
