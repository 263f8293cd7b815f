"""Ties: among chains that cost as good as the same, the one that stands deepest inside its solution groups.

Where a chain must change its pose, only the change costs, and it can often be made in many places of the lattice. So
with the best chain's turns every gauge that the lattice knows is tried, and at each the solutions of too little merit
are left out as long as some chain still costs as little.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mhvedit.geometry.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from mhvedit.optimise.chains import (
    Chain,
    StageCosts,
    change_of_offset,
    facing_cost,
    rows_of_yaws,
    with_best_turns,
    yaws_of,
)
from mhvedit.optimise.stages import THREADS
from mhvedit.optimise.steps import cheapest_step, exactly

TIE = 1e-3  # share of the cost that counts as nothing
ROUNDING = 1e-9  # m of merit, and share of the cost, that floating point may lose

Number = TypeVar("Number", bound=np.generic)


@dataclass(frozen=True, slots=True, eq=False)
class _Choices:
    """Solutions of every stage that a chain may take at one gauge."""

    gauge: float  # rad
    rows: tuple[IntArray, ...]
    unary: tuple[FloatArray, ...]  # m^2
    first: tuple[ComplexArray, ...]  # (N,) m, e at the first roots
    last: tuple[ComplexArray, ...]
    merit: tuple[FloatArray, ...]  # (N,) m


def deepest_chain(costs: Sequence[StageCosts], merits: Sequence[FloatArray], chain: Chain, *, n_yaw: int) -> Chain:
    """The chain of most merit among those that cost as much as the best one, then the one of the smallest poses.

    Args:
        costs: of all stages.
        merits: G of (S,) m, of each stage's solutions.
        chain: the best.
        n_yaw: yaw steps in a full turn.

    Returns:
        A chain with the bound of the best one.
    """
    allowed = chain.cost * (1 + TIE)
    own = most = min(float(merit[row]) for merit, row in zip(merits, chain.chosen, strict=True))
    deepest: _Choices | None = None

    def choices_at(step: int) -> _Choices | None:
        choices = _choices(costs, merits, chain, chain.gauge + step * 2 * np.pi / n_yaw, allowed, own)
        return None if choices is None else _within(choices, allowed)

    with ThreadPoolExecutor(THREADS) as pool:
        at_gauges = list(pool.map(choices_at, range(n_yaw)))
    for choices in at_gauges:
        least = most + ROUNDING if deepest else most
        deeper = None if choices is None else _deepest(_above(choices, least), allowed, least)
        if deeper is not None:
            most, deepest = deeper
    if deepest is None:
        return chain
    found = with_best_turns(costs, _smallest(deepest, allowed), deepest.gauge)
    if found.cost > allowed:
        return chain
    return Chain(found.chosen, found.turns, found.gauge, found.cost, min(chain.lower_bound, found.cost))


def _choices(
    costs: Sequence[StageCosts],
    merits: Sequence[FloatArray],
    chain: Chain,
    gauge: float,
    allowed: float,
    least: float,
) -> _Choices | None:
    """All solutions of enough merit that can be part of an allowed chain; None where a stage has none."""
    rows = []
    for stage, merit, turn in zip(costs, merits, chain.turns, strict=True):
        mismatch = yaws_of(stage) - gauge
        cheap = rows_of_yaws(stage, facing_cost(stage, mismatch, np.asarray(turn)) <= allowed)
        rows.append(np.sort(cheap[merit[cheap] >= least]))
        if len(rows[-1]) == 0:
            return None
    found = list(zip(costs, rows, chain.turns, strict=True))
    return _Choices(
        gauge=gauge,
        rows=tuple(rows),
        unary=tuple(facing_cost(stage, stage.yaws[row] - gauge, np.asarray(turn)) for stage, row, turn in found),
        first=tuple(change_of_offset(stage, row, np.asarray(turn), gauge, 0) for stage, row, turn in found),
        last=tuple(change_of_offset(stage, row, np.asarray(turn), gauge, -1) for stage, row, turn in found),
        merit=tuple(merit[row] for merit, row in zip(merits, rows, strict=True)),
    )


def _deepest(choices: _Choices, allowed: float, least: float) -> tuple[float, _Choices] | None:
    """The most merit that all solutions of an allowed chain can have; and who has it."""
    if not _possible(choices, allowed):
        return None
    levels = np.append(least, np.unique(np.concatenate(choices.merit)))
    low, high = 0, len(levels)  # the first is possible, the last is not
    while high - low > 1:
        middle = (low + high) // 2
        if _possible(_above(choices, levels[middle]), allowed):
            low = middle
        else:
            high = middle
    return float(levels[low]), _above(choices, levels[low])


def _above(choices: _Choices, least: float) -> _Choices:
    return _some(choices, [merit >= least for merit in choices.merit])


def _within(choices: _Choices, allowed: float) -> _Choices | None:
    """Those through which an allowed chain goes; None where there is none."""
    behind, so_far, limit = _behind(choices, allowed), choices.unary[0], allowed * (1 + ROUNDING)
    kept = [so_far + behind[0] <= limit]
    for g in range(1, len(choices.rows)):
        if not kept[-1].any():
            return None
        source, target = exactly(choices.last[g - 1]), exactly(choices.first[g])
        left = limit - choices.unary[g] - behind[g]
        so_far = choices.unary[g] + cheapest_step(so_far, source, target, left)[0]
        kept.append(so_far + behind[g] <= limit)
    return _some(choices, kept) if kept[-1].any() else None


def _some(choices: _Choices, wanted: Sequence[BoolArray]) -> _Choices:
    """Some of each stage's solutions."""
    kept = [np.flatnonzero(own) for own in wanted]

    def take(arrays: Sequence[NDArray[Number]]) -> tuple[NDArray[Number], ...]:
        return tuple(array[keep] for array, keep in zip(arrays, kept, strict=True))

    return _Choices(
        choices.gauge,
        take(choices.rows),
        take(choices.unary),
        take(choices.first),
        take(choices.last),
        take(choices.merit),
    )


def _possible(choices: _Choices, allowed: float) -> bool:
    if any(len(row) == 0 for row in choices.rows):
        return False
    return bool((choices.unary[0] + _behind(choices, allowed)[0]).min() <= allowed)


def _behind(choices: _Choices, allowed: float) -> list[FloatArray]:
    """What the cheapest chain costs behind each solution of each stage; infinite where it is more than allowed."""
    behind = [np.zeros(len(choices.rows[-1]))]
    for g in range(len(choices.rows) - 1, 0, -1):
        source, target = exactly(choices.first[g]), exactly(choices.last[g - 1])
        left = allowed - choices.unary[g - 1]
        behind.insert(0, cheapest_step(behind[0] + choices.unary[g], source, target, left)[0])
    return behind


def _smallest(choices: _Choices, allowed: float) -> IntArray:
    """Of the allowed chains the one whose first solution comes first, then the second, and so on."""
    behind = _behind(choices, allowed)
    so_far = choices.unary[0]
    within = max(allowed, float((so_far + behind[0]).min()) * (1 + ROUNDING))
    chosen: list[int] = []
    for g in range(len(choices.rows)):
        if g:
            step = choices.first[g] - choices.last[g - 1][chosen[-1]]
            so_far = so_far[chosen[-1]] + choices.unary[g] + 0.5 * np.abs(step) ** 2
        chosen.append(int(np.flatnonzero(so_far + behind[g] <= within * (1 + g * ROUNDING))[0]))
    return np.array([rows[i] for rows, i in zip(choices.rows, chosen, strict=True)])
