"""Campaigns in one process: rows, determinism, resuming. The cluster has its own file."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")

from fullam.analysis import campaign as campaign_module
from fullam.analysis.campaign import Campaign, fly_slice, sweep
from fullam.analysis.campaign_store import FLUSH, CampaignStore
from fullam.analysis.campaign_table import SCHEMA, flatten, read_campaign
from fullam.analysis.contender import Contender
from fullam.analysis.judged import driver_of, fly_judged
from fullam.analysis.metrics import measure, rows_of
from fullam.control import pid
from fullam.control.controllers import CONTROLLERS, register
from fullam.control.estimators import ESTIMATORS, register_estimator
from fullam.control.first_order import FirstOrder
from fullam.control.signals import Command
from fullam.dynamics.spatial import Spatial
from fullam.exceptions import CampaignError, SettingsError, UnknownName
from fullam.model.loading import load_vehicle
from fullam.numbers.kernel import kernel, select
from fullam.simulation.motions.references import Step
from fullam.simulation.scenarios.catalogue import HOME
from fullam.simulation.scenarios.scenario import Scenario, load_scenario
from fullam.simulation.simulate import prepare, simulate

SHORT = replace(load_scenario("position-1"), name="short", duration=0.6)


def small(seeds=range(5), **changes):
    return Campaign(
        **{"scenarios": (SHORT,), "contenders": ("dc-pid", "pid"), "seeds": tuple(seeds)} | changes
    )


@pytest.fixture
def own():
    """Registers laws, and estimators, for the length of a test."""
    kept = [(names, dict(names)) for names in (CONTROLLERS, ESTIMATORS)]
    yield register
    for names, before in kept:
        names.clear()
        names.update(before)


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
    run = simulate(SHORT, "pid", seed=3, driver="fused")
    figures = measure(run)
    table = finished[1]
    cells = table.rows.filter(table.column("contender") == "pid").to_pylist()[3]
    for name, value in flatten(figures).items():
        # The thrust is summed rotor by rotor here, and by BLAS there.
        assert cells[name] == (pytest.approx(value, rel=1e-14) if name == "effort" else value), name
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
    monkeypatch.setattr(
        Campaign,
        "fly",
        lambda self, keys, *threads: counted.extend(keys) or fly(self, keys, *threads),
    )
    return counted


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_stopped_campaign_continues_and_ends_with_the_same_bytes(
    tmp_path, finished, monkeypatch, jobs
):
    campaign, out = small(traces=True), tmp_path / "again.parquet"

    def stop(done, total):
        if done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(campaign, out, jobs=jobs, progress=stop)
    assert not out.exists()
    kept = CampaignStore(out, campaign.identity(), False).keys
    assert kept == {("short", "dc-pid", seed) for seed in range(5)}
    # What a kill in the middle of a write leaves.
    (tmp_path / "again.parquet.parts" / ".half-written.parquet").write_bytes(b"PAR1")

    counted = count_flights(monkeypatch)
    told = []
    sweep(campaign, out, jobs=jobs, progress=lambda done, total: told.append((done, total)))
    assert counted == [("short", "pid", seed) for seed in range(5)]
    assert told[0] == (5, 10)
    assert told[-1] == (10, 10)
    assert out.read_bytes() == finished[0].read_bytes()


def test_rows_know_neither_threads_nor_neighbours(tmp_path):
    campaign, out = small(range(21), traces=True), tmp_path / "one.parquet"
    sweep(campaign, out)
    sweep(campaign, tmp_path / "two.parquet", jobs=2)
    assert (tmp_path / "two.parquet").read_bytes() == out.read_bytes()
    # Other blocks: seven seeds, then those between, so that every flight has other neighbours.
    pieces = tmp_path / "pieces.parquet"
    for seeds in (range(0, 21, 3), range(1, 21, 2), range(21)):
        sweep(small(seeds, traces=True), pieces, jobs=2)
    assert pieces.read_bytes() == out.read_bytes()


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


@pytest.mark.parametrize("driver", ["python", "fused"])
def test_a_diverged_flight_is_a_row(tmp_path, driver):
    hopeless = replace(SHORT, name="hopeless", initial_euler_deg=(179.0, 0.0, 0.0), duration=2.0)
    campaign = small([0], scenarios=(hopeless,), driver=driver, traces=True)
    table = sweep(campaign, tmp_path / "a.parquet")
    assert set(table.column("outcome")) == {"diverged"}
    assert not table.column("settled").any()
    for name, trace in zip(("dc-pid", "pid"), table.traces("hopeless"), strict=True):
        run = simulate(hopeless, name, driver=driver, throw=False)
        (reason,) = table.column("reason", contender=name)
        assert reason == run.metadata["reason"]
        assert "deg from the reference" in reason
        assert np.isfinite(trace).all(axis=1).sum() == len(run.pose[::4])


LOWEST = 8.985


@kernel
def nervous_command(numbers, chain, estimate, target, memory):
    """The law of "pid"; not a number where the platform seems to be low."""
    command, memory = pid.command(numbers, chain, estimate, target, memory)
    x, y, z = command.wrench.linear
    x = select(estimate.pose.position[2] < LOWEST, float("nan"), x)
    return Command(Spatial((x, y, z), command.wrench.angular), command.u_pid, command.u_dc), memory


class Nervous(pid.Pid):
    kernels = pid.Pid.kernels._replace(command=nervous_command)


class Gentle(pid.Pid):
    """A law as a class: what it overrides, no machine code knows."""

    def wrench(self, t, measurement, reference):
        wrench = super().wrench(t, measurement, reference)
        wrench[:2] *= 0.5
        return wrench


def test_a_failed_flight_is_a_row_whoever_flew_beside_it(tmp_path, own):
    own("nervous")(Nervous)
    campaign = small(
        range(24), scenarios=(replace(SHORT, reference=Step(HOME)),), contenders=("nervous",)
    )
    assert campaign.drivers == {"nervous": "fused"}
    table = sweep(campaign, tmp_path / "lanes.parquet")
    failed = table.column("outcome") == "failed"
    assert 0 < failed.sum() < 24
    for name in ("settled", "rms_position_mm"):
        empty = table.rows.column(name).is_null().to_numpy(zero_copy_only=False)
        assert np.array_equal(empty, failed), name
    assert all("is not finite" in reason for reason in table.column("reason")[failed])
    assert not any(table.column("reason")[~failed])
    pieces = tmp_path / "pieces.parquet"
    for seeds in (range(0, 24, 5), range(24)):
        sweep(replace(campaign, seeds=tuple(seeds)), pieces, jobs=2)
    assert pieces.read_bytes() == (tmp_path / "lanes.parquet").read_bytes()
    python = sweep(replace(campaign, driver="python"), tmp_path / "python.parquet")
    assert list(python.column("outcome")) == list(table.column("outcome"))


def test_a_law_that_is_a_class_flies_by_python(tmp_path, own):
    own("gentle")(Gentle)
    scenario = Scenario("brief", duration=0.3)
    campaign = small([0, 1], scenarios=(scenario,), contenders=("gentle", "pid"))
    assert campaign.drivers == {"gentle": "python", "pid": "fused"}
    table = sweep(campaign, tmp_path / "sweep.parquet")
    run = simulate(scenario, "gentle", seed=1)
    (_, rms) = table.column("rms_position_mm", contender="gentle")
    assert rms == measure(run).rms_position_mm
    assert rms != table.column("rms_position_mm", contender="pid")[1]
    with pytest.raises(SettingsError, match="'gentle' is not written as kernels"):
        sweep(replace(campaign, driver="fused"), tmp_path / "fused.parquet")


def test_an_estimator_that_is_a_class_flies_by_python(own):
    class Late(FirstOrder):
        def update(self, readings, measurement):
            super().update(readings, measurement)

    register_estimator("late")(Late)
    assert driver_of("pid", "first-order") == "fused"
    assert driver_of("pid", "late") == "python"
    assert driver_of("pid", "late", "fused") == "fused", "what is asked for is not changed"


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
    with pytest.raises(CampaignError, match=r"vehicles \(fullam\) differ"):
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
        small(driver="steam")


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
    campaign = small(range(20), contenders=("dc-pid",))
    monkeypatch.setattr(campaign_module, "SLICE", 0.0)
    assert len(fly_slice(campaign, campaign.conditions(), campaign.keys)) == 1
    assert campaign_module.SLICE < FLUSH


def test_both_drivers_fly_the_same_table(tmp_path):
    short = replace(load_scenario("task-2"), name="short", duration=3.0)
    names = ("dc-pid", "backstepping", "dc-pid-plus@kalman")
    tables = [
        sweep(
            small(range(2), scenarios=(short,), contenders=names, driver=driver),
            tmp_path / f"{driver}.parquet",
        )
        for driver in ("python", "fused")
    ]
    for field in SCHEMA:
        one, other = (table.column(field.name) for table in tables)
        if field.type == "double":
            # Figures of 1 to 1000 mm and deg; feedback keeps rounding from growing.
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9, err_msg=field.name)
        else:
            assert list(one) == list(other), field.name


@pytest.mark.parametrize("driver", ["python", "fused"])
def test_flights_that_share_a_plan_are_the_single_flights(driver):
    for judged in fly_judged(prepare(SHORT, seed=7), [3, 1, 3], driver):
        for seed, row in zip(judged.seeds, rows_of(judged.figures), strict=True):
            single = flatten(measure(simulate(SHORT, seed=seed, driver=driver)))
            # As above, but for the sum of the thrusts.
            assert row.pop("effort") == pytest.approx(single.pop("effort"), rel=1e-14)
            assert row == single
