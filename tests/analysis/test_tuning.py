"""The tuning procedure, on a cost that is known; and what is committed of its results."""

import functools
import math
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("cma", reason="the extra 'campaign' is not installed")

from fullam.analysis import tuned_gains, tuning
from fullam.analysis.cluster import map_in_order, open_workers
from fullam.analysis.judged import figures_of, judge_of
from fullam.analysis.metrics import measure
from fullam.analysis.response import Response
from fullam.analysis.tuned_gains import tuned_names, tuned_settings
from fullam.analysis.tuning import (
    LOST,
    SEARCH_SPACES,
    TRAINING,
    VALIDATION,
    Parameter,
    candidate_cost,
    flight_costs,
    tune,
)
from fullam.control.controllers import controller_names, make_settings
from fullam.exceptions import CampaignError, SettingsError, UnknownName
from fullam.simulation.simulate import fly_by_python, prepare

BEST = {"position_gains": (12.0, 0.5, 7.0), "attitude_gains": (40.0, 2.0, 11.0)}


def bowl(settings, controller, estimator, driver, flights):
    """Squared distance from BEST in logarithms; 0 there."""
    return sum(
        math.log(value / best) ** 2
        for name in BEST
        for value, best in zip(settings[name], BEST[name], strict=True)
    )


@pytest.fixture
def known_cost(monkeypatch):
    monkeypatch.setattr(tuning, "candidate_cost", bowl)


def test_it_finds_the_bottom_of_a_known_bowl(known_cost):
    result = tune("dc-pid", budget=400)
    # From a distance of 2.9 (a factor 18) to 0.1, every gain within 10 %.
    assert result.cost < 0.01 < 8.0 < result.default_cost
    assert result.evaluations <= 400
    assert result.validation == (result.default_cost, result.cost)


def test_the_same_seed_finds_the_same(known_cost):
    state = np.random.get_state()[1].tolist()  # noqa: NPY002 - that it is left alone
    first, again, other = (tune("dc-pid", budget=60, seed=s) for s in (1, 1, 2))
    assert first == again != other
    assert np.random.get_state()[1].tolist() == state  # noqa: NPY002


def test_an_interrupted_search_leaves_its_best(tmp_path, known_cost):
    out = tmp_path / "dc-pid.toml"
    told = []

    def stop(best):
        told.append(best)
        if len(told) == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tune("dc-pid", budget=400, out=out, progress=stop)
    assert out.read_text(encoding="utf-8") == told[-1].to_toml()
    costs = [best.cost for best in told]
    assert costs == sorted(costs, reverse=True)
    assert told[-1].evaluations == 51


def test_a_stopped_search_goes_on_and_ends_with_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr(tuning, "candidate_cost", bowl)
    whole, out = tune("dc-pid", budget=60, out=tmp_path / "whole.toml"), tmp_path / "dc-pid.toml"
    flown = []

    def dies(settings, controller, estimator, driver, flights):
        if len(flown) == 27:
            raise KeyboardInterrupt
        flown.append(settings)
        return bowl(settings, controller, estimator, driver, flights)

    monkeypatch.setattr(tuning, "candidate_cost", dies)
    with pytest.raises(KeyboardInterrupt):
        tune("dc-pid", budget=60, out=out)
    journal = tmp_path / "dc-pid.toml.journal"
    # What a kill in the middle of a write leaves.
    journal.write_bytes(journal.read_bytes() + b"0123456789abcdef [[")

    def counts(*arguments):
        flown.append(arguments[0])
        return bowl(*arguments[:1], *[None] * 4)

    monkeypatch.setattr(tuning, "candidate_cost", lambda settings, **options: counts(settings))
    assert tune("dc-pid", budget=60, out=out) == whole
    assert len(flown) == 51 + 2, "candidates and validation, each once"
    assert out.read_bytes() == (tmp_path / "whole.toml").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dc-pid.toml", "whole.toml"]


def test_costs_of_other_conditions_are_not_continued(tmp_path, known_cost, monkeypatch):
    out = tmp_path / "dc-pid.toml"

    def stop(best):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tune("dc-pid", budget=30, out=out, progress=stop)
    with pytest.raises(CampaignError, match="estimator differ"):
        tune("dc-pid", estimator="truth", budget=30, out=out)
    seen = []
    monkeypatch.setattr(tuning, "_vehicles", lambda: seen.append(0) or {"fullam": len(seen) > 2})
    with pytest.raises(CampaignError, match="was edited"):
        tune("dc-pid", budget=30, out=tmp_path / "other.toml")


