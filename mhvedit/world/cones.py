"""Reach cones: where a limb may point, as a spherical polygon about the joint (Wilhelms and Van Gelder 2001; C3.5).

The polygon need not be convex: it is enough that all of it is seen from one point inside. That point and each edge make
a slice; in the slice that a direction is in, one triple product says on which side of the edge it lies.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit

from mhvedit.avoidance.posture import Placed, Rows
from mhvedit.files import load_table
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.model import Skeleton, joint_index
from mhvedit.world.descent import DescentSettings, Effector, descend
from mhvedit.world.materials import PACKAGE
from mhvedit.world.problems import WorldError

LEVER: Final = 0.1  # m: a limb that is off its cone by an angle counts as a point this far out that is off
INWARDS: Final = 1e-6  # how far inside the boundary a direction is put that was outside
_SETTINGS: Final = DescentSettings(tolerance=1e-7, sweeps=40)


@dataclass(frozen=True, slots=True, eq=False)
class ReachCone:
    """Where the limb at a joint may point."""

    joint: int
    limb: FloatArray  # (3,) unit, along the limb in the joint's frame
    polygon: FloatArray  # (N, 3) unit, in the parent's frame, anticlockwise seen from outside the sphere
    seen_from: FloatArray  # (3,) unit, inside, from where all of the polygon is seen

    def __post_init__(self) -> None:
        edges = np.cross(self.polygon, np.roll(self.polygon, -1, axis=0))
        unit = np.allclose(np.linalg.norm(self.polygon, axis=1), 1.0)
        if len(self.polygon) < 3 or not unit or (edges @ self.seen_from <= 0).any():
            raise WorldError(
                "reach cone",
                "a polygon of unit vectors, anticlockwise, all of whose edges are seen from the point inside",
                self.polygon.tolist(),
            )


def inside(cone: ReachCone, direction: FloatArray) -> bool:
    """Whether the limb may point there.

    Args:
        cone: of the joint.
        direction: (3,) unit, in the parent's frame.
    """
    return bool(_inside(cone.polygon, cone.seen_from, direction))


def nearest_inside(cone: ReachCone, direction: FloatArray) -> FloatArray:
    """(3,) unit: the direction itself, or the nearest point of the boundary.

    Args:
        cone: of the joint.
        direction: (3,) unit, in the parent's frame.
    """
    if inside(cone, direction):
        return direction
    corners, nexts = cone.polygon, np.roll(cone.polygon, -1, axis=0)
    planes = np.cross(corners, nexts)
    planes /= np.linalg.norm(planes, axis=1, keepdims=True)
    feet = direction - (planes @ direction)[:, None] * planes
    on_arc = (np.einsum("ij,ij->i", np.cross(corners, feet), planes) >= 0) & (
        np.einsum("ij,ij->i", np.cross(feet, nexts), planes) >= 0
    )
    lengths = np.linalg.norm(feet, axis=1, keepdims=True)
    feet = feet / np.maximum(lengths, 1e-12)
    candidates = np.concatenate([feet[on_arc & (lengths[:, 0] > 1e-12)], corners])
    best = candidates[int(np.argmax(candidates @ direction))]
    inwards = best + INWARDS * cone.seen_from
    return np.asarray(inwards / np.linalg.norm(inwards))


@dataclass(frozen=True, slots=True, eq=False)
class InCone:
    """A limb stays on the inner side of the nearby edge of its reach cone (a constraint of posture prediction)."""

    cone: ReachCone

    def rows(self, placed: Placed) -> Rows:
        """One row: the edge's plane, linearised."""
        cone, skeleton = self.cone, placed.skeleton
        row = np.zeros((1, skeleton.n_dofs))
        beyond = _cone_row(
            cone.polygon,
            cone.seen_from,
            cone.limb,
            placed.rotations[skeleton.parents[cone.joint]],
            placed.rotations[cone.joint],
            placed.axes,
            skeleton.dof_joint == cone.joint,
            row[0],
        )
        return Rows(row, np.array([beyond]), np.array([np.inf]))


def limb_direction(skeleton: Skeleton, q: FloatArray, cone: ReachCone) -> FloatArray:
    """(3,) unit, where a limb points, in its parent's frame."""
    rotations, _ = joint_frames(skeleton, q)
    up = int(skeleton.parents[cone.joint])
    return np.asarray(rotations[up].T @ rotations[cone.joint] @ cone.limb)


