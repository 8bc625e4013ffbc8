"""`fullam view` and `fullam plot`."""

from __future__ import annotations

import argparse
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from fullam.cli import options
from fullam.cli.output import progress, say
from fullam.cli.verbs import FAILED, OK, argument, verb

if TYPE_CHECKING:
    from fullam.simulation.flight_plan import FlightPlan
    from fullam.simulation.record.run import Run
    from fullam.viz.viewer.replay import Film
    from fullam.viz.viewer.server import ViewerServer

SERVER = (
    argument("--open", action="store_true", help="open the page in the default browser"),
    argument(
        "--port", type=options.port, metavar="N", help="(default: the first free one from 7000)"
    ),
    argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="listen there, 0.0.0.0 for everywhere; whoever has the page's address can then steer "
        "the flight from another machine, and nothing is encrypted (default: this machine only)",
    ),
    argument(
        "--allow-host",
        action="append",
        default=[],
        metavar="NAME",
        help="a name under which a proxy asks for the page, * for any; may be repeated",
    ),
    argument("--save", type=options.run_path, metavar="FILE", help="keep the record (.npz)"),
)


speed = options.between(1e-3, 1e3, "speed, from")
distance = options.between(-1e4, 1e4, "distance in m, from")
seconds = options.between(0.0, 1e5, "time in s, from")
duration = options.between(0.1, 1e4, "time in s, from")


@verb(
    "view",
    argument("target", nargs="+", metavar="WHAT", help="a scenario, or one or more run files"),
    *options.LAW,
    *options.FLIGHT,
    argument("--speed", type=speed, default=1.0, metavar="X", help="of the live flight (1)"),
    argument("--offset", type=distance, metavar="M", help="between flights side by side [m]"),
    *SERVER,
    argument("--wait", type=seconds, default=10.0, metavar="S", help="for a page to open (10)"),
    argument("--once", action="store_true", help="stop when the live flight is over"),
    argument("--html", type=Path, metavar="FILE", help="write a page that plays offline"),
    argument("--png", type=Path, metavar="FILE", help="write a still (needs Chromium)"),
    argument("--gif", type=Path, metavar="FILE", help="write an animation (needs Chromium)"),
    argument("--at", type=seconds, metavar="S", help="when the still is taken (half-way)"),
)
def view_flight(arguments: argparse.Namespace) -> int:
    """See a flight in three dimensions.

    A scenario is flown in real time while you look: the page's address is printed, the flight
    starts when the page is open or after --wait seconds, and when it is over the page replays it.
    Run files (.npz) are replayed, several of them side by side. With --html, --png or --gif
    nothing is served: the flight is written to those files. Ctrl-C stops.

    The vehicle can be touched while it flies: pulled with the mouse, its target dragged, its law
    and weather switched, rotors stopped; and a moment that has been flown can be gone back to.

    The page is served to this machine only; its address holds a secret, and whoever has it can
    touch the flight. From elsewhere use a tunnel: ssh -L 7000:127.0.0.1:7000 HOST.
    """
    records = [name for name in arguments.target if name.endswith(".npz")]
    if len(records) < len(arguments.target) and len(arguments.target) > 1:
        from fullam.exceptions import InvalidInput

        raise InvalidInput(
            "fullam view",
            "WHAT",
            f"is {' '.join(arguments.target)}",
            "give one scenario, or run files (.npz) alone",
        )
    if not records and not (arguments.html or arguments.png or arguments.gif):
        return _fly_live(arguments)
    from fullam.simulation.record.run import Run
    from fullam.viz.viewer.replay import film

    runs = [Run.load(path) for path in records] or [_fly(arguments)]
    shown = film(runs, offset=arguments.offset)
    if arguments.html or arguments.png or arguments.gif:
        _export(shown, arguments)
    else:
        with _server(arguments) as server:
            server.play(shown)
            _announce(server, arguments)
            _until_interrupted()
    return FAILED if any(run.diverged for run in runs) else OK


def _fly(arguments: argparse.Namespace) -> Run:
    from fullam.cli.flying import flown

    run, _ = flown(_prepared(arguments))
    return run


def _prepared(arguments: argparse.Namespace) -> FlightPlan:
    from fullam.cli.flying import prepared
    from fullam.simulation.scenarios.scenario import load_scenario

    scenario = load_scenario(arguments.target[0])
    as_run_has_them = argparse.Namespace(**vars(arguments), scenario=scenario)
    return prepared(as_run_has_them, *options.law(arguments, scenario.controller))


def _fly_live(arguments: argparse.Namespace) -> int:
    return _show_live(_prepared(arguments), arguments)


