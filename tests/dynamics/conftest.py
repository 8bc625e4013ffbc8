"""What the dynamics tests share: random chains, and states that paper and witness both read."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.analysis.random_states import randomized_inertias
from fullam.model.loading import load_vehicle


def random_chain(n, rng):
    """A free-flying chain of n revolute joints, axes and placements random, tool off the origin."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    for i in range(1, n + 1):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        turn = pin.exp3(rng.uniform(-2, 2, 3))
        placement = pin.SE3(turn, rng.uniform(-0.3, 0.3, 3))
        model.addJoint(i, pin.JointModelRevoluteUnaligned(axis), placement, f"joint_{i}")
    tool = pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), rng.uniform(-0.3, 0.3, 3))
    model.addFrame(pin.Frame("tool", n + 1, 0, tool, pin.FrameType.OP_FRAME))
    return randomized_inertias(model, rng)


@pytest.fixture(scope="session")
def make_chain():
    return random_chain


@pytest.fixture(scope="session")
def fullam():
    return load_vehicle("fullam")


@pytest.fixture(scope="session", params=["fullam", "hextilt", "borinot"])
def vehicle(request):
    return load_vehicle(request.param)
