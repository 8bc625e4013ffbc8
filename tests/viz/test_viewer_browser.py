"""A real browser sees the scene: the live page moves, the written page plays without a network."""

import io
import threading

import numpy as np
import pytest
from PIL import Image

import fullam
from fullam.simulation.simulate import prepare
from fullam.viz.viewer import browser as browser_module
from fullam.viz.viewer.browser import Browser, BrowserError
from fullam.viz.viewer.export import write_gif, write_html, write_png
from fullam.viz.viewer.live import LiveFlight
from fullam.viz.viewer.portrait import portrait
from fullam.viz.viewer.replay import film
from fullam.viz.viewer.server import ViewerServer

SIZE = (480, 300)
"""Small, because it is drawn by the processor."""

PLATFORM = "fullam.viewer.scene_tree.find(['vehicle_1', 'platform']).object.position.toArray()"


@pytest.fixture(scope="module")
def run():
    data = fullam.load_scenario("task-2").to_dict() | {"duration": 1.0}
    return fullam.simulate(fullam.Scenario.from_dict(data), "dc-pid", seed=1)


def trail_points(chromium, vehicle=1):
    """Points of a trail that are drawn: each but the first brings ten triangles."""
    node = f"fullam.viewer.scene_tree.find(['vehicle_{vehicle}', 'trail']).object.children[0]"
    drawn = chromium.evaluate(f"{node}.geometry.drawRange.count")
    assert drawn % 30 == 0
    return drawn // 30 + 1


def pixels(picture):
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=int)


def share_that_differs(before, after):
    return float(np.mean(np.abs(pixels(before) - pixels(after)).max(axis=2) > 24))


@pytest.mark.browser
def test_the_live_page_moves_while_it_flies(chromium):
    live = LiveFlight(prepare("task-2", seed=1))
    with ViewerServer(0) as server:
        live.show(server)
        chromium.open(server.url)
        assert server.wait_for_page(10.0)
        before, start = chromium.screenshot(), chromium.evaluate(PLATFORM)
        np.testing.assert_allclose(start, [9.0, 9.0, 9.0], atol=1e-5)
        reports = []
        pilot = threading.Thread(target=lambda: reports.append(live.fly(server, speed=4.0)))
        pilot.start()
        chromium.wait_for("fullam.state.frames > 10 && fullam.state.time > 1.0")
        rendered = chromium.evaluate("fullam.state.rendered")
        pilot.join(timeout=60.0)
        chromium.wait_for("fullam.state.time > 11.9")
        after, end = chromium.screenshot(), chromium.evaluate(PLATFORM)
        assert chromium.evaluate("fullam.state.rendered") > rendered
        np.testing.assert_allclose(end, live.flight.pose[:3], atol=1e-5)
        assert share_that_differs(before, after) > 0.01
        assert "11.9" in chromium.evaluate("document.getElementById('clock').textContent") or (
            "12.0" in chromium.evaluate("document.getElementById('clock').textContent")
        )
        title = chromium.evaluate("document.getElementById('title').textContent")
        assert title == "task-2 · dc-pid"
        # One point a frame, but for those within 2 mm of the one before.
        assert 10 < trail_points(chromium) <= chromium.evaluate("fullam.state.frames")
        # A page that comes late is told of the past, and adds the frame it was sent last.
        chromium.open(server.url)
        assert trail_points(chromium) - len(server._trails[0]) in (0, 1)
        # Over: the page replays the record.
        server.play(film(reports[0].run))
        chromium.wait_for("fullam.state.playing && fullam.state.time < 8")
        chromium.evaluate("fullam.play(false)")
        for second in (0, 3, 12):
            chromium.evaluate(f"fullam.seek({second})")
            assert trail_points(chromium) == 30 * second + 1


@pytest.mark.browser
def test_the_written_page_plays_without_a_network(chromium, run, tmp_path):
    movie = film(run)
    chromium.open(write_html(movie, tmp_path / "flight.html"))
    chromium.wait_for("fullam.state.time > 0.2")
    button = "document.getElementById('toggle').click(), fullam.state.playing"
    chromium.evaluate("fullam.seek(0), fullam.play()")
    assert not chromium.evaluate(button)
    assert chromium.evaluate(button)
    assert not chromium.evaluate(button)
    held = chromium.evaluate("fullam.state.time")
    for k in (0, 7, 30):
        chromium.evaluate(f"fullam.seek({k / movie.rate})")
        np.testing.assert_allclose(chromium.evaluate(PLATFORM), movie.frames[k, 1:4], atol=1e-5)
    assert chromium.evaluate("fullam.state.time") != held
    # The slider does what seek does.
    chromium.evaluate(
        "(() => { const s = document.getElementById('slider'); s.value = 0.5;"
        " s.dispatchEvent(new Event('input')); })()"
    )
    assert chromium.evaluate("fullam.state.time") == pytest.approx(0.5)
    # Half-way between two frames the pose is half-way.
    chromium.evaluate(f"fullam.seek({3.5 / movie.rate})")
    middle = 0.5 * (movie.frames[3, 1:4] + movie.frames[4, 1:4])
    np.testing.assert_allclose(chromium.evaluate(PLATFORM), middle, atol=1e-5)


