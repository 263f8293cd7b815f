"""Convex pieces, of which everything in a world is made: spheres, capsules and hulls.

A piece is all that lies within a radius of the hull of its points: one point is a sphere, two are a capsule, four or
more a solid of radius 0.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import trimesh

from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.world.problems import WorldError

NO_FACES: Final = np.zeros((0, 3), np.int32)
SIDES: Final = 1  # subdivisions of an icosahedron: 42 points, 80 triangles, about the paper's hundred


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """One convex piece in the frame of what carries it."""

    points: FloatArray  # (N, 3) m: 1 for a sphere, 2 for a capsule, else the corners of a hull
    radius: float  # m round the points; 0 for a hull
    faces: Int32Array  # (F, 3) of a hull, seen anticlockwise from outside; none for the others

    def __post_init__(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 3 or len(self.points) in (0, 3):
            raise WorldError("piece", "1, 2 or at least 4 points", f"{self.points.shape}")
        if not np.isfinite(self.points).all():
            raise WorldError("piece", "finite coordinates", "NaN or infinity")
        if (self.radius > 0) == self.is_hull or not np.isfinite(self.radius):
            raise WorldError("piece", "a positive radius for 1 or 2 points, 0 for a hull", self.radius)

    @property
    def is_hull(self) -> bool:
        """Whether it is a hull of radius 0."""
        return len(self.points) > 2


@dataclass(frozen=True, slots=True, eq=False)
class MassProperties:
    """Volume, centre of mass and inertia at density 1."""

    volume: float  # m3
    centre: FloatArray  # (3,) m
    inertia: FloatArray  # (3, 3) m5, about the centre


def sphere(radius: float, centre: FloatArray | None = None) -> Piece:
    """A sphere, at the origin by default."""
    return Piece(np.zeros((1, 3)) if centre is None else np.array(centre, np.float64)[None], radius, NO_FACES)


def capsule(first: FloatArray, last: FloatArray, radius: float) -> Piece:
    """What is within a radius of the way between two points; a sphere where they are one."""
    ends = np.array([first, last], np.float64)
    if np.linalg.norm(ends[1] - ends[0]) < 1e-6:
        return sphere(radius, ends[0])
    return Piece(ends, radius, NO_FACES)


def box(low: FloatArray, high: FloatArray) -> Piece:
    """A box along the axes."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    if not (high > low).all():
        raise WorldError("box", "a low corner below the high one", f"{low.tolist()} and {high.tolist()}")
    return hull(np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (high - low) + low)


def ellipsoid(centre: FloatArray, axes: FloatArray) -> Piece:
    """An ellipsoid of 80 triangles.

    Args:
        centre: (3,) m.
        axes: (3, 3) m, half axes in rows.
    """
    ball = trimesh.creation.icosphere(subdivisions=SIDES)
    return hull(np.asarray(ball.vertices) @ axes + centre)


def hull(points: FloatArray) -> Piece:
    """The convex hull of points.

    Raises:
        WorldError: they span no volume.
    """
    points = np.asarray(points, np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise WorldError("hull", "(N, 3) finite points", f"{points.shape}")
    try:
        found = trimesh.convex.convex_hull(points)
    except Exception as error:  # qhull's own errors
        raise WorldError("hull", "points that span a volume", f"{len(points)} points that do not") from error
    return Piece(np.array(found.vertices, np.float64), 0.0, np.array(found.faces, np.int32))


def surface(piece: Piece) -> tuple[FloatArray, Int32Array]:
    """Vertices (V, 3) m and faces (F, 3) of a piece, for pictures and files."""
    if piece.is_hull:
        return piece.points, piece.faces
    if len(piece.points) == 1:
        ball = trimesh.creation.icosphere(subdivisions=3, radius=piece.radius)
        return np.asarray(ball.vertices) + piece.points[0], np.asarray(ball.faces, np.int32)
    along = piece.points[1] - piece.points[0]
    length = float(np.linalg.norm(along))
    mesh = trimesh.creation.capsule(height=length, radius=piece.radius, count=(16, 12))
    turn = trimesh.geometry.align_vectors([0.0, 0.0, 1.0], along / length)[:3, :3]
    return np.asarray(mesh.vertices) @ turn.T + piece.points.mean(0), np.asarray(mesh.faces, np.int32)


def mass_properties(piece: Piece) -> MassProperties:
    """Of one piece; exact for spheres, capsules and hulls."""
    if piece.is_hull:
        return mesh_mass(piece.points, piece.faces)
    r, centre = piece.radius, piece.points.mean(0)
    ball = 4.0 / 3.0 * np.pi * r**3
    if len(piece.points) == 1:
        return MassProperties(ball, centre, np.eye(3) * 0.4 * ball * r**2)
    along = piece.points[1] - piece.points[0]
    length = float(np.linalg.norm(along))
    rod, n = np.pi * r**2 * length, along / length
    axial = rod * r**2 / 2 + ball * 0.4 * r**2
    # each half ball has its centre of mass 3/8 r beyond its end
    across = rod * (length**2 / 12 + r**2 / 4) + ball * (0.4 * r**2 + length**2 / 4 + 3 * length * r / 8)
    return MassProperties(rod + ball, centre, axial * np.outer(n, n) + across * (np.eye(3) - np.outer(n, n)))


def mesh_mass(vertices: FloatArray, faces: Int32Array) -> MassProperties:
    """Of what a closed mesh encloses: sums over tetrahedra from the middle to each triangle (exact)."""
    middle = vertices.mean(0)
    a, b, c = np.moveaxis((vertices - middle)[faces], 1, 0)
    six = np.einsum("ij,ij->i", a, np.cross(b, c))
    volume = float(six.sum() / 6)
    if volume <= 0:
        return MassProperties(volume, middle, np.zeros((3, 3)))
    centre = (six[:, None] * (a + b + c)).sum(0) / 24 / volume
    corners = np.stack([a, b, c], 1)
    total = corners.sum(1)
    second = np.einsum("t,tij,tik->jk", six, corners, corners) + np.einsum("t,ti,tj->ij", six, total, total)
    second = second / 120 - volume * np.outer(centre, centre)
    return MassProperties(volume, centre + middle, np.trace(second) * np.eye(3) - second)


def together(parts: list[MassProperties]) -> MassProperties:
    """Of several that do not overlap."""
    volume = sum(part.volume for part in parts)
    centre = np.sum([part.volume * part.centre for part in parts], axis=0) / volume
    inertia = np.zeros((3, 3))
    for part in parts:
        away = part.centre - centre
        inertia += part.inertia + part.volume * (away @ away * np.eye(3) - np.outer(away, away))
    return MassProperties(volume, centre, inertia)
