"""Who may see and touch a flight: whoever has the address, from a page of this server."""

import asyncio
import contextlib
import json
import socket
import threading
import time
import urllib.error
import urllib.request
from typing import ClassVar
from urllib.parse import urlsplit

import numpy as np
import pytest
import tornado.httpclient
import tornado.web
import tornado.websocket
from tornado.websocket import websocket_connect

from fullam.simulation.hands.free import plan_of
from fullam.viz.viewer.browser import Browser
from fullam.viz.viewer.frame import frame_html
from fullam.viz.viewer.handlers import BURST, MOST_BYTES, MOST_PAGES
from fullam.viz.viewer.live import LiveFlight
from fullam.viz.viewer.server import ViewerServer


@pytest.fixture
def server():
    """It remembers what it is told."""
    with ViewerServer(0) as made:
        made.said = []
        made.hear = lambda message, who: made.said.append(message)
        yield made


def feed_of(server):
    return server.url.replace("http", "ws") + "feed"


def status_of(url, **headers):
    try:
        return urllib.request.urlopen(
            urllib.request.Request(url, headers=headers), timeout=10
        ).status
    except urllib.error.HTTPError as error:
        return error.code


def talk(server, *messages, headers=None, url=None):
    """Send messages to the feed; what came of the connection: "refused", "dropped" or "kept"."""

    async def go():
        request = tornado.httpclient.HTTPRequest(url or feed_of(server), headers=headers or {})
        try:
            feed = await websocket_connect(request)
        except (tornado.httpclient.HTTPError, OSError):
            return "refused"
        with contextlib.suppress(tornado.websocket.WebSocketClosedError):
            for message in messages:
                await feed.write_message(message, binary=isinstance(message, bytes))
        try:
            answer = await asyncio.wait_for(feed.read_message(), 0.4)
        except TimeoutError:
            answer = "kept"
        feed.close()
        return "dropped" if answer is None else "kept"

    return asyncio.run(go())


def wait_until(condition, timeout=15.0):
    until = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < until, "it did not happen"
        time.sleep(0.02)


def test_what_a_page_says_is_heard(server):
    assert talk(server, '{"do": "pause"}') == "kept"
    assert server.said == [{"do": "pause"}, {"do": "leave"}]


@pytest.mark.parametrize("path", ["", "x/", "{}x/", "page.js", "x/page.js", "x/feed", "{}/../x/"])
def test_without_the_secret_there_is_nothing(server, path):
    base = server.url.replace(f"{server.token}/", "")
    assert status_of(base + path.format(server.token)) == 404


def test_a_wrong_token_gets_no_feed(server):
    wrong = feed_of(server).replace(server.token, server.token[::-1] + "x")
    assert talk(server, "{}", url=wrong) == "refused"


def test_every_server_has_a_secret_of_its_own():
    with ViewerServer(0) as one, ViewerServer(0) as other:
        assert one.token != other.token and len(one.token) > 20


def test_a_foreign_origin_is_refused(server):
    own = f"http://127.0.0.1:{server.port}"
    assert talk(server, '{"do": "play"}', headers={"Origin": own}) == "kept"
    for origin in ("http://evil.example", "http://127.0.0.1:1", "null", "http://localhost"):
        assert talk(server, '{"do": "play"}', headers={"Origin": origin}) == "refused"
    assert server.said.count({"do": "play"}) == 1


def test_a_foreign_host_is_refused_unless_it_is_named():
    with ViewerServer(0) as server, ViewerServer(0, hosts=("hub.example",)) as named:
        assert status_of(server.url, Host="hub.example") == 404
        assert status_of(server.url, Host="localhost:1234") == 200
        assert status_of(named.url, Host="hub.example") == 200
        assert status_of(named.url, Host="evil.example") == 404
        assert talk(named, "{}", headers={"Origin": "https://hub.example"}) == "kept"
        assert talk(named, "{}", headers={"Origin": "https://evil.example"}) == "refused"


