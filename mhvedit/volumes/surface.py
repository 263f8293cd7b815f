"""Labels on the surface of a motion history volume: where the motion starts, where it ends, and what it only passes."""

from enum import IntFlag

import numpy as np

from mhvedit.geometry.arrays import BoolArray, ByteArray
from mhvedit.volumes.history import MotionHistoryVolume


class SurfaceLabel(IntFlag):
    """START is the paper's `-`, END its `+`, LATERAL its `0`; a voxel that never moves is both START and END."""

    NONE = 0
    START = 1
    END = 2
    LATERAL = 4


def surface_labels(volume: MotionHistoryVolume) -> ByteArray:
    """Label the surface voxels by when they were filled (Shi et al., section 3.2; its equations, not its prose).

    Args:
        volume: of tau frames.

    Returns:
        (X, Y, Z) SurfaceLabel flags; NONE inside and outside.
    """
    surface = surface_voxels(volume.filled)
    start = surface & (volume.t_start == 0)
    end = surface & (volume.t_end == volume.last)
    lateral = surface & ~start & ~end
    return np.asarray(
        start * SurfaceLabel.START.value + end * SurfaceLabel.END.value + lateral * SurfaceLabel.LATERAL.value, np.uint8
    )


def surface_voxels(filled: BoolArray) -> BoolArray:
    """Filled voxels with an empty face neighbour; the outside of the box is empty."""
    padded = np.pad(filled, 1)
    core = padded.copy()
    for axis in range(3):
        core &= np.roll(padded, 1, axis) & np.roll(padded, -1, axis)
    return np.asarray(filled & ~core[1:-1, 1:-1, 1:-1])
