"""The command line: verbs, exit codes, and what goes to which stream."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fullam import cli
from fullam.analysis.metrics import measure
from fullam.cli import output
from fullam.cli.options import setting
from fullam.control.controllers import controller_names
from fullam.model.loading import vehicle_names
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.scenario import scenario_names

OK, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130

SHORT = """
name = "short"
duration = 0.8
initial_arm_deg = [-90.0, 0.0, -45.0, 0.0]
[reference]
kind = "step"
position = [0.1, 0.0, 1.0]
"""

GALE = """
name = "gale"
duration = 0.5
[reference]
kind = "step"
position = [0.0, 0.0, 1.0]
[weather]
force_disturbance = 1e5
gust_interval = 0.1
"""

FAR = """
name = "far"
duration = 0.5
[reference]
kind = "step"
position = [100.0, 0.0, 1.0]
"""


@pytest.fixture
def fullam(capsys):
    """Run a command; gives exit code, stdout and stderr."""

    def call(*arguments):
        code = cli.main([str(a) for a in arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


@pytest.fixture
def scenario(tmp_path):
    def write(text):
        path = tmp_path / "scenario.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_list_names_everything_that_is_registered(fullam):
    code, out, err = fullam("list")
    assert (code, err) == (OK, "")
    for name in (*scenario_names(), *vehicle_names(), *controller_names(), "paper", "first-order"):
        assert re.search(rf"^  {re.escape(name)} +\S", out, re.MULTILINE), name
    found = json.loads(fullam("list", "--json")[1])
    assert set(found["scenarios"]) == set(scenario_names())
    assert all(text for entries in found.values() for text in entries.values())


def test_run_prints_an_aligned_table_with_units(fullam, scenario):
    code, out, err = fullam("run", scenario(SHORT), "--calm")
    assert (code, err) == (OK, "")
    head, dashes, *rows = out.split("\n\n")[1].splitlines()
    assert head.split("  ")[-1].strip() == "gamma [deg]"
    assert set(dashes) == {"-"}
    assert {len(row) for row in rows} == {len(head)} == {len(dashes)}
    assert re.search(r"^RMS position +\d+\.\d\d +mm$", out, re.MULTILINE)


def test_run_json_is_only_json_and_equals_the_library(fullam, scenario, tmp_path):
    path = tmp_path / "run.npz"
    code, out, err = fullam("run", scenario(SHORT), "--seed", 3, "--out", path, "--json")
    assert (code, err) == (OK, "")
    data = json.loads(out)
    run = Run.load(path)
    assert data["seed"] == run.seed == 3
    assert data["files"] == {"run": str(path)}
    expected = json.loads(json.dumps(measure(run).to_dict()))
    assert {key: data[key] for key in expected} == expected
    for key in (
        *("settled", "settling_time_s", "overshoot_percent", "rms_position_mm"),
        *("rms_attitude_deg", "max_excursion_mm", "saturated_share", "diverged"),
    ):
        assert key in data


def test_both_drivers_fly_from_the_command_line(fullam, scenario):
    pytest.importorskip("numba", reason="the extra 'fast' is not installed")
    said = {}
    for driver in ("python", "fused"):
        code, out, _ = fullam("run", scenario(SHORT), "--driver", driver, "--json")
        assert code == OK
        said[driver] = json.loads(out)
        assert said[driver]["driver"] == driver
    one, other = (said[driver]["rms_position_mm"] for driver in said)
    assert one == pytest.approx(other, rel=1e-9)
    code, _, err = fullam("run", scenario(SHORT), "--driver", "steam")
    assert code == USAGE
    assert "fused" in err


def test_options_reach_the_flight(fullam, scenario, tmp_path):
    path = tmp_path / "run.npz"
    code, *_ = fullam(
        *("run", scenario(SHORT), "--controller", "dc-pid", "--out", path),
        *("--set", "compensation=previous_wrench", "--set", "position_gains=[9.0, 1, 5]"),
        *("--shape", "max_acceleration=null", "--weather", "recorded"),
        *("--control-rate", 200, "--plant-rate", 400, "--estimator", "truth"),
    )
    assert code == OK
    run = Run.load(path)
    assert run.settings["compensation"] == "previous_wrench"
    assert tuple(run.settings["position_gains"]) == (9.0, 1.0, 5.0)
    assert run.scenario.shaping.max_acceleration is None
    assert run.weather.force_disturbance == 10.0
    assert run.weather.uncertainty.share == 0.0
    assert run.simulation.control_period == 1 / 200
    assert run.simulation.plant_period == 1 / 400
    assert run.simulation.estimator == "truth"


def test_vehicle_may_be_a_path(fullam, scenario, tmp_path):
    from fullam.model.loading import load_vehicle

    path = tmp_path / "run.npz"
    source = load_vehicle("fullam").source
    code, *_ = fullam("run", scenario(SHORT), "--vehicle", source, "--calm", "--out", path)
    assert code == OK
    assert Run.load(path).vehicle.name == "fullam"


def test_compare_flies_the_same_weather_and_stands_side_by_side(fullam, scenario, tmp_path):
    figure = tmp_path / "both.png"
    path = scenario(SHORT)
    code, out, err = fullam(
        "compare", path, "--controllers", "dc-pid,pid", "--seed", 5, "--figure", figure
    )
    assert (code, err) == (OK, "")
    assert re.search(r"unit +dc-pid +pid$", out, re.MULTILINE)
    assert figure.read_bytes().startswith(b"\x89PNG")
    data = json.loads(fullam("compare", path, "--seed", 5, "--json")[1])
    assert [run["controller"] for run in data["runs"]] == ["dc-pid", "pid"]
    alone = json.loads(fullam("run", path, "--controller", "pid", "--seed", 5, "--json")[1])
    assert alone["rms_position_mm"] == data["runs"][1]["rms_position_mm"]


def test_figure_is_drawn(fullam, scenario, tmp_path):
    path = tmp_path / "deep" / "figure.pdf"
    code, out, _ = fullam("run", scenario(SHORT), "--figure", path)
    assert code == OK
    assert path.read_bytes().startswith(b"%PDF")
    assert str(path) in out


def test_diverged_flight_exits_1_and_still_reports(fullam, scenario):
    path = scenario(GALE)
    code, out, err = fullam("run", path)
    assert code == FAILED
    assert "DIVERGED, dc-pid: at t =" in out
    assert err == ""
    code, out, _ = fullam("run", path, "--json")
    assert code == FAILED
    data = json.loads(out)
    assert data["diverged"] is True
    assert data["settled"] is False
    assert data["settling_time_s"] is None
    assert fullam("compare", path)[0] == FAILED


def test_flight_that_would_end_before_its_first_tick_is_refused(fullam, scenario, tmp_path):
    figure = tmp_path / "figure.png"
    code, out, err = fullam(
        *("run", scenario(FAR), "--shape", "max_acceleration=null", "--json", "--figure", figure)
    )
    assert (code, out) == (USAGE, "")
    assert "max_position_error" in err
    assert not figure.exists()


def test_check_reports_capability_and_agreement(fullam):
    code, out, err = fullam("check", "fullam", "--samples", 50)
    assert (code, err) == (OK, "")
    words = " ".join(out.split())
    assert "fully actuated yes" in words
    assert "rank of the coupling matrix 6 of 6" in words
    assert "acceleration" in words
    words = " ".join(fullam("check", "borinot", "--samples", 50)[1].split())
    assert "fully actuated no" in words
    data = json.loads(fullam("check", "borinot", "--samples", 50, "--json")[1])
    assert data["capability"]["rank"] == 4
    assert data["agreement"]["largest"] < data["agreement"]["tolerance"]
    assert data["passed"] is True


def test_check_fails_when_the_dynamics_disagree(fullam, monkeypatch):
    monkeypatch.setattr("fullam.cli.checking.AGREEMENT", 0.0)
    code, out, _ = fullam("check", "quadrotor_arm", "--samples", 5)
    assert code == FAILED
    assert "DISAGREE" in out


def test_check_fails_for_a_vehicle_that_cannot_lift_itself(fullam, tmp_path):
    from fullam.model.loading import load_vehicle

    definition = Path(load_vehicle("fullam").source)
    text, changed = re.subn(
        r"^max_speed = [\d.]+", "max_speed = 100.0", definition.read_text(), flags=re.MULTILINE
    )
    assert changed
    (tmp_path / "weak.toml").write_text(text)
    (tmp_path / "fullam.urdf").write_text(definition.with_name("fullam.urdf").read_text())
    code, out, _ = fullam("check", tmp_path / "weak.toml", "--samples", 5)
    assert code == FAILED
    assert "IMPOSSIBLE" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "required: VERB"),
        (["glide"], "invalid choice: 'glide'"),
        (["run", "task-9"], "Did you mean 'task-"),
        (["run", "task-1", "--controller", "lqr"], "Known: .*dc-pid"),
        (["run", "task-1", "--vehicle", "x"], "Known: .*hextilt"),
        (["run", "task-1", "--weather", "x"], "Known: calm"),
        (["run", "task-1", "--estimator", "x"], "Known: .*first-order"),
        (["run", "task-1", "--calm", "--weather", "paper"], "give one of the two"),
        (["run", "task-1", "--seed", "-1"], "no whole number, from 0"),
        (["run", "task-1", "--seed", "x"], "no whole number, from 0"),
        (["run", "task-1", "--control-rate", "300"], "give a whole multiple"),
        (["run", "task-1", "--control-rate", "0"], "no rate in Hz"),
        (["run", "task-1", "--out", "run.txt"], "does not end in .npz"),
        (["run", "task-1", "--figure", "figure.doc"], "ends in none of"),
        (["run", "task-1", "--set", "gain=1"], "it has position_gains"),
        (["run", "task-1", "--set", "gain"], "not KEY=VALUE"),
        (["run", "task-1", "--set", "position_gains=high"], "position_gains"),
        (["run", "task-1", "--shape", 'max_acceleration="x"'], "max_acceleration"),
        (["run", "task-1", "--vehicle", "borinot"], "rank 4 on the 6 axes"),
        (["run", "task-1", "--vehicle", "hextilt"], "5 joints"),
        (["run", "no/such.toml"], "unknown scenario"),
        (["compare", "task-1", "--controllers", ","], "no names given"),
        (["compare", "task-1", "--controllers", "dc-pid,x"], "unknown controller 'x'"),
        (["check", "no/such.toml"], "cannot be read"),
        (["check", "fullam", "--samples", "0"], "no whole number, from 1"),
    ],
)
def test_bad_usage_exits_2_with_a_message_and_no_results(fullam, arguments, message):
    code, out, err = fullam(*arguments)
    assert code == USAGE
    assert out == ""
    assert re.search(message, err), err
    assert "Traceback" not in err


def test_path_that_cannot_be_written_exits_2(fullam, scenario, tmp_path):
    (tmp_path / "file").write_text("in the way")
    code, _, err = fullam("run", scenario(SHORT), "--out", tmp_path / "file" / "run.npz")
    assert code == USAGE
    assert "file" in err


def test_interruption_exits_130_without_a_traceback(fullam, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("fullam.simulation.simulate.fly_by_python", interrupted)
    code, out, err = fullam("run", "task-1", "--json")
    assert (code, out) == (INTERRUPTED, "")
    assert err == "fullam: interrupted\n"


def test_failed_allocation_is_a_failure_and_not_bad_usage(fullam, monkeypatch):
    from fullam.exceptions import AllocationFailed

    def fail(*_, **__):
        raise AllocationFailed(np.zeros(6), "MAX_ITER", {})

    monkeypatch.setattr("fullam.simulation.simulate.fly_by_python", fail)
    code, _, err = fullam("run", "task-1")
    assert code == FAILED
    assert "MAX_ITER" in err


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a=1", ("a", 1)),
        ("a=[1, 2.5]", ("a", [1, 2.5])),
        ("a=null", ("a", None)),
        ("a=true", ("a", True)),
        ("a=1_000", ("a", 1000)),
        ("a=word", ("a", "word")),
        ('a="1"', ("a", "1")),
        ("a=b=c", ("a", "b=c")),
    ],
)
def test_settings_are_json_or_toml_or_words(text, expected):
    assert setting(text) == expected


class Terminal:
    def __init__(self):
        self.text = ""

    def write(self, text):
        self.text += text

    def flush(self):
        pass

    def isatty(self):
        return True


def test_progress_shows_on_a_terminal_only_and_only_for_long_work(monkeypatch, capsys):
    with output.progress("flight") as show:
        show(1, 10)
    assert capsys.readouterr().err == ""
    for patience, shown in ((0.0, True), (60.0, False)):
        terminal = Terminal()
        monkeypatch.setattr(sys, "stderr", terminal)
        monkeypatch.setattr(output, "PATIENCE", patience)
        with output.progress("flight") as show:
            show(1, 10)
            show(10, 10)
        assert ("flight" in terminal.text) is shown


def test_json_never_contains_nan(capsys):
    output.say_json({"a": [float("nan"), float("inf"), 1.0]})
    assert json.loads(capsys.readouterr().out) == {"a": [None, None, 1.0]}


def test_help_explains_every_verb(fullam):
    code, out, _ = fullam("--help")
    assert code == OK
    for verb in ("check", "compare", "list", "run"):
        assert re.search(rf"^ +{verb} +[A-Z]", out, re.MULTILINE)
        code, text, _ = fullam(verb, "--help")
        assert code == OK
        assert "--json" in text


def test_module_runs_as_a_program():
    command = [sys.executable, "-m", "fullam", "--version"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == OK, done.stderr
    assert re.fullmatch(r"fullam \d+\.\d+\.\d+\S*\n", done.stdout)


def test_help_needs_no_figures_viewer_or_urdf_writer():
    code = "import sys; from fullam.cli import main; main(['--version']); "
    code += "sys.exit(bool({'matplotlib', 'meshcat', 'yourdfpy', 'dask'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == OK


def test_reader_that_stops_early_is_no_error():
    code = "import sys; from fullam.cli import main; sys.exit(main(['list']))"
    done = subprocess.run(
        f'"{sys.executable}" -c "{code}" | head -n 1; exit ${{PIPESTATUS[0]}}',
        shell=True,
        executable="/bin/bash",
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout, done.stderr) == (OK, "scenarios\n", "")


def test_what_is_out_of_reach_is_told_before_take_off(fullam, tmp_path):
    steep = tmp_path / "steep.toml"
    steep.write_text(
        SHORT.replace("position = [0.1", "euler_deg = [45.0, 0.0, 0.0]\nposition = [0.1")
    )
    err = fullam("run", steep, "--calm")[2]
    assert "out of reach: at" in err
    assert "deg short" in err
    assert fullam("run", "task-2", "--calm")[2] == ""


def test_another_plant_flies(fullam, tmp_path):
    scenario, record = tmp_path / "short.toml", tmp_path / "run.npz"
    scenario.write_text(SHORT)
    choice = ("--plant", "servo", "--plant-set", "feedback=truth", "--calm", "--out", record)
    fullam("run", scenario, *choice)
    run = Run.load(record)
    assert run.simulation.plant == "servo"
    assert run.simulation.plant_settings == {"feedback": "truth"}
    assert np.abs(run.arm_torque).max() > 0.01
    for wrong, words in (
        (("--plant", "elastic"), "prescribed, servo"),
        (("--plant-set", "feedback=truth"), "plant 'prescribed'"),
        (("--plant", "servo", "--plant-set", "feedback=9"), "twin"),
    ):
        code, _, err = fullam("run", scenario, *wrong)
        assert code == USAGE
        assert words in err


def test_settings_of_a_plant_are_for_the_one_that_the_scenario_needs(fullam, tmp_path):
    scenario, record = tmp_path / "short.toml", tmp_path / "run.npz"
    scenario.write_text(
        SHORT + '[[world]]\nkind = "plane"\npoint = [0.0, 0.0, 0.0]\nnormal = [0.0, 0.0, 1.0]\n'
    )
    fullam("run", scenario, "--plant-set", "feedback=truth", "--calm", "--out", record)
    assert Run.load(record).simulation.plant_settings == {"feedback": "truth"}
