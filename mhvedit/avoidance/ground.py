"""Limbs that bear weight: where they stand still in the captured motion, they stay (Degenhardt, future work)."""

from dataclasses import dataclass

import numpy as np

from mhvedit.avoidance.tasks import Keep
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.forward import points_on_joints
from mhvedit.skeleton.model import Motion, Skeleton
from mhvedit.skeleton.roles import joint_roles

FEET = ("left_foot", "left_toe", "right_foot", "right_toe")
HANDS = ("left_hand", "right_hand")
DETOUR = 0.3  # m/s: how fast a point may leave the path it was captured on, and come back to it


@dataclass(frozen=True, slots=True)
class StandingSettings:
    """When a point counts as standing."""

    speed: float = 0.15  # m/s: slower is still
    height: float = 0.20  # m above the lowest that the point ever is
    least: int = 3  # frames that it has to last


def standing(
    paths: FloatArray, *, fps: float, floor: float | None = None, settings: StandingSettings | None = None
) -> BoolArray:
    """In which frames points stand still near the ground.

    Args:
        paths: (T, E, 3) m.
        fps: Hz.
        floor: m, height of the ground; by default each point's own lowest.
        settings: thresholds.

    Returns:
        (T, E).
    """
    chosen = settings or StandingSettings()
    if len(paths) < 2:
        return np.ones(paths.shape[:2], np.bool_)
    speed = np.linalg.norm(np.diff(paths, axis=0), axis=2) * fps
    slow = speed < chosen.speed
    # a frame is still if the step to either neighbour is
    still = np.zeros(paths.shape[:2], np.bool_)
    still[:-1] |= slow
    still[1:] |= slow
    still &= paths[..., 2] < (paths[..., 2].min(0) if floor is None else floor) + chosen.height
    return _without_short_runs(still, chosen.least)


def ground_joints(skeleton: Skeleton, roles: tuple[str, ...] = FEET) -> IntArray:
    """(E,) joints of the body that have one of the roles, and the ends of their bones."""
    chosen = np.array([role in roles for role in joint_roles(skeleton.names)])
    ends = ~np.isin(np.arange(skeleton.n_joints), skeleton.parents) & (skeleton.parents >= 0)
    return np.flatnonzero(chosen | (ends & chosen[skeleton.parents]))


def keep_standing(
    skeleton: Skeleton, motion: Motion, joints: IntArray, *, floor: float | None = None, required: bool = True
) -> Keep:
    """The task that keeps joints where they were captured while they stand.

    Between two stands they may leave their path by as much as they can come back for in time.

    Args:
        skeleton: the tree.
        motion: captured.
        joints: (E,).
        floor: m, height of the ground; by default each joint's own lowest.
        required: or may be given up where nothing fits.
    """
    points = np.zeros((len(joints), 3))
    paths = points_on_joints(skeleton, motion.q, joints, points)
    still = standing(paths, fps=motion.fps, floor=floor)
    return Keep(joints, points, paths, frames_to(still) * DETOUR / motion.fps, required)


def keep_everywhere(skeleton: Skeleton, motion: Motion, joints: IntArray) -> Keep:
    """The task that keeps joints where they were captured in all frames; it may be given up."""
    points = np.zeros((len(joints), 3))
    paths = points_on_joints(skeleton, motion.q, joints, points)
    return Keep(joints, points, paths, np.zeros(paths.shape[:2]), required=False)


def frames_to(mask: BoolArray) -> FloatArray:
    """(T, E) how many frames away the nearest one is that is set; inf where none is.

    >>> frames_to(np.array([[False], [True], [False], [False]]))[:, 0]
    array([1., 0., 1., 2.])
    """
    out = np.where(mask, 0.0, np.inf)
    for t in range(1, len(out)):
        out[t] = np.minimum(out[t], out[t - 1] + 1)
    for t in range(len(out) - 2, -1, -1):
        out[t] = np.minimum(out[t], out[t + 1] + 1)
    return out


def _without_short_runs(mask: BoolArray, least: int) -> BoolArray:
    """(T, E) runs of at least so many frames."""
    out = np.zeros_like(mask)
    for column in range(mask.shape[1]):
        padded = np.concatenate([[False], mask[:, column], [False]])
        edges = np.flatnonzero(padded[1:] != padded[:-1])
        for first, past in zip(edges[::2], edges[1::2], strict=True):
            if past - first >= least:
                out[first:past, column] = True
    return out
