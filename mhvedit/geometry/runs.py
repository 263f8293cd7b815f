"""Maps of bytes as runs of equal values: a map of reasons is a hundred times smaller so, and as quickly read."""

import numpy as np

from mhvedit.geometry.arrays import ByteArray, IntArray


def run_lengths(values: ByteArray) -> tuple[ByteArray, IntArray]:
    """The runs of equal values in a row of bytes.

    Args:
        values: (N,).

    Returns:
        (R,) their values, and (R,) how long they are; `np.repeat` makes the row of them again.
    """
    starts = np.flatnonzero(values[1:] != values[:-1]) + 1
    if len(values):
        starts = np.append(0, starts)
    return values[starts], np.diff(starts, append=len(values))
