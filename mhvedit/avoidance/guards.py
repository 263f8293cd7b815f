"""What says whether a posture is free of collision: the limbs' meshes, or spheres (Degenhardt, 3.3)."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import shortest_path

from mhvedit.avoidance.constraints import ContactGaps, SkinPoints
from mhvedit.avoidance.correct import Found
from mhvedit.collision.detect import CollisionBody, Depths, collision_body, measure_depths
from mhvedit.collision.pairs import LimbPairs
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.skin import SkinnedBody, skinned_vertices

CARRIERS = 4  # joints that carry a point of the skin, at most


@dataclass(frozen=True, slots=True, eq=False)
class MeshGuard:
    """The skinned body's own limbs: no pair deeper than at rest and a little more."""

    body: CollisionBody
    allowed: float = 0.004  # m deeper than at rest; less than what is a collision, for other ways to measure
    aim: float = 0.001  # m deeper than at rest that corrections bring a pair to
    workers: int | None = None

    def excess(self, q: FloatArray) -> FloatArray:
        """(N,) m, how much deeper than allowed the worst pair is; at most 0 where free."""
        return np.asarray(self.pair_excess(q).max(1, initial=-np.inf))

    def pair_excess(self, q: FloatArray) -> FloatArray:
        """(N, P) m, of each pair."""
        depth = measure_depths(self.body, q, workers=self.workers).depth
        return np.asarray(depth - self.body.rest_depth - self.allowed)

    def look(self, q: FloatArray) -> Found:
        """The deepest vertex of each pair that is deeper than aimed for."""
        return self._found(measure_depths(self.body, q[None], workers=1), 0, q)

    def look_all(self, q: FloatArray) -> list[Found]:
        """The same for each of many postures (N, D)."""
        depths = measure_depths(self.body, q, workers=self.workers)
        return [self._found(depths, frame, posture) for frame, posture in enumerate(q)]

    def _found(self, depths: Depths, frame: int, q: FloatArray) -> Found:
        """What was measured in one posture (D,), as contacts."""
        body, over = self.body, depths.depth[frame] - self.body.rest_depth
        excess = float(over.max(initial=-np.inf)) - self.allowed
        pairs = np.flatnonzero((over > self.aim) & (depths.vertex[frame] >= 0))
        if len(pairs) == 0:
            return Found(excess, None)
        first = depths.first_inside[frame, pairs]
        normal = np.where(first[:, None], 1.0, -1.0) * depths.normal[frame, pairs]
        surface = depths.point[frame, pairs] + depths.depth[frame, pairs, None] * normal
        outer = np.where(first, body.pairs.limbs[pairs, 1], body.pairs.limbs[pairs, 0])
        rotations, positions = joint_frames(body.body.skeleton, q)
        turning = body.limbs.arrays.joints[outer]
        contacts = ContactGaps(
            skin_points(body.body, depths.vertex[frame, pairs].astype(np.int64)),
            _carried(body, outer, surface, rotations, positions),
            turning,
            np.einsum("kji,kj->ki", rotations[turning], normal),
            -(body.rest_depth[pairs] + self.aim),
        )
        return Found(excess, contacts)


def mesh_guard(body: SkinnedBody, *, nearest: int = 2, workers: int | None = None) -> MeshGuard:
    """The guard of a body.

    Args:
        body: skinned, with its equipment.
        nearest: limbs that are at least this many joints apart must not meet; 2 is all that are not adjacent.
        workers: threads of the detection.
    """
    ready = collision_body(body)
    if nearest > 2:
        far = _limb_distances(ready)[ready.pairs.limbs[:, 0], ready.pairs.limbs[:, 1]] >= nearest
        ready = collision_body(body, pairs=LimbPairs(ready.pairs.limbs[far]))
    return MeshGuard(ready, workers=workers)


def _limb_distances(body: CollisionBody) -> FloatArray:
    """(L, L) how many steps there are from limb to limb along the tree."""
    return np.asarray(shortest_path(body.limbs.adjacent.astype(np.float64), directed=False, unweighted=True))


def skin_points(body: SkinnedBody, vertices: IntArray) -> SkinPoints:
    """Vertices of the body, as what carries them."""
    joints, weights = _carriers(body, vertices)
    return SkinPoints(joints, weights, body.vertices[vertices][:, None] - body.skeleton.rest_positions[joints])


def _carried(
    body: CollisionBody, limbs: IntArray, points: FloatArray, rotations: FloatArray, positions: FloatArray
) -> SkinPoints:
    """Points on the skin of limbs, in the world, carried by what carries the vertex next to each."""
    vertices, arrays = skinned_vertices(body.body, rotations, positions), body.limbs.arrays
    near = np.empty(len(limbs), np.int64)
    for k, limb in enumerate(limbs):
        mine = arrays.vertex[arrays.vertex_start[limb] : arrays.vertex_start[limb + 1]]
        near[k] = mine[((vertices[mine] - points[k]) ** 2).sum(1).argmin()]
    joints, weights = _carriers(body.body, near)
    away = points[:, None] - positions[joints]
    return SkinPoints(joints, weights, np.einsum("kmji,kmj->kmi", rotations[joints], away))


def _carriers(body: SkinnedBody, vertices: IntArray) -> tuple[IntArray, FloatArray]:
    """(K, M) joints with the largest weights, and these, made to add up to 1."""
    weights = body.weights[vertices]
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :CARRIERS]
    chosen = np.take_along_axis(weights, joints, axis=1)
    return joints, chosen / chosen.sum(1, keepdims=True)
