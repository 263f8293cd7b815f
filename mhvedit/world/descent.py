"""Cyclic coordinate descent: one joint after the other turns an end effector towards its goal (Wang and Chen 1991)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.forward import forward_axes_into
from mhvedit.skeleton.model import Skeleton

SHORT = 1e-6  # m: a joint this near to effector or goal, seen along its axis, cannot tell which way to turn


@dataclass(frozen=True, slots=True)
class DescentSettings:
    """How hard to try."""

    tolerance: float = 1e-4  # m between effector and goal
    sweeps: int = 8  # over all DOFs
    share: float = 1.0  # of its angle by which a DOF turns in a sweep; below 1 outer joints leave some to inner ones


@dataclass(frozen=True, slots=True, eq=False)
class Effector:
    """A point on a limb that is to go somewhere."""

    joint: int
    point: FloatArray  # (3,) m, in the joint's frame
    goal: FloatArray  # (3,) m, world


@dataclass(frozen=True, slots=True, eq=False)
class Descended:
    """Where it ended."""

    q: FloatArray  # (D,) rad or m
    residual: float  # m between effector and goal
    sweeps: int


def signed_angle(axis: FloatArray, u: FloatArray, v: FloatArray) -> float:
    """By which angle to turn about a unit axis so that u points where v does, seen along the axis (C3.3, mended).

    Args:
        axis: (3,) unit.
        u: (3,) m, from the joint to the effector.
        v: (3,) m, from the joint to the goal.

    Returns:
        rad, -pi to pi; 0 where either vector is along the axis.
    """
    return float(_angle(axis, u, v))


def descend(
    skeleton: Skeleton, q: FloatArray, effector: Effector, dofs: Sequence[int] | IntArray, *, settings: DescentSettings
) -> Descended:
    """Bring an effector to its goal by turning DOFs, from the effector inwards, again and again (C3.2 to C3.5).

    Args:
        skeleton: with the limits within which DOFs stay.
        q: (D,) rad or m.
        effector: the point and its goal.
        dofs: that may turn, from the effector inwards; slides are left out.
        settings: when to stop.
    """
    moved = q.copy()
    s = skeleton
    tree = (s.parents, s.offsets, s.dof_joint, s.dof_axis, s.dof_slides)
    residual, sweeps = _descend(
        tree,
        s.limits,
        np.asarray(dofs, np.int64),
        effector.joint,
        effector.point,
        effector.goal,
        moved,
        (settings.tolerance, settings.sweeps, settings.share),
    )
    return Descended(moved, residual, sweeps)


Tree = tuple[IntArray, FloatArray, IntArray, FloatArray, BoolArray]


@njit(cache=True, nogil=True, error_model="numpy")
def _descend(
    tree: Tree,
    limits: FloatArray,
    dofs: IntArray,
    joint: int,
    point: FloatArray,
    goal: FloatArray,
    q: FloatArray,
    settings: tuple[float, int, float],
) -> tuple[float, int]:
    """See `descend`; writes to `q`."""
    parents, offsets, dof_joint, dof_axis, dof_slides = tree
    tolerance, most_sweeps, share = settings
    n = parents.shape[0]
    rotations, positions, axes = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((q.shape[0], 3))
    at, sweeps = np.empty(3), 0
    while True:
        forward_axes_into(parents, offsets, dof_joint, dof_axis, dof_slides, q, rotations, positions, axes)
        for r in range(3):
            at[r] = positions[joint, r]
            for c in range(3):
                at[r] += rotations[joint, r, c] * point[c]
        residual = np.sqrt(((at - goal) ** 2).sum())
        if residual <= tolerance or sweeps == most_sweeps:
            return residual, sweeps
        sweeps += 1
        for d in dofs:
            if dof_slides[d]:
                continue
            origin, axis = positions[dof_joint[d]], axes[d]
            angle = share * _angle(axis, at - origin, goal - origin)
            after = min(max(q[d] + angle, limits[d, 0]), limits[d, 1])
            _turn_point(at, origin, axis, after - q[d])
            q[d] = after


@njit(cache=True, nogil=True, error_model="numpy")
def _angle(axis: FloatArray, u: FloatArray, v: FloatArray) -> float:
    """See `signed_angle`; parts along the axis drop out of both products but for their product."""
    along_u = axis[0] * u[0] + axis[1] * u[1] + axis[2] * u[2]
    along_v = axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2]
    uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2] - along_u * along_u
    vv = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - along_v * along_v
    if uu < SHORT * SHORT or vv < SHORT * SHORT:
        return 0.0
    cosine = u[0] * v[0] + u[1] * v[1] + u[2] * v[2] - along_u * along_v
    sine = (
        axis[0] * (u[1] * v[2] - u[2] * v[1])
        + axis[1] * (u[2] * v[0] - u[0] * v[2])
        + axis[2] * (u[0] * v[1] - u[1] * v[0])
    )
    return float(np.arctan2(sine, cosine))


@njit(cache=True, nogil=True, error_model="numpy")
def _turn_point(at: FloatArray, origin: FloatArray, axis: FloatArray, angle: float) -> None:
    """Turn a point about an axis through a joint, in place."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = at[0] - origin[0], at[1] - origin[1], at[2] - origin[2]
    along = (axis[0] * x + axis[1] * y + axis[2] * z) * (1.0 - c)
    at[0] = origin[0] + c * x + s * (axis[1] * z - axis[2] * y) + axis[0] * along
    at[1] = origin[1] + c * y + s * (axis[2] * x - axis[0] * z) + axis[1] * along
    at[2] = origin[2] + c * z + s * (axis[0] * y - axis[1] * x) + axis[2] * along
