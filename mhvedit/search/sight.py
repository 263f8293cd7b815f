"""At which shifts is somebody in sight? Exact on voxel centres, with work that grows with the boundary of the answer.

Shifts are taken in square blocks and the volume in cubes of as many voxels a side. Seen from anywhere in a block, a
cube lies within a ball around the direction of its middle; a block is settled if such a ball lies wholly in the cone,
or if none reaches into it. Otherwise both are halved: four blocks, with what the cubes that are still open hold.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.constraints.visibility import SightCone
from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray, Words
from mhvedit.geometry.planar import rotation
from mhvedit.geometry.uncounted import uncounted
from mhvedit.search.columns import WORD, Columns, Layout, TurnedColumns, occupied, outline_of
from mhvedit.volumes.history import MotionHistoryVolume

TOP = 6
TOP_SIDE = 1 << TOP  # shifts along the side of the coarsest blocks, voxels along that of the coarsest cubes
WITNESSED = 8  # shifts along the side of the coarsest blocks that the last witness is tried on
MARGIN = 1e-9  # m, by which a ball must clear the cone's surface to be settled at once
SETTLED = -1


@dataclass(frozen=True, slots=True, eq=False)
class MutualSight:
    """Both cones of one segment, in canonical frames."""

    a: SightCone
    b: SightCone


def whole_columns(volume: MotionHistoryVolume) -> Columns:
    """All that is ever filled of a volume, as it is looked at: of one moment, with slabs of 64 voxels."""
    start = np.array(volume.grid.start)
    layout = Layout(int(start[2]), max(1, -(-volume.frames.shape[2] // WORD)), WORD, 1)
    shape = volume.grid.shape[:2]
    column_of, cells = occupied(shape, [((slice(None), slice(None)), volume.frames.reshape(*shape, -1))])
    voxels = _ever(volume.frames, cells, layout.n_slabs)
    return Columns(layout, column_of, start[:2], voxels, voxels, voxels, outline_of(cells, start[:2]))


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
    corner = np.append(volume.start, volume.columns.layout.low).astype(np.float64)
    view = (eye, direction, np.sin(cone.half_angle), np.cos(cone.half_angle), step, pitch)
    words, first, along_y = _cubes(volume.column_of, volume.columns.voxels)
    _look(view, (words, first, along_y, corner), asked, out)
    return out


View = tuple[FloatArray, FloatArray, float, float, float, float]  # eye, direction, sine and cosine, step, pitch
Cubes = tuple[Words, IntArray, IntArray, FloatArray]
"""Columns (N, W) of cubes of all levels, one level after the other, a bit for each cube that holds anything, at the
height of its first voxel; where a level begins; its columns along y; lattice index (3,) of the first voxel."""


@njit(cache=True, nogil=True)
def _ever(frames: Words, cells: Int32Array, n_slabs: int) -> Words:
    """(C, S) a bit for each voxel of all columns that is ever filled, the empty column first."""
    voxels = np.zeros((cells.shape[0] + 1, n_slabs), np.uint64)
    for n in range(cells.shape[0]):
        column, out = frames[cells[n, 0], cells[n, 1]], voxels[n + 1]
        for z in range(column.shape[0]):
            for w in range(column.shape[1]):
                if column[z, w] != 0:
                    out[z // WORD] |= np.uint64(1) << np.uint64(z % WORD)
    return voxels


@njit(cache=True, nogil=True)
def _cubes(column_of: Int32Array, voxels: Words) -> tuple[Words, IntArray, IntArray]:
    """Which cubes of 2^L voxels a side hold anything."""
    n_x, n_y = column_of.shape
    first, along_y = np.zeros(TOP + 2, np.int64), np.zeros(TOP + 1, np.int64)
    for level in range(TOP + 1):
        along_y[level] = -(-n_y >> level)
        first[level + 1] = first[level] + -(-n_x >> level) * along_y[level]
    words = np.zeros((first[TOP + 1], voxels.shape[1]), np.uint64)
    for x in range(n_x):
        for y in range(n_y):
            for w in range(voxels.shape[1]):
                words[x * n_y + y, w] = voxels[column_of[x, y], w]
    for level in range(TOP):
        half, feet = np.uint64(1 << level), np.uint64(0)
        for bit in range(0, WORD, 2 << level):
            feet |= np.uint64(1) << np.uint64(bit)
        for x in range(-(-n_x >> level)):
            for y in range(along_y[level]):
                fine, coarse = first[level] + x * along_y[level] + y, first[level + 1] + (x >> 1) * along_y[level + 1]
                for w in range(voxels.shape[1]):
                    word = words[fine, w]
                    words[coarse + (y >> 1), w] |= (word | word >> half) & feet
    return words, first, along_y


@njit(cache=True, nogil=True)
def _look(view: View, cubes: Cubes, asked: BoolArray, out: BoolArray) -> None:
    """Settle all blocks of shifts."""
    view = (uncounted(view[0]), uncounted(view[1]), view[2], view[3], view[4], view[5])
    cubes = uncounted(cubes[0]), uncounted(cubes[1]), uncounted(cubes[2]), uncounted(cubes[3])
    roots = _roots(cubes)
    lists = np.empty((TOP + 1, _most(cubes), 3), np.int32)
    for i in range(0, asked.shape[0], TOP_SIDE):
        for j in range(0, asked.shape[1], TOP_SIDE):
            _settle_block(i, j, uncounted(roots), uncounted(lists), view, cubes, uncounted(asked), uncounted(out))


@njit(cache=True, nogil=True)
def _roots(cubes: Cubes) -> Int32Array:
    """(N, 3) the coarsest cubes: column along x and y, and height of the first voxel."""
    words, first, along_y, _ = cubes
    found = np.empty(((words.shape[0] - first[TOP]) * words.shape[1], 3), np.int32)
    n = 0
    for column in range(words.shape[0] - first[TOP]):
        for w in range(words.shape[1]):
            if words[first[TOP] + column, w] != 0:
                found[n, 0], found[n, 1], found[n, 2] = column // along_y[TOP], column % along_y[TOP], w * WORD
                n += 1
    return found[:n]


@njit(cache=True, nogil=True)
def _most(cubes: Cubes) -> int:
    """No level has more cubes than this: eight times those of level 1."""
    words, first, _, _ = cubes
    n = 0
    for column in range(first[1], first[2]):
        for word in words[column]:
            while word != 0:
                word &= word - np.uint64(1)
                n += 8
    return n


@njit(cache=True, nogil=True)  # with a stack of its own: compiled recursion does not survive the cache
def _settle_block(
    i: int, j: int, roots: Int32Array, lists: Int32Array, view: View, cubes: Cubes, asked: BoolArray, out: BoolArray
) -> None:
    """Settle one of the coarsest blocks of shifts, depth first; `lists` holds what is open on the way down."""
    eye, step = view[0], view[4]
    witness = np.full(3, np.nan)  # the voxel that was seen last
    counts = np.zeros(TOP + 1, np.int64)
    stack = np.zeros((4 * (TOP + 1), 3), np.int64)  # first shift of a block, and its level
    stack[0, 0], stack[0, 1], stack[0, 2] = i, j, TOP
    height = 1
    while height > 0:
        height -= 1
        u, v, level = stack[height]
        size = 1 << level
        here = asked[u : u + size, v : v + size]
        if not here.any():
            continue
        if size <= WITNESSED and _all_see(witness, u, v, here, view, out[u : u + size, v : v + size]):
            continue
        at_x, at_y = eye[0] + (u + 0.5 * (size - 1)) * step, eye[1] + (v + 0.5 * (size - 1)) * step
        above, n_above, split = (roots, roots.shape[0], 1) if level == TOP else (lists[level + 1], counts[level + 1], 2)
        kept = _sift(level, split, above, n_above, lists[level], at_x, at_y, view, cubes, witness)
        if kept == SETTLED:
            for x in range(here.shape[0]):
                for y in range(here.shape[1]):
                    out[u + x, v + y] = here[x, y]
        elif size > 1 and kept > 0:
            counts[level] = kept
            for quarter in range(4):
                stack[height, 0] = u + (quarter & 1) * (size // 2)
                stack[height, 1] = v + (quarter >> 1) * (size // 2)
                stack[height, 2] = level - 1
                height += 1


@njit(cache=True, nogil=True, inline="always")
def _sift(
    level: int,
    split: int,
    above: Int32Array,
    n_above: int,
    kept: Int32Array,
    at_x: float,
    at_y: float,
    view: View,
    cubes: Cubes,
    witness: FloatArray,
) -> int:
    """Keep the cubes (split: 1) or the parts of cubes (split: 2) that are open for a block of shifts.

    Returns:
        How many; SETTLED if one is in sight from all of the block.
    """
    eye, direction, sine, cosine, step, pitch = view
    words, first, along_y, corner = cubes
    side = 1 << level
    reach = 0.5 * np.sqrt(3.0) * (side - 1) * pitch + abs(step) * (side - 1) * np.sqrt(0.5) + MARGIN
    n = 0
    for c in range(n_above):
        for part in range(split * split * split):
            i, j = split * above[c, 0] + (part & 1), split * above[c, 1] + (part >> 1 & 1)
            k = above[c, 2] + side * (part >> 2)
            if j >= along_y[level] or first[level] + i * along_y[level] >= first[level + 1]:
                continue
            if not words[first[level] + i * along_y[level] + j, k // WORD] >> np.uint64(k % WORD) & np.uint64(1):
                continue
            x = (corner[0] + side * i + 0.5 * (side - 1)) * pitch - at_x
            y = (corner[1] + side * j + 0.5 * (side - 1)) * pitch - at_y
            z = (corner[2] + k + 0.5 * (side - 1)) * pitch - eye[2]
            inwards = _inwards(x, y, z, direction, sine, cosine)
            if inwards > reach or (side == 1 and inwards >= -reach and _in_cone(x, y, z, direction, cosine)):
                if side == 1:
                    witness[0], witness[1], witness[2] = x + at_x, y + at_y, z + eye[2]
                for d in range(3):
                    above[c, d], above[0, d] = above[0, d], above[c, d]
                return SETTLED
            if inwards >= -reach:
                kept[n, 0], kept[n, 1], kept[n, 2] = i, j, k
                n += 1
    return n


@njit(cache=True, nogil=True, inline="always")
def _all_see(witness: FloatArray, u: int, v: int, asked: BoolArray, view: View, out: BoolArray) -> bool:
    """Try the point that was seen last from all shifts of a block, until it is not seen from one."""
    eye, direction, _, cosine, step, _ = view
    z = witness[2] - eye[2]
    for i in range(asked.shape[0]):
        for j in range(asked.shape[1]):
            if asked[i, j]:
                x, y = witness[0] - eye[0] - (u + i) * step, witness[1] - eye[1] - (v + j) * step
                if not _in_cone(x, y, z, direction, cosine):  # nor where there is no witness yet
                    return False
                out[i, j] = True
    return True


@njit(cache=True, nogil=True, inline="always")
def _in_cone(x: float, y: float, z: float, direction: FloatArray, cosine: float) -> bool:
    """Whether a point beside the eye is in the cone."""
    along = x * direction[0] + y * direction[1] + z * direction[2]
    return bool(along >= cosine * np.sqrt(x * x + y * y + z * z))


@njit(cache=True, nogil=True, inline="always")
def _inwards(x: float, y: float, z: float, direction: FloatArray, sine: float, cosine: float) -> float:
    """How far inside the cone a point beside the eye is: in size never more than its distance from the cone's surface.

    Across the surface this is the distance itself; where the apex is nearest it falls short of it.
    """
    along = x * direction[0] + y * direction[1] + z * direction[2]
    across = np.sqrt(max(0.0, x * x + y * y + z * z - along * along))
    return float(along * sine - across * cosine)
