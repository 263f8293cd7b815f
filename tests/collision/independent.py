"""How deep limbs lie in each other, without any code of the package: by numpy and trimesh.

A skinned `.npz` is posed by the formula of its format. A triangle belongs to the joint with the largest mean weight on
its corners. A vertex is inside a limb where the limb's surface, its holes closed by fans round their middles, has a
solid angle of more than half a sphere; it is as deep as the limb's skin (without the fans) is far. Vertices on the
common border of two limbs do not count, nor those within `FOLD` of it at rest.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray

FOLD = 0.08  # m


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """A body cut into limbs; pairs are all that are not joined in the tree."""

    names: list[str]
    faces: list[IntArray]  # of each limb
    vertices: list[IntArray]  # of each limb
    pairs: list[tuple[int, int]]
    exempt: dict[tuple[int, int], BoolArray]  # (inner, outer): which of the inner's vertices do not count


def cut(stored: Mapping[str, Any], *, fold: float = FOLD) -> Pieces:
    """Cut the body of a skinned `.npz`."""
    faces, weights = stored["faces"].astype(np.int64), stored["weights"].astype(np.float64)
    owner = weights[faces].mean(1).argmax(1)
    joints = sorted(set(owner.tolist()))
    parts = [faces[owner == joint] for joint in joints]
    vertices = [np.unique(part) for part in parts]
    pairs = [
        (a, b)
        for b in range(len(joints))
        for a in range(b)
        if joints[a] != _limb_above(stored, joints, joints[b]) and joints[b] != _limb_above(stored, joints, joints[a])
    ]
    rest = stored["vertices"].astype(np.float64)
    exempt = {}
    for a, b in [*pairs, *((b, a) for a, b in pairs)]:
        border = np.isin(vertices[a], vertices[b])
        near = _distances(rest, parts[b], rest[vertices[a]]) <= fold if border.any() and fold > 0 else border
        exempt[a, b] = border | near
    return Pieces([str(stored["joints"][joint]) for joint in joints], parts, vertices, pairs, exempt)


def posed(stored: Mapping[str, Any], frame: int) -> FloatArray:
    """(V, 3) m: sum_j w_j (R_j (v - rest_j) + p_j), with the rotations of the file."""
    turns = Rotation.from_quat(stored["rotations"][frame].astype(np.float64)).as_matrix()
    weights, rest = stored["weights"].astype(np.float64), stored["rest"].astype(np.float64)
    shift = stored["positions"][frame].astype(np.float64) - np.einsum("jab,jb->ja", turns, rest)
    moved = np.einsum("vj,jab,vb->va", weights, turns, stored["vertices"].astype(np.float64), optimize=True)
    return np.asarray(moved + weights @ shift)


def depths(pieces: Pieces, vertices: FloatArray) -> FloatArray:
    """(P,) m, the deepest vertex of either limb of each pair."""
    boxes = [(vertices[v].min(0), vertices[v].max(0)) for v in pieces.vertices]
    out = np.zeros(len(pieces.pairs))
    for p, (a, b) in enumerate(pieces.pairs):
        if (boxes[a][0] <= boxes[b][1]).all() and (boxes[b][0] <= boxes[a][1]).all():
            out[p] = max(_depth(pieces, vertices, a, b), _depth(pieces, vertices, b, a))
    return out


def rest_depths(stored: Mapping[str, Any], pieces: Pieces) -> FloatArray:
    """(P,) m at rest: what touches by construction."""
    return depths(pieces, stored["vertices"].astype(np.float64))


def _limb_above(stored: Mapping[str, Any], joints: list[int], joint: int) -> int:
    """The nearest joint above that owns triangles, or -1."""
    up = int(stored["parents"][joint])
    while up >= 0 and up not in joints:
        up = int(stored["parents"][up])
    return up


def _depth(pieces: Pieces, vertices: FloatArray, inner: int, outer: int) -> float:
    """How deep the deepest vertex of one limb is in another."""
    own = pieces.vertices[inner][~pieces.exempt[inner, outer]]
    low, high = vertices[pieces.vertices[outer]].min(0), vertices[pieces.vertices[outer]].max(0)
    own = own[((vertices[own] >= low) & (vertices[own] <= high)).all(1)]
    if not len(own):
        return 0.0
    points = vertices[own]
    inside = _turns_round(*_closed(vertices, pieces.faces[outer]), points) > 0.5
    return float(_distances(vertices, pieces.faces[outer], points[inside]).max()) if inside.any() else 0.0


def _closed(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """The surface with every hole closed by a fan round the middle of its ring; rings pass no vertex twice."""
    edges = {(int(f[i]), int(f[(i + 1) % 3])) for f in faces for i in range(3)}
    ahead = {a: [] for a, _ in edges}  # type: dict[int, list[int]]
    for a, b in edges:
        if (b, a) not in edges:
            ahead[a].append(b)
    points, fans = list(vertices), []
    while any(ahead.values()):
        ring = [next(a for a in sorted(ahead) if ahead[a])]
        while len(set(ring)) == len(ring):
            ring.append(ahead[ring[-1]].pop())
        tail = ring[: ring.index(ring[-1])]
        for a, b in zip(tail, [*tail[1:], ring[-1]], strict=False):
            ahead[a].append(b)
        ring = ring[len(tail) :]
        fans += [[len(points), ring[i + 1], ring[i]] for i in range(len(ring) - 1)]
        points.append(vertices[ring[:-1]].mean(0))
    return np.array(points), np.concatenate([faces, np.array(fans, np.int64).reshape(-1, 3)])


def _turns_round(vertices: FloatArray, faces: IntArray, points: FloatArray) -> FloatArray:
    """(N,) how often a closed surface goes round each point: solid angles (van Oosterom and Strackee) over 4 pi."""
    a, b, c = (vertices[faces[:, k]][None] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    volume = (a * np.cross(b, c)).sum(-1)
    below = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return np.asarray(np.arctan2(volume, below).sum(1) / (2 * np.pi))


def _distances(vertices: FloatArray, faces: IntArray, points: FloatArray) -> FloatArray:
    """(N,) m from a surface."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    return np.asarray(trimesh.proximity.closest_point(mesh, points)[1])
