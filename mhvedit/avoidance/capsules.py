"""A body of capsules round the bones, for motions that come without one."""

from typing import Final

import numpy as np
import trimesh

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.model import Skeleton
from mhvedit.skeleton.roles import joint_roles
from mhvedit.skeleton.skin import SkinnedBody

# m, half the widths of limbs of a person whose legs are 0.9 m long; ours, measured on the bodies of our tests
RADII: Final = {
    "pelvis": 0.11,
    "spine": 0.11,
    "neck": 0.05,
    "head": 0.09,
    "clavicle": 0.05,
    "upper_arm": 0.045,
    "forearm": 0.038,
    "hand": 0.035,
    "thigh": 0.075,
    "shin": 0.052,
    "foot": 0.042,
    "toe": 0.035,
}
UNKNOWN: Final = 0.03  # m
LEGS: Final = 0.9  # m
SIDES: Final = (12, 8)  # triangles round a capsule
SHORT: Final = 1e-4  # m


def capsule_body(skeleton: Skeleton) -> SkinnedBody:
    """A capsule from each joint to each of its children, as wide as that limb usually is.

    Args:
        skeleton: with z up where q = 0.

    Raises:
        ShapeError: fewer than two bones have a length.
    """
    at, roles = skeleton.rest_positions, joint_roles(skeleton.names)
    scale = max(float(at[:, 2].max() - at[:, 2].min()), 0.1) / (2 * LEGS)
    vertices, faces, owner = list[FloatArray](), list[FloatArray](), list[int]()
    for child in range(1, skeleton.n_joints):
        joint = int(skeleton.parents[child])
        if np.linalg.norm(at[child] - at[joint]) < SHORT:
            continue
        role = roles[joint].removeprefix("left_").removeprefix("right_")
        mesh = _capsule(at[joint], at[child], scale * RADII.get(role, UNKNOWN))
        faces.append(mesh.faces + sum(len(part) for part in vertices))
        vertices.append(mesh.vertices)
        owner += [joint] * len(mesh.vertices)
    if len(set(owner)) < 2:
        raise ShapeError("skeleton", f"{len(set(owner))} bones with a length", "at least 2")
    weights = np.zeros((len(owner), skeleton.n_joints))
    weights[np.arange(len(owner)), owner] = 1.0
    return SkinnedBody(skeleton, np.concatenate(vertices), np.concatenate(faces).astype(np.int32), weights)


def _capsule(first: FloatArray, last: FloatArray, radius: float) -> trimesh.Trimesh:
    """A closed capsule between two points."""
    along = last - first
    length = float(np.linalg.norm(along))
    mesh = trimesh.creation.capsule(height=length, radius=min(radius, 0.5 * length + 0.01), count=SIDES)
    turn = trimesh.geometry.align_vectors([0.0, 0.0, 1.0], along / length)
    turn[:3, 3] = (first + last) / 2  # the capsule is centred
    return mesh.apply_transform(turn)
