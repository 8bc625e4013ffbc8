"""What hangs at the tool, learned in flight: mass and first moment, by a Kalman filter.

A body of mass m at c from the tool's point, axes of the arm's last link, has the first moment
s = m c there, and pulls at the origin of {A} with

    f = m g,    tau = L x g,    L = m r + R s,

r the way from {A} to the tool's point, R the attitude of the last link. What the momentum observer
(`wrench_observer`) does not explain, d, less its mean before the gripper closed (the tare), tells m
and the horizontal part of L: three rows for four unknowns. The state (m, s) is a random walk; a
prior holds s within `reach` of m, and with it what links of one attitude leave open. Gusts do not
average out from period to period: a row's variance is measured with the tare, and taken times
their correlation.

Nothing is told while the platform accelerates or something turns, or did within the observer's lag:
the estimate is then frozen. The gripper tells when it closes and opens; the tare needs a second of
hover before it closes.

**Hand-over.** Bit by bit the estimate becomes a load that is known: the servos' goals, the twin and
what is added to the law's command (`payload_lift`) are told. With each bit the law is relieved of
the weight that its observer or its integrator held for a disturbance (`relieved` of
`fullam.control.law`), so that its command goes on where it was. When the gripper opens, all of it
is gone at once.

**What it brings.** On `pick-and-place` with dc-PID+, paper weather, seeds 0 to 63, the mass is
known to 6 g, RMS, from 0.7 s after the pick-up on (17 g at worst). Mean and worst distance from the
target, unknown, learned and `known`:

    after the pick-up    8.2, 13.4    8.2, 13.4    7.6, 13.3 mm
    on the way           7.8, 11.4    7.8, 11.5    7.8, 11.4 mm
    after the drop       7.8, 12.0    7.1, 10.3    7.1, 10.3 mm
    tool, RMS, carried   9.4          5.5          5.4 mm

and after the drop in calm air, where no gust hides it, 4.4, 0.9 and 0.9 mm; in paper weather dc-PID
behind the Kalman filter 73, 20 and 16 mm. The hand-over changes the commanded force by up to 0.03 N
from period to period, 2 % of the weight; as the arm comes up again, the goals in whole steps of the
servo, it is 0.22 N. Little is lost by it, then, but not nothing, and "unknown" stays the default.
The velocity behind the paper's first-order filter is too rough for anything to count as still:
there nothing is learned, and flown as if it were unknown.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from fullam.control.caution import Halves
from fullam.control.payload_filter import begun, take_in
from fullam.control.wrench_observer import (
    ObserverMemory,
    ObserverNumbers,
    asked,
    nothing_observed,
    observed,
)
from fullam.dynamics.recursion import Chain
from fullam.dynamics.so3 import boxplus, rotation_matrix
from fullam.dynamics.spatial import Spatial, rotate_spatial_back
from fullam.numbers.kernel import (
    Number,
    absolute,
    both,
    either,
    kernel,
    maximum,
    minimum,
    select,
)
from fullam.numbers.vectors import (
    IDENTITY,
    ZERO,
    Vector,
    add,
    axpy,
    dot,
    multiply,
    rotate,
    scale,
    subtract,
)


class LearnNumbers(NamedTuple):
    """How a load is learned.

    The observer; the tool's point, axes of the last row; gravity; standard deviations of a mass
    and, per mass, of its centre before anything is known; a period's share in the variance of a
    row by which m and s walk; periods over which gusts are one; least variances of a row, of m and
    of L. Share of a new value in the filters of what moves; bounds of acceleration and of rates;
    periods that a filter remembers; periods of the tare at most, and those to be told before
    anything is handed over; share of what is left that is handed over in a period.
    """

    observer: ObserverNumbers
    tool: Vector
    gravity: Number
    heaviest: Number
    reach: Number
    walk: Number
    correlation: Number
    floor: Vector
    share: Number
    acceleration: Number
    turning: Number
    lag: Number
    tare: Number
    enough: Number
    over: Number


class Held(NamedTuple):
    """What hangs there: mass, and first moment about the joint of the last link, in its axes."""

    mass: Number
    moment: Vector


class Moving(NamedTuple):
    """How much moves: velocity of {A}, its change filtered once and twice, its turning filtered.

    World axes; and the periods since something was fast.
    """

    velocity: Vector
    once: Vector
    twice: Vector
    turning: Vector
    quiet: Number


class Tare(NamedTuple):
    """Mean and variance of (m, L_x, L_y) with an open gripper, and periods in them."""

    mean: Vector
    variance: Vector
    periods: Number


class LearnMemory(NamedTuple):
    """What is remembered of a load.

    The observer; what moves; the tare; 1 while the gripper is closed, periods since it moved, and
    how many of them told of what it holds; what is handed over.
    """

    observer: ObserverMemory
    moving: Moving
    tare: Tare
    closed: Number
    since: Number
    told: Number
    held: Held


class Gripper(NamedTuple):
    """1 while it is closed around something unknown, else 0: in this period, and in the next."""

    closed: Number
    then: Number


class LearnView(NamedTuple):
    """What `learn` is shown.

    One row of `LearnNumbers`; the law's links; joints and their motions, and rows of them in a
    period; the estimate; what it turns on until the rotors follow; what was delivered; the gripper.
    Rewritten are the memory, (m, s) and its covariance (four rows). Written is the weight that
    is handed over anew.
    """

    numbers: Any
    links: Any
    joints: Any
    motions: Any
    joint_rows: Any
    estimate: Any
    ahead: Any
    delivery: Any
    gripper: Any
    memory: Any
    state: Any
    covariance: Any
    weight: Any


@kernel
def last_link(joints):
    """Attitude of the last link, and where its joint is from the origin of {A}, {A} axes."""
    R, p = IDENTITY, ZERO
    for i in range(len(joints)):
        R, p = joints[i].rotation, add(p, joints[i].step)
    return R, p


@kernel
def weight_of(held, joints, R, gravity):
    """Wrench of gravity on what is held, at the origin of {A}, world axes.

    Args:
        held: `Held`.
        joints: Of the arm.
        R: Attitude of {A}.
        gravity: Along -z [m/s^2].
    """
    turn, place = last_link(joints)
    lever = rotate(R, axpy(held.mass, place, rotate(turn, held.moment)))
    return Spatial((0.0, 0.0, -gravity * held.mass), (-gravity * lever[1], gravity * lever[0], 0.0))


@kernel
def moved(numbers, estimate, motions, memory):
    """`Moving` one period on."""
    a, velocity = numbers.share, estimate.velocity
    change = scale(1.0 / numbers.observer.period, subtract(velocity.linear, memory.velocity))
    once = axpy(a, subtract(change, memory.once), memory.once)
    twice = axpy(a, subtract(once, memory.twice), memory.twice)
    turning = axpy(a, subtract(velocity.angular, memory.turning), memory.turning)
    fast = dot(twice, twice) > numbers.acceleration * numbers.acceleration
    fast = either(fast, dot(turning, turning) > numbers.turning * numbers.turning)
    for i in range(len(motions)):
        fast = either(fast, absolute(motions[i].rate) > numbers.turning)
    quiet = select(fast, 0.0, memory.quiet + 1.0)
    return Moving(velocity.linear, once, twice, turning, quiet)


@kernel
def weighed(numbers, tare, read, weighing):
    """The tare one period on."""
    count = minimum(tare.periods + 1.0, numbers.tare)
    gap = subtract(read, tare.mean)
    mean = axpy(1.0 / count, gap, tare.mean)
    spread = multiply(gap, subtract(read, mean))
    variance = axpy(1.0 / count, subtract(spread, tare.variance), tare.variance)
    return select(weighing, Tare(mean, variance, count), tare)


@kernel
def filtered(numbers, view, axes, tool, value, variance, told):
    """Take in (m, L_x, L_y) of a period, which are linear in (m, s).

    Args:
        numbers: `LearnNumbers`.
        view: `LearnView`.
        axes: Of the last link, x, y and z, world axes.
        tool: The tool's point from the origin of {A}, world axes.
        value: What is read.
        variance: Of each of the three.
        told: Whether it counts.
    """
    x, P = view.state, view.covariance
    x_axis, y_axis, z_axis = axes
    walk = select(told, numbers.walk, 0.0)
    P[0][0] = P[0][0] + walk * variance[0]
    for i in range(1, 4):
        P[i][i] = P[i][i] + walk * maximum(variance[1], variance[2])
    take_in(x, P, (1.0, 0.0, 0.0, 0.0), value[0], variance[0], told)
    take_in(x, P, (tool[0], x_axis[0], y_axis[0], z_axis[0]), value[1], variance[1], told)
    take_in(x, P, (tool[1], x_axis[1], y_axis[1], z_axis[1]), value[2], variance[2], told)


@kernel
def nothing_learned(numbers, chain, estimate):
    """The memory at the start; nothing hangs, nothing is known."""
    observer = nothing_observed(numbers.observer, chain, estimate)
    moving = Moving(estimate.velocity.linear, ZERO, ZERO, ZERO, 0.0)
    nothing = Held(0.0, ZERO)
    return LearnMemory(observer, moving, Tare(ZERO, ZERO, 0.0), 0.0, 0.0, 0.0, nothing)


@kernel
def learn(view, k):
    """Learn from control period k; see the module's text."""
    numbers, estimate, g = view.numbers[0], view.estimate[0], view.numbers[0].gravity
    at = k * int(view.joint_rows[0])
    joints, chain = view.joints[at], Chain(view.links, view.joints[at])
    if k == 0:
        view.memory[0] = nothing_learned(numbers, chain, estimate)
    memory, gripper = view.memory[0], view.gripper[0]
    R = rotation_matrix(estimate.pose.attitude)
    observer = observed(numbers.observer, Halves(1.0, 1.0), chain, estimate, memory.observer)
    d = observer.wrench
    read = (-d.linear[2] / g, d.angular[1] / g, -d.angular[0] / g)  # (m, L_x, L_y) and the tare

    moving = moved(numbers, estimate, view.motions[at], memory.moving)
    since = select(gripper.closed == memory.closed, memory.since + 1.0, 0.0)
    still, holds = both(moving.quiet >= numbers.lag, since >= numbers.lag), gripper.closed > 0.0
    told = both(still, holds)
    tare = weighed(numbers, memory.tare, read, both(still, gripper.closed <= 0.0))
    variance = (
        numbers.correlation * maximum(tare.variance[0], numbers.floor[0]),
        numbers.correlation * maximum(tare.variance[1], numbers.floor[1]),
        numbers.correlation * maximum(tare.variance[2], numbers.floor[2]),
    )
    value = subtract(read, tare.mean)
    heaviest, reach = numbers.heaviest, numbers.reach
    begun(heaviest, reach, view.state, view.covariance, value[0], memory.told <= 0.0)
    turn, place = last_link(joints)
    axes = (
        rotate(R, (turn[0], turn[3], turn[6])),
        rotate(R, (turn[1], turn[4], turn[7])),
        rotate(R, (turn[2], turn[5], turn[8])),
    )
    tool = rotate(R, add(place, rotate(turn, numbers.tool)))
    filtered(numbers, view, axes, tool, value, variance, told)

    count = select(holds, memory.told + select(told, 1.0, 0.0), 0.0)
    x, spread = view.state, view.covariance[0][0]
    sure = both(count >= numbers.enough, both(x[0] > 0.0, x[0] * x[0] > 9.0 * spread))
    known = Held(x[0], axpy(x[0], numbers.tool, (x[1], x[2], x[3])))
    held = select(holds, memory.held, Held(0.0, ZERO))
    gone = both(sure, gripper.then < gripper.closed)  # what was not handed over is relieved at once
    part = select(gone, 1.0, select(sure, numbers.over, 0.0))
    new = Held(part * (known.mass - held.mass), scale(part, subtract(known.moment, held.moment)))
    held = Held(held.mass + new.mass, add(held.moment, new.moment))
    view.weight[0] = weight_of(new, joints, R, g)
    R = rotation_matrix(boxplus(estimate.pose.attitude, view.ahead[k].turn))
    observer = asked(observer, rotate_spatial_back(R, view.delivery[0].wrench))
    view.memory[0] = LearnMemory(observer, moving, tare, gripper.closed, since, count, held)
