"""A film as a line drawing: light enough for every notebook cell, and it plays without a kernel.

The page holds rotor rings, arm, target and the tool's path, positions and quaternions in 16 bits;
edges of the world and of a scene in MJCF, the force of them on the tool, what is carried and the
path asked of the tool.
Where a live notebook shows it, it asks the kernel's server for the whole scene and makes room.
"""

from __future__ import annotations

import base64
import html
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fullam.dynamics.rotations import quaternion_rotation
from fullam.viz.viewer.frame import REACH, places
from fullam.viz.viewer.outlines import outlines
from fullam.viz.viewer.replay import Film
from fullam.viz.viewer.scene import WIDTHS

if TYPE_CHECKING:
    from fullam.viz.viewer.server import ViewerServer

Array = NDArray[np.float64]

MOST_BYTES = 30_000
"""Frames of a drawing; a longer film has fewer of them in a second."""

LARGEST = 32767
RING = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
"""Corners of a drawn rotor."""

MOST_LINES, MOST_BODIES = 200, 12
"""Of a scene: what stands still, or one body that moves, has so many lines; and bodies that move,
whose places take room in every frame."""

FARTHEST = 20.0
"""A flight that is lost is drawn no farther away than so many times the scene's radius."""

HERE = Path(__file__).resolve().parent

STYLE = """html, body { margin: 0; height: 100%; overflow: hidden; color: #5f6b7a;
font: 12px system-ui, sans-serif; background: #f4f6f8; }
canvas { width: 100%; height: 100%; display: block; touch-action: none; cursor: grab; }
#head { position: absolute; top: 8px; left: 12px; right: 12px; pointer-events: none; }
#head b { color: #22272e; } #bar { position: absolute; bottom: 8px; left: 12px; right: 12px;
display: flex; gap: 8px; align-items: center; } #bar[hidden] { display: none; }
#bar input { flex: 1; } iframe { width: 100%; height: 100%; border: 0; }"""


def sketch_page(film: Film, server: ViewerServer | None = None) -> str:
    """One small page that plays a film as lines, or shows the server's page where that answers.

    Args:
        film: The film.
        server: Who plays the whole film to a live notebook; None for nobody.
    """
    script = (HERE / "sketch.js").read_text(encoding="utf-8")
    data = _json(sketch_of(film))
    labels = [(v["colour"], html.escape(v["label"])) for v in film.scene["vehicles"]]
    several = [f'<span style="color: {colour}">{label}</span>' for colour, label in labels]
    title, details = html.escape(film.scene["title"]), html.escape(film.scene["details"])
    live = "" if server is None else f"{REACH}\nreachLive({_json(places(server))});"
    return (
        '<!DOCTYPE html><meta charset="utf-8"><meta name="referrer" content="no-referrer">'
        f'<title>{title}</title><style>{STYLE}</style><canvas id="sketch" role="img" '
        f'aria-label="{", ".join(label for _, label in labels)}"></canvas>'
        f'<div id="head"><b>{title}</b> {details}<br>{" ".join(several[1:] and several)}</div>'
        '<div id="bar"><button id="play" type="button">Pause</button>'
        '<input id="time" type="range" min="0" step="any" value="0" aria-label="time">'
        '<span id="now"></span></div>'
        f"<script>const SKETCH = {data};\n{script}\n{live}</script>"
    )