def into_cones(skeleton: Skeleton, q: FloatArray, cones: tuple[ReachCone, ...]) -> FloatArray:
    """(D,) the posture with limbs that have left their cones brought back to the nearest boundary point.

    The joint's own DOFs turn the limb there, within their limits, so that twist stays limited separately.
    """
    for cone in cones:
        wanted = nearest_inside(cone, limb_direction(skeleton, q, cone))
        rotations, positions = joint_frames(skeleton, q)
        up = int(skeleton.parents[cone.joint])
        goal = positions[cone.joint] + rotations[up] @ wanted
        own = np.flatnonzero(skeleton.dof_joint == cone.joint)[::-1]
        q = descend(skeleton, q, Effector(cone.joint, cone.limb, goal), own, settings=_SETTINGS).q
    return q


def leaves_cone(skeleton: Skeleton, rotations: FloatArray, cones: tuple[ReachCone, ...]) -> bool:
    """Whether a limb is outside its cone where joints have these rotations (J, 3, 3)."""
    for cone in cones:
        turned = rotations[cone.joint] @ cone.limb
        if not _inside(cone.polygon, cone.seen_from, turned @ rotations[skeleton.parents[cone.joint]]):
            return True
    return False


def load_cones(skeleton: Skeleton) -> tuple[ReachCone, ...]:
    """The package's cones for those joints that the skeleton has, by name."""
    found = []
    for row in load_table(PACKAGE, "reach_cones")["cones"]:
        for side, mirror in (("left", 1.0), ("right", -1.0)):
            name = f"{side}_{row['joint']}"
            if name not in skeleton.names:
                continue
            flip = np.array([mirror, 1.0, 1.0])
            corners = np.array(row["polygon"], np.float64) * flip
            polygon = np.ascontiguousarray(corners if mirror > 0 else corners[::-1])
            polygon /= np.linalg.norm(polygon, axis=1, keepdims=True)
            middle = np.array(row["seen_from"], np.float64) * flip
            limb = np.array(row["limb"], np.float64) * flip
            found.append(ReachCone(joint_index(skeleton, name), limb, polygon, middle / np.linalg.norm(middle)))
    return tuple(found)


@njit(cache=True, nogil=True)
def _inside(polygon: FloatArray, seen_from: FloatArray, direction: FloatArray) -> bool:
    """See `inside`: in the slice of an edge, and on the inner side of that edge."""
    normal = _edge(polygon, seen_from, direction)
    return bool(normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2] >= 0)


@njit(cache=True, nogil=True)
def _cone_row(
    polygon: FloatArray,
    seen_from: FloatArray,
    limb: FloatArray,
    up: FloatArray,
    turn: FloatArray,
    axes: FloatArray,
    own: BoolArray,
    row: FloatArray,
) -> float:
    """By how much a limb is beyond its edge, m at LEVER; writes how that changes with the joint's own DOFs."""
    direction = turn @ limb
    plane = up @ _edge(polygon, seen_from, up.T @ direction)
    for d in range(own.shape[0]):
        if own[d]:
            row[d] = LEVER * _triple(axes[d], direction, plane)
    return float(-LEVER * (plane @ direction))


@njit(cache=True, nogil=True)
def _edge(polygon: FloatArray, seen_from: FloatArray, direction: FloatArray) -> FloatArray:
    """See `limb_edge`; slices fill the sphere, whose far side is outside of all edges that do not reach round it."""
    n, chosen = polygon.shape[0], 0
    for i in range(n):
        corner, follower = polygon[i], polygon[(i + 1) % n]
        if _triple(seen_from, corner, direction) >= 0 and _triple(follower, seen_from, direction) >= 0:
            chosen = i
            break
    corner, follower = polygon[chosen], polygon[(chosen + 1) % n]
    normal = np.array(
        [
            corner[1] * follower[2] - corner[2] * follower[1],
            corner[2] * follower[0] - corner[0] * follower[2],
            corner[0] * follower[1] - corner[1] * follower[0],
        ]
    )
    return np.asarray(normal / np.sqrt((normal**2).sum()))


@njit(cache=True, nogil=True)
def _triple(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    """(a x b) . c."""
    return float(
        (a[1] * b[2] - a[2] * b[1]) * c[0] + (a[2] * b[0] - a[0] * b[2]) * c[1] + (a[0] * b[1] - a[1] * b[0]) * c[2]
    )
