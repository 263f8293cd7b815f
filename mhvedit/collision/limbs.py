"""Limbs: the triangles that follow each joint most, in a frame along the bone, with their holes capped (A3).

A limb is an open piece of the body's surface. To say what is inside it, every hole is closed by a fan of triangles
round the middle of its ring, wherever that is in a posture; two limbs that share a hole share its cap, so that
together they are closed without gap or overlap. (A fan from a corner of a bent hole, as the groin and the armpit have,
cuts into the limb on one side and bulges on the other.) Caps decide what is inside and nothing else: depth is
measured to the skin.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array

from mhvedit.collision.boxes import BoxTree, box_tree, refit_into
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray
from mhvedit.skeleton.model import Skeleton
from mhvedit.skeleton.roles import joint_roles
from mhvedit.skeleton.skin import SkinnedBody


class LimbArrays(NamedTuple):
    """All limbs, one after the other, as compiled code takes them."""

    joints: IntArray  # (L,) whose frame the limb follows
    axes: FloatArray  # (L, 3, 3) joint_from_box, the bone first
    vertex_start: IntArray  # (L + 1,)
    vertex: IntArray  # (N,) the body's vertex; one on the border of two limbs is there twice; -1: middle of a hole
    face_start: IntArray  # (L + 1,)
    faces: IntArray  # (F, 3) of the N, in the order of the boxes
    cap_start: IntArray  # (L + 1,)
    caps: IntArray  # (C, 3) of the N, the middle of the hole last
    root: IntArray  # (L,) the limb's box
    first: IntArray  # (M,) see BoxTree
    size: IntArray  # (M,)
    leaf: BoolArray  # (M,)
    centre: FloatArray  # (M, 3) m, boxes at rest, in their limbs' box frames
    half: FloatArray  # (M, 3) m


@dataclass(frozen=True, slots=True, eq=False)
class Limbs:
    """A body cut into limbs."""

    names: tuple[str, ...]  # L, of their joints
    arrays: LimbArrays
    local: FloatArray  # (N, 3) m, vertices in their limbs' box frames where q = 0 (A3.6)
    face_ids: IntArray  # (F,) which triangle of the body each is
    adjacent: BoolArray  # (L, L) joined in the tree, over joints without a limb too
    bordering: BoolArray  # (L, L) share vertices of the mesh

    @property
    def n_limbs(self) -> int:
        """L."""
        return len(self.names)


def limbs_of(body: SkinnedBody) -> Limbs:
    """Cut a body into limbs (A3.1): each triangle belongs to the joint with the largest weight on its corners.

    Raises:
        ShapeError: fewer than two joints own triangles.
    """
    owner = body.weights[body.faces].sum(1).argmax(1)
    joints = np.unique(owner)
    if len(joints) < 2:
        raise ShapeError("limbs", f"{len(joints)} joint that owns triangles", "at least 2")
    names = tuple(body.skeleton.names[j] for j in joints)
    faces = _outwards(body)
    pieces = [_Piece.cut(body, faces, np.flatnonzero(owner == joint), int(joint)) for joint in joints]
    arrays = _joined(joints, pieces)
    local = np.ascontiguousarray(np.concatenate([piece.local for piece in pieces]))
    refit_into(local, arrays.faces, arrays.first, arrays.size, arrays.leaf, arrays.centre, arrays.half)
    users = np.zeros((len(joints), len(body.vertices)), np.int64)
    for limb, piece in enumerate(pieces):
        users[limb, piece.vertex[piece.vertex >= 0]] = 1
    return Limbs(
        names,
        arrays,
        local,
        np.concatenate([piece.face_ids for piece in pieces]),
        _adjacent(body.skeleton, joints),
        (users @ users.T > 0) & ~np.eye(len(joints), dtype=np.bool_),
    )


def limb_index(limbs: Limbs, name: str) -> int:
    """Which limb follows a joint.

    Raises:
        ShapeError: none does; the message lists those that there are.
    """
    if name not in limbs.names:
        raise ShapeError("limb", repr(name), "one of " + ", ".join(limbs.names))
    return limbs.names.index(name)


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    """One limb before they are joined."""

    axes: FloatArray  # (3, 3)
    vertex: IntArray  # (n,) of the body, -1 for middles of holes
    local: FloatArray  # (n, 3) m
    faces: IntArray  # (f, 3) of the n
    caps: IntArray  # (c, 3) of the n
    face_ids: IntArray  # (f,)
    tree: BoxTree

    @classmethod
    def cut(cls, body: SkinnedBody, faces: Int32Array, mine: IntArray, joint: int) -> "_Piece":
        """The triangles of one limb."""
        vertex, index = np.unique(faces[mine], return_inverse=True)
        away = body.vertices[vertex] - body.skeleton.rest_positions[joint]
        axes = box_axes(bone_direction(body.skeleton, joint), away)
        corners = index.reshape(-1, 3)
        local = away @ axes
        tree = box_tree(local[corners])
        rings, caps = cap_faces(corners, len(vertex))
        middles = np.array([local[ring].mean(0) for ring in rings]).reshape(-1, 3)
        return cls(
            axes,
            np.concatenate([vertex, np.full(len(rings), -1)]).astype(np.int64),
            np.concatenate([local, middles]),
            corners[tree.order],
            caps,
            mine[tree.order],
            tree,
        )


def bone_direction(skeleton: Skeleton, joint: int) -> FloatArray:
    """(3,) unit direction of a limb's bone where q = 0.

    From the joint to its child; where two symmetric bones leave it (hips, shoulder girdle), the one bone that joins
    their ends (A3.4); of several children the farthest; of none, on from the parent.
    """
    roles = joint_roles(skeleton.names)
    children = np.flatnonzero(skeleton.parents == joint)
    sides = {roles[c]: c for c in children}
    for role, left in sides.items():
        right = sides.get(role.replace("left_", "right_")) if role.startswith("left_") else None
        if right is not None:
            return _unit(skeleton.offsets[left] - skeleton.offsets[right])
    if len(children):
        return _unit(max(skeleton.offsets[children], key=lambda offset: float(np.linalg.norm(offset))))
    return _unit(skeleton.offsets[joint])


def box_axes(bone: FloatArray, points: FloatArray) -> FloatArray:
    """The frame of a limb's boxes (A3.2): the bone, and the principal axes of the points seen along it.

    Args:
        bone: (3,) unit.
        points: (n, 3) m.

    Returns:
        (3, 3) columns, right-handed.
    """
    across = points - points.mean(0)
    across = across - np.outer(across @ bone, bone)
    _, vectors = np.linalg.eigh(across.T @ across + np.outer(bone, bone) * -1.0)  # the bone has the least value
    second = vectors[:, 2]
    second = second * np.sign(second[np.argmax(np.abs(second))])
    second = _unit(second - (second @ bone) * bone)
    return np.stack([bone, second, np.cross(bone, second)], 1)


def cap_faces(faces: IntArray, first: int) -> tuple[list[IntArray], IntArray]:
    """Triangles that close all holes: fans round the middles of the rings of open edges.

    Args:
        faces: (F, 3).
        first: number of the first middle.

    Returns:
        the corners of each ring, and (C, 3) triangles, the middle last.
    """
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    n = int(faces.max()) + 1
    balance = coo_array((np.ones(len(edges), np.int64), (edges[:, 0], edges[:, 1])), (n, n)).tocsr()
    difference = (balance - balance.T).tocoo()
    ends = np.stack([difference.row, difference.col], 1).astype(np.int64)
    ahead = np.repeat(ends, np.maximum(difference.data, 0), axis=0)  # there one way more often than back
    rings = _rings(ahead)
    fans = [np.stack([np.roll(ring, -1), ring, np.full(len(ring), first + k)], 1) for k, ring in enumerate(rings)]
    return rings, np.concatenate([np.zeros((0, 3), np.int64), *fans])


def _rings(edges: IntArray) -> list[IntArray]:
    """Directed edges (E, 2), as many into each corner as out of it, as rings that pass no corner twice.

    Holes that touch in one corner are two rings: the middle of both together can lie on the wrong side of the skin.
    """
    ahead: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        ahead.setdefault(a, []).append(b)
    rings, path = list[IntArray](), list[int]()
    while ahead:
        path = path or [next(iter(ahead))]
        after = ahead[path[-1]].pop()
        if not ahead[path[-1]]:
            del ahead[path[-1]]
        if after in path:
            start = path.index(after)
            rings.append(np.array(path[start:], np.int64))
            path = path[:start]
        if after in ahead:
            path.append(after)
    return rings


def _outwards(body: SkinnedBody) -> Int32Array:
    """The faces, turned round if the mesh is inside out."""
    a, b, c = (body.vertices[body.faces[:, k]] for k in range(3))
    inside_out = float((np.cross(a, b) * c).sum()) < 0
    return body.faces[:, ::-1] if inside_out else body.faces


def _adjacent(skeleton: Skeleton, joints: IntArray) -> BoolArray:
    """(L, L) limbs of which one is the nearest above the other."""
    out = np.zeros((len(joints), len(joints)), np.bool_)
    limb = {int(joint): i for i, joint in enumerate(joints)}
    for joint, i in limb.items():
        up = int(skeleton.parents[joint])
        while up >= 0 and up not in limb:
            up = int(skeleton.parents[up])
        if up >= 0:
            out[i, limb[up]] = out[limb[up], i] = True
    return out


def _joined(joints: IntArray, pieces: list[_Piece]) -> LimbArrays:
    """One array for all limbs of each kind."""
    vertex_start, face_start, cap_start, node_start = (
        np.cumsum([0, *sizes])
        for sizes in (
            [len(p.vertex) for p in pieces],
            [len(p.faces) for p in pieces],
            [len(p.caps) for p in pieces],
            [len(p.tree.first) for p in pieces],
        )
    )
    first = [p.tree.first + np.where(p.tree.leaf, face_start[i], node_start[i]) for i, p in enumerate(pieces)]
    return LimbArrays(
        joints.astype(np.int64),
        np.stack([p.axes for p in pieces]),
        vertex_start,
        np.concatenate([p.vertex for p in pieces]),
        face_start,
        np.concatenate([p.faces + vertex_start[i] for i, p in enumerate(pieces)]).astype(np.int64),
        cap_start,
        np.concatenate([p.caps + vertex_start[i] for i, p in enumerate(pieces)]).astype(np.int64),
        node_start[:-1],
        np.concatenate(first),
        np.concatenate([p.tree.size for p in pieces]),
        np.concatenate([p.tree.leaf for p in pieces]),
        np.empty((node_start[-1], 3)),
        np.empty((node_start[-1], 3)),
    )


def _unit(vector: FloatArray) -> FloatArray:
    """Of length 1; upwards if it has none."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
