"""Positive definite systems whose matrix is a band around its diagonal, by Cholesky.

In compiled code on one thread: the result does not depend on how many threads a library takes, small systems do not
wait for each other, and nothing has to be imported that takes longer than what is to be solved.
"""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray


def band_solution(diagonals: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a system that is told by diagonals.

    Args:
        diagonals: (k + 1, n) of the symmetric matrix; in row o the entries at (i + o, i), the last o of no matter.
        right: (n, C) right sides.

    Returns:
        (n, C).

    Raises:
        ValueError: the matrix is not positive definite.
    """
    k, n = len(diagonals) - 1, len(right)
    band, solution = np.zeros((n, k + 1)), np.array(right, np.float64)
    for offset in range(min(k, n - 1) + 1):
        band[offset:, k - offset] = diagonals[offset, : n - offset]
    if not solve_band(band, solution):
        raise ValueError("expected a positive definite matrix")
    return solution


@njit(cache=True, nogil=True, fastmath=True)
def solve_band(band: FloatArray, right: FloatArray) -> bool:
    """Solve a system in place.

    Args:
        band: (n, k + 1) of each row, what is left of the diagonal and it; becomes the factor.
        right: (n, C) right sides; become the solutions.

    Returns:
        Whether the matrix is positive definite; if not, both are of no use.
    """
    if not _factored(band):
        return False
    n, k = band.shape[0], band.shape[1] - 1
    for c in range(right.shape[1]):
        for i in range(n):
            for j in range(max(0, i - k), i):
                right[i, c] -= band[i, k - i + j] * right[j, c]
            right[i, c] /= band[i, k]
        for i in range(n - 1, -1, -1):
            right[i, c] /= band[i, k]
            for j in range(max(0, i - k), i):
                right[j, c] -= band[i, k - i + j] * right[i, c]
    return True


@njit(cache=True, nogil=True, fastmath=True)
def _factored(band: FloatArray) -> bool:
    """Put Cholesky's factor in place of a matrix; whether there is one."""
    n, k = band.shape[0], band.shape[1] - 1
    for i in range(n):
        low, row = max(0, i - k), band[i]
        for j in range(low, i + 1):
            other, mine, its, total = band[j], low - i + k, low - j + k, 0.0
            for m in range(j - low):
                total += row[mine + m] * other[its + m]
            left = row[k - i + j] - total
            if j < i:
                row[k - i + j] = left / other[k]
            elif left > 0.0:
                row[k] = np.sqrt(left)
            else:
                return False
    return True
