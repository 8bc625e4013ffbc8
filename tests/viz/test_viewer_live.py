"""Live flights keep time; the server speaks to this machine only and goes with its process."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import numpy as np
import pytest

import fullam
from fullam.exceptions import FullamError, InvalidInput
from fullam.simulation.simulate import prepare
from fullam.viz.viewer.live import FEWEST_FRAMES, MOST_FRAMES, SLOW, LiveFlight
from fullam.viz.viewer.page import SCRIPTS
from fullam.viz.viewer.replay import film
from fullam.viz.viewer.server import HOST, ViewerServer


class Clock:
    """A clock that sleeping moves on, and each look at it by `cost`."""

    def __init__(self, cost=0.0):
        self.now, self.cost = 100.0, cost

    def __call__(self):
        self.now += self.cost
        return self.now

    def sleep(self, seconds):
        assert seconds > 0.0
        self.now += seconds


class Screen:
    """A server that keeps what it is shown, and when."""

    def __init__(self, clock):
        self.clock, self.scenes, self.frames, self.times = clock, [], [], []
        self.notes = []

    def show(self, scene):
        self.scenes.append(scene)

    def tell(self, message):
        json.dumps(message)
        self.notes += [message["note"]] if "note" in message else []

    def push(self, frame, drop=False):
        self.frames.append(frame)
        self.times.append(self.clock.now)


def plan(duration=1.0, **options):
    data = fullam.load_scenario("task-2").to_dict()
    return prepare(fullam.Scenario.from_dict(data | {"duration": duration}), **options)


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_a_flight_takes_its_time(speed):
    clock = Clock()
    screen = Screen(clock)
    report = LiveFlight(plan()).fly(screen, speed, clock=clock, sleep=clock.sleep)
    assert report.wall_time == pytest.approx(1.0 / speed)
    assert report.latest == pytest.approx(0.0, abs=1e-9)
    assert report.run.outcome == "completed"
    shown = np.array([frame[0] for frame in screen.frames])
    assert np.all(np.diff(shown) >= 0.0) and shown[-1] == pytest.approx(1.0)


def test_frames_are_sent_thirty_to_sixty_times_a_second():
    clock = Clock()
    screen = Screen(clock)
    LiveFlight(plan()).fly(screen, clock=clock, sleep=clock.sleep)
    # One before it flies, the one at take-off, sixty in its second, and the last once more.
    assert 30 <= len(screen.frames) <= MOST_FRAMES + 3


def test_a_late_flight_drops_frames_and_not_time():
    """Every look at the clock costs 8 ms: three looks a tick cannot be real time at 100 Hz."""
    clock = Clock(cost=0.008)
    screen = Screen(clock)
    report = LiveFlight(plan()).fly(screen, clock=clock, sleep=clock.sleep)
    assert report.latest > 0.5
    assert len(report.run) == 101
    gaps = np.diff(screen.times)
    # Hardly any frames, but never none for long.
    assert len(screen.frames) < 3.0 + FEWEST_FRAMES * (screen.times[-1] - screen.times[0])
    assert gaps.max() < 1.0 / FEWEST_FRAMES + 0.05


@pytest.mark.parametrize(("cost", "notes"), [(0.0, []), (0.03, [SLOW])])
def test_a_page_is_told_once_that_a_flight_falls_behind(cost, notes):
    """Looks at the clock that cost 30 ms each put a flight of 3 s behind by 1.5 s several times."""
    clock = Clock(cost)
    screen = Screen(clock)
    LiveFlight(plan(3.0)).fly(screen, clock=clock, sleep=clock.sleep)
    assert screen.notes == notes


def test_a_live_flight_is_the_flight_of_simulate():
    clock = Clock()
    report = LiveFlight(plan(0.3, seed=5)).fly(Screen(clock), clock=clock, sleep=clock.sleep)
    data = fullam.load_scenario("task-2").to_dict()
    same = fullam.simulate(fullam.Scenario.from_dict(data | {"duration": 0.3}), seed=5)
    np.testing.assert_array_equal(report.run.pose, same.pose)


def test_live_and_replayed_frames_agree_in_calm_air():
    """In calm air the true vehicle is the nominal one, so the same flight gives the same frames."""
    clock = Clock()
    screen = Screen(clock)
    live = LiveFlight(plan(0.3, calm=True))
    report = live.fly(screen, clock=clock, sleep=clock.sleep)
    movie = film(report.run, rate=100.0)
    for frame in screen.frames[1:-1]:
        k = round(float(frame[0]) / 0.01)
        # Columns 1-35: platform and links; 36-43: thrusts. Joint accelerations are differences
        # in the replay, and propellers turn by other steps, so those columns may differ.
        np.testing.assert_allclose(frame[1:44], movie.frames[k, 1:44], rtol=1e-5, atol=2e-5)


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_a_speed_that_is_none_is_refused(speed):
    with pytest.raises(InvalidInput):
        LiveFlight(plan(0.1)).fly(Screen(Clock()), speed)


def test_the_server_brings_the_page_and_its_scripts():
    with ViewerServer(0) as server:
        page = urllib.request.urlopen(server.url, timeout=10).read().decode()
        assert "fullam.connect()" in page
        for name in ("meshcat.js", *SCRIPTS):
            assert name in page
            assert urllib.request.urlopen(server.url + name, timeout=10).status == 200


@pytest.mark.parametrize("name", ["server.py", "../server.py", "page.html", "feed/x"])
def test_the_server_brings_nothing_else(name):
    with ViewerServer(0) as server, pytest.raises(urllib.error.HTTPError):
        urllib.request.urlopen(server.url + name, timeout=10)


def test_another_host_name_is_refused():
    """Else a page from elsewhere whose name resolves to this machine could read the flight."""
    with ViewerServer(0) as server:
        request = urllib.request.Request(server.url, headers={"Host": "evil.example"})
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(request, timeout=10)


def test_the_server_listens_on_the_loopback_address_only():
    # Linux gives every 127.x.y.z to the loopback device: a server on all interfaces answers.
    with ViewerServer(0) as server, pytest.raises(OSError):
        socket.create_connection(("127.0.0.2", server.port), timeout=2)


def test_two_servers_take_two_ports_and_a_taken_port_is_said():
    with ViewerServer() as first, ViewerServer() as second:
        assert first.url != second.url
        with pytest.raises(FullamError, match=HOST):
            ViewerServer(first.port)


def test_a_page_that_opens_late_gets_scene_trail_and_frame():
    import asyncio

    from tornado.websocket import websocket_connect

    live = LiveFlight(plan(0.3, calm=True))
    clock = Clock()

    async def listen(url):
        feed = await websocket_connect(url.replace("http", "ws") + "feed")
        messages = [await feed.read_message() for _ in range(3)]
        feed.close()
        return messages

    with ViewerServer(0) as server:
        live.fly(server, clock=clock, sleep=clock.sleep)
        text, trails, frame = asyncio.run(listen(server.url))
    assert json.loads(text)["scene"]["title"] == "task-2 · dc-pid"
    (trail,) = json.loads(trails)["trails"].values()
    assert len(trail) > 3
    times = [point[3] for point in trail]
    assert times == sorted(times) and times[-1] <= 0.3
    assert np.frombuffer(frame, "<f4")[0] == pytest.approx(0.3)


def test_interrupting_the_command_ends_it_and_frees_its_port():
    command = [sys.executable, "-m", "fullam", "view", "task-2", "--wait", "0.1", "--port", "0"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        line = process.stdout.readline()
        assert line.startswith("open http://127.0.0.1:")
        port = int(line.split()[1].split(":")[2].split("/")[0])
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        _, complaint = process.communicate(timeout=20)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    assert process.returncode == 0
    assert complaint == ""
    with pytest.raises(OSError), socket.create_connection((HOST, port), timeout=2):
        pass
