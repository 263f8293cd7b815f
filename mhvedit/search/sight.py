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
from mhvedit.geometry.uncounted import uncounted
from mhvedit.search.pyramid import MOMENT_SLAB, Columns, TurnedColumns, level_of

CELL_LEVEL = 3
CELL = 1 << CELL_LEVEL  # voxels along a cell's side
TOP_BLOCK = 64  # shifts along the side of the coarsest blocks
WITNESSED = 8  # shifts along the side of the coarsest blocks that the last witness is tried on
MARGIN = 1e-9  # m, by which a ball must clear the cone's surface to be settled at once


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
    cells = _occupied_cells(level_of(volume.some, CELL_LEVEL), volume.columns)
    corner = np.append(volume.starts[0], volume.columns.first * volume.columns.slab)
    middles = (corner + CELL * cells + 0.5 * (CELL - 1)) * pitch
    open_cells = np.empty((TOP_BLOCK.bit_length() + 1, len(cells)), np.int32)
    open_cells[0] = np.arange(len(cells))
    view = (eye, direction, np.sin(cone.half_angle), np.cos(cone.half_angle), step, pitch)
    solid = (
        cells,
        middles,
        corner,
        volume.column_of,
        volume.columns.voxels,
        volume.columns.slab,
        volume.columns.n_words,
    )
    _look(open_cells, view, solid, asked, out)
    return out


def _occupied_cells(level: Words, columns: Columns) -> Int32Array:
    """(C, 3) cells of the level that hold anything, from the columns' first voxel on."""
    if columns.slab == MOMENT_SLAB:  # bits are voxels, bytes cells
        filled = level.astype("<u8").view(np.uint8) != 0
    else:
        filled = (level != 0).reshape(*level.shape[:2], -1, columns.n_words).any(-1)
    return np.argwhere(filled).astype(np.int32)


View = tuple[FloatArray, FloatArray, float, float, float, float]  # eye, direction, sine and cosine, step, pitch
Solid = tuple[Int32Array, FloatArray, IntArray, Int32Array, Words, int, int]


@njit(cache=True, nogil=True)
def _look(open_cells: Int32Array, view: View, solid: Solid, asked: BoolArray, out: BoolArray) -> None:
    """Settle all blocks of shifts."""
    view = (uncounted(view[0]), uncounted(view[1]), view[2], view[3], view[4], view[5])
    arrays = uncounted(solid[0]), uncounted(solid[1]), uncounted(solid[2]), uncounted(solid[3]), uncounted(solid[4])
    solid = (arrays[0], arrays[1], arrays[2], arrays[3], arrays[4], solid[5], solid[6])
    for i in range(0, asked.shape[0], TOP_BLOCK):
        for j in range(0, asked.shape[1], TOP_BLOCK):
            _settle_block(i, j, uncounted(open_cells), view, solid, uncounted(asked), uncounted(out))


