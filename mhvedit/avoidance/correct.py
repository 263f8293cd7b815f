"""One posture made free of collision: predict, look at the real surfaces again, add what they still show, repeat.

Spheres give the thesis's posture prediction its gradients; whether a posture is free is for the meshes to say. So what
a guard finds on the true surfaces is linearised as constraints and the prediction is run again, until it finds nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from mhvedit.avoidance.constraints import ContactGaps
from mhvedit.avoidance.posture import Constraint, Posture, PostureSettings, effort, place, predict_posture
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.skeleton.model import Skeleton

ROUNDS = 16  # of prediction and looking again
MEMORY = 4  # rounds whose contacts still count: older ones were linearised too far away
LONG_MEMORY = 10  # where thin limbs are pushed to and fro, more have to be remembered


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What a guard sees in one posture."""

    excess: float  # m: deepest over what is allowed; at most 0 where the posture is free
    contacts: ContactGaps | None  # what is deeper than the guard aims for, asked to come out that far


class Guard(Protocol):
    """Says whether postures are free of collision; the truth that avoidance is measured by."""

    @property
    def allowed(self) -> float:
        """How much deeper than at rest a pair may be, m."""

    def excess(self, q: FloatArray) -> FloatArray:
        """(N,) m, how much deeper than allowed the worst pair of each posture (N, D) is; at most 0 where free."""

    def look(self, q: FloatArray) -> Found:
        """What is deeper than aimed for in one posture (D,)."""

    def look_all(self, q: FloatArray) -> list[Found]:
        """What is deeper than aimed for in each posture (N, D)."""


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """What correction may move, and at which price."""

    skeleton: Skeleton
    weights: FloatArray  # (D,) gamma
    free: BoolArray  # (D,)
    guard: Guard
    settings: PostureSettings = field(default_factory=PostureSettings)


def correct_posture(
    body: Body,
    captured: FloatArray,
    *,
    start: FloatArray | None = None,
    constraints: Sequence[Constraint] = (),
    limits: FloatArray | None = None,
    memory: int = MEMORY,
) -> Posture:
    """The posture near the captured one in which the guard finds nothing too deep.

    Args:
        body: what may move.
        captured: (D,) rad or m.
        start: (D,) where to begin; the captured posture by default.
        constraints: what else has to be met.
        limits: (D, 2) rad or m.
        memory: rounds whose contacts still count.

    Returns:
        The posture in which nothing is deeper than aimed for, else the best that was seen.
    """
    q = captured if start is None else start
    seen: list[Constraint] = []
    best, least, used = q, np.inf, 0
    for _ in range(ROUNDS):
        found = body.guard.look(q)
        missed = task_violation(body, q, constraints) - body.settings.tolerance
        worst = max(found.excess, missed)
        if worst < least:
            best, least = q, worst
        if found.contacts is None and missed <= 0:
            break
        if found.contacts is not None:
            seen.append(found.contacts)
        posture = predict_posture(
            body.skeleton,
            captured,
            [*constraints, *seen[-memory:]],
            start=q,
            weights=body.weights,
            free=body.free,
            limits=limits,
            settings=body.settings,
        )
        q, used = posture.q, used + posture.iterations
    return Posture(best, max(least, 0.0), effort(body.weights, best, captured), used, least <= 0)


def task_violation(body: Body, q: FloatArray, constraints: Sequence[Constraint]) -> float:
    """By how much the worst of some constraints is missed, m."""
    placed = place(body.skeleton, q)
    return max((constraint.rows(placed).violation for constraint in constraints), default=0.0)