@pytest.mark.browser
def test_a_film_draws_the_trail_up_to_now(chromium, run, tmp_path):
    movie = film([run, run], rate=20.0)
    chromium.open(write_html(movie, tmp_path / "flights.html"))
    chromium.evaluate("fullam.play(false)")
    for k in (0, 1, 13, 20):
        chromium.evaluate(f"fullam.seek({(k + 0.01) / movie.rate})")
        assert [trail_points(chromium, vehicle) for vehicle in (1, 2)] == [k + 1, k + 1]
    # More points than a live trail remembers.
    scene = "JSON.parse(JSON.stringify(fullam.scene))"
    chromium.evaluate(
        f"fullam.load({scene}); (() => {{ const n = 7000, w = {movie.frames.shape[1]};"
        " const a = new Uint8Array(4 * n * w); let t = '';"
        " for (let i = 0; i < a.length; i += 8192)"
        " t += String.fromCharCode(...a.subarray(i, i + 8192));"
        " fullam.film({ fps: 100, count: n, width: w, data: btoa(t) }); fullam.seek(69); })()"
    )
    assert trail_points(chromium) == 6901


@pytest.mark.browser
def test_what_a_page_complains_of_is_kept(opened, tmp_path):
    page = tmp_path / "bad.html"
    page.write_text(
        "<script>var fullam = {state: {ready: 1}}; console.error('bad', 7);"
        " setTimeout(() => nobody.knows());</script><img src='missing.png'>"
    )
    opened.open(page)
    opened.wait_for("document.readyState === 'complete' && performance.now() > 200")
    complaints, opened.complaints = opened.complaints, []
    assert [c for c in complaints if "console.error: bad 7" in c]
    assert [c for c in complaints if "nobody is not defined" in c]
    assert [c for c in complaints if "missing.png" in c]


@pytest.mark.browser
def test_the_page_asks_the_network_for_nothing(chromium, run, tmp_path):
    chromium.open(write_html(film(run), tmp_path / "flight.html"))
    asked = "performance.getEntriesByType('resource').map((entry) => entry.name)"
    assert [name for name in chromium.evaluate(asked) if not name.startswith("data:")] == []


@pytest.mark.browser
def test_arrows_grow_and_colour_with_the_thrust(chromium, tmp_path):
    vehicle = fullam.load_vehicle("fullam")
    movie = portrait(vehicle, euler_deg=(20.0, 20.0, 0.0))
    chromium.open(write_html(movie, tmp_path / "hover.html"))
    tracks = movie.scene["vehicles"][0]["tracks"]
    first = next(k for k, track in enumerate(tracks) if track["kind"] == "thrust")
    at = 1 + 7 * first
    for i in (0, 7):
        path = tracks[first + i]["path"].split("/")
        arrow = f"fullam.viewer.scene_tree.find({path!r}).object.children[0]"
        length = tracks[first + i]["length"] * float(movie.frames[0, at + i])
        # The head ends where the arrow does: its middle is half its height below.
        head = chromium.evaluate(f"(() => {{ const c = {arrow}.children[1];"
                                 " return c.position.y + 0.5 * c.scale.y; })()")  # fmt: skip
        assert head == pytest.approx(length, rel=1e-5)
    idle, busy = np.argmin(movie.frames[0, at : at + 8]), np.argmax(movie.frames[0, at : at + 8])
    red = [
        chromium.evaluate(
            f"fullam.viewer.scene_tree.find({tracks[first + i]['path'].split('/')!r})"
            ".object.children[0].children[0].userData.fine.color.r"
        )
        for i in (idle, busy)
    ]
    assert red[0] != pytest.approx(red[1], abs=0.02)


@pytest.mark.browser
def test_stills_and_animations_are_pictures_of_the_flight(run, tmp_path):
    movie = film(run)
    with Image.open(write_png(movie, tmp_path / "a.png", at=0.5, size=SIZE)) as still:
        assert still.size == SIZE
        assert len(still.convert("RGB").getcolors(maxcolors=10**6)) > 500
    with Image.open(write_gif(movie, tmp_path / "a.gif", size=(320, 200), rate=4.0)) as animation:
        assert (animation.size, animation.n_frames) == ((320, 200), 4)
        first = np.asarray(animation.convert("RGB"), dtype=int)
        animation.seek(3)
        last = np.asarray(animation.convert("RGB"), dtype=int)
    assert np.mean(np.abs(last - first) > 24) > 0.005


@pytest.mark.browser
def test_a_page_that_raises_says_so(chromium):
    with pytest.raises(BrowserError, match="nonsense"):
        chromium.evaluate("nonsense.at.all")
    with pytest.raises(BrowserError, match="refused"):
        chromium.command("No.such")


@pytest.mark.browser
def test_no_browser_is_left_behind():
    browser = Browser(*SIZE)
    process, profile = browser._process, browser._profile.name
    browser.close()
    assert process.poll() is not None
    with pytest.raises(FileNotFoundError):
        io.FileIO(profile)


def test_without_a_browser_the_message_says_what_to_install(monkeypatch, run, tmp_path):
    monkeypatch.setattr(browser_module.shutil, "which", lambda name: None)
    for write, name in ((write_png, "a.png"), (write_gif, "a.gif")):
        with pytest.raises(BrowserError, match=r"chromium.*--html"):
            write(film(run), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("write", "name"), [(write_html, "a.htm"), (write_png, "a.jpg"), (write_gif, "a.png")]
)
def test_another_suffix_is_refused(run, tmp_path, write, name):
    with pytest.raises(fullam.FullamError, match="suffix"):
        write(film(run), tmp_path / name)


def test_a_still_outside_of_the_flight_is_refused(run, tmp_path):
    with pytest.raises(fullam.FullamError, match="from 0 to 1 s"):
        write_png(film(run), tmp_path / "a.png", at=1.5)
