"""What a posture can be asked to meet: targets, planes, directions, gaps between limbs (Degenhardt, 2.3 and 3.4)."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.avoidance.posture import Placed, Rows
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray

LEVER = 0.1  # m: a direction that is off by an angle counts as a point this far out that is off


@dataclass(frozen=True, slots=True, eq=False)
class PointTargets:
    """Points on limbs are at places in the world, or not far from them."""

    joints: IntArray  # (K,) that carry the points
    points: FloatArray  # (K, 3) m, in the joints' frames
    targets: FloatArray  # (K, 3) m
    slack: FloatArray  # (K,) m along each axis

    def __post_init__(self) -> None:
        shape = (len(self.joints), 3)
        if self.points.shape != shape or self.targets.shape != shape or self.slack.shape != self.joints.shape:
            raise ShapeError("targets", self.targets.shape, shape)

    def rows(self, placed: Placed) -> Rows:
        """One row for each point and axis."""
        n, turned = len(self.joints), np.einsum("kij,kj->ki", placed.rotations[self.joints], self.points)
        at = turned + placed.positions[self.joints]
        off, slack = (self.targets - at).ravel(), np.repeat(self.slack, 3)
        axes, joints = np.tile(np.eye(3), (n, 1)), np.repeat(self.joints, 3)
        jacobian = _rows(placed, np.arange(3 * n), joints, np.repeat(at, 3, axis=0), np.ones(3 * n), axes)
        return Rows(jacobian, off - slack, off + slack)


@dataclass(frozen=True, slots=True, eq=False)
class BodyPointTarget:
    """A point on a limb is at a point on another limb."""

    joint: int
    point: FloatArray  # (3,) m, in the joint's frame
    other: int
    other_point: FloatArray  # (3,) m, in the other joint's frame

    def rows(self, placed: Placed) -> Rows:
        """Three equalities."""
        at, there = world_point(placed, self.joint, self.point), world_point(placed, self.other, self.other_point)
        off = there - at
        return Rows(point_rows(placed, self.joint, at) - point_rows(placed, self.other, there), off, off)


@dataclass(frozen=True, slots=True, eq=False)
class PlaneTarget:
    """A point on a limb is on an unbounded plane (Degenhardt, eq. 3.3: n (x - p) = 0)."""

    joint: int
    point: FloatArray  # (3,) m, in the joint's frame
    origin: FloatArray  # (3,) m, on the plane
    normal: FloatArray  # (3,) unit

    def rows(self, placed: Placed) -> Rows:
        """One equality."""
        at = world_point(placed, self.joint, self.point)
        off = np.array([self.normal @ (self.origin - at)])
        return Rows(self.normal[None] @ point_rows(placed, self.joint, at), off, off)


@dataclass(frozen=True, slots=True, eq=False)
class DirectionTarget:
    """A direction on a limb is a direction on another limb; in the world where `other` is -1."""

    joint: int
    direction: FloatArray  # (3,) unit, in the joint's frame
    other: int
    other_direction: FloatArray  # (3,) unit, in the other joint's frame

    def rows(self, placed: Placed) -> Rows:
        """Three equalities, in metres at the end of a lever."""
        here = placed.rotations[self.joint] @ self.direction
        jacobian = _turned_rows(placed, self.joint, here)
        there = self.other_direction
        if self.other >= 0:
            there = placed.rotations[self.other] @ self.other_direction
            jacobian = jacobian - _turned_rows(placed, self.other, there)
        off = LEVER * (there - here)
        return Rows(LEVER * jacobian, off, off)


@dataclass(frozen=True, slots=True, eq=False)
class SphereGaps:
    """Pairs of spheres stay apart (Degenhardt, 2.3: |c_a - c_b| >= r_a + r_b)."""

    joints: IntArray  # (S,) that carry the spheres
    centres: FloatArray  # (S, 3) m, in the joints' frames
    radii: FloatArray  # (S,) m
    pairs: IntArray  # (P, 2)
    margin: float = 0.0  # m, on top of the radii
    reach: float = 0.08  # m: pairs further apart than this cannot meet in one step

    def __post_init__(self) -> None:
        if self.pairs.ndim != 2 or self.pairs.shape[1] != 2:
            raise ShapeError("sphere pairs", self.pairs.shape, "(P, 2)")
        if self.centres.shape != (len(self.joints), 3) or self.radii.shape != self.joints.shape:
            raise ShapeError("sphere centres", self.centres.shape, (len(self.joints), 3))

    def rows(self, placed: Placed) -> Rows:
        """One inequality for each pair that is near."""
        skeleton = placed.skeleton
        low, jacobian = _sphere_rows(
            (skeleton.parents, skeleton.dof_joint, skeleton.dof_slides, placed.positions, placed.axes),
            placed.rotations,
            self.joints,
            self.centres,
            self.radii,
            self.pairs,
            self.margin,
            self.reach,
        )
        return Rows(jacobian, low, np.full(len(low), np.inf))


@dataclass(frozen=True, slots=True, eq=False)
class SkinPoints:
    """Points of a skin: each is carried by several joints, as linear blend skinning does."""

    joints: IntArray  # (K, M)
    weights: FloatArray  # (K, M), each row sums to 1
    points: FloatArray  # (K, M, 3) m, the point in the frame of each joint at rest

    def __post_init__(self) -> None:
        if self.weights.shape != self.joints.shape or self.points.shape != (*self.joints.shape, 3):
            raise ShapeError("skin points", self.points.shape, (*self.joints.shape, 3))

    def terms(self, placed: Placed) -> FloatArray:
        """(K, M, 3) m, where each joint alone would have the points."""
        turned = np.einsum("kmij,kmj->kmi", placed.rotations[self.joints], self.points)
        return np.asarray(turned + placed.positions[self.joints])


@dataclass(frozen=True, slots=True, eq=False)
class ContactGaps:
    """Points of the skin stay outside of planes that move with it: contacts of the meshes, linearised."""

    points: SkinPoints  # K points of one limb
    surface: SkinPoints  # K points of the other limb, where each is to come out
    joints: IntArray  # (K,) that turn the normals
    normals: FloatArray  # (K, 3) unit, out of the other limb, in the frames of those joints
    gaps: FloatArray  # (K,) m: least n (point - surface); negative where some depth is allowed
    reach: float = 0.08  # m: what is further outside cannot come in during one step

    def rows(self, placed: Placed) -> Rows:
        """One inequality for each contact that is near."""
        low, normals, _ = self.missing(placed)
        at, there = self.points.terms(placed), self.surface.terms(placed)
        near = np.flatnonzero(low > -self.reach)
        n_terms = self.points.joints.shape[1] + self.surface.joints.shape[1]
        jacobian = _rows(
            placed,
            np.repeat(np.arange(len(near)), n_terms),
            np.concatenate([self.points.joints[near], self.surface.joints[near]], 1).ravel(),
            np.concatenate([at[near], there[near]], 1).reshape(-1, 3),
            np.concatenate([self.points.weights[near], -self.surface.weights[near]], 1).ravel(),
            normals[near],
        )
        return Rows(jacobian, low[near], np.full(len(near), np.inf))

    def missing(self, placed: Placed) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What is missing at each contact (K,) m, its normal (K, 3) and its point (K, 3) m, in the world."""
        at = (self.points.weights[..., None] * self.points.terms(placed)).sum(1)
        there = (self.surface.weights[..., None] * self.surface.terms(placed)).sum(1)
        normals = np.einsum("kij,kj->ki", placed.rotations[self.joints], self.normals)
        return self.gaps - (normals * (at - there)).sum(1), normals, at


