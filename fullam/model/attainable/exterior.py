"""Exterior products in six dimensions: the vector orthogonal to five others.

The normal of a face of the attainable wrenches is orthogonal to the five generators that span the
face: the six minors of their 5 x 6 matrix. They are built from 2 x 2 minors (a plane) and 3 x 3
minors (a volume), so that faces which share generators share the work. All of it is sums of
products: it holds for numbers and, element by element, for arrays of them.
"""

from __future__ import annotations

from typing import Any

from fullam.model.attainable.machine import kernel

PLANE, VOLUME = 15, 20
"""Numbers of 2 x 2 minors of two, and of 3 x 3 minors of three vectors, in lexicographic order."""


@kernel
def plane(a: Any, b: Any) -> Any:
    """The 15 minors a_i b_j - a_j b_i, i < j, of two vectors: all 0 if they are parallel."""
    return (
        a[0] * b[1] - a[1] * b[0],
        a[0] * b[2] - a[2] * b[0],
        a[0] * b[3] - a[3] * b[0],
        a[0] * b[4] - a[4] * b[0],
        a[0] * b[5] - a[5] * b[0],
        a[1] * b[2] - a[2] * b[1],
        a[1] * b[3] - a[3] * b[1],
        a[1] * b[4] - a[4] * b[1],
        a[1] * b[5] - a[5] * b[1],
        a[2] * b[3] - a[3] * b[2],
        a[2] * b[4] - a[4] * b[2],
        a[2] * b[5] - a[5] * b[2],
        a[3] * b[4] - a[4] * b[3],
        a[3] * b[5] - a[5] * b[3],
        a[4] * b[5] - a[5] * b[4],
    )


@kernel
def volume(p: Any, c: Any) -> Any:
    """The 20 minors of three vectors, i < j < k, from the plane of two of them and the third."""
    return (
        p[0] * c[2] - p[1] * c[1] + p[5] * c[0],
        p[0] * c[3] - p[2] * c[1] + p[6] * c[0],
        p[0] * c[4] - p[3] * c[1] + p[7] * c[0],
        p[0] * c[5] - p[4] * c[1] + p[8] * c[0],
        p[1] * c[3] - p[2] * c[2] + p[9] * c[0],
        p[1] * c[4] - p[3] * c[2] + p[10] * c[0],
        p[1] * c[5] - p[4] * c[2] + p[11] * c[0],
        p[2] * c[4] - p[3] * c[3] + p[12] * c[0],
        p[2] * c[5] - p[4] * c[3] + p[13] * c[0],
        p[3] * c[5] - p[4] * c[4] + p[14] * c[0],
        p[5] * c[3] - p[6] * c[2] + p[9] * c[1],
        p[5] * c[4] - p[7] * c[2] + p[10] * c[1],
        p[5] * c[5] - p[8] * c[2] + p[11] * c[1],
        p[6] * c[4] - p[7] * c[3] + p[12] * c[1],
        p[6] * c[5] - p[8] * c[3] + p[13] * c[1],
        p[7] * c[5] - p[8] * c[4] + p[14] * c[1],
        p[9] * c[4] - p[10] * c[3] + p[12] * c[2],
        p[9] * c[5] - p[11] * c[3] + p[13] * c[2],
        p[10] * c[5] - p[11] * c[4] + p[14] * c[2],
        p[12] * c[5] - p[13] * c[4] + p[14] * c[3],
    )


@kernel
def normal(p: Any, t: Any) -> Any:
    """The vector n with n . x = det(x, a, b, c, d, e) for any x, orthogonal to all five.

    Args:
        p: Plane of a and b.
        t: Volume of c, d and e.

    Returns:
        Six numbers; their length is the 5-volume that the five vectors span.
    """
    return (
        p[5] * t[19]
        - p[6] * t[18]
        + p[7] * t[17]
        - p[8] * t[16]
        + p[9] * t[15]
        - p[10] * t[14]
        + p[11] * t[13]
        + p[12] * t[12]
        - p[13] * t[11]
        + p[14] * t[10],
        -p[1] * t[19]
        + p[2] * t[18]
        - p[3] * t[17]
        + p[4] * t[16]
        - p[9] * t[9]
        + p[10] * t[8]
        - p[11] * t[7]
        - p[12] * t[6]
        + p[13] * t[5]
        - p[14] * t[4],
        p[0] * t[19]
        - p[2] * t[15]
        + p[3] * t[14]
        - p[4] * t[13]
        + p[6] * t[9]
        - p[7] * t[8]
        + p[8] * t[7]
        + p[12] * t[3]
        - p[13] * t[2]
        + p[14] * t[1],
        -p[0] * t[18]
        + p[1] * t[15]
        - p[3] * t[12]
        + p[4] * t[11]
        - p[5] * t[9]
        + p[7] * t[6]
        - p[8] * t[5]
        - p[10] * t[3]
        + p[11] * t[2]
        - p[14] * t[0],
        p[0] * t[17]
        - p[1] * t[14]
        + p[2] * t[12]
        - p[4] * t[10]
        + p[5] * t[8]
        - p[6] * t[6]
        + p[8] * t[4]
        + p[9] * t[3]
        - p[11] * t[1]
        + p[13] * t[0],
        -p[0] * t[16]
        + p[1] * t[13]
        - p[2] * t[11]
        + p[3] * t[10]
        - p[5] * t[7]
        + p[6] * t[5]
        - p[7] * t[4]
        - p[9] * t[2]
        + p[10] * t[1]
        - p[12] * t[0],
    )
