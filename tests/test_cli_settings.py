"""`--settings FILE` as typed, on every verb that flies."""

import json
from dataclasses import replace

import pytest

from fullam.cli import main
from fullam.simulation.scenarios.scenario import load_scenario, register_scenario
from fullam.simulation.weather import CALM

SHORT = register_scenario(
    replace(load_scenario("position-1"), name="short-settings", duration=0.3, weather=CALM)
)
GAINS = {"position_gains": [20.0, 10.0, 6.0]}


@pytest.fixture
def gains(tmp_path):
    def written(controller, estimator=None):
        path = tmp_path / f"{controller}.toml"
        lines = [f'controller = "{controller}"']
        lines += [f'estimator = "{estimator}"'] if estimator else []
        lines += ["[settings]", f"position_gains = {GAINS['position_gains']}"]
        path.write_text("\n".join(lines), encoding="utf-8")
        return str(path)

    return written


def flown(capsys, *line):
    """What a command says in JSON."""
    assert main([*line, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_run_flies_whom_the_file_names_and_set_comes_on_top(capsys, gains):
    line = ["run", "short-settings", "--settings", gains("pid", "truth")]
    data = flown(capsys, *line)
    assert (data["controller"], data["simulation"]["estimator"]) == ("pid", "truth")
    assert data["settings"]["position_gains"] == GAINS["position_gains"]
    data = flown(capsys, *line, "--set", "anti_windup=2")
    assert data["settings"]["anti_windup"] == 2
    assert data["settings"]["position_gains"] == GAINS["position_gains"]


def test_another_controller_than_the_files_is_refused(capsys, gains):
    line = ["run", "short-settings", "--controller", "dc-pid", "--settings", gains("pid")]
    assert main(line) == 2
    assert "is 'pid', and 'dc-pid' is to fly" in capsys.readouterr().err


def test_compare_gives_each_file_to_whom_it_names(capsys, gains):
    files = [word for name in ("pid", "dc-pid") for word in ("--settings", gains(name))]
    line = ["compare", "short-settings", "--controllers", "dc-pid,pid,backstepping", *files]
    runs = flown(capsys, *line)["runs"]
    assert [run["contender"] for run in runs] == ["dc-pid, dc-pid", "pid, pid", "backstepping"]
    assert [run["settings"]["position_gains"] == GAINS["position_gains"] for run in runs] == [
        True,
        True,
        False,
    ]


def test_compare_flies_before_and_after_beside_each_other(capsys, gains):
    line = ["compare", "short-settings", "--controllers", f"pid,pid@truth,{gains('pid')}"]
    before, true, after = flown(capsys, *line)["runs"]
    assert before["settings"]["position_gains"] != GAINS["position_gains"]
    assert after["settings"]["position_gains"] == GAINS["position_gains"]
    assert true["simulation"]["estimator"] == "truth"
    assert main(line) == 0
    assert "pid, pid" in capsys.readouterr().out


def test_a_file_for_nobody_is_refused(tmp_path, capsys, gains):
    line = ["compare", "short-settings", "--controllers", "dc-pid,pid"]
    assert main([*line, "--settings", gains("backstepping")]) == 2
    assert "is 'backstepping', which does not fly here" in capsys.readouterr().err
    nameless = tmp_path / "nameless.toml"
    nameless.write_text("[settings]\nposition_gains = [1, 2, 3]\n", encoding="utf-8")
    assert main([*line, "--settings", str(nameless)]) == 2
    assert "controller: is missing, and several fly" in capsys.readouterr().err


def test_sweep_flies_files(tmp_path, capsys, gains):
    pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")
    line = ["sweep", "short-settings", "--runs", "1", "--driver", "python"]
    line += ["--controllers", f"pid,{gains('dc-pid', 'truth')}", "--settings", gains("pid")]
    data = flown(capsys, *line, "--out", str(tmp_path / "rows.parquet"))
    assert [row["contender"] for row in data["summary"]] == ["pid, pid", "dc-pid@truth, dc-pid"]


def test_sweep_gives_a_file_to_the_contender_of_its_estimator(tmp_path, capsys, gains):
    pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")
    line = ["sweep", "short-settings", "--runs", "1", "--driver", "python"]
    line += ["--controllers", "pid@truth,pid@kalman", "--settings", gains("pid", "kalman")]
    data = flown(capsys, *line, "--out", str(tmp_path / "rows.parquet"))
    assert [row["contender"] for row in data["summary"]] == ["pid@truth", "pid@kalman, pid"]


def test_check_tells_the_margins_of_the_files_gains(capsys, gains):
    usual = flown(capsys, "check", "fullam", "--samples", "3", "--controller", "dc-pid")
    tuned = flown(capsys, "check", "fullam", "--samples", "3", "--settings", gains("dc-pid"))
    assert tuned["margins"]["controller"] == "dc-pid"
    assert tuned["margins"] != usual["margins"]
    assert main(["check", "fullam", "--samples", "3", "--set", "rounds=2"]) == 2
    assert "add --controller" in capsys.readouterr().err


def test_view_and_fly_take_them(tmp_path, capsys, gains, monkeypatch):
    import fullam.cli.viewing as viewing

    shown = []
    monkeypatch.setattr(viewing, "_show_live", lambda plan, _: shown.append(plan) or 0)
    file = gains("pid")
    assert main(["view", "short-settings", "--settings", file]) == 0
    assert main(["fly", "fullam", "--settings", file, "--duration", "1"]) == 0
    assert [plan.controller for plan in shown] == ["pid", "pid"]
    assert all(list(p.settings.position_gains) == GAINS["position_gains"] for p in shown)


@pytest.mark.parametrize("verb", ["run", "compare", "sweep", "check", "view", "fly", "reproduce"])
def test_every_verb_says_that_the_file_is_not_there(tmp_path, monkeypatch, capsys, verb):
    monkeypatch.chdir(tmp_path)
    subject = {"check": ["fullam"], "fly": ["fullam"], "reproduce": []}.get(verb, ["task-1"])
    more = ["--out", "rows.parquet"] if verb == "sweep" else []
    assert main([verb, *subject, *more, "--settings", "none.toml"]) == 2
    assert "none.toml: file: cannot be read" in capsys.readouterr().err
