"""Solution groups: every accepted pose of a segment, as the paper names it and as a transform, with its region."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.distance import distance_in_runs, distance_to_outside
from mhvedit.geometry.planar import rotation
from mhvedit.geometry.runs import runs_along_rows
from mhvedit.search.poses import PoseGrid, lattice_pose
from mhvedit.search.solve import ACCEPTED, ReasonMap


@dataclass(frozen=True, slots=True, eq=False)
class SolutionGroup:
    """All solutions of one segment, in canonical frames; rows belong together."""

    keys: IntArray  # (S, 3) pose on the subjects' common lattice: steps of x and y, and of yaw
    poses: FloatArray  # (S, 3) x, y m and yaw rad of B in A
    distance: FloatArray  # (S,) L, between the roots, m
    theta_a: FloatArray  # (S,) rad, from A's facing to the line towards B's root
    theta_b: FloatArray  # (S,) rad, from B's facing to the line towards A's root
    region: Int32Array  # (S,) connected region, the largest is 0
    clearance: FloatArray  # (S,) m, to the nearest pose that is not a solution

    def __len__(self) -> int:
        return len(self.keys)


def solution_group(found: ReasonMap, *, facing_a: float, facing_b: float, lever: float) -> SolutionGroup:
    """Collect the accepted poses (Shi et al., section 4.3.2: R).

    Args:
        found: what the search said.
        facing_a: A's facing over the segment, rad in its canonical frame.
        facing_b: B's.
        lever: what a turn of one radian counts for in `clearance`, m.
    """
    cells, region, clearance = located_solutions(found, lever=lever)
    return described(found.grid, cells, region, clearance, facing=(facing_a, facing_b))


def located_solutions(found: ReasonMap, *, lever: float) -> tuple[IntArray | Int32Array, Int32Array, FloatArray]:
    """Where the accepted poses are.

    Args:
        found: what the search said.
        lever: what a turn of one radian counts for in clearances, m.

    Returns:
        (S,) cells of the flattened grid, ascending; (S,) region, (S,) clearance as in `SolutionGroup`.
    """
    shape = found.reason.shape
    runs, starts = runs_along_rows(found.reason, ACCEPTED)
    region = _numbered(runs, _joined(runs, starts, shape))
    yaw_step = 2 * np.pi / found.grid.n_yaw * lever
    cells: IntArray | Int32Array
    if found.reason.size < 2**31:
        cells = np.empty(len(region), np.int32)
    else:
        cells = np.empty(len(region), np.int64)
    _list_cells(runs, starts, shape[2], cells)
    spacing = (found.grid.step, found.grid.step, yaw_step)
    return cells, region, distance_in_runs(runs, starts, shape, spacing=spacing)


def described(
    grid: PoseGrid,
    cells: IntArray | Int32Array,
    region: Int32Array,
    clearance: FloatArray,
    *,
    facing: tuple[float, float],
) -> SolutionGroup:
    """Solutions as the paper names them.

    Args:
        grid: candidate poses.
        cells: (S,) of the flattened grid.
        region: (S,) as in `SolutionGroup`.
        clearance: (S,) as in `SolutionGroup`.
        facing: of A and B over the segment, rad in their canonical frames.
    """
    turned_b = rotation(grid.yaws) @ grid.root_b
    keys, poses, distance, theta_a, theta_b = _described(
        cells, grid.size, grid.base, grid.step, grid.yaws, turned_b - grid.root_a, np.array(facing)
    )
    return SolutionGroup(keys, poses, distance, theta_a, theta_b, region, clearance)


def connected_regions(accepted: BoolArray) -> Int32Array:
    """Number the regions of poses that touch (26 neighbours; yaw is a circle), largest first, equals by first cell.

    Args:
        accepted: (X, Y, Yaw).

    Returns:
        (S,) region of each accepted cell, in the order of `np.argwhere`.
    """
    runs, starts = runs_along_rows(accepted.view(np.uint8), 1)
    return _numbered(runs, _joined(runs, starts, accepted.shape))


def clearances(accepted: BoolArray, *, step: float, yaw_step: float) -> FloatArray:
    """Distance of each accepted cell to the nearest that is not (the outside of the map is not), yaw being a circle.

    Args:
        accepted: (X, Y, Yaw).
        step: m a cell of x and y.
        yaw_step: m a cell of yaw; 0 where a turn counts for nothing.

    Returns:
        (S,) m, in the order of `np.argwhere`.
    """
    return distance_to_outside(accepted, spacing=(step, step, yaw_step))


@njit(cache=True, nogil=True)
def _list_cells(runs: IntArray, starts: IntArray, n_z: int, cells: IntArray) -> None:
    """All cells of all runs in the flattened map, in order."""
    at = 0
    for row in range(starts.shape[0] - 1):
        for run in range(starts[row], starts[row + 1]):
            for z in range(runs[run, 0], runs[run, 1]):
                cells[at] = row * n_z + z
                at += 1


@njit(cache=True, nogil=True)
def _joined(runs: IntArray, starts: IntArray, shape: tuple[int, int, int]) -> IntArray:
    """(R,) the first run of the region that each run is in."""
    n_x, n_y, n_z = shape
    parent = np.arange(runs.shape[0])
    for x in range(n_x):
        for y in range(n_y):
            here = x * n_y + y
            if starts[here] == starts[here + 1]:
                continue
            _join_rows(runs, starts, here, here, n_z, parent)
            for d_x, d_y in ((-1, -1), (-1, 0), (-1, 1), (0, -1)):
                if x + d_x >= 0 and 0 <= y + d_y < n_y:
                    _join_rows(runs, starts, here, here + d_x * n_y + d_y, n_z, parent)
    for run in range(runs.shape[0]):
        parent[run] = parent[parent[run]]
    return parent


def _numbered(runs: IntArray, roots: IntArray) -> Int32Array:
    """(S,) the rank of the region of each cell, from the first run of each run's region."""
    lengths = runs[:, 1] - runs[:, 0]
    names, inverse = np.unique(roots, return_inverse=True)
    sizes = np.bincount(inverse, weights=lengths, minlength=len(names))
    rank = np.empty(len(names), np.int32)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(names))
    return np.repeat(rank[inverse], lengths)


