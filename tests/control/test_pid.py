"""Eq. (19): error, integral, limits and anti-windup."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.control.controller import ALL_AXES, Measurement, ReferencePoint
from fullam.control.pid import Pid, PidLaw, PidSettings
from fullam.dynamics.pose_space import pose_from_euler
from fullam.exceptions import SettingsError
from fullam.model.loading import load_vehicle

EXACT = 1e-12
"""Rounding of a few products of numbers of order one."""


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


def at(vehicle, position, euler):
    m = Measurement(vehicle)
    m.q[:7] = pose_from_euler(np.array(position, float), np.array(euler, float))
    return m


def test_the_error_is_the_world_side_axis_angle(vehicle):
    """e_tau = log(R_d R_c^T) of eqs. (17)-(18), by Pinocchio's logarithm."""
    m = at(vehicle, (1, 2, 3), (0.3, -0.2, 0.5))
    ref = ReferencePoint()
    ref.pose = pose_from_euler(np.array([2.0, 1.0, 5.0]), np.array([-0.4, 0.9, 1.1]))
    law = PidLaw(PidSettings(), 0.01, ALL_AXES)
    law.acceleration(m, ref, np.empty(6))
    R_c = pin.Quaternion(m.q[3:7]).toRotationMatrix()
    R_d = pin.Quaternion(ref.pose[3:7]).toRotationMatrix()
    np.testing.assert_allclose(law.error[:3], [1.0, -1.0, 2.0], atol=EXACT)
    np.testing.assert_allclose(law.error[3:], pin.log3(R_d @ R_c.T), atol=EXACT)


def test_the_three_terms_add_up(vehicle):
    settings = PidSettings((2.0, 3.0, 5.0), (7.0, 11.0, 13.0), integral_limits=(100.0, 100.0))
    law = PidLaw(settings, 0.1, ALL_AXES)
    m = at(vehicle, (0, 0, 0), (0, 0, 0))
    m.v[:6] = 0.1, 0.2, 0.3, 0.4, 0.5, 0.6
    ref = ReferencePoint()
    ref.pose = pose_from_euler(np.array([1.0, 0.0, 0.0]), np.array([0.2, 0.0, 0.0]))
    ref.acceleration = np.arange(6.0)
    first = law.acceleration(m, ref, np.empty(6)).copy()
    second = law.acceleration(m, ref, np.empty(6))
    e = np.array([1.0, 0, 0, 0.2, 0, 0])
    kp, ki = np.repeat([2.0, 7.0], 3), np.repeat([3.0, 11.0], 3)
    kd = np.repeat([5.0, 13.0], 3)
    np.testing.assert_allclose(first, kp * e - kd * m.v[:6] + np.arange(6), atol=EXACT)
    np.testing.assert_allclose(second - first, ki * e * 0.1, atol=EXACT)


def test_the_integral_stops_at_its_limit(vehicle):
    law = PidLaw(PidSettings(integral_limits=(0.5, 0.25)), 0.01, ALL_AXES)
    m, ref = at(vehicle, (0, 0, 0), (0, 0, 0)), ReferencePoint()
    ref.pose = pose_from_euler(np.array([9.0, -9.0, 9.0]), np.array([0.5, 0.0, 0.0]))
    for _ in range(500):
        law.acceleration(m, ref, np.empty(6))
    np.testing.assert_allclose(law.integral, [0.5, -0.5, 0.5, 0.25, 0, 0], atol=EXACT)


def test_draining_lets_go_of_what_pushes_into_the_limit_and_of_no_more(vehicle):
    law = PidLaw(PidSettings(anti_windup=5.0), 0.01, ALL_AXES)
    law.integral[:] = 1.0, 1.0, -1.0, 0.0, 0.1, -0.1
    law.drain(np.array([-2.0, 2.0, 4.0, -3.0, -90.0, 90.0]))
    np.testing.assert_allclose(law.integral, [0.9, 1.0, -0.8, 0.0, 0.0, 0.0], atol=EXACT)


def test_uncontrolled_axes_get_no_feedback(vehicle):
    law = PidLaw(PidSettings(), 0.01, (False, False, True, True, True, True))
    m, ref = at(vehicle, (5, 5, 5), (0, 0, 0)), ReferencePoint()
    a = law.acceleration(m, ref, np.empty(6))
    assert a[0] == a[1] == 0.0
    assert a[2] < 0.0


def test_the_command_respects_its_bounds(vehicle):
    bounds = (6.0, 6.0, 40.0, 0.965, 0.965, 9.65)
    controller = Pid(vehicle, PidSettings(wrench_bounds=bounds))
    m, ref = at(vehicle, (0, 0, 9), (0.5, 0.5, 0.0)), ReferencePoint()
    ref.pose = pose_from_euler(np.array([50.0, -50.0, -50.0]), np.zeros(3))
    controller.reset(m, ref)
    u = controller.wrench(0.0, m, ref)
    np.testing.assert_allclose(u[:3], [6.0, -6.0, 0.0], atol=EXACT)  # rotors do not pull down
    assert np.all(np.abs(u) <= np.array(bounds) + EXACT)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("position_gains", (1.0, 2.0)),
        ("position_gains", (1.0, -2.0, 3.0)),
        ("integral_limits", (1.0, -1.0)),
        ("wrench_bounds", (1.0, 1.0, 1.0)),
        ("anti_windup", -1.0),
    ],
)
def test_bad_settings_name_the_field(field, value):
    with pytest.raises(SettingsError, match=field):
        PidSettings(**{field: value})
