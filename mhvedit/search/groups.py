"""Solution groups: every accepted pose of a segment, as the paper names it and as a transform, with its region."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.distance import distance_to_outside
from mhvedit.geometry.planar import rotation, wrap_angle
from mhvedit.search.solve import ReasonMap


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
    grid = found.grid
    cells = np.argwhere(found.accepted)
    poses = grid.poses(cells)
    root_b = (rotation(poses[:, 2]) @ grid.root_b) + poses[:, :2]
    towards_b = root_b - grid.root_a
    bearing = np.arctan2(towards_b[:, 1], towards_b[:, 0])
    regions = connected_regions(found.accepted)
    clear = clearances(found.accepted, step=grid.step, yaw_step=2 * np.pi / grid.n_yaw * lever)
    at = tuple(cells.T)
    return SolutionGroup(
        keys=np.concatenate([grid.base[cells[:, 2]] + cells[:, :2], cells[:, 2:]], 1),
        poses=poses,
        distance=np.linalg.norm(towards_b, axis=1),
        theta_a=wrap_angle(bearing - facing_a),
        theta_b=wrap_angle(bearing + np.pi - facing_b - poses[:, 2]),
        region=regions[at],
        clearance=clear[at],
    )


def rows_of_group(group: SolutionGroup, rows: IntArray) -> SolutionGroup:
    """Some of the solutions.

    Args:
        group: of a segment.
        rows: (N,) which.
    """
    return SolutionGroup(
        keys=group.keys[rows],
        poses=group.poses[rows],
        distance=group.distance[rows],
        theta_a=group.theta_a[rows],
        theta_b=group.theta_b[rows],
        region=group.region[rows],
        clearance=group.clearance[rows],
    )


def connected_regions(accepted: BoolArray) -> Int32Array:
    """Number the regions of poses that touch (26 neighbours; yaw is a circle), largest first, equals by first cell.

    Args:
        accepted: (X, Y, Yaw).

    Returns:
        (X, Y, Yaw) region, -1 elsewhere.
    """
    out = np.full(accepted.shape, -1, np.int32)
    if not accepted.any():
        return out
    box = _box(accepted)
    inside = accepted[box]
    labels, count = ndimage.label(inside, np.ones((3, 3, 3)))
    parent = np.arange(count + 1)
    for here, there in _seam_pairs(np.asarray(labels, np.int32)):
        a, b = _root(parent, here), _root(parent, there)
        parent[max(a, b)] = min(a, b)
    merged = np.array([_root(parent, label) for label in range(count + 1)])
    names, first, sizes = np.unique(merged[labels[inside]], return_index=True, return_counts=True)
    rank = np.full(count + 1, -1, np.int32)
    rank[names[np.lexsort((first, -sizes))]] = np.arange(len(names))
    out[box] = rank[merged][labels]
    return out


def clearances(accepted: BoolArray, *, step: float, yaw_step: float) -> FloatArray:
    """Distance of each accepted cell to the nearest that is not (the outside of the map is not), yaw being a circle.

    Args:
        accepted: (X, Y, Yaw).
        step: m a cell of x and y.
        yaw_step: m a cell of yaw.

    Returns:
        (X, Y, Yaw) m.
    """
    out = np.zeros(accepted.shape)
    if accepted.any():
        box = _box(accepted)
        out[box] = distance_to_outside(accepted[box], spacing=(step, step, yaw_step))
    return out


def _box(accepted: BoolArray) -> tuple[slice, slice]:
    """The smallest rectangle of x and y around the accepted cells."""
    xs, ys = np.flatnonzero(accepted.any((1, 2))), np.flatnonzero(accepted.any((0, 2)))
    return slice(int(xs[0]), int(xs[-1]) + 1), slice(int(ys[0]), int(ys[-1]) + 1)


def _seam_pairs(labels: Int32Array) -> IntArray:
    """(N, 2) labels that touch across the seam of yaw."""
    first, last = np.pad(labels[:, :, 0], 1), labels[:, :, -1]
    pairs = []
    for dx in range(3):
        for dy in range(3):
            moved = first[dx : dx + last.shape[0], dy : dy + last.shape[1]]
            both = (moved > 0) & (last > 0)
            pairs.append(np.stack([moved[both], last[both]], 1))
    return np.unique(np.concatenate(pairs), axis=0)


def _root(parent: IntArray, label: int) -> int:
    while parent[label] != label:
        label = int(parent[label])
    return label
