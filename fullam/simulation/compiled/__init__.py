"""The compiled engine: the whole flight loop as machine code, through numba.

It starts from the same `FlightPlan` as the reference engine (same tables, same weather, same true
vehicle) and flies the same flight to rounding, ten to fifty times faster. Its equations are written
out here once more, by the paper's recursion instead of Pinocchio's algorithms, so each engine is
the other's witness. `simulate(..., engine="compiled")` uses it; the extra `fullam[fast]` brings
numba, which nothing else in fullam needs.

Modules, inner ones first:
    jit         how functions are compiled and kept on disk
    rotations   3-vectors, rotation matrices and quaternions as tuples of floats
    dynamics    the sweep over the links; the platform's acceleration under a prescribed arm
    integrate   steps of the plant
    law         PID, dc-PID and the pose filter
    allocation  exact map, warm active set, flagged clip
    loop        the flight, tick by tick
    arrays      a `FlightPlan` as flat arrays
    engine      from plan to `Run`
    batch       many seeds of one plan
"""
