"""The one tree behind every view of a body: 23 limbs, 55 Denavit-Hartenberg joints or five chains."""

from dataclasses import dataclass

import numpy as np

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Skeleton:
    """Joints in a tree and the degrees of freedom that move them.

    All frames are parallel to the world's where every DOF is 0. A joint stands at its offset in the parent's frame,
    then slides, then turns: R = R_parent R_1 R_2 R_3 in the order of its DOFs. The rotations about z of a
    Denavit-Hartenberg table and the Euler angles of a BVH file are both of this kind.
    """

    names: tuple[str, ...]  # J joints, parents before children
    parents: IntArray  # (J,) -1 for the root
    offsets: FloatArray  # (J, 3) m, joint in its parent's frame where q = 0
    dof_joint: IntArray  # (D,) joint that each DOF moves, never decreasing
    dof_axis: FloatArray  # (D, 3) unit, in the joint's own frame
    dof_slides: BoolArray  # (D,) a translation along the axis (m) and not a rotation (rad); slides come before turns
    limits: FloatArray  # (D, 2) rad or m, least and largest; -inf, inf where free
    dof_names: tuple[str, ...]  # e.g. "left_elbow.x"

    def __post_init__(self) -> None:
        n_joints, n_dofs = len(self.names), len(self.dof_names)
        for name, array, shape in (
            ("parents", self.parents, (n_joints,)),
            ("offsets", self.offsets, (n_joints, 3)),
            ("dof_joint", self.dof_joint, (n_dofs,)),
            ("dof_axis", self.dof_axis, (n_dofs, 3)),
            ("dof_slides", self.dof_slides, (n_dofs,)),
            ("limits", self.limits, (n_dofs, 2)),
        ):
            if array.shape != shape:
                raise ShapeError(name, array.shape, shape)
        self._check_tree()
        self._check_dofs()

    def _check_tree(self) -> None:
        """One root, and parents before children."""
        if len(set(self.names)) < len(self.names) or not self.names:
            raise ShapeError("names", self.names, "at least one joint, and each name once")
        if self.parents[0] != -1 or (self.parents[1:] < 0).any():
            raise ShapeError("parents", self.parents.tolist(), "-1 for the first joint and for no other")
        if (self.parents >= np.arange(len(self.parents))).any():
            raise ShapeError("parents", self.parents.tolist(), "parents before their children")
        if not np.isfinite(self.offsets).all():
            raise ShapeError("offsets", self.offsets.tolist(), "finite numbers")

    def _check_dofs(self) -> None:
        """Unit axes in the order of the joints, slides first, limits the right way round."""
        joints = self.dof_joint
        if len(joints) and (joints.min() < 0 or joints.max() >= len(self.names) or (np.diff(joints) < 0).any()):
            raise ShapeError("dof_joint", joints.tolist(), f"joints 0 to {len(self.names) - 1}, never decreasing")
        late = self.dof_slides[1:] & ~self.dof_slides[:-1] & (np.diff(joints) == 0)
        if late.any():
            raise ShapeError("dof_slides", self.dof_names[int(np.argmax(late)) + 1], "slides before turns")
        if not np.allclose(np.linalg.norm(self.dof_axis, axis=1), 1.0, atol=1e-9):
            raise ShapeError("dof_axis", self.dof_axis.tolist(), "unit vectors")
        if not (self.limits[:, 0] <= self.limits[:, 1]).all():
            raise ShapeError("limits", self.limits.tolist(), "the lower limit first")

    @property
    def n_joints(self) -> int:
        """J."""
        return len(self.names)

    @property
    def n_dofs(self) -> int:
        """D."""
        return len(self.dof_names)

    @property
    def rest_positions(self) -> FloatArray:
        """(J, 3) m, joints where q = 0."""
        positions = self.offsets.copy()
        for joint in range(1, self.n_joints):
            positions[joint] += positions[self.parents[joint]]
        return positions


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A posture of a skeleton for each frame."""

    q: FloatArray  # (T, D) rad or m
    fps: float  # Hz

    def __post_init__(self) -> None:
        if self.q.ndim != 2:
            raise ShapeError("q", self.q.shape, "(T, D)")
        if not np.isfinite(self.q).all():
            frame, dof = np.argwhere(~np.isfinite(self.q))[0]
            raise ShapeError(f"q of frame {frame}, DOF {dof}", self.q[frame, dof], "a finite number")
        if not 0 < self.fps < np.inf:
            raise ShapeError("fps", self.fps, "a positive number")

    @property
    def n_frames(self) -> int:
        """T."""
        return len(self.q)


def joint_index(skeleton: Skeleton, name: str, *, asked: str = "joint") -> int:
    """Which joint has a name.

    Args:
        skeleton: to look in.
        name: of the joint.
        asked: what the name was given for, as it is told.

    Raises:
        ShapeError: none has; the message lists those that there are.
    """
    if name not in skeleton.names:
        raise ShapeError(asked, repr(name), "one of " + ", ".join(skeleton.names))
    return skeleton.names.index(name)


def dofs_of(skeleton: Skeleton, names: tuple[str, ...]) -> IntArray:
    """(K,) DOFs of the named joints, ascending.

    Raises:
        ShapeError: no such joint.
    """
    joints = [joint_index(skeleton, name) for name in names]
    return np.flatnonzero(np.isin(skeleton.dof_joint, joints))


def ancestors(skeleton: Skeleton) -> BoolArray:
    """(J, J) whether the column's joint is the row's or above it."""
    above = np.eye(skeleton.n_joints, dtype=np.bool_)
    for joint in range(1, skeleton.n_joints):
        above[joint] |= above[skeleton.parents[joint]]
    return above
