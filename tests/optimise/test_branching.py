"""The bound and the optimum, against all chains with turns and gauge polished."""

from itertools import product

import numpy as np
import pytest
from pytest import approx

from mhvedit.optimise.branching import (
    GOOD_ENOUGH,
    _blocks,
    _bounds,
    _Branch,
    _cell_bounds,
    _Cells,
    _Level,
    _refined,
    best_chain,
)
from mhvedit.optimise.chains import StageCosts, chain_cost, change_of_offset, facing_cost, stage_costs, with_best_turns
from mhvedit.optimise.stages import Stage
from tests.optimise.problems import N_YAW, STEP, problem

GAUGES = 2 * np.pi * np.arange(0, 5) / 5


def true_optimum(stages: tuple[Stage, ...], facing_weight: float) -> float:
    """Every chain, polished from every fifth of a turn of the gauge."""
    costs = stage_costs(stages, facing_weight=facing_weight)
    chains = [np.array(chain) for chain in product(*(range(len(stage)) for stage in stages))]
    return min(with_best_turns(costs, chain, gauge).cost for chain in chains for gauge in GAUGES)


@pytest.mark.parametrize(("seed", "weight"), [(2, 0.02), (0, 1.0), (1, 1.0), (2, 20.0), (3, 20.0)])
def test_cost_and_bound_enclose_the_true_optimum(seed: int, weight: float) -> None:
    stages = problem(seed, count=3, size=3)
    truth = true_optimum(stages, weight)
    found = best_chain(stages, facing_weight=weight, step=STEP, n_yaw=N_YAW)
    assert found.lower_bound <= truth * (1 + 1e-6)
    assert found.cost >= truth * (1 - 1e-6)
    assert found.cost - found.lower_bound <= GOOD_ENOUGH * found.cost
    costs = stage_costs(stages, facing_weight=weight)
    assert chain_cost(costs, found.chosen, found.turns, found.gauge) == approx(found.cost)


@pytest.mark.parametrize("seed", range(2))
def test_stages_of_several_segments(seed: int) -> None:
    stages = problem(seed, count=4, size=150, adjoins=[True, False, True])
    few = tuple(Stage(s.names, s.keys[:5], s.poses[:5], s.merit[:5], s.roots_a, s.roots_b) for s in stages)
    truth = true_optimum(few, 0.5)
    found = best_chain(few, facing_weight=0.5, step=STEP, n_yaw=N_YAW)
    assert found.lower_bound <= truth * (1 + 1e-6)
    assert truth * (1 - 1e-6) <= found.cost <= found.lower_bound / (1 - GOOD_ENOUGH)


@pytest.mark.parametrize("seed", range(2))
def test_larger_problems_are_proven_too(seed: int) -> None:
    stages = problem(seed, count=6, size=60)
    found = best_chain(stages, facing_weight=1.0, step=STEP, n_yaw=N_YAW)
    assert 0 < found.lower_bound <= found.cost <= found.lower_bound / (1 - GOOD_ENOUGH)


def test_poses_on_either_side_of_the_seam_of_yaw_are_near() -> None:
    stages = problem(0, count=2, size=3)
    near = tuple(
        Stage(
            s.names, np.array([[0, 0, k]]), np.array([[0, 0, k * 2 * np.pi / N_YAW]]), np.zeros(1), s.roots_a, s.roots_b
        )
        for s, k in zip(stages, (0, N_YAW - 1), strict=True)
    )
    far = best_chain(near, facing_weight=1.0, step=STEP, n_yaw=N_YAW)
    assert far.cost < 0.2
    assert far.cost == approx(true_optimum(near, 1.0))


def test_a_common_pose_is_found_by_search_too() -> None:
    stages = problem(5, count=3, size=30)
    same = tuple(Stage(s.names, stages[0].keys, stages[0].poses, stages[0].merit, s.roots_a, s.roots_b) for s in stages)
    found = best_chain(same, facing_weight=1.0, step=STEP, n_yaw=N_YAW)
    assert found.cost == approx(0, abs=1e-9)


def test_no_weight_on_facing_is_no_error() -> None:
    stages = problem(3, count=3, size=3)
    found = best_chain(stages, facing_weight=0.0, step=STEP, n_yaw=N_YAW)
    assert 0 <= found.lower_bound <= found.cost


# Pruning


def start_level(most_turn: float) -> _Level:
    return _Level(8, 8, most_turn, np.pi / 3, most_turn)


