"""Forward kinematics and its derivatives: where joints and points on limbs are, and how each DOF moves them.

The functions that end in `_into` work on one posture, take arrays and write into arrays of the caller, so that other
compiled code can call them.
"""

import numpy as np
from numba import njit

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.model import Skeleton


def joint_frames(skeleton: Skeleton, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where all joints are.

    Args:
        skeleton: the tree.
        q: (..., D) rad or m.

    Returns:
        rotations (..., J, 3, 3), world_from_joint, and positions (..., J, 3) m.
    """
    flat = _postures(skeleton, q)
    n = skeleton.n_joints
    rotations, positions = np.empty((len(flat), n, 3, 3)), np.empty((len(flat), n, 3))
    _forward_all(*_tree(skeleton), flat, rotations, positions)
    return rotations.reshape(*q.shape[:-1], n, 3, 3), positions.reshape(*q.shape[:-1], n, 3)


def points_on_joints(skeleton: Skeleton, q: FloatArray, joints: IntArray, points: FloatArray) -> FloatArray:
    """Where points that move with joints are.

    Args:
        skeleton: the tree.
        q: (..., D) rad or m.
        joints: (N,) the joint that carries each point.
        points: (N, 3) m, in the frames of those joints.

    Returns:
        (..., N, 3) m, world.
    """
    rotations, positions = joint_frames(skeleton, q)
    return np.asarray((rotations[..., joints, :, :] @ points[:, :, None])[..., 0] + positions[..., joints, :])


def point_jacobian(skeleton: Skeleton, q: FloatArray, joint: int, point: FloatArray) -> FloatArray:
    """How a point on a limb moves with each DOF.

    Args:
        skeleton: the tree.
        q: (..., D) rad or m.
        joint: that carries the point.
        point: (3,) m, in the joint's frame.

    Returns:
        (..., 3, D) m per rad or m.
    """
    flat = _postures(skeleton, q)
    jacobians = np.empty((len(flat), 3, skeleton.n_dofs))
    _point_jacobians(*_tree(skeleton), flat, joint, np.asarray(point, np.float64), jacobians)
    return jacobians.reshape(*q.shape[:-1], 3, skeleton.n_dofs)


def turn_jacobian(skeleton: Skeleton, q: FloatArray, joint: int) -> FloatArray:
    """How fast a joint's frame turns with each DOF.

    Args:
        skeleton: the tree.
        q: (..., D) rad or m.
        joint: whose frame turns.

    Returns:
        (..., 3, D) world angular velocity, rad per rad; 0 for slides.
    """
    flat = _postures(skeleton, q)
    jacobians = np.empty((len(flat), 3, skeleton.n_dofs))
    _turn_jacobians(*_tree(skeleton), flat, joint, jacobians)
    return jacobians.reshape(*q.shape[:-1], 3, skeleton.n_dofs)


Tree = tuple[IntArray, FloatArray, IntArray, FloatArray, BoolArray]


def _tree(skeleton: Skeleton) -> Tree:
    """The arrays that compiled code takes."""
    return skeleton.parents, skeleton.offsets, skeleton.dof_joint, skeleton.dof_axis, skeleton.dof_slides


def _postures(skeleton: Skeleton, q: FloatArray) -> FloatArray:
    """(N, D) contiguous, whatever the batch."""
    if q.ndim == 0 or q.shape[-1] != skeleton.n_dofs:
        raise ShapeError("q", q.shape, f"(..., {skeleton.n_dofs})")
    return np.ascontiguousarray(q, np.float64).reshape(-1, skeleton.n_dofs)


@njit(cache=True, nogil=True, error_model="numpy")
def forward_into(
    parents: IntArray,
    offsets: FloatArray,
    dof_joint: IntArray,
    dof_axis: FloatArray,
    dof_slides: BoolArray,
    q: FloatArray,
    rotations: FloatArray,
    positions: FloatArray,
) -> None:
    """Joint frames of one posture: rotations (J, 3, 3) and positions (J, 3) m."""
    axes = np.empty((q.shape[0], 3))
    forward_axes_into(parents, offsets, dof_joint, dof_axis, dof_slides, q, rotations, positions, axes)


@njit(cache=True, nogil=True, error_model="numpy")
def forward_axes_into(
    parents: IntArray,
    offsets: FloatArray,
    dof_joint: IntArray,
    dof_axis: FloatArray,
    dof_slides: BoolArray,
    q: FloatArray,
    rotations: FloatArray,
    positions: FloatArray,
    axes: FloatArray,
) -> None:
    """Joint frames of one posture and (D, 3) the DOFs' axes in the world; a turn's axis goes through its joint."""
    d = 0
    for j in range(parents.shape[0]):
        turn, at, up = rotations[j], positions[j], parents[j]
        for r in range(3):
            for c in range(3):
                turn[r, c] = rotations[up, r, c] if up >= 0 else (1.0 if r == c else 0.0)
        for r in range(3):
            at[r] = turn[r, 0] * offsets[j, 0] + turn[r, 1] * offsets[j, 1] + turn[r, 2] * offsets[j, 2]
            if up >= 0:
                at[r] += positions[up, r]
        while d < q.shape[0] and dof_joint[d] == j:
            x, y, z = dof_axis[d, 0], dof_axis[d, 1], dof_axis[d, 2]
            for r in range(3):
                axes[d, r] = turn[r, 0] * x + turn[r, 1] * y + turn[r, 2] * z
            if dof_slides[d]:
                for r in range(3):
                    at[r] += axes[d, r] * q[d]
            else:
                _turn_about(turn, x, y, z, q[d])
            d += 1


@njit(cache=True, nogil=True, error_model="numpy")
def point_jacobian_into(
    parents: IntArray,
    dof_joint: IntArray,
    dof_slides: BoolArray,
    positions: FloatArray,
    axes: FloatArray,
    joint: int,
    point: FloatArray,
    jacobian: FloatArray,
) -> None:
    """(3, D) derivative of a point (3,) m in the world that moves with a joint; all columns are written."""
    jacobian[:, :] = 0.0
    d = dof_joint.shape[0] - 1
    while joint >= 0:
        while d >= 0 and dof_joint[d] > joint:
            d -= 1
        while d >= 0 and dof_joint[d] == joint:
            if dof_slides[d]:
                for r in range(3):
                    jacobian[r, d] = axes[d, r]
            else:
                x, y, z = point[0] - positions[joint, 0], point[1] - positions[joint, 1], point[2] - positions[joint, 2]
                jacobian[0, d] = axes[d, 1] * z - axes[d, 2] * y
                jacobian[1, d] = axes[d, 2] * x - axes[d, 0] * z
                jacobian[2, d] = axes[d, 0] * y - axes[d, 1] * x
            d -= 1
        joint = parents[joint]


@njit(cache=True, nogil=True, error_model="numpy")
def turn_jacobian_into(
    parents: IntArray, dof_joint: IntArray, dof_slides: BoolArray, axes: FloatArray, joint: int, jacobian: FloatArray
) -> None:
    """(3, D) angular velocity of a joint's frame; all columns are written."""
    jacobian[:, :] = 0.0
    d = dof_joint.shape[0] - 1
    while joint >= 0:
        while d >= 0 and dof_joint[d] > joint:
            d -= 1
        while d >= 0 and dof_joint[d] == joint:
            if not dof_slides[d]:
                for r in range(3):
                    jacobian[r, d] = axes[d, r]
            d -= 1
        joint = parents[joint]


@njit(cache=True, nogil=True, error_model="numpy")
def _turn_about(turn: FloatArray, x: float, y: float, z: float, angle: float) -> None:
    """Multiply a rotation from the right by the one about a unit axis."""
    c, s = np.cos(angle), np.sin(angle)
    v = 1.0 - c
    for r in range(3):
        a0, a1, a2 = turn[r, 0], turn[r, 1], turn[r, 2]
        along = (a0 * x + a1 * y + a2 * z) * v
        turn[r, 0] = a0 * c + along * x + (a1 * z - a2 * y) * s
        turn[r, 1] = a1 * c + along * y + (a2 * x - a0 * z) * s
        turn[r, 2] = a2 * c + along * z + (a0 * y - a1 * x) * s


@njit(cache=True, nogil=True, error_model="numpy")
def _forward_all(
    parents: IntArray,
    offsets: FloatArray,
    dof_joint: IntArray,
    dof_axis: FloatArray,
    dof_slides: BoolArray,
    q: FloatArray,
    rotations: FloatArray,
    positions: FloatArray,
) -> None:
    """Joint frames of many postures."""
    for i in range(q.shape[0]):
        forward_into(parents, offsets, dof_joint, dof_axis, dof_slides, q[i], rotations[i], positions[i])


@njit(cache=True, nogil=True, error_model="numpy")
def _point_jacobians(
    parents: IntArray,
    offsets: FloatArray,
    dof_joint: IntArray,
    dof_axis: FloatArray,
    dof_slides: BoolArray,
    q: FloatArray,
    joint: int,
    point: FloatArray,
    jacobians: FloatArray,
) -> None:
    """(N, 3, D) for many postures."""
    n = parents.shape[0]
    rotations, positions, axes = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((q.shape[1], 3))
    world = np.empty(3)
    for i in range(q.shape[0]):
        forward_axes_into(parents, offsets, dof_joint, dof_axis, dof_slides, q[i], rotations, positions, axes)
        for r in range(3):
            turned = 0.0
            for c in range(3):
                turned += rotations[joint, r, c] * point[c]
            world[r] = turned + positions[joint, r]
        point_jacobian_into(parents, dof_joint, dof_slides, positions, axes, joint, world, jacobians[i])


@njit(cache=True, nogil=True, error_model="numpy")
def _turn_jacobians(
    parents: IntArray,
    offsets: FloatArray,
    dof_joint: IntArray,
    dof_axis: FloatArray,
    dof_slides: BoolArray,
    q: FloatArray,
    joint: int,
    jacobians: FloatArray,
) -> None:
    """(N, 3, D) for many postures."""
    n = parents.shape[0]
    rotations, positions, axes = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((q.shape[1], 3))
    for i in range(q.shape[0]):
        forward_axes_into(parents, offsets, dof_joint, dof_axis, dof_slides, q[i], rotations, positions, axes)
        turn_jacobian_into(parents, dof_joint, dof_slides, axes, joint, jacobians[i])
