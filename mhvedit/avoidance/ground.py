"""Limbs that bear weight: where they stand still in the captured motion, they stay (Degenhardt, future work)."""

from dataclasses import dataclass

import numpy as np

from mhvedit.avoidance.kalman import Effectors
from mhvedit.avoidance.tasks import Keep
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.forward import points_on_joints
from mhvedit.skeleton.model import Motion, Skeleton
from mhvedit.skeleton.roles import joint_roles
from mhvedit.skeleton.skin import SkinnedBody

FEET = ("left_foot", "left_toe", "right_foot", "right_toe")
HANDS = ("left_hand", "right_hand")
DIAGONALS = np.array([[1.0, 1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0]])  # towards the corners of a sole
DETOUR = 0.3  # m/s: how fast a point may leave the path it was captured on, and come back to it


@dataclass(frozen=True, slots=True)
class StandingSettings:
    """When a point counts as standing."""

    speed: float = 0.15  # m/s: slower is still
    height: float = 0.20  # m above the lowest that the point ever is
    least: int = 2  # frames that it has to last


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
    slow = np.linalg.norm(np.diff(paths, axis=0), axis=2) * fps < chosen.speed
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


def at_joints(joints: IntArray) -> Effectors:
    """The joints themselves as points."""
    return Effectors(joints, np.zeros((len(joints), 3)))


def soles(body: SkinnedBody, joints: IntArray) -> Effectors:
    """Corners of the skin below joints: where these alone are kept, feet may still turn about them.

    Args:
        body: skinned.
        joints: (E,) of feet and toes.
    """
    owner, rest = body.weights.argmax(1), body.skeleton.rest_positions
    chosen, points = [joints[:0]], [np.zeros((0, 3))]
    for joint in joints:
        away = body.vertices[owner == joint] - rest[joint]
        below = away[away[:, 2] <= np.median(away[:, 2])] if len(away) else away
        if len(below):
            corners = np.unique((below[:, :2] @ DIAGONALS).argmax(0))
            chosen.append(np.full(len(corners), joint))
            points.append(below[corners])
    return Effectors(np.concatenate(chosen), np.concatenate(points))


def keep_standing(
    skeleton: Skeleton, motion: Motion, points: Effectors, *, floor: float | None = None, required: bool = True
) -> Keep:
    """The task that keeps points of limbs where they were captured while they stand.

    Between two stands they may leave their path by as much as they can come back for in time.

    Args:
        skeleton: the tree.
        motion: captured.
        points: what stands.
        floor: m, height of the ground; by default each point's own lowest.
        required: or may be given up where nothing fits.
    """
    paths = points_on_joints(skeleton, motion.q, points.joints, points.points)
    still = standing(paths, fps=motion.fps, floor=floor)
    return Keep(points.joints, points.points, paths, frames_to(still) * DETOUR / motion.fps, still, required)


def keep_everywhere(skeleton: Skeleton, motion: Motion, points: Effectors) -> Keep:
    """The task that keeps points of limbs where they were captured in all frames; it may be given up."""
    paths = points_on_joints(skeleton, motion.q, points.joints, points.points)
    still = np.zeros(paths.shape[:2], np.bool_)
    return Keep(points.joints, points.points, paths, np.zeros(paths.shape[:2]), still, required=False)


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
