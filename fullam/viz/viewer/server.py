"""The web server of the viewer: this machine only, in a thread, gone with its process.

Meshcat's own server listens on every interface without a password and lives in a process that
survives a killed parent. This one serves the same viewer on the loopback address, below a path that
cannot be guessed, and dies with the process. Whoever has the address can see and touch the flight;
others, also other users of this machine, can do neither. Nothing is encrypted: with `host` set to
more than the loopback address, whoever listens on the network can read the address.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import secrets
import socket
import threading
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.exceptions import FullamError
from fullam.viz.viewer.replay import Film
from fullam.viz.viewer.scene import WIDTHS

HOST = "127.0.0.1"
LOOPBACK, EVERYWHERE = ("127.0.0.1", "localhost"), ("", "0.0.0.0")

TOKEN_BYTES = 16
"""Random bytes in an address."""

IDLE, MOST_HEADER = 30.0, 16384
"""Longest silence within a request [s], and the longest header [bytes]."""

FIRST_PORT, PORTS = 7000, 50
"""Ports tried, from the first; Meshcat's habit."""

TRAIL_STEP = 0.004
"""Least distance between remembered points of a trail [m]."""

MOST_POINTS = 4000
"""A longer trail loses every other point of its older half."""

START_TIMEOUT = 10.0
"""Longest wait for the server to stand [s]."""

GOODBYE = 1.0
"""Longest wait for a page, and for a connection, to answer a goodbye [s]."""


