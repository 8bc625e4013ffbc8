"""crazyflow in an environment of its own, for its pins of JAX are not ours.

    python benchmarks/crazyflow_apart.py install    makes benchmarks/.venv with crazyflow (1.3 GB)
    benchmarks/.venv/bin/python benchmarks/crazyflow_apart.py WORLDS STEPS CONTROL

The second is what `test_crazyflow.py` starts; it answers each line of its input with a burst.
CONTROL is "state" (its Mellinger controller and its rigid quadrotor, every step) or "rotor_vel"
(the quadrotor alone). What is timed is as it is shipped: float32, explicit Euler.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent

REQUIREMENT = "crazyflow==0.4.0"

FOLDER = HERE / ".venv"

PYTHON = FOLDER / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")

FREQUENCY = 1000
"""Of plant and controllers [Hz]."""

HOVER = 0.5
"""Height at which the quadrotors are asked to hover [m]."""

ROTOR_SPEED = 15_000.0
"""Rotor speed without a controller [rpm]."""


def install() -> None:
    """Make the environment."""
    subprocess.run([sys.executable, "-m", "venv", str(FOLDER)], check=True)
    subprocess.run([str(PYTHON), "-m", "pip", "install", "--quiet", REQUIREMENT], check=True)


def floor() -> float:
    """Seconds of a burst of plain Python: the same work in every process."""
    start, total = time.perf_counter(), 0.0
    for i in range(20_000):
        total += 0.5 * i
    return time.perf_counter() - start


def serve(worlds: int, steps: int, control: str) -> None:
    """Answer with seconds a step of one world, by the clock and of the processors, and a floor."""
    import jax
    import numpy as np
    from crazyflow.control import Control
    from crazyflow.sim import Sim

    sim = Sim(
        n_worlds=worlds,
        control=Control(control),
        freq=FREQUENCY,
        state_freq=FREQUENCY,
        attitude_freq=FREQUENCY,
        force_torque_freq=FREQUENCY,
    )
    command = np.full((worlds, 1, 4), ROTOR_SPEED, dtype=np.float32)
    if control == "state":
        command = np.zeros((worlds, 1, 16), dtype=np.float32)
        command[..., 2], command[..., 12] = HOVER, 1.0
    getattr(sim, f"{control}_control")(command)

    def burst() -> dict[str, Any]:
        start, processor = time.perf_counter(), time.process_time()
        sim.step(steps)
        jax.block_until_ready(sim.data)
        clock, calls = time.perf_counter() - start, worlds * steps
        processor = time.process_time() - processor
        return {"clock": clock / calls, "processor": processor / calls, "floor": floor()}

    for _ in range(2):  # it compiles twice
        burst()
    answer_bursts({"jax": jax.__version__}, burst)


if __name__ == "__main__":
    if sys.argv[1] == "install":
        install()
    else:
        from apart import answer_bursts

        serve(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
