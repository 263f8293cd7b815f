"""Whether the faces of a mesh close up."""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import Int32Array


def has_no_boundary(faces: Int32Array) -> bool:
    """Whether every edge is run through equally often in both directions.

    The boundary chain of the mesh is summed with a 64-bit pseudo-random weight per edge: it is zero for every closed
    mesh, and for an open one with a chance of 2^-64.
    """
    return bool(_boundary_sum(faces) == 0)


@njit(cache=True, nogil=True)
def _boundary_sum(faces: Int32Array) -> np.uint64:
    total = np.uint64(0)
    for f in range(faces.shape[0]):
        for e in range(3):
            a, b = faces[f, e], faces[f, (e + 1) % 3]
            if a == b:
                continue
            low, high = np.uint64(min(a, b)), np.uint64(max(a, b))
            mixed = (low << np.uint64(32)) | high
            mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            mixed ^= mixed >> np.uint64(31)
            if a < b:
                total += mixed
            else:
                total -= mixed
    return total
