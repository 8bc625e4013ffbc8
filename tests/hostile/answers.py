"""What may come of an attack: an answer, or a refusal in words, soon."""

from __future__ import annotations

import contextlib
import functools
import signal
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

import fullam
from fullam.exceptions import FullamError, FullamWarning
from fullam.ownership import LOADED, withdraw
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.world.world_file import WorldFile

PATIENCE = 10
"""What takes longer hangs [s of the processor; on a machine that is busy, six times that]."""


OUTCOMES: Counter[str] = Counter()
"""How often an attack was refused, and how often what it brought was taken."""


@dataclass(frozen=True)
class Attack:
    """A strategy and what is done with its cases."""

    name: str
    cases: st.SearchStrategy[Any]
    happen: Callable[[Any], None]


class Hang(BaseException):
    """Nobody may catch it by accident."""


@contextlib.contextmanager
def patience(seconds: int = PATIENCE) -> Iterator[None]:
    """Ends what takes too long."""

    def ring(*_: object) -> None:
        raise Hang(f"no answer after {seconds} s")

    clocks = {signal.SIGPROF: signal.ITIMER_PROF, signal.SIGALRM: signal.ITIMER_REAL}
    before = {number: signal.signal(number, ring) for number in clocks}
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, 6 * seconds)
    try:
        yield
    finally:
        for number, clock in clocks.items():
            signal.setitimer(clock, 0.0)
            signal.signal(number, before[number])


def forget_plugins() -> None:
    """Withdraw all plugins, and their modules."""
    while LOADED:
        source, plugin = LOADED.popitem()
        withdraw(plugin)
        for name, module in list(sys.modules.items()):
            if str(getattr(module, "__file__", "")) == source:
                del sys.modules[name]


def answered(call: Callable[[], Any]) -> Any:
    """The result, which is something, or None where it was refused as it should be."""
    with patience(), warnings.catch_warnings():
        # An overflow on the way is a number beyond sense that got too far.
        warnings.simplefilter("error", RuntimeWarning)
        warnings.simplefilter("ignore", FullamWarning)  # which is an answer, too
        try:
            result = call()
        except FullamError as error:
            assert str(error).endswith("."), f"no sentence: {error}"
            assert len(str(error)) < 20_000
            result = None
    OUTCOMES["refused" if result is None else "accepted"] += 1
    return result


@functools.cache
def folder() -> Path:
    """A folder for this process."""
    return Path(tempfile.mkdtemp(prefix="hostile-"))


@functools.cache
def whole_run() -> Run:
    """A short flight with noise and gusts; what flights need is compiled then."""
    return fullam.simulate(Scenario("brief", duration=0.3), seed=1)


SCENE = """<mujoco><worldbody>
  <body name="box"><freejoint/><geom size="0.1"/>
    <body><joint name="lid"/><geom size="0.1" pos="0.2 0 0"/>
      <body><joint name="ball" type="ball"/><geom size="0.1" pos="0.4 0 0"/></body></body></body>
</worldbody></mujoco>"""


@functools.cache
def scene_run() -> Run:
    """A short flight beside a box that falls, its lid and a ball, whose places are recorded."""
    scenario = Scenario("beside", duration=0.1, world_file=WorldFile("scene.xml", SCENE))
    return fullam.simulate(scenario, seed=1)