@pytest.mark.parametrize(
    "message",
    [
        "no json",
        "[1, 2]",
        "7",
        b"\x00\x01",
        "[" * 3000,
        json.dumps({"act": "pull", "hand": "x" * MOST_BYTES}),
    ],
)
def test_garbage_and_oversized_frames_drop_the_page(server, message):
    assert talk(server, message) == "dropped"
    assert server.said == [{"do": "leave"}]


def test_a_flood_drops_the_page(server):
    assert talk(server, *['{"do": "play"}'] * (2 * int(BURST))) == "dropped"
    assert len(server.said) < 1.5 * BURST


def test_raw_garbage_harms_nobody(server):
    for rubbish in (b"\x16\x03\x01" * 100, b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 5000, b"\0"):
        line = socket.create_connection(("127.0.0.1", server.port), timeout=5)
        with line, contextlib.suppress(OSError):
            line.sendall(rubbish)
    assert status_of(server.url) == 200


def open_feed(server):
    """A connection that has shaken hands, by hand."""
    line = socket.create_connection(("127.0.0.1", server.port), timeout=5)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    line.sendall(
        f"GET /{server.token}/feed HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
    )
    return line, line.recv(12)


def test_no_more_pages_than_there_is_room_for(server):
    lines = [open_feed(server) for _ in range(200)]
    try:
        answers = [answer for _, answer in lines]
        assert answers.count(b"HTTP/1.1 101") == MOST_PAGES == server.pages
        assert answers.count(b"HTTP/1.1 503") == 200 - MOST_PAGES
    finally:
        for line, _ in lines:
            line.close()
    wait_until(lambda: server.pages == 0)


def test_who_does_not_read_is_dropped_and_delays_nobody(server):
    line, answer = open_feed(server)
    assert answer == b"HTTP/1.1 101"
    wait_until(lambda: server.pages == 1)
    note = {"note": "x" * 100_000}
    with line:
        for _ in range(400):
            begun = time.perf_counter()
            server.tell(note)
            # Telling is putting into a queue: 40 MB that nobody reads take no time here.
            assert time.perf_counter() - begun < 1.0
            if server.pages == 0:
                break
            time.sleep(0.01)
        wait_until(lambda: server.pages == 0)


def test_orders_of_pages_cannot_fill_the_memory():
    live = LiveFlight(plan_of("fullam", duration=1.0))
    for _ in range(10_000):
        live.orders.hear({"act": "pull", "hand": [0.0, 0.0, 0.0]})
    assert live.orders._waiting.qsize() == live.orders._waiting.maxsize


def test_another_address_is_bound_when_it_is_asked_for():
    with ViewerServer(0, host="127.0.0.2") as server:
        assert server.url.startswith("http://127.0.0.2:")
        assert status_of(server.url) == 200
        # Whoever comes from another machine does so under a name of its own.
        assert status_of(server.url, Host="lab.example") == 200


