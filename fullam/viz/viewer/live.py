"""A flight in real time: it goes on by the clock, the page gets what it can take, hands are heard.

One thread flies. Whatever a page, a notebook or a test wants is put in a queue from any thread and
done by that one between two control periods; nobody who speaks or listens makes the flight wait.
"""

from __future__ import annotations

import contextlib
import gc
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fullam.analysis.atlas.envelope import Envelope
from fullam.exceptions import FullamError, InvalidInput
from fullam.numbers.blas import one_blas_thread
from fullam.numbers.records import flat
from fullam.simulation.flight_plan import FlightPlan
from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.weather import WEATHERS
from fullam.viz.viewer.orders import Orders, Transport
from fullam.viz.viewer.replay import propeller_rates
from fullam.viz.viewer.scene import Scene, VehicleScene
from fullam.viz.viewer.scenery import Scenery
from fullam.viz.viewer.snapshot import Snapshot

if TYPE_CHECKING:
    from fullam.simulation.record.run import Run
    from fullam.viz.viewer.server import ViewerServer

Array = NDArray[np.float64]

MOST_FRAMES = 60.0
"""Frames sent in a second, at most."""

FEWEST_FRAMES = 5.0
"""Frames sent in a second, at least, even when the simulation lags behind the clock."""

LATEST = 1.5
"""Farther behind the clock than this the flight does not try to catch up [s]."""

SLOW = (
    "this machine computes the flight more slowly than the clock goes: time is stretched "
    "(joints on servos cost Python the most; --plant-rate 500 halves it)"
)
"""What a page is told of a flight that falls behind."""

IMPATIENCE = 0.0005
"""How long the server's thread may go on once the flight's wants to [s]; Python's own 5 ms, at each
of a tick's waits for the interpreter, are as much as a frame when many connections come at once."""

