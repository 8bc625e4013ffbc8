"""What the dynamics tests share: random chains, and states that paper and witness both read."""

import numpy as np
import pinocchio as pin
import pytest

from fullam.analysis.random_states import randomized_inertias
from fullam.model.loading import load_vehicle


def random_chain(joints, rng, tool_link=None):
    """A free-flying chain with random axes and placements, and a tool off the origin.

    `joints` is their number, all revolute, or a text with R and P for each: "RPR". The tool is on
    the last link unless another is said (0 is the platform).
    """
    kinds = "R" * joints if isinstance(joints, int) else joints
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    for i, kind in enumerate(kinds, start=1):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        turn = pin.exp3(rng.uniform(-2, 2, 3))
        placement = pin.SE3(turn, rng.uniform(-0.3, 0.3, 3))
        unaligned = {"R": pin.JointModelRevoluteUnaligned, "P": pin.JointModelPrismaticUnaligned}
        model.addJoint(i, unaligned[kind](axis), placement, f"joint_{i}")
    tool = pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), rng.uniform(-0.3, 0.3, 3))
    link = len(kinds) if tool_link is None else tool_link
    model.addFrame(pin.Frame("tool", link + 1, 0, tool, pin.FrameType.OP_FRAME))
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
