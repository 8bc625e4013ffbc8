"""Motions that are wrong on purpose: CSV files, splines, tool tasks, sensors; alone and in TOML."""

from __future__ import annotations

import functools
import json
from dataclasses import replace
from typing import Any

import numpy as np
from answers import answered, folder, whole_run
from hypothesis import strategies as st
from values import NUMBERS, TEXTS, damaged, document, mostly, toml_values, torn

import fullam
from fullam.simulation.motions.joint_trajectory import JointTrajectory
from fullam.simulation.motions.trajectory import Trajectory
from fullam.simulation.scenarios.scenario import Scenario, load_scenario

TIMES, POINTS = (0.0, 1.0, 2.0), ((0, 0, 1), (1, 0, 1), (1, 1, 1))
THROUGH = {"waypoints": POINTS, "times": TIMES, "euler_deg": ((0, 0, 0), (0, 5, 9), (0, 0, 0))}
ANGLES = ((-90, 0, -45, 0), (-80, 5, -40, 9), (-90, 0, -45, 0))
JOINTS = {"waypoints_deg": ANGLES, "times": TIMES}
TOOL = {"attitude": "fixed", "priority": "strict", "at": 0.0, "max_speed": 1.0}
SOLD = json.loads(json.dumps(fullam.weather("sold").to_dict()))

WHOLE: tuple[dict[str, Any], ...] = (
    {"reference": {"kind": "minimum-snap", **THROUGH}, "weather": SOLD},
    {"reference": {"kind": "minimum-snap", "waypoints": POINTS, "speed": 1.0, "at": 0.0}},
    {"reference": {"kind": "b-spline", **THROUGH, "degree": 3, "at": 0.0}},
    {"reference": {"kind": "csv", "path": "m.csv", "degree": 3, "ends": "free", "at": 0.0}},
    {"arm_motion": {"kind": "csv", "path": "m.csv", "degree": 3, "ends": "rest"}},
    {"arm_motion": {"kind": "minimum-snap", **JOINTS, "at": 0.0}},
    {"arm_motion": {"kind": "b-spline", **JOINTS, "degree": 5, "joints": []}},
    {"tool": {"path": {"kind": "circle", "radius": 0.1, "rounds": 1.0}, **TOOL}},
    {"tool": {"path": {"kind": "square", "side": 0.1, "normal": [1, 0, 0]}, "weights": {}}},
    {"tool": {"path": {"kind": "line", "to": [0.1, 0, 0]}, "euler_deg": [0, 0, 9]}},
    {"tool": {"path": {"kind": "minimum-snap", **THROUGH}, "attitude": "free"}},
    {"tool": {"path": {"kind": "csv", "path": "m.csv"}}},
    *(
        json.loads(json.dumps(load_scenario(name).to_dict()))
        for name in ("draw-circle", "push-wall", "slide-wall", "pick-and-place")
    ),
    {"world": [{"kind": "sphere", "center": [0.4, 0, 0.8], "radius": 0.2, "friction": 0.3}]},
    json.loads(
        json.dumps(
            Scenario(
                "both",
                reference=Trajectory.minimum_snap(**THROUGH),
                arm_motion=JointTrajectory.b_spline(**JOINTS),
                initial_arm_deg=ANGLES[0],
            ).to_dict()
        )
    ),
)  # fmt: skip
"""Scenarios of every kind of motion; each has a name and the arm where it begins."""