def sketch_of(film: Film) -> dict[str, Any]:
    """The drawing as JSON values: lines that stand still in a body, and numbers that move them."""
    scene = film.scene
    vehicles: list[dict[str, Any]] = []
    columns: list[int] = []
    balls: list[tuple[int, int]] = []
    at, width = 1, 0
    for vehicle in scene["vehicles"]:
        drawn: dict[str, Any] = {"pose": None, "target": None, "joints": [], "tool": None}
        drawn |= {"contact": None, "balls": [], "bodies": []}
        for track in vehicle["tracks"]:
            kept = _keep(drawn, vehicle, track, width)
            if track["kind"] == "ball":
                balls.append((width, at + 3))
            columns += range(at, at + kept)
            at, width = at + WIDTHS[track["kind"]], width + kept
        vehicles.append(
            drawn
            | {"label": vehicle["label"], "colour": vehicle["colour"], "rotors": _rotors(vehicle)}
            | {"world": _edges(vehicle), "task": _task(vehicle)}
            | {"scene": _lines(vehicle, f"{vehicle['path']}/world/scene")}
        )
    stride = max(1, -(-2 * width * len(film.frames) // MOST_BYTES))
    frames = film.frames[::stride].astype(np.float64)
    rows = frames[:, columns]
    for start, carried in balls:  # what is not carried is out of sight
        rows[frames[:, carried] < 0.5, start : start + 3] = np.inf
    centre, scale = np.array(scene["centre"]), FARTHEST * scene["radius"] / LARGEST
    quaternions = [
        v[name] + 3 for v in vehicles for name in ("pose", "target") if v[name] is not None
    ]
    quaternions += [body["at"] + 3 for v in vehicles for body in v["bodies"]]
    steps = _quantized(rows, quaternions, centre, scale)
    direction = np.array(scene["direction"])
    return {
        "vehicles": vehicles,
        "count": len(steps),
        "width": width,
        "rate": film.rate / stride,
        "duration": (len(steps) - 1) * stride / film.rate,
        "scale": scale,
        "centre": scene["centre"],
        "radius": scene["radius"],
        "ground": scene["ground"],
        "yaw": float(np.arctan2(direction[1], direction[0])),
        "pitch": float(np.arctan2(direction[2], np.hypot(*direction[:2]))),
        "data": base64.b64encode(steps.tobytes()).decode(),
    }


def _keep(drawn: dict[str, Any], vehicle: dict[str, Any], track: dict[str, Any], at: int) -> int:
    """Note where a track's numbers are in a row of the drawing; how many of them it has there."""
    kind, path = track["kind"], track.get("path", "")
    if track.get("scene"):
        lines = _lines(vehicle, path) if len(drawn["bodies"]) < MOST_BODIES else []
        drawn["bodies"] += [{"at": at, "lines": lines}] if lines else []
        return 7 if lines else 0
    if track.get("main") or path.endswith("/target"):
        drawn["pose" if track.get("main") else "target"] = at
        return 7
    if kind in ("pose", "ball"):
        drawn["joints" if kind == "pose" else "balls"].append(at)
        return 3
    if kind == "trail" or path.endswith("/contact"):  # an arrow's foot; it ends at the tool
        drawn["tool" if kind == "trail" else "contact"] = at
        return 3
    return 0


def _quantized(
    rows: Array, quaternions: list[int], centre: Array, scale: float
) -> NDArray[np.int16]:
    """The numbers in 16 bits: positions about the centre, quaternions without a jump of sign."""
    numbers = np.empty_like(rows)
    turning = np.zeros(rows.shape[1], dtype=bool)
    for start in quaternions:
        q = rows[:, start : start + 4]
        signs = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
        numbers[:, start : start + 4] = LARGEST * q * np.cumprod(np.r_[1.0, signs])[:, None]
        turning[start : start + 4] = True
    points = rows[:, ~turning].reshape(len(rows), -1, 3)
    numbers[:, ~turning] = ((points - centre) / scale).reshape(len(rows), -1)
    numbers = np.nan_to_num(numbers, nan=0.0, posinf=LARGEST, neginf=-LARGEST)
    return np.rint(np.clip(numbers, -LARGEST, LARGEST)).astype("<i2")


def _rotors(vehicle: dict[str, Any]) -> list[dict[str, Any]]:
    """Hub and ring of each rotor in the platform's axes, and its colour."""
    found = []
    for shape in vehicle["shapes"]:
        path = shape["path"].removeprefix(f"{vehicle['path']}/platform/")
        if not path.startswith("propeller_") or "/" in path or "pose" not in shape:
            continue
        pose, radius = np.array(shape["pose"]), shape["radius"]
        around = radius * np.column_stack([np.cos(RING), np.sin(RING), np.zeros_like(RING)])
        ring = pose[:3] + around @ quaternion_rotation(pose[3:]).T
        points = np.vstack([pose[:3], ring]).round(4)
        found.append({"colour": shape["colour"], "ring": points.tolist()})
    return found


def _edges(vehicle: dict[str, Any]) -> list[list[list[float]]]:
    """Lines along what may be touched: the edges of boxes and tiles, three rings of a ball."""
    found = []
    for shape in vehicle["shapes"]:
        folder, _, name = shape["path"].removeprefix(f"{vehicle['path']}/").partition("/")
        if folder != "world" or "/" in name:
            continue
        found += outlines(shape)
    return found


def _lines(vehicle: dict[str, Any], path: str) -> list[list[Any]]:
    """Colour and points of each line along the shapes right below a path."""
    found: list[list[Any]] = []
    for shape in vehicle["shapes"]:
        if shape["path"].rpartition("/")[0] == path and len(found) < MOST_LINES:
            found += [[shape["colour"], line] for line in outlines(shape)]
    return found[:MOST_LINES]


def _task(vehicle: dict[str, Any]) -> list[list[float]]:
    """Points along the path asked of the tool: the middles of its dashes."""
    start = f"{vehicle['path']}/task/"
    dashes = [shape for shape in vehicle["shapes"] if shape["path"].startswith(start)]
    return [np.round(dash["pose"][:3], 4).tolist() for dash in dashes if "pose" in dash]


def _json(value: Any) -> str:
    """JSON inside a <script>: no name in it can end that."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")
