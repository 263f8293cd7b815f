"""Ties: among chains that cost as good as the same, the one that stands deepest inside its solution groups.

Where a chain must change its pose, only the change costs, and it can often be made in many places of the lattice. So
with the best chain's turns every gauge that the lattice knows is tried, and at each the solutions of too little merit
are left out as long as some chain still costs as little.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.optimise.chains import Chain, StageCosts, change_of_offset, facing_cost, stage_costs, with_best_turns
from mhvedit.optimise.stages import Stage

TIE = 1e-3  # share of the cost that counts as nothing
ROUNDING = 1e-9  # m of merit, and share of the cost, that floating point may lose


@dataclass(frozen=True, slots=True, eq=False)
class _Choices:
    """Solutions of every stage that a chain may take at one gauge."""

    gauge: float  # rad
    rows: tuple[IntArray, ...]
    unary: tuple[FloatArray, ...]  # m^2
    first: tuple[FloatArray, ...]  # (N, 2) m, e at the first roots
    last: tuple[FloatArray, ...]


def deepest_chain(stages: Sequence[Stage], chain: Chain, *, facing_weight: float, n_yaw: int) -> Chain:
    """The chain of most merit among those that cost as much as the best one, then the one of the smallest poses.

    Args:
        stages: in order.
        chain: the best.
        facing_weight: lambda, m^2.
        n_yaw: yaw steps in a full turn.

    Returns:
        A chain with the bound of the best one.
    """
    costs = stage_costs(stages, facing_weight=facing_weight)
    allowed = chain.cost * (1 + TIE)
    merits = [stage.merit for stage in stages]
    most = min(float(merit[row]) for merit, row in zip(merits, chain.chosen, strict=True))
    deepest: _Choices | None = None
    for step in range(n_yaw):
        choices = _choices(costs, chain, chain.gauge + step * 2 * np.pi / n_yaw, allowed)
        deeper = _deepest(choices, merits, allowed, most + ROUNDING if deepest else most)
        if deeper is not None:
            most, deepest = deeper
    if deepest is None:
        return chain
    found = with_best_turns(costs, _smallest(deepest, allowed), deepest.gauge)
    if found.cost > allowed:
        return chain
    return Chain(found.chosen, found.turns, found.gauge, found.cost, min(chain.lower_bound, found.cost))


def _choices(costs: Sequence[StageCosts], chain: Chain, gauge: float, allowed: float) -> _Choices:
    rows, unary, first, last = [], [], [], []
    for stage, turn in zip(costs, chain.turns, strict=True):
        facing = facing_cost(stage, stage.yaws - gauge, np.asarray(turn))
        row = np.flatnonzero(facing <= allowed)
        turns = np.full(len(row), turn)
        rows.append(row)
        unary.append(facing[row])
        first.append(change_of_offset(stage, row, turns, gauge, 0))
        last.append(change_of_offset(stage, row, turns, gauge, -1))
    return _Choices(gauge, tuple(rows), tuple(unary), tuple(first), tuple(last))


def _deepest(
    choices: _Choices, merits: Sequence[FloatArray], allowed: float, least: float
) -> tuple[float, _Choices] | None:
    """The most merit (no less than `least`) that all solutions of an allowed chain can have; and who has it."""
    own = [merit[row] for merit, row in zip(merits, choices.rows, strict=True)]
    if min(merit.max(initial=-np.inf) for merit in own) < least:
        return None
    levels = np.unique(np.concatenate(own))
    levels = np.append(least, levels[levels > least])
    if not _possible(_above(choices, own, least), allowed):
        return None
    low, high = 0, len(levels)  # the first is possible, the last is not
    while high - low > 1:
        middle = (low + high) // 2
        if _possible(_above(choices, own, levels[middle]), allowed):
            low = middle
        else:
            high = middle
    return float(levels[low]), _above(choices, own, levels[low])


def _above(choices: _Choices, merits: Sequence[FloatArray], least: float) -> _Choices:
    kept = [np.flatnonzero(merit >= least) for merit in merits]

    def take(arrays: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
        return tuple(array[keep] for array, keep in zip(arrays, kept, strict=True))

    rows = tuple(row[keep] for row, keep in zip(choices.rows, kept, strict=True))
    return _Choices(choices.gauge, rows, take(choices.unary), take(choices.first), take(choices.last))


def _possible(choices: _Choices, allowed: float) -> bool:
    if any(len(row) == 0 for row in choices.rows):
        return False
    return bool((choices.unary[0] + _behind(choices)[0]).min() <= allowed)


def _behind(choices: _Choices) -> list[FloatArray]:
    """What the cheapest chain costs behind each solution of each stage."""
    behind = [np.zeros(len(choices.rows[-1]))]
    for g in range(len(choices.rows) - 1, 0, -1):
        value = behind[0] + choices.unary[g]
        tree = cKDTree(np.column_stack([choices.first[g], np.sqrt(2 * (value - value.min()))]))
        far, _ = tree.query(np.column_stack([choices.last[g - 1], np.zeros(len(choices.last[g - 1]))]))
        behind.insert(0, value.min() + 0.5 * far**2)
    return behind


def _smallest(choices: _Choices, allowed: float) -> IntArray:
    """Of the allowed chains the one whose first solution comes first, then the second, and so on."""
    behind = _behind(choices)
    so_far = choices.unary[0]
    within = max(allowed, float((so_far + behind[0]).min()) * (1 + ROUNDING))
    chosen: list[int] = []
    for g in range(len(choices.rows)):
        if g:
            step = choices.first[g] - choices.last[g - 1][chosen[-1]]
            so_far = so_far[chosen[-1]] + choices.unary[g] + 0.5 * (step**2).sum(1)
        chosen.append(int(np.flatnonzero(so_far + behind[g] <= within * (1 + g * ROUNDING))[0]))
    return np.array([rows[i] for rows, i in zip(choices.rows, chosen, strict=True)])
