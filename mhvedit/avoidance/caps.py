"""Limbs whose holes are closed by fans round their middles.

A fan from a corner of a bent hole (the groin, the armpit) cuts into the limb on one side and bulges on the other, and a
vertex beside it changes from outside to centimetres deep when the fan starts at another corner. What decides whether a
motion is free should not hang on that choice; a fan round the middle has none.
"""

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mhvedit.collision.detect import CollisionBody, measure_depths
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.skeleton.skin import SkinnedBody, sparse_weights


def with_middle_caps(body: CollisionBody) -> CollisionBody:
    """The same body with other caps; the middles become vertices of the skin that no triangle of it has.

    Args:
        body: prepared.
    """
    arrays, skin = body.limbs.arrays, body.body
    holes = [
        _holes(arrays.faces[arrays.face_start[limb] : arrays.face_start[limb + 1]])
        for limb in range(body.limbs.n_limbs)
    ]
    counts = np.array([len(rings) for rings in holes])
    shift = np.concatenate([[0], np.cumsum(counts)])
    rings = [arrays.vertex[np.unique(ring)] for limb in holes for ring in limb]
    grown = _with_middles(skin, rings)
    vertex, local, exempt, caps = [], [], [], []
    for limb, mine in enumerate(holes):
        span = slice(arrays.vertex_start[limb], arrays.vertex_start[limb + 1])
        middles = len(skin.vertices) + np.arange(shift[limb], shift[limb + 1])
        away = grown.vertices[middles] - skin.skeleton.rest_positions[arrays.joints[limb]]
        vertex += [arrays.vertex[span], middles]
        local += [body.rest_local[span], away @ arrays.axes[limb]]
        exempt += [body.exempt[:, span], np.ones((len(counts), len(mine)), np.bool_)]
        first = arrays.vertex_start[limb + 1] + shift[limb]  # of the middles, among all vertices of limbs
        caps.append(_fans([ring + shift[limb] for ring in mine], int(first)))
    faces_of = np.repeat(np.arange(len(counts)), np.diff(arrays.face_start))
    changed = arrays._replace(
        vertex_start=arrays.vertex_start + shift,
        vertex=np.concatenate(vertex).astype(np.int64),
        faces=arrays.faces + shift[faces_of][:, None],
        cap_start=np.cumsum([0, *(len(cap) for cap in caps)]),
        caps=np.concatenate(caps),
    )
    start, joint, weight = sparse_weights(grown.weights)
    other = CollisionBody(
        grown,
        replace(body.limbs, arrays=changed),
        body.pairs,
        body.arrays._replace(vertices=grown.vertices, start=start, joint=joint, weight=weight),
        np.ascontiguousarray(np.concatenate(local)),
        np.concatenate(exempt, 1),
        body.rest_depth,
    )
    rest = measure_depths(other, np.zeros((1, skin.skeleton.n_dofs)), workers=1).depth[0]
    return replace(other, rest_depth=rest)


def _with_middles(skin: SkinnedBody, rings: list[IntArray]) -> SkinnedBody:
    """The body with a vertex in the middle of each ring, carried by the mean of what carries the ring."""
    if not rings:
        return skin
    middles: FloatArray = np.stack([skin.vertices[ring].mean(0) for ring in rings])
    weights: FloatArray = np.stack([skin.weights[ring].mean(0) for ring in rings])
    return SkinnedBody(
        skin.skeleton, np.concatenate([skin.vertices, middles]), skin.faces, np.concatenate([skin.weights, weights])
    )


def _holes(faces: IntArray) -> list[IntArray]:
    """Rings of open edges, each (n, 2) from corner to corner as the triangles have them."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    n = int(faces.max()) + 1
    balance = coo_array((np.ones(len(edges), np.int64), (edges[:, 0], edges[:, 1])), (n, n)).tocsr()
    difference = (balance - balance.T).tocoo()
    ends = np.stack([difference.row, difference.col], 1)
    ahead = np.repeat(ends, np.maximum(difference.data, 0), axis=0).astype(np.int64)
    joined = coo_array((np.ones(len(ahead)), (ahead[:, 0], ahead[:, 1])), (n, n))
    _, ring = connected_components(joined, directed=False)
    return [ahead[ring[ahead[:, 0]] == one] for one in np.unique(ring[ahead[:, 0]])]


def _fans(rings: list[IntArray], first: int) -> IntArray:
    """(C, 3) triangles from each ring to its middle; the middles are numbered from `first`."""
    fans = [np.stack([ring[:, 1], ring[:, 0], np.full(len(ring), first + k)], 1) for k, ring in enumerate(rings)]
    return np.concatenate([np.zeros((0, 3), np.int64), *fans])
