"""At which poses is somebody in sight? Exact on voxel centres; cells of 8 voxels are settled at once where possible."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.constraints.visibility import SightCone
from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray, Words
from mhvedit.geometry.planar import rotation
from mhvedit.search.pyramid import TurnedColumns

CELL_LEVEL = 3
MARGIN = 1e-9  # rad, by which a whole cell must clear the cone's edge to be settled at once


@dataclass(frozen=True, slots=True, eq=False)
class MutualSight:
    """Both cones of one segment, in canonical frames."""

    a: SightCone
    b: SightCone


def a_sees_b(cone: SightCone, b: TurnedColumns, shifts: FloatArray, *, pitch: float) -> BoolArray:
    """Whether turned and shifted B is in A's cone.

    Args:
        cone: of A.
        b: all of B, turned.
        shifts: (N, 2) of B, m.
        pitch: m.

    Returns:
        (N,).
    """
    eyes = np.tile(cone.eye, (len(shifts), 1))
    eyes[:, :2] -= shifts
    return _in_sight(cone, cone.direction, eyes, b, pitch)


def b_sees_a(cone: SightCone, a: TurnedColumns, shifts: FloatArray, yaw: float, *, pitch: float) -> BoolArray:
    """Whether A is in the cone of turned and shifted B; arguments as for `a_sees_b`, `yaw` in rad."""
    eyes = np.tile(cone.eye, (len(shifts), 1))
    eyes[:, :2] = rotation(yaw) @ cone.eye[:2] + shifts
    direction = cone.direction.copy()
    direction[:2] = rotation(yaw) @ cone.direction[:2]
    return _in_sight(cone, direction, eyes, a, pitch)


def _in_sight(
    cone: SightCone, direction: FloatArray, eyes: FloatArray, volume: TurnedColumns, pitch: float
) -> BoolArray:
    cells = np.argwhere(volume.levels[CELL_LEVEL].any(-1)).astype(np.int32)
    found = _search(cells, volume.starts[0], volume.column_of, volume.bits, eyes, direction, cone.half_angle, pitch)
    return np.asarray(found)


@njit(cache=True, nogil=True)
def _search(
    cells: Int32Array,
    start: IntArray,
    column_of: Int32Array,
    bits: Words,
    eyes: FloatArray,
    direction: FloatArray,
    half_angle: float,
    pitch: float,
) -> BoolArray:
    out = np.zeros(eyes.shape[0], np.bool_)
    size = 1 << CELL_LEVEL
    radius = 0.5 * np.sqrt(3.0) * (size - 1) * pitch
    middle = 0.5 * (size - 1)
    for p in range(eyes.shape[0]):
        for c in range(cells.shape[0]):
            x = (start[0] + size * cells[c, 0] + middle) * pitch - eyes[p, 0]
            y = (start[1] + size * cells[c, 1] + middle) * pitch - eyes[p, 1]
            z = (start[2] + size * cells[c, 2] + middle) * pitch - eyes[p, 2]
            far = np.sqrt(x * x + y * y + z * z)
            if far > radius:
                cosine = (x * direction[0] + y * direction[1] + z * direction[2]) / far
                angle = np.arccos(min(1.0, max(-1.0, cosine)))
                spread = np.arcsin(radius / far)
                if angle - spread > half_angle + MARGIN:
                    continue
                if angle + spread < half_angle - MARGIN:
                    out[p] = True
                    break
            if _voxel_in_sight(cells[c], size, start, column_of, bits, eyes[p], direction, half_angle, pitch):
                out[p] = True
                break
    return out


@njit(cache=True, nogil=True)
def _voxel_in_sight(
    cell: Int32Array,
    size: int,
    start: IntArray,
    column_of: Int32Array,
    bits: Words,
    eye: FloatArray,
    direction: FloatArray,
    half_angle: float,
    pitch: float,
) -> bool:
    cosine = np.cos(half_angle)
    for i in range(size * cell[0], size * cell[0] + size):
        for j in range(size * cell[1], size * cell[1] + size):
            column = column_of[i, j]
            if column < 0:
                continue
            x = (start[0] + i) * pitch - eye[0]
            y = (start[1] + j) * pitch - eye[1]
            for k in range(size * cell[2], size * cell[2] + size):
                z = (start[2] + k) * pitch - eye[2]
                along = x * direction[0] + y * direction[1] + z * direction[2]
                if along >= cosine * np.sqrt(x * x + y * y + z * z):
                    for w in range(bits.shape[2]):
                        if bits[column, k, w] != 0:
                            return True
    return False
