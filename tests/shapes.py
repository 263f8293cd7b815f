"""Meshes of trimesh as this package takes them."""

import numpy as np
import trimesh

from mhvedit.sequences.meshes import Mesh


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    """A shape as a mesh of a capture."""
    return Mesh(np.asarray(shape.vertices, np.float64), np.asarray(shape.faces, np.int32))


def boxes(*parts: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Mesh:
    """Boxes of centres and sizes, m, cut as finely as captures are."""
    made = []
    for centre, size in parts:
        box = trimesh.creation.box(extents=size).subdivide_to_size(0.04)
        box.apply_translation(centre)
        made.append(box)
    return mesh_of(trimesh.util.concatenate(made))
