"""Command lines that are wrong on purpose."""

from __future__ import annotations

import contextlib
import io
import json
import re
import shutil
import time
import warnings

from answers import PATIENCE, Hang, folder, forget_plugins, patience, whole_run
from hypothesis import strategies as st
from values import document

from fullam.cli import main
from fullam.cli.scaffolding import TEMPLATES

COMPILING = 120
"""What takes longer hangs, even if it has to be compiled [s]."""

WORDS = (
    *("0", "-1", "1", "1e308", "1e-300", "nan", "inf", "70000", "1000000000000", "9" * 400, ""),
    *("9" * 5000, "x", "dc-pid", "pid", "calm", "paper", "kalman", "truth", "a,b", ","),
    *("fastest", "fused", "python", "on", "off", "anticipate=false", "max_acceleration=0", "cants"),
    *("position_gains=[1,2,3]", "compensation=x", "position_gains=" + "[" * 2000, "=", "a\0b"),
    *("gains.toml", "bad.toml", "law.py", "bad.py", "no_such_module", "rotor_1", "1,2", "own-law"),
    *(
        "fullam",
        "pid@kalman",
        "0-3",
        "own-law@truth",
        "good.npz",
        "mcap",
        "estimator",
        "0.1",
        "4.5",
    ),
    *("\x1b[31m", "<!--", "s.toml", "/dev/null", "no.npz", "-", "--", "overview", "pose", "../.."),
    *("servo", "prescribed", "feedback=truth", "feedback=x", "feed_forward=off", "push-wall"),
)
OPTIONS = {
    "run": ("--controller --set --settings --seed --weather --vehicle --control-rate --plant-rate "
            "--plant --plant-set --out --estimator --governor --failed --shape --figure --driver "
            "--calm --json"),
    "compare": ("--controllers --settings --seed --weather --vehicle --control-rate --governor "
                "--shape --failed --figure --driver --plant --calm --json"),
    "check": ("--seed --settings --json --samples --controller --estimator --delay --control-rate "
              "--weather --failed"),
    "list": "--json",
    "calibrate": "--record --out --mass --share --seed --weather --json",
    "new": "--kernel",
    "export": "--to --out",
    "completion": "--help",
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
    **{"calibrate": "fullam", "new": "controller", "export": "good.npz", "completion": "bash"},
}
"""What a verb can be given."""

LAST = {
    "tune": ["--budget", "11", "--scenario", "good.toml", "--seeds", "0", "--jobs", "1"],
    "calibrate": ["--duration", "5"],
    "export": ["--to", "csv"],
    "new": ["own_law.py"],
    "check": ["--samples", "3"],
    "sweep": ["--out", "sweep.parquet", "--runs", "1"],
    "view": ["--html", "view.html"],
    "datasheet": ["--flights", "0"],
    "design": ["--evaluations", "1", "--starts", "1"],
}
"""What keeps a verb from working for minutes, or from waiting for somebody. It stands last, and so
prevails; what was given before is read all the same."""

FILES = {
    "gains.toml": 'controller = "pid"\n[settings]\nposition_gains = [9.0, 9.0, 5.0]\n',
    "bad.toml": 'controller = "pid"\n[settings]\nposition_gains = [9.0, "x"]\n',
    "law.py": (TEMPLATES / "controller.py").read_text("utf-8").replace("my-law", "own-law"),
    "bad.py": "import fullam\nraise ValueError('half a law')\n",
}
"""What stands beside the command: settings and plugins, good and bad."""

WITHOUT_VALUE = {"--calm", "--json", "--tuned", "--no-gusts", "--overwrite", "--version", "--help"}
WITHOUT_VALUE |= {"--kernel"}


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    """A verb with arguments that it knows and values that it may not."""
    verb = draw(st.sampled_from(sorted(OPTIONS)))
    line = [verb] if verb else []
    if verb in GOOD:
        line.append(draw(st.one_of(st.just(GOOD[verb]), st.sampled_from(WORDS))))
    options = [*OPTIONS[verb].split(), *(["--plugin"] if verb else [])]
    for option in draw(st.lists(st.sampled_from(options), max_size=3)):
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
    (work / "good.npz").write_bytes(whole_run().save(folder() / "good.npz").read_bytes())
    for name, text in FILES.items():
        (work / name).write_text(text, encoding="utf-8")
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
    """Exit code, output and complaints of a command, and how long it took the processor [s]."""
    out, err, start = io.StringIO(), io.StringIO(), time.process_time()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        patience(COMPILING),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        try:
            code = main(case)
        finally:
            forget_plugins()
    return code, out.getvalue(), err.getvalue(), time.process_time() - start
