"""What answers the pages of the viewer: tornado's handlers, which come with Meshcat.

Everything lives below a path that nobody can guess, so that whoever has no address has nothing.
A page that speaks must come from this server (Origin), under a name that is meant (Host); what it
says is a small JSON table, and not too many of them; who does not read what is sent is dropped.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

import tornado.iostream
import tornado.web
import tornado.websocket

from fullam.viz.viewer import page

LOOPBACK = ("localhost", "127.0.0.1", "[::1]")
"""Host names that are always answered."""

MOST_BYTES = 4096
"""Length of a message from a page; tornado drops who sends more."""

MESSAGES, BURST = 120.0, 240.0
"""Messages of a page in a second, and at once; who sends more is dropped."""

MOST_PAGES = 16
"""Pages at a time."""

MOST_UNSENT = 64
"""Messages on their way to a page; who lets more pile up is dropped."""

ALIVE = 15.0
"""Time between two signs of life [s]."""


@dataclass(frozen=True)
class Door:
    """Who may come in, and who is told.

    Attributes:
        token: Secret part of the address.
        hosts: Further host names that are answered; "*" answers all.
        join: Told of a page that came.
        leave: Told of a page that went.
        hear: Told what a page said, and which.
        pages: How many there are.
    """

    token: str
    hosts: tuple[str, ...]
    join: Callable[[Any], None]
    leave: Callable[[Any], None]
    hear: Callable[[dict[str, Any], Any], None]
    pages: Callable[[], int]

    def answers(self, netloc: str) -> bool:
        """Whether a host name, with or without port, is meant."""
        name = urlsplit(f"//{netloc}").hostname or ""
        name = f"[{name}]" if ":" in name else name
        return "*" in self.hosts or name in LOOPBACK or name in self.hosts


class Guarded(tornado.web.RequestHandler):
    """Answers under the right token and a host name that is meant; 404 to everybody else."""

    def initialize(self, door: Door) -> None:
        """Bind the door."""
        self.door = door

    def set_default_headers(self) -> None:
        """The address is a secret: it goes to no other site."""
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Cache-Control", "no-store")
        self.clear_header("Server")

    def prepare(self) -> None:
        """Look at the address before anything else."""
        token = self.path_args[0] or ""
        right = hmac.compare_digest(token.encode(), self.door.token.encode())
        if not (right and self.door.answers(self.request.host)):
            raise tornado.web.HTTPError(404)

    def write_error(self, status_code: int, **_: Any) -> None:
        """As little as possible."""
        self.finish(f"{status_code}\n")


class Page(Guarded):
    """The page and its scripts."""

    def get(self, _: str, name: str) -> None:
        """Serve the page, or a script by its name."""
        if name == "":
            self.finish(page.served_page())
            return
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        if name == "here.js":  # only to see whether this server can be reached
            self.finish("")
            return
        path = page.meshcat_script() if name == "meshcat.js" else page.HERE / name
        self.finish(path.read_bytes())


class Feed(Guarded, tornado.websocket.WebSocketHandler):
    """One open page."""

    def prepare(self) -> None:
        """The address, and whether there is room."""
        super().prepare()
        self._credit, self._counted = BURST, time.monotonic()
        self._sending: set[Any] = set()
        if self.door.pages() >= MOST_PAGES:
            raise tornado.web.HTTPError(503)

    def check_origin(self, origin: str) -> bool:
        """Only pages that came from here may speak, or those of hosts that were named."""
        found = urlsplit(origin)
        same = found.netloc.lower() == self.request.host.lower()
        return same or (found.hostname or "") in self.door.hosts

    def open(self, *_: str, **__: str) -> None:
        """A page has come."""
        self.set_nodelay(True)
        self.door.join(self)

    def send(self, message: str | bytes, drop: bool = False) -> None:
        """Send; with `drop`, not while something is still on its way."""
        if drop and self._sending:
            return
        if len(self._sending) > MOST_UNSENT:
            self.throw_out()
            return
        try:
            writing = self.write_message(message, binary=isinstance(message, bytes))
        except tornado.websocket.WebSocketClosedError:
            self.door.leave(self)
        else:
            task = asyncio.ensure_future(_quiet(writing))
            self._sending.add(task)
            task.add_done_callback(self._sending.discard)

    def on_message(self, message: str | bytes) -> None:
        """A page has said something: a table of a few numbers and names, or it is dropped."""
        now = time.monotonic()
        self._credit = min(BURST, self._credit + MESSAGES * (now - self._counted)) - 1.0
        self._counted = now
        said = _table(message)
        if said is None or self._credit < 0.0:
            self.throw_out()
        else:
            self.door.hear(said, self)

    def throw_out(self) -> None:
        """Close without a goodbye: who does not read would not read that either."""
        self.door.leave(self)
        connection = self.ws_connection
        if connection is not None and connection.stream is not None:
            connection.stream.close()

    def on_close(self) -> None:
        """The page has gone."""
        self.door.leave(self)


async def _quiet(writing: Any) -> None:
    gone = tornado.websocket.WebSocketClosedError, tornado.iostream.StreamClosedError
    with contextlib.suppress(*gone):
        await writing


def _table(message: str | bytes) -> dict[str, Any] | None:
    """The JSON table that a message is; None if it is none."""
    if not isinstance(message, str):
        return None
    try:
        said = json.loads(message)
    except (ValueError, RecursionError):
        return None
    return said if isinstance(said, dict) else None


def application(door: Door) -> Any:
    """The tornado application."""
    names = "|".join(("meshcat.js", "here.js", *page.SCRIPTS)).replace(".", r"\.")
    rules = [
        (r"/([^/]*)/feed", Feed, {"door": door}),
        (rf"/([^/]*)/({names}|)", Page, {"door": door}),
    ]
    return tornado.web.Application(
        rules,
        websocket_max_message_size=MOST_BYTES,
        websocket_ping_interval=ALIVE,
        websocket_ping_timeout=ALIVE,
        log_function=lambda handler: None,  # a log would hold the token
    )
