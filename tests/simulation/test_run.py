"""The record: saves, loads, flies again bit for bit, and says what is wrong with a bad file."""

import json
from dataclasses import replace
from importlib.metadata import version

import numpy as np
import pytest

import fullam
from fullam.exceptions import Diverged, RunFileError, ScenarioError, SettingsError, UnknownName
from fullam.model.perturbation import Uncertainty, perturb
from fullam.simulation.motions.shaping import Shaping
from fullam.simulation.record.refly import refly
from fullam.simulation.record.run import COLUMNS, Run
from fullam.simulation.settings import SimulationSettings


@pytest.fixture(scope="module")
def run():
    scenario = fullam.Scenario(
        "short",
        reference=fullam.Step((0.2, 0.1, 1.1), (5.0, 0.0, 0.0)),
        arm_motion=fullam.SineRate(),
        initial_arm_deg=(-90.0, 0.0, -45.0, 0.0),
        duration=1.5,
    )
    return fullam.simulate(scenario, seed=5)


def same(a, b):
    return all(np.array_equal(a.columns[name], b.columns[name]) for name in COLUMNS)


def test_columns_have_shapes_units_and_are_read_only(run):
    assert len(run) == 151
    for name in COLUMNS:
        assert getattr(run, name).shape[0] == 151
        assert name in run.units
    assert run.rotor_speeds.shape[1] == 8
    assert run.units["u_dc"] == "N, N m"
    with pytest.raises(ValueError, match="read-only"):
        run.pose[0, 0] = 1.0


def test_saving_and_loading_changes_nothing(run, tmp_path):
    loaded = Run.load(run.save(tmp_path / "run.npz"))
    assert same(run, loaded)
    assert loaded.metadata == run.metadata
    assert loaded.scenario == run.scenario
    assert list(tmp_path.iterdir()) == [tmp_path / "run.npz"]


def test_a_loaded_run_flies_again_bit_for_bit(run, tmp_path):
    assert same(run, refly(Run.load(run.save(tmp_path / "run.npz"))))


def test_a_run_says_which_driver_and_versions_flew_it(run, tmp_path):
    packages = {"fullam", "python", "pin", "numpy", "scipy", "proxsuite"}
    assert run.driver == run.metadata["driver"] == "python"
    assert set(run.metadata["versions"]) == packages
    fused = fullam.simulate(replace(run.scenario, duration=0.1), seed=5, driver="fused")
    assert fused.driver == "fused"
    versions = fused.metadata["versions"]
    assert set(versions) == packages | {"numba", "llvmlite"}
    assert versions["numba"] == version("numba")
    again = refly(Run.load(fused.save(tmp_path / "run.npz")))
    assert same(fused, again)
    assert again.metadata == fused.metadata


def test_what_was_changed_flies_again_as_it_was_changed(run, tmp_path):
    """Settings of law and estimator, shaping and simulation are in the record."""
    changed = fullam.simulate(
        replace(run.scenario, duration=0.2),
        "dc-pid-plus",
        seed=2,
        weather="recorded",
        settings={"actuation_speedup": 1.5, "observer_rates": (10.0, 9.0)},
        shaping={"max_acceleration": 4.0, "anticipate": False},
        simulation=SimulationSettings(
            estimator="first-order", estimator_settings={"cutoff": 12.0}, integrator="rk4"
        ),
    )
    assert changed.scenario.shaping == Shaping(4.0, 8.0, anticipate=False)
    assert changed.simulation.estimator_settings == {"cutoff": 12.0}
    again = refly(Run.load(changed.save(tmp_path / "run.npz")))
    assert same(changed, again)
    assert again.metadata == changed.metadata


def test_an_unknown_choice_is_named_before_it_flies(run):
    with pytest.raises(UnknownName, match=r"swift.*python, fused"):
        fullam.simulate(run.scenario, driver="swift")
    with pytest.raises(TypeError, match=r"'engine'.*vehicle, seed, weather"):
        fullam.simulate(run.scenario, engine="reference")


