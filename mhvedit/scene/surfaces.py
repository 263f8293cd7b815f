"""Distances between surfaces: how deep one person is in another, or how far apart they are.

What counts as inside. Five rays leave a point. Where all five cross the surface an odd number of times it is inside;
where one meets nothing and none is odd it is outside. Otherwise (holes, flipped faces, a body that runs through
itself) the generalised winding number decides: inside where it is beyond one half, either way round, so that a mesh
turned inside out is the same solid.

Depth is distance to the other's surface. It is measured at the vertices, and on faces with edges longer than `LARGE`
at points `SPACING` apart: between the vertices a smaller face can lie some millimetres deeper. Where none of these
points is inside, the surfaces may still cross, as thin blades do: then depth is measured midway between the two
points where an edge enters and leaves. Distances between what does not cross are exact (vertices to faces, edges to
edges).
"""

import os
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Final

import numpy as np
from numba import njit

from mhvedit.errors import MissingLibrary
from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.winding import winding_numbers
from mhvedit.scene.edges import closest_between_edges, unique_edges
from mhvedit.sequences.meshes import Mesh

LARGE: Final = 0.1  # m, edges longer than this make a face large
SPACING: Final = 0.02  # m, between points of large faces
FINEST: Final = 128  # into about how many pieces an edge is cut at most
RAYS: Final = np.array(  # (5, 3) spread evenly, along no axis
    [[0.61, 0.31, 0.73], [-0.64, 0.59, 0.49], [-0.23, -0.83, 0.51], [0.68, -0.42, -0.60], [-0.29, 0.38, -0.88]]
)
TIE: Final = 1e-9  # sides that differ by less, relatively, are equally long
INSIDE: Final = 0.5  # winding number


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A mesh that distances can be asked of."""

    vertices: FloatArray  # (V, 3) m
    faces: Int32Array  # (F, 3)
    points: FloatArray  # (P, 3) m, on the surface: the vertices, then points of large faces
    corners: IntArray  # (P,) the vertex that each point belongs with
    n_corners: int  # how many of the points are vertices
    low: FloatArray  # (3,) m
    high: FloatArray  # (3,) m
    rays: Any  # open3d's RaycastingScene, about `low`
    workers: int  # threads, 0 for all


@dataclass(frozen=True, slots=True, eq=False)
class Clearance:
    """How two surfaces stand to each other."""

    gap: float  # m, negative: how deep; inf where they are further apart than was asked
    crossing: bool  # the surfaces cross, or one holds the other
    point: FloatArray  # (3,) m, where they are deepest or nearest; NaN where the gap is inf
    corner_a: int  # vertex of A at the deepest or nearest of its points; -1 where none was near
    corner_b: int  # of B
    near_a: IntArray  # (K,) the vertices of A that belong with its points within reach of the box of B
    signed_a: FloatArray  # (K,) m, their distances to B, negative inside
    near_b: IntArray  # the same of B
    signed_b: FloatArray

    @property
    def depth(self) -> float:
        """How deep one is in the other, m; 0 where they do not meet."""
        return max(0.0, -self.gap)

    def swapped(self) -> "Clearance":
        """The same told with B first."""
        near = self.near_b, self.signed_b, self.near_a, self.signed_a
        return Clearance(self.gap, self.crossing, self.point, self.corner_b, self.corner_a, *near)


def open_surface(mesh: Mesh, *, workers: int = 1) -> Surface:
    """Prepare a mesh of at least one face for questions about distance.

    Args:
        mesh: in the world.
        workers: threads, 0 for all; no more are taken than there are processors for this process.

    Raises:
        MissingLibrary: open3d cannot be loaded.
    """
    o3d, workers = load_open3d(), min(workers, _processors())  # TBB, below open3d, writes a warning if asked for more
    named = np.zeros(len(mesh.vertices), np.bool_)
    named[mesh.faces.ravel()] = True
    in_use = np.flatnonzero(named)
    used = mesh.vertices[in_use]
    low, high = used.min(0), used.max(0)
    rays = o3d.t.geometry.RaycastingScene(nthreads=workers)
    rays.add_triangles(
        o3d.core.Tensor(np.ascontiguousarray(mesh.vertices - low, np.float32)),
        o3d.core.Tensor(np.ascontiguousarray(mesh.faces, np.uint32)),
    )
    extra, corners = points_of_large_faces(mesh.vertices, mesh.faces, spacing=SPACING)
    points, owners = np.concatenate([used, extra]), np.concatenate([in_use, corners])
    return Surface(mesh.vertices, mesh.faces, points, owners, len(in_use), low, high, rays, workers)


def _processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def load_open3d() -> ModuleType:
    """open3d, which takes a second to load and needs a system library that a bare machine may lack.

    Raises:
        MissingLibrary: it cannot be loaded.
    """
    try:
        import open3d as o3d  # lazily: everything else works without
    except (ImportError, OSError) as error:
        raise MissingLibrary(
            "measuring distances between meshes",
            f"on Debian, `apt install libusb-1.0-0 libgl1 libgomp1` ({error})",
        ) from error
    return o3d


def points_of_large_faces(vertices: FloatArray, faces: Int32Array, *, spacing: float) -> tuple[FloatArray, IntArray]:
    """Points on the faces with an edge longer than `LARGE`, corners left out.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3).
        spacing: m, how far apart.

    Returns:
        (N, 3) m, and (N,) the corner nearest in the face's own coordinates.
    """
    faces = faces[_beyond(vertices, faces, (LARGE * (1 - TIE)) ** 2)]
    corners = vertices[faces]
    longest = _longest(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2))
    of = np.flatnonzero(longest > LARGE)
    finest = np.maximum(spacing, longest / FINEST)
    weights = np.tile(np.eye(3), (len(of), 1, 1))  # (T, 3, 3) corners of the pieces in coordinates of their face
    points, owners = [np.zeros((0, 3))], [np.zeros(0, np.int64)]
    while len(of):
        of, weights, middles, nearest = _halved(of, weights, corners, finest * (1 + TIE))
        points.append(middles)
        owners.append(faces[of[: len(middles)], nearest].astype(np.int64))
    return np.concatenate(points), np.concatenate(owners)


def signed_distances(surface: Surface, points: FloatArray) -> FloatArray:
    """Distance of points to a surface, negative inside (see the module).

    Args:
        surface: of the other.
        points: (P, 3) m.

    Returns:
        (P,) m.
    """
    if len(points) == 0:
        return np.zeros(0)
    o3d = load_open3d()
    local = o3d.core.Tensor(np.ascontiguousarray(points - surface.low, np.float32))
    far = surface.rays.compute_distance(local, nthreads=surface.workers).numpy().astype(np.float64)
    return np.asarray(np.where(is_inside(surface, points), -far, far))


def is_inside(surface: Surface, points: FloatArray) -> BoolArray:
    """Which points lie inside a surface (see the module).

    Args:
        surface: any mesh.
        points: (P, 3) m.

    Returns:
        (P,).
    """
    inside = np.zeros(len(points), np.bool_)
    boxed = np.flatnonzero(_within(points, surface.low, surface.high))
    if len(boxed) == 0:
        return inside
    crossings = _crossings(surface, points[boxed])
    odd = (crossings % 2 == 1).sum(1)
    unsure = ((odd > 0) | (crossings > 0).all(1)) & (odd < len(RAYS))
    inside[boxed[odd == len(RAYS)]] = True
    ask = boxed[unsure]
    inside[ask] = np.abs(winding_numbers(surface.vertices, surface.faces, points[ask])) > INSIDE
    return inside


def clearance(a: Surface, b: Surface, *, reach: float) -> Clearance:
    """The smallest signed distance between two surfaces.

    Args:
        a: one.
        b: the other.
        reach: m; gaps wider than this are not measured.
    """
    near_a, near_b = _near_box(a, b, reach), _near_box(b, a, reach)
    signed_a, signed_b = signed_distances(b, a.points[near_a]), signed_distances(a, b.points[near_b])
    gap, point = _smallest(a.points[near_a], signed_a, b.points[near_b], signed_b)
    crossing = gap < 0
    if gap >= 0:
        depth, where = _depth_of_crossing(a, b)
        crossing = depth >= 0
        if crossing:
            gap, point = -depth, where
        elif gap < reach or _boxes_within(a, b, reach):
            gap, point = _nearest_edges(a, b, (near_a, signed_a), (near_b, signed_b), (min(gap, reach), point))
    if gap >= reach:
        gap, point = np.inf, np.full(3, np.nan)
    corners = (_corner_at(a, near_a, signed_a), _corner_at(b, near_b, signed_b))
    near = a.corners[near_a], signed_a, b.corners[near_b], signed_b
    return Clearance(float(gap), bool(crossing), point, *corners, *near)


def boxes_apart(low_a: FloatArray, high_a: FloatArray, low_b: FloatArray, high_b: FloatArray) -> float:
    """Distance between two boxes given by their corners, m; 0 where they overlap."""
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(low_a - high_b, low_b - high_a))))


def _crossings(surface: Surface, points: FloatArray) -> IntArray:
    """(P, 5) how often each ray from each point crosses the surface."""
    local = np.repeat((points - surface.low)[:, None], len(RAYS), 1)
    rays = np.concatenate([local, np.broadcast_to(RAYS, local.shape)], -1).astype(np.float32)
    counted = surface.rays.count_intersections(load_open3d().core.Tensor(rays), nthreads=surface.workers)
    return np.asarray(counted.numpy().astype(np.int64))


def _near_box(surface: Surface, other: Surface, reach: float) -> IntArray:
    """Points within reach of the other's box."""
    return np.flatnonzero(_within(surface.points, other.low - reach, other.high + reach))