def test_what_is_written_is_what_is_read(tmp_path, known_cost, monkeypatch):
    monkeypatch.setattr(tuned_gains, "TUNED", tmp_path)
    result = tune("dc-pid", estimator="truth", budget=30, out=tmp_path / "dc-pid@truth.toml")
    assert tuned_names() == ("dc-pid@truth",)
    read = tuned_settings("dc-pid", "truth")
    assert make_settings("dc-pid", read) == make_settings("dc-pid", result.settings)
    assert "fullam tune dc-pid@truth --budget 30 --seed 0" in result.to_toml()
    with pytest.raises(UnknownName, match="dc-pid@truth"):
        tuned_settings("dc-pid")


@pytest.mark.parametrize("name", tuned_names())
def test_committed_settings_fit_their_controller_and_beat_its_defaults(name):
    import tomllib

    document = tomllib.loads((tuned_gains.TUNED / f"{name}.toml").read_text(encoding="utf-8"))
    controller, _, estimator = name.partition("@")
    settings = make_settings(controller, tuned_settings(controller, estimator or None))
    assert document["command"].startswith(f"fullam tune {name} ")
    for parameter in SEARCH_SPACES[controller]:
        value = getattr(settings, parameter.field)[parameter.index]
        assert parameter.low <= value <= parameter.high
    assert document["validation"]["tuned"] < document["validation"]["defaults"]


def test_every_controller_has_a_search_space_of_the_same_size():
    assert set(SEARCH_SPACES) == set(controller_names())
    assert {len(space) for space in SEARCH_SPACES.values()} == {6}


def test_no_seed_serves_two_purposes():
    evaluation = set(range(10_000))
    training, validation = ({seed for _, seed in flights} for flights in (TRAINING, VALIDATION))
    assert not training & validation
    assert not (training | validation) & evaluation


def test_decoding_inverts_encoding_at_the_written_precision():
    parameter = Parameter("position_gains", 0, 0.01, 30.0)
    assert parameter.decode(0.0) == 0.01
    assert parameter.decode(1.0) == 30.0
    assert parameter.encode(100.0) == 1.0
    assert parameter.encode(0.0) == 0.0  # a default of 0 starts at the lower end
    for x in (0.1, 0.5, 0.9):
        # Four digits are up to 5e-4 relative, over a range of 8 e-folds 6e-5 of the interval.
        assert parameter.encode(parameter.decode(x)) == pytest.approx(x, abs=6.3e-5)


def test_a_worse_flight_costs_more():
    costs = []
    for plan in (prepare("position-1", calm=True), prepare("position-1", seed=0)):
        run = fly_by_python(plan)
        figures = figures_of(judge_of(plan), run, plan.nominal.rotors.k_f)
        costs += flight_costs(figures).tolist()
    assert 0.0 < costs[0] < costs[1] < LOST


def test_the_cost_is_the_formula_of_the_text():
    plan = prepare("tilt-hover-2", seed=3)
    run = fly_by_python(plan)
    figures, response = measure(run), Response.of(run)
    expected = (
        figures.rms_position_mm / 10.0
        + figures.rms_attitude_deg
        + figures.max_excursion_mm / 25.0
        + figures.max_excursion_deg / 5.0
    )
    # The position is held in this scenario: only the turn has a step to be divided by.
    assert not response.step[:3].any()
    angle = np.linalg.norm(response.rotation, axis=1)
    expected += angle.sum() * response.period / np.linalg.norm(response.step[3:])
    found = flight_costs(figures_of(judge_of(plan), run, plan.nominal.rotors.k_f))
    # Sums of 600 rows in another order.
    np.testing.assert_allclose(found, [expected], rtol=1e-12)


def test_both_drivers_and_any_number_of_threads_find_the_same_cost():
    flights = (("position-1", 1_000_000), ("position-1", 1_000_001))
    costs = [candidate_cost({}, "dc-pid", "first-order", d, flights) for d in ("python", "fused")]
    # Pinocchio flies where the kernels' own recursion does otherwise: rounding, over 6 s.
    assert costs[0] == pytest.approx(costs[1], rel=1e-9)
    with open_workers(2, threads=True) as workers:
        work = functools.partial(
            candidate_cost,
            controller="dc-pid",
            estimator="first-order",
            driver="fused",
            flights=flights,
        )
        assert map_in_order(workers, work, [{}] * 4) == [costs[1]] * 4


@pytest.mark.parametrize("driver", ["python", "fused"])
def test_a_lost_flight_costs_the_most(driver):
    limp = {"attitude_gains": (1e-3, 0.0, 0.0)}
    cost = candidate_cost(limp, "pid", "first-order", driver, (("position-3", 1_000_000),))
    assert cost == LOST


def test_mistakes_are_named_before_anything_flies():
    with pytest.raises(UnknownName):
        tune("lqr")
    with pytest.raises(UnknownName):
        tune("dc-pid", estimator="clairvoyance")
    with pytest.raises(SettingsError, match="budget"):
        tune("dc-pid", budget=3)
    assert Path(tuned_gains.TUNED).name == "tuned"
