"""Planes across the path of a joint, which keep predicted postures on their way (Degenhardt, 3.4.1)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mhvedit.avoidance.constraints import PlaneTarget
from mhvedit.avoidance.posture import Constraint
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.skeleton.forward import points_on_joints
from mhvedit.skeleton.model import Skeleton
from mhvedit.skeleton.roles import joint_roles

AT_REST = 1e-4  # m a frame: a joint that goes less far has no direction
ELBOWS = ("left_forearm", "right_forearm")
WRISTS = ("left_hand", "right_hand")


@dataclass(frozen=True, slots=True, eq=False)
class PathPlanes:
    """Joints stay on the plane through where they are, across the direction in which they go (a task).

    The direction is that of the *modified* curves, so that it follows the detour that was found so far.
    """

    skeleton: Skeleton
    joints: IntArray  # (E,)
    required: bool = False

    def constraints(self, frame: int, q: FloatArray) -> Sequence[Constraint]:
        """A plane for each joint that moves."""
        pair = [frame, frame + 1] if frame + 1 < len(q) else [frame - 1, frame]
        if pair[0] < 0:
            return []
        points = np.zeros((len(self.joints), 3))
        there = points_on_joints(self.skeleton, q[pair], self.joints, points)
        at = there[0] if pair[0] == frame else there[1]
        return [
            PlaneTarget(int(joint), np.zeros(3), origin, direction)
            for joint, origin, direction in zip(self.joints, at, plane_normals(there), strict=True)
            if np.isfinite(direction).all()
        ]


def plane_normals(pair: FloatArray) -> FloatArray:
    """Unit direction of motion (Degenhardt, eq. 3.2: x_{i+1} - x_i, normalised).

    Args:
        pair: (2, E, 3) m, the joints in a frame and the next.

    Returns:
        (E, 3); NaN where a joint is at rest.
    """
    step = pair[1] - pair[0]
    length = np.linalg.norm(step, axis=1, keepdims=True)
    return np.where(length > AT_REST, step / np.maximum(length, AT_REST), np.nan)


def path_planes(skeleton: Skeleton, *, wrists: bool = True) -> PathPlanes:
    """Planes for the elbows and the wrists of a body, each with its own position and direction."""
    wanted = ELBOWS + (WRISTS if wrists else ())
    joints = [joint for joint, role in enumerate(joint_roles(skeleton.names)) if role in wanted]
    return PathPlanes(skeleton, np.array(joints, np.int64))