class ViewerServer:
    """Serves the page, and pushes scenes and frames to whoever has it open.

    A page that opens late gets the scene, the trails so far and the latest frame. A page that
    cannot keep up misses frames; nobody waits for it. All methods may be called from any thread.

    Attributes:
        url: Address of the page.
        port: Its port.
        token: Its secret part.
        hear: Called with what a page says (a table) and which page it was; None says nothing and
            "do": "leave" that the page has gone. Called in the server's thread: be quick.
    """

    def __init__(
        self, port: int | None = None, host: str = HOST, hosts: Iterable[str] = ()
    ) -> None:
        """Start to listen.

        Args:
            port: The port; by default the first free one from `FIRST_PORT` on, 0 for any.
            host: The address to listen on. Another one than the loopback address lets other
                machines in; under which name they do is then their affair.
            hosts: Further host names under which pages may be asked for, as behind a proxy; "*" is
                any. The secret in the address is asked for all the same.

        Raises:
            FullamError: No port is free, or this machine has no such address.
        """
        self.hear: Callable[..., None] = _deaf
        self._host = host
        self._hosts = (*hosts, *(() if host in LOOPBACK else ("*",)))
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        self._scene: dict[str, Any] | None = None
        self._film: dict[str, Any] | None = None
        self._frame: bytes | None = None
        self._opening = ""  # scene and film as they are sent
        self._trails: dict[int, list[list[float]]] = {}
        self._trail_columns: list[int] = []
        self._clients: set[Any] = set()
        self._opened, self._started = threading.Event(), threading.Event()
        self._failure: OSError | None = None
        self._status: dict[str, Any] | None = None
        self._lock = threading.Lock()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._serve, args=(port,), daemon=True)
        self._thread.start()
        self._started.wait(START_TIMEOUT)
        if self._failure is not None:
            raise FullamError(f"the viewer cannot listen on {host}: {self._failure}")

    # ---- what callers do -------------------------------------------------------------------

    def show(self, scene: dict[str, Any]) -> None:
        """Show another scene; films and trails of the one before are forgotten."""
        columns, at = [], 1
        for track in (track for vehicle in scene["vehicles"] for track in vehicle["tracks"]):
            if track["kind"] == "trail":
                columns.append(at)
            at += WIDTHS[track["kind"]]
        with self._lock:
            self._scene, self._film, self._frame = scene, None, None
            self._trail_columns, self._trails = columns, {k: [] for k in range(len(columns))}
            self._opening = json.dumps({"scene": scene})
        self._post(self._opening)

    def push(self, frame: NDArray[np.float32], drop: bool = False) -> None:
        """Show a frame of the scene, now; with `drop`, only on pages that have had the last."""
        data = frame.astype("<f4").tobytes()
        with self._lock:
            self._frame = data
            for k, at in enumerate(self._trail_columns):
                self._remember(self._trails[k], frame[at : at + 3], float(frame[0]))
        self._post(data, drop)

    @staticmethod
    def _remember(path: list[list[float]], point: NDArray[np.float32], t: float) -> None:
        """Add a point and its time to a trail, if it is far enough from the one before."""
        if path and (t <= path[-1][3] or np.linalg.norm(point - path[-1][:3]) < TRAIL_STEP):
            return
        path.append([*(round(float(x), 4) for x in point), round(t, 3)])
        if len(path) > MOST_POINTS:
            del path[: MOST_POINTS // 2 : 2]

    def forget_after(self, t: float) -> None:
        """Trails end at a time [s]: the flight has gone back there."""
        with self._lock:
            for path in self._trails.values():
                while path and path[-1][3] > t:
                    path.pop()
        self._post(json.dumps({"forget": t}))

    def tell(self, message: dict[str, Any]) -> None:
        """Tell all pages something; of "status", pages that come later are told the last one."""
        if "status" in message:
            self._status = message
        self._post(json.dumps(message))

    def play(self, film: Film) -> None:
        """Show a film, with a slider; it starts when the page has it."""
        with self._lock:
            self._scene, self._film, self._frame = film.scene, film.to_dict(), None
            self._status = None
            self._trail_columns, self._trails = [], {}
            self._opening = json.dumps({"scene": film.scene, "film": self._film})
        self._post(self._opening)

    def wait_for_page(self, timeout: float) -> bool:
        """Wait until a page has connected; whether one has."""
        return self._opened.wait(timeout)

    @property
    def pages(self) -> int:
        """How many pages are connected."""
        return len(self._clients)

    def close(self) -> None:
        """Stop to listen and close every connection."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(START_TIMEOUT)

    def __enter__(self) -> ViewerServer:
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    # ---- what happens in the thread --------------------------------------------------------

    def _serve(self, port: int | None) -> None:
        from tornado.httpserver import HTTPServer

        asyncio.set_event_loop(self._loop)
        from fullam.viz.viewer.handlers import Door, application

        door = Door(
            self.token, self._hosts, self._join, self._leave, self._heard, lambda: self.pages
        )
        ports = range(FIRST_PORT, FIRST_PORT + PORTS) if port is None else (port,)
        try:
            bound = _bind(self._host, ports)
        except OSError as error:
            self._failure = error
            self._started.set()
            self._loop.close()
            return
        server = HTTPServer(
            application(door),
            idle_connection_timeout=IDLE,
            body_timeout=IDLE,
            max_header_size=MOST_HEADER,
            max_body_size=0,
        )
        server.add_socket(bound)
        self.port = int(bound.getsockname()[1])
        shown = socket.gethostname() if self._host in EVERYWHERE else self._host
        self.url = f"http://{shown}:{self.port}/{self.token}/"
        self._loop.call_soon(self._started.set)
        self._loop.run_forever()
        self._loop.run_until_complete(self._finish(server))
        self._loop.close()

    async def _finish(self, server: Any) -> None:
        """Say goodbye to the pages and close every connection."""
        server.stop()
        for client in list(self._clients):
            client.close()
        until = self._loop.time() + GOODBYE
        while self._clients and self._loop.time() < until:
            await asyncio.sleep(0.01)
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(server.close_all_connections(), GOODBYE)
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    def _join(self, client: Any) -> None:
        """Bring a new page up to date."""
        with self._lock:
            opening, frame = self._opening, self._frame
            trails = {str(k): list(path) for k, path in self._trails.items() if path}
        if opening:
            client.send(opening)
        if trails:
            client.send(json.dumps({"trails": trails}))
        if frame is not None:
            client.send(frame)
        if self._status is not None:
            client.send(json.dumps(self._status))
        self._clients.add(client)
        self._opened.set()

    def _leave(self, client: Any) -> None:
        if client in self._clients:
            self._clients.discard(client)
            self._heard({"do": "leave"}, client)

    def _heard(self, message: dict[str, Any], client: Any) -> None:
        self.hear(message, client)

    def _post(self, message: str | bytes, drop: bool = False) -> None:
        if self._thread.is_alive() and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._send, message, drop)

    def _send(self, message: str | bytes, drop: bool) -> None:
        for client in list(self._clients):
            client.send(message, drop=drop)


def _deaf(message: dict[str, Any], client: Any) -> None:
    """Nobody listens."""


def _bind(host: str, ports: Iterable[int]) -> socket.socket:
    """A socket on the first free one of some ports.

    Raises:
        OSError: None is free.
    """
    failure = OSError("no port to try")
    for port in ports:
        found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        found.setblocking(False)
        # A port just left may be taken again; one in use still may not (but on Windows it could).
        if os.name == "posix":
            found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            found.bind((host, port))
            found.listen()
        except OSError as error:
            failure = error
            found.close()
        else:
            return found
    raise failure
