"""A frame of its own for each capture, fixed by the meshes, so that no result depends on the capture's world frame."""

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose, invert
from mhvedit.sequences.areas import area_shares
from mhvedit.sequences.meshes import Mesh, MeshSequence


def capture_from_canonical(sequence: MeshSequence) -> FloatArray:
    """Planar pose of the canonical frame in the capture's frame.

    The origin is the area centroid of the first mesh; x runs along the principal axis of its area in plan, towards the
    side with the longer tail.

    Args:
        sequence: at least one frame.

    Returns:
        (3,) x, y m and yaw rad.
    """
    weights, middles = area_shares(sequence.mesh(sequence.numbers[0]))
    middles = middles[:, :2]
    origin = weights @ middles
    offset = middles - origin
    axis = np.linalg.eigh((offset * weights[:, None]).T @ offset)[1][:, 1]
    if weights @ (offset @ axis) ** 3 < 0:
        axis = -axis
    return np.array([origin[0], origin[1], np.arctan2(axis[1], axis[0])])


def in_canonical_frame(mesh: Mesh, pose: FloatArray) -> Mesh:
    """The mesh in its capture's canonical frame.

    Args:
        mesh: in the capture's frame.
        pose: (3,) capture_from_canonical.
    """
    return Mesh(apply_pose(invert(pose), mesh.vertices), mesh.faces, mesh.labels)
