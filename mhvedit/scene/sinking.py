"""How deep closed meshes are in each other, and nothing else: what paths that keep clear ask of many frames.

The same depth that `surfaces.clearance` finds, without open3d: that of the deepest vertex, or point of a large face,
that lies inside the other; where none does, of the points midway between two piercings of an edge. A mesh without
boundary has one winding number at each point, so that one ray, straight up, tells what the five there do: a point is
inside where it is not 0. Only faces over the part of the plan that both bodies' boxes share are looked at for that.

Exact but for this: whether a point is over a face is told in whole numbers of `SNAP`.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.closed import has_no_boundary
from mhvedit.geometry.nearest import nearest_weights
from mhvedit.scene.surfaces import SPACING, clearance, open_surface, points_of_large_faces
from mhvedit.sequences.meshes import Mesh

CELL: Final = 0.02  # m, squares of the plan by which faces are looked up
MOST_CELLS: Final = 512  # along an axis
SNAP: Final = 1e-6  # m
PARALLEL: Final = 1e-18  # m^3 and less: an edge runs along a face


@dataclass(frozen=True, slots=True, eq=False)
class _Listed:
    """A mesh whose faces can be looked up by the squares of a part of the plan."""

    vertices: FloatArray  # (V, 3) m
    faces: Int32Array  # (F, 3)
    boxes: FloatArray  # (F, 6) m, low and high corner of each face
    low: FloatArray  # (3,) m, of the mesh
    high: FloatArray  # (3,) m
    corner: FloatArray  # (2,) m, where the squares start
    cell: float  # m, side of a square
    starts: IntArray  # (X + 1, Y + 1) flattened to (X * Y + 1,), in `over`
    over: IntArray  # faces by square
    shape: tuple[int, int]  # (X, Y) squares


def sunk(a: Mesh, b: Mesh) -> float:
    """How deep two meshes are in each other, m; 0 where they do not meet.

    Args:
        a: of at least one face.
        b: likewise, in the same frame.
    """
    if not (has_no_boundary(a.faces) and has_no_boundary(b.faces)):
        return clearance(open_surface(a), open_surface(b), reach=0.0).depth
    boxes_a, boxes_b = _boxes(a.vertices, a.faces), _boxes(b.vertices, b.faces)
    whole_a, whole_b = _box_of_all(boxes_a), _box_of_all(boxes_b)
    low, high = np.maximum(whole_a[:3], whole_b[:3]), np.minimum(whole_a[3:], whole_b[3:])
    if (low > high).any():
        return 0.0
    one, other = _listed(a, boxes_a, (low[:2], high[:2])), _listed(b, boxes_b, (low[:2], high[:2]))
    depth = max(_deepest_point(one, other), _deepest_point(other, one))
    return depth if depth > 0 else max(_deepest_middle(one, other), _deepest_middle(other, one))


def _listed(mesh: Mesh, boxes: FloatArray, part: tuple[FloatArray, FloatArray]) -> _Listed:
    """A mesh with its faces by the squares between two corners of the plan."""
    low, high = part
    cell = max(CELL, float((high - low).max()) / MOST_CELLS)
    shape = (int((high[0] - low[0]) / cell) + 1, int((high[1] - low[1]) / cell) + 1)
    starts, over = _by_square(boxes, low, cell, shape)
    whole = _box_of_all(boxes)
    return _Listed(mesh.vertices, mesh.faces, boxes, whole[:3], whole[3:], low, cell, starts, over, shape)


def _deepest_point(one: _Listed, other: _Listed) -> float:
    """How deep the deepest of the one's points is in the other, m; 0 where none is inside."""
    faces = one.faces[_meet_box(one.boxes, other.low, other.high)]
    if not len(faces):
        return 0.0
    named = np.zeros(len(one.vertices), np.bool_)
    named[faces] = True
    extra, _ = points_of_large_faces(one.vertices, faces, spacing=SPACING)
    return _deepest(np.concatenate([one.vertices[named], extra]), other)


