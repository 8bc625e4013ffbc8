"""What a notebook cell shows: a page in a frame, and sliders that change the vehicle."""

import time

import numpy as np
import pytest

import fullam
from fullam.exceptions import InvalidInput, MissingDependency
from fullam.viz.viewer.widgets import canted

pytest.importorskip("ipywidgets")


@pytest.fixture
def explorer():
    made = fullam.explore("fullam")
    yield made
    made.close()


def test_a_cell_holds_the_whole_page():
    data = fullam.load_scenario("task-2").to_dict() | {"duration": 0.2}
    run = fullam.simulate(fullam.Scenario.from_dict(data), calm=True)
    view = fullam.view(run, height=333)
    cell = view._repr_html_()
    assert "height: 333px" in cell and "srcdoc=" in cell
    assert "fullam.film(" in cell and "script src" not in cell
    assert "task-2" in repr(view)


def test_a_vehicle_among_records_is_refused():
    vehicle = fullam.load_vehicle("fullam")
    with pytest.raises(InvalidInput):
        fullam.view(vehicle, vehicle)


def test_sliders_move_arm_tilt_and_cant(explorer):
    level = explorer.hover
    assert level.feasible
    explorer.sliders["joint_1"].value = -90.0
    np.testing.assert_allclose(explorer.hover.arm[0], -np.pi / 2)
    explorer.sliders["tilt about x"].value = 20.0
    assert np.rad2deg(explorer.hover.tilt) == pytest.approx(20.0)
    explorer.sliders["cant"].value = 10.0
    assert np.rad2deg(np.arccos(explorer.vehicle.rotors.axes[:, 2])) == pytest.approx(10.0)
    # Ten degrees of cant push sideways with at most tan 10 deg of the lift.
    assert not explorer.hover.feasible
    assert "cannot hold" in explorer._report.value
    explorer.sliders["tilt about x"].value = 0.0
    assert explorer.hover.feasible
    assert "holds" in explorer._report.value


def test_the_report_has_a_rose_and_the_scene_the_forces_on_request(explorer):
    assert 'aria-label="hover tilt by azimuth"' in explorer._report.value

    def drawn():
        shapes = explorer._stage.spec()["vehicles"][0]["shapes"]
        return [shape["vertices"] for shape in shapes if shape["path"].endswith("/forces")]

    assert drawn() == []
    explorer.forces.value = True
    first = drawn()
    explorer.sliders["joint_1"].value = -90.0
    assert len(first) == 1
    assert drawn() != first, "another arm pose, another body"
    explorer.forces.value = False
    assert drawn() == []


def test_the_scene_follows_the_sliders(explorer):
    before = explorer.server._frame
    explorer.sliders["joint_2"].value = 30.0
    assert explorer.server._frame != before
    scene = explorer.server._scene
    explorer.sliders["cant"].value = 20.0
    assert explorer.server._scene is not scene
    assert explorer.server._scene["keep_camera"]


def test_a_vehicle_without_a_design_has_no_cant_slider():
    explorer = fullam.explore(fullam.load_vehicle("hextilt"))
    try:
        assert "cant" not in explorer.sliders
        assert len(explorer.sliders) == 5 + 2
    finally:
        explorer.close()


def test_canted_changes_the_rotors_and_nothing_else():
    vehicle = fullam.load_vehicle("fullam")
    other = canted(vehicle, 30.0)
    assert other.mass == vehicle.mass
    np.testing.assert_allclose(other.rotors.positions, vehicle.rotors.positions, atol=1e-12)
    np.testing.assert_allclose(np.rad2deg(np.arccos(other.rotors.axes[:, 2])), 30.0)


def test_without_ipywidgets_the_message_names_the_extra(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    with pytest.raises(MissingDependency, match=r"fullam\[notebook\]"):
        fullam.explore()


def test_a_prismatic_joint_has_a_slider_in_metres():
    vehicle = fullam.load_vehicle("fullam")
    start = vehicle.urdf.index('<joint name="joint_4" type="revolute"')
    end = vehicle.urdf.index("</joint>", start)
    joint = vehicle.urdf[start:end].replace("revolute", "prismatic")
    joint = joint.replace("2.617993877991", "0.15")
    urdf = vehicle.urdf[:start] + joint + vehicle.urdf[end:]
    sliding = type(vehicle).from_definition(vehicle.definition, urdf)
    explorer = fullam.explore(sliding)
    try:
        slider = explorer.sliders["joint_4"]
        assert (slider.min, slider.max, slider.description) == (-0.15, 0.15, "joint_4 [m]")
        slider.value = 0.1
        np.testing.assert_allclose(explorer.hover.arm, [0.0, 0.0, 0.0, 0.1])
        assert explorer.sliders["joint_1"].description == "joint_1 [deg]"
    finally:
        explorer.close()


def test_a_flight_in_a_cell_is_flown_by_the_notebook_and_by_its_page():
    flight = fullam.fly("fullam", duration=20.0)
    studio = flight.view(height=321)
    try:
        cell = studio._repr_html_()
        assert "height: 321px" in cell and studio.server.token in cell
        assert studio.url in repr(studio)
        flight.push([1.0, 0.0, 0.0], duration=0.1)
        flight.advance(0.2)
        wait_until(lambda: frame_time(studio) == pytest.approx(0.2))
        studio.play(speed=4.0)
        wait_until(lambda: flight.time > 0.4)
        studio.pause()
        wait_until(lambda: not studio.live.transport.playing)
        run = flight.record
        np.testing.assert_array_equal(fullam.refly(run).pose, run.pose)
    finally:
        studio.close()
    assert not studio._thread.is_alive()


def frame_time(studio):
    return float(np.frombuffer(studio.server._frame, "<f4")[0])


def wait_until(condition, timeout=15.0):
    until = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < until, "it did not happen"
        time.sleep(0.02)
