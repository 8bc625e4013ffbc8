"""Covariance of the error of a motion that is known through biased inertial sensors.

The error is fifteen numbers, x = [position (world); attitude ({A}); velocity (world); bias of the
gyroscope; bias of the accelerometer]; in a control period T it becomes F x + noise with

    F = [F9, G; 0, 1],   G = [0, -T^2/2 R; -T 1, 0; 0, -T R],

F9 that of `kalman`. F is never written down: it is applied to the columns of P and then to the rows
of what results, of which the last six stay what they are. P is symmetric to the last bit.
"""

from __future__ import annotations

from typing import NamedTuple

from fullam.control.kalman import Error, Step, carry_error
from fullam.numbers.kernel import kernel
from fullam.numbers.vectors import Matrix, add, axpy, multiply, rotate


class BiasStep(NamedTuple):
    """What F is made of: F9, and d v+ / d b_f = -T R."""

    motion: Step
    pull: Matrix


@kernel
def scale_matrix(s, a):
    """Multiple s a of a matrix."""
    return (
        s * a[0],
        s * a[1],
        s * a[2],
        s * a[3],
        s * a[4],
        s * a[5],
        s * a[6],
        s * a[7],
        s * a[8],
    )


@kernel
def carry_biased(step, x, w, f):
    """The first nine entries of F x, for an error x of the motion and errors w, f of the biases."""
    T, y = step.motion.period, carry_error(step.motion, x)
    pulled = rotate(step.pull, f)
    return Error(
        axpy(0.5 * T, pulled, y.position), axpy(-T, w, y.attitude), add(y.velocity, pulled)
    )


@kernel
def predict(numbers, P, step, moved):
    """P becomes F P F^T + Q.

    Args:
        numbers: Variances; see `kalman_bias.KalmanBiasNumbers`.
        P: Covariance, fifteen rows.
        step: F.
        moved: How far the readings have moved of late, `Inertial`.
    """
    for j in range(15):
        y = carry_biased(
            step,
            Error(
                (P[0][j], P[1][j], P[2][j]),
                (P[3][j], P[4][j], P[5][j]),
                (P[6][j], P[7][j], P[8][j]),
            ),
            (P[9][j], P[10][j], P[11][j]),
            (P[12][j], P[13][j], P[14][j]),
        )
        P[0][j], P[1][j], P[2][j] = y.position
        P[3][j], P[4][j], P[5][j] = y.attitude
        P[6][j], P[7][j], P[8][j] = y.velocity
    for i in range(9):
        row = P[i]
        y = carry_biased(
            step,
            Error((row[0], row[1], row[2]), (row[3], row[4], row[5]), (row[6], row[7], row[8])),
            (row[9], row[10], row[11]),
            (row[12], row[13], row[14]),
        )
        row[0], row[1], row[2] = y.position
        row[3], row[4], row[5] = y.attitude
        row[6], row[7], row[8] = y.velocity
        for j in range(i):
            P[j][i] = row[j]
        for j in range(9, 15):
            P[j][i] = row[j]
    for i in range(3):
        P[i][i] = P[i][i] + numbers.position
        P[3 + i][3 + i] = P[3 + i][3 + i] + numbers.attitude
        P[6 + i][6 + i] = P[6 + i][6 + i] + numbers.velocity
        P[i][6 + i] = P[i][6 + i] + numbers.mixed
        P[6 + i][i] = P[6 + i][i] + numbers.mixed
    add_drift(numbers, P, moved)


@kernel
def add_drift(numbers, P, moved):
    """What a period adds to the variances of the biases: drift, and scale errors of a motion."""
    w = multiply(moved.gyroscope, moved.gyroscope)
    f = multiply(moved.accelerometer, moved.accelerometer)
    drift, by_square = numbers.drift, numbers.scale
    P[9][9] = P[9][9] + (drift[0] + by_square[0] * w[0])
    P[10][10] = P[10][10] + (drift[0] + by_square[0] * w[1])
    P[11][11] = P[11][11] + (drift[0] + by_square[0] * w[2])
    P[12][12] = P[12][12] + (drift[1] + by_square[1] * f[0])
    P[13][13] = P[13][13] + (drift[1] + by_square[1] * f[1])
    P[14][14] = P[14][14] + (drift[1] + by_square[1] * f[2])


@kernel
def absorb(P, x, c, weight, surprise):
    """Take in a number whose error has the covariances c with the state's, in the lower triangle.

    Args:
        P: Covariance.
        x: Correction so far.
        c: Covariances of the state with the number.
        weight: 1 over the variance of the number as it is read.
        surprise: What is read less what is expected after the correction so far.
    """
    gain = weight * surprise
    for i in range(15):
        x[i] = x[i] + c[i] * gain
        share = weight * c[i]
        row = P[i]
        for m in range(i + 1):
            row[m] = row[m] - share * c[m]


@kernel
def mirror(P):
    """Have the upper triangle mirror the lower."""
    for i in range(15):
        for j in range(i):
            P[j][i] = P[i][j]
