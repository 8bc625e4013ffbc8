"""The compiled engine: the whole flight loop as machine code, through numba.

It starts from the same `FlightPlan` as the reference engine (same tables, same weather, same true
vehicle) and flies the same flight to rounding, about ten times faster or more. Its equations are
written out here once more, by the paper's recursion instead of Pinocchio's algorithms, so each
engine is the other's witness. `simulate(..., engine="compiled")` uses it; the extra `fullam[fast]`
brings numba, which nothing else in fullam needs.

Modules, inner ones first:
    jit           how functions are compiled and kept on disk
    rotations     3-vectors, rotation matrices and quaternions as tuples of floats
    dynamics      the sweep over the links; the platform's acceleration under a prescribed arm
    integrate     steps of the plant
    law           PID, dc-PID and the pose filter
    backstepping  the law of that name
    box_qp        the box problem and its warm active set
    allocation    exact map, warm active set, flagged clip
    moment_about  allocation about the centre of mass
    loop          the flight, tick by tick
    entries       what Python calls
    arrays        a `FlightPlan` as flat arrays
    engine        from plan to `Run`
    batch         many seeds of one plan
    tick          a controller and its allocator in one call
"""