def _show_live(plan: FlightPlan, arguments: argparse.Namespace) -> int:
    """Fly a plan on a page until it is over, or, unless --once, until Ctrl-C."""
    from fullam.viz.viewer.live import LiveFlight

    live = LiveFlight(plan)
    with _server(arguments) as server:
        live.show(server)
        _announce(server, arguments)
        try:
            server.wait_for_page(arguments.wait)
            report = live.fly(server, arguments.speed, stay=not arguments.once)
        except KeyboardInterrupt:
            if arguments.save and live.flight.period > 1:
                say(f"run saved to {live.flight.record.save(arguments.save)}")
            return OK
        run = report.run
        say(
            f"{run.scenario.name}, {run.controller}: {run.t[-1]:.2f} s flown in "
            f"{report.wall_time:.2f} s, {report.frame_rate:.0f} frames/s, at most "
            f"{1000.0 * report.latest:.0f} ms late, {run.outcome}"
        )
        if arguments.save:
            say(f"run saved to {run.save(arguments.save)}")
    return FAILED if run.diverged else OK


@verb(
    "fly",
    argument(
        "subject",
        metavar="WHAT",
        help="a vehicle, its name (see `fullam list`) or TOML file; or the name of a scenario",
    ),
    *options.LAW,
    *[flag for flag in options.FLIGHT if flag[0][0] not in ("--vehicle", "--shape")],
    argument("--speed", type=speed, default=1.0, metavar="X", help="seconds in a second (1)"),
    argument(
        "--duration", type=duration, default=300.0, metavar="S", help="longest flight [s] (300)"
    ),
    *SERVER,
    argument("--wait", type=seconds, default=10.0, metavar="S", help="for a page to open (10)"),
    argument("--once", action="store_true", help="stop when the flight is over"),
)
def fly_free(arguments: argparse.Namespace) -> int:
    """Fly a vehicle by hand.

    It hovers, in calm air unless --weather says otherwise, until you touch it on the page whose
    address is printed: pull it with the mouse, drag its target, move its arm, switch its law, stop
    a rotor, go back in time and fly on otherwise. A scenario, such as push-wall, is flown in its
    own weather, its world and on its plant, and goes on when it would have ended. With --save the
    record is kept at the end (Ctrl-C), with all that was done; `fullam view FILE` replays it.

    The page is served to this machine only; its address holds a secret, and whoever has it can
    touch the flight. From elsewhere use a tunnel: ssh -L 7000:127.0.0.1:7000 HOST.
    """
    from fullam.simulation.hands.free import plan_of
    from fullam.simulation.scenarios.scenario import load_scenario, scenario_names

    simulation = options.simulation_settings(arguments)
    simulation.check_length(arguments.duration)
    subject, default = arguments.subject, options.DEFAULT
    if subject in scenario_names():
        default = load_scenario(subject).controller
    controller, settings = options.law(arguments, default)
    plan = plan_of(
        subject,
        controller,
        arguments.duration,
        seed=arguments.seed,
        failed=arguments.failed,
        calm=arguments.calm,
        weather=arguments.weather,
        settings=settings,
        simulation=simulation,
    )
    return _show_live(plan, arguments)


def _server(arguments: argparse.Namespace) -> ViewerServer:
    from fullam.viz.viewer.server import ViewerServer

    return ViewerServer(arguments.port, arguments.host, arguments.allow_host)


def _announce(server: ViewerServer, arguments: argparse.Namespace) -> None:
    import sys

    from fullam.viz.viewer.server import LOOPBACK

    if arguments.host in LOOPBACK:
        say(f"open {server.url} (this machine only; Ctrl-C stops)")
    else:
        say(
            f"open {server.url} (also from other machines: whoever has this address, or listens "
            "on the network, can touch the flight; Ctrl-C stops)"
        )
    sys.stdout.flush()
    if arguments.open:
        import webbrowser

        webbrowser.open(server.url)


def _until_interrupted() -> None:
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        return


def _export(film: Film, arguments: argparse.Namespace) -> None:
    from fullam.viz.viewer import export

    if arguments.html:
        say(f"page saved to {export.write_html(film, arguments.html)}")
    if arguments.png:
        say(f"still saved to {export.write_png(film, arguments.png, arguments.at)}")
    if arguments.gif:
        with progress("animation") as show:
            path = export.write_gif(film, arguments.gif, progress=show)
        say(f"animation saved to {path}")


@verb(
    "plot",
    argument("run", metavar="FILE", help="a run file (.npz)"),
    argument(
        "--what",
        type=options.names,
        default=["overview"],
        metavar="A,B,...",
        help="panels: pose, attitude, errors, rotors, effort, wrench, command, compensation, "
        "residual, and on servos contact, joints, torques; or overview, all on one page (default)",
    ),
    argument(
        "--out", type=options.figure_path, required=True, metavar="FILE", help=".png, .pdf or .svg"
    ),
)
def plot_run(arguments: argparse.Namespace) -> int:
    """Draw a record.

    Panels stand under each other over one time axis, half a column wide; the suffix of the file
    chooses the format.
    """
    from fullam.simulation.record.run import Run
    from fullam.viz.figures import overview, save_figure
    from fullam.viz.panels import plot

    run = Run.load(arguments.run)
    whole = arguments.what == ["overview"]
    figure = overview(run) if whole else plot(run, arguments.what)
    say(f"figure saved to {save_figure(figure, arguments.out)}")
    return OK
