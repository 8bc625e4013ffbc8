"""Command lines that are wrong on purpose."""

from __future__ import annotations

import contextlib
import io
import json
import re
import shutil
import time
import warnings

from answers import PATIENCE, Hang, folder, patience
from hypothesis import strategies as st
from values import document

from fullam.cli import main

COMPILING = 120
"""What takes longer hangs, even if it has to be compiled [s]."""

WORDS = (
    *("0", "-1", "1", "1e308", "1e-300", "nan", "inf", "70000", "1000000000000", "9" * 400, ""),
    *("9" * 5000, "x", "dc-pid", "pid", "calm", "paper", "kalman", "truth", "a,b", ","),
    *("fastest", "fused", "python", "on", "off", "anticipate=false", "max_acceleration=0", "cants"),
    *("position_gains=[1,2,3]", "compensation=x", "position_gains=" + "[" * 2000, "=", "a\0b"),
    *("\x1b[31m", "<!--", "s.toml", "/dev/null", "no.npz", "-", "--", "overview", "pose", "../.."),
)
OPTIONS = {
    "run": ("--controller --set --settings --seed --weather --vehicle --control-rate --plant-rate "
            "--out --estimator --governor --failed --shape --figure --driver --calm --json"),
    "compare": ("--controllers --settings --seed --weather --vehicle --control-rate --governor "
                "--shape --failed --figure --driver --calm --json"),
    "check": ("--seed --settings --json --samples --controller --estimator --delay --control-rate "
              "--weather --failed"),
    "list": "--json --plugin",
    "equations": "--json",
    "plot": "--what --out",
    "view": ("--controller --settings --seed --offset --speed --port --wait --at --vehicle "
             "--failed --calm"),
    "sweep": ("--controllers --settings --runs --tuned --estimator --weather --no-gusts "
              "--overwrite --jobs --tls-ca --driver --json"),
    "tune": ("--budget --seed --seeds --scenario --vehicle --weather --settings --control-rate "
             "--shape --jobs --driver --calm --json"),
    "datasheet": "--out --flights --seed --json",
    "design": ("--rotors --objective --free --period --reserve --min-efficiency --min-tilt --arm "
               "--seed --out --pareto --json"),
    "": "--version --help --nonsense",
}  # fmt: skip
GOOD = {
    **dict.fromkeys(("run", "compare", "sweep", "view"), "good.toml"),
    **dict.fromkeys(("check", "datasheet"), "quadrotor_arm"),
    **{"plot": "r.npz", "equations": "12", "tune": "pid", "design": "fullam"},
}
"""What a verb can be given."""

LAST = {
    "tune": ["--budget", "1"],
    "check": ["--samples", "3"],
    "sweep": ["--out", "sweep.parquet", "--runs", "1"],
    "view": ["--html", "view.html"],
    "datasheet": ["--flights", "0"],
    "design": ["--evaluations", "1", "--starts", "1"],
}
"""What keeps a verb from working for minutes, or from waiting for somebody. It stands last, and so
prevails; what was given before is read all the same."""

WITHOUT_VALUE = {"--calm", "--json", "--tuned", "--no-gusts", "--overwrite", "--version", "--help"}


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    """A verb with arguments that it knows and values that it may not."""
    verb = draw(st.sampled_from(sorted(OPTIONS)))
    line = [verb] if verb else []
    if verb in GOOD:
        line.append(draw(st.one_of(st.just(GOOD[verb]), st.sampled_from(WORDS))))
    for option in draw(st.lists(st.sampled_from(OPTIONS[verb].split()), max_size=3)):
        line.append(option)
        if option not in WITHOUT_VALUE:
            line.append(draw(st.sampled_from(WORDS)))
    return line + LAST.get(verb, [])


def attack_command(case: list[str]) -> None:
    """Every command ends with 0, 1 or 2 and, if not well, one complaint in words."""
    work = folder() / "c"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    good = document({"name": "good", "duration": 0.05})
    (work / "good.toml").write_text(good, encoding="utf-8")
    with contextlib.chdir(work):
        code, out, err, seconds = run(case)
        if seconds > PATIENCE:  # it may have been the first to need something compiled
            code, out, err, seconds = run(case)
    if seconds > PATIENCE:
        raise Hang(f"{seconds:.0f} s")
    assert code in (0, 1, 2), code
    assert "Traceback" not in err
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f]", out + err)
    assert code != 2 or err.strip()
    if "--json" in case and code == 0:
        json.loads(out)


def run(case: list[str]) -> tuple[int, str, str, float]:
    """Exit code, output and complaints of a command, and how long it took [s]."""
    out, err, start = io.StringIO(), io.StringIO(), time.monotonic()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        patience(COMPILING),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        code = main(case)
    return code, out.getvalue(), err.getvalue(), time.monotonic() - start
