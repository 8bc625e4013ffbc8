import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from fullam.dynamics import rotations as rot

ROUNDING = 1e-14
"""A handful of operations on numbers of order one."""

EULER_BRANCH = 1e-6
"""Angles this close to a branch or the singularity are tried in `test_euler_angles...`."""

angles = st.floats(-3.1, 3.1)
directions = st.tuples(*3 * [st.floats(-1, 1)]).filter(lambda v: np.linalg.norm(v) > 0.1)


def unit(v):
    return np.asarray(v) / np.linalg.norm(v)


def samples(n=200, seed=0):
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(n, 3))
    return axes / np.linalg.norm(axes, axis=1, keepdims=True), rng


@given(directions, directions)
def test_skew_15_is_the_cross_product(a, b):
    a, b = np.array(a), np.array(b)
    np.testing.assert_allclose(rot.skew(a) @ b, np.cross(a, b), atol=ROUNDING)
    np.testing.assert_allclose(rot.cross(a, b), np.cross(a, b), atol=ROUNDING)


@given(directions, angles)
def test_exponential_16_is_the_matrix_exponential(v, angle):
    v = unit(v)
    np.testing.assert_allclose(rot.exponential(v, angle), expm(rot.skew(v * angle)), atol=1e-13)


@given(angles, angles, angles)
def test_euler_2_is_intrinsic_xyz_and_not_roll_pitch_yaw(phi, psi, gamma):
    R = rot.euler_rotation(np.array([phi, psi, gamma]))
    scipy_R = Rotation.from_euler("XYZ", [phi, psi, gamma]).as_matrix()
    np.testing.assert_allclose(R, scipy_R, atol=ROUNDING)


def test_euler_2_differs_from_roll_pitch_yaw():
    angle = np.array([0.3, 0.4, 0.5])
    assert np.abs(rot.euler_rotation(angle) - pin.rpy.rpyToMatrix(*angle)).max() > 0.1


@pytest.mark.parametrize("psi", [0.0, 1.0, np.pi / 2 - EULER_BRANCH, np.pi / 2, -np.pi / 2])
def test_euler_angles_give_the_attitude_back_even_when_singular(psi):
    _, rng = samples()
    euler = rng.uniform(-np.pi, np.pi, (100, 3))
    euler[:, 1] = psi
    R = rot.euler_rotation(euler)
    np.testing.assert_allclose(rot.euler_rotation(rot.euler_angles(R)), R, atol=ROUNDING)


def test_euler_angles_invert_eq_2_away_from_the_singularity():
    _, rng = samples()
    euler = rng.uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1], (100, 3))
    # Near psi = 1.5 the angles amplify rounding by 1/cos(1.5) = 14.
    np.testing.assert_allclose(rot.euler_angles(rot.euler_rotation(euler)), euler, atol=1e-13)


def test_euler_rates_7_are_the_derivative_of_the_angles_of_2():
    _, rng = samples()
    euler = rng.uniform([-2.5, -1.2, -2.5], [2.5, 1.2, 2.5], (200, 3))
    w = rng.normal(size=(200, 3))
    speed = np.linalg.norm(w, axis=1)
    h = 1e-3

    def angles_at(t):
        return rot.euler_angles(
            rot.exponential(w / speed[:, None], speed * t) @ rot.euler_rotation(euler)
        )

    # Five-point stencil: its error is h^4 f^(5) / 30; f^(5) <= 5! (speed / cos psi)^5 < 1e7.
    def difference(t):
        return (angles_at(t) - angles_at(-t)) / (2 * t)

    numeric = (4 * difference(h) - difference(2 * h)) / 3
    np.testing.assert_allclose(rot.euler_rates(euler, w), numeric, atol=1e-6)


