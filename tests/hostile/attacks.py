"""The attacks: vehicles, scenarios, runs and stores that are wrong on purpose, and all others.

Each has a strategy, which makes a case, and a function that lets the case happen. What is allowed
is an answer, or an error of ours that names a remedy, soon. A traceback of anything else, a hang,
or a difference that nobody is told of is a failure.
"""

from __future__ import annotations

import contextlib
import copy
import functools
import io
import json
import re
import tomllib
import warnings
import zipfile
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from answers import Attack, answered, folder, scene_run, whole_run
from commands import attack_command, command_lines
from hypothesis import strategies as st
from motions import attack_motion
from motions import cases as motions
from own_files import attack_plugin, attack_settings, plugins, settings_files
from values import damaged, document, json_values, mostly, toml_values, torn

import fullam
from fullam.analysis.scene_motion import scene_motions
from fullam.model.bodies import body_tables
from fullam.model.loading import load_vehicle, vehicle_path
from fullam.model.servos import DEFAULTS
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.scenario import Scenario, load_scenario

# --- vehicles ---------------------------------------------------------------------------------

WHOLE_URDF = vehicle_path("fullam").with_suffix(".urdf").read_text(encoding="utf-8")
WHOLE_VEHICLE = tomllib.loads(vehicle_path("fullam").read_text(encoding="utf-8")) | {
    "urdf": "v.urdf",
    "gravity": 9.81,
}
# The declared mass is checked against the URDF's, which would hide every other damage to masses.
del WHOLE_VEHICLE["mass"], WHOLE_VEHICLE["design"]
MORE = {"body": body_tables(load_vehicle("fullam").model), "servo": dict(DEFAULTS)}
"""Mass properties as a calibrated vehicle states them, and servos."""

ATTRIBUTES = [found.span(1) for found in re.finditer(r'="([^"]*)"', WHOLE_URDF)]
ELEMENTS = [found.span() for found in re.finditer(r"<(\w+)[^<>]*/>", WHOLE_URDF)]
NUMERALS = ("nan", "inf", "0", "-1", "1e100", "1e150", "1e308", "1e-300", "", "x", "1 2", "0 0 0")


@st.composite
def urdfs(draw: st.DrawFn) -> bytes:
    """A URDF with an attribute rewritten, an element removed or doubled, or bytes damaged."""
    kind = draw(st.sampled_from((*["attribute"] * 7, "remove", "double", "bytes")))
    if kind == "bytes":
        return draw(torn(WHOLE_URDF.encode()))
    start, end = draw(st.sampled_from(ATTRIBUTES if kind == "attribute" else ELEMENTS))
    old = WHOLE_URDF[start:end]
    if kind == "attribute":
        words = old.split()
        if draw(st.booleans()) and len(words) > 1:
            words[draw(st.integers(0, len(words) - 1))] = draw(st.sampled_from(NUMERALS))
            new = " ".join(words)
        else:
            new = draw(st.sampled_from((*NUMERALS, "platform", "\x1b[31m", "a" * 10_000)))
    else:
        new = "" if kind == "remove" else 2 * old
    return (WHOLE_URDF[:start] + new + WHOLE_URDF[end:]).encode()


GOOD_VEHICLE, GOOD_URDF = document(WHOLE_VEHICLE).encode(), WHOLE_URDF.encode()

vehicles = mostly(
    st.one_of(
        st.tuples(
            st.sampled_from((WHOLE_VEHICLE, WHOLE_VEHICLE | MORE))
            .flatmap(lambda whole: damaged(whole, toml_values))
            .map(lambda t: document(t).encode()),
            st.just(GOOD_URDF),
        ),
        st.tuples(st.just(GOOD_VEHICLE), urdfs()),
    ),
    st.tuples(torn(GOOD_VEHICLE), st.just(GOOD_URDF)),
)


