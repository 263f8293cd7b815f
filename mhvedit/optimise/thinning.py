"""Large sets of solutions thinned to those that the best chain can be made of.

A chain of samples costs something, and less once it is improved among all solutions around its own. Blocks of the pose
lattice through which every chain costs more hold nothing of the best one, nor of one that ties with it.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.optimise.blocks import block_map, marked
from mhvedit.optimise.branching import SPARE, blocks_within
from mhvedit.optimise.chains import StageCosts, Start, chain_near, polished, stage_costs, start_of
from mhvedit.optimise.sampling import sampled_chain
from mhvedit.optimise.stages import THREADS, Stage
from mhvedit.optimise.ties import TIE
from mhvedit.search.poses import CellSet, cells_of_keys

SAMPLED = 20_000  # solutions of a stage among which a chain is looked for
ENOUGH = 100_000  # solutions of all stages that are not worth thinning
AROUND = 6, 6, 2  # steps of x, y and yaw, within which a chain is improved at a time
GAUGES_AROUND = -1, 0, 1  # steps of yaw from its gauge
MOST_ROUNDS = 20
WORTH_ANOTHER = 0.98  # share of the cost; what is improved by less is not improved again


@dataclass(frozen=True, slots=True)
class _Lattice:
    """What keys mean, and what turning costs."""

    facing_weight: float  # lambda, m^2
    step: float  # m
    n_yaw: int


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where the solutions of one stage are; nothing else needs to be known."""

    cells: CellSet
    roots_a: FloatArray  # (n, 2) m, one a segment
    roots_b: FloatArray  # (n, 2) m

    def __len__(self) -> int:
        return len(self.cells)


def places_of(stage: Stage) -> Places:
    """Where the solutions of a stage are."""
    return Places(cells_of_keys(stage.keys), stage.roots_a, stage.roots_b)


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
    if sum(map(len, places)) <= enough:
        return Near([np.arange(len(own)) for own in places], None)
    lattice = _Lattice(facing_weight, step, n_yaw)
    sample = _costs(places, [np.arange(0, len(own), -(-len(own) // SAMPLED)) for own in places], lattice)
    start, cost = _improved(places, start_of(sample, sampled_chain(sample)), lattice)
    with ThreadPoolExecutor(THREADS) as pool:
        maps = list(pool.map(lambda own: block_map(own.cells), places))
        alive = blocks_within(sample, maps, budget=cost * (1 + TIE) * (1 + SPARE), step=step, n_yaw=n_yaw)
        left = list(pool.map(lambda own, flags: np.flatnonzero(marked(own.cells, flags)), places, alive))
    return Near(left, start)


def _improved(places: Sequence[Places], start: Start, lattice: _Lattice) -> tuple[Start, float]:
    """A chain improved among all solutions around its own, at gauges around its own, again and again; and its cost."""
    cost = np.inf
    for _ in range(MOST_ROUNDS):
        around = [own.cells.rows_at(_around(key, lattice.n_yaw)) for own, key in zip(places, start.keys, strict=True)]
        costs = _costs(places, [np.unique(rows[rows >= 0]) for rows in around], lattice)
        gauges = [start.gauge + turn * 2 * np.pi / lattice.n_yaw for turn in GAUGES_AROUND]
        nearest = min((chain_near(costs, gauge) for gauge in gauges), key=lambda chain: chain.cost)
        found = polished(costs, nearest.chosen, nearest.gauge)
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


def _costs(places: Sequence[Places], rows: Sequence[IntArray], lattice: _Lattice) -> tuple[StageCosts, ...]:
    """Stages of some of the solutions."""
    stages = []
    for own, some in zip(places, rows, strict=True):
        keys = own.cells.keys(some)
        poses = np.column_stack([keys[:, :2] * lattice.step, keys[:, 2] * (2 * np.pi / lattice.n_yaw)])
        names = ("",) * len(own.roots_a)
        stages.append(Stage(names, keys, poses, np.zeros(len(keys)), own.roots_a, own.roots_b))
    return stage_costs(stages, facing_weight=lattice.facing_weight)
