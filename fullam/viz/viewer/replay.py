"""Records as films: what the page plays, and what the exports are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fullam.analysis.captions import weather_caption
from fullam.exceptions import InvalidInput
from fullam.simulation.record.refly import hand_forces
from fullam.viz.viewer import shapes
from fullam.viz.viewer.scene import SPIN_RATE, Scene, VehicleScene
from fullam.viz.viewer.scenery import Scenery
from fullam.viz.viewer.snapshot import Snapshot

if TYPE_CHECKING:
    from fullam.model.vehicle import Vehicle
    from fullam.simulation.record.run import Run

Array = NDArray[np.float64]

FRAME_RATE = 30.0
"""Frames of a film in a second; the page interpolates between them."""

MOST_FRAMES = 6000
"""Longer flights get fewer frames in a second, so that a page stays a few megabytes."""


@dataclass(frozen=True, eq=False)
class Film:
    """A scene and its frames.

    Attributes:
        scene: The scene as JSON values.
        frames: Rows of the frames, shape (n, width); column 0 is the time.
        rate: Frames in a second.
    """

    scene: dict[str, Any]
    frames: NDArray[np.float32]
    rate: float

    @property
    def duration(self) -> float:
        """Length [s]."""
        return (len(self.frames) - 1) / self.rate

    def to_dict(self, start: float = 0.0) -> dict[str, Any]:
        """The frames as JSON values: numbers in base64."""
        count, width = self.frames.shape
        data = shapes.encode(self.frames.astype("<f4"))
        return {"fps": self.rate, "count": count, "width": width, "data": data, "start": start}


def film(
    runs: Run | Sequence[Run],
    *,
    offset: float | Sequence[float] | None = None,
    labels: Sequence[str] | None = None,
    rate: float = FRAME_RATE,
) -> Film:
    """Turn one record, or several side by side, into a film.

    Args:
        runs: The record or records; they start together.
        offset: How far apart they are drawn [m], to the right in the picture; or a vector [m].
            By default one and a half times the width of the vehicle; 0 lays them over each other.
        labels: Their names on the page; by default the controllers', with seeds where those
            are the same.
        rate: Frames in a second.

    Raises:
        InvalidInput: No record, one without a tick, or not one label a record.
    """
    records = [runs] if not isinstance(runs, Sequence) else list(runs)
    if not records or any(len(run) == 0 for run in records):
        raise InvalidInput("film", "runs", "is empty", "give at least one flown record")
    names = list(labels) if labels is not None else labels_of(records)
    if len(names) != len(records):
        raise InvalidInput(
            "film", "labels", f"has {len(names)} entries", f"give {len(records)}, one a record"
        )
    vehicles = [run.vehicle for run in records]
    around = [scenery(run, vehicle) for run, vehicle in zip(records, vehicles, strict=True)]
    steps = _spread(offset, vehicles, around[0].direction)
    parts = [
        VehicleScene(vehicle, name, number, step, around=near)
        for number, (vehicle, name, step, near) in enumerate(
            zip(vehicles, names, steps, around, strict=True), 1
        )
    ]
    longest = max(float(run.t[-1]) for run in records)
    rate = min(rate, MOST_FRAMES / max(longest, 1e-9))
    places = np.vstack([np.r_[run.pose[:, :3], run.reference_pose[:, :3]] for run in records])
    scene = Scene(parts, title(records), details(records), places, longest)
    reels = [Reel(run, part) for run, part in zip(records, parts, strict=True)]
    times = np.arange(int(np.floor(longest * rate + 1e-9)) + 1) / rate
    frames = np.stack([scene.frame(t, [reel.at(t) for reel in reels]) for t in times.tolist()])
    touched = {"touched": True} if any(run.script for run in records) else {}
    return Film(scene.spec(**touched), frames, rate)


def scenery(run: Run, vehicle: Vehicle) -> Scenery:
    """What stood around a vehicle in a record."""
    places = np.vstack([run.pose[:, :3], run.reference_pose[:, :3]])
    period = run.simulation.control_period
    return Scenery.of(run.scenario, vehicle, period, places, run.scene_joints)


def title(runs: Sequence[Run]) -> str:
    """Scenario and controllers."""
    scenarios = dict.fromkeys(run.scenario.name for run in runs)
    controllers = dict.fromkeys(run.controller for run in runs)
    return f"{', '.join(scenarios)} · {' and '.join(controllers)}"


def details(runs: Sequence[Run]) -> str:
    """Vehicles, weathers and seeds, each of them once."""
    vehicles = dict.fromkeys(run.metadata["vehicle"]["definition"]["name"] for run in runs)
    seeds: dict[str, dict[str, None]] = {}
    for run in runs:
        name, _, seed = weather_caption(run).partition(", seed ")
        seeds.setdefault(name, {})[seed] = None
    weathers = [f"{name}{_listed(known)}" for name, known in seeds.items()]
    ended = "" if not any(run.diverged for run in runs) else " · DIVERGED"
    return f"{', '.join(vehicles)} · {' and '.join(weathers)}{ended}"


def _listed(seeds: Iterable[str]) -> str:
    """The seeds as the end of a phrase: ", seeds 3 and 7"; nothing for calm weather."""
    known = [seed for seed in seeds if seed]
    return f", seed{'s' * (len(known) > 1)} {' and '.join(known)}" if known else ""


def labels_of(runs: Sequence[Run]) -> list[str]:
    """Names of records on the page: the controllers', with the seeds where that does not tell."""
    names = [run.controller for run in runs]
    if len(set(names)) == len(names):
        return names
    return [f"{run.controller}, seed {run.seed}" for run in runs]


