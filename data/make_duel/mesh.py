"""From a blend of shapes to a clean closed mesh, meshed anew in every frame."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import open3d as o3d
from scipy import sparse
from skimage import measure

from .field import field_at, field_on_lattice
from .vectors import Floats, Ints, turn

MARGIN = 0.05  # m


def mesh_of(
    shapes: Floats, *, pitch: float, faces_about: int, seed: tuple[int, ...], noise: float
) -> tuple[Floats, Ints]:
    """The surface of a blend, cut on a lattice that is turned and shifted at random, then thinned where it is flat.

    Args:
        shapes: (S, 20) table for `field`.
        pitch: m, of the lattice.
        faces_about: how many faces to keep, within a fiftieth.
        seed: of this frame; the same seed gives the same mesh.
        noise: m, standard deviation of the surface noise.

    Returns:
        Vertices (V, 3) m and outward faces (F, 3), one closed manifold.
    """
    for attempt in range(8):
        rng = np.random.default_rng((*seed, attempt))
        vertices, faces = _march(shapes, pitch, rng)
        vertices = _even_out(shapes, vertices, faces, rounds=2)
        vertices, faces = _thin(vertices, faces, int(faces_about * rng.uniform(0.98, 1.02)))
        vertices = _even_out(shapes, vertices, faces, rounds=2)
        vertices = vertices + _normals(shapes, vertices) * rng.normal(0.0, noise, (len(vertices), 1))
        vertices[:, 2] = np.maximum(vertices[:, 2], 0.0)
        if is_closed(faces, len(vertices)):
            return vertices, faces
    raise RuntimeError(f"frame {seed}: expected a closed mesh, got none in 8 lattices")


def _march(shapes: Floats, pitch: float, rng: np.random.Generator) -> tuple[Floats, Ints]:
    """Marching cubes on a random lattice round the shapes."""
    rotation = turn(rng.uniform(-np.pi, np.pi), rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3))
    low, high = _bounds(shapes, rotation)
    low = low - rng.uniform(0.0, pitch, 3)
    counts = np.ceil((high - low) / pitch).astype(int) + 1
    shape = (int(counts[0]), int(counts[1]), int(counts[2]))
    values = field_on_lattice(shapes, rotation, rotation @ low, pitch=pitch, counts=shape)
    points, faces, _, _ = measure.marching_cubes(values, 0.0, gradient_direction="ascent")
    vertices = (points.astype(np.float64) * pitch + low) @ rotation.T
    vertices, faces = _largest_piece(vertices, faces.astype(np.int32))
    return vertices, faces if _volume(vertices, faces) > 0 else np.ascontiguousarray(faces[:, ::-1])


def _largest_piece(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Without the crumbs that a lattice leaves of a thin finger."""
    ends = (faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel())
    links = sparse.coo_matrix((np.ones(len(ends[0])), ends), shape=(len(vertices), len(vertices)))
    _, piece = sparse.csgraph.connected_components(links, directed=False)
    kept = piece == np.bincount(piece).argmax()
    number = np.cumsum(kept) - 1
    return vertices[kept], number[faces[kept[faces[:, 0]]]].astype(np.int32)


def _bounds(shapes: Floats, rotation: Floats) -> tuple[Floats, Floats]:
    """A box in the lattice's axes round all shapes."""
    starts, axes = shapes[:, :3], shapes[:, [5, 8, 11]]
    scales = shapes[:, 15:18].max(axis=1)
    reach = (shapes[:, 13:15].max(axis=1) * scales)[:, None] + MARGIN
    ends = starts + axes * shapes[:, 12:13]
    turned = np.concatenate([starts, ends]) @ rotation
    reach = np.concatenate([reach, reach])
    return np.asarray((turned - reach).min(axis=0)), np.asarray((turned + reach).max(axis=0))


def _thin(vertices: Floats, faces: Ints, count: int) -> tuple[Floats, Ints]:
    """Quadric decimation: keeps nose and fingers, spares thighs."""
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(faces))
    thin = mesh.simplify_quadric_decimation(count)
    return np.array(thin.vertices), np.array(thin.triangles, dtype=np.int32)


def _even_out(shapes: Floats, vertices: Floats, faces: Ints, *, rounds: int) -> Floats:
    """Slides the vertices along the surface until the triangles are even."""
    average = _neighbour_average(faces, len(vertices))
    for _ in range(rounds):
        normals = _normals(shapes, vertices)
        step = average @ vertices - vertices
        step -= normals * np.sum(step * normals, axis=1, keepdims=True)
        vertices = vertices + 0.5 * step
        vertices = vertices - normals * np.clip(field_at(shapes, vertices), -0.004, 0.004)[:, None]
    return vertices


def _neighbour_average(faces: Ints, count: int) -> sparse.csr_matrix:
    """Sparse (V, V) matrix that takes the mean of each vertex's neighbours."""
    i, j = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
    links = sparse.coo_matrix((np.ones(len(i)), (i, j)), shape=(count, count)).tocsr()
    return sparse.csr_matrix(sparse.diags(1.0 / np.maximum(np.asarray(links.sum(axis=1)).ravel(), 1.0)) @ links)


def _normals(shapes: Floats, points: Floats) -> Floats:
    """Unit gradients (N, 3) of the field."""
    step = 1e-3
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=np.float64)
    gradient = sum(np.outer(field_at(shapes, points + step * c), c) for c in corners)
    return np.asarray(gradient / np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-9))


def _volume(vertices: Floats, faces: Ints) -> float:
    """Signed volume, m^3."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def is_closed(faces: npt.NDArray[np.int32], count: int) -> bool:
    """Whether every edge joins exactly two faces, oppositely oriented, and the surface is in one piece."""
    edges = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    forward = np.sort(edges[:, 0] * count + edges[:, 1])
    backward = np.sort(edges[:, 1] * count + edges[:, 0])
    links = sparse.coo_matrix((np.ones(len(edges)), edges.T), shape=(count, count))
    pieces, _ = sparse.csgraph.connected_components(links, directed=False)
    return bool((np.diff(forward) > 0).all() and (forward == backward).all() and pieces == 1)
