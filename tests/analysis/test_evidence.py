"""Verdicts on made-up rows whose answer is known, and the proof about parallel rotors."""

import numpy as np
import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")

import pyarrow as pa

from fullam.analysis.campaign_table import SCHEMA, CampaignTable
from fullam.analysis.claims import (
    CLAIMS,
    RIVAL,
    SCENARIOS,
    SUBJECT,
    TARGETS,
    Bound,
    Claim,
    Paired,
    Proof,
    Side,
)
from fullam.analysis.evidence import (
    FAILS,
    FIGURES,
    HOLDS,
    UNDECIDED,
    judge,
    prove_no_tilted_hover,
)
from fullam.exceptions import CampaignError
from fullam.model.loading import load_vehicle
from fullam.simulation.scenarios.catalogue import CONFIGURATIONS, TILT_EULER_DEG
from fullam.simulation.scenarios.scenario import scenario_names

RNG = np.random.default_rng(7)


def table(**samples):
    """Rows from {"scenario/contender": {column: values}}."""
    rows = []
    for key, columns in samples.items():
        scenario, contender = key.split("/")
        for seed in range(len(next(iter(columns.values())))):
            row = {name: values[seed] for name, values in columns.items()}
            rows.append(
                {"scenario": scenario, "contender": contender, "seed": seed}
                | {"outcome": "completed"}
                | row
            )
    return CampaignTable(pa.Table.from_pylist(rows, SCHEMA), {})


def settling_claim(quantile=0.5):
    return Claim("k", "says", "measured", Bound("settling", 2.0, "s", ("a", "b"), quantile))


def settling(a, b):
    return table(**{"a/me": {"settling_time_s": a}, "b/me": {"settling_time_s": b}})


def test_a_bound_is_judged_by_its_worst_scenario():
    fast, slow = RNG.normal(1.5, 0.1, 40), RNG.normal(2.5, 0.1, 40)
    assert judge(settling_claim(), settling(fast, fast), "me", {}).verdict == HOLDS
    finding = judge(settling_claim(), settling(fast, slow), "me", {})
    assert (finding.verdict, finding.where) == (FAILS, "b")
    assert finding.note == "1 of 2 scenarios below"


def test_an_interval_across_the_threshold_decides_nothing():
    near = RNG.normal(2.0, 0.3, 40)
    assert judge(settling_claim(), settling(near, near - 1.0), "me", {}).verdict == UNDECIDED


def test_flights_that_never_settle_count():
    sometimes = [1.5] * 28 + [None] * 12
    assert judge(settling_claim(), settling(sometimes, sometimes), "me", {}).verdict == HOLDS
    finding = judge(settling_claim(0.95), settling(sometimes, sometimes), "me", {})
    assert finding.verdict == FAILS
    assert finding.interval.estimate == np.inf


def paired_claim(tolerance=0.0):
    test = Paired("attitude jitter", "deg", Side(("a",), RIVAL), Side(("a",)), tolerance)
    return Claim("k", "says", "measured", test)


def jitter(me, rival, outcome="completed"):
    n = len(me)
    return table(
        **{
            "a/me": {"jitter_attitude_deg": me, "outcome": ["completed"] * n},
            "a/him": {"jitter_attitude_deg": rival, "outcome": [outcome] + ["completed"] * (n - 1)},
        }
    )


def test_a_paired_claim_falls_whichever_way_the_flights_do():
    weather = RNG.normal(5.0, 2.0, 40)
    rivals = {RIVAL: "him"}
    better = judge(paired_claim(), jitter(weather, weather + 0.2), "me", rivals)
    assert better.verdict == HOLDS
    assert better.interval.estimate == pytest.approx(0.2)
    worse = judge(paired_claim(), jitter(weather + 0.2, weather), "me", rivals)
    assert worse.verdict == FAILS
    noise = RNG.normal(0.0, 1.0, 40)
    equal = judge(paired_claim(), jitter(weather, weather + noise - noise.mean()), "me", rivals)
    assert equal.verdict == UNDECIDED
    assert judge(paired_claim(0.5), jitter(weather + 0.2, weather), "me", rivals).verdict == HOLDS


def test_a_certain_difference_that_does_not_matter_is_called_so():
    weather = RNG.normal(5.0, 2.0, 40)
    tiny = judge(paired_claim(), jitter(weather, weather + 0.005), "me", {RIVAL: "him"})
    assert (tiny.verdict, tiny.note) == (HOLDS, "too little to matter")
    plain = judge(paired_claim(), jitter(weather, weather + 0.05), "me", {RIVAL: "him"})
    assert plain.note == ""


def test_a_lost_flight_takes_its_pair_with_it_and_is_told():
    finding = judge(paired_claim(), jitter([1.0] * 9, [2.0] * 9, "diverged"), "me", {RIVAL: "him"})
    assert finding.interval.count == 8
    assert finding.note == "1 pairs incomplete"


def test_one_diverged_flight_refutes_that_there_is_none():
    claim = Claim("k", "s", "m", Bound("diverged", 0.05, "", ("a",), None))
    well = table(**{"a/me": {"outcome": ["completed"] * 50}})
    assert judge(claim, well, "me", {}).verdict == HOLDS
    lost = table(**{"a/me": {"outcome": ["completed"] * 49 + ["diverged"]}})
    assert judge(claim, lost, "me", {}).verdict == FAILS


def test_what_was_not_flown_is_named():
    with pytest.raises(CampaignError, match="no flight of you"):
        judge(settling_claim(), settling([1.0], [1.0]), "you", {})
    with pytest.raises(CampaignError, match="needs no flights"):
        judge(Claim("k", "s", "m", Proof()), settling([1.0], [1.0]), "me", {})


def test_claims_speak_of_scenarios_and_figures_that_exist():
    keys = [claim.key for claim in (*CLAIMS, *TARGETS)]
    assert len(set(keys)) == len(keys)
    assert set(SCENARIOS) < set(scenario_names())
    for claim in (*CLAIMS, *TARGETS):
        test = claim.test
        if isinstance(test, Proof):
            continue
        assert test.figure in FIGURES
        sides = [test] if isinstance(test, Bound) else [test.more, test.less]
        for side in sides:
            assert set(side.scenarios) <= set(scenario_names())
            assert getattr(side, "contender", SUBJECT) in (SUBJECT, RIVAL)


@pytest.mark.parametrize("number", CONFIGURATIONS)
def test_parallel_rotors_miss_a_tilted_hover_by_the_sine_of_the_tilt(number):
    asked = TILT_EULER_DEG[number], CONFIGURATIONS[number]
    quadrotor = prove_no_tilted_hover(load_vehicle("quadrotor_arm"), *asked)
    assert quadrotor.rank == 4
    # Nothing pushes sideways: what is missing is weight times sin(tilt), and moments besides.
    assert quadrotor.missing_share == pytest.approx(
        np.sin(np.radians(quadrotor.tilt_deg)), rel=1e-2
    )
    ours = prove_no_tilted_hover(load_vehicle("fullam"), *asked)
    assert ours.rank == 6
    assert ours.missing_share < 1e-9  # rounding, in units of the weight


def test_both_hold_a_level_hover():
    for name in ("quadrotor_arm", "fullam"):
        proof = prove_no_tilted_hover(load_vehicle(name), (0.0, 0.0, 0.0), CONFIGURATIONS[4])
        assert proof.missing_share < 1e-9
        assert proof.tilt_deg == 0.0
