"""What runs for every frame without touching Python: pose a body, bring its limbs there, look at all pairs."""

from typing import NamedTuple

import numpy as np
from numba import njit

from mhvedit.collision.boxes import Nine, Three, refit_into, widened
from mhvedit.collision.crossing import Posture, boxes_apart, common_segment_into, crossings_into, relative
from mhvedit.collision.depth import deepest_into, skin_distance_into
from mhvedit.collision.limbs import LimbArrays
from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray
from mhvedit.skeleton.forward import forward_into
from mhvedit.skeleton.skin import skin_into


class BodyArrays(NamedTuple):
    """A skinned body as compiled code takes it."""

    parents: IntArray
    offsets: FloatArray
    dof_joint: IntArray
    dof_axis: FloatArray
    dof_slides: BoolArray
    rest: FloatArray  # (J, 3) m
    vertices: FloatArray  # (V, 3) m
    start: IntArray  # (V + 1,), joint and weight: see `sparse_weights`
    joint: IntArray
    weight: FloatArray


@njit(cache=True, nogil=True, error_model="numpy")
def _posture(limbs: LimbArrays, rest_local: FloatArray, rigid: bool) -> Posture:
    """A posture to be filled; that of rigid limbs keeps vertices and boxes at rest and only moves their frames."""
    n = limbs.joints.shape[0]
    local, centre, half = rest_local, limbs.centre, limbs.half
    if not rigid:
        local, centre, half = np.empty(local.shape), np.empty(centre.shape), np.empty(half.shape)
    return Posture(local, centre, half, np.empty((n, 3, 3)), np.empty((n, 3)))


@njit(cache=True, nogil=True, error_model="numpy")
def _pose(
    body: BodyArrays,
    limbs: LimbArrays,
    q: FloatArray,
    rigid: bool,
    rotations: FloatArray,
    positions: FloatArray,
    skin: FloatArray,
    posture: Posture,
) -> None:
    """Bring all limbs into a posture; rotations, positions and skin are scratch."""
    forward_into(body.parents, body.offsets, body.dof_joint, body.dof_axis, body.dof_slides, q, rotations, positions)
    for limb in range(limbs.joints.shape[0]):
        joint = limbs.joints[limb]
        for i in range(3):
            posture.places[limb, i] = positions[joint, i]
            for j in range(3):
                total = 0.0
                for k in range(3):
                    total += rotations[joint, i, k] * limbs.axes[limb, k, j]
                posture.turns[limb, i, j] = total
    if rigid:
        return
    skin_into(body.vertices, body.rest, body.start, body.joint, body.weight, rotations, positions, skin)
    for limb in range(limbs.joints.shape[0]):
        turn, place = posture.turns[limb], posture.places[limb]
        for v in range(limbs.vertex_start[limb], limbs.vertex_start[limb + 1]):
            w = limbs.vertex[v]
            if w < 0:
                continue
            x, y, z = skin[w, 0] - place[0], skin[w, 1] - place[1], skin[w, 2] - place[2]
            for j in range(3):
                posture.local[v, j] = turn[0, j] * x + turn[1, j] * y + turn[2, j] * z
        caps = limbs.caps[limbs.cap_start[limb] : limbs.cap_start[limb + 1]]
        _place_middles(limbs.vertex, caps, posture.local)
    refit_into(posture.local, limbs.faces, limbs.first, limbs.size, limbs.leaf, posture.centre, posture.half)


@njit(cache=True, nogil=True, error_model="numpy")
def _place_middles(vertex: IntArray, caps: IntArray, local: FloatArray) -> None:
    """Put the middles of a limb's holes where their rings are; every corner of a ring is the second of one cap."""
    for f in range(caps.shape[0]):
        if vertex[caps[f, 2]] < 0:
            local[caps[f, 2]] = 0.0
    corners = np.zeros(caps.shape[0])
    base = caps[:, 2].min() if caps.shape[0] else 0
    for f in range(caps.shape[0]):
        middle = caps[f, 2]
        if vertex[middle] < 0:
            corners[middle - base] += 1.0
            for x in range(3):
                local[middle, x] += (local[caps[f, 1], x] - local[middle, x]) / corners[middle - base]


