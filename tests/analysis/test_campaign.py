"""Campaigns in one process: rows, determinism, resuming. The cluster has its own file."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")

from fullam.analysis import campaign as campaign_module
from fullam.analysis.campaign import Campaign, Contender, fly_slice, sweep
from fullam.analysis.campaign_store import SCHEMA, CampaignStore, read_campaign
from fullam.analysis.metrics import measure
from fullam.exceptions import CampaignError, NonFiniteWrench, UnknownName
from fullam.model.loading import load_vehicle
from fullam.simulation.scenario import load_scenario
from fullam.simulation.simulate import fly_under_seeds, prepare, simulate

SHORT = replace(load_scenario("position-1"), name="short", duration=0.6)


def small(seeds=range(5), **changes):
    return Campaign(
        **{"scenarios": (SHORT,), "contenders": ("dc-pid", "pid"), "seeds": tuple(seeds)} | changes
    )


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    path = tmp_path_factory.mktemp("campaign") / "sweep.parquet"
    return path, sweep(small(traces=True), path)


def test_every_cell_is_a_row_in_canonical_order(finished):
    path, table = finished
    keys = list(zip(*(table.column(n) for n in ("scenario", "contender", "seed")), strict=True))
    assert keys == [("short", c, s) for c in ("dc-pid", "pid") for s in range(5)]
    assert read_campaign(path).rows.equals(table.rows)
    assert table.rows.schema.names == SCHEMA.names
    assert not path.with_name(path.name + ".parts").exists()


def test_a_row_says_what_measure_says(finished):
    run = simulate(SHORT, "pid", seed=3)
    figures = measure(run)
    table = finished[1]
    row = {name: table.column(name, contender="pid")[3] for name in SCHEMA.names}
    assert row["rms_position_mm"] == figures.rms_position_mm
    assert row["z_max_excursion_mm"] == figures.axes["z"].max_excursion
    assert np.isnan(row["settling_time_s"]) == (figures.settling_time_s is None)
    assert row["settled"] == figures.settled
    trace = table.traces("short", "pid")[3]
    # float32 keeps 10 m to 1 um.
    assert np.allclose(trace[:, :3], 1e3 * run.pose[::4, :3], atol=1e-3 * 2)


def test_both_contenders_meet_the_same_weather():
    flights = [simulate(SHORT, name, seed=4) for name in ("pid", "dc-pid")]
    assert np.array_equal(flights[0].disturbance, flights[1].disturbance)


def count_flights(monkeypatch):
    """A list that from now on gets the key of every flight."""
    counted, fly = [], Campaign.fly
    monkeypatch.setattr(Campaign, "fly", lambda self, keys: counted.extend(keys) or fly(self, keys))
    return counted


def test_a_stopped_campaign_continues_and_ends_with_the_same_bytes(tmp_path, finished, monkeypatch):
    campaign, out = small(traces=True), tmp_path / "again.parquet"
    flown = []
    figures = Campaign._figures

    def stopping(self, fly, seed, vehicle):
        if len(flown) == 7:
            raise KeyboardInterrupt
        flown.append(seed)
        return figures(self, fly, seed, vehicle)

    monkeypatch.setattr(Campaign, "_figures", stopping)
    with pytest.raises(KeyboardInterrupt):
        sweep(campaign, out)
    assert not out.exists()
    kept = CampaignStore(out, campaign.identity(), False).keys
    assert len(kept) == 7
    # What a kill in the middle of a write leaves.
    (tmp_path / "again.parquet.parts" / ".half-written.parquet").write_bytes(b"PAR1")

    monkeypatch.setattr(Campaign, "_figures", figures)
    counted = count_flights(monkeypatch)
    told = []
    sweep(campaign, out, progress=lambda done, total: told.append((done, total)))
    assert len(counted) == 3
    assert told[0] == (7, 10)
    assert told[-1] == (10, 10)
    assert out.read_bytes() == finished[0].read_bytes()


def test_a_finished_campaign_is_not_flown_again_but_extended(tmp_path, monkeypatch):
    out = tmp_path / "sweep.parquet"
    sweep(small(range(2)), out)
    before = out.read_bytes()
    counted = count_flights(monkeypatch)
    sweep(small(range(2)), out)
    assert not counted
    assert out.read_bytes() == before
    sweep(small(range(3)), out)
    assert sorted(counted) == [("short", "dc-pid", 2), ("short", "pid", 2)]
    fresh = tmp_path / "fresh.parquet"
    sweep(small(range(3)), fresh)
    assert out.read_bytes() == fresh.read_bytes()


def test_a_diverged_and_a_failed_flight_are_rows(tmp_path, monkeypatch):
    hopeless = replace(SHORT, name="hopeless", initial_euler_deg=(179.0, 0.0, 0.0), duration=2.0)
    table = sweep(small([0], scenarios=(hopeless,)), tmp_path / "a.parquet")
    assert set(table.column("outcome")) == {"diverged"}
    assert "deg from the reference" in table.column("reason")[0]
    assert not table.column("settled").any()

    def breaks(seed):
        raise NonFiniteWrench(np.full(6, np.nan))

    monkeypatch.setattr(campaign_module, "fly_under_seeds", lambda plan, engine: breaks)
    table = sweep(small([0]), tmp_path / "b.parquet")
    assert list(table.column("outcome")) == ["failed", "failed"]
    assert np.isnan(table.column("rms_position_mm")).all()


def test_a_file_of_other_conditions_is_refused_unless_overwritten(tmp_path):
    out = tmp_path / "sweep.parquet"
    sweep(small([0]), out)
    other = small([0], weather="calm")
    with pytest.raises(CampaignError, match="weather differ"):
        sweep(other, out)
    assert sweep(other, out, overwrite=True).identity["weather"]["position_noise"] == 0.0
    with pytest.raises(CampaignError, match="parquet"):
        sweep(other, tmp_path / "sweep.csv")


def test_another_vehicle_of_the_same_name_is_another_campaign(tmp_path, monkeypatch):
    out = tmp_path / "sweep.parquet"
    sweep(small([0]), out)
    heavier = load_vehicle("fullam")
    rotors = replace(heavier.rotors, k_f=1.01 * heavier.rotors.k_f)
    definition = {**heavier.definition, "description": "stronger"}
    stronger = replace(heavier, rotors=rotors, definition=definition)
    monkeypatch.setattr(campaign_module, "cached_vehicle", lambda name: stronger)
    with pytest.raises(CampaignError, match="vehicles differ"):
        sweep(small([0, 1]), out)


def test_a_file_that_is_no_result_is_named(tmp_path):
    broken = tmp_path / "broken.parquet"
    broken.write_bytes(b"PAR1 and no more")
    with pytest.raises(CampaignError, match="cannot be read"):
        read_campaign(broken)
    with pytest.raises(CampaignError, match="does not exist"):
        read_campaign(tmp_path / "none.parquet")


def test_mistakes_are_found_before_anything_flies():
    with pytest.raises(UnknownName):
        small(contenders=("dc-pidd",))
    with pytest.raises(UnknownName):
        small(contenders=("dc-pid@kalmann",))
    with pytest.raises(CampaignError, match="seeds"):
        small(seeds=())
    for seeds in ((0, -1), (0.0, 1.7), ("0",)):
        with pytest.raises(CampaignError, match=r"seed: is .*whole number"):
            small(seeds=seeds)
    with pytest.raises(CampaignError, match="contenders"):
        small(contenders=("pid", Contender("pid")))
    with pytest.raises(UnknownName):
        small(weather="stormy")
    with pytest.raises(UnknownName):
        small(engine="steam")


def test_an_estimator_of_its_own_shows_in_the_row(tmp_path):
    campaign = small([0], contenders=("dc-pid@truth", "dc-pid"))
    table = sweep(campaign, tmp_path / "sweep.parquet")
    assert list(table.column("estimator")) == ["truth", "first-order"]
    assert list(table.column("contender")) == ["dc-pid@truth", "dc-pid"]


def test_a_worker_where_something_else_would_fly_is_refused():
    campaign = small([0])
    conditions = campaign.conditions()
    assert len(fly_slice(campaign, conditions, campaign.keys[:1])) == 1
    for other, message in (
        ({"code": "0" * 16}, "code"),
        ({"versions": conditions["versions"] | {"pin": "3.9.0"}}, "pin .* here, 3.9.0 there"),
        ({"vehicles": {"fullam": "0" * 16}}, "vehicles"),
        ({"registered": {"controller mine": "0" * 16}}, "registered"),
    ):
        with pytest.raises(CampaignError, match=message):
            fly_slice(campaign, conditions | other, campaign.keys[:1])


def test_a_slice_of_work_ends_in_time(monkeypatch):
    campaign = small(range(5), contenders=("dc-pid",))
    monkeypatch.setattr(campaign_module, "SLICE", 0.0)
    assert len(fly_slice(campaign, campaign.conditions(), campaign.keys)) == 1


def test_the_fastest_engine_is_chosen_contender_by_contender(tmp_path):
    pytest.importorskip("numba", reason="the extra 'fast' is not installed")
    campaign = small([0], contenders=("dc-pid", "dc-pid@kalman"), engine="fastest")
    assert campaign.engines == {"dc-pid": "compiled", "dc-pid@kalman": "reference"}
    table = sweep(campaign, tmp_path / "sweep.parquet")
    assert table.rows.num_rows == 2


def test_both_engines_fly_the_same_table(tmp_path):
    pytest.importorskip("numba", reason="the extra 'fast' is not installed")
    short = replace(load_scenario("task-2"), name="short", duration=3.0)
    tables = [
        sweep(
            small(
                range(3), scenarios=(short,), contenders=("dc-pid", "backstepping"), engine=engine
            ),
            tmp_path / f"{engine}.parquet",
        )
        for engine in ("reference", "compiled")
    ]
    for field in SCHEMA:
        one, other = (table.column(field.name) for table in tables)
        if field.type == "double":
            # Figures of 1 to 1000 mm and deg; feedback keeps rounding from growing.
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9, err_msg=field.name)
        else:
            assert list(one) == list(other), field.name


@pytest.mark.parametrize("engine", ["reference", "compiled"])
def test_flights_that_share_a_plan_are_the_single_flights(engine):
    if engine == "compiled":
        pytest.importorskip("numba", reason="the extra 'fast' is not installed")
    fly = fly_under_seeds(prepare(SHORT, seed=7), engine)
    for seed in (3, 1, 3):
        run, single = fly(seed), simulate(SHORT, seed=seed, engine=engine)
        assert run.metadata == single.metadata
        for name, column in single.columns.items():
            assert np.array_equal(column, run.columns[name]), name
