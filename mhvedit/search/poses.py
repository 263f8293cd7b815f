"""The lattice of candidate poses of B beside A, and the window of it that a segment is searched in.

Poses live on one lattice for all segments of two subjects (whole steps of x and y, whole steps of yaw, both from zero
in the subjects' canonical frames), so that one and the same relative pose is a candidate of every segment. The window
of a segment is the square around A's root in which B's root may stand; its map has one cell per lattice pose and yaw.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.lookup import rows_in
from mhvedit.geometry.planar import rotation


@dataclass(frozen=True, slots=True, eq=False)
class PoseGrid:
    """Candidate poses of B in A's canonical frame: cell (i, j, k) is ((base[k] + (i, j)) * step, k * yaw_step)."""

    step: float  # m
    stride: int  # step in voxels
    n_yaw: int
    window: float  # m, side of the square
    root_a: FloatArray  # (2,) m, in A's canonical frame
    root_b: FloatArray  # (2,) m, in B's canonical frame
    base: IntArray  # (n_yaw, 2) lattice index, in steps, of cell (0, 0)
    size: int  # cells along x and along y

    @property
    def yaws(self) -> FloatArray:
        """(n_yaw,) rad."""
        return np.asarray(np.arange(self.n_yaw) * (2 * np.pi / self.n_yaw), np.float64)

    def yaw(self, k: int) -> float:
        """One of them."""
        return k * (2 * np.pi / self.n_yaw)

    @property
    def offsets(self) -> FloatArray:
        """(size,) nominal place of B's root relative to A's along x (and y) of each cell, m; true to half a step."""
        return np.asarray((np.arange(self.size) - self.size // 2) * self.step)

    def poses(self, cells: IntArray) -> FloatArray:
        """Poses of cells.

        Args:
            cells: (S, 3) i, j, k.

        Returns:
            (S, 3) x, y m and yaw rad of B in A, canonical frames.
        """
        return self.lattice_poses(np.column_stack([self.base[cells[:, 2]] + cells[:, :2], cells[:, 2]]))

    def lattice_poses(self, keys: IntArray) -> FloatArray:
        """Poses of places on the lattice of poses.

        Args:
            keys: (S, 3) steps of x, y and yaw.

        Returns:
            (S, 3) as `poses`.
        """
        found = np.empty(keys.shape)
        found[:, :2], found[:, 2] = keys[:, :2] * self.step, self.yaws[keys[:, 2]]
        return found

    def roots(self) -> FloatArray:
        """(n_yaw, 2, size) where B's root stands relative to A's along x, and along y, m."""
        turned = rotation(self.yaws) @ self.root_b - self.root_a
        return np.asarray((self.base[:, :, None] + np.arange(self.size)) * self.step + turned[:, :, None])

    def reach(self) -> tuple[BoolArray, BoolArray]:
        """(n_yaw, size) at which steps along x, and along y, B's root is in the window: where both are, a cell is."""
        there = np.abs(self.roots()) <= self.window / 2 + 1e-9
        return there[:, 0], there[:, 1]


@njit(cache=True, nogil=True, inline="always")
def lattice_pose(cell: int, size: int, base: IntArray) -> tuple[int, int, int]:
    """Steps of x and y, and of yaw, of a cell of the flattened grid (`size` and `base` as in `PoseGrid`)."""
    row, k = divmod(np.int64(cell), base.shape[0])
    return base[k, 0] + row // size, base[k, 1] + row % size, k


@dataclass(frozen=True, slots=True, eq=False)
class CellSet:
    """Some cells of a grid, and the lattice poses that they are."""

    cells: IntArray | Int32Array  # (N,) of the flattened grid, ascending
    size: int
    base: IntArray  # (n_yaw, 2); both as in `PoseGrid`

    def __len__(self) -> int:
        return len(self.cells)

    def keys(self, rows: IntArray) -> IntArray:
        """(N, 3) lattice poses.

        Args:
            rows: (N,) of the cells.
        """
        return np.asarray(_lattice_keys(self.cells, rows, self.size, self.base))

    def rows_at(self, keys: IntArray) -> IntArray:
        """Rows of lattice poses, -1 for those that are not there.

        Args:
            keys: (N, 3) steps of x, y and yaw.
        """
        found = np.full(len(keys), -1)
        if len(self) == 0:
            return found
        n_yaw = len(self.base)
        known = np.flatnonzero(keys[:, 2] < n_yaw)
        place = keys[known, :2] - self.base[keys[known, 2]]
        within = ((place >= 0) & (place < self.size)).all(1)
        known, place = known[within], place[within]
        flat = (place[:, 0] * self.size + place[:, 1]) * n_yaw + keys[known, 2]
        found[known] = rows_in(self.cells, flat.astype(self.cells.dtype))
        return found


def cells_of_keys(keys: IntArray) -> CellSet:
    """Lattice poses as cells of the smallest grid that has them.

    Args:
        keys: (N, 3) steps of x, y and yaw, ascending, at least one.
    """
    low, high = keys.min(0), keys.max(0)
    size, n_yaw = int((high - low)[:2].max()) + 1, int(high[2]) + 1
    place = keys[:, :2] - low[:2]
    return CellSet((place[:, 0] * size + place[:, 1]) * n_yaw + keys[:, 2], size, np.tile(low[:2], (n_yaw, 1)))


@njit(cache=True, nogil=True)
def _lattice_keys(cells: IntArray, rows: IntArray, size: int, base: IntArray) -> IntArray:
    """(N, 3) lattice poses of the cells of some rows."""
    keys = np.empty((rows.shape[0], 3), np.int64)
    for n in range(rows.shape[0]):
        i, j, k = lattice_pose(cells[rows[n]], size, base)
        keys[n, 0], keys[n, 1], keys[n, 2] = i, j, k
    return keys


def pose_grid(
    root_a: FloatArray, root_b: FloatArray, *, pitch: float, stride: int, n_yaw: int, window: float
) -> PoseGrid:
    """The candidate poses of one segment.

    Args:
        root_a: (2,) m, A's root in its canonical frame.
        root_b: (2,) m, B's root in its canonical frame.
        pitch: voxel size, m.
        stride: step in voxels, at least 1.
        n_yaw: samples of the full turn.
        window: side of the square around A's root, m.
    """
    step = stride * pitch
    half = int(np.floor(window / 2 / step + 1e-9)) + 1
    turned = rotation(np.asarray(np.arange(n_yaw) * (2 * np.pi / n_yaw))) @ root_b
    base = np.rint((root_a - turned) / step).astype(np.int64) - half
    return PoseGrid(step, stride, n_yaw, window, root_a, root_b, base, 2 * half + 1)