def _deepest_middle(one: _Listed, other: _Listed) -> float:
    """How deep the deepest point midway between two piercings of an edge of the one is in the other, m."""
    edges = _edges_near(one.vertices, one.faces, other.low, other.high)
    edge, at = _piercings(
        edges, one.vertices, one.faces, other.vertices, other.faces, other.boxes,
        other.corner, other.cell, other.starts, other.over, other.shape,
    )  # fmt: skip
    order = np.lexsort((at, edge))
    edge, at = edge[order], at[order]
    pairs = np.flatnonzero(edge[1:] == edge[:-1])
    face, corner = edge[pairs] // 3, edge[pairs] % 3
    start, stop = one.vertices[one.faces[face, corner]], one.vertices[one.faces[face, (corner + 1) % 3]]
    middle = (at[pairs] + at[pairs + 1]) / 2
    return _deepest(start + middle[:, None] * (stop - start), other)


def _deepest(points: FloatArray, other: _Listed) -> float:
    """How deep the deepest of (P, 3) m points is in a mesh, m; 0 where none is inside."""
    boxed = points[_meet_box(np.concatenate([points, points], 1), other.low, other.high)]
    flat = np.rint((other.vertices[:, :2] - other.corner) / SNAP).astype(np.int64)
    ours = np.rint((boxed[:, :2] - other.corner) / SNAP).astype(np.int64)
    turns = _windings(
        boxed, ours, other.vertices, flat, other.faces, other.corner, other.cell, other.starts, other.over, other.shape
    )
    squared = _deepest_squared(boxed[turns != 0], other.vertices, other.faces, other.boxes)
    return float(np.sqrt(squared))


@njit(cache=True, nogil=True)
def _boxes(vertices: FloatArray, faces: Int32Array) -> FloatArray:
    """(F, 6) m, low and high corner of each face."""
    out = np.empty((faces.shape[0], 6))
    for f in range(faces.shape[0]):
        for c in range(3):
            i, j, k = vertices[faces[f, 0], c], vertices[faces[f, 1], c], vertices[faces[f, 2], c]
            out[f, c], out[f, c + 3] = min(i, j, k), max(i, j, k)
    return out


@njit(cache=True, nogil=True)
def _box_of_all(boxes: FloatArray) -> FloatArray:
    """(6,) m, low and high corner of what (F, 6) boxes hold."""
    out = boxes[0].copy()
    for f in range(1, boxes.shape[0]):
        for c in range(3):
            out[c], out[c + 3] = min(out[c], boxes[f, c]), max(out[c + 3], boxes[f, c + 3])
    return np.asarray(out)


