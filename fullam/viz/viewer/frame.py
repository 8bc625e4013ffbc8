"""A server's page in a notebook cell, wherever the notebook's kernel is.

The cell is a small page of its own. It first tries the server on this machine, as the browser sees
it; if that is elsewhere (JupyterHub, a remote kernel, an SSH tunnel of one port), it asks through
the notebook's own server, under proxy/PORT/, which jupyter-server-proxy answers.
"""

from __future__ import annotations

import html
import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fullam.viz.viewer.server import ViewerServer

REACH = """// Where a server of the kernel is, as this browser sees it.
function notebook() {
  try {
    const told = parent.document.getElementById("jupyter-config-data");
    const base = told ? JSON.parse(told.textContent).baseUrl : parent.document.body.dataset.baseUrl;
    return base ? new URL(base, parent.location.href).href : null;
  } catch (error) { return null; }
}
function reach(at, found, lost) {
  const base = notebook();
  const places = [at.direct, ...(base ? [`${base}proxy/${at.port}/${at.token}/`] : [])];
  const attempt = (k) => {
    if (k === places.length) return lost();
    const probe = document.createElement("script");
    probe.src = `${places[k]}here.js`;
    probe.onload = () => found(places[k]);
    probe.onerror = () => attempt(k + 1);
    document.head.append(probe);
  };
  attempt(0);
}
function show(where) {
  const frame = document.createElement("iframe");
  frame.src = where;
  frame.allow = "fullscreen; gamepad";
  document.body.replaceChildren(frame);
}
// A page of a saved notebook asks nobody: only where there may be a kernel.
function reachLive(at) {
  let editor = false;
  try { editor = parent.location.protocol === "vscode-webview:"; } catch (error) { /* closed */ }
  if (notebook() || editor) reach(at, show, () => {});
}"""
"""Functions of a cell's page."""

CELL = """<!DOCTYPE html><meta name="referrer" content="no-referrer">
<style>html, body, iframe { margin: 0; width: 100%; height: 100%; border: 0; overflow: hidden;
font: 13px system-ui, sans-serif; }</style><p id="said"></p><script>
FUNCTIONS
const at = PLACES;
reach(at, show, () => {
  document.getElementById("said").textContent = "The flight is served at port " + at.port +
    " of the kernel's machine, and cannot be reached from this browser. Install " +
    "jupyter-server-proxy beside the notebook's server, or forward that port.";
});
</script>"""


def frame_html(server: ViewerServer, height: int) -> str:
    """The cell as HTML.

    Args:
        server: The server.
        height: Of the cell [px].
    """
    page = CELL.replace("FUNCTIONS", REACH).replace("PLACES", json.dumps(places(server)))
    return in_a_frame(page, height)


def places(server: ViewerServer) -> dict[str, Any]:
    """Where a server can be reached."""
    return {"direct": server.url, "port": server.port, "token": server.token}


def in_a_frame(page: str, height: int) -> str:
    """A page of its own inside a cell.

    Args:
        page: The page.
        height: Of the cell [px].
    """
    return (
        f'<iframe srcdoc="{html.escape(page, quote=True)}" style="width: 100%; '
        f'height: {height}px; border: 0" allow="fullscreen; gamepad"></iframe>'
    )