class Proxy:
    """Passes /user/me/proxy/PORT/... on to a port of this machine, as a notebook's server does."""

    PREFIX = "/user/me/proxy"
    far: ClassVar = []

    class Pages(tornado.web.RequestHandler):
        async def get(self, port, path):
            client = tornado.httpclient.AsyncHTTPClient()
            answer = await client.fetch(
                f"http://127.0.0.1:{port}/{path}",
                headers={"Host": self.request.host},
                raise_error=False,
            )
            self.set_status(answer.code)
            self.set_header("Content-Type", answer.headers.get("Content-Type", "text/html"))
            self.finish(answer.body)

    class Sockets(tornado.websocket.WebSocketHandler):
        async def open(self, port, path):
            headers = {"Host": self.request.host, "Origin": self.request.headers["Origin"]}
            request = tornado.httpclient.HTTPRequest(
                f"ws://127.0.0.1:{port}/{path}", headers=headers
            )
            self.far = await websocket_connect(request, on_message_callback=self.pass_on)

            Proxy.far.append(self.far)

        def pass_on(self, message):
            if message is None:
                self.close()
            else:
                self.write_message(message, binary=isinstance(message, bytes))

        def on_message(self, message):
            self.far.write_message(message)

    def __enter__(self):
        self.loop, started = asyncio.new_event_loop(), threading.Event()

        def run():
            asyncio.set_event_loop(self.loop)
            rules = [
                (rf"{self.PREFIX}/(\d+)/(.*/feed)", self.Sockets),
                (rf"{self.PREFIX}/(\d+)/(.*)", self.Pages),
            ]
            bound = tornado.netutil.bind_sockets(0, "127.0.0.1")
            self.port = bound[0].getsockname()[1]
            self.web = tornado.httpserver.HTTPServer(tornado.web.Application(rules))
            self.web.add_sockets(bound)
            self.loop.call_soon(started.set)
            self.loop.run_forever()
            self.web.stop()
            while Proxy.far:
                Proxy.far.pop().close()
            self.loop.run_until_complete(self.web.close_all_connections())
            for task in asyncio.all_tasks(self.loop):
                task.cancel()
            self.loop.run_until_complete(asyncio.sleep(0.1))
            self.loop.close()

        self.thread = threading.Thread(target=run)
        self.thread.start()
        started.wait(10.0)
        return self

    def __exit__(self, *_):
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(10.0)


@pytest.mark.browser
def test_behind_a_proxy_that_rewrites_paths_the_flight_is_seen_and_touched(tmp_path):
    live = LiveFlight(plan_of("fullam", duration=30.0))
    with ViewerServer(0) as server, Proxy() as proxy, Browser(480, 300, network=False) as browser:
        live.show(server)
        pilot = threading.Thread(target=live.fly, args=(server,), kwargs={"stay": True})
        pilot.start()
        try:
            base = f"http://127.0.0.1:{proxy.port}{proxy.PREFIX}"
            browser.open(f"{base}/{server.port}/{server.token}/")
            browser.wait_for("fullam.status && fullam.state.time > 0.3")
            browser.evaluate("Hands.aim([0.1, 0.2, 1.4, 0, 0, 0, 1])")
            wait_until(lambda: live.flight.script)
            np.testing.assert_allclose(live.flight.target[:3], [0.1, 0.2, 1.4])
            asked = "performance.getEntriesByType('resource').map((entry) => entry.name)"
            hosts = {urlsplit(name).netloc for name in browser.evaluate(asked)} - {""}
            assert hosts == {f"127.0.0.1:{proxy.port}"}
            assert browser.complaints == []
        finally:
            live.transport.quit = True
            pilot.join(20.0)


@pytest.mark.browser
def test_a_notebook_cell_finds_the_server_here_or_through_the_notebooks_own(tmp_path):
    """As in JupyterLab, whose page tells its base address; what cannot be reached is said."""
    live = LiveFlight(plan_of("fullam", duration=5.0))
    look = (
        "document.querySelector('iframe')?.contentDocument?.querySelector('iframe')?.src ?? "
        "document.querySelector('iframe')?.contentDocument?.getElementById('said')?.textContent"
    )
    with ViewerServer(0) as server, Proxy() as proxy, Browser(480, 300, network=False) as browser:
        live.show(server)
        hub = f"http://127.0.0.1:{proxy.port}/user/me/"
        config = f'<script id="jupyter-config-data">{json.dumps({"baseUrl": hub})}</script>'
        through = f"{hub}proxy/{server.port}/{server.token}/"

        def cell(url, top):
            class Cell:
                port, token = server.port, server.token

            Cell.url = url
            page = tmp_path / "notebook.html"
            page.write_text(f"<body>{top}{frame_html(Cell, 200)}</body>", encoding="utf-8")
            browser.command("Page.navigate", url=page.resolve().as_uri())
            browser.wait_for(f"Boolean({look})")
            return browser.evaluate(look)

        nowhere = "http://127.0.0.1:9/x/"
        assert cell(server.url, "") == server.url
        assert cell(nowhere, config) == through
        assert "jupyter-server-proxy" in cell(nowhere, "")
