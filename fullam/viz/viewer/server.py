"""The web server of the viewer: this machine only, in a thread, gone with its process.

Meshcat's own server listens on every interface without a password and lives in a process that
survives a killed parent. This one serves the same viewer on the loopback address only, refuses
requests under any other host name (a page elsewhere could otherwise reach it through the
browser), and dies with the process. Any user of this machine can still open the page.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import socket
import threading
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fullam.exceptions import FullamError
from fullam.viz.viewer.replay import Film
from fullam.viz.viewer.scene import WIDTHS

HOST = "127.0.0.1"
FIRST_PORT, PORTS = 7000, 50
"""Ports tried, from the first; Meshcat's habit."""

TRAIL_STEP = 0.004
"""Least distance between remembered points of a trail [m]."""

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
    """

    def __init__(self, port: int | None = None) -> None:
        """Start to listen.

        Args:
            port: The port; by default the first free one from `FIRST_PORT` on, 0 for any.

        Raises:
            FullamError: No port is free.
        """
        self._scene: dict[str, Any] | None = None
        self._film: dict[str, Any] | None = None
        self._frame: bytes | None = None
        self._trails: dict[int, list[list[float]]] = {}
        self._trail_columns: list[int] = []
        self._clients: set[Any] = set()
        self._opened, self._started = threading.Event(), threading.Event()
        self._failure: OSError | None = None
        self._lock = threading.Lock()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._serve, args=(port,), daemon=True)
        self._thread.start()
        self._started.wait(START_TIMEOUT)
        if self._failure is not None:
            raise FullamError(f"the viewer cannot listen on {HOST}: {self._failure}")

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
        self._post(json.dumps({"scene": scene}))

    def push(self, frame: NDArray[np.float32], drop: bool = False) -> None:
        """Show a frame of the scene, now; with `drop`, only on pages that have had the last."""
        data = frame.astype("<f4").tobytes()
        with self._lock:
            self._frame = data
            for k, at in enumerate(self._trail_columns):
                point, path = frame[at : at + 3], self._trails[k]
                if not path or np.linalg.norm(point - path[-1]) >= TRAIL_STEP:
                    path.append([round(float(x), 4) for x in point])
        self._post(data, drop)

    def play(self, film: Film) -> None:
        """Show a film, with a slider; it starts when the page has it."""
        with self._lock:
            self._scene, self._film, self._frame = film.scene, film.to_dict(), None
            self._trail_columns, self._trails = [], {}
        self._post(json.dumps({"scene": film.scene, "film": self._film}))

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
        from fullam.viz.viewer.handlers import application

        handlers = application(self._join, self._clients.discard)
        try:
            bound = _bind(range(FIRST_PORT, FIRST_PORT + PORTS) if port is None else (port,))
        except OSError as error:
            self._failure = error
            self._started.set()
            self._loop.close()
            return
        server = HTTPServer(handlers)
        server.add_socket(bound)
        self.url = f"http://{HOST}:{bound.getsockname()[1]}/"
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
            scene, film, frame = self._scene, self._film, self._frame
            trails = {str(k): list(path) for k, path in self._trails.items() if path}
        if scene is not None:
            text = {"scene": scene} | ({"film": film} if film else {"trails": trails})
            client.send(json.dumps(text))
        if frame is not None:
            client.send(frame)
        self._clients.add(client)
        self._opened.set()

    def _post(self, message: str | bytes, drop: bool = False) -> None:
        if self._thread.is_alive() and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._send, message, drop)

    def _send(self, message: str | bytes, drop: bool) -> None:
        for client in list(self._clients):
            client.send(message, drop=drop)


def _bind(ports: Iterable[int]) -> socket.socket:
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
            found.bind((HOST, port))
            found.listen()
        except OSError as error:
            failure = error
            found.close()
        else:
            return found
    raise failure
