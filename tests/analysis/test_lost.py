"""Flights of a campaign that were lost are flown again and explained."""

import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")

from fullam.analysis.campaign import Campaign, sweep
from fullam.analysis.lost import lost_flights


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
