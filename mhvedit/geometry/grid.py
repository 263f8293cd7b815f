"""The voxel lattice: voxel (i, j, k) has its centre at (i, j, k) * pitch, so lattices of one pitch always agree."""

from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray

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


def cropped(filled: BoolArray, grid: VoxelGrid) -> VoxelGrid:
    """The smallest box around the filled voxels; one voxel where there are none."""
    if not filled.any():
        return VoxelGrid(grid.start, (1, 1, 1), grid.pitch)
    low, high = [], []
    for axis in range(3):
        others = tuple(a for a in range(3) if a != axis)
        where = np.flatnonzero(filled.any(axis=others))
        low.append(grid.start[axis] + where[0])
        high.append(grid.start[axis] + where[-1] + 1)
    return _grid(np.array(low), np.array(high), grid.pitch)


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