@njit(cache=True, nogil=True, error_model="numpy")
def cross_all(
    body: BodyArrays,
    limbs: LimbArrays,
    pairs: IntArray,
    rest_local: FloatArray,
    q: FloatArray,
    rigid: bool,
    out: BoolArray,
) -> None:
    """Which pairs cross in each posture."""
    n = body.parents.shape[0]
    rotations, positions, skin = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty(body.vertices.shape)
    posture, found = _posture(limbs, rest_local, rigid), np.empty((1, 2), np.int64)
    local, centre, half, turns, places = posture
    faces, vertex, root, first, size, leaf = (
        limbs.faces, limbs.vertex, limbs.root, limbs.first, limbs.size, limbs.leaf
    )  # fmt: skip
    for frame in range(q.shape[0]):
        _pose(body, limbs, q[frame], rigid, rotations, positions, skin, posture)
        for p in range(pairs.shape[0]):
            a, b = pairs[p, 0], pairs[p, 1]
            r, t = relative(turns, places, a, b)
            out[frame, p] = 0 < crossings_into(
                faces, vertex, first, size, leaf, local, centre, half, r, t, root[a], root[b], found
            )


@njit(cache=True, nogil=True, error_model="numpy")
def measure_all(
    body: BodyArrays,
    limbs: LimbArrays,
    pairs: IntArray,
    exempt: BoolArray,
    rest_local: FloatArray,
    q: FloatArray,
    rigid: bool,
    crossing: BoolArray,
    depth: FloatArray,
    vertex: Int32Array,
    first_inside: BoolArray,
    point: FloatArray,
    normal: FloatArray,
) -> None:
    """Fill one row of `Depths` for each posture."""
    n = body.parents.shape[0]
    rotations, positions, skin = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty(body.vertices.shape)
    posture, found, ends = _posture(limbs, rest_local, rigid), np.empty((1, 2), np.int64), np.empty((2, 3))
    nearest = np.empty(3)
    for frame in range(q.shape[0]):
        _pose(body, limbs, q[frame], rigid, rotations, positions, skin, posture)
        for p in range(pairs.shape[0]):
            a, b = pairs[p, 0], pairs[p, 1]
            r, t = relative(posture.turns, posture.places, a, b)
            if boxes_apart(posture.centre, posture.half, r, widened(r), t, limbs.root[a], limbs.root[b]):
                continue
            crossing[frame, p] = _first_crossing(limbs, posture, a, b, r, t, found)
            deepest, v = _deepest(limbs, posture, exempt, b, a, r, t, 0.0, nearest)
            if v >= 0:
                _set_contact(posture, v, b, a, nearest, -1.0, point[frame, p], normal[frame, p])
            r, t = relative(posture.turns, posture.places, b, a)
            deeper, w = _deepest(limbs, posture, exempt, a, b, r, t, deepest, nearest)
            if w >= 0:
                _set_contact(posture, w, a, b, nearest, 1.0, point[frame, p], normal[frame, p])
                deepest, v, first_inside[frame, p] = deeper, w, True
            if v >= 0:
                depth[frame, p], vertex[frame, p] = deepest, limbs.vertex[v]
            elif crossing[frame, p]:
                common_segment_into(limbs.faces, posture, pairs[p], found[0], ends)
                for x in range(3):
                    point[frame, p, x] = 0.5 * (ends[0, x] + ends[1, x])
                _face_normal(limbs.faces, posture, b, found[0, 1], normal[frame, p])


@njit(cache=True, nogil=True, error_model="numpy")
def _first_crossing(
    limbs: LimbArrays,
    posture: Posture,
    a: int,
    b: int,
    r: Nine,
    t: Three,
    found: IntArray,
) -> bool:
    """Whether the surfaces of a pair cross; found (K, 2) has room for K crossings."""
    n = crossings_into(
        limbs.faces, limbs.vertex, limbs.first, limbs.size, limbs.leaf,
        posture.local, posture.centre, posture.half, r, t, limbs.root[a], limbs.root[b], found,
    )  # fmt: skip
    return bool(n > 0)


