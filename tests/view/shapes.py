"""Simple people, things and volumes."""

import numpy as np

from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.geometry.grid import VoxelGrid
from mhvedit.sequences.meshes import Mesh
from mhvedit.volumes.history import MotionHistoryVolume, history

PITCH = 0.05
N_FRAMES = 8
BOX_FACES: Int32Array = np.array(
    [
        [0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
        [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5],
    ],
    np.int32,
)  # fmt: skip


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    corners: FloatArray = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float64)
    return Mesh(np.array(low) + corners * (np.array(high) - np.array(low)), BOX_FACES)


def person(x: float, y: float = 0.0) -> Mesh:
    return box((x - 0.15, y - 0.2, 0.0), (x + 0.15, y + 0.2, 1.7))


def sweep(step: int) -> MotionHistoryVolume:
    """A block of 4 voxels a side that moves along x, one voxel a frame."""
    return history(
        [(VoxelGrid((step * i, 0, 20), (4, 4, 4), PITCH), np.ones((4, 4, 4), bool)) for i in range(N_FRAMES)]
    )


def standing() -> MotionHistoryVolume:
    solid = np.ones((6, 8, 34), bool)
    return history([(VoxelGrid((-3, -4, 0), solid.shape, PITCH), solid)] * N_FRAMES)


def solid_block(size: int) -> MotionHistoryVolume:
    solid = np.ones((size, size, size), bool)
    return history([(VoxelGrid((2, 3, 4), (size, size, size), PITCH), solid)])