def attack_vehicle(case: tuple[bytes, bytes]) -> None:
    """A vehicle that is accepted has finite dynamics."""
    path = folder() / "v.toml"
    path.write_bytes(case[0])
    path.with_suffix(".urdf").write_bytes(case[1])

    def load() -> bool:
        vehicle = load_vehicle(path)
        q, v = vehicle.neutral(), np.ones(vehicle.model.nv)
        data = vehicle.create_data()
        assert np.isfinite(pin.rnea(vehicle.model, data, q, v, v)).all()
        inertia = pin.crba(vehicle.model, data, q)
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        # A thin rod may turn about itself: its joint is prescribed, or has its motor's armature.
        assert np.linalg.eigvalsh(inertia[:6, :6])[0] > 0.0
        assert np.linalg.eigvalsh(inertia)[0] > -1e-12 * inertia.max()
        assert np.isfinite(vehicle.rotors.normalized_coupling).all()
        assert 0.0 < vehicle.gravity < 1e3
        return vehicle.actuation_rank() <= 6

    assert answered(load) is not False


# --- scenarios --------------------------------------------------------------------------------

WHOLE_SCENARIOS = (
    json.loads(json.dumps(load_scenario("task-2").to_dict())),
    json.loads(
        json.dumps(
            Scenario(
                "points",
                reference=fullam.Waypoints((0.0, 1.0), ((0, 0, 1), (1, 0, 1)), ((0, 0, 0),) * 2),
            ).to_dict()
        )
    ),
    json.loads(json.dumps(Scenario("round", reference=fullam.Circle((0, 0, 1))).to_dict())),
)

scenarios = st.sampled_from(WHOLE_SCENARIOS).flatmap(
    lambda whole: mostly(
        damaged(whole, toml_values).map(lambda t: document(t).encode()),
        torn(document(whole).encode()),
    )
)


def attack_scenario(case: bytes) -> None:
    """A scenario that is accepted can be flown, for five ticks."""
    whole_run()  # compiles what flights need, which may take longer than anybody's patience
    path = folder() / "s.toml"
    path.write_bytes(case)

    def fly() -> bool:
        scenario = load_scenario(path)
        assert Scenario.from_dict(json.loads(json.dumps(scenario.to_dict()))) == scenario
        short = replace(scenario, duration=min(scenario.duration, 0.05))
        run = fullam.simulate(short, "pid", throw=False)
        return len(run) <= 6

    assert answered(fly) is not False


# --- run files --------------------------------------------------------------------------------


@functools.cache
def whole_run_bytes() -> bytes:
    """Its file."""
    return whole_run().save(folder() / "whole.npz").read_bytes()


