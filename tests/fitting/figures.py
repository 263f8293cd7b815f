"""A person made of a few hundred rings of skin round known bones, in any posture: the truth that fits are judged by."""

import numpy as np
import trimesh

from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.body_fit import BodyPose, joint_places
from mhvedit.sequences.body_model import (
    LEFT_ELBOW,
    LEFT_HIP,
    LEFT_KNEE,
    LEFT_SHOULDER,
    RIGHT_ELBOW,
    RIGHT_SHOULDER,
    plain_adult,
    rotation_from_vector,
)
from mhvedit.sequences.meshes import Mesh, MeshSequence
from tests.shapes import mesh_of

MODEL = plain_adult()


def pose(t: float) -> BodyPose:
    """Arms and one leg swing; t goes from 0 to 1."""
    swing = np.sin(2 * np.pi * t)
    bend = {
        LEFT_SHOULDER: (0.6, -0.9 * swing, 0.0),
        RIGHT_SHOULDER: (-0.6, 0.9 * swing, 0.0),
        LEFT_ELBOW: (0.0, -0.5 - 0.4 * swing, 0.0),
        RIGHT_ELBOW: (0.0, -0.5 + 0.4 * swing, 0.0),
        LEFT_HIP: (0.15, -0.5 * swing, 0.0),
        LEFT_KNEE: (0.0, 0.5 + 0.4 * swing, 0.0),
    }
    rotations = np.tile(np.eye(3), (len(MODEL.parents), 1, 1))
    for joint in range(1, len(MODEL.parents)):
        own = rotation_from_vector(np.array(bend.get(joint, (0.0, 0.0, 0.0))))
        rotations[joint] = rotations[MODEL.parents[joint]] @ own
    return BodyPose(rotations, np.array([0.1 * t, 0.0, 0.95]), np.zeros(2))


def surface(at: BodyPose, *, pitch: float = 0.022) -> Mesh:
    """The union of the round cones of a posture, as one closed surface."""
    places = joint_places(MODEL, at)
    ends = places[MODEL.cone_joint][:, None] + np.einsum(
        "cij,cej->cei", at.rotations[MODEL.cone_joint], MODEL.cone_ends
    )
    low, high = ends.min((0, 1)) - 0.2, ends.max((0, 1)) + 0.2
    axes = [np.arange(a, b, pitch) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    inside = np.full(grid.shape[:-1], np.inf)
    for (start, end), (r0, r1) in zip(ends, MODEL.cone_radii, strict=True):
        bone = end - start
        along = ((grid - start) @ bone / max(float(bone @ bone), 1e-12)).clip(0.0, 1.0)
        far = np.linalg.norm(grid - start - along[..., None] * bone, axis=-1)
        inside = np.minimum(inside, far - r0 - along * (r1 - r0))
    return _contour(-inside, low, pitch)


def _contour(values: FloatArray, low: FloatArray, pitch: float) -> Mesh:
    from skimage.measure import marching_cubes

    vertices, faces, _, _ = marching_cubes(values, 0.0)
    made = trimesh.Trimesh(vertices * pitch + low, faces[:, ::-1])
    return mesh_of(made)


def walking(n_frames: int) -> tuple[MeshSequence, FloatArray]:
    """The figure in motion, and where its joints are, (T, 14, 3) m."""
    poses = [pose(t) for t in np.arange(n_frames) / n_frames]
    meshes = [surface(each) for each in poses]
    places = np.array([joint_places(MODEL, each) for each in poses])
    return MeshSequence("figure", tuple(range(n_frames)), 25.0, lambda number: meshes[number]), places
