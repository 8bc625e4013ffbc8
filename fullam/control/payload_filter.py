"""A Kalman filter of a load's mass and first moment, four numbers, row by row."""

from __future__ import annotations

from fullam.numbers.kernel import absolute, kernel, maximum, select

LIGHTEST = 1e-3
"""For the prior of the first moment, which goes with the mass [kg]."""


@kernel
def begun(heaviest, reach, x, P, mass, fresh):
    """Nothing known, where it is fresh.

    Args:
        heaviest: Standard deviation of m [kg].
        reach: Of s per mass, each coordinate [m].
        x: (m, s), rewritten.
        P: Its covariance, four rows, rewritten.
        mass: As it is read first, which says how wide s may be [kg].
        fresh: Whether to begin.
    """
    m, s = heaviest, reach * maximum(absolute(mass), LIGHTEST)
    for i in range(4):
        x[i] = select(fresh, 0.0, x[i])
        for j in range(4):
            P[i][j] = select(fresh, 0.0, P[i][j])
    P[0][0] = select(fresh, m * m, P[0][0])
    for i in range(1, 4):
        P[i][i] = select(fresh, s * s, P[i][i])


@kernel
def take_in(x, P, row, value, variance, told):
    """Take in one number, row . x, where it is told.

    Args:
        x: State, four numbers, rewritten.
        P: Its covariance, four rows, rewritten.
        row: Four numbers.
        value: What is read.
        variance: Of the reading.
        told: Whether it counts.
    """
    a, b, c, d = row
    p = P[0][0] * a + P[0][1] * b + P[0][2] * c + P[0][3] * d
    q = P[1][0] * a + P[1][1] * b + P[1][2] * c + P[1][3] * d
    r = P[2][0] * a + P[2][1] * b + P[2][2] * c + P[2][3] * d
    s = P[3][0] * a + P[3][1] * b + P[3][2] * c + P[3][3] * d
    weight = select(told, 1.0 / (a * p + b * q + c * r + d * s + variance), 0.0)
    gain = weight * (value - (a * x[0] + b * x[1] + c * x[2] + d * x[3]))
    x[0], x[1] = x[0] + gain * p, x[1] + gain * q
    x[2], x[3] = x[2] + gain * r, x[3] + gain * s
    for i in range(4):
        # Of the covariance, as the row was before: c_i is P row.
        share = weight * select(i < 2, select(i == 0, p, q), select(i == 2, r, s))
        P[i][0] = P[i][0] - share * p
        P[i][1] = P[i][1] - share * q
        P[i][2] = P[i][2] - share * r
        P[i][3] = P[i][3] - share * s
