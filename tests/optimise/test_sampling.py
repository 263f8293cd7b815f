import numpy as np
import pytest

from mhvedit.geometry.arrays import IntArray
from mhvedit.optimise.chains import (
    StageCosts,
    chain_cost,
    change_of_offset,
    cheapest_chain,
    cheapest_turn,
    facing_cost,
    stage_costs,
    with_best_turns,
)
from mhvedit.optimise.sampling import _cheapest_of_all, _packed, first_chain, sampled_chain
from tests.optimise.problems import problem


def plain_sample(stage: StageCosts, gauge: float, near: float, most: int) -> IntArray:
    """Rows of some of the solutions near a gauge, or nearest to it, in the order of their yaws."""
    away = np.abs((stage.yaws - gauge + np.pi) % (2 * np.pi) - np.pi)
    rows = stage.by_yaw[away[stage.by_yaw] <= max(near, away.min())]
    return np.asarray(rows[:: -(-len(rows) // most)], np.int64)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("adjoins", [[False] * 3, [True, False, False]])
def test_each_sample_holds_no_cheaper_chain(seed: int, adjoins: list[bool]) -> None:
    """Beside the same recursion of matrices in NumPy."""
    costs = stage_costs(problem(seed, count=4, size=40, adjoins=adjoins), facing_weight=0.5)
    rng = np.random.default_rng(seed)
    tasks = np.column_stack([rng.uniform(0, 2 * np.pi, 12), rng.choice([0.0, 0.1, 3.0], 12)])
    found, chosen = _cheapest_of_all(tasks, _packed(costs), 7)
    for (gauge, near), cost, own in zip(tasks, found, chosen, strict=True):
        rows = [plain_sample(stage, gauge, near, 7) for stage in costs]
        turns = [cheapest_turn(stage, stage.yaws[some] - gauge) for stage, some in zip(costs, rows, strict=True)]
        unary, first, last = zip(
            *(
                (
                    facing_cost(stage, stage.yaws[some] - gauge, turn),
                    change_of_offset(stage, some, turn, gauge, 0),
                    change_of_offset(stage, some, turn, gauge, -1),
                )
                for stage, some, turn in zip(costs, rows, turns, strict=True)
            ),
            strict=True,
        )
        _, least = cheapest_chain(unary, first, last)
        assert cost == pytest.approx(least)
        picked = [stage.by_yaw[row] for stage, row in zip(costs, own, strict=True)]
        assert all(row in some for row, some in zip(picked, rows, strict=True))
        best = with_best_turns(costs, np.array(picked), gauge)
        assert best.cost <= cost * (1 + 1e-9)


def test_the_first_chain_is_one() -> None:
    costs = stage_costs(problem(3, count=4, size=40), facing_weight=0.5)
    for found in (sampled_chain(costs), first_chain(costs)):
        assert chain_cost(costs, found.chosen, found.turns, found.gauge) == pytest.approx(found.cost)
