"""What answers the pages of the viewer: tornado's handlers, which come with Meshcat."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import tornado.iostream
import tornado.web
import tornado.websocket

from fullam.viz.viewer import page

LOCAL = r"(localhost|127\.0\.0\.1)"
"""Host names that are answered."""


class Page(tornado.web.RequestHandler):
    """The page and its scripts."""

    def get(self, name: str) -> None:
        """Serve the page, or a script by its name."""
        self.set_header("Cache-Control", "no-store")
        if name == "":
            self.finish(page.served_page())
            return
        path = page.meshcat_script() if name == "meshcat.js" else page.HERE / name
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        self.finish(path.read_bytes())


class Feed(tornado.websocket.WebSocketHandler):
    """One open page. Tornado refuses connections that pages of other origins ask for."""

    def initialize(self, join: Callable[[Any], None], leave: Callable[[Any], None]) -> None:
        """Bind what is called when a page comes and goes."""
        self._join, self._leave = join, leave
        self.sent: Any = None

    def open(self, *_: str, **__: str) -> None:
        """A page has come."""
        self.set_nodelay(True)
        self._join(self)

    def send(self, message: str | bytes, drop: bool = False) -> None:
        """Send; with `drop`, not while the message before is still on its way."""
        if drop and self.sent is not None and not self.sent.done():
            return
        try:
            writing = self.write_message(message, binary=isinstance(message, bytes))
        except tornado.websocket.WebSocketClosedError:
            self._leave(self)
        else:
            self.sent = asyncio.ensure_future(_quiet(writing))

    def on_message(self, message: str | bytes) -> None:
        """Pages only listen."""

    def on_close(self) -> None:
        """The page has gone."""
        self._leave(self)


async def _quiet(sending: Any) -> None:
    try:
        await sending
    except (tornado.websocket.WebSocketClosedError, tornado.iostream.StreamClosedError):
        return


def application(join: Callable[[Any], None], leave: Callable[[Any], None]) -> Any:
    """The tornado application; `join` and `leave` are told of pages that come and go."""
    made = tornado.web.Application()
    names = "|".join(("meshcat.js", *page.SCRIPTS)).replace(".", r"\.")
    hands = {"join": join, "leave": leave}
    made.add_handlers(LOCAL, [(r"/feed", Feed, hands), (rf"/({names}|)", Page)])
    return made