def _boxes_within(a: Surface, b: Surface, reach: float) -> bool:
    return boxes_apart(a.low, a.high, b.low, b.high) < reach


def _smallest(
    points_a: FloatArray, signed_a: FloatArray, points_b: FloatArray, signed_b: FloatArray
) -> tuple[float, FloatArray]:
    """The smallest distance of either's points, and where."""
    signed = np.concatenate([signed_a, signed_b])
    if len(signed) == 0:
        return np.inf, np.full(3, np.nan)
    best = int(signed.argmin())
    return float(signed[best]), np.concatenate([points_a, points_b])[best]


def _corner_at(surface: Surface, near: IntArray, signed: FloatArray) -> int:
    return int(surface.corners[near[signed.argmin()]]) if len(near) else -1


def _depth_of_crossing(a: Surface, b: Surface) -> tuple[float, FloatArray]:
    """Depth where edges of one pierce the other and no point of either lies inside; -1 where none does."""
    best, where, pierced = -1.0, np.full(3, np.nan), False
    for one, other in ((a, b), (b, a)):
        enters, middles = _pierced(one, other)
        if len(enters) == 0:
            continue
        if not pierced:
            best, where, pierced = max(best, 0.0), enters[0], True
        signed = signed_distances(other, middles)
        if len(signed) and -signed.min() > best:
            best, where = float(-signed.min()), middles[signed.argmin()]
    return best, where


