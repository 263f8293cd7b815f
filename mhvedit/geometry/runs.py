"""Maps of bytes as runs of equal values: a map of reasons is a hundred times smaller so, and as quickly read."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, ByteArray, IntArray

THREADS = 2
PORTIONS = 16  # in which a map is handed to the threads


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


def byte_counts(values: ByteArray, kinds: int) -> IntArray:
    """How often each of the first so many values comes.

    Args:
        values: of any shape.
        kinds: at most 256.

    Returns:
        (kinds,).
    """
    return np.asarray(_counted(np.ascontiguousarray(values).reshape(-1))[:kinds])


def runs_along_rows(inside: BoolArray) -> tuple[IntArray, IntArray]:
    """The runs of a set of cells along the last axis.

    Args:
        inside: (X, Y, Z).

    Returns:
        (R, 2) start and stop of each run, row by row, and (X * Y + 1,) where those of each row start.
    """
    with ThreadPoolExecutor(THREADS) as pool:
        parts = list(pool.map(_runs_of_planes, np.array_split(inside, min(len(inside), PORTIONS))))
    starts = np.concatenate([[0], np.cumsum(np.concatenate([count for _, count in parts]))])
    return np.concatenate([run for run, _ in parts]), starts


@njit(cache=True, nogil=True)
def _counted(values: ByteArray) -> IntArray:
    """(256,) how often each byte comes; four counts at a time, since equal bytes follow each other."""
    counts = np.zeros((4, 256), np.int64)
    whole = len(values) // 4 * 4
    for n in range(0, whole, 4):
        counts[0, values[n]] += 1
        counts[1, values[n + 1]] += 1
        counts[2, values[n + 2]] += 1
        counts[3, values[n + 3]] += 1
    for n in range(whole, len(values)):
        counts[0, values[n]] += 1
    return np.asarray(counts.sum(0))


@njit(cache=True, nogil=True)
def _runs_of_planes(inside: BoolArray) -> tuple[IntArray, IntArray]:
    """Runs of some planes, and how many each row has."""
    n_x, n_y, n_z = inside.shape
    count = np.zeros(n_x * n_y, np.int64)
    for x in range(n_x):
        for y in range(n_y):
            before, total = False, 0
            for z in range(n_z):
                total += inside[x, y, z] and not before
                before = inside[x, y, z]
            count[x * n_y + y] = total
    runs = np.empty((count.sum(), 2), np.int64)
    at = 0
    for x in range(n_x):
        for y in range(n_y):
            if count[x * n_y + y] == 0:
                continue
            for z in range(n_z):
                if inside[x, y, z]:
                    if z == 0 or not inside[x, y, z - 1]:
                        runs[at, 0] = z
                        at += 1
                    runs[at - 1, 1] = z + 1
    return runs, count
