"""The voxel lattice: voxel (i, j, k) has its centre at (i, j, k) * pitch, so lattices of one pitch always agree."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mhvedit.geometry.arrays import FloatArray, IntArray

Index3 = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class VoxelGrid:
    """A box of the lattice."""

    start: Index3  # lattice index of its first voxel
    shape: Index3  # (X, Y, Z) voxels
    pitch: float  # m

    @property
    def stop(self) -> Index3:
        """Lattice index just past its last voxel."""
        return (self.start[0] + self.shape[0], self.start[1] + self.shape[1], self.start[2] + self.shape[2])

    def axis(self, axis: int) -> FloatArray:
        """Voxel centres along one axis, m."""
        return np.asarray((self.start[axis] + np.arange(self.shape[axis])) * self.pitch, np.float64)

    def slices_in(self, outer: "VoxelGrid") -> tuple[slice, slice, slice]:
        """Where this box lies in the arrays of a box that contains it."""
        low = [s - o for s, o in zip(self.start, outer.start, strict=True)]
        return (
            slice(low[0], low[0] + self.shape[0]),
            slice(low[1], low[1] + self.shape[1]),
            slice(low[2], low[2] + self.shape[2]),
        )


def grid_around(low: FloatArray, high: FloatArray, pitch: float) -> VoxelGrid:
    """The smallest box whose voxels cover the points between two corners.

    Args:
        low: (3,) m.
        high: (3,) m.
        pitch: m.
    """
    start = np.floor(low / pitch + 0.5).astype(int)
    stop = np.floor(high / pitch + 0.5).astype(int) + 1
    return _grid(start, stop, pitch)


def united(grids: list[VoxelGrid]) -> VoxelGrid:
    """The smallest box that contains all the given ones (at least one, all of one pitch)."""
    start = np.min([g.start for g in grids], axis=0)
    stop = np.max([g.stop for g in grids], axis=0)
    return _grid(start, stop, grids[0].pitch)


def grown(grid: VoxelGrid, margin: int) -> VoxelGrid:
    """The box with a margin of voxels on every side."""
    return _grid(np.array(grid.start) - margin, np.array(grid.stop) + margin, grid.pitch)


def overlap(a: VoxelGrid, b: VoxelGrid) -> VoxelGrid | None:
    """The box that two boxes of one pitch have in common."""
    start, stop = np.maximum(a.start, b.start), np.minimum(a.stop, b.stop)
    return _grid(start, stop, a.pitch) if (start < stop).all() else None


def cropped(filled: NDArray[Any], grid: VoxelGrid) -> VoxelGrid:
    """The smallest box around the filled voxels; one voxel where there are none.

    Args:
        filled: (X, Y, Z) or (X, Y, Z, W) not 0 where a voxel is filled.
        grid: the box that they are in.
    """
    low, high = _extent(filled.reshape(*grid.shape[:2], -1), grid.shape[2])
    if high[0] == 0:
        return VoxelGrid(grid.start, (1, 1, 1), grid.pitch)
    return _grid(np.array(grid.start) + low, np.array(grid.start) + high, grid.pitch)


def ball_offsets(radius: float) -> IntArray:
    """Lattice offsets within a distance, nearest first.

    Args:
        radius: in voxels.

    Returns:
        (N, 3); only the zero offset below a radius of 1.

    >>> len(ball_offsets(1.0)), len(ball_offsets(2.0))
    (7, 33)
    """
    reach = int(radius)
    span = np.arange(-reach, reach + 1)
    offsets = np.stack(np.meshgrid(span, span, span, indexing="ij"), -1).reshape(-1, 3)
    squared = (offsets**2).sum(1)
    inside = np.flatnonzero(squared <= radius * radius + 1e-9)
    return np.asarray(offsets[inside[np.argsort(squared[inside], kind="stable")]])


def _grid(start: IntArray, stop: IntArray, pitch: float) -> VoxelGrid:
    a, b = [int(v) for v in start], [int(v) for v in stop]
    return VoxelGrid((a[0], a[1], a[2]), (b[0] - a[0], b[1] - a[1], b[2] - a[2]), pitch)


@njit(cache=True, nogil=True)
def _extent(filled: NDArray[Any], n_z: int) -> tuple[IntArray, IntArray]:
    """(3,) first index of the filled voxels along each axis, and (3,) just past the last; 0 and 0 where none is."""
    n_x, n_y, n = filled.shape
    low, high = np.array([n_x, n_y, n_z]), np.zeros(3, np.int64)
    ever = np.zeros(n, filled.dtype)  # of all columns
    for x in range(n_x):
        for y in range(n_y):
            some = filled[x, y, 0]
            for z in range(n):
                some |= filled[x, y, z]
                ever[z] |= filled[x, y, z]
            if some:
                low[0], high[0] = min(low[0], x), x + 1
                low[1], high[1] = min(low[1], y), max(high[1], y + 1)
    for z in range(n):
        if ever[z]:
            low[2], high[2] = min(low[2], z * n_z // n), z * n_z // n + 1
    return low, high
