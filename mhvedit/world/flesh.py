"""A captured body in motion as convex pieces: what pushes props, although its meshes have nothing in common.

The mesh of a frame is cut along a lattice into small solids. How each has come there since the frame before is told by
the surface round it, which is shifted until it lies on the earlier surface (iterated closest points, translation only).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.sequences.meshes import Mesh
from mhvedit.volumes.voxelise import solid_voxels
from mhvedit.world.pieces import Piece, hull
from mhvedit.world.problems import WorldError

CELL: Final = 0.06  # m, side of the lattice: what is hollow between two limbs or fingers is filled no wider than this
OVERLAP: Final = 0.012  # m, by which neighbours share their points, so that no gap is left between them
SAMPLE: Final = 0.02  # m, longest edge of the surface's triangles, and pitch of the points inside
NEIGHBOURHOOD: Final = 0.12  # m round a piece, of the surface that tells its way
WIDER: Final = 0.25  # m, of a first guess
SAMPLES: Final = 80  # points of a neighbourhood
ROUNDS: Final = 12
FITS: Final = 0.004  # m, mean distance at which a neighbourhood lies on the earlier surface
FARTHEST: Final = 0.4  # m that anything moves from one frame to the next


@dataclass(frozen=True, slots=True, eq=False)
class Flesh:
    """Solids of a body at the end of a step, and how far they came."""

    pieces: tuple[Piece, ...]  # K, about their middles
    middles: FloatArray  # (K, 3) m
    shifts: FloatArray  # (K, 3) m, from where they were a frame earlier


NO_FLESH: Final = Flesh((), np.zeros((0, 3)), np.zeros((0, 3)))


def flesh_near(mesh: Mesh, boxes: FloatArray, *, before: Mesh | None, last: Flesh = NO_FLESH) -> Flesh:
    """The solids of a body that come into some boxes.

    Args:
        mesh: of the body, in the world.
        boxes: (N, 2, 3) m, lowest and highest coordinates.
        before: a frame earlier; None for a body that does not move.
        last: solids of that frame, whose ways are tried as a first guess.
    """
    if not _meets(mesh.vertices, boxes, 0.0):
        return NO_FLESH
    surface = _surface(mesh, boxes, WIDER)
    clouds = _cells(np.concatenate([surface, _inside(mesh, boxes)]), boxes)
    hulls = [piece for cloud in clouds if (piece := _solid(cloud)) is not None]
    middles = np.array([piece.points.mean(0) for piece in hulls]).reshape(-1, 3)
    pieces = tuple(Piece(piece.points - middle, 0.0, piece.faces) for piece, middle in zip(hulls, middles, strict=True))
    if before is None or not pieces:
        return Flesh(pieces, middles, np.zeros_like(middles))
    earlier = _surface(before, boxes, WIDER + FARTHEST)
    shifts = -shifts_onto(surface, earlier, middles, first=-_guessed(middles, last))
    return Flesh(pieces, middles, shifts)


def shifts_onto(surface: FloatArray, earlier: FloatArray, middles: FloatArray, *, first: FloatArray) -> FloatArray:
    """Translations that bring the surface round some points onto an earlier one.

    Each begins from rest, from a guess, and, where neither fits, from what a wider neighbourhood says. What fits best
    is taken, and rest where that is farther than FARTHEST.

    Args:
        surface: (N, 3) m.
        earlier: (M, 3) m.
        middles: (K, 3) m, points on or in the surface.
        first: (K, 3) m, guesses.

    Returns:
        (K, 3) m.
    """
    found = np.zeros_like(middles)
    if not len(earlier) or not len(surface):
        return found
    known, ours = cKDTree(earlier), cKDTree(surface)
    for k, middle in enumerate(middles):
        near = _some(surface[ours.query_ball_point(middle, NEIGHBOURHOOD)])
        if not len(near):
            continue
        tried = [_onto(near, known, start) for start in (np.zeros(3), first[k])]
        if min(off for _, off in tried) > FITS:
            wide = _some(surface[ours.query_ball_point(middle, WIDER)])
            tried.append(_onto(near, known, _onto(wide, known, np.zeros(3))[0]))
        shift = min(tried, key=lambda each: each[1])[0]
        found[k] = shift if np.linalg.norm(shift) <= FARTHEST else 0.0
    return found


def _onto(points: FloatArray, known: cKDTree, start: FloatArray) -> tuple[FloatArray, float]:
    """A translation of points onto a surface, and how far they then are from it on average, m."""
    shift = start
    for _ in range(ROUNDS):
        moved = points + shift
        off = known.data[known.query(moved)[1]] - moved
        length = np.linalg.norm(off, axis=1)
        kept = length <= np.quantile(length, 0.8)  # what came into the neighbourhood from elsewhere does not count
        step = off[kept].mean(0)
        shift = shift + step
        if np.linalg.norm(step) < 1e-4:
            break
    return shift, float(known.query(points + shift)[0].mean())


def _guessed(middles: FloatArray, last: Flesh) -> FloatArray:
    """(K, 3) m, how the nearest solid moved a frame earlier."""
    if not len(last.middles):
        return np.zeros_like(middles)
    return np.asarray(last.shifts[cKDTree(last.middles + last.shifts).query(middles)[1]])


def _some(points: FloatArray) -> FloatArray:
    """At most SAMPLES points, evenly from the list."""
    return points[np.linspace(0, len(points) - 1, min(SAMPLES, len(points))).astype(np.int64)]


def _meets(points: FloatArray, boxes: FloatArray, margin: float) -> bool:
    """Whether the box round some points comes within a margin of one of the boxes."""
    low, high = points.min(0), points.max(0)
    return bool(((boxes[:, 0] - margin <= high) & (low <= boxes[:, 1] + margin)).all(1).any())


def _within(low: FloatArray, high: FloatArray, boxes: FloatArray, margin: float) -> BoolArray:
    """(N,) which boxes come within a margin of some others."""
    found = np.zeros(len(low), np.bool_)
    for box in boxes:
        found |= ((box[0] - margin <= high) & (low <= box[1] + margin)).all(1)
    return found


def _surface(mesh: Mesh, boxes: FloatArray, margin: float) -> FloatArray:
    """(N, 3) m, points all over the surface within a margin of the boxes, no farther than SAMPLE from each other."""
    corners = mesh.vertices[mesh.faces]
    near = mesh.faces[_within(corners.min(1), corners.max(1), boxes, margin)]
    if not len(near):
        return np.zeros((0, 3))
    used, faces = np.unique(near, return_inverse=True)
    points, _ = trimesh.remesh.subdivide_to_size(mesh.vertices[used], faces.reshape(-1, 3), SAMPLE, max_iter=20)
    return np.unique(points[_within(points, points, boxes, margin)].round(6), axis=0)


def _inside(mesh: Mesh, boxes: FloatArray) -> FloatArray:
    """(N, 3) m, points of a lattice inside the mesh and near the boxes."""
    grid, filled = solid_voxels(mesh, SAMPLE)
    points = (np.argwhere(filled) + np.array(grid.start)) * SAMPLE
    return np.asarray(points[_within(points, points, boxes, CELL)])


def _cells(points: FloatArray, boxes: FloatArray) -> Sequence[FloatArray]:
    """Points of each cell of the lattice that comes into the boxes; those near a border belong to both sides."""
    if not len(points):
        return []
    base = np.floor((points.min(0) - OVERLAP) / CELL).astype(np.int64)
    shape = np.floor((points.max(0) + OVERLAP) / CELL).astype(np.int64) - base + 1
    rows, cells = list[IntArray](), list[IntArray]()
    for signs in product((-OVERLAP, OVERLAP), repeat=3):
        rows.append(np.arange(len(points)))
        index = np.floor((points + np.array(signs)) / CELL).astype(np.int64) - base
        cells.append(np.ravel_multi_index(tuple(index.T), tuple(shape)))
    pairs = np.unique(np.concatenate(cells) * len(points) + np.concatenate(rows))
    cell, row = np.divmod(pairs, len(points))
    low = np.asarray((np.stack(np.unravel_index(cell, tuple(shape)), 1) + base) * CELL, np.float64)
    kept = _within(low, low + CELL, boxes, 0.0)
    cell, row = cell[kept], row[kept]
    starts = np.flatnonzero(np.diff(cell)) + 1
    return [points[part] for part in np.split(row, starts) if len(part) >= 4]


def _solid(points: FloatArray) -> Piece | None:
    """The hull of points; none where they span no volume, which neighbouring cells then do."""
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False)
    if spread[-1] < 1e-3 * np.sqrt(len(points)):
        return None
    try:
        return hull(points)
    except WorldError:
        return None
