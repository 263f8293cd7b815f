import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.geometry.arrays import IntArray
from mhvedit.optimise.blocks import MAPPED, YAW_LEVEL, block_map, curve_of_map, marked
from mhvedit.optimise.branching import best_chain
from mhvedit.optimise.chains import stage_costs, vectors
from mhvedit.optimise.keys import best_placements
from mhvedit.optimise.stages import Stage, some_of
from mhvedit.optimise.thinning import near_best, places_of
from mhvedit.optimise.ties import deepest_chain
from mhvedit.search.poses import cells_of_keys
from tests.optimise.problems import N_YAW, problem, some_keys

WEIGHT, STEP = 0.5, 0.01  # m^2, m


def wide_problem(seed: int) -> tuple[Stage, ...]:
    """Stages of which most solutions are far from the best chain."""
    rng = np.random.default_rng(seed)
    stages = problem(seed, count=4, size=12)
    wide = []
    for stage in stages:
        far = some_keys(rng, 300, reach=200, yaws=N_YAW // 2)
        keys = np.unique(np.concatenate([stage.keys, far]), axis=0)
        poses = np.column_stack([keys[:, :2] * STEP, keys[:, 2] * 2 * np.pi / N_YAW])
        wide.append(Stage(stage.names, keys, poses, rng.random(len(keys)), stage.roots_a, stage.roots_b))
    return tuple(wide)


@pytest.mark.parametrize("seed", range(6))
def test_the_best_chain_of_what_is_left_is_that_of_all(seed: int) -> None:
    stages = wide_problem(seed)
    near = near_best([places_of(stage) for stage in stages], facing_weight=WEIGHT, step=STEP, n_yaw=N_YAW, enough=0)
    thin = [some_of(stage, own) for stage, own in zip(stages, near.rows, strict=True)]
    assert sum(map(len, thin)) < 0.8 * sum(map(len, stages))
    assert near.start is not None
    assert all((own.keys == key).all(1).any() for own, key in zip(thin, near.start.keys, strict=True))
    found = []
    for some in (stages, thin):
        costs = stage_costs(some, facing_weight=WEIGHT)
        chain = best_chain(costs, step=STEP, n_yaw=N_YAW)
        deepest = deepest_chain(costs, [stage.merit for stage in some], chain, n_yaw=N_YAW)
        found.append((chain.cost, [stage.keys[row].tolist() for stage, row in zip(some, deepest.chosen, strict=True)]))
    assert found[1][0] == pytest.approx(found[0][0], rel=1e-8)
    assert found[1][1] == found[0][1]


def test_rows_are_those_of_the_whole_stages(monkeypatch: pytest.MonkeyPatch) -> None:
    stages = wide_problem(1)
    whole = best_placements(stages, facing_weight=WEIGHT, step=STEP, n_yaw=N_YAW)
    monkeypatch.setattr(near_best, "__kwdefaults__", {"enough": 0})
    thin = best_placements(stages, facing_weight=WEIGHT, step=STEP, n_yaw=N_YAW)
    assert thin.chosen.tolist() == whole.chosen.tolist()
    assert thin.cost == pytest.approx(whole.cost) and thin.lower_bound >= 0.99 * thin.cost


def test_what_is_thinned_already_is_not_thinned_again(monkeypatch: pytest.MonkeyPatch) -> None:
    stages = wide_problem(2)
    whole = best_placements(stages, facing_weight=WEIGHT, step=STEP, n_yaw=N_YAW)
    near = near_best([places_of(stage) for stage in stages], facing_weight=WEIGHT, step=STEP, n_yaw=N_YAW, enough=0)
    thin = [some_of(stage, own) for stage, own in zip(stages, near.rows, strict=True)]
    monkeypatch.delattr("mhvedit.optimise.keys.near_best")
    found = best_placements(thin, facing_weight=WEIGHT, step=STEP, n_yaw=N_YAW, start=near.start)
    assert [own[row] for own, row in zip(near.rows, found.chosen, strict=True)] == whole.chosen.tolist()
    assert found.cost == pytest.approx(whole.cost)


def test_few_solutions_are_left_as_they_are() -> None:
    stages = problem(0, count=3, size=12)
    near = near_best([places_of(stage) for stage in stages], facing_weight=WEIGHT, step=STEP, n_yaw=N_YAW)
    assert near.start is None
    assert [own.tolist() for own in near.rows] == [list(range(len(stage))) for stage in stages]


def some_lattice_keys(seed: int) -> IntArray:
    rng = np.random.default_rng(seed)
    return some_keys(rng, 60, reach=40, yaws=N_YAW // 2, about=(int(rng.integers(-90, 90)), 5, 0))


@settings(max_examples=30)
@given(st.integers(0, 10**6))
def test_blocks_are_there_where_solutions_are(seed: int) -> None:
    keys, rng = some_lattice_keys(seed), np.random.default_rng(seed)
    rows = np.sort(rng.permutation(len(keys))[: 1 + len(keys) // 2])
    cells = cells_of_keys(keys[rows])
    found = block_map(cells)
    assert found.origin.tolist() == keys[rows, :2].min(0).tolist()
    places = {tuple(own) for own in ((keys[rows] - [*found.origin, 0]) >> sides()).tolist()}
    assert {tuple(own) for own in np.argwhere(found.there).tolist()} == places
    flags = found.there & (rng.random(found.there.shape) < 0.5)
    there = (keys[rows] - [*found.origin, 0]) >> sides()
    assert marked(cells, flags).tolist() == flags[tuple(there.T)].tolist()


@settings(max_examples=20)
@given(st.integers(0, 10**6))
def test_a_block_holds_the_vectors_and_yaws_of_its_solutions(seed: int) -> None:
    keys, rng = some_lattice_keys(seed), np.random.default_rng(seed)
    poses = np.column_stack([keys[:, :2] * STEP, keys[:, 2] * 2 * np.pi / N_YAW])
    stage = Stage(("", ""), keys, poses, np.zeros(len(keys)), rng.normal(0, 1, (2, 2)), rng.normal(0, 1, (2, 2)))
    (costs,) = stage_costs([stage], facing_weight=1.0)
    blocks = block_map(cells_of_keys(keys))
    curve = curve_of_map(blocks, costs, step=STEP, n_yaw=N_YAW)
    assert (np.diff(curve.codes) > 0).all() and sorted(curve.rows) == np.flatnonzero(blocks.there).tolist()
    place = np.empty(blocks.there.size, np.int64)
    place[curve.rows] = np.arange(len(curve.rows))
    own = place[np.ravel_multi_index(tuple(((keys - [*blocks.origin, 0]) >> sides()).T), blocks.there.shape)]
    for which, middles in ((0, curve.first), (-1, curve.last)):
        away = vectors(costs, np.arange(len(keys)), which) - middles[own]
        assert np.abs(away.real).max() <= curve.half.real + 1e-12
        assert np.abs(away.imag).max() <= curve.half.imag + 1e-12
    assert np.abs(poses[:, 2] - curve.yaws[own]).max() <= curve.half_yaw + 1e-12


def sides() -> IntArray:
    return np.array([MAPPED, MAPPED, MAPPED - YAW_LEVEL])