SPOILED = (*map(str, NUMBERS[:9]), *(repr(n) for n in NUMBERS if isinstance(n, float)), *TEXTS)
HEADERS = (
    *("t", "t [s]", "t_ms", "x", "x [mm]", "y_cm", "z", "phi_deg", "psi [rad]", "gamma", "qx"),
    *("qw", "vx", "vz_m_s", "joint_1_deg", "joint_2 [m]", "joint_3_rad", "x []", "[", "x [m", ""),
    *("t [deg]", "x (furlong)", "joint_99_deg", "_m", '"x"', "\x1b[31m"),
)
WHOLE_CSV = tuple(
    "\n".join([header, *(row + ",0" * (header.count(",") - row.count(",")) for row in rows)])
    for header, rows in (
        ("t,x,y,z", ("0,0,0,1", "1,0,0,1.5", "2,1,0,1")),
        ("t [s],x [mm],y [m],z_cm,phi_deg,psi_rad,gamma [deg]", ("0,0,0,1", "1,0,0,1.5")),
        ("t,x,y,z,qw,qx,qy,qz", ("0,0,0,1,1", "1,0,0,1.5,1", "2,1,0,1,1")),
        ("t,x,y,z,vx,vy,vz", ("0,0,0,1,0", "1,0,0,1.5,1", "2,1,0,1,0")),
        ("t,joint_1_deg,joint_2_deg,joint_3_rad,joint_4_deg", ("0,0,0,1", "1,0,0,1.5", "2,1")),
    )
)


@st.composite
def tables(draw: st.DrawFn) -> bytes:
    """A CSV file with one to three cells, lines or headers that are not what they should be."""
    rows = [line.split(",") for line in draw(st.sampled_from(WHOLE_CSV)).splitlines()]
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(rows) - 1))
        row = rows[at]
        cell = draw(st.integers(0, max(0, len(row) - 1)))
        match draw(
            st.sampled_from((*["cell"] * 4, *["header"] * 2, "add", "cut", "double", "row"))
        ):
            case "cell" if row:
                row[cell] = draw(st.one_of(st.sampled_from(SPOILED), st.floats(-9, 9).map(repr)))
            case "header" if len(rows[0]) > cell:
                rows[0][cell] = draw(st.sampled_from(HEADERS))
            case "add":
                row.append(draw(st.sampled_from(SPOILED)))
            case "cut":
                del row[cell:]
            case "double":
                rows.insert(at, list(row))
            case "row":
                rows[at] = [draw(st.sampled_from(("# no", "", ",,,", '"', "t" * 200_000)))]
    separator, end = draw(st.sampled_from((",", ",", ";", "\t"))), draw(st.sampled_from("\n\r"))
    text = end.join(separator.join(row) for row in rows)
    return text.encode("utf-8", "surrogatepass")


files = mostly(tables(), st.sampled_from(WHOLE_CSV).flatmap(lambda text: torn(text.encode())))
named = [{"name": "motion", "initial_arm_deg": [-90.0, 0.0, -45.0, 0.0], **w} for w in WHOLE]
scenarios = st.sampled_from(named).flatmap(
    lambda whole: st.one_of(
        st.just(document(whole).encode()),
        damaged(whole, toml_values).map(lambda table: document(table).encode()),
    )
)
cases = st.tuples(files, scenarios)


@functools.cache
def compiled() -> None:
    """Compile what flights need, which may take longer than anybody's patience."""
    whole_run()
    for name in ("push-wall", "pick-and-place"):
        brief = replace(load_scenario(name), duration=0.05)
        fullam.simulate(brief, "pid", weather="sold", throw=False)


def attack_motion(case: tuple[bytes, bytes]) -> None:
    """A motion that is accepted is finite, the same when it is read again, and can be flown."""
    compiled()
    table, path = folder() / "m.csv", folder() / "m.toml"
    table.write_bytes(case[0])
    path.write_bytes(case[1])

    def fly() -> bool:
        scenario = load_scenario(path)
        assert Scenario.from_dict(json.loads(json.dumps(scenario.to_dict()))) == scenario
        short = replace(scenario, duration=min(scenario.duration, 0.05))
        run = fullam.simulate(short, "pid", throw=False)
        assert np.isfinite(run.reference_pose).all()
        return len(run) <= 6

    assert answered(fly) is not False
    for read in (Trajectory.from_csv, JointTrajectory.from_csv):
        motion = answered(lambda read=read: read(table))
        assert motion is None or np.isfinite(motion.times).all()