@njit(cache=True, nogil=True)
def _join_rows(runs: IntArray, starts: IntArray, here: int, there: int, n_z: int, parent: IntArray) -> None:
    """Join the runs of two rows that touch, across the seam of yaw too."""
    a, b = starts[here], starts[there]
    while a < starts[here + 1] and b < starts[there + 1]:
        if runs[a, 0] <= runs[b, 1] and runs[b, 0] <= runs[a, 1]:
            _join(parent, a, b)
        if runs[a, 1] < runs[b, 1]:
            a += 1
        else:
            b += 1
    if starts[here] < starts[here + 1] and starts[there] < starts[there + 1]:
        for low, high in ((here, there), (there, here)):
            first, last = starts[low], starts[high + 1] - 1
            if runs[first, 0] == 0 and runs[last, 1] == n_z:
                _join(parent, first, last)


@njit(cache=True, nogil=True)
def _join(parent: IntArray, a: int, b: int) -> None:
    """Make the smaller root that of both."""
    while parent[a] != a:
        parent[a] = parent[parent[a]]
        a = parent[a]
    while parent[b] != b:
        parent[b] = parent[parent[b]]
        b = parent[b]
    if a < b:
        parent[b] = a
    else:
        parent[a] = b


@njit(cache=True, nogil=True)
def _described(
    cells: IntArray, size: int, base: IntArray, step: float, yaws: FloatArray, turned: FloatArray, facing: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Keys, poses, distance and both angles of cells; `turned` is B's turned root less A's root, for each yaw."""
    count = cells.shape[0]
    keys, poses = np.empty((count, 3), np.int64), np.empty((count, 3))
    distance, theta_a, theta_b = np.empty(count), np.empty(count), np.empty(count)
    for s in range(count):
        i, j, k = lattice_pose(cells[s], size, base)
        keys[s, 0], keys[s, 1], keys[s, 2] = i, j, k
        poses[s, 0], poses[s, 1], poses[s, 2] = keys[s, 0] * step, keys[s, 1] * step, yaws[k]
        x, y = poses[s, 0] + turned[k, 0], poses[s, 1] + turned[k, 1]
        bearing = np.arctan2(y, x)
        distance[s] = np.sqrt(x * x + y * y)
        theta_a[s] = seen_from(bearing, facing[0], np.pi)
        theta_b[s] = seen_from(bearing, facing[1], -yaws[k])
    return keys, poses, distance, theta_a, theta_b


@njit(cache=True, nogil=True, inline="always")
def seen_from(bearing: float, facing: float, turn: float) -> float:
    """The angle in [-pi, pi) from a facing to a bearing, or (`turn`: less its yaw, for pi) from B's to the way back.

    `%` would take longer than all else about a solution.
    """
    angle = bearing - facing + turn
    while angle < 0:
        angle += 2 * np.pi
    while angle >= 2 * np.pi:
        angle -= 2 * np.pi
    return angle - np.pi
