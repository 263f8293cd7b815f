"""Large sets of solutions thinned to those that the best chain can be made of.

A chain of samples costs something, and less once it is improved among all solutions around its own. Blocks of the pose
lattice through which every chain costs more hold nothing of the best one, nor of one that ties with it.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.lookup import rows_in
from mhvedit.optimise.blocks import BlockMap, KeysAt, block_map, marked
from mhvedit.optimise.branching import SPARE, blocks_within
from mhvedit.optimise.chains import StageCosts, Start, chain_from, chain_near, sampled_chain, stage_costs, start_of
from mhvedit.optimise.stages import THREADS, Stage, pose_codes
from mhvedit.optimise.ties import TIE

SAMPLED = 20_000  # solutions of a stage among which a chain is looked for
ENOUGH = 100_000  # solutions of all stages that are not worth thinning
AROUND = 6, 6, 2  # steps of x, y and yaw, within which a chain is improved at a time
GAUGES_AROUND = -1.0, -0.5, 0.0, 0.5, 1.0  # steps of yaw from its gauge
MOST_ROUNDS = 20
WORTH_ANOTHER = 0.98  # share of the cost; what is improved by less is not improved again
RowsAt = Callable[[IntArray], IntArray]


@dataclass(frozen=True, slots=True)
class _Lattice:
    """What keys mean, and what turning costs."""

    facing_weight: float  # lambda, m^2
    step: float  # m
    n_yaw: int


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where the solutions of one stage are; nothing else needs to be known, and that only where it is asked for."""

    count: int
    keys_at: KeysAt  # (N, 3) on the pose lattice, of (N,) rows
    rows_at: RowsAt  # (N,) of (N, 3) places on the lattice, -1 where there is no solution
    roots_a: FloatArray  # (n, 2) m, one a segment
    roots_b: FloatArray  # (n, 2) m

    def __len__(self) -> int:
        return self.count


def places_of(stage: Stage) -> Places:
    """Where the solutions of a stage are."""
    codes = pose_codes(stage.keys)
    return Places(
        len(stage),
        keys_at=lambda rows: stage.keys[rows],
        rows_at=lambda keys: rows_in(codes, pose_codes(keys)),
        roots_a=stage.roots_a,
        roots_b=stage.roots_b,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Near:
    """What the best chain, and those that tie with it, can be made of."""

    rows: list[IntArray]  # (N,) of each stage, ascending; at least all of those
    start: Start | None  # a good chain of these; None where nothing was thinned


def near_best(places: Sequence[Places], *, facing_weight: float, step: float, n_yaw: int, enough: int = ENOUGH) -> Near:
    """Which solutions the best chain can be made of.

    Args:
        places: of all stages of a chain, none empty.
        facing_weight: lambda, m^2.
        step: of x and y between poses, m.
        n_yaw: yaw steps in a full turn.
        enough: solutions of all stages that are not worth thinning.
    """
    rows = [np.arange(len(own)) for own in places]
    if sum(map(len, rows)) <= enough:
        return Near(rows, None)
    lattice = _Lattice(facing_weight, step, n_yaw)
    sample = _costs(places, [own[:: -(-len(own) // SAMPLED)] for own in rows], lattice)
    start, cost = _improved(places, start_of(sample, sampled_chain(sample)), lattice)
    with ThreadPoolExecutor(THREADS) as pool:
        maps = list(pool.map(lambda own, some: block_map(own.keys_at, some), places, rows))
        alive = blocks_within(sample, maps, budget=cost * (1 + TIE) * (1 + SPARE), step=step, n_yaw=n_yaw)
        left = list(pool.map(_rows_within, places, rows, maps, alive))
    return Near(left, start)


def _improved(places: Sequence[Places], start: Start, lattice: _Lattice) -> tuple[Start, float]:
    """A chain improved among all solutions around its own, at gauges around its own, again and again; and its cost."""
    cost = np.inf
    for _ in range(MOST_ROUNDS):
        around = [own.rows_at(_around(key, lattice.n_yaw)) for own, key in zip(places, start.keys, strict=True)]
        costs = _costs(places, [np.unique(rows[rows >= 0]) for rows in around], lattice)
        gauges = [start.gauge + turn * 2 * np.pi / lattice.n_yaw for turn in GAUGES_AROUND]
        found = min([chain_from(costs, start), *(chain_near(costs, gauge) for gauge in gauges)], key=lambda c: c.cost)
        if found.cost < cost:
            start = start_of(costs, found)
        if found.cost >= cost * WORTH_ANOTHER:
            break
        cost = found.cost
    return start, min(cost, found.cost)


def _around(key: IntArray, n_yaw: int) -> IntArray:
    """(N, 3) the lattice around a place."""
    sides = [np.arange(-most, most + 1) for most in AROUND]
    keys = key + np.stack(np.meshgrid(*sides, indexing="ij"), -1).reshape(-1, 3)
    keys[:, 2] %= n_yaw
    return keys


def _rows_within(own: Places, rows: IntArray, blocks: BlockMap, flags: BoolArray) -> IntArray:
    """Those of some rows that are in flagged blocks."""
    return rows[marked(own.keys_at, rows, blocks, flags)]


def _costs(places: Sequence[Places], rows: Sequence[IntArray], lattice: _Lattice) -> tuple[StageCosts, ...]:
    """Stages of some of the solutions."""
    stages = []
    for own, some in zip(places, rows, strict=True):
        keys = own.keys_at(some)
        poses = np.column_stack([keys[:, :2] * lattice.step, keys[:, 2] * (2 * np.pi / lattice.n_yaw)])
        names = ("",) * len(own.roots_a)
        stages.append(Stage(names, keys, poses, np.zeros(len(keys)), own.roots_a, own.roots_b))
    return stage_costs(stages, facing_weight=lattice.facing_weight)