IDLE = 0.008
"""Time between two looks at what hands want, while nothing flies [s]."""


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
    """A flight that goes on while one looks and touches.

    Attributes:
        flight: What is flown; it stands at the tick drawn last.
        transport: Whether it plays, how fast, and which moment of the past is looked at.
        orders: What pages ask for.
        scene: What is drawn.
    """

    def __init__(self, flight: FlightPlan | InteractiveFlight, playing: bool = True) -> None:
        """Lay out the scene; nothing flies yet.

        Args:
            flight: A plan, or a flight that somebody else may have a hand on, too.
            playing: Whether it plays as soon as `fly` is called.
        """
        if isinstance(flight, FlightPlan):
            flight = InteractiveFlight(flight)
        self.transport = Transport(playing)
        self.orders = Orders(self)
        self._shown = False
        self.take(flight)

    def take(self, flight: InteractiveFlight) -> None:
        """Have this flight in the scene from now on."""
        self.flight = flight
        plan, vehicle = flight.plan, flight.plan.nominal
        places = np.vstack([plan.asked.pose[:, :3], plan.scenario.initial_pose[:3]])
        period, joints = plan.simulation.control_period, flight.flight.block.plant.scene
        around = Scenery.of(plan.scenario, vehicle, period, places, joints)
        self._vehicle = VehicleScene(plan.true, plan.controller, around=around)
        try:
            self._vehicle.forces = Envelope.of(vehicle, plan.arm.theta[0])
        except FullamError:  # one of these rotors cannot be told what it is asked
            self._vehicle.forces = None
        weather = next((name for name, w in WEATHERS.items() if w == plan.weather), "own")
        seed = "" if weather == "calm" else f", seed {plan.seed}"
        self.scene = Scene(
            [self._vehicle],
            f"{plan.scenario.name} · {plan.controller}",
            f"{vehicle.name} · {weather} weather{seed} · live",
            places,
            plan.scenario.duration,
        )
        self._spin, self._spun = np.zeros(vehicle.rotors.count), 0.0

    def show(self, server: ViewerServer, **more: Any) -> None:
        """Show the vehicle where it is; pages may ask for things from now on."""
        server.show(self.scene.spec(live=self.orders.choices(), **more))
        server.push(self.frame())
        server.hear = self.orders.hear
        server.tell(self.orders.status())
        self._shown = True

    def frame(self) -> NDArray[np.float32]:
        """The frame of the moment that is looked at: now, or one of the past."""
        past = self.transport.past
        if past is not None and past < self.flight.period:
            return self._past_frame(past)
        with self.flight.lock:
            return self._frame()

    def _frame(self) -> NDArray[np.float32]:
        plan, live, flight = self.flight.plan, self.flight, self.flight.flight
        pose, speeds, look = flight.pose, flight.rotor_speeds, flight.lists.of
        arm, arm_rate, arm_acceleration = live.arm
        block, t = flight.block, live.time
        R_WA = pin.Quaternion(pose[3:]).toRotationMatrix()
        k = min(live.period, len(plan.t) - 1)
        now = Snapshot(
            pose=pose,
            velocity=_turned(R_WA, flight.twist),
            arm=arm,
            arm_rate=arm_rate,
            arm_acceleration=arm_acceleration,
            rotor_speeds=speeds,
            rotor_wrench=_turned(R_WA, plan.true.rotors.wrench(speeds)),
            disturbance=live.load(k),
            target=live.target,
            saturated=flight.saturated,
            spin=self._spun_to(t, speeds),
            u_dc=np.array([*flat(look(block.command)[0].u_dc)]),
            residual=np.array([*flat(look(block.residual)[0])]),
            hand=np.array([*live.felt.foot, *live.felt.pull]),
            contact=live.contact,
            carried=self._vehicle.around.carried(k),
            scene=live.scene,
        )
        return self.scene.frame(t, [now])

    def _past_frame(self, k: int) -> NDArray[np.float32]:
        row, t = self.flight.row(k), float(self.flight.plan.t[k])
        now = Snapshot(
            pose=row["pose"],
            velocity=row["velocity"],
            arm=row["arm"],
            arm_rate=row["arm_rate"],
            arm_acceleration=np.zeros_like(row["arm"]),
            rotor_speeds=row["rotor_speeds"],
            rotor_wrench=row["rotor_wrench"],
            disturbance=row["disturbance"],
            target=row["reference_pose"],
            saturated=bool(row["saturated"]),
            spin=self._spun_to(t, row["rotor_speeds"]),
            u_dc=row["u_dc"],
            residual=row["residual"],
            contact=row.get("contact_force", np.zeros(3)),
            carried=self._vehicle.around.carried(k),
            scene=row.get("scene"),
        )
        return self.scene.frame(t, [now])

    def _spun_to(self, t: float, speeds: Array) -> Array:
        self._spin += (t - self._spun) * propeller_rates(self.flight.plan.true, speeds)
        self._spun = t
        return self._spin

    def fly(
        self,
        server: ViewerServer,
        speed: float = 1.0,
        *,
        stay: bool = False,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], Any] = time.sleep,
    ) -> LiveReport:
        """Fly to the end, in real time, and show it.

        Each tick waits for its moment on the clock. If the simulation is late, frames are left
        out until it has caught up: time is kept, frames are dropped.

        Args:
            server: Where it is shown.
            speed: Seconds of flight in a second; a page may change it.
            stay: Stay when the flight is over, to be rewound, until `transport.quit`.
            clock: Seconds that pass.
            sleep: Waits so many seconds.

        Raises:
            InvalidInput: The speed is not above 0.
        """
        if not (np.isfinite(speed) and speed > 0.0):
            raise InvalidInput("live flight", "speed", f"is {speed!r}", "give a number above 0")
        self.transport.speed = speed
        if not self._shown:
            self.show(server)
        with _undisturbed():
            return self._fly(server, _Pace(server, self, clock, sleep), stay)

    def _fly(self, server: ViewerServer, pace: _Pace, stay: bool) -> LiveReport:
        start = pace.clock()
        while not self.transport.quit:
            self.orders.obey(server, pace)
            if self.transport.playing and self._step():
                pace.keep()
            elif not (stay or not self.transport.playing):
                break
            else:
                self._stand(server, pace)
        if self.flight.period:
            server.push(self.frame())
        wall = pace.clock() - start
        return LiveReport(self.flight.record, wall, pace.frames + 1, pace.latest)

    def _step(self) -> bool:
        # Not for as long as the page is open: a notebook computes other things beside it.
        with one_blas_thread():
            return self.flight.step()

    def _stand(self, server: ViewerServer, pace: _Pace) -> None:
        """Nothing flies; somebody else may have flown on, and hands may want something."""
        period = self.flight.period  # before it is drawn: it may go on meanwhile
        if self.transport.playing:  # it has come to its end
            self.transport.playing = False
            server.push(self.frame())
            server.tell(self.orders.status())
        elif pace.shown != period:
            server.push(self.frame())  # none follows that would make up for a dropped one
            server.tell(self.orders.status())
        pace.shown = period
        pace.rebase()
        pace.sleep(IDLE)


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Keep the interpreter from holding a flight up.

    The server's thread hands over at once, and the collector of cycles leaves alone what is there
    already: going through all of a numba and a Pinocchio takes it 100 ms.
    """
    interval, frozen = sys.getswitchinterval(), gc.get_freeze_count()
    sys.setswitchinterval(IMPATIENCE)
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        sys.setswitchinterval(interval)
        if not frozen:
            gc.unfreeze()


class _Pace:
    """The clock of a live flight: waits for each tick's moment, and sends frames when they are due.

    Attributes:
        clock: Seconds that pass.
        sleep: Waits so many seconds.
        frames: Frames sent.
        latest: Largest lag behind the clock [s].
        shown: Period that was drawn last.
    """

    def __init__(
        self,
        server: ViewerServer,
        live: LiveFlight,
        clock: Callable[[], float],
        sleep: Callable[[float], Any],
    ) -> None:
        self._server, self._live, self.clock, self.sleep = server, live, clock, sleep
        self.frames, self.latest, self.shown = 0, 0.0, -1
        self._told, self._slow = 0.0, False
        self.rebase()

    def rebase(self) -> None:
        """Begin to count here and now."""
        self._start = self._due = self._drawn = self.clock()
        self._first = self._live.flight.period

    def keep(self) -> None:
        """Wait for the moment of the tick that was just flown, and draw it if a frame is due."""
        live, clock = self._live, self.clock
        ticks = live.flight.period - 1 - self._first
        period = live.flight.plan.simulation.control_period
        moment = self._start + ticks * period / live.transport.speed
        now = clock()
        if moment > now:
            self.sleep(moment - now)
        late = clock() - moment
        self.latest = max(self.latest, late)
        # On time, a frame is due sixty times a second; late, only now and then.
        ready = moment >= self._due and late < 1.0 / MOST_FRAMES
        if ready or clock() - self._drawn >= 1.0 / FEWEST_FRAMES:
            self._server.push(live.frame(), drop=True)
            self._drawn = clock()
            self._due = max(self._due + 1.0 / MOST_FRAMES, moment)
            self.frames += 1
            self.shown = live.flight.period
            if moment - self._told > 0.25:
                self._told = moment
                self._server.tell(live.orders.status())
        if late > LATEST:
            if not self._slow:
                self._slow = True
                self._server.tell({"note": SLOW})
            self.rebase()


def _turned(R_WA: Array, twist: Array) -> Array:
    """Both halves of a 6-vector, from body to world axes."""
    return np.concatenate([R_WA @ twist[:3], R_WA @ twist[3:]])
