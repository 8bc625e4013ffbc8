"""`fullam view` and `fullam plot` from the command line."""

import pytest

import fullam
from fullam.cli import main
from fullam.viz.viewer import browser


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    data = fullam.load_scenario("task-2").to_dict() | {"duration": 0.3}
    run = fullam.simulate(fullam.Scenario.from_dict(data), seed=2)
    return str(run.save(tmp_path_factory.mktemp("runs") / "run.npz"))


def test_records_side_by_side_become_a_page(record, tmp_path, capsys):
    page = tmp_path / "flight.html"
    assert main(["view", record, record, "--offset", "1.5", "--html", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "fullam.film(" in text and '"path":"vehicle_2"' in text
    assert str(page) in capsys.readouterr().out


def test_a_scenario_is_flown_for_a_page(tmp_path):
    scenario = tmp_path / "short.toml"
    scenario.write_text('name = "short"\nduration = 0.2\n', encoding="utf-8")
    page = tmp_path / "flight.html"
    assert main(["view", str(scenario), "--calm", "--html", str(page)]) == 0
    assert "short" in page.read_text(encoding="utf-8")


def test_a_live_flight_says_where_and_how_it_went(tmp_path, capsys):
    scenario = tmp_path / "short.toml"
    scenario.write_text('name = "short"\nduration = 0.2\n', encoding="utf-8")
    asked = ["view", str(scenario), "--once", "--wait", "0.05", "--port", "0", "--speed", "2"]
    assert main(asked) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("open http://127.0.0.1:")
    assert "short, dc-pid: 0.20 s flown in 0." in second and second.endswith("completed")


def test_a_missing_browser_is_a_message_and_not_a_trace(record, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(browser.shutil, "which", lambda name: None)
    assert main(["view", record, "--png", str(tmp_path / "a.png")]) == 2
    assert "apt install chromium" in capsys.readouterr().err


@pytest.mark.parametrize(
    "asked",
    [
        ["view", "task-1", "task-2"],
        ["view", "task-9"],
        ["view", "missing.npz"],
        ["view", "task-2", "--speed", "0"],
        ["plot", "missing.npz", "--out", "a.png"],
    ],
)
def test_what_cannot_be_seen_is_a_usage_error(asked, capsys):
    assert main(asked) == 2
    assert capsys.readouterr().err


@pytest.mark.parametrize("what", [[], ["--what", "pose,rotors,wrench"]])
def test_plot_writes_a_figure(record, tmp_path, what):
    target = tmp_path / "figure.png"
    assert main(["plot", record, *what, "--out", str(target)]) == 0
    assert target.read_bytes().startswith(b"\x89PNG")


def test_plot_names_the_panels_it_knows(record, tmp_path, capsys):
    assert main(["plot", record, "--what", "pose,colour", "--out", str(tmp_path / "a.png")]) == 2
    assert "residual" in capsys.readouterr().err


def test_a_vehicle_is_flown_by_hand_and_its_record_kept(tmp_path, capsys):
    record = tmp_path / "hand.npz"
    asked = ["fly", "fullam", "--duration", "0.3", "--once", "--wait", "0.05", "--port", "0"]
    assert main([*asked, "--save", str(record)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert "this machine only" in said[0]
    assert said[1].startswith("free flight, dc-pid: 0.30 s flown")
    run = fullam.Run.load(record)
    assert run.scenario.name == "free flight" and run.weather == fullam.weather("calm")


def test_a_scenario_is_flown_by_hand_in_its_world_on_servos(tmp_path, capsys):
    record = tmp_path / "wall.npz"
    asked = ["fly", "push-wall", "--duration", "0.3"]
    assert main([*asked, "--once", "--wait", "0", "--port", "0", "--save", str(record)]) == 0
    assert "push-wall, hybrid-force: 0.30 s flown" in capsys.readouterr().out
    run = fullam.Run.load(record)
    assert run.simulation.plant == "servo" and len(run.scenario.world) == 1
    assert run.scenario.duration == 0.3 and run.weather == fullam.weather("paper")


def test_listening_to_other_machines_is_said_plainly(capsys):
    asked = ["fly", "fullam", "--duration", "0.1", "--once", "--wait", "0", "--port", "0"]
    assert main([*asked, "--host", "127.0.0.2"]) == 0
    assert "whoever has this address" in capsys.readouterr().out


@pytest.mark.parametrize(
    "asked",
    [
        ["fly", "nobody"],
        ["fly", "fullam", "--duration", "0"],
        ["fly", "fullam", "--save", "a.txt"],
        ["fly", "fullam", "--once", "--host", "192.0.2.1"],
    ],
)
def test_what_cannot_be_flown_is_a_usage_error(asked, capsys):
    assert main(asked) == 2
    assert capsys.readouterr().err
