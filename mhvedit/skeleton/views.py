"""One tree, three views of it: 23 limbs, the thesis's 55 degrees of freedom, and five chains (D1)."""

from collections.abc import Mapping

import numpy as np

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import IntArray
from mhvedit.skeleton.denavit import dh_skeleton
from mhvedit.skeleton.model import Skeleton
from mhvedit.skeleton.roles import UNKNOWN, joint_roles


def limb_joints(skeleton: Skeleton) -> IntArray:
    """Joints that are limbs of a body, in the order of the skeleton; 23 for a whole one."""
    return np.flatnonzero([role != UNKNOWN for role in joint_roles(skeleton.names)])


def five_chains(skeleton: Skeleton) -> Mapping[str, IntArray]:
    """Joints of torso with head, and of each arm and leg; joints without a role are with the joint above them."""
    roles, groups = joint_roles(skeleton.names), list[str]()
    for joint, role in enumerate(roles):
        up = groups[skeleton.parents[joint]] if joint else "torso"
        groups.append(up if role == UNKNOWN else _group(role))
    return {name: np.flatnonzero([g == name for g in groups]) for name in ("torso", *_SIDED)}


def thesis_dofs(skeleton: Skeleton) -> IntArray:
    """(55,) which DOF of a body is which of the thesis, in the order of its files; others count as still.

    Raises:
        ShapeError: the skeleton lacks one.
    """
    wanted = dh_skeleton()
    mine, theirs = _keys(skeleton), _keys(wanted)
    missing = [wanted.dof_names[i] for i, key in enumerate(theirs) if key not in mine]
    if missing:
        raise ShapeError("skeleton", f"no {', '.join(missing)}", "all 55 DOFs of the thesis")
    return np.array([mine.index(key) for key in theirs])


_SIDED = ("left_arm", "right_arm", "left_leg", "right_leg")
_ARM = ("clavicle", "upper_arm", "forearm", "hand")


def _group(role: str) -> str:
    """The chain of a role."""
    side, _, part = role.partition("_")
    if side not in ("left", "right"):
        return "torso"
    return f"{side}_{'arm' if part in _ARM else 'leg'}"


def _keys(skeleton: Skeleton) -> list[tuple[str, int, str]]:
    """Role, which of its joints, and kind and axis of each DOF."""
    roles = joint_roles(skeleton.names)
    keys = []
    for joint, axis, slides in zip(skeleton.dof_joint, skeleton.dof_axis, skeleton.dof_slides, strict=True):
        nth = roles[:joint].count(roles[joint])
        keys.append((roles[joint], nth, f"{'t' if slides else ''}{'xyz'[int(np.argmax(np.abs(axis)))]}"))
    return keys
