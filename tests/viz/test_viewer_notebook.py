"""What a notebook cell shows: a page in a frame, and sliders that change the vehicle."""

import base64
import json
import re
import time

import numpy as np
import pytest
from altered_vehicles import with_joint

import fullam
from fullam.exceptions import FullamError, InvalidInput, MissingDependency
from fullam.viz.viewer import view as view_module
from fullam.viz.viewer.browser import Browser
from fullam.viz.viewer.replay import Film
from fullam.viz.viewer.sketch import sketch_page
from fullam.viz.viewer.widgets import canted

pytest.importorskip("ipywidgets")

MOST = 100_000
"""Bytes that a look at a flight may add to a notebook."""


@pytest.fixture
def explorer():
    made = fullam.explore("fullam")
    yield made
    made.close()


@pytest.fixture(autouse=True)
def nothing_served():
    """Servers end with their test."""
    yield
    while view_module.SERVED:
        view_module.SERVED.pop().close()


@pytest.fixture(scope="module")
def run():
    return fullam.simulate("task-2", driver="fused")


def test_a_cell_holds_the_whole_page_if_it_shall():
    data = fullam.load_scenario("task-2").to_dict() | {"duration": 0.2}
    run = fullam.simulate(fullam.Scenario.from_dict(data), calm=True)
    view = fullam.view(run, height=333, embed=True)
    cell = view._repr_html_()
    assert "height: 333px" in cell and "srcdoc=" in cell
    assert "fullam.film(" in cell and "script src" not in cell
    assert "task-2" in repr(view)


def lines_of(page):
    """The numbers of a drawing, as its script reads them."""
    data = json.loads(re.search(r"const SKETCH = (.*?);\n", page, re.DOTALL)[1])
    steps = np.frombuffer(base64.b64decode(data["data"]), "<i2")
    return data, steps.reshape(data["count"], data["width"])


@pytest.mark.parametrize("name", ["fullam", "hextilt", "borinot"])
def test_a_cell_of_a_vehicle_is_light(name):
    assert len(fullam.view(fullam.load_vehicle(name))._repr_html_().encode()) < MOST


def test_a_cell_of_records_is_light_and_holds_the_address_of_the_whole(run):
    view = fullam.view(run, run, height=333)
    cell = view._repr_html_()
    assert len(cell.encode()) < MOST
    assert "height: 333px" in cell and "srcdoc=" in cell
    assert view._server().token in cell
    assert view._repr_html_() == cell, "one server a view, however often it is shown"


def test_a_long_film_is_light_too(run):
    film = fullam.view(run).film
    long = Film(film.scene, np.tile(film.frames, (17, 1)), film.rate)
    page = sketch_page(long)
    assert len(page.encode()) < MOST
    data, _ = lines_of(page)
    assert data["duration"] == pytest.approx(long.duration, abs=1.0 / data["rate"])


def test_a_drawing_is_where_the_film_is(run):
    film = fullam.view(run).film
    data, steps = lines_of(sketch_page(film))
    [drawn] = data["vehicles"]
    assert data["rate"] == film.rate and data["count"] == len(film.frames)
    place = steps[:, drawn["pose"] : drawn["pose"] + 3] * data["scale"] + data["centre"]
    # The film's frames are every third or fourth tick; half a step of rounding, and of 32 bits.
    np.testing.assert_allclose(place, film.frames[:, 1:4], rtol=0.0, atol=0.51 * data["scale"])
    assert data["scale"] < 1e-3
    q = steps[:, drawn["pose"] + 3 : drawn["pose"] + 7].astype(float)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    assert np.all(np.abs(np.sum(q * film.frames[:, 4:8], axis=1)) > 1.0 - 1e-6)
    assert np.all(np.sum(q[1:] * q[:-1], axis=1) > 0.0), "no jump of sign to interpolate through"
    assert len(drawn["rotors"]) == 8 and len(drawn["joints"]) == 4
    hubs = np.array([rotor["ring"][0] for rotor in drawn["rotors"]])
    np.testing.assert_allclose(hubs, run.vehicle.rotors.positions, atol=0.02)  # drawn a bit above


def test_what_is_not_finite_is_drawn_somewhere(run):
    film = fullam.view(run).film
    frames = film.frames.copy()
    frames[-1, 1:] = np.nan
    frames[-2, 1:4] = np.inf, -1e20, 0.0
    _, steps = lines_of(sketch_page(Film(film.scene, frames, film.rate)))
    assert steps.shape[0] == len(frames)


def test_the_last_views_are_served_and_older_ones_again_when_they_are_shown_again(run, monkeypatch):
    monkeypatch.setattr(view_module, "MOST_SERVED", 2)
    views = [fullam.view(run) for _ in range(3)]
    servers = [view._server() for view in views]
    assert [server._thread.is_alive() for server in servers] == [False, True, True]
    assert views[2]._server() is servers[2]
    again = views[0]._server()
    assert again is not servers[0] and again._thread.is_alive()
    assert not servers[1]._thread.is_alive()


def test_a_view_is_served_even_if_nobody_keeps_it(run):
    """As after `display(fullam.view(run))`."""
    server = fullam.view(run)._server()
    assert server._thread.is_alive()


def test_a_cell_is_drawn_where_nothing_can_be_served(run, monkeypatch):
    def refuse(*_, **__):
        raise FullamError("no port")

    monkeypatch.setattr("fullam.viz.viewer.view.ViewerServer", refuse)
    cell = fullam.view(run)._repr_html_()
    assert "SKETCH" in cell and "reachLive" not in cell


@pytest.mark.browser
def test_an_exported_cell_plays_without_asking_anybody_and_a_live_one_shows_the_scene(
    run, tmp_path
):
    view = fullam.view(run)
    inner = "document.querySelector('iframe')?.contentDocument"
    page = tmp_path / "notebook.html"
    asked = (
        "document.querySelector('iframe').contentWindow.performance.getEntriesByType('resource')"
    )
    with Browser(640, 520, network=False) as browser:

        def show(top):
            page.write_text(f"<body>{top}{view._repr_html_()}</body>", encoding="utf-8")
            browser.command("Page.navigate", url=page.resolve().as_uri())

        show("")
        browser.wait_for(f"{inner}?.getElementById('now')?.textContent > '0.3'")
        assert browser.evaluate(f"{asked}.length") == 0
        browser.evaluate(f"{inner}?.getElementById('play').click()")
        stands = browser.evaluate(f"{inner}?.getElementById('now').textContent")
        time.sleep(0.1)
        assert browser.evaluate(f"{inner}?.getElementById('now').textContent") == stands
        dark = (
            f"(() => {{ const c = {inner}?.getElementById('sketch'); const p = c.getContext('2d')"
            ".getImageData(0, 0, c.width, c.height).data; let n = 0;"
            "for (let i = 3; i < p.length; i += 4) n += p[i] > 0; return n / (c.width * c.height);"
            "})()"
        )
        assert 0.01 < browser.evaluate(dark) < 0.5, "lines, and paper between them"

        config = json.dumps({"baseUrl": "http://127.0.0.1:9/"})
        show(f'<script id="jupyter-config-data" type="application/json">{config}</script>')
        browser.wait_for(f"{inner}?.querySelector('iframe')?.src === {view._server().url!r}")
        assert view._server().wait_for_page(20.0)
        assert browser.complaints == []


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
    sliding = with_joint("joint_4", "prismatic", 'lower="-0.15" upper="0.15"')
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
