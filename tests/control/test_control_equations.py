"""Eqs. (19) and (26) as the paper writes them, on the controllers that fly."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.analysis.random_states import random_states
from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.dc_pid import DcPid, DcPidSettings
from fullam.control.pid import Pid, PidSettings
from fullam.dynamics.kinematics import motion_of
from fullam.dynamics.matrix_system import platform_inertia
from fullam.dynamics.paper_model import PaperModel
from fullam.dynamics.rotations import attitude_error, euler_rotation, quaternion_rotation, turn
from fullam.model.loading import load_vehicle

PERIOD = 0.01
ROUNDING = 1e-11
"""Sums of products of numbers up to 100."""

MATRIX = 1e-10
"""Relative: rounding times the condition number of the matrix system."""


@pytest.fixture(scope="module", params=["fullam", "hextilt"])
def vehicle(request):
    return load_vehicle(request.param)


def told(vehicle, seed=0):
    """A measurement near a reference, all of it moving."""
    s = random_states(vehicle.n_arm, "ordinary", 1, np.random.default_rng(seed))
    measurement, reference = Measurement(vehicle), ReferencePoint()
    measurement.q[:], measurement.v[:] = s.q[0], s.v[0]
    measurement.arm_acceleration[:] = s.ddtheta[0]
    R_d = euler_rotation(np.array([0.4, 0.3, -0.6]))
    reference.pose[:3] = s.q[0, :3] + [0.3, -0.2, 0.1]
    reference.pose[3:] = pin.Quaternion(R_d).coeffs()
    reference.velocity[:] = [0.1, 0.2, -0.1, 0.3, 0.1, -0.2]
    return measurement, reference


def paper_errors(measurement, reference):
    """Pose error (e_f, e_tau) and its rate, force axes first, world axes: eqs. (17)-(18)."""
    R_c = quaternion_rotation(measurement.q[3:7])
    R_d = quaternion_rotation(reference.pose[3:])
    e_f = reference.pose[:3] - measurement.q[:3]
    v, w = turn(R_c, measurement.v[:3]), turn(R_c, measurement.v[3:6])
    rate = reference.velocity - np.concatenate([v, w])
    return np.concatenate([e_f, attitude_error(R_d, R_c)]), rate


def test_pid_19_is_the_sum_of_its_three_terms(vehicle):
    settings = PidSettings(position_gains=(9.0, 0.5, 6.0), attitude_gains=(30.0, 2.0, 10.0))
    controller = Pid(vehicle, settings, PERIOD)
    measurement, reference = told(vehicle)
    e, rate = paper_errors(measurement, reference)
    k_p, k_i, k_d = (np.repeat(pair, 3) for pair in ((9.0, 30.0), (0.5, 2.0), (6.0, 10.0)))
    for tick in range(4):
        controller.wrench(0.0, measurement, reference)
        # The error is constant, so its integral at this tick is tick * period * e.
        expected = k_p * e + k_i * (tick * PERIOD * e) + k_d * rate
        np.testing.assert_allclose(controller.u_pid, expected, atol=ROUNDING)


@pytest.mark.parametrize("model", ["pinocchio", "recursion"])
def test_dc_pid_26_is_inertia_times_u_pid_plus_u_dc(vehicle, model):
    controller = DcPid(vehicle, DcPidSettings(model=model), PERIOD)
    measurement, reference = told(vehicle)
    controller.reset(measurement, reference)
    u = controller.wrench(0.0, measurement, reference).copy()
    paper = PaperModel(vehicle)
    inertia = platform_inertia(paper.chain, motion_of(paper.chain, measurement.q, measurement.v))
    np.testing.assert_allclose(
        u, inertia @ controller.u_pid + controller.u_dc, atol=MATRIX * np.abs(u).max()
    )
    # u_dc is that of the paper's matrix system at the same wanted acceleration.
    u_dc = paper.compensation(
        measurement.q,
        measurement.v,
        measurement.arm_acceleration,
        acceleration_W=controller.u_pid,
    )
    np.testing.assert_allclose(controller.u_dc, u_dc, atol=MATRIX * np.abs(u_dc).max())