def test_world_inertia_14_keeps_principal_moments_and_turns_axes():
    axes, rng = samples(50)
    R = rot.exponential(axes, rng.uniform(-3, 3, 50))
    diagonal = np.array([1.0, 2.0, 2.5])
    turned = rot.world_inertia(R, np.diag(diagonal))
    # R's column k is the k-th principal axis in world axes.
    np.testing.assert_allclose(turned @ R, R * diagonal, atol=ROUNDING)


def test_relative_rotation_17_leads_from_current_to_desired_in_world_axes():
    axes, rng = samples(50)
    R_c = rot.exponential(axes, rng.uniform(-3, 3, 50))
    R_d = rot.exponential(axes[::-1], rng.uniform(-3, 3, 50))
    np.testing.assert_allclose(rot.relative_rotation(R_d, R_c) @ R_c, R_d, atol=ROUNDING)
    e_tau = rot.attitude_error(R_d, R_c)
    angle = np.linalg.norm(e_tau, axis=1)
    stepped = rot.exponential(e_tau / angle[:, None], angle) @ R_c
    np.testing.assert_allclose(stepped, R_d, atol=ROUNDING)


def printed_logarithm(R):
    """Eq. (18) as printed."""
    with np.errstate(invalid="ignore", divide="ignore"):
        angle = np.arccos((np.trace(R) - 1.0) / 2.0)
        w = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
        return angle * w / (2.0 * np.sin(angle))


def recovers(log, angle):
    """Whether a logarithm gives back rotations of this angle to a relative 1e-7.

    The matrix itself knows a small angle to its rounding, 1e-16 absolute, and a direction near pi
    as well; 1e-7 is far above that for every angle of the list.
    """
    axes, _ = samples(20)
    found = np.array([log(R) for R in rot.exponential(axes, np.full(20, angle))])
    return bool(np.all(np.linalg.norm(found - angle * axes, axis=1) < 1e-7 * angle))


ANGLES = [1e-9, 1e-6, 1e-3, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-6, np.pi - 1e-9]


@pytest.mark.parametrize("angle", ANGLES)
def test_logarithm_18_is_right_at_every_angle(angle):
    assert recovers(rot.logarithm, angle)
    assert recovers(pin.log3, angle)


@pytest.mark.parametrize("angle", [1e-3, 1.0, 3.0])
def test_printed_logarithm_18_is_transcribed_right(angle):
    assert recovers(printed_logarithm, angle)


@pytest.mark.parametrize("angle", [1e-9, np.pi - 1e-9])
def test_printed_logarithm_18_fails_at_both_ends(angle):
    assert not recovers(printed_logarithm, angle)


def test_logarithm_of_identity_and_half_turns():
    np.testing.assert_array_equal(rot.logarithm(np.eye(3)), np.zeros(3))
    for k in range(3):
        half_turn = np.diag(np.where(np.arange(3) == k, 1.0, -1.0))
        found = np.abs(rot.logarithm(half_turn))
        np.testing.assert_allclose(found, np.pi * np.eye(3)[k], atol=ROUNDING)


def test_batches_equal_single_calls():
    axes, rng = samples(12)
    R = rot.exponential(axes, rng.uniform(-3, 3, 12))
    w = rng.normal(size=(12, 3))
    grid = R.reshape(3, 4, 3, 3)
    for function in (rot.logarithm, rot.euler_angles):
        single = np.array([function(one) for one in R])
        np.testing.assert_allclose(function(grid).reshape(12, 3), single, atol=ROUNDING)
    rates = rot.euler_rates(rot.euler_angles(grid), w.reshape(3, 4, 3)).reshape(12, 3)
    one_by_one = [rot.euler_rates(rot.euler_angles(r), x) for r, x in zip(R, w, strict=True)]
    np.testing.assert_allclose(rates, one_by_one, rtol=1e-12)


def test_quaternion_rotation_is_pinocchios():
    axes, rng = samples(20)
    for R in rot.exponential(axes, rng.uniform(-3, 3, 20)):
        np.testing.assert_allclose(
            rot.quaternion_rotation(pin.Quaternion(R).coeffs()), R, atol=ROUNDING
        )
