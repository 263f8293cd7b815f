"""A motion on a body of other proportions (collision-free editing, 7): joint angles stay, collisions are edited."""

from collections.abc import Mapping

import numpy as np

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.model import Motion, Skeleton
from mhvedit.skeleton.skin import SkinnedBody


def retargeted(motion: Motion, source: Skeleton, target: Skeleton) -> Motion:
    """The captured joint angles on another skeleton; the root goes as far as the longer or shorter legs carry it.

    Args:
        motion: of the source.
        source: performer's skeleton.
        target: skeleton with the same joints, by name; what only one of the two can turn stays at 0.

    Raises:
        ShapeError: a joint of the source moves and the target has none of that name; the message lists those it has.
    """
    here, there = shared_dofs(source, target)
    q = np.zeros((motion.n_frames, target.n_dofs))
    q[:, there] = motion.q[:, here]
    scale = stature(target) / stature(source)
    places, root = joint_frames(source, motion.q)[1][:, 0], target.offsets[0]
    slides = [d for d in np.flatnonzero(target.dof_slides) if target.dof_joint[d] == 0]
    q[:, slides] = (places * scale - root) @ target.dof_axis[slides].T
    return Motion(q, motion.fps)


def shared_dofs(source: Skeleton, target: Skeleton) -> tuple[IntArray, IntArray]:
    """DOFs of the source that the target has too, by name, and which those are there.

    Raises:
        ShapeError: the source moves a joint that the target does not have.
    """
    moving = {source.names[joint] for joint in source.dof_joint}
    unknown = [name for name in source.names if name in moving and name not in target.names]
    if unknown:
        raise ShapeError("joints of the motion", ", ".join(unknown), "some of " + ", ".join(target.names))
    here = [d for d, name in enumerate(source.dof_names) if name in target.dof_names]
    there = [target.dof_names.index(source.dof_names[d]) for d in here]
    return np.array(here, np.int64), np.array(there, np.int64)


def stature(skeleton: Skeleton) -> float:
    """How high the root is above the lowest joint where q = 0, m: the length of the legs."""
    heights = skeleton.rest_positions[:, 2]
    return max(float(heights[0] - heights.min()), 1e-9)


def with_proportions(body: SkinnedBody, factors: Mapping[str, float]) -> SkinnedBody:
    """The body with bones of other lengths: the skin goes where the joints that carry it go.

    Args:
        body: skinned.
        factors: by joint, of the bone that leads to it.

    Raises:
        ShapeError: no such joint, or a factor that is not positive.
    """
    skeleton = body.skeleton
    unknown = [name for name in factors if name not in skeleton.names]
    if unknown:
        raise ShapeError("joint", ", ".join(unknown), "one of " + ", ".join(skeleton.names))
    if not all(factor > 0 for factor in factors.values()):
        raise ShapeError("factors", dict(factors), "positive numbers")
    scale = np.array([factors.get(name, 1.0) for name in skeleton.names])
    other = Skeleton(
        skeleton.names,
        skeleton.parents,
        skeleton.offsets * scale[:, None],
        skeleton.dof_joint,
        skeleton.dof_axis,
        skeleton.dof_slides,
        skeleton.limits,
        skeleton.dof_names,
    )
    moved = other.rest_positions - skeleton.rest_positions
    return SkinnedBody(other, body.vertices + body.weights @ moved, body.faces, body.weights)


def likeness(captured: Motion, edited: Motion) -> FloatArray:
    """(3,) root mean square differences of pose (rad), velocity (rad/s) and acceleration (rad/s^2)."""
    change = edited.q - captured.q
    out = []
    for order in range(3):
        rate = np.diff(change, order, axis=0) * captured.fps**order
        out.append(float(np.sqrt((rate**2).mean())) if len(rate) else 0.0)
    return np.array(out)
