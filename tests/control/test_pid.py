"""Eq. (19): error, integral, limits and anti-windup."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.control.controller import ALL_AXES, Measurement, ReferencePoint
from fullam.control.controllers import make_controller
from fullam.control.law import estimate_of, target_of
from fullam.control.pid import Pid, PidSettings, drained, integrated, pid, pose_error, rigid_inertia
from fullam.dynamics.multibody import rotation_of
from fullam.dynamics.pose_space import pose_from_euler
from fullam.dynamics.spatial import Spatial
from fullam.exceptions import SettingsError
from fullam.model.loading import load_vehicle
from fullam.numbers.records import flat, record
from fullam.numbers.vectors import IDENTITY

EXACT = 1e-12
"""Rounding of a few products of numbers of order one."""


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("fullam")


def at(vehicle, position, euler):
    m = Measurement(vehicle)
    m.q[:7] = pose_from_euler(np.array(position, float), np.array(euler, float))
    return m


def vector(value):
    return np.array([*flat(value)])


class Law:
    """Eq. (19) and its integrator, period by period, on the gains of a controller."""

    def __init__(self, vehicle, settings, period=0.01, axes=ALL_AXES):
        self.gains = Pid(vehicle, settings, period, axes).gains()
        self.integral = Spatial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    def acceleration(self, m, ref):
        target = target_of(ref)
        e, de = pose_error(estimate_of(m), target)
        a = pid(self.gains, e, de, self.integral, target.acceleration)
        self.integral = integrated(self.gains, self.integral, e)
        return vector(a)


def test_the_error_is_the_world_side_axis_angle(vehicle):
    """e_tau = log(R_d R_c^T) of eqs. (17)-(18), by Pinocchio's logarithm."""
    m = at(vehicle, (1, 2, 3), (0.3, -0.2, 0.5))
    ref = ReferencePoint()
    ref.pose = pose_from_euler(np.array([2.0, 1.0, 5.0]), np.array([-0.4, 0.9, 1.1]))
    e, _ = pose_error(estimate_of(m), target_of(ref))
    R_c = pin.Quaternion(m.q[3:7]).toRotationMatrix()
    R_d = pin.Quaternion(ref.pose[3:7]).toRotationMatrix()
    np.testing.assert_allclose(e.linear, [1.0, -1.0, 2.0], atol=EXACT)
    np.testing.assert_allclose(e.angular, pin.log3(R_d @ R_c.T), atol=EXACT)


def test_the_rate_of_the_error_is_in_world_axes(vehicle):
    m, ref = at(vehicle, (1, 2, 3), (0.3, -0.2, 0.5)), ReferencePoint()
    m.v[:6] = 0.1, 0.2, 0.3, 0.4, 0.5, 0.6
    ref.velocity = np.arange(1.0, 7.0)
    _, de = pose_error(estimate_of(m), target_of(ref))
    R = pin.Quaternion(m.q[3:7]).toRotationMatrix()
    expected = ref.velocity - (m.v[:6].reshape(2, 3) @ R.T).ravel()
    np.testing.assert_allclose(vector(de), expected, atol=EXACT)


def test_the_three_terms_add_up(vehicle):
    settings = PidSettings((2.0, 3.0, 5.0), (7.0, 11.0, 13.0), integral_limits=(100.0, 100.0))
    law = Law(vehicle, settings, 0.1)
    m = at(vehicle, (0, 0, 0), (0, 0, 0))
    m.v[:6] = 0.1, 0.2, 0.3, 0.4, 0.5, 0.6
    ref = ReferencePoint()
    ref.pose = pose_from_euler(np.array([1.0, 0.0, 0.0]), np.array([0.2, 0.0, 0.0]))
    ref.acceleration = np.arange(6.0)
    first = law.acceleration(m, ref)
    second = law.acceleration(m, ref)
    e = np.array([1.0, 0, 0, 0.2, 0, 0])
    kp, ki = np.repeat([2.0, 7.0], 3), np.repeat([3.0, 11.0], 3)
    kd = np.repeat([5.0, 13.0], 3)
    np.testing.assert_allclose(first, kp * e - kd * m.v[:6] + np.arange(6), atol=EXACT)
    np.testing.assert_allclose(second - first, ki * e * 0.1, atol=EXACT)


def test_the_integral_stops_at_its_limit(vehicle):
    law = Law(vehicle, PidSettings(integral_limits=(0.5, 0.25)))
    m, ref = at(vehicle, (0, 0, 0), (0, 0, 0)), ReferencePoint()
    ref.pose = pose_from_euler(np.array([9.0, -9.0, 9.0]), np.array([0.5, 0.0, 0.0]))
    for _ in range(500):
        law.acceleration(m, ref)
    np.testing.assert_allclose(vector(law.integral), [0.5, -0.5, 0.5, 0.25, 0, 0], atol=EXACT)


