"""How sound one mesh is: open edges, flipped and degenerate faces, duplicates, floating bits."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.meshes import Mesh
from mhvedit.sequences.raw import same_places

FLAT = 1e-12  # m^2, a face smaller than a micrometre square is degenerate
LISTED = 5  # floating bits that are described one by one


@dataclass(frozen=True, slots=True)
class FrameQuality:
    """What one frame's mesh is like. Vertices at exactly the same place count as one for everything about edges."""

    number: int  # frame
    vertices: int
    faces: int
    low: tuple[float, float, float]  # m
    high: tuple[float, float, float]  # m
    open_edges: int  # edges with one face
    crowded_edges: int  # edges with more than two faces (non-manifold)
    flipped_edges: int  # edges whose two faces are wound against each other
    degenerate_faces: int  # without area, or with a corner twice
    duplicate_vertices: int  # at a place that an earlier vertex has
    loose_vertices: int  # in no face
    inside_out: bool  # encloses a negative volume
    pieces: int  # connected surfaces
    bits: tuple[tuple[int, float], ...]  # the largest of the others than the main one: faces, longest side in m

    @property
    def watertight(self) -> bool:
        """Whether every edge has two faces that agree on the side that is out."""
        return not (self.open_edges or self.crowded_edges or self.flipped_edges)


def measure_mesh(mesh: Mesh, number: int) -> FrameQuality:
    """Count what is wrong with a mesh.

    Args:
        mesh: one frame, m.
        number: its frame number.
    """
    first, place = same_places(mesh.vertices)
    points, faces = mesh.vertices[first], place[mesh.faces]
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    distinct = (faces != np.roll(faces, 1, axis=1)).all(1)
    flat = ~distinct | (np.linalg.norm(normals, axis=1) < 2 * FLAT)
    edges = _count_edges(faces[distinct], len(points))
    pieces, bits = _pieces(faces, points)
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces] = True
    volume = np.einsum("fi,fi->", corners[:, 0] - points.mean(0), normals) / 6
    return FrameQuality(
        number,
        len(mesh.vertices),
        len(mesh.faces),
        _triple(mesh.vertices.min(0)),
        _triple(mesh.vertices.max(0)),
        *edges,
        int(flat.sum()),
        len(mesh.vertices) - len(first),
        int((~used).sum()),
        bool(volume < 0),
        pieces,
        bits,
    )


def _triple(point: FloatArray) -> tuple[float, float, float]:
    """A point as plain numbers."""
    return float(point[0]), float(point[1]), float(point[2])


def _count_edges(faces: IntArray, n_points: int) -> tuple[int, int, int]:
    """Edges with one face, with more than two, and with two that run along them in the same direction."""
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    key = np.minimum(start, end) * n_points + np.maximum(start, end)
    order = np.argsort(key)
    key, sign = key[order], np.where(start < end, 1, -1)[order]
    begins = np.flatnonzero(np.diff(key, prepend=-1))
    if not len(begins):
        return 0, 0, 0
    count, net = np.diff(begins, append=len(key)), np.add.reduceat(sign, begins)
    return int((count == 1).sum()), int((count > 2).sum()), int(((count == 2) & (net != 0)).sum())


def _pieces(faces: IntArray, points: FloatArray) -> tuple[int, tuple[tuple[int, float], ...]]:
    """How many connected surfaces there are, and faces and longest side of the largest bits beside the main one."""
    ends = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(ends), bool), (ends[:, 0], ends[:, 1])), shape=(len(points), len(points)))
    _, label = connected_components(graph, directed=False)
    of_face = label[faces[:, 0]]
    sizes = np.bincount(of_face)
    largest = np.argsort(-sizes, kind="stable")[: int((sizes > 0).sum())]
    bits = []
    for piece in largest[1 : LISTED + 1]:
        own = points[faces[of_face == piece]].reshape(-1, 3)
        bits.append((int(sizes[piece]), round(float((own.max(0) - own.min(0)).max()), 4)))
    return len(largest), tuple(bits)
