"""A first chain: at gauges all around the cheapest of a few solutions of each stage, everybody turned to face best."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from typing import NamedTuple

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import ComplexArray, FloatArray, IntArray
from mhvedit.optimise.chains import Chain, StageCosts, polished, with_best_turns, yaws_of
from mhvedit.optimise.stages import THREADS

SAMPLE = 200  # solutions a stage
GAUGES = 45
NEAR = 0.0, float(np.radians(8))  # yaw against the gauge of solutions that may be taken, where there are any


class _Stages(NamedTuple):
    """All stages one after the other; a tuple, since kernels take it."""

    first_yaw: IntArray  # (G + 1,) where each stage's yaws start
    first_row: IntArray  # (K + 1,) where the solutions of each yaw start
    yaws: FloatArray  # (K,) rad
    shifts: ComplexArray  # (S,) m, as in `StageCosts`, those of one yaw together
    roots: ComplexArray  # (G, 4) m, of A first and last, of B first and last
    weights: FloatArray  # (G, 2) m^2, of A and B


def first_chain(stages: Sequence[StageCosts]) -> Chain:
    """A good chain to start from."""
    sampled = sampled_chain(stages)
    return polished(stages, sampled.chosen, sampled.gauge)


def sampled_chain(stages: Sequence[StageCosts]) -> Chain:
    """The best chain of samples, turned best.

    Args:
        stages: in order, none empty.
    """
    packed, yaws = _packed(stages), yaws_of(stages[0])
    tasks = np.array(list(product(yaws[:: -(-len(yaws) // GAUGES)].tolist(), NEAR)))
    with ThreadPoolExecutor(THREADS) as pool:
        parts = list(pool.map(lambda some: _cheapest_of_all(some, packed, SAMPLE), np.array_split(tasks, THREADS)))
    costs, chosen = (np.concatenate(column) for column in zip(*parts, strict=True))
    best = int(np.argmin(costs))
    rows = [stage.by_yaw[row] for stage, row in zip(stages, chosen[best], strict=True)]
    return with_best_turns(stages, np.array(rows, np.int64), float(tasks[best, 0]))


def _packed(stages: Sequence[StageCosts]) -> _Stages:
    rows = np.cumsum([0, *(len(stage.yaws) for stage in stages)])
    starts = [stage.yaw_starts[:-1] + row for stage, row in zip(stages, rows, strict=False)]
    return _Stages(
        first_yaw=np.cumsum([0, *map(len, starts)]),
        first_row=np.append(np.concatenate(starts), rows[-1]),
        yaws=np.concatenate([yaws_of(stage) for stage in stages]),
        shifts=np.concatenate([stage.shifts[stage.by_yaw] for stage in stages]),
        roots=np.array([[*stage.roots_a, *stage.roots_b] for stage in stages]),
        weights=np.array([[stage.weight_a, stage.weight_b] for stage in stages]),
    )


@njit(cache=True, nogil=True)
def _cheapest_of_all(tasks: FloatArray, stages: _Stages, most: int) -> tuple[FloatArray, IntArray]:
    """The cost of the cheapest chain of each sample, (T,) m^2, and which solutions it is of, (T, G) in their stages.

    Args:
        tasks: (T, 2) gauge, and how far from it yaws may be where there are any, rad.
        stages: all.
        most: solutions a stage.
    """
    n_stages = stages.weights.shape[0]
    costs, chosen = np.empty(tasks.shape[0]), np.empty((tasks.shape[0], n_stages), np.int64)
    back, rows = np.empty((n_stages, most), np.int64), np.empty((n_stages, most), np.int64)
    unary, first, last = np.empty(most), np.empty(most, np.complex128), np.empty(most, np.complex128)
    for t in range(tasks.shape[0]):
        gauge, near = tasks[t, 0], tasks[t, 1]
        value, left = np.zeros(1), np.zeros(1, np.complex128)
        for g in range(n_stages):
            count = _sample(stages, g, gauge, near, rows[g], unary, first, last)
            total = np.empty(count)
            for j in range(count):
                total[j] = np.inf
                for i in range(value.shape[0]):
                    way = first[j] - left[i] if g > 0 else 0j
                    cost = value[i] + 0.5 * (way.real * way.real + way.imag * way.imag)
                    if cost < total[j]:
                        total[j], back[g, j] = cost, i
                total[j] += unary[j]
            value, left = total, last[:count].copy()
        at = np.argmin(value)
        costs[t] = value[at]
        for g in range(n_stages - 1, -1, -1):
            chosen[t, g] = rows[g, at] - stages.first_row[stages.first_yaw[g]]
            at = back[g, at]
    return costs, chosen


@njit(cache=True, nogil=True)
def _sample(
    stages: _Stages,
    g: int,
    gauge: float,
    near: float,
    rows: IntArray,
    unary: FloatArray,
    first: ComplexArray,
    last: ComplexArray,
) -> int:
    """Some of a stage's solutions near a gauge, or nearest to it: which, facing costs and changes e; and how many."""
    start, stop = stages.first_yaw[g], stages.first_yaw[g + 1]
    away = np.abs((stages.yaws[start:stop] - gauge + np.pi) % (2 * np.pi) - np.pi)
    wanted, total = away <= max(near, away.min()), 0
    for k in range(start, stop):
        total += stages.first_row[k + 1] - stages.first_row[k] if wanted[k - start] else 0
    stride, passed, count = -(-total // rows.shape[0]), 0, 0
    kept = np.exp(1j * gauge) * stages.roots[g, 2:] - stages.roots[g, :2]
    for k in range(start, stop):
        if not wanted[k - start]:
            continue
        mismatch = stages.yaws[k] - gauge
        turn = -np.angle(stages.weights[g, 0] + stages.weights[g, 1] * np.exp(1j * mismatch))
        cost = stages.weights[g, 0] * (1 - np.cos(turn)) + stages.weights[g, 1] * (1 - np.cos(turn + mismatch))
        spin, arm = np.exp(1j * turn), np.exp(1j * stages.yaws[k]) * stages.roots[g, 2:] - stages.roots[g, :2]
        for row in range(stages.first_row[k] + -passed % stride, stages.first_row[k + 1], stride):
            rows[count], unary[count] = row, cost
            first[count] = spin * (stages.shifts[row] + arm[0]) - kept[0]
            last[count] = spin * (stages.shifts[row] + arm[1]) - kept[1]
            count += 1
        passed += stages.first_row[k + 1] - stages.first_row[k]
    return count