def packed(columns: dict[str, Any], metadata: Any) -> bytes:
    """A run file of any arrays."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in {"metadata": np.array(json.dumps(metadata)), **columns}.items():
            entry = io.BytesIO()
            np.lib.format.write_array(entry, np.asanyarray(array), allow_pickle=True)
            archive.writestr(f"{name}.npy", entry.getvalue())
    return buffer.getvalue()


@st.composite
def strange_columns(draw: st.DrawFn) -> bytes:
    """A run file with one to three columns of another type, shape or content."""
    run = draw(st.sampled_from((whole_run, scene_run)))()
    columns: dict[str, Any] = dict(run.columns)
    for _ in range(draw(st.integers(1, 3))):
        name = draw(st.sampled_from(sorted(columns)))
        old = np.asarray(columns[name])
        match draw(st.sampled_from(("type", "shape", "rows", "value", "remove", "add"))):
            case "type":
                kind = draw(st.sampled_from(("f4", "i8", "c16", "U5", "S3", "?", "O", "M8[s]")))
                with (
                    contextlib.suppress(ValueError, TypeError, RuntimeError),
                    warnings.catch_warnings(),
                ):
                    warnings.simplefilter("ignore")
                    columns[name] = old.astype(kind)
            case "shape":
                columns[name] = draw(
                    st.sampled_from((old.T, old[None], old.ravel(), old[..., None], old[:, ...]))
                )
            case "rows":
                columns[name] = old[: draw(st.integers(0, len(old)))] if old.ndim else old
            case "value":
                new = np.array(old)
                if new.size and new.dtype.kind == "f":
                    at = draw(st.integers(0, new.size - 1))
                    new.flat[at] = draw(st.floats())
                columns[name] = new
            case "remove":
                del columns[name]
            case "add":
                columns[draw(st.sampled_from(("x", "a/b", "../up")))] = old
    return packed(columns, run.metadata)


@st.composite
def strange_scene(draw: st.DrawFn) -> bytes:
    """A run file that names the joints of its scene in other ways."""
    joints = draw(damaged(copy.deepcopy(scene_run().metadata["scene"]), json_values))
    return packed(scene_run().columns, scene_run().metadata | {"scene": joints})


runs = st.deferred(
    lambda: mostly(
        st.one_of(
            strange_columns(),
            strange_scene(),
            damaged(copy.deepcopy(whole_run().metadata), json_values).map(
                lambda m: packed(whole_run().columns, m)
            ),
        ),
        torn(whole_run_bytes()),
    )
)


def attack_run(case: bytes) -> None:
    """A run that is accepted can be measured, and damaged bytes give the same numbers or none."""
    path = folder() / "r.npz"
    path.write_bytes(case)

    def load() -> bool:
        run = Run.load(path)
        assert str(run)
        assert len(scene_motions(run)) == len(run.scene_joints) * bool(len(run))
        return fullam.measure(run).diverged == run.diverged

    assert answered(load) is not False


# --- stores -----------------------------------------------------------------------------------


@functools.cache
def whole_store() -> tuple[Any, Any, bytes]:
    """A small campaign, its table and its file."""
    from fullam.analysis.campaign import Campaign, sweep

    campaign = Campaign((Scenario("brief", duration=0.1),), ("pid",), (0, 1, 2), traces=True)
    path = folder() / "whole.parquet"
    table = sweep(campaign, path)
    return campaign, table, path.read_bytes()


@st.composite
def rewritten_stores(draw: st.DrawFn) -> bytes:
    """A Parquet file with columns dropped, renamed, retyped, emptied or doubled; or restamped."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    _, table, _ = whole_store()
    rows, identity = table.rows, copy.deepcopy(table.identity)
    stamp: dict[bytes, bytes] = dict(rows.schema.metadata)
    for _ in range(draw(st.integers(1, 2))):
        at = draw(st.integers(0, rows.num_columns - 1))
        name = rows.schema.names[at]
        match draw(
            st.sampled_from(("drop", "rename", "retype", "empty", "double", "stamp", "raw"))
        ):
            case "drop":
                rows = rows.remove_column(at)
            case "rename":
                rows = rows.rename_columns([f"{n}x" if n == name else n for n in rows.schema.names])
            case "retype":
                texts = pa.array([str(v) for v in rows.column(at).to_pylist()])
                rows = rows.set_column(at, name, texts)
            case "empty":
                kind = rows.schema.field(at).type
                rows = rows.set_column(at, name, pa.nulls(rows.num_rows, kind))
            case "double":
                rows = rows.append_column(name, rows.column(at))
            case "stamp":
                changed = draw(damaged(identity, json_values))
                stamp[b"fullam"] = json.dumps(changed).encode()
            case "raw":
                stamp[b"fullam"] = draw(st.one_of(st.binary(max_size=50), st.just(b"[" * 5000)))
    buffer = io.BytesIO()
    pq.write_table(rows.replace_schema_metadata(stamp), buffer)
    return buffer.getvalue()


stores = st.deferred(lambda: st.one_of(torn(whole_store()[2]), rewritten_stores()))


def attack_store(case: bytes) -> None:
    """A store that is accepted says exactly what was written."""
    from fullam.analysis.campaign_store import CampaignStore
    from fullam.analysis.campaign_table import read_campaign

    campaign, whole, _ = whole_store()
    path = folder() / "p.parquet"
    path.write_bytes(case)
    table = answered(lambda: read_campaign(path))
    if table is not None:
        assert table.rows.equals(whole.rows), "a difference that nobody is told of"
        assert table.identity == whole.identity
    answered(lambda: CampaignStore(path, campaign.identity(), False).keys)
    parts = folder() / "q.parquet.parts"
    parts.mkdir(exist_ok=True)
    (parts / "part-0.parquet").write_bytes(case)
    answered(lambda: CampaignStore(folder() / "q.parquet", campaign.identity(), False).keys)


ATTACKS = (
    Attack("vehicle", vehicles, attack_vehicle),
    Attack("scenario", scenarios, attack_scenario),
    Attack("run", runs, attack_run),
    Attack("store", stores, attack_store),
    Attack("motion", motions, attack_motion),
    Attack("settings", settings_files, attack_settings),
    Attack("plugin", plugins, attack_plugin),
    Attack("command", command_lines(), attack_command),
)
