"""Large sets of solutions thinned to those that the best chain can be made of.

A chain of samples costs something; blocks of the pose lattice through which every chain costs more hold nothing of the
best one, nor of one that ties with it. What is left is sampled again, more closely, as long as that helps.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.optimise.blocks import block_map, marked
from mhvedit.optimise.branching import blocks_within
from mhvedit.optimise.chains import first_chain, stage_costs
from mhvedit.optimise.stages import Stage
from mhvedit.optimise.ties import TIE

SAMPLED = 20_000  # solutions of a stage among which a chain is looked for
ENOUGH = 100_000  # solutions of all stages that are not worth thinning
WORTHWHILE = 0.5  # share that is left after thinning, up to which it is done again
SPARE = 1e-6  # share of the cost that floating point may lose, and more


class Candidates(Protocol):
    """The solutions of one stage, of which nothing needs to be known but where they are: a `Stage`, or `Places`."""

    @property
    def keys(self) -> IntArray:
        """(S, 3) on the pose lattice."""

    @property
    def roots_a(self) -> FloatArray:
        """(n, 2) m, one a segment."""

    @property
    def roots_b(self) -> FloatArray:
        """(n, 2) m, one a segment."""


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where the solutions of one stage are."""

    keys: IntArray  # (S, 3) on the pose lattice
    roots_a: FloatArray  # (n, 2) m, one a segment
    roots_b: FloatArray  # (n, 2) m


def near_best(
    candidates: Sequence[Candidates], *, facing_weight: float, step: float, n_yaw: int, enough: int = ENOUGH
) -> list[IntArray]:
    """Which solutions the best chain, and those that tie with it, can be made of.

    Args:
        candidates: of all stages of a chain, none empty.
        facing_weight: lambda, m^2.
        step: of x and y between poses, m.
        n_yaw: yaw steps in a full turn.
        enough: solutions of all stages that are not worth thinning.

    Returns:
        (N,) rows of each stage, ascending; at least all of those.
    """
    rows = [np.arange(len(own.keys)) for own in candidates]
    cost = np.inf
    while (count := sum(map(len, rows))) > enough:
        sample = [_stage(own, some, step, n_yaw) for own, some in zip(candidates, rows, strict=True)]
        costs = stage_costs(sample, facing_weight=facing_weight)
        cost = min(cost, first_chain(costs).cost)
        maps = [block_map(own.keys, some) for own, some in zip(candidates, rows, strict=True)]
        alive = blocks_within(costs, maps, budget=cost * (1 + TIE) * (1 + SPARE), step=step, n_yaw=n_yaw)
        rows = [some[marked(own.keys, some, there, flags)]
                for own, some, there, flags in zip(candidates, rows, maps, alive, strict=True)]  # fmt: skip
        if sum(map(len, rows)) > WORTHWHILE * count:
            break
    return rows


def _stage(own: Candidates, rows: IntArray, step: float, n_yaw: int) -> Stage:
    """Some of the candidates, evenly."""
    keys = own.keys[rows[:: -(-len(rows) // SAMPLED)]]
    poses = np.column_stack([keys[:, :2] * step, keys[:, 2] * (2 * np.pi / n_yaw)])
    names = ("",) * len(own.roots_a)
    return Stage(names, keys, poses, np.zeros(len(keys)), own.roots_a, own.roots_b)
