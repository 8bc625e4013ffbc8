"""While something flies BLAS has one thread, and afterwards what it had before."""

import threading

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import fullam
from fullam.numbers.blas import one_blas_thread
from fullam.simulation import flight, fused
from fullam.simulation.scenarios.scenario import load_scenario

SHORT = load_scenario("position-1").to_dict() | {"duration": 0.1}


def threads():
    """Of each BLAS library of this process, but those built for one thread (that of cvxopt is)."""
    found = [library for library in threadpool_info() if library["user_api"] == "blas"]
    return [each["num_threads"] for each in found if each["threading_layer"] != "disabled"]


@pytest.fixture(autouse=True)
def two_threads():
    import scipy.linalg  # noqa: F401 - may bring a BLAS of its own

    with threadpool_limits(2, user_api="blas"):
        assert threads() and set(threads()) == {2}
        yield
        assert set(threads()) == {2}, "they are not given back"


def test_it_may_be_nested_and_gives_back_after_an_error():
    with one_blas_thread():
        with one_blas_thread():
            assert set(threads()) == {1}
        assert set(threads()) == {1}
    assert set(threads()) == {2}
    with pytest.raises(ZeroDivisionError), one_blas_thread():
        _ = 1 / 0
    assert set(threads()) == {2}


def test_whoever_leaves_last_gives_back_in_whatever_order():
    entered, leave = threading.Event(), threading.Event()

    def hold():
        with one_blas_thread():
            entered.set()
            assert leave.wait(10.0)

    other = threading.Thread(target=hold)
    with one_blas_thread():
        other.start()
        assert entered.wait(10.0)
    assert set(threads()) == {1}, "the other one still flies"
    leave.set()
    other.join()
    assert set(threads()) == {2}


@pytest.mark.parametrize("driver", ["python", "fused"])
def test_a_flight_has_one_thread(driver, monkeypatch):
    # What the first flight imports on its way may bring a BLAS of its own.
    fullam.simulate(fullam.Scenario.from_dict(SHORT), driver=driver)
    seen = []
    module = flight if driver == "python" else fused
    original = module.finish

    def watched(*given, **more):
        seen.append(threads())
        return original(*given, **more)

    monkeypatch.setattr(module, "finish", watched)
    fullam.simulate(fullam.Scenario.from_dict(SHORT), driver=driver)
    assert seen and set(seen[0]) == {1}


def test_a_flight_in_the_hand_has_one_thread_only_while_it_moves(monkeypatch):
    seen = []
    hand = fullam.fly("fullam", duration=1.0)
    step = hand.flight.step
    monkeypatch.setattr(hand.flight, "step", lambda: (seen.append(threads()), step())[1])
    hand.advance(0.05)
    assert seen and all(set(found) == {1} for found in seen)
    assert set(threads()) == {2}


def test_many_flights_have_one_thread_and_who_takes_them_has_his_own():
    plan = fullam.prepare(fullam.Scenario.from_dict(SHORT))
    for _ in fullam.fly_many(plan, range(3), threads=1):
        assert set(threads()) == {2}
