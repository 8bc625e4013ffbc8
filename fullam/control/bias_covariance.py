"""Covariance of the error of a motion that is known through biased inertial sensors.

The error is fifteen numbers, x = [p; e; v; b; c]: position (world), attitude ({A}), velocity
(world), bias of the gyroscope, bias of the accelerometer. The estimate is carried by trapezoids
(`kalman.carry`) from R_0 with readings f_0 to R_1 with readings f_1, and what becomes of x in that
control period T is their derivative,

    e+ = E (e - T/2 b) - T/2 b,                        E = R_1^T R_0,
    v+ = v - T/2 (R_0 s(f_0) e + R_1 s(f_1) e+ + (R_0 + R_1) c),
    p+ = p + T/2 (v + v+),   b+ = b,   c+ = c,

to T^3. This is finer than `kalman` needs: a bias is large at first and known to a hundredth of that
soon after, so each period has to carry it to better than that. F is never written down: it is
applied to the columns of P and then to the rows of what results, of which the last six stay what
they are. P is symmetric to the last bit.
"""

from __future__ import annotations

from typing import NamedTuple

from fullam.control.kalman import Error, add_noise, pushed
from fullam.dynamics.so3 import rotation_matrix
from fullam.numbers.kernel import Number, kernel
from fullam.numbers.vectors import Matrix, add, axpy, multiply, rotate, scale


class BiasStep(NamedTuple):
    """What F is made of: T; E; -T/2 R s(f) at both ends; -T/2 (R_0 + R_1)."""

    period: Number
    turn: Matrix
    first: Matrix
    second: Matrix
    pull: Matrix


@kernel
def bias_step(period, before, after):
    """F of a control period, from the `InertialPose` at its ends, readings less their biases."""
    R, S = rotation_matrix(before.pose.attitude), rotation_matrix(after.pose.attitude)
    half = -0.5 * period
    pull = (
        half * (R[0] + S[0]), half * (R[1] + S[1]), half * (R[2] + S[2]),
        half * (R[3] + S[3]), half * (R[4] + S[4]), half * (R[5] + S[5]),
        half * (R[6] + S[6]), half * (R[7] + S[7]), half * (R[8] + S[8]),
    )  # fmt: skip
    turn = (
        S[0] * R[0] + S[3] * R[3] + S[6] * R[6],
        S[0] * R[1] + S[3] * R[4] + S[6] * R[7],
        S[0] * R[2] + S[3] * R[5] + S[6] * R[8],
        S[1] * R[0] + S[4] * R[3] + S[7] * R[6],
        S[1] * R[1] + S[4] * R[4] + S[7] * R[7],
        S[1] * R[2] + S[4] * R[5] + S[7] * R[8],
        S[2] * R[0] + S[5] * R[3] + S[8] * R[6],
        S[2] * R[1] + S[5] * R[4] + S[8] * R[7],
        S[2] * R[2] + S[5] * R[5] + S[8] * R[8],
    )
    first = pushed(R, scale(half, before.inertial.accelerometer))
    second = pushed(S, scale(half, after.inertial.accelerometer))
    return BiasStep(period, turn, first, second, pull)


@kernel
def carry_biased(step, x, b, c):
    """The first nine entries of F x, for an error x of the motion and errors b, c of the biases."""
    half = -0.5 * step.period
    e = axpy(half, b, rotate(step.turn, axpy(half, b, x.attitude)))
    push = add(rotate(step.first, x.attitude), rotate(step.second, e))
    v = add(x.velocity, add(push, rotate(step.pull, c)))
    p = axpy(-half, add(x.velocity, v), x.position)
    return Error(p, e, v)


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
    add_noise(numbers.kalman, P)
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
