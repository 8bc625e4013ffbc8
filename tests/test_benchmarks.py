"""Every benchmark runs; the meter judges and reports as it says."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
BENCHMARKS = ROOT / "benchmarks"

if not BENCHMARKS.is_dir():
    pytest.skip("benchmarks/ is in the repository only", allow_module_level=True)


@pytest.fixture(scope="module")
def meter():
    """The module benchmarks/meter.py."""
    sys.path.insert(0, str(BENCHMARKS))
    import meter

    yield meter
    sys.path.remove(str(BENCHMARKS))


def test_every_benchmark_runs_once():
    """Each row's work is done once, untimed; the summary ends the run."""
    command = [sys.executable, "-m", "pytest", "-q", "--benchmark-disable", str(BENCHMARKS)]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-1000:]
    assert "in RNEA equivalents" in done.stdout
    assert " failed" not in done.stdout


@pytest.mark.parametrize(
    ("value", "unit", "verdict"),
    [
        (8.0, "RE", "aim"),
        (11.0, "RE", "must"),
        (13.0, "RE", "MISSED"),
        (13.0, "x", "aim"),
        (10.0, "x", "must"),
        (8.0, "x real time", "MISSED"),
    ],
)
def test_verdicts(meter, value, unit, verdict):
    """A time has to stay below its bounds, a speed-up above."""
    must, aim = (12.0, 9.0) if unit == "RE" else (9.0, 12.0)
    row = meter.Row("group", "name", 1.0, must=must, aim=aim, value=value, unit=unit)
    assert row.verdict == verdict


def test_report_names_what_was_not_run(meter):
    collected = meter.Meter(skipped=["test_x: rotorpy is not installed (fullam[bench])"])
    collected.rows.append(meter.Row("Ticks", "dc-pid", 9.5, re=9.9, floor=1.25, unit="RE"))
    collected.units.append(0.96)
    text = "\n".join(meter.report(collected))
    assert "not run: test_x: rotorpy is not installed" in text
    assert "7.6" in text  # the ratio to the floor


def test_the_unit_is_a_call_of_rnea(meter):
    from fullam.model.loading import load_vehicle

    ticks = iter(range(100))
    burst = meter.rnea_timer(load_vehicle("fullam"), lambda: float(next(ticks)))
    calls = meter.UNIT_CALLS // meter.UNIT_STATES * meter.UNIT_STATES
    assert burst() == pytest.approx(1.0 / calls)
