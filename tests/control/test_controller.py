"""What every registered law promises to those who call it."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.control.controller import Controller, Measurement, ReferencePoint
from fullam.control.controllers import (
    CONTROLLERS,
    LAWS,
    controller_class,
    controller_names,
    make_controller,
    register,
)
from fullam.control.dc_pid_plus import DcPidPlus
from fullam.exceptions import UnknownName
from fullam.model.loading import load_vehicle


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


@pytest.mark.parametrize("name", controller_names())
def test_reset_forgets_all_that_was(name, vehicle):
    """Also what was said to be delivered."""
    law, m, ref = make_controller(name, vehicle), Measurement(vehicle), ReferencePoint()
    ref.pose[:3] = 0.3, -0.2, 0.5
    m.q[3:7] = pin.Quaternion(pin.exp3(np.array([0.2, -0.1, 0.3]))).coeffs()
    law.reset(m, ref)
    first = law.wrench(0.0, m, ref).copy()
    for _ in range(3):
        u = law.wrench(0.0, m, ref)
        law.delivered(0.8 * u, -0.2 * u)
    law.reset(m, ref)
    np.testing.assert_array_equal(law.wrench(0.0, m, ref), first)


@pytest.mark.parametrize("name", controller_names())
def test_the_measurement_is_left_as_it_was(name, vehicle, rng):
    law, m, ref = make_controller(name, vehicle), Measurement(vehicle), ReferencePoint()
    m.q[:] = pin.integrate(vehicle.model, m.q, rng.normal(size=vehicle.model.nv))
    m.v[:] = rng.normal(size=vehicle.model.nv)
    m.arm_acceleration[:] = rng.normal(size=vehicle.n_arm)
    q, v, a = m.q.copy(), m.v.copy(), m.arm_acceleration.copy()
    law.reset(m, ref)
    law.wrench(0.0, m, ref)
    for now, before in ((m.q, q), (m.v, v), (m.arm_acceleration, a)):
        np.testing.assert_array_equal(now, before)


@pytest.mark.parametrize("name", controller_names())
def test_a_law_says_with_what_lag_its_wrench_follows(name, vehicle):
    law = make_controller(name, vehicle)
    mean = vehicle.rotors.lags.mean()
    assert mean > 0.0
    assert law.thrust_lag() == (0.5 * mean if isinstance(law, DcPidPlus) else mean)


def test_the_table_holds_the_laws_under_their_names():
    assert {law.name for law in LAWS} <= set(controller_names())
    assert all(controller_class(law.name) is law for law in LAWS)


def test_a_user_s_law_is_found_by_its_name(vehicle, monkeypatch):
    monkeypatch.setattr("fullam.control.controllers.CONTROLLERS", type(CONTROLLERS)("controller"))

    @register("still")
    class Still(Controller):
        def reset(self, measurement, reference):
            """Nothing to forget."""

        def wrench(self, t, measurement, reference):
            return np.zeros(6)

    assert controller_names() == ("still",)
    assert controller_class("still") is Still
    assert Still.name == "still"
    with pytest.raises(UnknownName, match="still"):
        controller_class("stil")
