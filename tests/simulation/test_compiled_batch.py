"""Many seeds of one plan: the flights are those of `simulate`, and fail one by one."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from fullam.exceptions import NonFiniteWrench
from fullam.simulation.simulate import prepare, simulate

pytest.importorskip("numba", reason="the compiled engine needs the extra 'fast'")

from fullam.simulation.compiled import batch


@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_is_the_single_flights(threads, monkeypatch):
    monkeypatch.setattr(batch, "TOGETHER", 2)
    plan = prepare("task-2", seed=99)
    for flown in batch.fly_seeds(plan, range(5), threads):
        run, single = flown.run(), simulate("task-2", seed=flown.plan.seed, engine="compiled")
        assert run.metadata == single.metadata
        for name, column in single.columns.items():
            assert np.array_equal(column, run.columns[name]), name


def test_a_failure_costs_no_other_flight_of_a_batch(monkeypatch):
    """It is kept with its seed, and raised when its run is asked for."""
    plan, draws = prepare("task-2", seed=0), batch.draw_of
    poisoned = plan.with_seed(1).forecast.pose_noise

    def draw_of(forecast):
        draw = draws(forecast)
        if np.array_equal(forecast.pose_noise, poisoned):
            draw.noise[3] = np.nan
        return draw

    monkeypatch.setattr(batch, "draw_of", draw_of)
    flights = list(batch.fly_seeds(plan, range(4), threads=2))
    assert [flown.plan.seed for flown in flights] == [0, 1, 2, 3]
    for seed in (0, 2, 3):
        assert flights[seed].run().outcome == "completed"
    with pytest.raises(NonFiniteWrench):
        flights[1].run()
    with pytest.raises(NonFiniteWrench):
        batch.Batch(plan).fly(1).run()


def test_a_batch_that_is_closed_flies_no_more(monkeypatch):
    """What is queued is cancelled; what is in the air may land."""
    started, land = [], threading.Event()
    fly_some = batch.Batch.fly_some

    def slowly(self, seeds):
        started.append(seeds)
        if len(started) > 1:
            land.wait(10.0)
        return fly_some(self, seeds)

    monkeypatch.setattr(batch, "TOGETHER", 1)
    monkeypatch.setattr(batch.Batch, "fly_some", slowly)
    flights = batch.fly_seeds(prepare("task-2"), range(100), threads=2)
    for _ in range(2):  # the first is flown without threads
        next(flights)
    threading.Timer(0.2, land.set).start()
    flights.close()
    assert len(started) <= 3
