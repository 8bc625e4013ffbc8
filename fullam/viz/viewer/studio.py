"""`fullam.fly`: a flight in the hand, which can show itself on a page where it can be touched."""

from __future__ import annotations

import threading
from typing import Unpack

from fullam.model.vehicle import Vehicle
from fullam.simulation.hands.free import plan_of
from fullam.simulation.hands.interactive import InteractiveFlight
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.simulate import Choices
from fullam.viz.viewer.frame import frame_html
from fullam.viz.viewer.live import LiveFlight
from fullam.viz.viewer.server import ViewerServer


class Studio:
    """A flight on a page, flown by a thread of its own; the last expression of a cell shows it.

    Page and notebook have their hands on the same flight: what one does, the other sees.

    Attributes:
        live: The flight as it is shown.
        server: Serves the page to this machine only.
        height: Of the notebook cell [px].
    """

    def __init__(
        self, flight: InteractiveFlight, height: int = 560, port: int | None = None
    ) -> None:
        """Start to serve; the flight stands until somebody lets it play."""
        self.height = height
        self.live = LiveFlight(flight, playing=False)
        # A notebook's page may come through its server, under that one's name.
        self.server = ViewerServer(port, hosts=("*",))
        self.live.show(self.server)
        self._thread = threading.Thread(target=self._fly, daemon=True)
        self._thread.start()

    def _fly(self) -> None:
        self.live.fly(self.server, stay=True)

    @property
    def flight(self) -> InteractiveFlight:
        """What flies; another one after a restart."""
        return self.live.flight

    @property
    def url(self) -> str:
        """Address of the page, for a browser of this machine."""
        return self.server.url

    def play(self, speed: float = 1.0) -> None:
        """Let it fly by the clock, `speed` seconds in a second."""
        self.live.orders.hear({"do": "speed", "value": speed})
        self.live.orders.hear({"do": "play"})

    def pause(self) -> None:
        """Let it stand."""
        self.live.orders.hear({"do": "pause"})

    def close(self) -> None:
        """End the thread and the server."""
        self.live.transport.quit = True
        self._thread.join(5.0)
        self.server.close()

    def _repr_html_(self) -> str:
        """The page in a frame of its own."""
        return frame_html(self.server, self.height)

    def __repr__(self) -> str:
        """What flies, and where it can be seen."""
        return f"<Studio of {self.flight.plan.scenario.name} at {self.url}: .play(), .close()>"


class StudioFlight(InteractiveFlight):
    """A flight in the hand that can show itself."""

    def view(self, height: int = 560, port: int | None = None) -> Studio:
        """Show it on a page where it can be touched; in a notebook, as the last of a cell.

        Args:
            height: Of the cell [px].
            port: The server's port; by default the first free one.
        """
        return Studio(self, height, port)


def fly(
    subject: Vehicle | Scenario | str = "fullam",
    controller: str | None = None,
    *,
    duration: float | None = None,
    **choices: Unpack[Choices],
) -> StudioFlight:
    """A flight in the hand, standing at its start: fly it on, touch it, go back, fly on otherwise.

        flight = fullam.fly("fullam")
        flight.target = [0.5, 0.0, 1.5]
        flight.advance(2.0)
        flight.push([3.0, 0.0, 0.0], at="tool", duration=1.0)
        flight.advance(3.0)
        run = flight.record            # `fullam.refly(run)` gives it again, bit for bit
        flight.view()                  # the same on a page

    Args:
        subject: A vehicle, its name or path, for a free flight; or a scenario or its name.
        controller: Name of a registered controller; by default the scenario's, in free flight
            dc-PID.
        duration: When it ends at the latest [s]; 300 by default in free flight. `run()` flies on
            till then.
        **choices: As in `simulate`; free flight is in calm air unless `weather` says otherwise.

    Raises:
        FullamError: As `simulate`.
    """
    return StudioFlight(plan_of(subject, controller, duration, **choices))
