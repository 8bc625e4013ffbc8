"""What has been measured, in words: the list of all rows, and the table of the bounds."""

from __future__ import annotations

import os
import platform
import statistics
from pathlib import Path

from meter import Meter, Row


def figures(meter: Meter) -> list[str]:
    """All rows, group by group, line by line."""
    lines = []
    if meter.units:
        unit = statistics.median(meter.units)
        lines.append(f"RE = {unit:.2f} us, the median of {len(meter.units)}")
    for group in dict.fromkeys(row.group for row in meter.rows):
        rows = [row for row in meter.rows if row.group == group]
        width = max(len(row.name) for row in rows)
        head = f"{'us':>9}{'RE':>8}{'x C++':>7}{rows[0].unit:>8}{'must':>7}{'aim':>7}"
        lines += ["", group, f"  {'':<{width}}{head}", *(_line(row, width) for row in rows)]
    return lines + [""] + [f"not run: {reason}" for reason in meter.skipped]


def _line(row: Row, width: int) -> str:
    re = "" if row.re is None else _digits(row.re)
    over = "" if None in (row.floor, row.re) else f"{row.re / row.floor:.1f}"
    value = "" if row.value is None else _figure(row.value)
    must, aim = ("" if x is None else f"{x:g}" for x in (row.must, row.aim))
    kept = "; ".join(text for text in (row.verdict, row.note) if text)
    us = _digits(row.us) if row.us else ""
    line = f"  {row.name:<{width}}{us:>9}{re:>8}{over:>7}{value:>8}{must:>7}{aim:>7}  {kept}"
    return line.rstrip()


def _digits(number: float) -> str:
    """Two decimals where they say something, none where they do not."""
    decimals = 3 if number < 1.0 else 2 if number < 100.0 else 0
    return f"{number:.{decimals}f}"


def _figure(number: float) -> str:
    """Three digits, and all of a large number."""
    return f"{number:.0f}" if abs(number) >= 1000.0 else f"{number:.3g}"


def bounds(meter: Meter) -> list[str]:
    """The rows that keep a promise, as a table in Markdown."""
    lines = ["| what | measured | must | aim | |", "|---|---|---|---|---|"]
    for row in meter.rows:
        if row.promise and row.value is not None:
            unit = "x" if row.unit.startswith("x") else row.unit
            numbers = (f"{_figure(x)} {unit}" for x in (row.value, row.must, row.aim))
            lines.append(f"| {row.promise} | {' | '.join(numbers)} | {row.verdict} |")
    return lines


def machine() -> str:
    """Processor, vector registers, cores, load and Python."""
    load = ", ".join(f"{x:.1f}" for x in os.getloadavg())
    return f"{processor()}, {os.cpu_count()} cores, load {load}, Python {platform.python_version()}"


def processor() -> str:
    """The processor's name, what LLVM takes it for, and its vector registers."""
    names, flags = _cpuinfo("model name"), _cpuinfo("flags").split()
    name = names or platform.processor() or platform.machine()
    try:
        from llvmlite import binding

        name += f" ({binding.get_host_cpu_name()})"
    except ImportError:
        pass
    widths = [label for flag, label in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags]
    return ", ".join([name, *widths[:1]])


def _cpuinfo(key: str) -> str:
    """An entry of the first processor, where the system tells."""
    info = Path("/proc/cpuinfo")
    for line in info.read_text(encoding="utf-8").splitlines() if info.exists() else []:
        if line.partition(":")[0].strip() == key:
            return line.partition(":")[2].strip()
    return ""
