"""Command lines that are wrong on purpose."""

from __future__ import annotations

import contextlib
import functools
import io
import json
import re
import shutil
import warnings

from answers import folder, patience
from hypothesis import strategies as st
from values import document

from fullam.cli import main

WORDS = (
    *("0", "-1", "1", "1e308", "1e-300", "nan", "inf", "70000", "1000000000000", "9" * 400, ""),
    *("9" * 5000, "x", "dc-pid", "pid", "calm", "paper", "kalman", "truth", "a,b", ","),
    *("fastest", "fused", "python", "on", "off", "anticipate=false", "max_acceleration=0", "cants"),
    *("position_gains=[1,2,3]", "compensation=x", "position_gains=" + "[" * 2000, "=", "a\0b"),
    *("\x1b[31m", "<!--", "s.toml", "/dev/null", "no.npz", "-", "--", "overview", "pose", "../.."),
)
OPTIONS = {
    "run": ("--controller --set --seed --weather --vehicle --control-rate --plant-rate --out "
            "--estimator --governor --shape --figure --driver --calm --json"),
    "compare": ("--controllers --seed --weather --vehicle --control-rate --governor --shape "
                "--figure --driver --calm --json"),
    "check": ("--seed --json --samples --controller --estimator --delay --control-rate "
              "--weather"),
    "list": "--json",
    "equations": "--json",
    "plot": "--what --out",
    "view": "--controller --seed --offset --speed --port --wait --at --vehicle --calm",
    "sweep": ("--controllers --runs --tuned --estimator --weather --no-gusts --overwrite --jobs "
              "--tls-ca --driver --json"),
    "tune": "--budget --seed --jobs --driver",
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

BEFORE = {"tune": ["--budget", "1"], "check": ["--samples", "3"]}
AFTER = {
    "sweep": ["--out", "sweep.parquet", "--runs", "1"],
    "view": ["--html", "view.html"],
    "datasheet": ["--flights", "0"],
    "design": ["--evaluations", "1", "--starts", "1"],
}
"""What keeps a verb from working for minutes, or from waiting for somebody, before and after."""

WITHOUT_VALUE = {"--calm", "--json", "--tuned", "--no-gusts", "--overwrite", "--version", "--help"}


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    """A verb with arguments that it knows and values that it may not."""
    verb = draw(st.sampled_from(sorted(OPTIONS)))
    line = [verb] if verb else []
    if verb in GOOD:
        line.append(draw(st.one_of(st.just(GOOD[verb]), st.sampled_from(WORDS))))
    line += BEFORE.get(verb, [])
    for option in draw(st.lists(st.sampled_from(OPTIONS[verb].split()), max_size=3)):
        line.append(option)
        if option not in WITHOUT_VALUE:
            line.append(draw(st.sampled_from(WORDS)))
    return line + AFTER.get(verb, [])


@functools.cache
def compile_all() -> None:
    """Compile what commands use: the first time may take longer than anybody's patience."""
    for verb in ("run", "datasheet"):
        main([verb, GOOD[verb], *AFTER.get(verb, [])])


def attack_command(case: list[str]) -> None:
    """Every command ends with 0, 1 or 2 and, if not well, one complaint in words."""
    work = folder() / "c"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    good = document({"name": "good", "duration": 0.05})
    (work / "good.toml").write_text(good, encoding="utf-8")
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(work),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        compile_all()
        out.truncate(0)
        out.seek(0)
        with patience():
            code = main(case)
    assert code in (0, 1, 2), code
    assert "Traceback" not in err.getvalue()
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f]", out.getvalue() + err.getvalue())
    assert code != 2 or err.getvalue().strip()
    if "--json" in case and code == 0:
        json.loads(out.getvalue())