def _spread(
    offset: float | Sequence[float] | None, vehicles: Sequence[Vehicle], direction: Array
) -> list[Array]:
    if offset is None:
        offset = 3.0 * max(shapes.reach(vehicle) for vehicle in vehicles)
    right = np.array([-direction[1], direction[0], 0.0]) / np.hypot(*direction[:2])
    step = np.array(offset, dtype=float) * (right if np.ndim(offset) == 0 else 1.0)
    if step.shape != (3,) or not np.all(np.isfinite(step)):
        raise InvalidInput("film", "offset", f"is {offset!r}", "give metres, or three of them")
    middle = 0.5 * (len(vehicles) - 1)
    return [(k - middle) * step for k in range(len(vehicles))]


class Reel:
    """Snapshots of a record at any time; after its end it stands still."""

    def __init__(self, run: Run, part: VehicleScene) -> None:
        """Derive what the record does not hold: joint accelerations, angles of the propellers."""
        vehicle, self._around = part.vehicle, part.around
        touched = {"contact_force": np.zeros((len(run), 3)), "hand": hand_forces(run)}
        self._columns = touched | run.columns
        self._t = run.t
        if len(run) > 1:
            self._acceleration = np.gradient(run.arm_rate, run.t, axis=0)
            steps = np.diff(run.t, prepend=run.t[0])[:, None]
        else:
            self._acceleration, steps = np.zeros_like(run.arm_rate), np.zeros((1, 1))
        self._spin = np.cumsum(steps * propeller_rates(vehicle, run.rotor_speeds), axis=0)

    def at(self, t: float) -> Snapshot:
        """The last tick at or before a time."""
        k = max(int(np.searchsorted(self._t, t + 1e-9, side="right")) - 1, 0)
        row = {name: column[k] for name, column in self._columns.items()}
        return Snapshot(
            pose=row["pose"],
            velocity=row["velocity"],
            arm=row["arm"],
            arm_rate=row["arm_rate"],
            arm_acceleration=self._acceleration[k],
            rotor_speeds=row["rotor_speeds"],
            rotor_wrench=row["rotor_wrench"],
            disturbance=row["disturbance"],
            target=row["reference_pose"],
            saturated=bool(row["saturated"]),
            spin=self._spin[k],
            u_dc=row["u_dc"],
            residual=row["residual"],
            hand=row["hand"],
            contact=row["contact_force"],
            carried=self._around.carried(k),
            scene=row.get("scene"),
        )


def propeller_rates(vehicle: Vehicle, speeds: Array) -> Array:
    """Rates at which propellers are drawn to turn [rad/s]; a drag torque opposes the turning."""
    top = np.where(vehicle.rotors.max_speeds > 0.0, vehicle.rotors.max_speeds, 1.0)
    return -SPIN_RATE * vehicle.rotors.spins * speeds / top
