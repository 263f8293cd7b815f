from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pytest import approx

from mhvedit.geometry.arrays import FloatArray
from mhvedit.optimise.chains import (
    Chain,
    chain_cost,
    cheapest_chain,
    cheapest_turn,
    complex_of,
    facing_cost,
    polished,
    stage_costs,
    with_best_turns,
)
from mhvedit.optimise.keys import KeyPlacements, _placed
from mhvedit.optimise.stages import Stage
from tests.optimise.problems import plain_cost, problem

WEIGHT = 0.7
JOINED = [True, False, True, True, False]


def some_chain(stages: tuple[Stage, ...], seed: int) -> Chain:
    rng = np.random.default_rng(seed)
    chosen = np.array([rng.integers(len(stage)) for stage in stages])
    turns, gauge = rng.uniform(-3, 3, len(stages)), float(rng.uniform(0, 6))
    cost = chain_cost(stage_costs(stages, facing_weight=WEIGHT), chosen, turns, gauge)
    return Chain(chosen, turns, gauge, cost)


def placed_cost(stages: tuple[Stage, ...], placed: KeyPlacements, shifts: FloatArray) -> float:
    a, b = placed.a.copy(), placed.b.copy()
    a[:, :2] += shifts
    b[:, :2] += shifts
    return plain_cost(stages, a, b, gauge=placed.gauge, facing_weight=WEIGHT)


@pytest.fixture(scope="module", params=["apart", "adjoining"])
def stages(request: pytest.FixtureRequest) -> tuple[Stage, ...]:
    if request.param == "apart":
        return problem(1, count=5, size=30)
    return problem(2, count=6, size=300, adjoins=JOINED)


@pytest.mark.parametrize("seed", range(4))
def test_the_cost_of_a_chain_is_the_plain_sum_at_its_placements(stages: tuple[Stage, ...], seed: int) -> None:
    chain = some_chain(stages, seed)
    placed = _placed(stages, chain, equals=1)
    assert placed_cost(stages, placed, np.zeros((len(stages), 2))) == approx(chain.cost, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_no_other_place_of_the_pair_costs_less(stages: tuple[Stage, ...], seed: int) -> None:
    placed = _placed(stages, some_chain(stages, seed), equals=1)
    rng = np.random.default_rng(seed)
    for _ in range(20):
        away = rng.normal(0, 1, (len(stages), 2)) * 10.0 ** rng.integers(-4, 1)
        assert placed_cost(stages, placed, away) >= placed.cost * (1 - 1e-9)


def test_placements_are_the_chosen_poses_turned(stages: tuple[Stage, ...]) -> None:
    chain = some_chain(stages, 0)
    placed = _placed(stages, chain, equals=1)
    for g, stage in enumerate(stages):
        x, y, yaw = stage.poses[chain.chosen[g]]
        c, s = np.cos(placed.a[g, 2]), np.sin(placed.a[g, 2])
        assert placed.a[g, 2] == approx(chain.turns[g])
        assert placed.b[g] - placed.a[g] == approx(np.array([c * x - s * y, s * x + c * y, yaw]))


def test_the_first_pair_stays_where_a_was(stages: tuple[Stage, ...]) -> None:
    placed = _placed(stages, some_chain(stages, 3), equals=1)
    root = stages[0].roots_a.mean(0)
    c, s = np.cos(placed.a[0, 2]), np.sin(placed.a[0, 2])
    assert placed.a[0, :2] + np.array([c * root[0] - s * root[1], s * root[0] + c * root[1]]) == approx(root)


@given(st.floats(-7, 7))
def test_the_cheapest_turn_is_the_least_of_all(mismatch: float) -> None:
    stage = stage_costs(problem(4, count=2, size=5), facing_weight=WEIGHT)[0]
    turns = np.linspace(-np.pi, np.pi, 721)
    best = cheapest_turn(stage, np.array([mismatch]))
    least = facing_cost(stage, np.array([mismatch]), best)[0]
    assert least <= facing_cost(stage, np.full(721, mismatch), turns).min() + 1e-12


states = st.integers(1, 4).flatmap(
    lambda n: st.lists(st.tuples(*[st.floats(-2, 2)] * 4, st.floats(0, 3)), min_size=n, max_size=n)
)


@settings(max_examples=60)
@given(st.lists(states, min_size=1, max_size=4))
def test_cheapest_chain_is_the_exhaustive_optimum(stages: list[list[tuple[float, float, float, float, float]]]) -> None:
    tables = [np.array(stage) for stage in stages]

    def cost(chain: tuple[int, ...]) -> float:
        picked = [table[i] for table, i in zip(tables, chain, strict=True)]
        moved = [0.5 * ((q[:2] - p[2:4]) ** 2).sum() for p, q in pairwise(picked)]
        return float(sum(p[4] for p in picked) + sum(moved))

    first, last = [complex_of(t[:, :2]) for t in tables], [complex_of(t[:, 2:4]) for t in tables]
    chosen, total = cheapest_chain([t[:, 4] for t in tables], first, last)
    assert total == approx(min(cost(chain) for chain in product(*(range(len(t)) for t in tables))), abs=1e-12)
    assert cost(tuple(int(i) for i in chosen)) == approx(total, abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_turns_and_gauge_of_a_chain_are_at_rest(seed: int) -> None:
    costs = stage_costs(problem(seed, count=4, size=10), facing_weight=WEIGHT)
    chosen = np.zeros(4, np.int64)
    best = with_best_turns(costs, chosen, costs[0].yaws[0])
    assert chain_cost(costs, chosen, best.turns, best.gauge) == approx(best.cost)
    for i in range(5):
        for step in (-1e-4, 1e-4):
            free = np.concatenate([[best.gauge], best.turns])
            free[i] += step
            assert chain_cost(costs, chosen, free[1:], free[0]) >= best.cost - 1e-12


@pytest.mark.parametrize("seed", range(5))
def test_polishing_never_makes_worse(seed: int) -> None:
    costs = stage_costs(problem(seed, count=4, size=40), facing_weight=WEIGHT)
    start = with_best_turns(costs, np.zeros(4, np.int64), costs[0].yaws[0])
    better = polished(costs, start.chosen, start.gauge)
    assert better.cost <= start.cost + 1e-12
    assert chain_cost(costs, better.chosen, better.turns, better.gauge) == approx(better.cost)
