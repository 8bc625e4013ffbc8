"""Files of one's own that are wrong on purpose: settings of a law, and plugins."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from answers import answered, folder, whole_run
from hypothesis import strategies as st
from values import damaged, document, mostly, toml_values, torn

import fullam
from fullam.cli.scaffolding import TEMPLATES
from fullam.control.controllers import controller_names, load_settings, make_settings
from fullam.exceptions import FullamError
from fullam.ownership import LOADED, withdraw
from fullam.plugins import load_plugin
from fullam.simulation.scenarios.scenario import Scenario

# --- settings ---------------------------------------------------------------------------------

WHOLE_SETTINGS: tuple[dict[str, Any], ...] = tuple(
    {
        "controller": law,
        "estimator": "kalman",
        "settings": {k: v for k, v in make_settings(law).to_dict().items() if v is not None},
        "tuning": {"vehicles": {"fullam": "0123456789abcdef"}, "seed": 0, "cost": [1.0, 2.0]},
    }
    for law in controller_names()
)

settings_files = st.sampled_from(WHOLE_SETTINGS).flatmap(
    lambda whole: mostly(
        damaged(whole, toml_values).map(lambda table: document(table).encode()),
        torn(document(whole).encode()),
    )
)


def attack_settings(case: bytes) -> None:
    """Settings that are accepted can be flown, and end as numbers or in words."""
    whole_run()
    path = folder() / "g.toml"
    path.write_bytes(case)

    def fly() -> bool:
        file = load_settings(path)
        law = file.controller or "dc-pid"
        run = fullam.simulate(Scenario("brief", duration=0.05), law, settings=file, throw=False)
        return run.diverged or bool(np.isfinite(run.pose).all())

    assert answered(fly) is not False


# --- plugins ----------------------------------------------------------------------------------

WHOLE_PLUGINS = tuple(
    (TEMPLATES / f"{name}.py").read_text(encoding="utf-8")
    for name in ("controller", "kernel_controller", "estimator")
)

LAW = """import numpy as np
import fullam
from dataclasses import dataclass, field

{before}

{decorator}
class Law({base}):
    {settings}

    def reset(self, measurement, reference):
        {reset}

    def wrench(self, t, measurement, reference):
        {set}
        return {wrench}

    def delivered(self, wrench_W, missing_W):
        pass

