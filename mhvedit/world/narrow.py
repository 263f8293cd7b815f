"""How far apart or how deep inside each other two convex pieces are: GJK and EPA, through coal."""

from dataclasses import dataclass
from typing import Any, Final

import coal
import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.world.broad import Colliders, near_pairs
from mhvedit.world.pieces import Piece

PATCH: Final = 8  # most points of a contact patch that are kept


@dataclass(frozen=True, slots=True, eq=False)
class Gaps:
    """Signed distances between pairs of pieces."""

    pairs: IntArray  # (K, 2) pieces a and b
    distance: FloatArray  # (K,) m, negative where they overlap: then minus the penetration depth
    normal: FloatArray  # (K, 3) unit, out of b into a
    at_a: FloatArray  # (K, 3) m, the nearest or deepest point of a, world
    at_b: FloatArray  # (K, 3) m

    @property
    def deepest(self) -> float:
        """Depth of the deepest overlap, m; 0 where there is none."""
        return float(np.maximum(-self.distance, 0.0).max(initial=0.0))


def only(gaps: Gaps, which: IntArray) -> Gaps:
    """Some of the pairs."""
    return Gaps(gaps.pairs[which], gaps.distance[which], gaps.normal[which], gaps.at_a[which], gaps.at_b[which])


class Narrow:
    """Exact queries between the pieces of a world; holds coal's shapes, which cannot be shared between threads."""

    def __init__(self, colliders: Colliders) -> None:
        self.colliders = colliders
        shapes = [_shape(piece) for piece in colliders.pieces]
        self._shapes = [shape for shape, _, _ in shapes]
        self._turns = np.array([turn for _, turn, _ in shapes])
        self._middles = np.array([middle for _, _, middle in shapes])
        self._places = [coal.Transform3s() for _ in shapes]
        self._ask, self._found = coal.DistanceRequest(), coal.DistanceResult()
        self._touch, self._touching = coal.CollisionRequest(), coal.CollisionResult()
        self._patch, self._patches = coal.ContactPatchRequest(), coal.ContactPatchResult()

    def near(self, rotations: FloatArray, positions: FloatArray, *, reach: float) -> Gaps:
        """Gaps of all pairs that may meet and are nearer than `reach`.

        Args:
            rotations: (F, 3, 3) world_from_frame of all frames.
            positions: (F, 3) m.
            reach: m.
        """
        found = self.gaps(near_pairs(self.colliders, rotations, positions, reach=reach), rotations, positions)
        close = found.distance < reach
        return found if close.all() else only(found, np.flatnonzero(close))

    def gaps(self, pairs: IntArray, rotations: FloatArray, positions: FloatArray) -> Gaps:
        """Gaps of given pairs.

        Args:
            pairs: (K, 2) pieces.
            rotations: (F, 3, 3) world_from_frame.
            positions: (F, 3) m.
        """
        self._put(pairs, rotations, positions)
        rows = np.empty((len(pairs), 10))
        ask, found, shapes, places = self._ask, self._found, self._shapes, self._places
        for k, (a, b) in enumerate(pairs.tolist()):
            found.clear()
            rows[k, 0] = coal.distance(shapes[a], places[a], shapes[b], places[b], ask, found)
            rows[k, 1:4] = found.normal
            rows[k, 4:7] = found.getNearestPoint1()
            rows[k, 7:10] = found.getNearestPoint2()
        return Gaps(pairs, rows[:, 0], -rows[:, 1:4], rows[:, 4:7], rows[:, 7:10])

    def patches(
        self, pairs: IntArray, rotations: FloatArray, positions: FloatArray, *, reach: float
    ) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
        """Points where pairs of pieces touch, so many that a solid stands on them.

        Args:
            pairs: (K, 2) pieces.
            rotations: (F, 3, 3) world_from_frame.
            positions: (F, 3) m.
            reach: m, distance up to which pieces count as touching.

        Returns:
            (N,) row of `pairs`, (N, 3) m points in the world, (N, 3) unit normals out of b into a, and (N,) m gaps.
        """
        self._put(pairs, rotations, positions)
        self._touch.security_margin = reach
        rows, points, normals, gaps = list[int](), list[FloatArray](), list[FloatArray](), list[float]()
        for k, (a, b) in enumerate(pairs.tolist()):
            where = (self._shapes[a], self._places[a], self._shapes[b], self._places[b])
            self._touching.clear()
            if not coal.collide(*where, self._touch, self._touching):
                continue
            contact = self._touching.getContact(0)
            for point in self._patch_points(where) or [contact.pos]:
                rows.append(k)
                points.append(np.array(point))
                normals.append(-np.array(contact.normal))
                gaps.append(float(contact.penetration_depth))
        n = len(rows)
        return np.array(rows, np.int64), np.reshape(points, (n, 3)), np.reshape(normals, (n, 3)), np.array(gaps)

    def _patch_points(self, where: tuple[Any, ...]) -> list[FloatArray]:
        """Corners of the flat common to two touching pieces."""
        self._patches.clear()
        coal.computeContactPatch(*where, self._touching, self._patch, self._patches)
        if not self._patches.numContactPatches():
            return []
        patch = self._patches.getContactPatch(0)
        points = [patch.getPoint(i) for i in range(patch.size())]
        return points if len(points) <= PATCH else [points[len(points) * i // PATCH] for i in range(PATCH)]

    def _put(self, pairs: IntArray, rotations: FloatArray, positions: FloatArray) -> None:
        """Move coal's copies of the pieces in question to where they are."""
        used = np.unique(pairs)
        carrier = self.colliders.carrier[used]
        turns = rotations[carrier] @ self._turns[used]
        middles = (rotations[carrier] @ self._middles[used][:, :, None])[..., 0] + positions[carrier]
        places = self._places
        for piece, turn, middle in zip(used.tolist(), turns, middles, strict=True):
            places[piece].setRotation(turn)
            places[piece].setTranslation(middle)


def _shape(piece: Piece) -> tuple[Any, FloatArray, FloatArray]:
    """Coal's shape, and its frame (3, 3), (3,) m in that of the piece."""
    middle = piece.points.mean(0)
    if len(piece.points) == 1:
        return coal.Sphere(piece.radius), np.eye(3), middle
    if len(piece.points) == 2:
        along = piece.points[1] - piece.points[0]
        length = float(np.linalg.norm(along))
        return coal.Capsule(piece.radius, length), _turn_to(along / length), middle
    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in piece.points - middle:
        corners.append(point)
    for face in piece.faces.tolist():
        triangles.append(coal.Triangle(*face))
    return coal.Convex(corners, triangles), np.eye(3), middle


def _turn_to(axis: FloatArray) -> FloatArray:
    """(3, 3) a rotation that takes z to a unit vector."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    across = np.cross(helper, axis)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(axis, across), axis], 1)
