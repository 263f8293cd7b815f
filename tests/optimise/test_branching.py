"""The bound and the optimum, against all chains with turns and gauge polished."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pytest import approx

from mhvedit.geometry.arrays import BoolArray, ComplexArray
from mhvedit.optimise.blocks import Blocks, coarsest_blocks, curve_of
from mhvedit.optimise.branching import (
    EXACT,
    NOTHING,
    _bounded,
    _Cells,
    _least_losing,
    _Level,
    _Problem,
    _problem,
    _refined,
    _View,
    best_chain,
)
from mhvedit.optimise.chains import Chain, StageCosts, chain_cost, stage_costs, steps_of, with_best_turns
from mhvedit.optimise.stages import Stage, some_of
from tests.optimise.problems import N_YAW, STEP, problem

GAUGES = 2 * np.pi * np.arange(0, 5) / 5


def true_optimum(stages: tuple[Stage, ...], facing_weight: float) -> float:
    """Every chain, polished from every fifth of a turn of the gauge."""
    costs = stage_costs(stages, facing_weight=facing_weight)
    chains = [np.array(chain) for chain in product(*(range(len(stage)) for stage in stages))]
    return min(with_best_turns(costs, chain, gauge).cost for chain in chains for gauge in GAUGES)


@pytest.mark.parametrize(("seed", "weight"), [(2, 0.02), (0, 1.0), (1, 1.0), (2, 20.0), (3, 20.0)])
def test_the_cost_is_the_true_optimum_and_the_bound_proves_it(seed: int, weight: float) -> None:
    stages = problem(seed, count=3, size=3)
    truth = true_optimum(stages, weight)
    found = best_chain(stage_costs(stages, facing_weight=weight), step=STEP, n_yaw=N_YAW)
    assert found.lower_bound <= truth * (1 + 1e-6)
    assert found.cost == approx(truth, rel=1e-6)
    assert found.lower_bound >= found.cost * (1 - EXACT)
    costs = stage_costs(stages, facing_weight=weight)
    assert chain_cost(costs, found.chosen, found.turns, found.gauge) == approx(found.cost)


@pytest.mark.parametrize("seed", range(2))
def test_stages_of_several_segments(seed: int) -> None:
    stages = problem(seed, count=4, size=150, adjoins=[True, False, True])
    few = tuple(Stage(s.names, s.keys[:5], s.poses[:5], s.merit[:5], s.roots_a, s.roots_b) for s in stages)
    truth = true_optimum(few, 0.5)
    found = best_chain(stage_costs(few, facing_weight=0.5), step=STEP, n_yaw=N_YAW)
    assert found.lower_bound <= truth * (1 + 1e-6)
    assert found.cost == approx(truth, rel=1e-6)
    assert found.lower_bound >= found.cost * (1 - EXACT)


@pytest.mark.parametrize("seed", range(2))
def test_larger_problems_are_proven_too(seed: int) -> None:
    stages = problem(seed, count=6, size=60)
    found = best_chain(stage_costs(stages, facing_weight=1.0), step=STEP, n_yaw=N_YAW)
    assert 0 < found.cost * (1 - EXACT) <= found.lower_bound <= found.cost


def test_poses_on_either_side_of_the_seam_of_yaw_are_near() -> None:
    stages = problem(0, count=2, size=3)
    near = tuple(
        Stage(
            s.names, np.array([[0, 0, k]]), np.array([[0, 0, k * 2 * np.pi / N_YAW]]), np.zeros(1), s.roots_a, s.roots_b
        )
        for s, k in zip(stages, (0, N_YAW - 1), strict=True)
    )
    far = best_chain(stage_costs(near, facing_weight=1.0), step=STEP, n_yaw=N_YAW)
    assert far.cost < 0.2
    assert far.cost == approx(true_optimum(near, 1.0))


def test_a_common_pose_is_found_by_search_too() -> None:
    stages = problem(5, count=3, size=30)
    same = tuple(Stage(s.names, stages[0].keys, stages[0].poses, stages[0].merit, s.roots_a, s.roots_b) for s in stages)
    found = best_chain(stage_costs(same, facing_weight=1.0), step=STEP, n_yaw=N_YAW)
    assert found.cost <= NOTHING


def test_no_weight_on_facing_is_no_error() -> None:
    stages = problem(3, count=3, size=3)
    found = best_chain(stage_costs(stages, facing_weight=0.0), step=STEP, n_yaw=N_YAW)
    assert 0 <= found.lower_bound <= found.cost


# Pruning


def cells_of(costs: tuple[StageCosts, ...], blocks: Blocks, gauges: list[float]) -> _Cells:
    starts = np.concatenate([[0], np.cumsum(np.bincount(blocks.stage, minlength=len(costs)))])
    bounds = np.arange(len(gauges))[:, None] * len(blocks) + starts
    block = np.tile(np.arange(len(blocks), dtype=np.int32), len(gauges))
    return _Cells(np.array(gauges), bounds, block, np.zeros(len(block), np.int32))


def cell_of(
    problem: _Problem, blocks: Blocks, cells: _Cells, level: _Level, branch: int, stage: int, row: int, turn: float
) -> int:
    """The cell that a solution and a turn are in."""
    at = int(np.flatnonzero(problem.curves[stage].rows == row)[0])
    own = (blocks.stage == stage) & (blocks.run[:, 0] <= at) & (at < blocks.run[:, 1])
    slot = int((turn + level.most_turn) // (2 * level.half_turn))
    inside = np.arange(len(cells))
    mine: BoolArray = (inside >= cells.bounds[branch, stage]) & (inside < cells.bounds[branch, stage + 1])
    (cell,) = np.flatnonzero(mine & own[cells.block] & (cells.slot == slot))
    return int(cell)


def some_best_chain(rng: np.random.Generator, costs: tuple[StageCosts, ...]) -> Chain:
    chosen = np.array([rng.integers(len(stage.keys)) for stage in costs])
    return with_best_turns(costs, chosen, float(rng.uniform(0, 2 * np.pi)))


def some_forces(rng: np.random.Generator, count: int) -> ComplexArray:
    return np.asarray((rng.normal(0, 1, count) + 1j * rng.normal(0, 1, count)) * 10.0 ** rng.integers(-3, 1))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("adjoins", [[False, False], [True, False, False], [False] * 5])
def test_no_chain_through_a_cell_costs_less_than_its_bound(seed: int, adjoins: list[bool]) -> None:
    """At every fineness and in every view; where turns or gauge are held, of chains at their best turns and gauge."""
    rng = np.random.default_rng(seed)
    stages = problem(seed, count=len(adjoins) + 1, size=40 if any(adjoins) else 12, adjoins=adjoins)
    costs = stage_costs(stages, facing_weight=0.5)
    level = _Level(5, np.pi, np.pi / 3, np.pi)
    with ThreadPoolExecutor(2) as pool:
        task = _problem(costs, [curve_of(own) for own in costs], pool)
        blocks = coarsest_blocks(task.curves, pool)
        cells = cells_of(costs, blocks, [np.pi / 3, np.pi, 5 * np.pi / 3])
        for _ in range(5):
            checked = 0
            for _ in range(6):
                best = some_best_chain(rng, costs)
                forces = [None, some_forces(rng, len(stages) - 1), steps_of(costs, best)]
                wide = [_View(level.half_turn, level.half_gauge, own) for own in forces]
                held = [_View(0.0, 0.0), *(_View(level.half_turn, 0.0, own) for own in forces)]
                free = rng.uniform(-np.pi, np.pi, len(stages)), float(rng.uniform(0, 2 * np.pi))
                views, stances = wide + held, [free] * len(wide) + [(best.turns, best.gauge)] * len(held)
                for view, (turns, gauge) in zip(views, stances, strict=True):
                    turns, gauge = (turns + np.pi) % (2 * np.pi) - np.pi, gauge % (2 * np.pi)
                    cost = chain_cost(costs, best.chosen, turns, gauge)
                    budget = cost * (1 + 1e-9) + rng.choice([0.0, 100.0])
                    through, least, _ = _bounded(task, blocks, cells, level, view, budget)
                    branch = int(np.abs((cells.gauges - gauge + np.pi) % (2 * np.pi) - np.pi).argmin())
                    assert least[branch] <= cost + 1e-9
                    for g, (row, turn) in enumerate(zip(best.chosen.tolist(), turns.tolist(), strict=True)):
                        assert through[cell_of(task, blocks, cells, level, branch, g, row, turn)] <= cost + 1e-9
                        checked += 1
            assert checked == 6 * 7 * len(stages)
            finer = level.halved(STEP, turn=1.0, gauge=1.0)
            blocks, cells = _refined(task, blocks, cells, level, finer)
            level = finer


def test_forces_bring_the_wide_bound_closer_to_the_chain_they_are_of() -> None:
    """Where all is known but the turns, which are small: without it more than three times as much is lost."""
    stages = problem(4, count=5, size=60)
    found = best_chain(stage_costs(stages, facing_weight=0.5), step=STEP, n_yaw=N_YAW)
    alone = tuple(some_of(stage, np.array([row])) for stage, row in zip(stages, found.chosen, strict=True))
    costs = stage_costs(alone, facing_weight=0.5)
    best = with_best_turns(costs, np.zeros(5, np.int64), found.gauge)
    half = 1.05 * float(np.abs(best.turns).max())
    with ThreadPoolExecutor(1) as pool:
        task = _problem(costs, [curve_of(own) for own in costs], pool)
        blocks = coarsest_blocks(task.curves, pool)
        cells, level = cells_of(costs, blocks, [best.gauge]), _Level(0, half, 0.0, half)
        loose, forced = (
            best.cost - _bounded(task, blocks, cells, level, _View(half, 0.0, forces), best.cost + 1)[1][0]
            for forces in (None, steps_of(costs, best))
        )
    assert 0 < forced < loose / 3


@pytest.mark.parametrize("seed", range(4))
def test_a_budget_changes_nothing_below_it(seed: int) -> None:
    stages = problem(seed, count=6, size=60)
    costs = stage_costs(stages, facing_weight=0.02)
    best = best_chain(costs, step=STEP, n_yaw=N_YAW)
    half = 1.5 * float(np.abs(best.turns).max())
    with ThreadPoolExecutor(1) as pool:
        task = _problem(costs, [curve_of(own) for own in costs], pool)
        blocks = coarsest_blocks(task.curves, pool)
        cells, level = cells_of(costs, blocks, [best.gauge]), _Level(5, half, 0.0, half)
        while level.blocks > 0:
            finer = replace(level, blocks=level.blocks - 1)
            blocks, cells = _refined(task, blocks, cells, level, finer)
            level = finer
        for share in (0.0, 0.5, 1.0, 3.0):
            view = _View(half, 0.0, share * steps_of(costs, best))
            every, _, _ = _bounded(task, blocks, cells, level, view, 100.0)
            for budget in np.quantile(every, (0.05, 0.3)):
                within, _, _ = _bounded(task, blocks, cells, level, view, max(budget, 0.0))
                np.testing.assert_allclose(within[every < budget], every[every < budget], rtol=1e-9, atol=1e-12)


def test_the_flat_bound_is_good_where_cells_are_small() -> None:
    """It loses with the square of the width: a tenth of it, a hundredth of the loss; the wide one a tenth only."""
    stages = tuple(
        Stage(s.names, s.keys[:1], s.poses[:1], s.merit[:1], s.roots_a, s.roots_b) for s in problem(1, count=3, size=12)
    )
    costs = stage_costs(stages, facing_weight=0.5)
    best = with_best_turns(costs, np.zeros(3, np.int64), float(costs[0].yaws[0]))
    with ThreadPoolExecutor(1) as pool:
        task = _problem(costs, [curve_of(own) for own in costs], pool)
        blocks = coarsest_blocks(task.curves, pool)
        lost = []
        for half in (1e-3, 1e-4):
            level = _Level(5, half, half, np.pi)
            cells = cells_of(costs, blocks, [best.gauge + 0.3 * half])
            slots = ((best.turns + np.pi) // (2 * half)).astype(np.int32)
            cells = _Cells(cells.gauges, cells.bounds, cells.block, slots)
            for view in (_View(half, half), _View(0.0, 0.0)):
                lost.append(best.cost - _bounded(task, blocks, cells, level, view, best.cost + 1)[1][0])
    assert all(loss > 0 for loss in lost)
    assert lost[2] > 0.03 * lost[0] and lost[3] < 0.03 * lost[1]


@given(st.integers(0, 10**6), st.integers(1, 9), st.sampled_from([0.0, 0.1, 2.0]))
@settings(max_examples=30, derandomize=True)
def test_forces_lose_no_more_than_any_that_are_like_them(seed: int, count: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    steps, half = some_forces(rng, count), complex(*(size * rng.random(2)))

    def lost(forces: ComplexArray) -> float:
        change = np.diff(forces, prepend=0.0, append=0.0)
        play = (np.abs(change.real) * half.real + np.abs(change.imag) * half.imag).sum()
        return float(0.5 * (np.abs(forces - steps) ** 2).sum() + play)

    found = _least_losing(steps, half)
    others = [steps, 0 * steps, np.full(count, steps.mean())]
    others += [found + 0.1 * np.abs(steps).mean() * some_forces(rng, count) for _ in range(20)]
    assert lost(found) <= min(map(lost, others)) * 1.1 + 1e-15