def test_draining_lets_go_of_what_pushes_into_the_limit_and_of_no_more(vehicle):
    limits = Pid(vehicle, PidSettings(anti_windup=5.0), 0.01).limits()
    limits = limits._replace(mass=2.0, inertia_inverse=(0.5, 0.0, 0.0, 0.25, 0.0, 0.1))
    integral = record(Spatial, [1.0, 1.0, -1.0, 0.0, 0.1, -0.1])
    missing = record(Spatial, [-4.0, 4.0, 8.0, -6.0, -360.0, 900.0])
    after = vector(drained(limits, integral, IDENTITY, missing))
    np.testing.assert_allclose(after, [0.9, 1.0, -0.8, 0.0, 0.0, 0.0], atol=EXACT)


def test_what_is_missing_of_a_moment_is_turned_by_the_inertia_in_its_own_axes(vehicle):
    limits = Pid(vehicle, PidSettings(anti_windup=1.0), 0.01).limits()
    R = pin.exp3(np.array([0.3, -0.5, 0.8]))
    x, xy, xz, y, yz, z = limits.inertia_inverse
    inverse = np.array([[x, xy, xz], [xy, y, yz], [xz, yz, z]])
    moment = np.array([0.3, -0.2, 0.1])
    rates = R @ inverse @ R.T @ moment
    integral = Spatial((0.0, 0.0, 0.0), tuple(-1e3 * np.sign(rates)))
    missing = Spatial((0.0, 0.0, 0.0), tuple(moment))
    after = drained(limits, integral, tuple(R.ravel()), missing)
    released = np.abs(np.array(integral.angular) - after.angular)
    np.testing.assert_allclose(released, 0.01 * np.abs(rates), atol=EXACT)


def test_u_is_what_one_rigid_body_takes(vehicle):
    """Force by the mass and the weight, moment by the neutral arm's inertia turned to the world."""
    controller, m, ref = Pid(vehicle), at(vehicle, (0, 0, 0), (0.3, -0.4, 0.9)), ReferencePoint()
    ref.pose = pose_from_euler(np.array([0.2, 0.1, -0.3]), np.array([0.1, 0.2, 0.3]))
    u, a, R = controller.wrench(0.0, m, ref), controller.u_pid, rotation_of(m.q)
    weight = np.array([0.0, 0.0, vehicle.mass * vehicle.gravity])
    np.testing.assert_allclose(u[:3], vehicle.mass * a[:3] + weight, atol=EXACT)
    turned = R @ rigid_inertia(vehicle) @ R.T
    np.testing.assert_allclose(u[3:], turned @ a[3:], atol=EXACT)
    np.testing.assert_allclose(controller.u_dc, [*weight, 0, 0, 0], atol=EXACT)


@pytest.mark.parametrize("law", ["pid", "dc-pid", "computed-wrench"])
@pytest.mark.parametrize(
    "tight", [0.98, [0.98, 0.98, 0.98, 9.0, 9.0, 9.0], [9, 9, 9, 0.9, 0.9, 0.9]]
)
def test_what_the_bounds_cut_off_drains_the_integrator_as_a_missing_wrench_does(
    vehicle, law, tight
):
    """The same law without bounds, told afterwards that it got what the bounds allow."""
    gains = {"position_gains": (9.0, 4.0, 6.0), "attitude_gains": (30.0, 9.0, 10.0)}
    m, ref = at(vehicle, (0, 0, 0), (0.1, -0.1, 0.2)), ReferencePoint()
    ref.pose = pose_from_euler(np.array([4.0, -4.0, 4.0]), np.array([0.8, 0.9, -0.7]))
    free = make_controller(law, vehicle, **gains)
    upper = np.array(tight) * np.abs(free.wrench(0.0, m, ref))
    bound = make_controller(law, vehicle, wrench_bounds=tuple(upper), **gains)
    lower = -upper * [1, 1, 0, 1, 1, 1]
    free.reset(m, ref)
    for _ in range(20):
        asked, got = free.wrench(0.0, m, ref), bound.wrench(0.0, m, ref)
        np.testing.assert_allclose(got, asked.clip(lower, upper), atol=EXACT)
        free.delivered(got, got - asked)
        integrals = [vector(c._memory.integral) for c in (free, bound)]
        np.testing.assert_allclose(*integrals, atol=EXACT)
    assert np.abs(integrals[0]).max() > 0.1


def test_uncontrolled_axes_get_no_feedback(vehicle):
    law = Law(vehicle, PidSettings(), 0.01, (False, False, True, True, True, True))
    m, ref = at(vehicle, (5, 5, 5), (0, 0, 0)), ReferencePoint()
    a = law.acceleration(m, ref)
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
