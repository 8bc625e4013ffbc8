"""Which poses a filter takes for outliers, and how it doubts itself when it takes many for such.

A pose with the innovation y, of covariance S = H P H^T + N, is plausible where

    y^T S^-1 y <= gate,    chi-square with six degrees of freedom.

After a time without poses P has grown, and S with it. A filter that is surer than it is right would
reject for ever: so after some rejections in a row each further one multiplies P, and before long,
whatever the distance, a pose is plausible again.
"""

from __future__ import annotations

from fullam.numbers.kernel import both, kernel, select, some


@kernel
def distance(numbers, memory):
    """Squared Mahalanobis distance y^T S^-1 y of a pose, by S = L D L^T."""
    own = numbers.kalman
    P, y, L, z = memory.covariance, memory.innovation, memory.factor, memory.column
    total = 0.0 * y[0]
    for i in range(6):
        z[i] = y[i]
        for j in range(i + 1):
            s = P[i][j]
            if i == j:
                s = s + (own.read_position if i < 3 else own.read_attitude)
            for m in range(j):
                s = s - L[i][m] * L[j][m] * L[m][m]
            L[i][j] = s if i == j else s / L[j][j]
        for m in range(i):
            z[i] = z[i] - L[i][m] * z[m]
        total = total + z[i] * z[i] / L[i][i]
    return total


@kernel
def doubt(numbers, memory, is_new, plausible):
    """Count rejections in a row, and let P grow after some of them."""
    P, count = memory.covariance, memory.rejected[0]
    count = select(is_new, select(plausible, 0.0, count + 1.0), count)
    memory.rejected[0] = count
    many = both(is_new, count > numbers.patience)
    if some(many):
        growth = select(many, numbers.growth, 1.0)
        for i in range(15):
            row = P[i]
            for j in range(i + 1):
                row[j] = row[j] * growth
