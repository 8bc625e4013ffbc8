"""Flights of a campaign that were lost, or that swing, are flown again and explained."""

import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")

from fullam.analysis.campaign import Campaign, sweep
from fullam.analysis.lost import OSCILLATING, lost_flights
from fullam.cli import main
from fullam.simulation.many import fly_many


def test_lost_flights_are_counted_and_the_first_of_them_explained(tmp_path):
    contenders = ("pid", "dc-pid-plus", "dc-pid-plus@truth")
    campaign = Campaign(("hextilt-step",), contenders, (0, 1, 2))
    table = sweep(campaign, tmp_path / "lost.parquet", jobs=1)
    count, flights = lost_flights(table, most=2)
    assert count == 3
    assert [(flight.contender, flight.seed) for flight in flights] == [("pid", 0), ("pid", 1)]
    for flight in flights:
        assert flight.scenario == "hextilt-step"
        assert flight.reason.startswith("at t =")
        assert flight.findings[0].kind == "margin"
    assert lost_flights(table, most=0) == (3, [])


@pytest.fixture(scope="module")
def swinging(tmp_path_factory):
    """The hextilt under the recommended law, with its own estimator and with a wrong one."""
    path = tmp_path_factory.mktemp("swinging") / "rows.parquet"
    labels = ("dc-pid-plus", "dc-pid-plus@first-order")
    campaign = Campaign(("hextilt-step",), labels, tuple(range(12)))
    return path, campaign, sweep(campaign, path)


def test_a_row_says_of_its_flight_what_the_flight_alone_says_of_itself(swinging):
    """Judged in lanes, told in the same words; some flights of the wrong pair swing."""
    _, campaign, table = swinging
    for contender in campaign.contenders:
        plan = campaign.plan(campaign.scenarios[0], contender)
        runs = list(fly_many(plan, campaign.seeds, threads=1))
        where = ("hextilt-step", contender.label)
        assert table.column("outcome", *where).tolist() == [run.outcome for run in runs]
        reasons = [run.metadata["reason"] for run in runs]
        assert table.column("reason", *where).tolist() == reasons
    right, wrong = (table.column("outcome", None, c.label).tolist() for c in campaign.contenders)
    assert right == ["completed"] * 12
    assert wrong.count("oscillating") >= 1


def test_python_and_machine_code_name_the_same_swings(swinging, tmp_path):
    _, campaign, table = swinging
    label = "dc-pid-plus@first-order"
    python = Campaign(campaign.scenarios, (label,), campaign.seeds[:3], driver="python")
    slow = sweep(python, tmp_path / "slow.parquet")
    for name in ("outcome", "reason"):
        assert slow.column(name).tolist() == table.column(name, None, label)[:3].tolist()


def test_flights_that_swing_are_not_lost_and_explained_apart(swinging):
    _, _, table = swinging
    swings = table.column("outcome").tolist().count("oscillating")
    count, flights = lost_flights(table, 1, OSCILLATING)
    assert count == swings
    assert "swings by" in flights[0].reason
    assert flights[0].findings
    lost, _ = lost_flights(table, 0)
    assert lost == table.column("outcome").tolist().count("diverged")


def test_the_command_counts_them(swinging, capsys):
    path, _, table = swinging
    labels = "dc-pid-plus,dc-pid-plus@first-order"
    sweep_again = ["sweep", "hextilt-step", "--controllers", labels, "--runs", "12"]
    assert main([*sweep_again, "--out", str(path)]) == 0
    out = capsys.readouterr().out
    assert "oscillating" in out.splitlines()[0]
    row = next(line.split() for line in out.splitlines() if "@first-order" in line)
    outcomes = table.column("outcome", None, "dc-pid-plus@first-order").tolist()
    assert [int(cell) for cell in row[2:4]] == [
        outcomes.count("diverged"),
        outcomes.count("oscillating"),
    ]