def world_point(placed: Placed, joint: int, point: FloatArray) -> FloatArray:
    """(3,) m, where a point on a limb is."""
    return np.asarray(placed.rotations[joint] @ point + placed.positions[joint])


def point_rows(placed: Placed, joint: int, at: FloatArray) -> FloatArray:
    """(3, D) how a point in the world that moves with a joint changes with the DOFs."""
    three = np.arange(3)
    return _rows(placed, three, np.full(3, joint), np.repeat(at[None], 3, axis=0), np.ones(3), np.eye(3))


def _turned_rows(placed: Placed, joint: int, direction: FloatArray) -> FloatArray:
    """(3, D) how a direction in the world that turns with a joint changes with the DOFs."""
    at = placed.positions[joint]
    return point_rows(placed, joint, at + direction) - point_rows(placed, joint, at)


def _rows(
    placed: Placed, rows: IntArray, joints: IntArray, at: FloatArray, scales: FloatArray, normals: FloatArray
) -> FloatArray:
    """(K, D) derivative of the sum of scaled n x over terms.

    Args:
        placed: the posture.
        rows: (N,) row that each term belongs to.
        joints: (N,) that carries its point.
        at: (N, 3) m, where the point is.
        scales: (N,) factor.
        normals: (K, 3) n of each row.
    """
    skeleton = placed.skeleton
    tree = (skeleton.parents, skeleton.dof_joint, skeleton.dof_slides, placed.positions, placed.axes)
    return np.asarray(_gather_rows(tree, rows, joints, np.ascontiguousarray(at), scales, normals))


