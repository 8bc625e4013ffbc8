"""One plan flown in another way, and whether records agree to the last bit."""

import numpy as np

from fullam.numbers.program import program
from fullam.simulation.block import Block
from fullam.simulation.fused import Fused, run_of
from fullam.simulation.tables import Tables


def fly_interpreted(plan):
    """The record by the fused driver's kernels, called by plain Python."""
    block = Block(Tables(plan))
    block.load(plan)
    block.begin()
    stages, last = block.stages(), block.tables.periods - 1
    program(list(stages.values()), compiled=False).run(0, last)
    del stages["move"]
    program(list(stages.values()), compiled=False).run(last, last + 1)
    return run_of(block, plan)


def fly_scalar(plan, seeds):
    """The records of some seeds by scalar machine code, one after the other."""
    fused = Fused(Tables(plan))
    for seed in seeds:
        own = plan.with_seed(seed)
        fused.block.load(own)
        fused.fly()
        yield run_of(fused.block, own)


def assert_same_bits(a, b):
    """The same columns and the same metadata."""
    assert a.columns.keys() == b.columns.keys()
    for name in a.columns:
        np.testing.assert_array_equal(a.columns[name], b.columns[name], err_msg=name)
    assert a.metadata == b.metadata
