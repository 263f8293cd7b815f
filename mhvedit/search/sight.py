"""At which shifts is somebody in sight? Exact on voxel centres, with work that grows with the boundary of the answer.

Shifts are taken in square blocks and the volume in cells of 8 voxels. Seen from anywhere in a block, a cell lies within
a ball around the direction of its middle; a block is settled if such a ball lies wholly in the cone, or if none reaches
into it. Otherwise it is quartered, with those cells that are still open; single shifts look at the voxels of these.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.constraints.visibility import SightCone
from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray, Words
from mhvedit.geometry.planar import rotation
from mhvedit.search.pyramid import TurnedColumns

CELL_LEVEL = 3
CELL = 1 << CELL_LEVEL  # voxels along a cell's side
TOP_BLOCK = 64  # shifts along the side of the coarsest blocks
MARGIN = 1e-9  # rad, by which a ball must clear the cone's edge to be settled at once


@dataclass(frozen=True, slots=True, eq=False)
class MutualSight:
    """Both cones of one segment, in canonical frames."""

    a: SightCone
    b: SightCone


def a_sees_b(
    cone: SightCone, b: TurnedColumns, *, base: IntArray, step: float, asked: BoolArray, pitch: float
) -> BoolArray:
    """At which shifts turned B is in A's cone.

    Args:
        cone: of A.
        b: all of B, turned.
        base: (2,) shift of cell (0, 0), in steps.
        step: between shifts, m.
        asked: (X, Y) which shifts to decide; the others come back False.
        pitch: m.

    Returns:
        (X, Y).
    """
    eye = cone.eye - np.append(base * step, 0.0)
    return _in_sight(cone, cone.direction, eye, -step, b, asked, pitch)


def b_sees_a(
    cone: SightCone, a: TurnedColumns, yaw: float, *, base: IntArray, step: float, asked: BoolArray, pitch: float
) -> BoolArray:
    """At which shifts A is in the cone of turned B; arguments as for `a_sees_b`, `yaw` in rad."""
    eye, direction = cone.eye.copy(), cone.direction.copy()
    eye[:2] = rotation(yaw) @ cone.eye[:2] + base * step
    direction[:2] = rotation(yaw) @ cone.direction[:2]
    return _in_sight(cone, direction, eye, step, a, asked, pitch)


def _in_sight(
    cone: SightCone,
    direction: FloatArray,
    eye: FloatArray,
    step: float,
    volume: TurnedColumns,
    asked: BoolArray,
    pitch: float,
) -> BoolArray:
    """The eye of cell (i, j) is at eye + (i, j) * step."""
    out = np.zeros(asked.shape, np.bool_)
    cells = np.argwhere(volume.levels[CELL_LEVEL].any(-1)).astype(np.int32)
    middles = (volume.starts[0] + CELL * cells + 0.5 * (CELL - 1)) * pitch
    open_cells = np.empty((TOP_BLOCK.bit_length() + 1, len(cells)), np.int32)
    open_cells[0] = np.arange(len(cells))
    view = (np.ascontiguousarray(eye), np.ascontiguousarray(direction), cone.half_angle, step, pitch)
    solid = (cells, np.ascontiguousarray(middles), volume.starts[0], volume.column_of, volume.bits)
    for i in range(0, asked.shape[0], TOP_BLOCK):
        for j in range(0, asked.shape[1], TOP_BLOCK):
            _settle_block(i, j, open_cells, view, solid, asked, out)
    return out


View = tuple[FloatArray, FloatArray, float, float, float]
Solid = tuple[Int32Array, FloatArray, IntArray, Int32Array, Words]


@njit(cache=True, nogil=True)  # with a stack of its own: compiled recursion does not survive the cache
def _settle_block(
    i: int, j: int, open_cells: Int32Array, view: View, solid: Solid, asked: BoolArray, out: BoolArray
) -> None:
    """Settle one of the coarsest blocks of shifts, depth first; row d of `open_cells` is what is open at depth d."""
    eye, step = view[0], view[3]
    counts = np.zeros(open_cells.shape[0], np.int64)
    counts[0] = open_cells.shape[1]
    stack = np.zeros((4 * open_cells.shape[0], 3), np.int64)  # first shift of a block, and its depth
    stack[0, 0], stack[0, 1] = i, j
    height = 1
    while height > 0:
        height -= 1
        u, v, depth = stack[height]
        size = TOP_BLOCK >> depth
        here = asked[u : u + size, v : v + size]
        if not here.any():
            continue
        at_x, at_y = eye[0] + (u + 0.5 * (size - 1)) * step, eye[1] + (v + 0.5 * (size - 1)) * step
        kept = _sift(size, counts[depth], open_cells[depth], open_cells[depth + 1], at_x, at_y, view, solid)
        if kept < 0 or (size == 1 and _any_in_sight(open_cells[depth + 1, :kept], at_x, at_y, view, solid)):
            out[u : u + size, v : v + size] = here
        elif size > 1 and kept > 0:
            counts[depth + 1] = kept
            for quarter in range(4):
                stack[height, 0] = u + (quarter & 1) * (size // 2)
                stack[height, 1] = v + (quarter >> 1) * (size // 2)
                stack[height, 2] = depth + 1
                height += 1


@njit(cache=True, nogil=True)
def _sift(
    size: int,
    n_open: int,
    open_cells: Int32Array,
    kept: Int32Array,
    at_x: float,
    at_y: float,
    view: View,
    solid: Solid,
) -> int:
    """Keep the cells that are still open for a block of shifts; -1 if some cell is in sight from all of it."""
    eye, direction, half_angle, step, pitch = view
    reach = 0.5 * np.sqrt(3.0) * (CELL - 1) * pitch + abs(step) * (size - 1) * np.sqrt(0.5)
    n = 0
    for c in range(n_open):
        cell = open_cells[c]
        found = _ball_in_cone(solid[1][cell], at_x, at_y, eye[2], direction, half_angle, reach)
        if found > 0:
            return -1
        if found == 0:
            kept[n] = cell
            n += 1
    return n


@njit(cache=True, nogil=True)
def _any_in_sight(open_cells: Int32Array, at_x: float, at_y: float, view: View, solid: Solid) -> bool:
    """Whether some voxel of the open cells is in the cone."""
    for cell in open_cells:
        if _voxel_in_sight(cell, at_x, at_y, view, solid):
            return True
    return False


@njit(cache=True, nogil=True, inline="always")
def _ball_in_cone(
    middle: FloatArray, at_x: float, at_y: float, at_z: float, direction: FloatArray, half_angle: float, reach: float
) -> int:
    """1 if everything within reach of the middle is in the cone, -1 if nothing is, 0 if that is open."""
    x, y, z = middle[0] - at_x, middle[1] - at_y, middle[2] - at_z
    far = np.sqrt(x * x + y * y + z * z)
    if far <= reach:
        return 0
    cosine = (x * direction[0] + y * direction[1] + z * direction[2]) / far
    angle = np.arccos(min(1.0, max(-1.0, cosine)))
    spread = np.arcsin(reach / far) + MARGIN
    if angle - spread > half_angle:
        return -1
    return 1 if angle + spread < half_angle else 0


@njit(cache=True, nogil=True)
def _voxel_in_sight(cell: int, at_x: float, at_y: float, view: View, solid: Solid) -> bool:
    """Whether the centre of some filled voxel of a cell is in the cone."""
    eye, direction, half_angle, _, pitch = view
    cells, _, start, column_of, bits = solid
    cosine = np.cos(half_angle)
    for i in range(CELL * cells[cell, 0], CELL * cells[cell, 0] + CELL):
        for j in range(CELL * cells[cell, 1], CELL * cells[cell, 1] + CELL):
            column = column_of[i, j]
            if column < 0:
                continue
            x, y = (start[0] + i) * pitch - at_x, (start[1] + j) * pitch - at_y
            for k in range(CELL * cells[cell, 2], CELL * cells[cell, 2] + CELL):
                z = (start[2] + k) * pitch - eye[2]
                along = x * direction[0] + y * direction[1] + z * direction[2]
                if along >= cosine * np.sqrt(x * x + y * y + z * z) and bits[column, k].any():
                    return True
    return False
