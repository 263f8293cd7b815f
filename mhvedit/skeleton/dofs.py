"""Degrees of freedom for bodies of any source, and their values from rotations.

Euler angles have two solutions for every rotation; of these the one that runs on from the frame before is taken, and
whole turns are added to it, so that a motion without jumps has DOFs without jumps.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.skeleton.model import Skeleton
from mhvedit.skeleton.roles import UNKNOWN, joint_roles
from mhvedit.skeleton.tables import FREE, ROLES

AXES: Final = {
    sign + axis: np.array([(-1.0 if sign else 1.0) * (axis == a) for a in "xyz"])
    for sign in ("", "-")
    for axis in "xyz"
}
DEFAULT_ORDER: Final = "zyx"  # of joints that the tables do not know
Turns = Mapping[str, Sequence[str] | None]  # axes ("x", "-y") by joint, or None for those of the tables


def body_skeleton(
    names: tuple[str, ...], parents: IntArray, offsets: FloatArray, *, turning: Turns, sliding: Sequence[str]
) -> Skeleton:
    """A skeleton whose joints turn about the world's axes at rest, within the limits of the tables.

    The limits hold for a body that faces -y with its arms out sideways where q = 0; joints of other bodies, and those
    that the tables do not know, are free.

    Args:
        names: J joints, parents before children.
        parents: (J,) -1 for the root.
        offsets: (J, 3) m, joint in its parent's frame.
        turning: joints that turn, and about which axes in which order.
        sliding: joints with three translations.
    """
    roles = joint_roles(names)
    stands = _stands_as_in_the_tables(roles, parents, offsets)
    rows: list[tuple[int, str, bool, tuple[float, float]]] = []  # joint, axis, slides, limits
    for joint, name in enumerate(names):
        role = roles[joint] if stands else UNKNOWN
        if name in sliding:
            rows += [(joint, axis, True, FREE) for axis in "xyz"]
        if name in turning:
            axes = turning[name]
            limits = _limits(role, roles.count(role))
            rows += [(joint, axis, False, limits[axis]) for axis in (_order(roles[joint]) if axes is None else axes)]
    return Skeleton(
        names,
        parents,
        offsets,
        np.array([joint for joint, *_ in rows], np.int64),
        np.array([AXES[axis] for _, axis, *_ in rows]).reshape(-1, 3),
        np.array([slides for *_, slides, _ in rows], np.bool_),
        np.array([limits for *_, limits in rows]).reshape(-1, 2),
        tuple(f"{names[joint]}.{'t' if slides else ''}{axis[-1]}" for joint, axis, slides, _ in rows),
    )


def dofs_from_frames(skeleton: Skeleton, rotations: FloatArray, positions: FloatArray) -> FloatArray:
    """The motion of a skeleton whose joints turn about three axes of `body_skeleton`, or not at all.

    Args:
        skeleton: of `body_skeleton`.
        rotations: (T, J, 3, 3) world_from_joint.
        positions: (T, J, 3) m, world.

    Returns:
        (T, D) rad or m.
    """
    up = skeleton.parents[1:]
    turns, places = rotations.copy(), positions.copy()
    down = np.swapaxes(rotations[:, up], 2, 3)
    turns[:, 1:] = down @ rotations[:, 1:]
    places[:, 1:] = (down @ (positions[:, 1:] - positions[:, up])[..., None])[..., 0]
    return dofs_from_local_frames(skeleton, turns, places)


def dofs_from_local_frames(skeleton: Skeleton, turns: FloatArray, places: FloatArray) -> FloatArray:
    """The same from frames of joints in their parents.

    Args:
        skeleton: of `body_skeleton`; joints with one or two turns are left at 0.
        turns: (T, J, 3, 3) parent_from_joint.
        places: (T, J, 3) m.
    """
    q = np.zeros((len(turns), skeleton.n_dofs))
    for joint in range(skeleton.n_joints):
        mine = np.flatnonzero(skeleton.dof_joint == joint)
        slides, rotating = mine[skeleton.dof_slides[mine]], mine[~skeleton.dof_slides[mine]]
        q[:, slides] = (places[:, joint] - skeleton.offsets[joint]) @ skeleton.dof_axis[slides].T
        if len(rotating) == 3:
            axes = skeleton.dof_axis[rotating]
            order = "".join("xyz"[int(np.argmax(np.abs(axis)))] for axis in axes)
            q[:, rotating] = euler_angles(turns[:, joint], order) * axes.sum(1)
    return q


def euler_angles(rotations: FloatArray, order: str) -> FloatArray:
    """Angles about three different axes whose product is each rotation, continuous from frame to frame.

    Args:
        rotations: (T, 3, 3).
        order: axes in the order in which they turn, R = R1 R2 R3, e.g. "zyx".

    Returns:
        (T, 3) rad.
    """
    angles = _principal(rotations, order)
    for t in range(1, len(angles)):
        angles[t] = nearest_solution(angles[t], angles[t - 1])
    return angles


def nearest_solution(angles: FloatArray, target: FloatArray) -> FloatArray:
    """The Euler angles of the same rotation that are nearest to others: both solutions, and whole turns.

    Args:
        angles: (3,) rad.
        target: (3,) rad.
    """
    near = [_nearest_turn(each, target) for each in (angles, angles * [1.0, -1.0, 1.0] + np.pi)]
    return min(near, key=lambda each: float(np.abs(each - target).sum()))


def _principal(rotations: FloatArray, order: str) -> FloatArray:
    """(T, 3) rad, the middle angle within a quarter turn; at gimbal lock the last angle is 0."""
    i, j, k = ("xyz".index(axis) for axis in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    r = rotations
    middle = np.arctan2(sign * r[:, i, k], np.hypot(r[:, i, i], r[:, i, j]))
    first = np.arctan2(-sign * r[:, j, k], r[:, k, k])
    # the last angle from what the first leaves over: accurate near gimbal lock too
    c, s = np.cos(first), sign * np.sin(first)
    last = np.arctan2(c * sign * r[:, j, i] + s * sign * r[:, k, i], c * r[:, j, j] + s * r[:, k, j])
    return np.stack([first, middle, last], 1)


def _nearest_turn(angles: FloatArray, target: FloatArray) -> FloatArray:
    """The same angles with whole turns added, as near to others as can be."""
    return angles - 2 * np.pi * np.round((angles - target) / (2 * np.pi))


def _order(role: str) -> str:
    """In which order a joint turns."""
    return ROLES[role].order if role in ROLES else DEFAULT_ORDER


def _limits(role: str, count: int) -> dict[str, tuple[float, float]]:
    """Ranges by axis, rad; a shared one divided by the number of joints that have it."""
    if role not in ROLES:
        return dict.fromkeys(AXES, FREE)
    parts = count if ROLES[role].shared else 1
    limits = {axis: (low / parts, high / parts) for axis, (low, high) in ROLES[role].limits.items()}
    return {**limits, **{f"-{axis}": (-high, -low) for axis, (low, high) in limits.items()}}


def _stands_as_in_the_tables(roles: Sequence[str], parents: IntArray, offsets: FloatArray) -> bool:
    """Whether arms point sideways, legs down and the left thigh is on the left, as far as there are any."""
    for joint, role in enumerate(roles):
        up = roles[parents[joint]] if parents[joint] >= 0 else UNKNOWN
        expected = _REST_BONES.get(up) if role == _BELOW.get(up) else None
        length = float(np.linalg.norm(offsets[joint]))
        if expected is not None and offsets[joint] @ expected < _ALIGNED * length:
            return False
    thighs = [offsets[roles.index(f"{side}_thigh")][0] for side in ("left", "right") if f"{side}_thigh" in roles]
    return len(thighs) < 2 or bool(thighs[0] > thighs[1])


_ALIGNED: Final = np.cos(np.radians(35.0))
_REST_BONES: Final = {
    "left_upper_arm": AXES["x"],
    "right_upper_arm": AXES["-x"],
    "left_thigh": AXES["-z"],
    "right_thigh": AXES["-z"],
}
_BELOW: Final = {
    "left_upper_arm": "left_forearm",
    "right_upper_arm": "right_forearm",
    "left_thigh": "left_shin",
    "right_thigh": "right_shin",
}
