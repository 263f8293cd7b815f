"""Equipment that hangs on a limb: it becomes part of the limb's mesh (Degenhardt, 3.3.2)."""

import numpy as np

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.skeleton.model import joint_index
from mhvedit.skeleton.skin import SkinnedBody


def attach(body: SkinnedBody, vertices: FloatArray, faces: Int32Array, *, limb: str) -> SkinnedBody:
    """The body with a mesh that moves rigidly with one of its joints.

    Args:
        body: skinned.
        vertices: (V, 3) m, of the equipment where the body is at rest.
        faces: (F, 3) closed; turned outwards where it is inside out.
        limb: joint that it hangs on.

    Raises:
        ShapeError: no such joint, or the mesh is not closed.
    """
    joint = joint_index(body.skeleton, limb)
    n_open = open_edges(faces)
    if n_open:
        raise ShapeError(f"equipment on {limb}", f"{n_open} open edges", "a closed mesh")
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    outwards = faces if float((np.cross(a, b) * c).sum()) > 0 else faces[:, ::-1]
    weights = np.zeros((len(vertices), body.skeleton.n_joints))
    weights[:, joint] = 1.0
    return SkinnedBody(
        body.skeleton,
        np.concatenate([body.vertices, vertices]),
        np.concatenate([body.faces, outwards + len(body.vertices)]).astype(np.int32),
        np.concatenate([body.weights, weights]),
    )


def open_edges(faces: Int32Array) -> int:
    """How many edges do not have one triangle on either side."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    there, ways = np.unique(edges, axis=0, return_counts=True)
    back = {(int(i), int(j)): int(n) for (i, j), n in zip(there, ways, strict=True)}
    return sum(back.get((j, i), 0) != n for (i, j), n in back.items())
