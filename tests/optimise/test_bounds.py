from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.optimise.bounds import Links, _facing, loss_of
from mhvedit.optimise.chains import chain_cost, stage_costs, vectors, with_best_turns
from tests.optimise.problems import problem

SOME = settings(max_examples=100, derandomize=True)


@given(
    st.tuples(st.floats(0, 3), st.floats(0, 3)),
    st.floats(-3.2, 3.2),
    st.sampled_from([0.0, 0.01, 0.3, 1.0]),
    st.floats(-3.1, 3.1),
    st.sampled_from([0.0, 0.02, 0.4]),
)
@SOME
def test_facing_costs_no_less_than_its_bound_anywhere_and_that_at_best(
    weights: tuple[float, float], turn: float, half_turn: float, mismatch: float, half_mismatch: float
) -> None:
    least, best, stiffness = _facing(*weights, turn, half_turn, mismatch, half_mismatch)
    turns = turn + half_turn * np.linspace(-1, 1, 41)[:, None]
    mismatches = mismatch + half_mismatch * np.linspace(-1, 1, 41)
    cost = weights[0] * (1 - np.cos(turns)) + weights[1] * (1 - np.cos(turns + mismatches))
    assert (cost >= least + 0.5 * stiffness * (turns - best) ** 2 - 1e-12).all()
    assert abs(best - turn) <= half_turn + 1e-12
    slope = weights[0] * half_turn / 20 + weights[1] * (half_turn + half_mismatch) / 20
    assert cost.min() <= least + slope + 1e-12


@given(st.integers(0, 200), st.floats(-4, -0.3))
@SOME
def test_near_its_best_turns_and_gauge_a_chain_costs_no_more_than_the_loss_on_top(seed: int, size: float) -> None:
    stages = problem(seed % 5, count=4, size=12)
    costs = stage_costs(stages, facing_weight=0.5)
    rng = np.random.default_rng(seed)
    chosen = np.array([rng.integers(len(stage)) for stage in stages])
    best = with_best_turns(costs, chosen, float(rng.uniform(0, 6)))
    pairs = list(pairwise(costs))
    kept = [(b.roots_a[0] - a.roots_a[-1], b.roots_b[0] - a.roots_b[-1]) for a, b in pairs]
    weights = np.array([[stage.weight_a, stage.weight_b] for stage in costs])
    links = Links(*np.ascontiguousarray(weights.T), *np.ascontiguousarray(np.array(kept).T))
    reach = [abs(vectors(stage, chosen[[g]], 0)[0]) for g, stage in enumerate(costs)]
    turn, gauge = 10.0**size, 10.0**size * rng.uniform(0, 1)
    loss = loss_of(links, np.array(reach), turn, gauge, best.cost)
    for _ in range(20):
        off = turn * rng.choice([-1.0, 1.0], 4) * rng.choice([1.0, rng.random()])
        cost = chain_cost(costs, chosen, best.turns + off, best.gauge + gauge * rng.choice([-1.0, 1.0]))
        assert best.cost - 1e-12 <= cost <= best.cost + loss + 1e-12
