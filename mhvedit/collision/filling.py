"""Equipment as spheres: a given number that fits best, or an octree (Degenhardt, 3.3.2; B4).

All meshes of a piece of equipment are wrapped in one convex envelope that is filled, so that no limb passes through
a ring between two frames; or each mesh is filled by itself. The octree is that of O'Sullivan and Dingliana.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from scipy.spatial import ConvexHull, QhullError
from scipy.stats.qmc import Halton

from mhvedit.collision.spheres import Spheres
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array
from mhvedit.geometry.winding import winding_numbers
from mhvedit.sequences.meshes import Mesh

SAMPLES: Final = 4000  # points inside that stand for a volume
ROUNDS: Final = 200  # of Lloyd's iteration at most
SETTLED: Final = 1e-5  # m: centres that move less do not move
LEVELS: Final = (1, 4)  # of the octree


@dataclass(frozen=True, slots=True, eq=False)
class Filling:
    """Spheres that stand for a solid."""

    centres: FloatArray  # (S, 3) m
    radii: FloatArray  # (S,) m


@dataclass(frozen=True, slots=True)
class FillingQuality:
    """How well they do (B4.5)."""

    coverage: float  # share of the envelope's volume within some sphere
    protrusion: float  # m, how far a sphere reaches out of the envelope at most
    count: int


def convex_envelope(meshes: Sequence[Mesh]) -> Mesh:
    """The convex hull of all meshes together, the cocoon (B4.3).

    Raises:
        ShapeError: they lie in a plane.
    """
    points = np.concatenate([mesh.vertices for mesh in meshes])
    try:
        hull = ConvexHull(points)
    except QhullError as error:
        raise ShapeError("equipment", f"{len(points)} vertices without volume", "a solid") from error
    index = np.full(len(points), -1)
    index[hull.vertices] = np.arange(len(hull.vertices))
    faces, corners = index[hull.simplices], points[hull.vertices]
    normals = np.cross(corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]])
    inward = (normals * hull.equations[:, :3]).sum(1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(corners, faces.astype(np.int32))


def filled_with_spheres(solid: Mesh, count: int, *, cover: float = 1.0) -> Filling:
    """The best fit of so many spheres (B4.2): centres by Lloyd's iteration, each with the radius of its share.

    Args:
        solid: closed.
        count: how many.
        cover: share of each cell that its sphere has to contain; less than 1 protrudes less.

    Raises:
        ShapeError: `count` is less than 1, or the mesh is not closed.
    """
    if count < 1:
        raise ShapeError("count", count, "at least 1 sphere")
    check_closed(solid)
    points = _inside_points(solid)
    centres = points[_spread_out(points, count)]
    for _ in range(ROUNDS):
        before, cell = centres, _nearest(points, centres)
        centres = np.stack([points[cell == k].mean(0) if (cell == k).any() else before[k] for k in range(len(before))])
        if np.abs(centres - before).max() < SETTLED:
            break
    ends = np.concatenate([points, solid.vertices])
    cell = _nearest(ends, centres)
    far = np.linalg.norm(ends - centres[cell], axis=1)
    radii = [float(np.quantile(far[cell == k], cover)) if (cell == k).any() else 0.0 for k in range(len(centres))]
    kept = np.array(radii) > 0
    return Filling(centres[kept], np.array(radii)[kept])


def filled_one_by_one(meshes: Sequence[Mesh], count: int) -> Filling:
    """Each mesh filled by itself, with its share of the spheres by volume and at least one (B4.3).

    Raises:
        ShapeError: a mesh is not closed.
    """
    volumes = np.array([abs(_volume(mesh)) for mesh in meshes])
    counts = np.maximum(1, np.round(count * volumes / volumes.sum()).astype(int))
    parts = [filled_with_spheres(mesh, int(n)) for mesh, n in zip(meshes, counts, strict=True)]
    return Filling(np.concatenate([p.centres for p in parts]), np.concatenate([p.radii for p in parts]))


def octree_spheres(solid: Mesh, levels: int) -> Filling:
    """Spheres round the cubes of an octree that contain some of a solid (B4.4).

    The smallest cube round the solid is cut into octants as often as there are levels; what is left out has no part
    of the solid. A cube of side s gets the sphere round it, s sqrt(3) / 2.

    Args:
        solid: closed.
        levels: 1 to 4.

    Raises:
        ShapeError: another number of levels, or the mesh is not closed.
    """
    if not LEVELS[0] <= levels <= LEVELS[1]:
        raise ShapeError("levels", levels, f"{LEVELS[0]} to {LEVELS[1]}")
    check_closed(solid)
    low, high = solid.vertices.min(0), solid.vertices.max(0)
    side, cubes = float((high - low).max()), ((low + high) / 2)[None]
    octants = np.stack(np.meshgrid(*[[-0.25, 0.25]] * 3, indexing="ij"), -1).reshape(8, 3)
    corners = np.ascontiguousarray(solid.vertices[solid.faces])
    for _ in range(levels):
        cubes = (cubes[:, None] + side * octants).reshape(-1, 3)
        side /= 2
        crossed = np.zeros(len(cubes), np.bool_)
        _cubes_crossed(cubes, side / 2, corners, crossed)
        inside = winding_numbers(solid.vertices, solid.faces, cubes) > 0.5
        cubes = cubes[crossed | inside]
    return Filling(cubes, np.full(len(cubes), side * np.sqrt(3.0) / 2.0))


def quality(filling: Filling, envelope: Mesh) -> FillingQuality:
    """Coverage of a convex envelope, protrusion out of it, and the number of spheres (B4.5)."""
    points = _inside_points(envelope)
    covered = np.zeros(len(points), np.bool_)
    for centre, radius in zip(filling.centres, filling.radii, strict=True):
        covered |= ((points - centre) ** 2).sum(1) <= radius**2 * (1 + 1e-9)
    a, b, c = (envelope.vertices[envelope.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    below = ((a[None] - filling.centres[:, None]) * normals).sum(2).min(1)  # depth of each centre
    out = float(np.maximum(filling.radii - below, 0.0).max())
    return FillingQuality(float(covered.mean()), out, len(filling.radii))


def as_spheres(filling: Filling, name: str, joint: int, joint_position: FloatArray, group: int) -> Spheres:
    """Equipment that moves with a limb and belongs to its group (B4.1).

    Args:
        filling: in the rest posture, world.
        name: of the equipment; the spheres are numbered.
        joint: that carries it.
        joint_position: (3,) m of that joint at rest.
        group: of that limb.
    """
    n = len(filling.radii)
    return Spheres(
        tuple(f"{name}_{i + 1}" for i in range(n)),
        np.full(n, joint),
        filling.centres - joint_position,
        filling.radii,
        np.full(n, group),
    )


def check_closed(mesh: Mesh) -> None:
    """Refuse a surface that has no inside.

    Raises:
        ShapeError: with the number of open edges.
    """
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    forth, back = {tuple(e) for e in edges.tolist()}, {tuple(e) for e in edges[:, ::-1].tolist()}
    if forth != back:
        raise ShapeError("equipment", f"{len(forth - back)} open edges", "a watertight mesh, or its convex envelope")


def _inside_points(solid: Mesh) -> FloatArray:
    """About SAMPLES points that are evenly spread in a solid (Halton's sequence, always the same)."""
    low, high = solid.vertices.min(0), solid.vertices.max(0)
    share = abs(_volume(solid)) / max(float(np.prod(high - low)), 1e-12)
    drawn = low + (high - low) * Halton(3, scramble=False).random(int(SAMPLES / max(share, 0.02)))
    points = drawn[np.abs(winding_numbers(solid.vertices, solid.faces, drawn)) > 0.5]
    return np.asarray(points if len(points) else solid.vertices.mean(0)[None])


def _spread_out(points: FloatArray, count: int) -> list[int]:
    """Points far from each other: each next is the farthest from those before."""
    chosen = [int(np.argmin(np.linalg.norm(points - points.mean(0), axis=1)))]
    far = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(far.argmax()))
        far = np.minimum(far, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return chosen


def _nearest(points: FloatArray, centres: FloatArray) -> Int32Array:
    """(N,) which centre is nearest."""
    return np.asarray(np.linalg.norm(points[:, None] - centres, axis=2).argmin(1), np.int32)


def _volume(mesh: Mesh) -> float:
    """Signed, m^3."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float((np.cross(a, b) * c).sum() / 6.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _cubes_crossed(centres: FloatArray, half: float, corners: FloatArray, out: BoolArray) -> None:
    """Which cubes a surface crosses."""
    for i in range(centres.shape[0]):
        for f in range(corners.shape[0]):
            if not out[i] and _meets_cube(centres[i], half, corners[f]):
                out[i] = True


@njit(cache=True, nogil=True, error_model="numpy")
def _meets_cube(centre: FloatArray, half: float, corners: FloatArray) -> bool:
    """Whether a triangle and a cube meet, by 13 separating axes (Akenine-Moeller 2001)."""
    p = corners - centre
    for axis in range(3):
        if min(p[0, axis], p[1, axis], p[2, axis]) > half or max(p[0, axis], p[1, axis], p[2, axis]) < -half:
            return False
    for e in range(3):
        x, y, z = p[(e + 1) % 3, 0] - p[e, 0], p[(e + 1) % 3, 1] - p[e, 1], p[(e + 1) % 3, 2] - p[e, 2]
        if _separates(p, half, 0.0, -z, y) or _separates(p, half, z, 0.0, -x) or _separates(p, half, -y, x, 0.0):
            return False
    u, v = p[1] - p[0], p[2] - p[0]
    x, y, z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    return not bool(_separates(p, half, x, y, z))


@njit(cache=True, nogil=True, error_model="numpy")
def _separates(p: FloatArray, half: float, x: float, y: float, z: float) -> bool:
    """Whether an axis separates a triangle from the cube round the origin."""
    a = p[0, 0] * x + p[0, 1] * y + p[0, 2] * z
    b = p[1, 0] * x + p[1, 1] * y + p[1, 2] * z
    c = p[2, 0] * x + p[2, 1] * y + p[2, 2] * z
    reach = half * (abs(x) + abs(y) + abs(z))
    return bool(min(a, b, c) > reach or max(a, b, c) < -reach)
