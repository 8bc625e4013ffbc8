"""`fullam sweep`, `tune` and `reproduce` as typed."""

import json
import subprocess
import sys
from dataclasses import replace

import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")

from fullam.analysis import campaign, reproduce, tuning
from fullam.analysis.campaign_table import read_campaign
from fullam.analysis.claims import CLAIMS, Proof
from fullam.cli import main
from fullam.control.controllers import load_settings
from fullam.exceptions import CampaignError
from fullam.simulation.scenarios.scenario import load_scenario, register_scenario

SHORT = register_scenario(replace(load_scenario("position-1"), name="short-cli", duration=0.5))
SWEEP = ["sweep", "short-cli", "--runs", "2", "--driver", "python"]


def test_a_sweep_prints_medians_and_keeps_rows(tmp_path, capsys):
    out = tmp_path / "rows.parquet"
    assert main([*SWEEP, "--controllers", "pid,dc-pid@truth", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "dc-pid@truth" in text
    assert "4 rows" in text
    assert len(read_campaign(out)) == 4


def test_scenarios_with_blanks_between_them_on_another_vehicle(tmp_path):
    other = register_scenario(replace(SHORT, name="other-cli", initial_arm_deg=()))
    register_scenario(replace(SHORT, name="short-cli-2", initial_arm_deg=()))
    out = tmp_path / "rows.parquet"
    line = ["sweep", other.name, "short-cli-2", "--vehicle", "hextilt", "--runs", "1"]
    assert main([*line, "--out", str(out)]) == 0
    rows = read_campaign(out)
    assert sorted(rows.column("scenario")) == ["other-cli", "short-cli-2"]
    assert {s["vehicle"] for s in rows.identity["scenarios"]} == {"hextilt"}


def test_a_sweep_in_json_is_json_alone(tmp_path, capsys):
    assert main([*SWEEP, "--json", "--out", str(tmp_path / "rows.parquet")]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["flights"] == 2
    assert data["summary"][0]["median"]["rms_position_mm"] > 0.0
    assert set(data["drivers"].values()) == {"python"}


def test_no_gusts_means_no_gusts(tmp_path):
    out = tmp_path / "rows.parquet"
    assert main([*SWEEP, "--no-gusts", "--out", str(out)]) == 0
    weather = read_campaign(out).identity["weather"]
    assert weather["force_disturbance"] == weather["moment_disturbance"] == 0.0
    assert weather["position_noise"] == SHORT.weather.position_noise


def test_an_interrupted_sweep_says_how_to_go_on(tmp_path, capsys, monkeypatch):
    def interrupt(self, keys, threads):
        raise KeyboardInterrupt

    monkeypatch.setattr(campaign.Campaign, "fly", interrupt)
    assert main([*SWEEP, "--out", str(tmp_path / "rows.parquet")]) == 130
    assert "the same command continues" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ["--out", "rows.csv"],
        ["--out", "rows.parquet", "--controllers", "dc-pdi"],
        ["--out", "rows.parquet", "--weather", "stormy"],
        ["--out", "rows.parquet", "--runs", "0"],
        ["--out", "rows.parquet", "--jobs", "0"],
        ["--out", "rows.parquet", "--tuned", "--controllers", "pid@truth"],
    ],
)
def test_a_mistake_is_one_line_and_no_rows(tmp_path, monkeypatch, capsys, arguments):
    monkeypatch.chdir(tmp_path)
    assert main([*SWEEP, *arguments]) == 2
    assert "Traceback" not in capsys.readouterr().err
    assert not list(tmp_path.glob("*.parquet"))


def test_tuning_prints_what_it_writes(tmp_path, capsys, monkeypatch):
    pytest.importorskip("cma", reason="the extra 'campaign' is not installed")
    monkeypatch.setattr(
        tuning, "candidate_cost", lambda settings, **_: settings["position_gains"][0]
    )
    line = ["tune", "dc-pid", "--scenario", "short-cli", "--weather", "calm", "--budget", "30"]
    assert main(line) == 0
    printed = capsys.readouterr().out
    said = "fullam tune dc-pid --scenario short-cli --weather calm --budget 30 --seed 0"
    assert f'command = "{said}"' in printed
    out = tmp_path / "gains.toml"
    assert main([*line, "--out", str(out)]) == 0
    saved = capsys.readouterr().out
    assert f"fullam run short-cli --settings {out}" in saved
    assert "integral of the error over the step" in saved, "the cost is told"
    assert printed.endswith(out.read_text(encoding="utf-8"))
    assert main([*line, "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["improved"]
    assert data["tuning"]["cost"]["after"] < data["tuning"]["cost"]["before"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--scenario", "nowhere"], "nowhere"),
        (["--vehicle", "spoon"], "spoon"),
        (["--seeds", "5-4"], "5-4"),
        (["--seeds", "2000000"], "judge the result"),
        (["--calm", "--weather", "paper"], "--calm"),
        (["--settings", "no.toml"], "no.toml"),
        (["--budget", "3"], "budget"),
    ],
)
def test_a_mistake_in_tuning_is_one_line(capsys, arguments, complaint):
    assert main(["tune", "dc-pid", *arguments]) == 2
    error = capsys.readouterr().err
    assert complaint in error
    assert "Traceback" not in error


def test_the_extra_is_named_where_it_is_missing():
    """In a process of its own: here everything has been imported."""
    code = "import sys; sys.modules['pyarrow'] = None; from fullam.cli import main; "
    code += "sys.exit(main(['tune', 'pid']))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "fullam[campaign]" in done.stderr
    assert "Traceback" not in done.stderr


def test_reproduce_writes_where_it_says(tmp_path, capsys, monkeypatch):
    import fullam.viz.report as report

    asked = {}
    monkeypatch.setattr(
        reproduce, "reproduce", lambda folder, **options: asked.update(options) or "result"
    )
    monkeypatch.setattr(report, "write_report", lambda result, folder: folder / "index.html")
    gains = tmp_path / "gains.toml"
    gains.write_text('controller = "dc-pid"\n[settings]\nrounds = 2\n', encoding="utf-8")
    line = ["reproduce", "--quick", "--jobs", "2", "--settings", str(gains)]
    assert main([*line, "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "index.html")
    assert (asked["quick"], asked["jobs"]) == (True, 2)
    assert dict(asked["contenders"][0].contender.file) == {"rounds": 2}


def test_settings_of_a_file_fly_in_the_report_and_in_its_commands(tmp_path):
    gains = tmp_path / "gains.toml"
    gains.write_text('controller = "dc-pid"\n[settings]\nrounds = 2\n', encoding="utf-8")
    subject, rival, plus = reproduce.entries([load_settings(gains)])
    assert subject.contender.complete["rounds"] == 2
    assert subject.contender.label == "dc-pid, gains"
    assert [e.contender.label for e in (rival, plus)] == [
        e.contender.label for e in reproduce.entries()[1:]
    ]
    claim = next(c for c in CLAIMS if not isinstance(c.test, Proof))
    condition = reproduce.CONDITIONS[0]
    assert f"--settings {gains}" in reproduce.command(claim, subject, condition, 5)
    assert "--settings" not in reproduce.command(claim, plus, condition, 5)
    stranger = tmp_path / "pid.toml"
    stranger.write_text('controller = "pid"\n[settings]\n', encoding="utf-8")
    with pytest.raises(CampaignError, match="does not fly here"):
        reproduce.entries([load_settings(stranger)])


def test_a_sweep_flies_another_plant(tmp_path):
    out = tmp_path / "rows.parquet"
    assert main([*SWEEP, "--plant", "servo", "--out", str(out)]) == 0
    assert read_campaign(out).identity["simulation"]["plant"] == "servo"
