"""`fullam sweep`, `tune` and `reproduce` as typed."""

import json
from dataclasses import replace

import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")

from fullam.analysis import campaign, reproduce, tuning
from fullam.analysis.campaign_table import read_campaign
from fullam.cli import main
from fullam.simulation.scenario import load_scenario, register_scenario

SHORT = register_scenario(replace(load_scenario("position-1"), name="short-cli", duration=0.5))
SWEEP = ["sweep", "short-cli", "--runs", "2", "--driver", "python"]


def test_a_sweep_prints_medians_and_keeps_rows(tmp_path, capsys):
    out = tmp_path / "rows.parquet"
    assert main([*SWEEP, "--controllers", "pid,dc-pid@truth", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "dc-pid@truth" in text
    assert "4 rows" in text
    assert len(read_campaign(out)) == 4


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
    out = tmp_path / "dc-pid.toml"
    assert main(["tune", "dc-pid", "--budget", "30", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert printed == out.read_text(encoding="utf-8")
    assert 'command = "fullam tune dc-pid --budget 30 --seed 0"' in printed


def test_reproduce_writes_where_it_says(tmp_path, capsys, monkeypatch):
    import fullam.viz.report as report

    asked = {}
    monkeypatch.setattr(
        reproduce, "reproduce", lambda folder, **options: asked.update(options) or "result"
    )
    monkeypatch.setattr(report, "write_report", lambda result, folder: folder / "index.html")
    assert main(["reproduce", "--quick", "--jobs", "2", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "index.html")
    assert (asked["quick"], asked["jobs"]) == (True, 2)


def test_a_sweep_flies_another_plant(tmp_path):
    out = tmp_path / "rows.parquet"
    assert main([*SWEEP, "--plant", "servo", "--out", str(out)]) == 0
    assert read_campaign(out).identity["simulation"]["plant"] == "servo"