@njit(cache=True, nogil=True)  # with a stack of its own: compiled recursion does not survive the cache
def _settle_block(
    i: int, j: int, open_cells: Int32Array, view: View, solid: Solid, asked: BoolArray, out: BoolArray
) -> None:
    """Settle one of the coarsest blocks of shifts, depth first; row d of `open_cells` is what is open at depth d."""
    eye, step = view[0], view[4]
    witness = np.full(3, np.nan)  # the voxel that was seen last
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
        if size <= WITNESSED and _all_see(witness, u, v, here, view, out[u : u + size, v : v + size]):
            continue
        at_x, at_y = eye[0] + (u + 0.5 * (size - 1)) * step, eye[1] + (v + 0.5 * (size - 1)) * step
        kept = _sift(size, counts[depth], open_cells[depth], open_cells[depth + 1], at_x, at_y, view, solid)
        if kept < 0 or (size == 1 and _any_in_sight(open_cells[depth + 1, :kept], at_x, at_y, view, solid, witness)):
            out[u : u + size, v : v + size] = here
        elif size > 1 and kept > 0:
            counts[depth + 1] = kept
            for quarter in range(4):
                stack[height, 0] = u + (quarter & 1) * (size // 2)
                stack[height, 1] = v + (quarter >> 1) * (size // 2)
                stack[height, 2] = depth + 1
                height += 1


@njit(cache=True, nogil=True, inline="always")
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
    eye, direction, sine, cosine, step, pitch = view
    middles = solid[1]
    reach = 0.5 * np.sqrt(3.0) * (CELL - 1) * pitch + abs(step) * (size - 1) * np.sqrt(0.5) + MARGIN
    n = 0
    for c in range(n_open):
        cell = open_cells[c]
        x, y, z = middles[cell, 0] - at_x, middles[cell, 1] - at_y, middles[cell, 2] - eye[2]
        inwards = _inwards(x, y, z, direction, sine, cosine)
        if inwards > reach:
            open_cells[c], open_cells[0] = open_cells[0], cell
            return -1
        if inwards >= -reach:
            kept[n] = cell
            n += 1
    return n


@njit(cache=True, nogil=True, inline="always")
def _all_see(witness: FloatArray, u: int, v: int, asked: BoolArray, view: View, out: BoolArray) -> bool:
    """Try the voxel that was seen last from all shifts of a block, until one does not see it."""
    eye, direction, _, cosine, step, _ = view
    z = witness[2] - eye[2]
    for i in range(asked.shape[0]):
        for j in range(asked.shape[1]):
            if asked[i, j]:
                x, y = witness[0] - eye[0] - (u + i) * step, witness[1] - eye[1] - (v + j) * step
                along = x * direction[0] + y * direction[1] + z * direction[2]
                if not along >= cosine * np.sqrt(x * x + y * y + z * z):  # nor where there is no witness yet
                    return False
                out[i, j] = True
    return True


@njit(cache=True, nogil=True, inline="always")
def _any_in_sight(
    open_cells: Int32Array, at_x: float, at_y: float, view: View, solid: Solid, witness: FloatArray
) -> bool:
    """Whether some voxel of the open cells is in the cone; the first that is becomes the witness."""
    for cell in open_cells:
        if _voxel_in_sight(cell, at_x, at_y, view, solid, witness):
            return True
    return False


@njit(cache=True, nogil=True, inline="always")
def _inwards(x: float, y: float, z: float, direction: FloatArray, sine: float, cosine: float) -> float:
    """How far inside the cone a point beside the eye is: in size never more than its distance from the cone's surface.

    Across the surface this is the distance itself; where the apex is nearest it falls short of it.
    """
    along = x * direction[0] + y * direction[1] + z * direction[2]
    across = np.sqrt(max(0.0, x * x + y * y + z * z - along * along))
    return float(along * sine - across * cosine)


@njit(cache=True, nogil=True, inline="always")
def _voxel_in_sight(cell: int, at_x: float, at_y: float, view: View, solid: Solid, witness: FloatArray) -> bool:
    """Whether the centre of some filled voxel of a cell is in the cone."""
    eye, direction, sine, cosine, _, pitch = view
    cells, middles, corner, column_of, voxels, slab, n_words = solid
    reach = 0.5 * (CELL - 1) * pitch + MARGIN
    dz = middles[cell, 2] - eye[2]
    for i in range(CELL * cells[cell, 0], CELL * cells[cell, 0] + CELL):
        for j in range(CELL * cells[cell, 1], CELL * cells[cell, 1] + CELL):
            column = column_of[i, j]
            x, y = (corner[0] + i) * pitch - at_x, (corner[1] + j) * pitch - at_y
            if column < 0 or _inwards(x, y, dz, direction, sine, cosine) < -reach:
                continue
            for k in range(CELL * cells[cell, 2], CELL * cells[cell, 2] + CELL):
                z = (corner[2] + k) * pitch - eye[2]
                along = x * direction[0] + y * direction[1] + z * direction[2]
                if along >= cosine * np.sqrt(x * x + y * y + z * z) and _filled(voxels[column], k, slab, n_words):
                    witness[0], witness[1], witness[2] = x + at_x, y + at_y, z + eye[2]
                    return True
    return False


@njit(cache=True, nogil=True, inline="always")
def _filled(column: Words, k: int, slab: int, n_words: int) -> bool:
    if slab == MOMENT_SLAB:
        return bool((column[k // MOMENT_SLAB] >> np.uint64(k % MOMENT_SLAB)) & np.uint64(1))
    for w in range(k * n_words, (k + 1) * n_words):
        if column[w] != 0:
            return True
    return False
