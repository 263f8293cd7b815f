"""A figure among bodies: which of its pieces touch what in a posture, and how the gaps change with the posture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.avoidance.posture import Placed, Rows, place
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.forward import point_jacobian_into
from mhvedit.world.bodies import Body
from mhvedit.world.broad import colliders_of
from mhvedit.world.figure import Figure
from mhvedit.world.narrow import Gaps, Narrow


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Where rigid bodies are."""

    rotations: FloatArray  # (B, 3, 3) world_from_body
    positions: FloatArray  # (B, 3) m


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A posture, and the gaps round it."""

    placed: Placed
    gaps: Gaps
    joints: IntArray  # (K, 2) joint of each side of a gap; -1 for a body


class Surroundings:
    """Looks at gaps between a figure, itself and rigid bodies; holds coal's shapes, so one for each thread."""

    def __init__(self, figure: Figure, bodies: Sequence[Body]) -> None:
        self.figure, self.bodies = figure, tuple(bodies)
        pieces = [piece for body in bodies for piece in body.pieces]
        self._body_of = np.repeat(np.arange(len(bodies)), [len(body.pieces) for body in bodies])
        n_own, n_other = len(figure.pieces), len(pieces)
        may_meet = np.zeros((n_other + n_own, n_other + n_own), np.bool_)
        may_meet[n_other:, :n_other] = may_meet[:n_other, n_other:] = True
        may_meet[n_other:, n_other:] = figure.self_pairs
        carrier = np.concatenate([self._body_of, len(bodies) + figure.joint])
        self._joint_of = np.concatenate([np.full(n_other, -1), figure.joint])
        self._narrow = Narrow(colliders_of((*pieces, *figure.pieces), carrier, may_meet))
        n = len(bodies) + figure.skeleton.n_joints
        self._rotations, self._positions = np.empty((n, 3, 3)), np.empty((n, 3))
        self.looks = 0

    def look(self, q: FloatArray, frames: Frames, *, reach: float) -> Seen:
        """All gaps of a posture that are smaller than `reach`.

        Args:
            q: (D,) rad or m.
            frames: of the bodies.
            reach: m.
        """
        return self.look_placed(place(self.figure.skeleton, q), frames, reach=reach)

    def look_placed(self, placed: Placed, frames: Frames, *, reach: float) -> Seen:
        """The same for a posture that has been placed."""
        self.looks += 1
        n = len(self.bodies)
        self._rotations[:n], self._positions[:n] = frames.rotations, frames.positions
        self._rotations[n:], self._positions[n:] = placed.rotations, placed.positions
        gaps = self._narrow.near(self._rotations, self._positions, reach=reach)
        return Seen(placed, gaps, self._joint_of[gaps.pairs])

    def name(self, piece: int) -> str:
        """What a piece belongs to."""
        joint = int(self._joint_of[piece])
        return self.figure.skeleton.names[joint] if joint >= 0 else self.bodies[self._body_of[piece]].name


def gap_rows(seen: Seen, which: IntArray) -> FloatArray:
    """(K, D) how the chosen gaps change with the DOFs, m per rad or m."""
    skeleton, gaps = seen.placed.skeleton, seen.gaps
    tree = (skeleton.parents, skeleton.dof_joint, skeleton.dof_slides, seen.placed.positions, seen.placed.axes)
    return np.asarray(
        _gap_rows(tree, seen.joints[which], gaps.normal[which], gaps.at_a[which], gaps.at_b[which], skeleton.n_dofs)
    )


@dataclass(frozen=True, slots=True, eq=False)
class PieceGaps:
    """All pieces stay a margin apart (a constraint of posture prediction)."""

    surroundings: Surroundings
    frames: Frames
    margin: float  # m
    reach: float  # m beyond the margin; farther pairs are left out

    def rows(self, placed: Placed) -> Rows:
        """One row a gap."""
        seen = self.surroundings.look_placed(placed, self.frames, reach=self.margin + self.reach)
        n = len(seen.gaps.distance)
        jacobian = gap_rows(seen, np.arange(n))
        return Rows(jacobian, self.margin - seen.gaps.distance, np.full(n, np.inf))


Tree = tuple[IntArray, IntArray, BoolArray, FloatArray, FloatArray]


@njit(cache=True, nogil=True)
def _gap_rows(
    tree: Tree, joints: IntArray, normal: FloatArray, at_a: FloatArray, at_b: FloatArray, n_dofs: int
) -> FloatArray:
    """See `gap_rows`."""
    parents, dof_joint, dof_slides, positions, axes = tree
    rows, one = np.zeros((normal.shape[0], n_dofs)), np.empty((3, n_dofs))
    for k in range(normal.shape[0]):
        for side in range(2):
            if joints[k, side] < 0:
                continue
            at, sign = (at_a[k], 1.0) if side == 0 else (at_b[k], -1.0)
            point_jacobian_into(parents, dof_joint, dof_slides, positions, axes, joints[k, side], at, one)
            for d in range(n_dofs):
                rows[k, d] += sign * (normal[k, 0] * one[0, d] + normal[k, 1] * one[1, d] + normal[k, 2] * one[2, d])
    return rows