{after}
"""

GOOD = {
    **{"before": "", "after": "", "decorator": '@fullam.register("hostile-law")'},
    **{"base": "fullam.Controller", "settings": "", "reset": "pass", "set": "pass"},
    "wrench": "np.array([0, 0, 30.0, 0, 0, 0])",
}
RAISING = (
    *("raise ValueError", "raise RuntimeError('a\\nb\\x1b[31m')", "raise SystemExit(3)", "1 / 0"),
    *("raise fullam.FullamError('x')", "raise MemoryError", "raise OSError(2, 'no')", "assert 0"),
    *("raise KeyError", "raise StopIteration", "raise RecursionError", "raise Warning('w')"),
    *("import no_such_module_at_all", "exit()", "x = y", "yield 1", "return", "await x", "(:"),
    *("f = lambda: f()\nf()", "raise ExceptionGroup('a', [OSError()])"),
)  # fmt: skip
NAMES = (
    *('""', '" "', "None", "3", '"pid"', '"a,b"', '"a@b"', '"x" * 5000', '"\\x1b[31m"', '"Ω"'),
    *('"a\\0b"', '"../up"', '"a.toml"', '"fused"', "object()", '"--json"', '"a b"', "b'x'", "[]"),
)
BASES = (
    *("object", "fullam.Estimator", "fullam.Run", "Exception", "type", "fullam.Controller, dict"),
    "fullam.control.dc_pid.DcPid",
)
SETTINGS = (
    *("Settings = None", "Settings = 3", "Settings = dict", "Settings = fullam.Run"),
    *("estimator = 'nobody'", "estimator = None", "estimator = 3", "name = None", "period = 0"),
    *(
        "def __init__(self): pass",
        "def __init__(self, *a): pass",
        "def __init__(self, *a): raise ValueError('in init')",
    ),
    *(
        f"@dataclass(frozen=True)\n    class Settings:\n        gain: {field}"
        for field in (
            *("object = field(default_factory=object)", "float = 1 / 0", "float"),
            *("float = float('nan')", "tuple = (1, 2, lambda: 3)", "int = 10**400"),
            *("float = fullam.tunable(1, 'a', [])", "float = fullam.tunable(1, 2, 1)"),
        )
    ),
)
WRENCHES = (
    *("None", "3", "[]", "np.zeros(5)", "np.zeros((6, 1))", "'abcdef'", "list('abcdef')", "{}"),
    *("np.full(6, np.nan)", "np.full(6, np.inf)", "np.full(6, 1e308)", "np.zeros(6, complex)"),
    *("[1j] * 6", "np.array([None] * 6)", "np.zeros(6, dtype=bool)", "np.ma.masked_all(6)", "self"),
    *("[10**400] * 6", "[np.zeros(2)] * 6", "np.zeros(6, 'M8[s]')", "np.zeros(6, 'S3')", "..."),
)  # fmt: skip
SETTING = (
    *("self.u_pid = None", "self.u_pid = 'abcdef'", "self.u_dc = np.full(6, np.nan)"),
    *("self.u_pid = [1j] * 6", "self.u_dc = [None] * 6", "self.u_pid = np.zeros((2, 3))"),
    *("measurement.q = None", "measurement.q[:] = np.nan", "reference.pose = 'x'"),
    *("self.vehicle = None", "self.axes = None", "measurement.v[:] = 1e300", "self.settings = 3"),
)  # fmt: skip
AFTER = (
    *("fullam.register_scenario(None)", "fullam.register_scenario(fullam.Scenario('task-1'))"),
    *("fullam.register('b')(Law)", "fullam.register('hostile-law')(Law)", "__file__ = 3"),
    *("fullam.load_plugin(__file__)", "fullam.load_plugin('no.py')", "__name__ = None"),
    *("fullam.register_estimator('e')(Law)", "fullam.register_estimator('e')(3)"),
    *("import sys; del sys.modules[__name__]", "import sys; sys.modules[__name__] = 3"),
)  # fmt: skip
SPOILT = {
    **{"before": RAISING, "after": (*AFTER, *RAISING), "base": BASES, "settings": SETTINGS},
    **{"wrench": WRENCHES, "set": SETTING},
    "decorator": tuple(f"@fullam.register({name})" for name in NAMES),
}


@st.composite
def own_laws(draw: st.DrawFn) -> bytes:
    """A small law with one or two parts that do not belong there."""
    parts = dict(GOOD)
    for name in draw(st.lists(st.sampled_from(sorted(SPOILT)), min_size=1, max_size=2)):
        parts[name] = draw(st.sampled_from(SPOILT[name]))
    return LAW.format(**parts).encode()


@st.composite
def changed_templates(draw: st.DrawFn) -> bytes:
    """What `fullam new` writes, with one to three lines removed, doubled or moved."""
    lines = draw(st.sampled_from(WHOLE_PLUGINS)).splitlines()
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(lines) - 1))
        match draw(st.sampled_from(("remove", "double", "move", "indent"))):
            case "remove" if len(lines) > 1:
                del lines[at]
            case "double":
                lines.insert(at, lines[at])
            case "move":
                lines.insert(draw(st.integers(0, len(lines) - 1)), lines.pop(at))
            case "indent":
                lines[at] = f"    {lines[at]}"
    return "\n".join(lines).encode()


plugins = st.one_of(
    own_laws(),
    own_laws(),
    changed_templates(),
    st.sampled_from((b"", b"\0", b"\xff", b"(" * 5000, b"x = " + b"9" * 5000, b"# coding: x\n")),
)


def attack_plugin(case: bytes) -> None:
    """A plugin is loaded whole or leaves nothing; what it raises in flight is told as its own."""
    whole_run()
    path = folder() / "hostile_law.py"
    path.write_bytes(case)
    before = set(controller_names()), set(sys.modules)
    try:
        module = answered(lambda: load_plugin(path))
        if module is None:
            assert set(controller_names()) == before[0], "something of it stayed"
            assert "hostile_law" not in set(sys.modules) - before[1]
            return
        answered(lambda: [_flown(law) for law in set(controller_names()) - before[0]])
    finally:
        plugin = LOADED.pop(str(path.resolve()), None)
        if plugin is not None:
            withdraw(plugin)
        sys.modules.pop("hostile_law", None)


def _flown(law: str) -> bool:
    """A short flight; what the law itself raises is its author's, and comes as it is."""
    try:
        run = fullam.simulate(Scenario("brief", duration=0.05), law, driver="python", throw=False)
    except FullamError:
        raise
    except Exception as error:
        if _is_the_laws(error):
            return True
        raise
    return len(run) <= 6


def _is_the_laws(error: BaseException) -> bool:
    """Whether the innermost frame of an error is in the law's own file."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return trace is not None and "hostile_law" in trace.tb_frame.f_code.co_filename
