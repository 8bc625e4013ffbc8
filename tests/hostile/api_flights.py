"""Calls of the Python API that fly, measure, tune, and read what is one's own."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from answers import folder, whole_run

import fullam
from fullam.analysis.external_wrench import WrenchSettings
from fullam.analysis.tuning import tune
from fullam.analysis.tuning_flights import TuningFlights
from fullam.cli.scaffolding import TEMPLATES
from fullam.control.controllers import CONTROLLERS
from fullam.control.estimators import ESTIMATORS
from fullam.control.kalman import Kalman
from fullam.control.pid import Pid
from fullam.control.tunable import search_space
from fullam.model.loading import load_vehicle
from fullam.model.writing import write_vehicle
from fullam.simulation.excitation import ArmExcitation, Excitation
from fullam.simulation.motions.motion_csv import read_columns
from fullam.simulation.payloads.payload import Payload
from fullam.simulation.plants.settings import ServoSettings
from fullam.simulation.scenarios.scenario import Scenario
from fullam.simulation.sensor_errors import SensorErrors
from fullam.simulation.simulate import prepare
from fullam.simulation.world.surfaces import Box, Plane, Sphere, surface

Calls = list[tuple[Callable[..., Any], dict[str, Any]]]


def identification() -> Calls:
    """What a flight tells of its vehicle."""
    vehicle = load_vehicle("fullam")
    swinging = Scenario("swinging", reference=Excitation(period=5.0), duration=5.0)
    run = fullam.simulate(swinging, seed=1)
    pushed = fullam.external_wrench(run)
    return [
        (Excitation, {"position": (0.3,) * 3, "euler_deg": (9.0,) * 3, "period": 5.0}),
        (ArmExcitation, {"amplitudes": (0.1,) * 4, "period": 5.0}),
        (
            fullam.excitation_flight,
            {"vehicle": vehicle, "duration": 5.0, "weather": fullam.weather("calm"), "arm": None},
        ),
        (fullam.calibrate, {"run": run, "share": 0.1, "center": 0.002, "mass": 4.0}),
        (write_vehicle, {"vehicle": vehicle, "path": folder() / "written.toml"}),
        (WrenchSettings, vars(WrenchSettings())),
        (
            fullam.external_wrench,
            {"run": run, "settings": WrenchSettings(), "vehicle": vehicle},
        ),
        (pushed.threshold, {"false_alarms": 1.0}),
        (pushed.detect, {"false_alarms": 1.0, "persistence": 0.1}),
        (SensorErrors, fullam.weather("sold").sensors.to_dict()),
        (SensorErrors.from_dict, {"data": fullam.weather("sold").sensors.to_dict()}),
    ]


def one_flight() -> Calls:
    """Flights, what is prepared for them, and what is made of their records."""
    brief, run = Scenario("brief", duration=0.02), whole_run()
    vehicle, plan = load_vehicle("fullam"), prepare(brief, "dc-pid")
    choices = {
        "vehicle": "fullam",
        "failed": ("rotor_1",),
        "seed": 1,
        "simulation": {},
        "plant": "servo",
    }

    def without(rotor: Any) -> Any:
        return vehicle.with_failed(rotor)

    def flown(seeds: Any) -> Any:
        return list(fullam.fly_many(plan, seeds, lanes=1, threads=1))

    def prepared(lanes: Any, threads: Any) -> Any:
        return list(fullam.fly_many(plan, (), lanes=lanes, threads=threads))

    def many(plan: Any) -> Any:
        return list(fullam.fly_many(plan, (0,), lanes=1, threads=1))

    return [
        (Plane, {"point": (0, 0, 0), "normal": (0, 0, 1), "stiffness": 1e5, "friction": 0.5}),
        (Sphere, {"center": (0, 0, 0), "radius": 0.1, "dissipation": 1.0, "slip": 0.02}),
        (Box, {"center": (0, 0, 0), "size": (1, 1, 1), "euler_deg": (0, 0, 9)}),
        (Payload, {"mass": 0.2, "picked_up": 1.0, "dropped": 2.0, "offset": (0, 0, 0)}),
        (Payload.from_dict, {"data": {"mass": 0.2}}),
        (surface, {"data": {"kind": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]}}),
        (ServoSettings, {"feedback": "twin", "feed_forward": "off"}),
        (without, {"rotor": "rotor_1"}),
        (prepare, {"scenario": brief, "controller": "dc-pid", **choices, "settings": {}}),
        (flown, {"seeds": (0,)}),
        (prepared, {"lanes": 1, "threads": 1}),
        (many, {"plan": plan}),
        *((function, {"run": run}) for function in (fullam.measure, fullam.refly, fullam.diagnose)),
        (fullam.loop_margins, {"plan": plan, "spare": 0.0}),
        (fullam.make_controller, {"name": "pid", "vehicle": vehicle, "period": 0.01}),
        *((write, {"path": folder() / "a"}) for write in (run.save, run.to_csv, run.to_parquet)),
        (run.to_mcap, {"path": folder() / "a"}),
    ]


def own_things() -> Calls:
    """Plugins, settings files, what is tunable, and tuning."""
    brief, law = Scenario("brief", duration=0.02), folder() / "own_law.py"
    law.write_text((TEMPLATES / "controller.py").read_text(encoding="utf-8"), encoding="utf-8")
    gains = folder() / "gains.toml"
    gains.write_text('controller = "pid"\n[settings]\n', encoding="utf-8")
    flights = TuningFlights((brief,), seeds=(0,), validation_seeds=(1,), driver="python")

    def registered(name: Any, cls: Any) -> Any:
        own = type("Own", (cls,), {}) if cls is Pid else cls
        fullam.register(name)(own)
        del CONTROLLERS[name]

    def estimating(name: Any, cls: Any) -> Any:
        own = type("Own", (cls,), {}) if cls is Kalman else cls
        fullam.register_estimator(name)(own)
        del ESTIMATORS[name]

    return [
        (fullam.load_plugin, {"source": law}),
        (fullam.load_settings, {"path": gains}),
        (read_columns, {"path": Path(__file__).with_name("tour.csv")}),
        (fullam.tunable, {"default": 3.0, "low": 1.0, "high": 9.0, "scale": "log"}),
        (fullam.tunable, {"default": (3.0, 4.0), "low": (1.0, 1.0), "high": (9.0, None)}),
        (search_space, {"settings": Pid.Settings}),
        (registered, {"name": "own", "cls": Pid}),
        (estimating, {"name": "own", "cls": Kalman}),
        (
            TuningFlights,
            {
                **{"scenarios": (brief,), "vehicle": "fullam", "weather": "calm", "shaping": {}},
                **{"simulation": {}, "seeds": (0,), "validation_seeds": (1,), "driver": "python"},
            },
        ),
        (partial(tune, "pid"), {"flights": flights, "budget": 1}),
        (
            partial(tune, flights=flights, budget=11),
            {
                **{"controller": "pid", "settings": {}, "seed": 0, "jobs": 1},
                "out": folder() / "best.toml",
            },
        ),
    ]


def calls() -> Calls:
    """All of them."""
    assert np.isfinite(whole_run().pose).all()
    return [*identification(), *one_flight(), *own_things()]
