"""The search as the paper tells it, written plainly in NumPy: pose by pose, move B's voxels, intersect, test."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mhvedit.constraints.clauses import Clause, Meeting, Option
from mhvedit.geometry.arrays import IntArray, Words
from mhvedit.search.poses import PoseGrid
from mhvedit.search.solve import ACCEPTED, BASE_REASONS
from mhvedit.volumes.history import MotionHistoryVolume


@dataclass(frozen=True, slots=True, eq=False)
class Voxels:
    """The filled voxels of a turned volume."""

    places: IntArray  # (N, 3) lattice indices
    words: Words  # (N, W)


Turned = dict[int, Voxels]  # by id of the volume


def reason_at(grid: PoseGrid, clauses: Sequence[Clause], cell: IntArray, turned: Turned) -> int:
    """What accepts or first rejects one pose of the window, numbered as in `ReasonMap`.

    Args:
        grid: candidate poses.
        clauses: constraints, in the order in which they are to be blamed.
        cell: (3,) of the grid.
        turned: voxels that are turned already; those that had to be are added.
    """
    for number, clause in enumerate(clauses, start=len(BASE_REASONS)):
        if not any(_holds(option, grid, cell, turned) for option in clause.options):
            return number
    return ACCEPTED


def turned_voxels(volume: MotionHistoryVolume, yaw: float) -> Voxels:
    """Turn a volume about z: a voxel of the lattice is what its centre falls into in the untouched volume."""
    c, s = np.cos(yaw), np.sin(yaw)
    start, shape = np.array(volume.grid.start[:2]), np.array(volume.grid.shape[:2])
    corners = start + shape * np.array([(0, 0), (0, 1), (1, 0), (1, 1)])
    around = corners @ np.array([[c, s], [-s, c]])
    low, high = np.floor(around.min(0)).astype(int) - 1, np.ceil(around.max(0)).astype(int) + 2
    x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]), indexing="ij")
    u, v = np.floor(c * x + s * y + 0.5).astype(int) - start[0], np.floor(c * y - s * x + 0.5).astype(int) - start[1]
    there = (u >= 0) & (v >= 0) & (u < shape[0]) & (v < shape[1])
    columns, words = np.stack([x[there], y[there]], 1), volume.frames[u[there], v[there]]
    column, z = np.nonzero(words.any(-1))
    return Voxels(np.column_stack([columns[column], z + volume.grid.start[2]]), words[column, z])


def _holds(option: Option, grid: PoseGrid, cell: IntArray, turned: Turned) -> bool:
    return all(_met(meeting, grid, cell, turned) for meeting in option.must) and not any(
        _met(meeting, grid, cell, turned) for meeting in option.never
    )


def _met(meeting: Meeting, grid: PoseGrid, cell: IntArray, turned: Turned) -> bool:
    if id(meeting.b) not in turned:
        turned[id(meeting.b)] = turned_voxels(meeting.b.whole, float(grid.yaws[cell[2]]))
    moved, a = turned[id(meeting.b)], meeting.a.whole
    shift = np.append((grid.base[cell[2]] + cell[:2]) * grid.stride, 0)
    places = moved.places + shift - a.grid.start
    inside = ((places >= 0) & (places < a.grid.shape)).all(1)
    i, j, k = places[inside].T
    common = np.bitwise_or.reduce(a.frames[i, j, k] & moved.words[inside], axis=0)
    return bool((common != 0).any() if meeting.every is None else (meeting.every & ~common == 0).all())