Tree = tuple[IntArray, IntArray, BoolArray, FloatArray, FloatArray]


@njit(cache=True, nogil=True)
def _sphere_rows(
    tree: Tree,
    rotations: FloatArray,
    joints: IntArray,
    centres: FloatArray,
    radii: FloatArray,
    pairs: IntArray,
    margin: float,
    reach: float,
) -> tuple[FloatArray, FloatArray]:
    """What is missing between near pairs (K,) m, and the derivative of their distances (K, D)."""
    positions = tree[3]
    at = np.empty((joints.shape[0], 3))
    for s in range(joints.shape[0]):
        for r in range(3):
            at[s, r] = positions[joints[s], r]
            for c in range(3):
                at[s, r] += rotations[joints[s], r, c] * centres[s, c]
    near, missing = np.empty(pairs.shape[0], np.int64), np.empty(pairs.shape[0])
    found = 0
    for p in range(pairs.shape[0]):
        a, b = pairs[p, 0], pairs[p, 1]
        square = (at[a, 0] - at[b, 0]) ** 2 + (at[a, 1] - at[b, 1]) ** 2 + (at[a, 2] - at[b, 2]) ** 2
        wanted = radii[a] + radii[b] + margin
        if square < (wanted + reach) ** 2:
            near[found], missing[found] = p, wanted - np.sqrt(square)
            found += 1
    jacobian, normal = np.zeros((found, tree[1].shape[0])), np.empty(3)
    for k in range(found):
        a, b = pairs[near[k], 0], pairs[near[k], 1]
        length = np.sqrt(((at[a] - at[b]) ** 2).sum())
        for r in range(3):
            normal[r] = (at[a, r] - at[b, r]) / length if length > 1e-9 else (1.0 if r == 2 else 0.0)
        _add_term(tree, joints[a], at[a], normal, 1.0, jacobian[k])
        _add_term(tree, joints[b], at[b], normal, -1.0, jacobian[k])
    return missing[:found].copy(), jacobian


@njit(cache=True, nogil=True)
def _gather_rows(
    tree: Tree, rows: IntArray, joints: IntArray, at: FloatArray, scales: FloatArray, normals: FloatArray
) -> FloatArray:
    """See `_rows`."""
    jacobian = np.zeros((normals.shape[0], tree[1].shape[0]))
    for i in range(rows.shape[0]):
        if scales[i] != 0.0:
            _add_term(tree, joints[i], at[i], normals[rows[i]], scales[i], jacobian[rows[i]])
    return jacobian


@njit(cache=True, nogil=True)
def _add_term(tree: Tree, joint: int, at: FloatArray, normal: FloatArray, scale: float, row: FloatArray) -> None:
    """Add how far a point that moves with a joint goes along a direction with each DOF."""
    parents, dof_joint, dof_slides, positions, axes = tree
    d = dof_joint.shape[0] - 1
    while joint >= 0:
        x, y, z = at[0] - positions[joint, 0], at[1] - positions[joint, 1], at[2] - positions[joint, 2]
        while d >= 0 and dof_joint[d] > joint:
            d -= 1
        while d >= 0 and dof_joint[d] == joint:
            a, b, c = axes[d, 0], axes[d, 1], axes[d, 2]
            if dof_slides[d]:
                row[d] += scale * (normal[0] * a + normal[1] * b + normal[2] * c)
            else:
                turned = normal[0] * (b * z - c * y) + normal[1] * (c * x - a * z) + normal[2] * (a * y - b * x)
                row[d] += scale * turned
            d -= 1
        joint = parents[joint]
