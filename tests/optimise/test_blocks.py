from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from mhvedit.geometry.arrays import ComplexArray, IntArray
from mhvedit.optimise.blocks import YAW_LEVEL, Blocks, Curve, coarsest_blocks, curve_of, smaller_blocks
from mhvedit.optimise.chains import StageCosts, stage_costs
from tests.optimise.problems import problem


def vectors(stage: StageCosts, which: int) -> ComplexArray:
    """From A's root to B's, of every solution."""
    return np.asarray(stage.shifts + np.exp(1j * stage.yaws) * stage.roots_b[which] - stage.roots_a[which])


@pytest.fixture(scope="module")
def pool() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(2) as threads:
        yield threads


def block_index(stage: StageCosts, level: int) -> IntArray:
    """Which block of the lattice each solution is in, counted from the smallest x and y."""
    keys = stage.keys - np.array([*stage.keys[:, :2].min(0), 0])
    return np.asarray(keys >> np.array([level, level, max(level - YAW_LEVEL, 0)]))


def check(costs: tuple[StageCosts, ...], curves: list[Curve], blocks: Blocks) -> None:
    for g, (stage, curve) in enumerate(zip(costs, curves, strict=True)):
        index, own = block_index(stage, blocks.level), np.flatnonzero(blocks.stage == g)
        held = []
        for block in own:
            rows = curve.rows[slice(*blocks.run[block])]
            held.append(rows)
            assert len(np.unique(index[rows], axis=0)) == 1
            for which, middle in ((0, blocks.first[block]), (-1, blocks.last[block])):
                away, half = vectors(stage, which)[rows] - middle, blocks.half[block]
                assert (np.abs(away.real) <= half.real + 1e-12).all() and (np.abs(away.imag) <= half.imag + 1e-12).all()
            assert (np.abs(stage.yaws[rows] - blocks.yaw[block]) <= blocks.half_yaw[block] + 1e-12).all()
        assert len(own) == len(np.unique(index, axis=0))
        assert np.sort(np.concatenate(held)).tolist() == list(range(len(stage.keys)))


@pytest.mark.parametrize("adjoins", [[False], [True, False]])
def test_every_level_is_cut_into_blocks_that_hold_all_solutions(adjoins: list[bool], pool: ThreadPoolExecutor) -> None:
    costs = stage_costs(problem(2, count=len(adjoins) + 1, size=30 * len(adjoins), adjoins=adjoins), facing_weight=1.0)
    curves = [curve_of(stage) for stage in costs]
    blocks = coarsest_blocks(curves, pool)
    check(costs, curves, blocks)
    while blocks.level:
        finer, starts = smaller_blocks(curves, blocks, np.arange(len(blocks)), pool)
        assert starts[0] == 0 and starts[-1] == len(finer)
        for block in range(len(blocks)):
            parts = finer.run[starts[block] : starts[block + 1]]
            assert parts[0, 0] == blocks.run[block, 0] and parts[-1, 1] == blocks.run[block, 1]
            assert (parts[1:, 0] == parts[:-1, 1]).all()
        blocks = finer
        check(costs, curves, blocks)
    assert (blocks.half == 0).all() and (blocks.half_yaw == 0).all()


def test_blocks_that_are_not_used_are_not_cut(pool: ThreadPoolExecutor) -> None:
    curves = [curve_of(stage) for stage in stage_costs(problem(2, count=2, size=30), facing_weight=1.0)]
    blocks = coarsest_blocks(curves, pool)
    finer, starts = smaller_blocks(curves, blocks, np.arange(1, len(blocks)), pool)
    assert starts[1] == 0 and (np.diff(starts)[1:] > 0).all()
    assert len(finer) == starts[-1]