def test_a_changed_vehicle_flies_again_as_it_was_changed(tmp_path):
    """A failed rotor and a drawn vehicle are in the record, not only the file they came from."""
    vehicle = fullam.load_vehicle("fullam")
    failed = replace(vehicle, rotors=vehicle.rotors.with_failed(0))
    drawn = perturb(vehicle, Uncertainty(0.1), np.random.default_rng(3))
    scenario = fullam.Scenario("hold", reference=fullam.Step((0.0, 0.0, 1.0)), duration=0.3)
    nominal = fullam.simulate(scenario, calm=True)
    for changed in (failed, drawn):
        run = fullam.simulate(scenario, vehicle=changed, calm=True)
        assert not same(run, nominal)
        assert same(run, refly(Run.load(run.save(tmp_path / "run.npz"))))


def test_a_seed_may_be_numpys_and_must_be_a_whole_number():
    scenario = fullam.Scenario("hold", duration=0.1)
    assert fullam.simulate(scenario, seed=np.int64(3)).seed == 3
    for seed in (None, -1, 0.5):
        with pytest.raises(fullam.FullamError, match="seed"):
            fullam.simulate(scenario, seed=seed)


def test_the_residual_tells_what_nobody_controls():
    """A quadrotor cannot push sideways; the record says what it was asked for and what it gave."""
    run = fullam.simulate("quadrotor-arm", seed=1)
    rotor_A = np.square(run.rotor_commands) @ run.vehicle.rotors.coupling_matrix.T
    np.testing.assert_allclose(rotor_A[:, :2], 0.0, atol=1e-9)
    asked = np.linalg.norm(run.command - run.delivered, axis=1)
    np.testing.assert_allclose(asked, np.linalg.norm(run.residual, axis=1), atol=1e-9)
    assert asked.max() > 0.1


