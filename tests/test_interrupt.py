"""Ctrl-C ends the command in one line, whenever it comes, and leaves no process behind."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fullam import interrupt

psutil = pytest.importorskip("psutil", reason="the extra 'campaign' is not installed")

# The first tenth of a second is Python's own start, before it knows of any of our code. It is
# waited for by looking for what the guard does: the process catches SIGINT.
STARTED = 10.0


def start(*arguments: object) -> subprocess.Popen:
    """The command, in a process group of its own, as a terminal would start it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "fullam", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
    )
    # Python catches SIGINT from its start on; what tells our code is that it has been opened.
    end = time.monotonic() + STARTED
    while time.monotonic() < end and not imported(process.pid):
        time.sleep(0.002)
    return process


def imported(pid: int) -> bool:
    """Whether numpy is being loaded: the guard stands before it."""
    with contextlib.suppress(OSError):
        return "numpy" in Path(f"/proc/{pid}/maps").read_text(encoding="utf-8")
    return False


def stop(process: subprocess.Popen) -> tuple[int, str]:
    """Press Ctrl-C; exit code and what was complained about."""
    family = psutil.Process(process.pid).children(recursive=True)
    os.killpg(process.pid, signal.SIGINT)
    _, complaint = process.communicate(timeout=20.0)
    assert not psutil.wait_procs(family, timeout=5.0)[1], "a worker outlives the command"
    return process.returncode, complaint


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize("later", [0.0, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0])
@pytest.mark.parametrize("jobs", [1, 2])
def test_an_interrupt_is_one_line(tmp_path, later, jobs):
    out = tmp_path / "rows.parquet"
    process = start("sweep", "task-1", "--runs", 100_000, "--jobs", jobs, "--out", out)
    time.sleep(later)
    code, complaint = stop(process)
    assert code == 130, complaint
    lines = complaint.strip().splitlines()
    assert len(lines) == 1, complaint
    assert lines[0].startswith("fullam: interrupted")
    if (tmp_path / "rows.parquet.parts").exists():
        assert "the same command continues" in lines[0]
    assert not (tmp_path / "rows.parquet.lock").exists()


def test_an_impatient_second_interrupt_shows_no_traceback(tmp_path):
    process = start("sweep", "task-1", "--runs", 100_000, "--out", tmp_path / "rows.parquet")
    time.sleep(1.5)
    for _ in range(5):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGINT)
        time.sleep(0.003)
    _, complaint = process.communicate(timeout=20.0)
    assert process.returncode == 130
    assert "Traceback" not in complaint


SLOW_LAW = """import threading, time
import fullam

threading.Thread(target=time.sleep, args=(60.0,)).start()  # as if it compiled something large

@fullam.register("slow-law")
class Slow(fullam.Controller):
    def reset(self, measurement, reference):
        print("flies", flush=True)

    def wrench(self, t, measurement, reference):
        time.sleep(0.05)
        return [0.0, 0.0, 25.0, 0.0, 0.0, 0.0]
"""


def test_nobody_waits_for_what_a_thread_still_does(tmp_path):
    plugin = tmp_path / "slow_law.py"
    plugin.write_text(SLOW_LAW, encoding="utf-8")
    process = start("run", "position-1", "--plugin", plugin, "--controller", "slow-law")
    assert process.stdout.readline() == "flies\n"
    begin = time.monotonic()
    code, complaint = stop(process)
    assert code == 130
    assert complaint.strip().splitlines()[-1] == "fullam: interrupted"
    # A period of the law, and what Python needs on a machine that is busy.
    assert time.monotonic() - begin < 10.0


def test_the_exit_code_is_ours_wherever_it_falls(tmp_path):
    # Python ends itself by the signal once one was raised in a string that was executed, although
    # it was caught.
    plugin = tmp_path / "executes.py"
    plugin.write_text(
        'exec("import os, signal, time; os.kill(os.getpid(), signal.SIGINT); time.sleep(5.0)")',
        encoding="utf-8",
    )
    process = start("run", "position-1", "--plugin", plugin)
    _, complaint = process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert complaint.strip() == "fullam: interrupted"


def test_elsewhere_an_interrupt_is_pythons_own():
    assert not interrupt.is_command()
    assert signal.getsignal(signal.SIGINT) is not interrupt.end_at_once
    code = "import fullam, signal; print(signal.getsignal(signal.SIGINT).__name__)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "default_int_handler"