@njit(cache=True, nogil=True)
def _meet_box(boxes: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """(F,) which boxes meet another one."""
    out = np.ones(boxes.shape[0], np.bool_)
    for f in range(boxes.shape[0]):
        for c in range(3):
            out[f] &= boxes[f, c] <= high[c] and boxes[f, c + 3] >= low[c]
    return out


@njit(cache=True, nogil=True)
def _span(low: float, high: float, corner: float, cell: float, count: int) -> tuple[int, int]:
    """First and past-the-last square along an axis that something from low to high is over; one more for rounding."""
    first, last = np.floor((low - corner) / cell - 0.01), np.floor((high - corner) / cell + 0.01)
    return int(min(max(first, 0.0), count)), int(min(max(last + 1, 0.0), count))


@njit(cache=True, nogil=True)
def _by_square(boxes: FloatArray, corner: FloatArray, cell: float, shape: tuple[int, int]) -> tuple[IntArray, IntArray]:
    """Where the faces over each square start, and these faces, ascending."""
    n_x, n_y = shape
    starts = np.zeros(n_x * n_y + 1, np.int64)
    for f in range(boxes.shape[0]):
        x0, x1 = _span(boxes[f, 0], boxes[f, 3], corner[0], cell, n_x)
        y0, y1 = _span(boxes[f, 1], boxes[f, 4], corner[1], cell, n_y)
        for x in range(x0, x1):
            for y in range(y0, y1):
                starts[x * n_y + y + 1] += 1
    starts = np.cumsum(starts)
    over, filled = np.empty(starts[-1], np.int64), starts.copy()
    for f in range(boxes.shape[0]):
        x0, x1 = _span(boxes[f, 0], boxes[f, 3], corner[0], cell, n_x)
        y0, y1 = _span(boxes[f, 1], boxes[f, 4], corner[1], cell, n_y)
        for x in range(x0, x1):
            for y in range(y0, y1):
                over[filled[x * n_y + y]] = f
                filled[x * n_y + y] += 1
    return starts, over


@njit(cache=True, nogil=True)
def _windings(
    points: FloatArray, ours: IntArray, vertices: FloatArray, flat: IntArray, faces: Int32Array,
    corner: FloatArray, cell: float, starts: IntArray, over: IntArray, shape: tuple[int, int],
) -> IntArray:  # fmt: skip
    """(P,) how often a mesh goes round each point, seen along a ray straight up; plan in whole numbers."""
    out = np.zeros(points.shape[0], np.int64)
    for p in range(points.shape[0]):
        x = min(max(int((points[p, 0] - corner[0]) / cell), 0), shape[0] - 1)
        y = min(max(int((points[p, 1] - corner[1]) / cell), 0), shape[1] - 1)
        square = x * shape[1] + y
        for n in range(starts[square], starts[square + 1]):
            i, j, k = faces[over[n], 0], faces[over[n], 1], faces[over[n], 2]
            u, v = ours[p, 0], ours[p, 1]
            turn = _passes(flat[i], flat[j], u, v) + _passes(flat[j], flat[k], u, v) + _passes(flat[k], flat[i], u, v)
            if turn != 0 and _height(vertices[i], vertices[j], vertices[k], points[p]) > points[p, 2]:
                out[p] += turn
    return out


@njit(cache=True, nogil=True)
def _passes(a: IntArray, b: IntArray, u: int, v: int) -> int:
    """1 where an edge in plan goes up at the right of a point, -1 where it comes down there, otherwise 0."""
    side = (b[0] - a[0]) * (v - a[1]) - (u - a[0]) * (b[1] - a[1])
    if a[1] <= v < b[1]:
        return 1 if side > 0 else 0
    if b[1] <= v < a[1]:
        return -1 if side < 0 else 0
    return 0


@njit(cache=True, nogil=True)
def _height(a: FloatArray, b: FloatArray, c: FloatArray, p: FloatArray) -> float:
    """Height of a face above a point of the plan, m, kept within its corners'."""
    low, high = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if area == 0.0:
        return float(0.5 * (low + high))
    s = ((p[0] - a[0]) * (c[1] - a[1]) - (p[1] - a[1]) * (c[0] - a[0])) / area
    t = ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])) / area
    return float(min(max(a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]), low), high))


@njit(cache=True, nogil=True)
def _deepest_squared(points: FloatArray, vertices: FloatArray, faces: Int32Array, boxes: FloatArray) -> float:
    """The largest of the squared distances of points to a mesh, m^2; a point is left once it is no deeper."""
    best = 0.0
    for p in range(points.shape[0]):
        nearest = np.inf
        for f in range(faces.shape[0]):
            beyond = 0.0
            for c in range(3):
                away = max(boxes[f, c] - points[p, c], points[p, c] - boxes[f, c + 3], 0.0)
                beyond += away * away
            if beyond < nearest:
                i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
                nearest = min(nearest, _to_face(points[p], vertices[i], vertices[j], vertices[k]))
                if nearest <= best:
                    break
        best = max(best, nearest) if nearest < np.inf else best
    return best


