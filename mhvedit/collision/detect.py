"""Self-collision of one posture and of a whole motion: which limbs, where, how deep (Liu et al., A4)."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.collision.kernels import BodyArrays, cross_all, crossings_of_pair, mark_fold, measure_all
from mhvedit.collision.limbs import Limbs, limbs_of
from mhvedit.collision.pairs import LimbPairs, non_adjacent_pairs
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray
from mhvedit.skeleton.model import Motion
from mhvedit.skeleton.skin import SkinnedBody, sparse_weights

FOLD: Final = 0.08  # m: skin that is this near to a limb that it borders on, at rest, may fold into it
TOLERANCE: Final = 0.005  # m: how much deeper than at rest two limbs may be before it is a collision (F5)
CHUNK: Final = 16  # frames that one thread does in one go


@dataclass(frozen=True, slots=True, eq=False)
class CollisionBody:
    """A body prepared for detection."""

    body: SkinnedBody
    limbs: Limbs
    pairs: LimbPairs
    arrays: BodyArrays
    rest_local: FloatArray  # (N, 3) m, limbs' vertices in their box frames at rest
    exempt: BoolArray  # (L, N) limbs' vertices that may lie inside a limb: they are on its border, or fold into it
    rest_depth: FloatArray  # (P,) m, of each pair where q = 0: what touches by construction


@dataclass(frozen=True, slots=True, eq=False)
class Depths:
    """All pairs in all frames."""

    crossing: BoolArray  # (T, P) surfaces cross
    depth: FloatArray  # (T, P) m, of the deepest vertex; 0 where none is inside
    vertex: Int32Array  # (T, P) of the body, the deepest; -1 where none is inside
    first_inside: BoolArray  # (T, P) that vertex is of the first limb, and inside the second
    point: FloatArray  # (T, P, 3) m, world: that vertex, or where surfaces cross; NaN where nothing touches
    normal: FloatArray  # (T, P, 3) unit, world: shortest way for the first limb out of the second


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """Pairs of limbs that touch, frame by frame (A4.7)."""

    frame: IntArray  # (K,) ascending
    pair: IntArray  # (K,) index into the pairs, ascending within a frame
    depth: FloatArray  # (K,) m
    excess: FloatArray  # (K,) m, deeper than at rest
    point: FloatArray  # (K, 3) m
    normal: FloatArray  # (K, 3) unit, shortest way for the first limb out of the second
    vertex: Int32Array  # (K,) of the body, -1 where surfaces cross and no vertex is inside


@dataclass(frozen=True, slots=True, eq=False)
class TriangleContacts:
    """Where the surfaces of one pair of limbs cross in one posture."""

    faces: IntArray  # (K, 2) triangles of the body, first limb's first
    segments: FloatArray  # (K, 2, 3) m, ends of what they have in common


def collision_body(body: SkinnedBody, *, pairs: LimbPairs | None = None) -> CollisionBody:
    """Prepare a body: limbs, boxes and depths at rest.

    Where two limbs share a border (arm and chest at the armpit, thigh and belly at the groin) skin folds whenever the
    joint between them bends, and no posture would be free of it. There, and only there, vertices that lie near the
    other limb at rest do not count.

    Args:
        body: skinned.
        pairs: which limbs to test; default all that are not adjacent.
    """
    limbs = limbs_of(body)
    chosen = non_adjacent_pairs(limbs) if pairs is None else pairs
    if chosen.limbs.size and chosen.limbs.max() >= limbs.n_limbs:
        raise ShapeError("pairs", int(chosen.limbs.max()), f"limbs 0 to {limbs.n_limbs - 1}")
    tree = body.skeleton
    arrays = BodyArrays(
        tree.parents,
        tree.offsets,
        tree.dof_joint,
        tree.dof_axis,
        tree.dof_slides,
        tree.rest_positions,
        body.vertices,
        *sparse_weights(body.weights),
    )
    exempt = _exempt(body, limbs)
    unrated = CollisionBody(body, limbs, chosen, arrays, limbs.local, exempt, np.zeros(len(chosen.limbs)))
    rest = measure_depths(unrated, np.zeros((1, tree.n_dofs)), workers=1).depth[0]
    return CollisionBody(body, limbs, chosen, arrays, limbs.local, exempt, rest)


def _exempt(body: SkinnedBody, limbs: Limbs) -> BoolArray:
    """(L, N) which vertices do not count inside which limb; middles of holes never do."""
    exempt = np.zeros((limbs.n_limbs, len(limbs.local)), np.bool_)
    places = body.skeleton.rest_positions[limbs.arrays.joints]
    for a, b in np.argwhere(limbs.bordering):
        mark_fold(limbs.arrays, limbs.local, places, a, b, FOLD, exempt[a])
    exempt[:, limbs.arrays.vertex < 0] = True
    return exempt


def detect_posture(body: CollisionBody, q: FloatArray) -> Contacts:
    """All pairs that touch in one posture; frame is 0.

    Args:
        body: prepared.
        q: (D,) rad or m.
    """
    return contacts_from(body, measure_depths(body, q[None], workers=1))


def detect_motion(body: CollisionBody, motion: Motion, *, workers: int | None = None) -> Contacts:
    """All pairs that touch in every frame.

    Args:
        body: prepared.
        motion: of its skeleton.
        workers: threads; default as many as there are processors. The result does not depend on it.
    """
    return contacts_from(body, measure_depths(body, motion.q, workers=workers))


def measure_depths(body: CollisionBody, q: FloatArray, *, rigid: bool = False, workers: int | None = None) -> Depths:
    """How deep every pair is in every posture.

    Args:
        body: prepared.
        q: (T, D) rad or m.
        rigid: limbs keep their shape at rest (A3.6) and are not skinned: faster, and coarse near the joints.
        workers: threads; default as many as there are processors.
    """
    if q.ndim != 2 or q.shape[1] != body.body.skeleton.n_dofs:
        raise ShapeError("q", q.shape, f"(T, {body.body.skeleton.n_dofs})")
    n, p = len(q), len(body.pairs.limbs)
    out = Depths(
        np.zeros((n, p), np.bool_),
        np.zeros((n, p)),
        np.full((n, p), -1, np.int32),
        np.zeros((n, p), np.bool_),
        np.full((n, p, 3), np.nan),
        np.full((n, p, 3), np.nan),
    )

    def measure(start: int) -> None:
        part = slice(start, start + CHUNK)
        measure_all(
            body.arrays,
            body.limbs.arrays,
            body.pairs.limbs,
            body.exempt,
            body.rest_local,
            np.ascontiguousarray(q[part], np.float64),
            rigid,
            out.crossing[part],
            out.depth[part],
            out.vertex[part],
            out.first_inside[part],
            out.point[part],
            out.normal[part],
        )

    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
        list(pool.map(measure, range(0, n, CHUNK)))
    return out


def contacts_from(body: CollisionBody, depths: Depths) -> Contacts:
    """What touches, as a list."""
    frame, pair = np.nonzero(depths.crossing | (depths.depth > 0))
    depth = depths.depth[frame, pair]
    return Contacts(
        frame,
        pair,
        depth,
        depth - body.rest_depth[pair],
        depths.point[frame, pair],
        depths.normal[frame, pair],
        depths.vertex[frame, pair],
    )


def collisions(contacts: Contacts, *, tolerance: float = TOLERANCE) -> Contacts:
    """The contacts that are deeper than at rest by more than a tolerance, m (F5)."""
    kept = contacts.excess > tolerance
    return Contacts(
        contacts.frame[kept],
        contacts.pair[kept],
        contacts.depth[kept],
        contacts.excess[kept],
        contacts.point[kept],
        contacts.normal[kept],
        contacts.vertex[kept],
    )


def surfaces_cross(body: CollisionBody, q: FloatArray, *, rigid: bool = False) -> BoolArray:
    """Whether surfaces cross: no depths, so much faster than `measure_depths`.

    Args:
        body: prepared.
        q: (T, D) rad or m.
        rigid: limbs keep their shape at rest (A3.6) and are not skinned.

    Returns:
        (T, P).
    """
    out = np.zeros((len(q), len(body.pairs.limbs)), np.bool_)
    postures = np.ascontiguousarray(q, np.float64)
    cross_all(body.arrays, body.limbs.arrays, body.pairs.limbs, body.rest_local, postures, rigid, out)
    return out


def triangle_contacts(body: CollisionBody, q: FloatArray, pair: int) -> TriangleContacts:
    """All triangles of a pair of limbs that meet in one posture, and where (A4.3, A4.7).

    Args:
        body: prepared.
        q: (D,) rad or m.
        pair: index into the body's pairs.
    """
    limbs, chosen = body.limbs, body.pairs.limbs[pair]
    wanted = 1024
    while True:
        faces, segments, n = np.empty((wanted, 2), np.int64), np.empty((wanted, 2, 3)), 0
        n = crossings_of_pair(
            body.arrays, limbs.arrays, chosen, body.rest_local, np.asarray(q, np.float64), faces, segments
        )
        if n < wanted:
            return TriangleContacts(limbs.face_ids[faces[:n]], segments[:n])
        wanted *= 4
