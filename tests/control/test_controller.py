"""What every registered law promises to those who call it."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.control.controller import Measurement, ReferencePoint
from fullam.control.controllers import controller_names, make_controller
from fullam.model.loading import load_vehicle


@pytest.mark.parametrize("name", controller_names())
def test_an_attitude_that_is_shared_is_the_measured_one_live(name):
    """One array for life: who turns the wrench looks it up once. Rounding of two formulas."""
    vehicle = load_vehicle("fullam")
    law = make_controller(name, vehicle)
    shared = law.attitude
    assert shared is not None or name == "backstepping"
    m, ref = Measurement(vehicle), ReferencePoint()
    law.reset(m, ref)
    for turn in ([0.2, -0.1, 0.3], [-0.4, 0.0, 1.0]):
        m.q[3:7] = pin.Quaternion(pin.exp3(np.array(turn))).coeffs()
        law.wrench(0.0, m, ref)
        assert law.attitude is shared
        if shared is not None:
            np.testing.assert_allclose(shared, pin.exp3(np.array(turn)), rtol=0, atol=1e-14)