@njit(cache=True, nogil=True)
def _to_face(p: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    """Squared distance of a point to a triangle."""
    ab_x, ab_y, ab_z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    ac_x, ac_y, ac_z = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    d1, d2 = ab_x * x + ab_y * y + ab_z * z, ac_x * x + ac_y * y + ac_z * z
    ab_ab, ab_ac = ab_x * ab_x + ab_y * ab_y + ab_z * ab_z, ab_x * ac_x + ab_y * ac_y + ab_z * ac_z
    ac_ac = ac_x * ac_x + ac_y * ac_y + ac_z * ac_z
    d3, d4, d5, d6 = d1 - ab_ab, d2 - ab_ac, d1 - ab_ac, d2 - ac_ac
    s, t = nearest_weights(d1, d2, d3, d4, d5, d6)
    x, y, z = x - s * ab_x - t * ac_x, y - s * ab_y - t * ac_y, z - s * ab_z - t * ac_z
    return float(x * x + y * y + z * z)


@njit(cache=True, nogil=True)
def _edges_near(vertices: FloatArray, faces: Int32Array, low: FloatArray, high: FloatArray) -> IntArray:
    """(N,) 3 face + corner where they start, of the edges the boxes of which meet a box.

    A closed mesh has each edge as often one way as the other; those from the smaller vertex count.
    """
    found, n = np.empty(3 * faces.shape[0], np.int64), 0
    for f in range(faces.shape[0]):
        for e in range(3):
            a, b = faces[f, e], faces[f, (e + 1) % 3]
            if a < b and not _clear(vertices[a], vertices[b], low, high):
                found[n] = 3 * f + e
                n += 1
    return found[:n]


@njit(cache=True, nogil=True)
def _piercings(
    edges: IntArray, vertices: FloatArray, faces: Int32Array,
    others: FloatArray, walls: Int32Array, boxes: FloatArray,
    corner: FloatArray, cell: float, starts: IntArray, over: IntArray, shape: tuple[int, int],
) -> tuple[IntArray, FloatArray]:  # fmt: skip
    """Edges of one mesh that pierce faces of the other: (N,) which of them, and (N,) how far along."""
    edge, at, n = np.empty(64, np.int64), np.empty(64), 0
    for own in edges:
        a, b = vertices[faces[own // 3, own % 3]], vertices[faces[own // 3, (own % 3 + 1) % 3]]
        x0, x1 = _span(min(a[0], b[0]), max(a[0], b[0]), corner[0], cell, shape[0])
        y0, y1 = _span(min(a[1], b[1]), max(a[1], b[1]), corner[1], cell, shape[1])
        for x in range(x0, x1):
            for y in range(y0, y1):
                for m in range(starts[x * shape[1] + y], starts[x * shape[1] + y + 1]):
                    w = over[m]
                    if _clear(a, b, boxes[w, :3], boxes[w, 3:]):
                        continue
                    first_x, _ = _span(boxes[w, 0], boxes[w, 3], corner[0], cell, shape[0])
                    first_y, _ = _span(boxes[w, 1], boxes[w, 4], corner[1], cell, shape[1])
                    if x != max(first_x, x0) or y != max(first_y, y0):
                        continue  # looked at in another square
                    along = _where_pierced(a, b, others[walls[w, 0]], others[walls[w, 1]], others[walls[w, 2]])
                    if along >= 0.0:
                        if n == len(edge):
                            edge, at = np.append(edge, np.empty_like(edge)), np.append(at, np.empty_like(at))
                        edge[n], at[n] = own, along
                        n += 1
    return edge[:n], at[:n]


@njit(cache=True, nogil=True)
def _clear(a: FloatArray, b: FloatArray, low: FloatArray, high: FloatArray) -> bool:
    """Whether an edge's box misses another box."""
    for c in range(3):
        if max(a[c], b[c]) < low[c] or min(a[c], b[c]) > high[c]:
            return True
    return False


@njit(cache=True, nogil=True)
def _where_pierced(a: FloatArray, b: FloatArray, i: FloatArray, j: FloatArray, k: FloatArray) -> float:
    """How far along an edge, 0 to 1, it goes through a triangle; -1 where it does not (Moeller and Trumbore)."""
    d_x, d_y, d_z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    e_x, e_y, e_z = j[0] - i[0], j[1] - i[1], j[2] - i[2]
    g_x, g_y, g_z = k[0] - i[0], k[1] - i[1], k[2] - i[2]
    p_x, p_y, p_z = d_y * g_z - d_z * g_y, d_z * g_x - d_x * g_z, d_x * g_y - d_y * g_x
    volume = e_x * p_x + e_y * p_y + e_z * p_z
    if abs(volume) <= PARALLEL:
        return -1.0
    t_x, t_y, t_z = a[0] - i[0], a[1] - i[1], a[2] - i[2]
    u = (t_x * p_x + t_y * p_y + t_z * p_z) / volume
    if u < 0.0 or u > 1.0:
        return -1.0
    q_x, q_y, q_z = t_y * e_z - t_z * e_y, t_z * e_x - t_x * e_z, t_x * e_y - t_y * e_x
    v = (d_x * q_x + d_y * q_y + d_z * q_z) / volume
    if v < 0.0 or u + v > 1.0:
        return -1.0
    along = (g_x * q_x + g_y * q_y + g_z * q_z) / volume
    return along if 0.0 <= along <= 1.0 else -1.0
