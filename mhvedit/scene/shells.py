"""Coarse surfaces for asking fast, and for many placements, in which frames two subjects are clear of each other.

A shell is a cloud of points, one in each cell of `SPACING` that a surface comes through. Two shells touch where a point
of one lies in a cell of `CELL` that holds a point of the other or borders on one that does. That is on the safe side:
surfaces whose shells do not touch do not meet, but for a tip between two points; surfaces whose shells touch may still
be some centimetres apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mhvedit.geometry.arrays import ByteArray, FloatArray, IntArray
from mhvedit.scene.surfaces import points_of_large_faces
from mhvedit.sequences.meshes import Mesh

SPACING: Final = 0.03  # m
CELL: Final = 0.04  # m
MOST_CELLS: Final = 1 << 24  # of a box that is marked cell by cell
Float32Array = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Shells:
    """A subject's shell in each of some frames, in the capture's frame."""

    points: Float32Array  # (P, 3) m, those of one frame together
    stops: IntArray  # (T + 1,) where each frame's points start

    def of(self, frame: int) -> FloatArray:
        """(K, 3) m, the points of one frame."""
        return self.points[self.stops[frame] : self.stops[frame + 1]].astype(np.float64)

    def each(self) -> list[Float32Array]:
        """(K, 3) m of every frame; views."""
        return np.split(self.points, self.stops[1:-1])

    def some(self, frames: IntArray) -> "Shells":
        """Some of the frames."""
        each = self.each()
        return stacked([each[frame] for frame in frames])


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Shells as boxes of cells, each with a mark where points are in or next to it."""

    marks: ByteArray  # (M,) of all frames, one after the other, each (X, Y, Z) in C order
    starts: IntArray  # (T,) in `marks`
    origins: FloatArray  # (T, 3) m, low corner
    shapes: IntArray  # (T, 3)


def shell_of(mesh: Mesh) -> Float32Array:
    """(K, 3) m, points all over a mesh."""
    extra, _ = points_of_large_faces(mesh.vertices, mesh.faces, spacing=SPACING)
    points = np.concatenate([mesh.vertices, extra])
    return np.asarray(points[_first_of_cells(np.floor(points / SPACING).astype(np.int64))], np.float32)


def _first_of_cells(cells: IntArray) -> IntArray:
    """Which rows of (N, 3) are the first of their kind, ascending."""
    low, high = _limits(cells)
    shape = high - low + 1
    if np.prod(shape.astype(np.float64)) <= MOST_CELLS:
        return np.asarray(_unseen(cells, low, shape))
    _, first = np.unique(cells @ (1 << np.array([42, 21, 0])), return_index=True)
    return np.sort(first)


def stacked(shells: Sequence[Float32Array]) -> Shells:
    """The shells of successive frames."""
    return Shells(np.concatenate(shells), np.cumsum([0, *map(len, shells)]))


def cells_of(shells: Shells) -> Cells:
    """Shells as boxes of cells."""
    frames = [shells.of(t) for t in range(len(shells.stops) - 1)]
    origins = np.array([points.min(0) for points in frames], np.float64) - CELL
    highs = np.array([points.max(0) for points in frames], np.float64)
    shapes = np.floor((highs - origins) / CELL).astype(np.int64) + 2
    sizes = shapes.prod(1)
    starts = np.cumsum(sizes) - sizes
    marks = np.zeros(int(sizes.sum()), np.uint8)
    _mark(shells.points, shells.stops, marks, starts, origins, shapes)
    return Cells(marks, starts, origins, shapes)


def touching(
    shells: Shells, cells: Cells, *, frames: tuple[IntArray, IntArray], relative: FloatArray, first: bool = False
) -> IntArray:
    """How many points of one subject touch the other, frame by frame.

    Args:
        shells: of the one.
        cells: of the other.
        frames: (N,) of the shells, and (N,) of the cells; -1 for one that is not to be asked about.
        relative: (N, 3) placement of the one's frame in the other's.
        first: whether the first frame in which they touch is enough; later ones then come out as 0.

    Returns:
        (N,) points.
    """
    return np.asarray(
        _touching(
            shells.points,
            shells.stops,
            cells.marks,
            cells.starts,
            cells.origins,
            cells.shapes,
            *frames,
            relative,
            first,
        )
    )


@njit(cache=True, nogil=True)
def _limits(cells: IntArray) -> tuple[IntArray, IntArray]:
    """The smallest and the largest of (N, 3)."""
    low, high = cells[0].copy(), cells[0].copy()
    for n in range(1, cells.shape[0]):
        for c in range(3):
            low[c], high[c] = min(low[c], cells[n, c]), max(high[c], cells[n, c])
    return low, high


@njit(cache=True, nogil=True)
def _unseen(cells: IntArray, low: IntArray, shape: IntArray) -> IntArray:
    """Rows whose cell of a box no earlier row has."""
    seen, rows, n = np.zeros(shape[0] * shape[1] * shape[2], np.bool_), np.empty(cells.shape[0], np.int64), 0
    for row in range(cells.shape[0]):
        at = ((cells[row, 0] - low[0]) * shape[1] + cells[row, 1] - low[1]) * shape[2] + cells[row, 2] - low[2]
        if not seen[at]:
            seen[at], rows[n] = True, row
            n += 1
    return rows[:n]


@njit(cache=True, nogil=True)
def _mark(
    points: Float32Array, stops: IntArray, marks: ByteArray, starts: IntArray, origins: FloatArray, shapes: IntArray
) -> None:
    for t in range(stops.shape[0] - 1):
        nx, ny, nz = shapes[t, 0], shapes[t, 1], shapes[t, 2]
        for n in range(stops[t], stops[t + 1]):
            x = int((points[n, 0] - origins[t, 0]) / CELL)
            y = int((points[n, 1] - origins[t, 1]) / CELL)
            z = int((points[n, 2] - origins[t, 2]) / CELL)
            for i in range(max(x - 1, 0), min(x + 2, nx)):
                for j in range(max(y - 1, 0), min(y + 2, ny)):
                    for k in range(max(z - 1, 0), min(z + 2, nz)):
                        marks[starts[t] + (i * ny + j) * nz + k] = 1


@njit(cache=True, nogil=True)
def _touching(
    points: Float32Array,
    stops: IntArray,
    marks: ByteArray,
    starts: IntArray,
    origins: FloatArray,
    shapes: IntArray,
    ours: IntArray,
    theirs: IntArray,
    relative: FloatArray,
    first: bool,
) -> IntArray:
    count = np.zeros(ours.shape[0], np.int64)
    for k in range(ours.shape[0]):
        s, t = ours[k], theirs[k]
        if s < 0 or t < 0:
            continue
        c, n = np.cos(relative[k, 2]), np.sin(relative[k, 2])
        nx, ny, nz = shapes[t, 0], shapes[t, 1], shapes[t, 2]
        for p in range(stops[s], stops[s + 1]):
            x = c * points[p, 0] - n * points[p, 1] + relative[k, 0] - origins[t, 0]
            y = n * points[p, 0] + c * points[p, 1] + relative[k, 1] - origins[t, 1]
            z = points[p, 2] - origins[t, 2]
            if x < 0 or y < 0 or z < 0:
                continue
            i, j, m = int(x / CELL), int(y / CELL), int(z / CELL)
            if i < nx and j < ny and m < nz:
                count[k] += marks[starts[t] + (i * ny + j) * nz + m]
        if first and count[k] > 0:
            return count
    return count