def _pierced(one: Surface, other: Surface) -> tuple[FloatArray, FloatArray]:
    """Where edges of one pierce the other: (H, 3) m; and (M, 3) m midway between consecutive piercings of an edge."""
    ends = one.vertices[_edges_near_box(one, other, 0.0)]
    boxed = ((ends.max(1) >= other.low) & (ends.min(1) <= other.high)).all(1)
    start, along = ends[boxed, 0], ends[boxed, 1] - ends[boxed, 0]
    if len(start) == 0:
        return np.zeros((0, 3)), np.zeros((0, 3))
    o3d = load_open3d()
    rays = np.concatenate([start - other.low, along], 1).astype(np.float32)
    hit = other.rays.test_occlusions(o3d.core.Tensor(rays), 0.0, 1.0, nthreads=other.workers).numpy()
    if not hit.any():
        return np.zeros((0, 3)), np.zeros((0, 3))
    start, along = start[hit], along[hit]
    listed = other.rays.list_intersections(o3d.core.Tensor(rays[hit]), nthreads=other.workers)
    ray, at = listed["ray_ids"].numpy().astype(np.int64), listed["t_hit"].numpy().astype(np.float64)
    ray, at = ray[at <= 1], at[at <= 1]
    order = np.lexsort((at, ray))
    ray, at = ray[order], at[order]
    same = np.flatnonzero(ray[1:] == ray[:-1])
    middle = (at[same] + at[same + 1]) / 2
    return start[ray] + at[:, None] * along[ray], start[ray[same]] + middle[:, None] * along[ray[same]]


def _nearest_edges(
    a: Surface,
    b: Surface,
    near_a: tuple[IntArray, FloatArray],
    near_b: tuple[IntArray, FloatArray],
    best: tuple[float, FloatArray],
) -> tuple[float, FloatArray]:
    """The smallest distance between edges where it is below the best so far, which points gave; else that."""
    ends_a, ends_b = _edges_below(a, b, near_a, best[0]), _edges_below(b, a, near_b, best[0])
    gap, point = closest_between_edges(ends_a, ends_b, below=best[0])
    return (gap, point) if gap < best[0] else best


def _edges_below(surface: Surface, other: Surface, near: tuple[IntArray, FloatArray], bound: float) -> FloatArray:
    """(E, 2, 3) the edges that can come nearer to the other than a bound: half an edge from an end that is near."""
    beyond = np.maximum(0.0, np.maximum(other.low - surface.vertices, surface.vertices - other.high))
    least = np.sqrt(_squared(beyond))
    is_vertex = near[0] < surface.n_corners
    least[surface.corners[near[0][is_vertex]]] = np.abs(near[1][is_vertex])
    edges = _edges_near_box(surface, other, bound)
    ends = surface.vertices[edges]
    half = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / 2
    return np.asarray(ends[least[edges].min(1) - half < bound])


