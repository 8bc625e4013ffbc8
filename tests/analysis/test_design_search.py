"""Design by optimisation: figures of merit, what a search finds, and that it flies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fullam
from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.failures import Atlas
from fullam.analysis.atlas.loads import load_of
from fullam.analysis.design_search import COLUMNS, DesignSearch, pareto_front
from fullam.analysis.merit import Judge
from fullam.exceptions import SettingsError, UnknownName, VehicleError
from fullam.model.loading import load_vehicle
from fullam.model.writing import write_vehicle

QUICK = {"evaluations": 600, "starts": 1}


def test_merit_is_what_the_envelope_says() -> None:
    """Two ways to the same figures: the judge's short one, and the atlas."""
    vehicle = load_vehicle("fullam")
    arm = np.array([0.3, 0.2, -0.4, 0.1])
    merit = Judge.of(vehicle, arm).merit(vehicle.rotors.positions, vehicle.rotors.axes)
    atlas = Atlas(vehicle)
    envelope, failures = atlas.envelope(arm), atlas.after_failures(arm)
    weight = envelope.load.weight
    assert merit.worst_tilt == pytest.approx(np.rad2deg(envelope.worst_tilt[0]))
    assert merit.level_force == pytest.approx(envelope.least_level_force / weight)
    assert merit.efficiency == pytest.approx(envelope.hover_efficiency)
    assert merit.reserve == pytest.approx(envelope.thrust_to_weight)
    assert merit.failure_margin == pytest.approx(min(e.margin.value for e in failures) / weight)


def test_a_search_beats_the_ring_at_equal_hover_efficiency() -> None:
    vehicle = fullam.design_vehicle("fullam")
    search = DesignSearch(min_efficiency=0.854, **QUICK)
    found = search.run(vehicle)
    assert found.feasible
    ring = found.ring.merit
    cant = np.deg2rad(found.ring.rows[0, 3])
    assert ring.efficiency == pytest.approx(np.cos(cant))
    assert np.tan(np.deg2rad(ring.worst_tilt)) == pytest.approx(np.tan(cant) * np.cos(np.pi / 4))
    assert found.gain > 8.0  # 600 layouts; 18 000 find 19 deg
    assert found.best.merit.reserve >= 1.5
    again = search.run(vehicle)
    np.testing.assert_array_equal(again.best.rows, found.best.rows)


def test_an_octorotor_that_survives_any_single_failure() -> None:
    """The alternating ring has no margin then; one that keeps 5 deg is in reach."""
    vehicle = fullam.design_vehicle("fullam")
    ring = Judge.of(vehicle).merit(vehicle.rotors.positions, vehicle.rotors.axes)
    assert ring.failure_margin == pytest.approx(0.0, abs=1e-12)
    search = DesignSearch("failure-tilt", evaluations=3000, starts=1, seed=1)
    built = fullam.design_vehicle("fullam", optimise=search, name="survivor")
    load = replace(load_of(built), center=np.zeros(3))
    kept = []
    for stopped in range(8):
        tilt = Envelope.from_rotors(built.rotors.with_failed(stopped), load).worst_tilt
        assert tilt is not None
        kept.append(np.rad2deg(tilt[0]))
    assert min(kept) > 5.0


def test_what_is_found_flies_and_can_be_written(tmp_path) -> None:
    search = DesignSearch(min_efficiency=0.8, free=COLUMNS, period=4, **QUICK)
    vehicle = fullam.design_vehicle("fullam", optimise=search, name="found")
    judged = Judge.of(vehicle).merit(vehicle.rotors.positions, vehicle.rotors.axes)
    assert judged.reserve >= 1.49
    assert judged.efficiency >= 0.798
    run = fullam.simulate("tilt-hover-1", vehicle=vehicle, calm=True)
    assert fullam.measure(run).rms_position_mm < 5.0
    toml, urdf = write_vehicle(vehicle, tmp_path / "found.toml")
    assert urdf.is_file()
    again = load_vehicle(toml)
    np.testing.assert_array_equal(again.rotors.positions, vehicle.rotors.positions)
    np.testing.assert_array_equal(again.rotors.axes, vehicle.rotors.axes)
    assert again.name == "found"
    with pytest.raises(VehicleError, match=r"\.toml"):
        write_vehicle(vehicle, tmp_path / "found.json")


def test_a_front_goes_down() -> None:
    vehicle = fullam.design_vehicle("fullam")
    search = DesignSearch(period=4, evaluations=300, starts=1)
    front = pareto_front(vehicle, search, [0.7, 0.95])
    assert front[0].best.merit.worst_tilt > front[1].best.merit.worst_tilt
    assert front[1].best.merit.efficiency > 0.948


def test_bad_searches_are_named() -> None:
    with pytest.raises(UnknownName, match="objective"):
        DesignSearch("speed")
    with pytest.raises(UnknownName, match="column"):
        DesignSearch(free=("colour",))
    with pytest.raises(SettingsError, match="reserve"):
        DesignSearch(reserve=0.5)
    with pytest.raises(SettingsError, match="period"):
        DesignSearch(period=3).run(load_vehicle("fullam"))
    with pytest.raises(SettingsError, match="design"):
        DesignSearch().run(load_vehicle("hextilt"))
    with pytest.raises(VehicleError, match="rotor_rows"):
        fullam.design_vehicle("fullam", rotor_rows=[[0.0, 0.3, 0.0, 10.0, 0.0]])
    with pytest.raises(VehicleError, match="rotor_rows"):
        fullam.design_vehicle("fullam", rotor_rows=[[0.0, 0.3]])
