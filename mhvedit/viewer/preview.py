"""Poses that are looked at, as cells of a segment's map."""

from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import BoolArray, IntArray
from mhvedit.search.solve import ACCEPTED
from mhvedit.viewer.material import SegmentView

Cell = tuple[int, int, int]  # x, y, yaw


@dataclass(frozen=True, slots=True)
class Preview:
    """A pose that is looked at: a cell of the current segment's map."""

    cell: Cell  # x, y, yaw
    pose: tuple[float, float, float]  # x, y m and yaw rad of B in A, canonical frames
    row: int | None  # of the solution group; None where the pose was rejected
    reason: str  # what rejected it, or "accepted"


def preview_of(view: SegmentView, cell: Cell) -> Preview | None:
    """A cell of a map as a preview; None outside."""
    i, j, k = cell
    size, _, n_yaw = view.found.reason.shape
    if not (0 <= i < size and 0 <= j < size):
        return None
    cell = (i, j, k % n_yaw)
    pose = view.grid.poses(np.array([cell]))[0]
    code = int(view.found.reason[cell])
    row = row_of(view, cell) if code == ACCEPTED else None
    return Preview(cell, (float(pose[0]), float(pose[1]), float(pose[2])), row, view.found.reasons[code])


def row_of(view: SegmentView, cell: Cell) -> int | None:
    """The row of the solution group in a cell of the map."""
    i, j, k = cell
    key = np.array([*(view.grid.base[k] + (i, j)), k])
    rows = np.flatnonzero((view.group.keys == key).all(1))
    return int(rows[0]) if len(rows) else None


def cell_of_row(view: SegmentView, row: int) -> Cell:
    """The cell of the map in which a solution is."""
    x, y, k = (int(value) for value in view.group.keys[row])
    return x - int(view.grid.base[k][0]), y - int(view.grid.base[k][1]), k


def best_cell(
    view: SegmentView, place: tuple[int, int], *, yaw: int | None = None, left: BoolArray | None = None
) -> Cell | None:
    """What somebody means who points at a place: the solution there, or else the nearest miss.

    Args:
        view: of the segment.
        place: i, j on the map.
        yaw: index of the yaw to stay near to; None for the most room.
        left: (S,) solutions that are not excluded.
    """
    i, j = place
    size, _, n_yaw = view.found.reason.shape
    if not (0 <= i < size and 0 <= j < size):
        return None
    column = view.found.reason[i, j]
    yaws = np.flatnonzero(column == ACCEPTED)
    if not len(yaws):
        yaws = np.flatnonzero(column == column.max())
        near = 0 if yaw is None else yaw
        return i, j, int(yaws[np.argmin(_yaw_steps(yaws, near, n_yaw))])
    if yaw is not None:
        return i, j, int(yaws[np.argmin(_yaw_steps(yaws, yaw, n_yaw))])
    rows = [row_of(view, (i, j, int(k))) for k in yaws]
    room = [
        -np.inf if row is None or (left is not None and not left[row]) else view.group.clearance[row] for row in rows
    ]
    return i, j, int(yaws[int(np.argmax(room))])


def _yaw_steps(yaws: IntArray, yaw: int, n_yaw: int) -> IntArray:
    """How many steps of yaw apart, round the circle."""
    apart = np.abs(yaws - yaw)
    return np.asarray(np.minimum(apart, n_yaw - apart))
