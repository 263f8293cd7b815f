"""Several solutions of one scene that are unlike each other: other regions first, then far from all before."""

from typing import Final

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.planar import rotation, wrap_angle
from mhvedit.pipeline.segments import SolvedSegment

LEVER: Final = 0.5  # m, what a radian of yaw counts for
Regions = IntArray | Int32Array


def diverse_rows(segment: SolvedSegment, first: int, count: int, *, left: IntArray) -> list[int]:
    """Rows of a solution group, each as far from those before it as can be, in regions that have none yet if any has.

    Only the better half of every region is considered, by merit: the farthest poses of a region are those on its rim.

    Args:
        segment: solved.
        first: the row to begin with.
        count: how many rows there are to be.
        left: (N,) rows that may be taken.

    Returns:
        At most `count` rows, `first` foremost; fewer where there are fewer solutions.
    """
    group = segment.group
    places = placed(group.poses, segment.grid.root_b)
    good = np.zeros(len(group), np.bool_)
    good[left] = better_half(segment.merit(left), group.region[left])
    return farthest(places, group.region, good, first=first, count=count)


def farthest(places: FloatArray, region: Regions, good: BoolArray, *, first: int, count: int) -> list[int]:
    """Farthest-point sampling that goes to new regions as long as there are any.

    Args:
        places: (S, 3) m: x, y and yaw times `LEVER`; of the yaw the shorter way round counts.
        region: (S,) of each.
        good: (S,) which may be taken.
        first: the row to begin with, whether it is good or not.
        count: how many rows there are to be.
    """
    rows = [first]
    free, new = good.copy(), good & (region != region[first])
    free[first] = False
    away = _apart(places, places[first])
    while len(rows) < count and free.any():
        among = new if new.any() else free
        row = int(np.argmax(np.where(among, away, -1.0)))
        rows.append(row)
        free[row] = False
        new &= region != region[row]
        away = np.minimum(away, _apart(places, places[row]))
    return rows


def placed(poses: FloatArray, root: FloatArray) -> FloatArray:
    """(S, 3) m: where poses of B put its root, and how they turn it.

    Args:
        poses: (S, 3) x, y m and yaw rad.
        root: (2,) m, in B's frame.
    """
    there = rotation(poses[:, 2]) @ root + poses[:, :2]
    return np.concatenate([there, poses[:, 2:] * LEVER], 1)


def better_half(merit: FloatArray, region: Regions) -> BoolArray:
    """(S,) which solutions have at least the median merit of their region: one or more of each.

    Args:
        merit: (S,) m.
        region: (S,) of each.
    """
    order = np.lexsort((-merit, region))
    _, start, size = np.unique(region[order], return_index=True, return_counts=True)
    rank = np.empty(len(region), np.int64)
    rank[order] = np.arange(len(region)) - np.repeat(start, size)
    half = np.empty(len(region), np.int64)
    half[order] = np.repeat((size + 1) // 2, size)
    return np.asarray(rank < half)


def _apart(places: FloatArray, place: FloatArray) -> FloatArray:
    """(S,) m."""
    turned = wrap_angle((places[:, 2] - place[2]) / LEVER) * LEVER
    return np.asarray(np.sqrt(((places[:, :2] - place[:2]) ** 2).sum(1) + turned**2))
