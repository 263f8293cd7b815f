"""Finding numbers in a row of numbers."""

import numpy as np

from mhvedit.geometry.arrays import Int32Array, IntArray


def rows_in(ascending: IntArray | Int32Array, wanted: IntArray | Int32Array) -> IntArray:
    """Where numbers stand, -1 for those that are not there.

    Args:
        ascending: (N,) none twice, at least one.
        wanted: (M,) of the same type, or all of the others would be converted for it.

    Returns:
        (M,).
    """
    rows = np.minimum(np.searchsorted(ascending, wanted), len(ascending) - 1)
    return np.where(ascending[rows] == wanted, rows, -1)