@njit(cache=True, nogil=True, error_model="numpy")
def _deepest(
    limbs: LimbArrays,
    posture: Posture,
    exempt: BoolArray,
    inner: int,
    outer: int,
    r: Nine,
    t: Three,
    least: float,
    nearest: FloatArray,
) -> tuple[float, int]:
    """`deepest_into` for two limbs; r, t are outer_from_inner."""
    depth, vertex = deepest_into(
        limbs.faces, limbs.caps[limbs.cap_start[outer] : limbs.cap_start[outer + 1]],
        limbs.first, limbs.size, limbs.leaf, posture.local, posture.centre, posture.half,
        limbs.root[outer], exempt[outer], limbs.vertex_start[inner], limbs.vertex_start[inner + 1],
        r, t, least, nearest,
    )  # fmt: skip
    return float(depth), int(vertex)


@njit(cache=True, nogil=True, error_model="numpy")
def crossings_of_pair(
    body: BodyArrays,
    limbs: LimbArrays,
    pair: IntArray,
    rest_local: FloatArray,
    q: FloatArray,
    faces: IntArray,
    segments: FloatArray,
) -> int:
    """Pairs of triangles of one pair of limbs that meet, and the ends of what they have in common."""
    n = body.parents.shape[0]
    rotations, positions, skin = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty(body.vertices.shape)
    posture = _posture(limbs, rest_local, False)
    _pose(body, limbs, q, False, rotations, positions, skin, posture)
    r, t = relative(posture.turns, posture.places, pair[0], pair[1])
    n_found = crossings_into(
        limbs.faces, limbs.vertex, limbs.first, limbs.size, limbs.leaf,
        posture.local, posture.centre, posture.half, r, t, limbs.root[pair[0]], limbs.root[pair[1]], faces,
    )  # fmt: skip
    for k in range(n_found):
        common_segment_into(limbs.faces, posture, pair, faces[k], segments[k])
    return int(n_found)


@njit(cache=True, nogil=True, error_model="numpy")
def mark_fold(
    limbs: LimbArrays, rest_local: FloatArray, rest_places: FloatArray, a: int, b: int, fold: float, out: BoolArray
) -> None:
    """Mark the vertices of limb b that lie within a distance of limb a's skin at rest."""
    p, q, stack = np.empty(3), np.empty(3), np.empty(512, np.int64)
    for v in range(limbs.vertex_start[b], limbs.vertex_start[b + 1]):
        for i in range(3):
            p[i] = 0.0
            for k in range(3):
                world = rest_places[b, k] - rest_places[a, k]
                for j in range(3):
                    world += limbs.axes[b, k, j] * rest_local[v, j]
                p[i] += limbs.axes[a, k, i] * world
        out[v] = fold >= skin_distance_into(
            limbs.faces, limbs.first, limbs.size, limbs.leaf, rest_local, limbs.centre, limbs.half,
            limbs.root[a], p, 0.0, stack, q,
        )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _set_contact(
    posture: Posture,
    vertex: int,
    inner: int,
    outer: int,
    nearest: FloatArray,
    sign: float,
    point: FloatArray,
    normal: FloatArray,
) -> None:
    """The deepest vertex in the world, and the unit vector from it to the skin, or its reverse."""
    length = 0.0
    for i in range(3):
        point[i], normal[i] = posture.places[inner, i], posture.places[outer, i]
        for j in range(3):
            point[i] += posture.turns[inner, i, j] * posture.local[vertex, j]
            normal[i] += posture.turns[outer, i, j] * nearest[j]
        normal[i] -= point[i]
        length += normal[i] * normal[i]
    for i in range(3):
        normal[i] *= sign / np.sqrt(length)


@njit(cache=True, nogil=True, error_model="numpy")
def _face_normal(faces: IntArray, posture: Posture, limb: int, face: int, normal: FloatArray) -> None:
    """The outward unit normal of a triangle, in the world."""
    across, local = np.empty(3), posture.local
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across[i] = (local[b, j] - local[a, j]) * (local[c, k] - local[a, k])
        across[i] -= (local[b, k] - local[a, k]) * (local[c, j] - local[a, j])
    length = np.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
    for i in range(3):
        normal[i] = 0.0
        for j in range(3):
            normal[i] += posture.turns[limb, i, j] * across[j] / length