def whole_branch(costs: tuple[StageCosts, ...], level: _Level, gauge: float) -> _Branch:
    blocks = [_blocks(stage, level) for stage in costs]
    cells = [_Cells(np.arange(len(b.member)), np.zeros(len(b.member), np.int64)) for b in blocks]
    return _Branch(gauge, tuple(cells))


@pytest.mark.parametrize("seed", range(4))
def test_no_chain_through_a_cell_costs_less_than_its_bound(seed: int) -> None:
    """At every fineness, random chains in the branch: each of their cells says at most what the chain costs."""
    rng = np.random.default_rng(seed)
    stages = problem(seed, count=3, size=12)
    costs = stage_costs(stages, facing_weight=0.5)
    level = start_level(np.pi)
    branches = [whole_branch(costs, level, gauge) for gauge in (1.0, 3.0)]
    blocks = [_blocks(stage, level) for stage in costs]
    for _ in range(5):
        for branch in branches:
            through, _ = _bounds(costs, blocks, branch, level, np.inf)
            for _ in range(10):
                chosen = np.array([rng.integers(len(stage)) for stage in stages])
                turns = rng.uniform(-np.pi, np.pi, 3)
                gauge = branch.gauge + rng.uniform(-1, 1) * level.half_gauge
                cost = chain_cost(costs, chosen, turns, gauge)
                for g, stage in enumerate(costs):
                    index = stage.keys[chosen[g]] // np.array([level.block, level.block, level.yaws])
                    block = int(np.flatnonzero((blocks[g].index == index).all(1))[0])
                    slot = int((turns[g] + np.pi) // (2 * level.half_turn))
                    cells = branch.cells[g]
                    (cell,) = np.flatnonzero((cells.block == block) & (cells.slot == slot))
                    assert through[g][cell] <= cost + 1e-9
        finer = level.halved(step=STEP, yaw_step=2 * np.pi / N_YAW)
        blocks, branches = _refined(costs, blocks, branches, level, finer)
        level = finer


@pytest.mark.parametrize("spread", ["turn", "gauge", "pose", "all"])
def test_what_is_in_a_cell_lies_in_its_disc(spread: str) -> None:
    """The corners of a cell, where each of its three freedoms is as far from the middle as it gets."""
    stages = problem(3, count=3, size=60)
    for stage in stage_costs(stages, facing_weight=0.5):
        sizes = {"turn": (1, 1, 0.3, 0.0), "gauge": (1, 1, 0.0, 0.3), "pose": (4, 6, 0.0, 0.0), "all": (4, 6, 0.2, 0.3)}
        level = _Level(*sizes[spread], most_turn=1.0)
        blocks = _blocks(stage, level)
        slots = np.zeros(len(blocks.member), np.int64)
        bounds = _cell_bounds(stage, blocks, _Cells(np.arange(len(slots)), slots), 2.0, level)
        index = stage.keys // np.array([level.block, level.block, level.yaws])
        rows = np.arange(len(index))
        cell = np.array([np.flatnonzero((blocks.index == own).all(1))[0] for own in index])
        for side, other in product((-1, 1), (-1, 1)):
            turn = np.full(len(rows), -level.most_turn + (1 + side) * level.half_turn)
            gauge = 2.0 + other * level.half_gauge
            for which, centre in ((0, bounds.first), (-1, bounds.last)):
                e = change_of_offset(stage, rows, turn, gauge, which)
                assert (np.hypot(*(e.T - [centre[cell].real, centre[cell].imag])) <= bounds.radius[cell] + 1e-12).all()
            assert (facing_cost(stage, stage.yaws - gauge, turn) >= bounds.unary[cell] - 1e-12).all()


@pytest.mark.parametrize("seed", range(3))
def test_cells_are_cut_into_all_that_is_in_them(seed: int) -> None:
    costs = stage_costs(problem(seed, count=2, size=60), facing_weight=0.5)
    level, finer = start_level(1.0), _Level(2, 4, 0.5, np.pi / 6, 1.0)
    blocks, branches = _refined(
        costs, [_blocks(s, level) for s in costs], [whole_branch(costs, level, 1.0)], level, finer
    )
    assert [branch.gauge for branch in branches] == approx([1.0 - np.pi / 6, 1.0 + np.pi / 6])
    for stage, own, cells in zip(costs, blocks, branches[0].cells, strict=True):
        wanted = {(*key, slot) for key in (stage.keys // np.array([2, 2, 4])).tolist() for slot in (0, 1)}
        got = [(*key, slot) for key, slot in zip(own.index[cells.block].tolist(), cells.slot.tolist(), strict=True)]
        assert len(got) == len(set(got)) and set(got) == wanted
