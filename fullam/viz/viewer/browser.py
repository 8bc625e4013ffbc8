"""Headless Chromium over a pipe: stills, animations and tests, without a port or a driver.

Chromium reads DevTools commands from one pipe and answers on another (`--remote-debugging-pipe`);
it ends when the pipe does, so none outlives the process that started it. Every wait has a limit.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from fullam.exceptions import FullamError

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
"""Programs that are looked for on the PATH, in this order."""

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader",
    "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--mute-audio",
)  # fmt: skip
"""WebGL in software, and nothing that asks the network. Without a sandbox it runs in containers;
it is shown only pages made here."""

OFFLINE = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"
"""Nothing but this machine's own address resolves: with it a page has no network."""

TIMEOUT = 60.0
"""Longest wait for one answer [s]; a software renderer on a busy machine is slow."""

# The child must find the two pipes at descriptors 3 and 4; doing it in a process of its own is
# safe when other threads run, a preexec function is not.
TRAMPOLINE = (
    "import os, sys; r, w = int(sys.argv[1]), int(sys.argv[2]); a, b = os.dup(r), os.dup(w); "
    "a, b = (os.dup(a), os.dup(b)) if min(a, b) < 5 else (a, b); "
    "os.dup2(a, 3); os.dup2(b, 4); os.execvp(sys.argv[3], sys.argv[3:])"
)


class BrowserError(FullamError):
    """Chromium is not there, did not start, did not answer, or reported an error."""


def chromium_path() -> str | None:
    """The first of `NAMES` on the PATH, or None."""
    return next((path for path in map(shutil.which, NAMES) if path), None)


class Browser:
    """A headless Chromium with one page; a context manager.

    Attributes:
        version: What it says it is.
        complaints: What pages wrote to the console as an error, threw and did not catch, or failed
            to load; in the order in which it came.
    """

    def __init__(self, width: int = 1200, height: int = 750, *, network: bool = True) -> None:
        """Start it.

        Args:
            width: Of the page [px].
            height: Of the page [px].
            network: False lets it reach nothing but this machine.

        Raises:
            BrowserError: There is none, or it does not start.
        """
        program = chromium_path()
        if program is None:
            raise BrowserError(
                "pictures of the viewer are taken by Chromium, and none of "
                f"{', '.join(NAMES)} is on the PATH; install one (Debian: apt install chromium), "
                "or write the page with --html and open it in any browser."
            )
        self._profile = tempfile.TemporaryDirectory(prefix="fullam-chromium-")
        to_child, self._write = os.pipe()
        self._read, from_child = os.pipe()
        flags = [*FLAGS, f"--user-data-dir={self._profile.name}", "--remote-debugging-pipe"]
        flags += [f"--window-size={width},{height}", *([] if network else [OFFLINE])]
        command = [sys.executable, "-I", "-c", TRAMPOLINE, str(to_child), str(from_child)]
        self._process = subprocess.Popen(
            [*command, program, *flags, "about:blank"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(to_child, from_child),
            start_new_session=True,
        )
        os.close(to_child)
        os.close(from_child)
        self._buffer, self._number, self._session = b"", 0, None
        self.complaints: list[str] = []
        try:
            self.version = self.command("Browser.getVersion")["product"]
            targets = self.command("Target.getTargets")["targetInfos"]
            page = next(t for t in targets if t["type"] == "page")
            attached = self.command(
                "Target.attachToTarget", targetId=page["targetId"], flatten=True
            )
            self._session = attached["sessionId"]
            for domain in ("Page", "Runtime", "Log"):
                self.command(f"{domain}.enable")
            self.resize(width, height)
        except BaseException:
            self.close()
            raise

    def command(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a DevTools command and wait for its answer.

        Raises:
            BrowserError: No answer in time, an error as the answer, or Chromium has ended.
        """
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        try:
            self._send(json.dumps(message).encode() + b"\0")
        except BrokenPipeError as error:
            raise BrowserError(f"Chromium ended before '{method}'") from error
        until = time.monotonic() + TIMEOUT
        while True:
            answer = json.loads(self._receive(until, method))
            if answer.get("id") == self._number:
                break
            self._hear(answer)
        if "error" in answer:
            raise BrowserError(f"Chromium refused '{method}': {answer['error'].get('message')}")
        result: dict[str, Any] = answer["result"]
        return result

    def _hear(self, event: dict[str, Any]) -> None:
        """Keep what an event complains of."""
        method, what = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            details = what["exceptionDetails"]
            self.complaints.append(
                details.get("exception", {}).get("description") or details["text"]
            )
        elif method == "Runtime.consoleAPICalled" and what["type"] in ("error", "assert"):
            words = [str(a.get("value", a.get("description", ""))) for a in what["args"]]
            self.complaints.append(f"console.{what['type']}: {' '.join(words)}")
        elif method == "Log.entryAdded" and what["entry"]["level"] == "error":
            self.complaints.append(f"{what['entry']['text']} {what['entry'].get('url', '')}")

    def _send(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._write, data) :]

    def _receive(self, until: float, method: str) -> bytes:
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], max(until - time.monotonic(), 0.0))
            if not ready:
                raise BrowserError(f"Chromium did not answer '{method}' in {TIMEOUT:.0f} s")
            chunk = os.read(self._read, 1 << 20)
            if not chunk:
                raise BrowserError(f"Chromium ended during '{method}'")
            self._buffer += chunk
        message, _, self._buffer = self._buffer.partition(b"\0")
        return message

    def resize(self, width: int, height: int) -> None:
        """Set the size of the page [px]."""
        self.command(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=False,
        )  # fmt: skip

    def open(self, address: str | Path) -> None:
        """Open an address, or a file, and wait until the scene stands.

        Raises:
            BrowserError: It cannot be opened, or no scene appears.
        """
        url = address.resolve().as_uri() if isinstance(address, Path) else address
        result = self.command("Page.navigate", url=url)
        if result.get("errorText"):
            raise BrowserError(f"'{url}' cannot be opened: {result['errorText']}")
        self.wait_for("typeof fullam !== 'undefined' && fullam.state.ready")

    def evaluate(self, expression: str) -> Any:
        """Value of a JavaScript expression, as JSON.

        Raises:
            BrowserError: The expression raised.
        """
        answer = self.command("Runtime.evaluate", expression=expression, returnByValue=True)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            text = details.get("exception", {}).get("description") or details.get("text")
            raise BrowserError(f"the page raised on '{expression[:80]}': {text}")
        return answer["result"].get("value")

    def wait_for(self, condition: str, timeout: float = TIMEOUT) -> None:
        """Wait until a JavaScript expression is true.

        Raises:
            BrowserError: It was not in time.
        """
        until = time.monotonic() + timeout
        while not self.evaluate(f"Boolean({condition})"):
            if time.monotonic() > until:
                raise BrowserError(f"the page did not come to '{condition}' in {timeout:.0f} s")
            time.sleep(0.05)

    def screenshot(self) -> bytes:
        """The page as it is, as PNG."""
        self.evaluate("fullam.still()")
        answer = self.command("Page.captureScreenshot", format="png", optimizeForSpeed=True)
        return base64.b64decode(answer["data"])

    def close(self) -> None:
        """End it and everything it started."""
        for end in (self._write, self._read):
            os.close(end)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=5.0)
        # Its children share its process group, and no other process does.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for _ in range(20):  # the last children may still be writing to the profile
            try:
                self._profile.cleanup()
                return
            except OSError:
                time.sleep(0.1)

    def __enter__(self) -> Browser:
        """Itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close it."""
        self.close()
