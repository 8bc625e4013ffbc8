"""Every benchmark runs; the meter judges and reports as it says."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from fullam.model.loading import load_vehicle

ROOT = Path(__file__).parent.parent
BENCHMARKS = ROOT / "benchmarks"

if not BENCHMARKS.is_dir():
    pytest.skip("benchmarks/ is in the repository only", allow_module_level=True)


@pytest.fixture(scope="module", autouse=True)
def modules():
    """Those of benchmarks/ can be imported."""
    sys.path.insert(0, str(BENCHMARKS))
    yield
    sys.path.remove(str(BENCHMARKS))


@pytest.fixture
def meter():
    """The module benchmarks/meter.py."""
    import meter

    return meter


@pytest.fixture
def report():
    """The module benchmarks/report.py."""
    import report

    return report


def test_every_benchmark_runs_once():
    """Each row's work is done once, untimed; the summary ends the run."""
    command = [sys.executable, "-m", "pytest", "-q", "--benchmark-disable", str(BENCHMARKS)]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-1000:]
    assert "in RNEA equivalents" in done.stdout


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


def test_report_names_what_was_not_run(meter, report):
    collected = meter.Meter(skipped=["test_x: rotorpy is not installed (fullam[bench])"])
    collected.rows.append(meter.Row("Ticks", "dc-pid", 9.5, re=9.5, floor=1.25, unit="RE"))
    collected.units.append(0.96)
    text = "\n".join(report.figures(collected))
    assert "not run: test_x: rotorpy is not installed" in text
    assert "7.6" in text  # the ratio to the floor


def test_the_table_of_bounds_has_what_is_promised_and_was_measured(meter, report):
    measured = meter.Row("g", "n", 1.0, must=12.0, aim=9.0, value=10.0, unit="RE")
    measured.promise = "a tick"
    unmeasured = meter.Row("g", "n", 1.0, must=12.0, aim=9.0, unit="RE", promise="a step")
    lines = report.bounds(meter.Meter(rows=[measured, unmeasured]))
    assert lines[2:] == ["| a tick | 10 RE | 12 RE | 9 RE | must |"]


def test_a_section_of_the_page_is_replaced(tmp_path, monkeypatch):
    import page

    readme = tmp_path / "README.md"
    readme.write_text("a\n<!-- x -->\nold\n<!-- end of x -->\nb\n", encoding="utf-8")
    monkeypatch.setattr(page, "README", readme)
    page.write_section("x", "new\n")
    assert readme.read_text(encoding="utf-8") == "a\n<!-- x -->\nnew\n<!-- end of x -->\nb\n"
    with pytest.raises(ValueError, match="section 'y': its marks are missing"):
        page.write_section("y", "new")


def test_a_process_apart_answers_burst_by_burst(tmp_path):
    from apart import apart

    script = tmp_path / "answers.py"
    script.write_text(
        "from apart import answer_bursts\n"
        "print('a banner')\n"
        "answer_bursts({'ready': 1}, lambda *words: {'heard': words})\n",
        encoding="utf-8",
    )
    env = {**os.environ, "PYTHONPATH": str(BENCHMARKS)}
    with apart([sys.executable, str(script)], env) as process:
        assert process.ready == {"ready": 1}
        assert process.burst("go", "on") == {"heard": ["go", "on"]}


def test_a_process_apart_that_ends_is_told_of(tmp_path):
    from apart import Apart

    with pytest.raises(RuntimeError, match="ended with 3"):
        Apart([sys.executable, "-c", "raise SystemExit(3)"])


class Recorder:
    """Stands for pytest-benchmark: rounds of the work, timed by a clock that we turn."""

    enabled = True

    def __init__(self, clock):
        self.clock, self.extra_info, self.stats = clock, {}, SimpleNamespace(stats=None)

    def pedantic(self, work, setup, rounds, warmup_rounds):
        times = []
        for _ in range(warmup_rounds + rounds):
            arguments, keywords = setup()
            start = self.clock.now
            work(*arguments, **keywords)
            times.append(self.clock.now - start)
        self.stats.stats = SimpleNamespace(data=times[warmup_rounds:])


def test_the_unit_counts_calls_of_rnea(meter, monkeypatch):
    clock = SimpleNamespace(now=0.0)

    def rnea(*arguments):
        clock.now += 2e-6

    monkeypatch.setattr(meter.pin, "rnea", rnea)
    burst = meter.rnea_timer(load_vehicle("fullam"), lambda: clock.now)
    assert burst() == pytest.approx(2e-6)


def test_a_row_is_the_time_of_a_call_and_its_ratio_to_the_unit(meter, monkeypatch):
    clock = SimpleNamespace(now=0.0)
    speed = iter([1.0, 1.0, 2.0, 3.0, 4.0] * 100)  # the machine's mood, round by round

    def mood(*arguments):
        clock.mood = next(speed)

    def unit(vehicle, timer):
        def burst():
            mood()
            return 2e-6 * clock.mood

        return burst

    def prepare():
        def work():
            clock.now += 40 * 14e-6 * clock.mood  # 40 calls of 14 us

        return work

    monkeypatch.setattr(meter, "rnea_timer", unit)
    row = meter.Row("g", "n", 0.0, must=12.0, aim=9.0, unit="RE")
    collected = meter.Meter()
    recorder = Recorder(clock)
    collected.measure(recorder, prepare, 40, None, row, rounds=25)
    assert row.re == row.value == pytest.approx(7.0)
    assert row.us == pytest.approx(14.0 * 2.0)  # the median mood
    assert row.verdict == "aim"
    assert collected.rows == [row]
    assert recorder.extra_info["re"] == row.re
