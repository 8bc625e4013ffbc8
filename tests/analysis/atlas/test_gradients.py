"""Gradients and, at kinks, directional derivatives: against differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fullam.analysis.atlas.envelope import Envelope
from fullam.analysis.atlas.gradients import (
    Change,
    Gradient,
    Sensitivity,
    force_sensitivity,
    margin_sensitivity,
    push_sensitivity,
    tilt_sensitivity,
)
from fullam.analysis.atlas.loads import load_of
from fullam.exceptions import FullamError, NotFullyActuated
from fullam.model.loading import load_vehicle

STEP = 1e-6
SMOOTH = 1e-7
"""Central differences at STEP: rounding costs 1e-10, the third derivative 1e-12 or so."""
ONE_SIDED = 1e-4
"""Forward differences at STEP: the second derivative times STEP, of figures of 1 to 20."""

DIRECTION = np.array([0.6, 0.0, -0.8])
AZIMUTH = 0.7

FIGURES: dict[str, tuple[Callable[[Envelope], Sensitivity], Callable[[Envelope], float]]] = {
    "worst tilt": (tilt_sensitivity, lambda e: e.worst_tilt[0]),
    "tilt": (lambda e: tilt_sensitivity(e, AZIMUTH), lambda e: e.rose([AZIMUTH])[0]),
    "margin": (margin_sensitivity, lambda e: e.margin.value),
    "push": (lambda e: push_sensitivity(e, DIRECTION), lambda e: float(e.push(DIRECTION))),
    "force": (lambda e: force_sensitivity(e, DIRECTION), lambda e: float(e.force(DIRECTION))),
}


def moved(envelope: Envelope, change: Change, step: float) -> Envelope:
    """The envelope of a vehicle changed by a step, its margin in the same unit."""
    r, load = envelope.rotors, envelope.load
    axes = r.axes + step * np.broadcast_to(change.axes, r.axes.shape)
    rotors = replace(
        r,
        positions=r.positions + step * np.broadcast_to(change.positions, r.positions.shape),
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        k_f=r.k_f + step * np.broadcast_to(change.k_f, r.k_f.shape),
    )
    tool = step * np.asarray(change.tool)
    moment = np.concatenate([np.zeros(3), np.cross(tool, load.extra[:3])])
    changed = replace(
        load,
        mass=load.mass + step * change.mass,
        center=load.center + step * np.asarray(change.center),
        tool=load.tool + tool,
        extra=load.extra + moment,
    )
    return replace(Envelope.from_rotors(rotors, changed), length=envelope.length)


def random_change(envelope: Envelope, rng: np.random.Generator) -> Change:
    e = envelope.rotors.axes
    axes = rng.normal(size=e.shape)
    return Change(
        positions=0.1 * rng.normal(size=e.shape),
        axes=axes - np.sum(axes * e, axis=1, keepdims=True) * e,
        k_f=envelope.rotors.k_f * rng.normal(size=len(e)),
        mass=float(rng.normal()),
        center=0.1 * rng.normal(size=3),
        tool=0.1 * rng.normal(size=3),
    )


def product(gradient: Gradient, change: Change) -> float:
    parts = ("positions", "axes", "k_f", "mass", "center", "tool")
    return float(sum(np.sum(getattr(gradient, p) * getattr(change, p)) for p in parts))


def generic() -> Envelope:
    """The default octorotor with its symmetry broken: no kinks."""
    envelope = Envelope.of(load_vehicle("fullam"), tool_wrench=[1.0, 0.5, 0.2, 0.01, 0.02, 0.03])
    return moved(envelope, random_change(envelope, np.random.default_rng(5)), 1e-2)


@pytest.mark.parametrize("figure", FIGURES)
@pytest.mark.parametrize("vehicle", ["hextilt", "octorotor without symmetry"])
def test_gradients_are_what_differences_say(vehicle: str, figure: str) -> None:
    envelope = Envelope.of(load_vehicle(vehicle)) if vehicle == "hextilt" else generic()
    sensitivity, value = FIGURES[figure]
    found = sensitivity(envelope)
    assert found.smooth
    assert found.gradient is not None
    assert found.value == pytest.approx(value(envelope), rel=1e-12)
    rng = np.random.default_rng(1)
    for _ in range(5):
        change = random_change(envelope, rng)
        more, less = (value(moved(envelope, change, s)) for s in (STEP, -STEP))
        expected = (more - less) / (2.0 * STEP)
        assert product(found.gradient, change) == pytest.approx(expected, rel=SMOOTH, abs=SMOOTH)
        assert found.along(change) == pytest.approx(expected, rel=SMOOTH, abs=SMOOTH)


def test_cants_and_azimuths_turn_the_rotors() -> None:
    envelope = generic()
    found = tilt_sensitivity(envelope).gradient
    assert found is not None
    r, e = envelope.rotors.positions, envelope.rotors.axes
    z = np.array([0.0, 0.0, 1.0])
    one = np.zeros((8, 1))
    one[3] = 1.0
    across = np.cross(np.cross(e, z), e)
    across /= -np.linalg.norm(across, axis=1, keepdims=True)  # away from z
    turn = Change(positions=one * np.cross(z, r), axes=one * np.cross(z, e))
    for derivative, change in ((found.cants[3], Change(axes=one * across)),
                               (found.azimuths[3], turn)):  # fmt: skip
        more, less = (moved(envelope, change, s).worst_tilt[0] for s in (STEP, -STEP))
        assert derivative == pytest.approx((more - less) / (2.0 * STEP), abs=SMOOTH)


def test_arm_angles_move_the_centre_of_mass() -> None:
    vehicle = load_vehicle("hextilt")
    theta = np.array([0.3, -0.5, 0.4, 0.2, -0.1])
    found = push_sensitivity(Envelope.of(vehicle, theta), DIRECTION)
    assert found.gradient is not None
    along = found.gradient.along_arm(vehicle, theta)
    for joint in range(vehicle.n_arm):
        step = np.zeros(5)
        step[joint] = STEP
        more, less = (
            float(Envelope.of(vehicle, theta + s * step).push(DIRECTION)) for s in (1.0, -1.0)
        )
        assert along[joint] == pytest.approx((more - less) / (2.0 * STEP), rel=SMOOTH, abs=SMOOTH)


@pytest.mark.parametrize("figure", FIGURES)
def test_the_symmetric_octorotor_has_kinks_and_says_so(figure: str) -> None:
    """No gradient, but a derivative along any change, which differs from the one backwards."""
    vehicle = load_vehicle("fullam")
    centred = replace(load_of(vehicle), center=np.zeros(3))
    sensitivity, value = FIGURES[figure]
    rng = np.random.default_rng(2)
    for envelope in (Envelope.of(vehicle), Envelope.from_rotors(vehicle.rotors, centred)):
        found = sensitivity(envelope)
        assert not found.smooth
        assert found.gradient is None
        assert len(found.facets) >= 1
        kinked = 0
        for _ in range(4):
            change = random_change(envelope, rng)
            expected = (value(moved(envelope, change, STEP)) - value(envelope)) / STEP
            back = (value(envelope) - value(moved(envelope, change, -STEP))) / STEP
            assert found.along(change) == pytest.approx(expected, rel=ONE_SIDED, abs=ONE_SIDED)
            kinked += abs(expected - back) > 1e-3
        assert kinked > 0


def test_mass_and_uniform_strength_cancel() -> None:
    """Twice the mass with twice the thrust is the same vehicle: an identity, not a difference."""
    envelope = generic()
    envelope = replace(envelope, load=replace(envelope.load, extra=np.zeros(6)))
    envelope = replace(envelope, rotors=replace(envelope.rotors, k_tau=np.zeros(8)))
    envelope = Envelope.from_rotors(envelope.rotors, envelope.load)
    found = tilt_sensitivity(envelope).gradient
    assert found is not None
    scaled = found.mass * envelope.load.mass + found.k_f @ envelope.rotors.k_f
    assert scaled == pytest.approx(0.0, abs=1e-9)  # rounding of terms of order 1


def test_what_has_no_derivative_is_refused() -> None:
    with pytest.raises(NotFullyActuated):
        tilt_sensitivity(Envelope.of(load_vehicle("borinot")))
    heavy = Envelope.of(load_vehicle("fullam"), payload=5.0)
    with pytest.raises(FullamError, match="cannot hover"):
        tilt_sensitivity(heavy)
    assert margin_sensitivity(heavy).value < 0.0
