"""Large sets of solutions thinned to those that the best chain can be made of.

A chain of samples costs something; blocks of the pose lattice through which every chain costs more hold nothing of the
best one, nor of one that ties with it. What is left is sampled again, more closely, as long as that helps.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.optimise.blocks import BlockMap, KeysAt, block_map, marked
from mhvedit.optimise.branching import blocks_within
from mhvedit.optimise.chains import Start, first_chain, stage_costs, start_of
from mhvedit.optimise.stages import THREADS, Stage
from mhvedit.optimise.ties import TIE

SAMPLED = 20_000  # solutions of a stage among which a chain is looked for
ENOUGH = 100_000  # solutions of all stages that are not worth thinning
WORTHWHILE = 0.5  # share that is left after thinning, up to which it is done again
SPARE = 1e-6  # share of the cost that floating point may lose, and more


class Candidates(Protocol):
    """The solutions of one stage, of which nothing needs to be known but where they are: a `Stage`, or `Places`."""

    def __len__(self) -> int:
        """How many there are."""

    def keys_at(self, rows: IntArray) -> IntArray:
        """(N, 3) on the pose lattice, of (N,) rows."""

    @property
    def roots_a(self) -> FloatArray:
        """(n, 2) m, one a segment."""

    @property
    def roots_b(self) -> FloatArray:
        """(n, 2) m, one a segment."""


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where the solutions of one stage are; which keys they have is found out where it is asked for."""

    count: int
    find_keys: KeysAt
    roots_a: FloatArray  # (n, 2) m, one a segment
    roots_b: FloatArray  # (n, 2) m

    def __len__(self) -> int:
        return self.count

    def keys_at(self, rows: IntArray) -> IntArray:
        """(N, 3) on the pose lattice, of (N,) rows."""
        return self.find_keys(rows)


@dataclass(frozen=True, slots=True, eq=False)
class Near:
    """What the best chain, and those that tie with it, can be made of."""

    rows: list[IntArray]  # (N,) of each stage, ascending; at least all of those
    start: Start | None  # a good chain of these; None where nothing was thinned


def near_best(
    candidates: Sequence[Candidates], *, facing_weight: float, step: float, n_yaw: int, enough: int = ENOUGH
) -> Near:
    """Which solutions the best chain can be made of.

    Args:
        candidates: of all stages of a chain, none empty.
        facing_weight: lambda, m^2.
        step: of x and y between poses, m.
        n_yaw: yaw steps in a full turn.
        enough: solutions of all stages that are not worth thinning.
    """
    rows = [np.arange(len(own)) for own in candidates]
    cost, start = np.inf, None
    with ThreadPoolExecutor(THREADS) as pool:
        while (count := sum(map(len, rows))) > enough:
            sample = [_stage(own, some, step, n_yaw) for own, some in zip(candidates, rows, strict=True)]
            costs = stage_costs(sample, facing_weight=facing_weight)
            chain = first_chain(costs)
            if chain.cost < cost:
                cost, start = chain.cost, start_of(costs, chain)
            maps = list(pool.map(lambda own, some: block_map(own.keys_at, some), candidates, rows))
            alive = blocks_within(costs, maps, budget=cost * (1 + TIE) * (1 + SPARE), step=step, n_yaw=n_yaw)
            rows = list(pool.map(_rows_within, candidates, rows, maps, alive))
            if sum(map(len, rows)) > WORTHWHILE * count:
                break
    return Near(rows, start)


def _rows_within(own: Candidates, rows: IntArray, blocks: BlockMap, flags: BoolArray) -> IntArray:
    """Those of some rows that are in flagged blocks."""
    return rows[marked(own.keys_at, rows, blocks, flags)]


def _stage(own: Candidates, rows: IntArray, step: float, n_yaw: int) -> Stage:
    """Some of the candidates, evenly."""
    keys = own.keys_at(rows[:: -(-len(rows) // SAMPLED)])
    poses = np.column_stack([keys[:, :2] * step, keys[:, 2] * (2 * np.pi / n_yaw)])
    names = ("",) * len(own.roots_a)
    return Stage(names, keys, poses, np.zeros(len(keys)), own.roots_a, own.roots_b)
