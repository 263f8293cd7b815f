"""What a motion has to keep doing while it avoids itself (Degenhardt, 3.4.2 and 3.4.3).

A task is created from the captured motion and asked for its constraints before every posture prediction. That is the
whole interface: your own task is a class with these two members.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from mhvedit.avoidance.constraints import BodyPointTarget, DirectionTarget, PointTargets
from mhvedit.avoidance.posture import Constraint
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.model import Motion, Skeleton, dofs_of, joint_index

LEAST_SLACK: Final = 1.5e-3  # m along each axis: less than what anybody sees, and room for the other constraints


class Task(Protocol):
    """Something that a motion has to keep doing."""

    @property
    def required(self) -> bool:
        """Whether a posture that misses it is no answer; else it is given up where nothing fits."""

    def constraints(self, frame: int, q: FloatArray) -> Sequence[Constraint]:
        """For one frame; q (T, D) are the curves as they are."""


@dataclass(frozen=True, slots=True, eq=False)
class Keep:
    """Points on limbs stay where they were captured, each frame as near as it says."""

    joints: IntArray  # (E,)
    points: FloatArray  # (E, 3) m, in the joints' frames
    targets: FloatArray  # (T, E, 3) m, captured
    slack: FloatArray  # (T, E) m along each axis; inf where the point is free
    stands: BoolArray  # (T, E) whether it was captured standing still
    required: bool = True

    def constraints(self, frame: int, q: FloatArray) -> Sequence[Constraint]:
        """Targets for the points that are not free."""
        del q
        held = np.flatnonzero(np.isfinite(self.slack[frame]))
        if len(held) == 0:
            return []
        slack = np.maximum(self.slack[frame, held], LEAST_SLACK)
        return [PointTargets(self.joints[held], self.points[held], self.targets[frame, held], slack)]


@dataclass(frozen=True, slots=True, eq=False)
class TwoHanded:
    """The second hand holds what hangs on the first: its point and its direction as they were in one frame."""

    hand: int  # joint that has to follow
    point: FloatArray  # (3,) m, where it holds on, in its own frame
    holder: int  # joint that the object hangs on
    target: FloatArray  # (3,) m, the same place in the holder's frame
    directions: FloatArray  # (2, 3) unit, in the hand's frame
    target_directions: FloatArray  # (2, 3) unit, in the holder's frame
    required: bool = True

    def constraints(self, frame: int, q: FloatArray) -> Sequence[Constraint]:
        """The place of contact and two directions."""
        del frame, q
        turned = [
            DirectionTarget(self.hand, here, self.holder, there)
            for here, there in zip(self.directions, self.target_directions, strict=True)
        ]
        return [BodyPointTarget(self.hand, self.point, self.holder, self.target), *turned]


def two_handed(
    skeleton: Skeleton, motion: Motion, *, hand: str, holder: str, point: FloatArray, frame: int = -1
) -> TwoHanded:
    """A two-handed weapon: what the second hand holds on to is taken from one captured frame (Degenhardt, 3.4.2).

    Args:
        skeleton: the tree.
        motion: captured.
        hand: joint of the hand that has to keep hold.
        holder: joint that the weapon is parented to.
        point: (3,) m, where the hand touches it, in the hand's frame.
        frame: in which both hold it; the last by default.

    Raises:
        ShapeError: no such joint.
    """
    here, there = joint_index(skeleton, hand), joint_index(skeleton, holder)
    rotations, positions = joint_frames(skeleton, motion.q[frame])
    down = rotations[there].T
    target = down @ (rotations[here] @ point + positions[here] - positions[there])
    axes = np.eye(3)[:2]
    return TwoHanded(here, point, there, target, axes, axes @ rotations[here].T @ rotations[there])


def frozen_dofs(skeleton: Skeleton, names: Sequence[str]) -> BoolArray:
    """(D,) which DOFs may change where the named joints are frozen (Degenhardt, 4.3: the lower body).

    Raises:
        ShapeError: no such joint; the message lists those that there are.
    """
    free = np.ones(skeleton.n_dofs, np.bool_)
    free[dofs_of(skeleton, tuple(names))] = False
    return free