def _edges_near_box(surface: Surface, other: Surface, reach: float) -> IntArray:
    """(E, 2) edges of the faces whose boxes are within reach of the other's box."""
    low, high = other.low - reach, other.high + reach
    near = np.ones(len(surface.faces), np.bool_)
    for axis in range(3):
        above, below = surface.vertices[:, axis] >= low[axis], surface.vertices[:, axis] <= high[axis]
        near &= _any_corner(above, surface.faces) & _any_corner(below, surface.faces)
    return unique_edges(surface.faces[near])


def _any_corner(holds: BoolArray, faces: Int32Array) -> BoolArray:
    """(F,) faces with a corner of which something holds."""
    return np.asarray(holds[faces[:, 0]] | holds[faces[:, 1]] | holds[faces[:, 2]])


def _within(points: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """(P,) points in a box; column by column, which is several times faster than row by row."""
    inside = np.ones(len(points), np.bool_)
    for axis in range(3):
        inside &= (points[:, axis] >= low[axis]) & (points[:, axis] <= high[axis])
    return inside


def _squared(vectors: FloatArray) -> FloatArray:
    """(N,) squared lengths."""
    return np.asarray(vectors[:, 0] ** 2 + vectors[:, 1] ** 2 + vectors[:, 2] ** 2)


def _longest(sides: FloatArray) -> FloatArray:
    """(F,) the largest of (F, 3)."""
    return np.asarray(np.maximum(np.maximum(sides[:, 0], sides[:, 1]), sides[:, 2]))


@njit(cache=True, nogil=True)
def _beyond(vertices: FloatArray, faces: Int32Array, squared: float) -> BoolArray:
    """(F,) faces with an edge the square of which is more, m^2."""
    out = np.zeros(faces.shape[0], np.bool_)
    for f in range(faces.shape[0]):
        for e in range(3):
            a, b = faces[f, e], faces[f, (e + 1) % 3]
            x, y, z = vertices[a, 0] - vertices[b, 0], vertices[a, 1] - vertices[b, 1], vertices[a, 2] - vertices[b, 2]
            out[f] |= x * x + y * y + z * z > squared
    return out


@njit(cache=True, nogil=True)
def _halved(
    of: IntArray, weights: FloatArray, corners: FloatArray, finest: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """Cut triangles whose longest side is too long from its middle to the corner across.

    Args:
        of: (T,) the face that each is a piece of.
        weights: (T, 3, 3) corners in coordinates of their face.
        corners: (F, 3, 3) m, of the faces.
        finest: (F,) m, sides of this length are left.

    Returns:
        (2N,) faces and (2N, 3, 3) weights of the halves, all first ones first; (N, 3) m, the middles; (N,) the corner
        of the face that each is nearest to.
    """
    side, n = np.full(of.shape[0], -1), 0
    for t in range(of.shape[0]):
        sides = _sides(weights[t], corners[of[t]])
        longest = max(sides[0], sides[1], sides[2])
        if longest > finest[of[t]]:
            n += 1
            for k in range(2, -1, -1):  # the first of those that are equally long
                if sides[k] >= longest * (1 - TIE):
                    side[t] = k
    faces, halves = np.empty(2 * n, np.int64), np.empty((2 * n, 3, 3))
    middles, nearest, at = np.zeros((n, 3)), np.empty(n, np.int64), 0
    for t in range(of.shape[0]):
        if side[t] < 0:
            continue
        after = (side[t] + 1) % 3
        middle = (weights[t, side[t]] + weights[t, after]) / 2
        faces[at], faces[at + n] = of[t], of[t]
        nearest[at] = middle.argmax()
        for c in range(3):
            for k in range(3):  # one by one: arrays put into arrays take seconds to compile
                halves[at, c, k] = middle[k] if c == after else weights[t, c, k]
                halves[at + n, c, k] = middle[k] if c == side[t] else weights[t, c, k]
                middles[at, k] += middle[c] * corners[of[t], c, k]
        at += 1
    return faces, halves, middles, nearest


@njit(cache=True, nogil=True)
def _sides(weights: FloatArray, corners: FloatArray) -> FloatArray:
    """(3,) m, sides of a piece of a face; side i leads from corner i to the next."""
    out = np.zeros(3)
    for k in range(3):
        for axis in range(3):
            step = 0.0
            for c in range(3):
                step += (weights[(k + 1) % 3, c] - weights[k, c]) * corners[c, axis]
            out[k] += step * step
    return np.sqrt(out)
