"""A server's page in a notebook cell, wherever the notebook's kernel is.

The cell is a small page of its own. It first tries the server on this machine, as the browser sees
it; if that is elsewhere (JupyterHub, a remote kernel, an SSH tunnel of one port), it asks through
the notebook's own server, under proxy/PORT/, which jupyter-server-proxy answers.
"""

from __future__ import annotations

import html
import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fullam.viz.viewer.server import ViewerServer

CELL = """<!DOCTYPE html><meta name="referrer" content="no-referrer">
<style>html, body, iframe { margin: 0; width: 100%; height: 100%; border: 0; overflow: hidden;
font: 13px system-ui, sans-serif; }</style><p id="said"></p><script>
const at = PLACES, show = (where) => {
  const frame = document.createElement("iframe");
  frame.src = where;
  frame.allow = "fullscreen; gamepad";
  document.body.replaceChildren(frame);
};
let base = null;
try {
  const told = parent.document.getElementById("jupyter-config-data");
  base = told ? JSON.parse(told.textContent).baseUrl : parent.document.body.dataset.baseUrl;
  base = base && new URL(base, parent.location.href).href;
} catch (error) { base = null; }
const places = [at.direct, ...(base ? [`${base}proxy/${at.port}/${at.token}/`] : [])];
const attempt = (k) => {
  if (k === places.length) {
    document.getElementById("said").textContent = "The flight is served at port " + at.port +
      " of the kernel's machine, and cannot be reached from this browser. Install " +
      "jupyter-server-proxy beside the notebook's server, or forward that port.";
    return;
  }
  const probe = document.createElement("script");
  probe.src = `${places[k]}here.js`;
  probe.onload = () => show(places[k]);
  probe.onerror = () => attempt(k + 1);
  document.head.append(probe);
};
attempt(0);
</script>"""


def frame_html(server: ViewerServer, height: int) -> str:
    """The cell as HTML.

    Args:
        server: The server.
        height: Of the cell [px].
    """
    places = json.dumps({"direct": server.url, "port": server.port, "token": server.token})
    page = html.escape(CELL.replace("PLACES", places), quote=True)
    return (
        f'<iframe srcdoc="{page}" style="width: 100%; height: {height}px; border: 0" '
        'allow="fullscreen; gamepad"></iframe>'
    )