def test_damaged_files_are_refused(run, tmp_path, rng):
    """Bits flipped anywhere: either the file still reads, or it is refused by name."""
    path = run.save(tmp_path / "run.npz")
    good = bytearray(path.read_bytes())
    refused = 0
    for place in rng.integers(0, len(good), 60):
        bad = bytearray(good)
        bad[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(bad)
        try:
            Run.load(path)
        except RunFileError as error:
            assert "run.npz" in str(error)
            refused += 1
    assert refused > 30


def test_columns_agree_with_each_other(run):
    """Rotor wrench from speeds and true attitude; delivered is command plus residual."""
    np.testing.assert_allclose(run.t, np.arange(151) * 0.01)
    in_reach = ~run.saturated
    np.testing.assert_allclose(run.delivered[in_reach], run.command[in_reach], atol=1e-9)
    assert np.all(run.rotor_commands >= 0.0)
    assert np.all(run.rotor_commands <= run.vehicle.rotors.max_speeds * (1 + 1e-12))


def test_the_seed_is_the_weather_and_the_controller_does_not_touch_it(run):
    other = fullam.simulate(run.scenario, "pid", seed=5)
    np.testing.assert_array_equal(run.disturbance, other.disturbance)
    assert not same(run, fullam.simulate(run.scenario, seed=6))


@pytest.mark.parametrize("share", [0.1, 0.5, 0.95])
def test_a_truncated_file_is_refused(run, tmp_path, share):
    path = run.save(tmp_path / "run.npz")
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(RunFileError, match=r"run\.npz.*truncated"):
        Run.load(path)


def test_other_files_are_refused(run, tmp_path):
    with pytest.raises(RunFileError, match=r"does not exist"):
        Run.load(tmp_path / "nothing.npz")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(RunFileError, match="metadata"):
        Run.load(tmp_path / "other.npz")
    np.savez(tmp_path / "list.npz", metadata=np.array("[1]"))
    with pytest.raises(RunFileError, match="format"):
        Run.load(tmp_path / "list.npz")
    (tmp_path / "array.npz").write_bytes(b"")
    np.save(tmp_path / "array.npy", np.zeros(3))
    (tmp_path / "array.npy").rename(tmp_path / "array.npz")
    with pytest.raises(RunFileError, match="array"):
        Run.load(tmp_path / "array.npz")
    np.savez(tmp_path / "old.npz", metadata=np.array(json.dumps({"format": "fullam-run-1"})))
    with pytest.raises(RunFileError, match=r"'fullam-run-1'.*reads 'fullam-run-2'.*version that"):
        Run.load(tmp_path / "old.npz")
    with pytest.raises(RunFileError, match=r"\.npz"):
        run.save(tmp_path / "run.txt")
    assert not (tmp_path / "run.txt").exists()


def test_a_failed_write_leaves_the_old_file(run, tmp_path, monkeypatch):
    path = run.save(tmp_path / "run.npz")
    before = path.read_bytes()

    def half(*args, **kwargs):
        args[0].write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez_compressed", half)
    with pytest.raises(OSError, match="disk full"):
        run.save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_divergence_raises_with_the_partial_run_or_is_a_value():
    """Gains of zero cannot hold anything against gusts and parameter errors."""
    scenario = fullam.Scenario("fall", duration=8.0)
    settings = {"position_gains": (0.0, 0.0, 0.0), "attitude_gains": (0.0, 0.0, 0.0)}
    with pytest.raises(Diverged, match=r"at t = .* from the reference") as caught:
        fullam.simulate(scenario, settings=settings)
    partial = caught.value.run
    assert 0 < len(partial) < 801
    value = fullam.simulate(scenario, settings=settings, throw=False)
    assert value.diverged
    assert same(value, partial)
    assert same(value, refly(value))


def test_rates_delay_and_estimators_are_settable():
    scenario = fullam.Scenario("hold", duration=0.5)
    for simulation in (
        SimulationSettings(control_period=0.001),
        SimulationSettings(control_period=0.004, plant_period=0.002, integrator="rk4"),
        SimulationSettings(pose_period=0.02, delay=0.01, estimator="truth"),
    ):
        run = fullam.simulate(scenario, simulation=simulation)
        assert run.outcome == "completed"
        assert run.t[1] == pytest.approx(simulation.control_period)
        assert same(run, refly(run))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"control_period": 0.0015}, "control_period.*whole multiple"),
        ({"pose_period": 0.015}, "pose_period.*whole multiple"),
        ({"delay": 0.005}, "delay.*whole multiple"),
        ({"plant_period": -0.001}, "plant_period"),
    ],
)
def test_rates_that_do_not_divide_are_refused(change, message):
    with pytest.raises(fullam.FullamError, match=message):
        SimulationSettings(**change)


def test_settings_of_estimators_are_checked_at_once():
    settings = SimulationSettings(estimator="kalman", estimator_settings={})
    assert SimulationSettings.from_dict(json.loads(json.dumps(settings.to_dict()))) == settings
    assert hash(replace(settings, estimator_settings={})) == hash(settings)
    with pytest.raises(SettingsError, match=r"'first-order'.*speed: is no setting of it.*cutoff"):
        SimulationSettings(estimator="first-order", estimator_settings={"speed": 3.0})
    with pytest.raises(SettingsError, match="cutoff"):
        SimulationSettings(estimator="first-order", estimator_settings={"cutoff": -1.0})
    with pytest.raises(SettingsError, match=r"'kalman'.*cutoff: is no setting of it"):
        fullam.prepare("task-1", "dc-pid-plus", simulation={"estimator_settings": {"cutoff": 9.0}})
    with pytest.raises(ScenarioError, match="estimator_settings"):
        SimulationSettings(estimator_settings=[1.0])


def test_unknown_names_list_the_known():
    for change, known in (
        ({"driver": "warp"}, "fused"),
        ({"weather": "storm"}, "paper"),
        ({"vehicle": "balloon"}, "hextilt"),
        ({"controller": "lqr"}, "dc-pid"),
    ):
        with pytest.raises(UnknownName, match=known):
            fullam.simulate("task-1", **change)
    with pytest.raises(UnknownName, match="first-order"):
        SimulationSettings(estimator="oracle")
