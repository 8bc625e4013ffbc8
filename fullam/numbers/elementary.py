"""Sine, cosine, arc tangent and exponential of kernels: the same bits in Python and in lanes.

A mathematical library would give other last bits on other machines, and knows no lanes. So these
are polynomials, after a reduction of the argument that is exact.
"""

from __future__ import annotations

from typing import Any

from fullam.numbers.kernel import _symbolic, absolute, kernel, maximum, minimum, select

ROUNDER = 6755399441055744.0
"""1.5 * 2^52: adding and subtracting it rounds to the nearest whole number."""

PI_2 = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
"""pi / 2 in three parts of 33 bits: products with small whole numbers are exact (fdlibm)."""


def sincos(x: Any) -> tuple[Any, Any]:
    """Sine and cosine of an angle below 1000 rad, to one unit in the last place."""
    casadi = _symbolic(x)
    return sincos_series(x) if casadi is None else (casadi.sin(x), casadi.cos(x))


def arctan2(y: Any, x: Any) -> Any:
    """Angle of the point (x, y), to two units in the last place; 0 at the origin."""
    casadi = _symbolic(y)
    return arctan2_series(y, x) if casadi is None else casadi.atan2(y, x)


@kernel
def sincos_series(x):
    """Sine and cosine: reduced to +-pi/4, then fdlibm's polynomials."""
    n = (x * 0.63661977236758134308 + ROUNDER) - ROUNDER
    r = ((x - n * PI_2[0]) - n * PI_2[1]) - n * PI_2[2]
    z = r * r
    s = 2.75573137070700676789e-06 + z * (
        -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    )
    s = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * s)
    s = r + r * z * (-1.66666666666666324348e-01 + z * s)
    c = -2.75573143513906633035e-07 + z * (
        2.08757232129817482790e-09 + z * -1.13596475577881948265e-11
    )
    c = 4.16666666666666019037e-02 + z * (
        -1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * c)
    )
    h = 0.5 * z
    one = 1.0 - h
    c = one + ((1.0 - one) - h + z * z * c)
    half = (n * 0.5 - 0.25 + ROUNDER) - ROUNDER  # whole half turns
    odd = n - 2.0 * half > 0.5
    sine, cosine = select(odd, c, s), select(odd, -s, c)
    opposite = half - 2.0 * ((half * 0.5 - 0.25 + ROUNDER) - ROUNDER) > 0.5
    return select(opposite, -sine, sine), select(opposite, -cosine, cosine)


@kernel
def arctan2_series(y, x):
    """Angle of (x, y): reduced to a slope below tan(pi/8), then Cephes' rational function."""
    a, b = absolute(y), absolute(x)
    low, high = minimum(a, b), maximum(a, b)
    steep = low > 0.41421356237309503 * high
    below = select(steep, low + high, high)
    t = select(steep, low - high, low) / select(below > 0.0, below, 1.0)
    z = t * t
    p = -1.615753718733365076637e1 + z * -8.750608600031904122785e-1
    p = -1.228866684490136173410e2 + z * (-7.500855792314704667340e1 + z * p)
    p = -6.485021904942025371773e1 + z * p
    q = 1.650270098316988542046e2 + z * (2.485846490142306297962e1 + z)
    q = 4.853903996359136964868e2 + z * (4.328810604912902668951e2 + z * q)
    q = 1.945506571482613964425e2 + z * q
    angle = select(steep, 0.78539816339744830962, 0.0) + (t + t * z * (p / q))
    angle = select(a > b, 1.57079632679489661923 - angle, angle)
    angle = select(x < 0.0, 3.14159265358979323846 - angle, angle)
    return select(y < 0.0, -angle, angle)


@kernel
def decay(x):
    """1 - exp(-x) for 0 <= x, without cancellation for small x; above 40 it is 1 to rounding.

    A Taylor series of x / 64, and six times e(2 y) = e(y) (2 - e(y)) for e(y) = 1 - exp(-y).
    """
    y = 0.015625 * minimum(x, 40.0)
    s = 1.0 - y * (1 / 10) * (1.0 - y * (1 / 11) * (1.0 - y * (1 / 12) * (1.0 - y * (1 / 13))))
    s = 1.0 - y * (1 / 6) * (1.0 - y * (1 / 7) * (1.0 - y * (1 / 8) * (1.0 - y * (1 / 9) * s)))
    e = y * (
        1.0 - y * (1 / 2) * (1.0 - y * (1 / 3) * (1.0 - y * (1 / 4) * (1.0 - y * (1 / 5) * s)))
    )
    e = e * (2.0 - e)
    e = e * (2.0 - e)
    e = e * (2.0 - e)
    e = e * (2.0 - e)
    e = e * (2.0 - e)
    return e * (2.0 - e)
