"""A flight in real time: the simulation goes on by the clock, the page gets what it can take."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.exceptions import InvalidInput
from fullam.simulation.flight import Flight
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.weather import WEATHERS
from fullam.viz.viewer.replay import propeller_rates
from fullam.viz.viewer.scene import Scene, Snapshot, VehicleScene

if TYPE_CHECKING:
    from fullam.simulation.run import Run
    from fullam.viz.viewer.server import ViewerServer

Array = NDArray[np.float64]

MOST_FRAMES = 60.0
"""Frames sent in a second, at most."""

FEWEST_FRAMES = 5.0
"""Frames sent in a second, at least, even when the simulation lags behind the clock."""


@dataclass(frozen=True, eq=False)
class LiveReport:
    """How a live flight went.

    Attributes:
        run: The record.
        wall_time: How long it took [s].
        frames: Frames sent.
        latest: Largest lag of the simulation behind the clock [s].
    """

    run: Run
    wall_time: float
    frames: int
    latest: float

    @property
    def frame_rate(self) -> float:
        """Frames sent in a second."""
        return self.frames / max(self.wall_time, 1e-9)


class LiveFlight:
    """A plan that is flown while one looks.

    Attributes:
        flight: What is flown; it stands at the tick drawn last.
        scene: What is drawn.
    """

    def __init__(self, plan: FlightPlan) -> None:
        """Lay out the scene; nothing flies yet."""
        self.plan, self.flight = plan, Flight(plan)
        vehicle = plan.nominal
        self._vehicle = VehicleScene(plan.true, plan.controller)
        weather = next((name for name, w in WEATHERS.items() if w == plan.weather), "own")
        seed = "" if weather == "calm" else f", seed {plan.seed}"
        self.scene = Scene(
            [self._vehicle],
            f"{plan.scenario.name} · {plan.controller}",
            f"{vehicle.name} · {weather} weather{seed} · live",
            np.vstack([plan.asked.pose[:, :3], plan.scenario.initial_pose[:3]]),
            plan.scenario.duration,
        )
        self._shown = False
        self._spin, self._spun = np.zeros(vehicle.rotors.count), 0.0

    def show(self, server: ViewerServer) -> None:
        """Show the vehicle where it starts."""
        server.show(self.scene.spec())
        server.push(self.frame(-1))
        self._shown = True

    def frame(self, k: int) -> NDArray[np.float32]:
        """The frame after tick k, which has just been flown: the vehicle at the next one."""
        plan, flight = self.plan, self.flight
        pose, speeds = flight.pose, flight.rotor_speeds
        k = min(k + 1, plan.t.size - 1)
        t, row = float(plan.t[k]), plan.arm_row(k)
        self._spin += (t - self._spun) * propeller_rates(plan.true, speeds)
        self._spun = t
        R_WA = pin.Quaternion(pose[3:]).toRotationMatrix()
        wrench_A = plan.true.rotors.wrench(speeds)
        now = Snapshot(
            pose=pose,
            velocity=_turned(R_WA, flight.twist),
            arm=plan.arm.theta[row],
            arm_rate=plan.arm.dtheta[row],
            arm_acceleration=plan.arm.ddtheta[row],
            rotor_speeds=speeds,
            rotor_wrench=_turned(R_WA, wrench_A),
            disturbance=plan.forecast.disturbance[k],
            target=plan.asked.pose[k],
            saturated=flight.saturated,
            spin=self._spin,
        )
        return self.scene.frame(t, [now])

    def fly(
        self,
        server: ViewerServer,
        speed: float = 1.0,
        *,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], Any] = time.sleep,
    ) -> LiveReport:
        """Fly to the end, in real time, and show it.

        Each tick waits for its moment on the clock. If the simulation is late, frames are left
        out until it has caught up: time is kept, frames are dropped.

        Args:
            server: Where it is shown.
            speed: Seconds of flight in a second.
            clock: Seconds that pass.
            sleep: Waits so many seconds.

        Raises:
            InvalidInput: The speed is not above 0.
        """
        if not (np.isfinite(speed) and speed > 0.0):
            raise InvalidInput("live flight", "speed", f"is {speed!r}", "give a number above 0")
        if not self._shown:
            self.show(server)
        start = clock()
        due = drawn = start
        frames, latest, k = 0, 0.0, 0
        for k in self.flight.ticks():
            moment = start + float(self.plan.t[k]) / speed
            now = clock()
            if moment > now:
                sleep(moment - now)
            late = clock() - moment
            latest = max(latest, late)
            # On time, a frame is due sixty times a second; late, only now and then.
            ready = moment >= due and late < 1.0 / MOST_FRAMES
            if ready or clock() - drawn >= 1.0 / FEWEST_FRAMES:
                server.push(self.frame(k), drop=True)
                drawn = clock()
                due = max(due + 1.0 / MOST_FRAMES, moment)
                frames += 1
        if self.flight.ticks_flown:
            server.push(self.frame(self.flight.ticks_flown - 1))
        return LiveReport(self.flight.run(), clock() - start, frames + 1, latest)


def _turned(R_WA: Array, twist: Array) -> Array:
    """Both halves of a 6-vector, from body to world axes."""
    return np.concatenate([R_WA @ twist[:3], R_WA @ twist[3:]])
