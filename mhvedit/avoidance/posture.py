"""Posture prediction: the posture nearest to the captured one that meets all constraints (Degenhardt, 2.3 and 3.2).

Minimise sum gamma_i (q_i - q_i^captured)^2 (eq. 2.5) under joint limits and constraints, by sequential quadratic
programming: constraints are linearised where the posture is, of the many inequalities only those within reach of a step
enter, and the small dense quadratic programme goes to an active-set solver. A constraint is anything that can say how
its values change with the DOFs and between which bounds they have to lie; constraints.py has a number of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import daqp
import numpy as np

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array
from mhvedit.skeleton.forward import forward_axes_into
from mhvedit.skeleton.model import Skeleton

_SOFT = 8  # daqp: the row may be violated at a price


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A skeleton in one posture: what constraints are computed from."""

    skeleton: Skeleton
    q: FloatArray  # (D,) rad or m
    rotations: FloatArray  # (J, 3, 3) world_from_joint
    positions: FloatArray  # (J, 3) m
    axes: FloatArray  # (D, 3) axes of the DOFs in the world


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Constraints about one posture: low <= jacobian @ change <= high; met where low <= 0 <= high."""

    jacobian: FloatArray  # (M, D) m per rad or m
    low: FloatArray  # (M,) m, -inf where there is none
    high: FloatArray  # (M,) m, inf where there is none

    @property
    def violation(self) -> float:
        """By how much the worst row is missed, m."""
        return float(np.maximum(self.low, -self.high).max(initial=0.0))


class Constraint(Protocol):
    """What a posture has to meet."""

    def rows(self, placed: Placed) -> Rows:
        """Linearised at a posture; rows that no step can reach may be left out."""


@dataclass(frozen=True, slots=True)
class PostureSettings:
    """How hard to try."""

    tolerance: float = 5e-4  # m: a constraint is met
    still: float = 1e-4  # rad or m: a step so small ends the search
    trust: float = 0.3  # rad or m: largest step of a DOF
    iterations: int = 25


@dataclass(frozen=True, slots=True, eq=False)
class Posture:
    """A predicted posture."""

    q: FloatArray  # (D,) rad or m
    violation: float  # m, of the worst constraint
    effort: float  # sum gamma (q - captured)^2
    iterations: int
    converged: bool


def place(skeleton: Skeleton, q: FloatArray) -> Placed:
    """Forward kinematics of one posture, with the axes that every Jacobian is made of."""
    n = skeleton.n_joints
    rotations, positions, axes = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((skeleton.n_dofs, 3))
    forward_axes_into(
        skeleton.parents,
        skeleton.offsets,
        skeleton.dof_joint,
        skeleton.dof_axis,
        skeleton.dof_slides,
        q,
        rotations,
        positions,
        axes,
    )
    return Placed(skeleton, q, rotations, positions, axes)


def no_rows(n_dofs: int) -> Rows:
    """Nothing to meet."""
    return Rows(np.zeros((0, n_dofs)), np.zeros(0), np.zeros(0))


def limits_around(limits: FloatArray, captured: FloatArray) -> FloatArray:
    """(..., D, 2) joint limits, widened where the captured posture itself is outside: it may stay, not go further."""
    return np.stack([np.minimum(limits[:, 0], captured), np.maximum(limits[:, 1], captured)], -1)


def effort(weights: FloatArray, q: FloatArray, captured: FloatArray) -> float:
    """Sum gamma_i (q_i - q_i^captured)^2 (Degenhardt, eq. 2.5)."""
    return float(weights @ (q - captured) ** 2)


def predict_posture(
    skeleton: Skeleton,
    captured: FloatArray,
    constraints: Sequence[Constraint],
    *,
    start: FloatArray | None = None,
    weights: FloatArray | None = None,
    free: BoolArray | None = None,
    limits: FloatArray | None = None,
    settings: PostureSettings | None = None,
) -> Posture:
    """The posture of least effort that meets the constraints (Degenhardt, section 2.3).

    Args:
        skeleton: the tree.
        captured: (D,) what the effort is counted from, rad or m.
        constraints: all that has to be met.
        start: (D,) where to begin; the captured posture by default. It decides on which side limbs pass.
        weights: (D,) gamma; 1 by default.
        free: (D,) DOFs that may change; all by default.
        limits: (D, 2) rad or m; the skeleton's, widened by the captured posture, by default.
        settings: of the search.

    Returns:
        The best posture found, and whether it meets the constraints.
    """
    chosen = settings or PostureSettings()
    n = skeleton.n_dofs
    gamma = np.ones(n) if weights is None else np.maximum(weights, 1e-6)
    moves = np.flatnonzero(np.ones(n, np.bool_) if free is None else free)
    bounds = limits_around(skeleton.limits, captured) if limits is None else limits
    for name, array, shape in (("captured", captured, (n,)), ("weights", gamma, (n,)), ("limits", bounds, (n, 2))):
        if array.shape != shape:
            raise ShapeError(name, array.shape, shape)
    problem = _Problem(gamma[moves], captured[moves], bounds[moves])
    q = (captured if start is None else start).astype(np.float64, copy=True)
    q[moves] = np.clip(q[moves], bounds[moves, 0], bounds[moves, 1])
    rows = _gather(skeleton, q, constraints)
    best, least, trust, used = q, rows.violation, chosen.trust, 0
    while used < chosen.iterations:
        used += 1
        step = _step(problem, q[moves], Rows(rows.jacobian[:, moves], rows.low, rows.high), trust)
        q = q.copy()
        q[moves] += step
        before, rows = rows.violation, _gather(skeleton, q, constraints)
        size = float(np.abs(step).max(initial=0.0))
        if rows.violation <= max(least, chosen.tolerance):
            best, least = q, rows.violation
        if size < chosen.still or (rows.violation <= chosen.tolerance and size < 20 * chosen.still):
            break
        if rows.violation > max(before, chosen.tolerance):
            trust *= 0.5
    cost = effort(gamma, best, captured)
    return Posture(best, least, cost, used, least <= chosen.tolerance)


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """What stays the same in all steps: the DOFs that move, in their order."""

    weights: FloatArray  # (F,)
    captured: FloatArray  # (F,)
    limits: FloatArray  # (F, 2)


def _gather(skeleton: Skeleton, q: FloatArray, constraints: Sequence[Constraint]) -> Rows:
    """The rows of all constraints."""
    placed = place(skeleton, q)
    parts = [constraint.rows(placed) for constraint in constraints]
    if len(parts) == 1:
        return parts[0]
    if not parts:
        return no_rows(len(q))
    return Rows(
        np.concatenate([part.jacobian for part in parts]),
        np.concatenate([part.low for part in parts]),
        np.concatenate([part.high for part in parts]),
    )


def _step(problem: _Problem, q: FloatArray, rows: Rows, trust: float) -> FloatArray:
    """(F,) solution of the quadratic programme; where it has none, of the one whose rows may be violated at a price."""
    n = len(q)
    low, high = np.maximum(problem.limits[:, 0] - q, -trust), np.minimum(problem.limits[:, 1] - q, trust)
    upper, lower = np.concatenate([high, rows.high]), np.concatenate([low, rows.low])
    root = np.sqrt(problem.weights)
    # in x = sqrt(gamma) dq the cost is |x - x_captured|^2
    pull = root * (q - problem.captured)
    matrix = np.ascontiguousarray(rows.jacobian / root)
    upper[:n] *= root
    lower[:n] *= root
    sense = np.zeros(n + len(rows.low), np.int32)
    x, good = _solve(pull, matrix, upper, lower, sense)
    if not good:
        sense[n:] = _SOFT
        x, _ = _solve(pull, matrix, upper, lower, sense)
    return np.asarray(np.clip(x / root, low, high))


def _solve(
    pull: FloatArray, matrix: FloatArray, upper: FloatArray, lower: FloatArray, sense: Int32Array
) -> tuple[FloatArray, bool]:
    """Minimise |x|^2 / 2 + pull x between bounds."""
    identity = np.eye(len(pull))
    x, _, flag, _ = daqp.solve(identity, pull, matrix, upper, lower, sense, rho_soft=1e-6)
    return np.asarray(x, np.float64), flag > 0
