"""Small skinned bodies whose collisions are known in closed form."""

import numpy as np
import trimesh

from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.model import Skeleton
from mhvedit.skeleton.skin import SkinnedBody


def boxes_on_sliders(sizes: FloatArray, places: FloatArray, *, cuts: int = 0) -> SkinnedBody:
    """Boxes that are limbs of their own: each hangs from the root by a joint that slides and turns about x, y, z.

    Args:
        sizes: (L, 3) m.
        places: (L, 3) m, centres where q = 0.
        cuts: how often each face is cut into four.
    """
    meshes = [trimesh.creation.box(extents) for extents in sizes]
    for _ in range(cuts):
        meshes = [mesh.subdivide() for mesh in meshes]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices + place for mesh, place in zip(meshes, places, strict=True)])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts[:-1], strict=True)])
    weights = np.zeros((len(vertices), len(sizes) + 1))
    for limb in range(len(sizes)):
        weights[starts[limb] : starts[limb + 1], limb + 1] = 1.0
    n = len(sizes)
    skeleton = Skeleton(
        ("root", *(f"box{i}" for i in range(n))),
        np.array([-1, *([0] * n)]),
        np.concatenate([np.zeros((1, 3)), places]),
        np.repeat(np.arange(1, n + 1), 6),
        np.tile(np.concatenate([np.eye(3), np.eye(3)]), (n, 1)),
        np.tile([True, True, True, False, False, False], n),
        np.tile([-np.inf, np.inf], (6 * n, 1)),
        tuple(f"box{i}.{name}" for i in range(n) for name in ("tx", "ty", "tz", "x", "y", "z")),
    )
    return SkinnedBody(skeleton, np.asarray(vertices, np.float64), faces.astype(np.int32), weights)
