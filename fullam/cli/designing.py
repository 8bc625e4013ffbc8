"""`fullam design`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fullam.cli import options
from fullam.cli.output import number, progress, say, say_json, table
from fullam.cli.verbs import FAILED, OK, argument, verb

if TYPE_CHECKING:
    from fullam.analysis.design_search import DesignSearch, Found
    from fullam.model.vehicle import Vehicle


def vehicle_file(text: str) -> Path:
    """A path for the vehicle, checked before the search rather than after it."""
    if Path(text).suffix != ".toml":
        raise argparse.ArgumentTypeError(f"'{text}' does not end in .toml")
    return Path(text)


rotors = options.whole(4, 1000, "number of rotors, from")
period = options.whole(0, 1000, "whole number, from")
reserve = options.between(1.0, 100.0, "ratio, from")
efficiency = options.between(0.0, 1.0, "efficiency, from")
angle = options.between(0.0, 180.0, "angle, from")
starts = options.whole(1, 1000, "number of starts, from")
entry = options.between(-1e4, 1e4, "number, from")


def numbers(text: str) -> tuple[float, ...]:
    """Numbers separated by commas."""
    return tuple(entry(part) for part in text.split(","))


@verb(
    "design",
    argument("base", nargs="?", default="fullam", metavar="VEHICLE", help="(default: fullam)"),
    argument("--rotors", type=rotors, metavar="N", help="how many (default: the vehicle's)"),
    argument("--objective", default="worst-tilt", metavar="NAME",
             help="worst-tilt, level-force, failure-tilt, failure-margin or efficiency"),
    argument("--free", type=options.names, default=["cants", "leans"], metavar="A,B",
             help="of azimuths, radii, heights, cants, leans (default: cants,leans)"),
    argument("--period", type=period, default=0, metavar="N",
             help="rotors repeat after N (0: all may differ; 2: as in the alternating ring)"),
    argument("--reserve", type=reserve, default=1.5, metavar="X", help="thrust to weight (1.5)"),
    argument("--min-efficiency", type=efficiency, default=0.0, metavar="X",
             help="at hover, 0 to 1"),
    argument("--min-tilt", type=angle, default=0.0, metavar="DEG", help="worst tilt kept"),
    argument("--arm", type=numbers, metavar="A,B,..", help="arm pose [deg] (none: centred)"),
    argument("--evaluations", type=options.runs, default=6000, metavar="N", help="a start (6000)"),
    argument("--starts", type=starts, default=3, metavar="N", help="the ring, and random ones (3)"),
    argument("--seed", type=options.seed, default=0, metavar="N", help="of the search (0)"),
    argument("--out", type=vehicle_file, metavar="FILE", help="write the vehicle (.toml, .urdf)"),
    argument("--pareto", type=numbers, metavar="X,Y,..", help="a search at each least efficiency"),
    options.FIGURE,
    options.JSON,
)  # fmt: skip
def design(arguments: argparse.Namespace) -> int:
    """Search for a better place and direction of every rotor.

    The result is compared with the best uniform ring under the same constraints. --out writes a
    vehicle that flies at once: `fullam run task-2 --vehicle FILE`, `fullam datasheet FILE`. With
    --pareto the search is repeated for several hover efficiencies, and --figure draws the front.
    Exit code 1 says that the constraints were not met.
    """
    from fullam.analysis.design_search import DesignSearch, pareto_front
    from fullam.model.design import design_vehicle

    search = DesignSearch(
        objective=arguments.objective,
        free=tuple(arguments.free),
        period=arguments.period,
        reserve=arguments.reserve,
        min_efficiency=arguments.min_efficiency,
        min_tilt=arguments.min_tilt,
        arm_deg=arguments.arm,
        evaluations=arguments.evaluations,
        starts=arguments.starts,
        seed=arguments.seed,
    )
    changes: dict[str, Any] = {} if arguments.rotors is None else {"rotor_count": arguments.rotors}
    vehicle = design_vehicle(arguments.base, **changes)
    with progress("design") as show:
        if arguments.pareto:
            front = pareto_front(vehicle, search, arguments.pareto, show)
        else:
            front = [search.run(vehicle, show)]
    if arguments.figure:
        from fullam.viz.design_figures import figure_front
        from fullam.viz.figures import save_figure

        save_figure(figure_front(front), arguments.figure)
    if arguments.json:
        say_json([_figures(found) for found in front] if arguments.pareto else _figures(front[0]))
    else:
        _say(front, search)
    if arguments.out:
        _write(arguments, front[-1], changes)
    return OK if all(found.feasible for found in front) else FAILED


def _write(arguments: argparse.Namespace, found: Found, changes: dict[str, Any]) -> Vehicle:
    from fullam.model.design import design_vehicle
    from fullam.model.writing import write_vehicle

    name = arguments.out.stem
    vehicle = design_vehicle(arguments.base, name=name, **{**changes, **found.changes})
    write_vehicle(vehicle, arguments.out)
    if not arguments.json:
        say(f"\n{arguments.out}")
    return vehicle


def _figures(found: Found) -> dict[str, Any]:
    return {
        "objective": found.search.objective,
        "feasible": found.feasible,
        "found": found.best.merit.to_dict(),
        "uniform_ring": found.ring.merit.to_dict(),
        "uniform_ring_cant_deg": abs(float(found.ring.rows[0, 3])),
        "gain": found.gain,
        "evaluations": found.evaluations,
        "rotor_rows": found.best.rows.tolist(),
    }


def _say(front: list[Found], search: DesignSearch) -> None:
    for found in front:
        best, ring = found.best.merit.to_dict(), found.ring.merit.to_dict()
        rows = [[key.replace("_", " "), number(best[key], 3), number(ring[key], 3)] for key in best]
        cant = abs(float(found.ring.rows[0, 3]))
        say(table(rows, ["", "found", f"uniform ring, {cant:.1f} deg"]))
        say(f"\n{search.objective}: {found.gain:+.3f} against the ring; "
            f"{found.evaluations} layouts tried")  # fmt: skip
        if not found.feasible:
            say("the constraints are NOT met")
        say("")
    rows = [[f"{k + 1}", *(f"{x:.3f}" for x in row)] for k, row in enumerate(front[-1].best.rows)]
    say(table(rows, ["rotor", "azimuth", "radius", "height", "cant", "lean"]))
