"""The best chain where no single pose serves all segments, with a proof: branch and bound over poses, turns and gauge.

A branch is an interval of the gauge; a cell of it holds the solutions of one stage in a block of the pose lattice, with an
interval for the pair's turn in the world. Within a cell e lies in a disc and the facing cost has a lower bound, so a forward
and a backward pass over the cells give the least that any chain through a cell can cost. Cells that cannot beat the best
chain known are dropped; the others are halved in every direction. What is dropped is never better than the best chain, so
the least bound of the cells that are left is a bound for all chains.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.planar import rotation, wrap_angle
from mhvedit.optimise.chains import Chain, StageCosts, first_chain, polished, stage_costs
from mhvedit.optimise.stages import Stage

GOOD_ENOUGH = 0.01  # relative gap at which refinement stops
MOST_CELLS = 3_000_000  # in one round; more stops refinement, and the gap says so
MOST_ROUNDS = 40
FIRST_BLOCK = 32  # steps of x and y in a block at first
FIRST_YAWS = 8  # steps of yaw in a block, and in a branch of the gauge, at first
ARM = 2.0  # m that a radian of yaw, turn or gauge counts for when choosing what to halve


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """Cells of one stage in one branch."""

    block: IntArray  # (N, 3) index of the block of keys
    slot: IntArray  # (N,) index of the interval of the turn
    low: FloatArray  # (N, 3) least shift and yaw of the solutions inside
    high: FloatArray  # (N, 3) greatest
    member: IntArray  # (N,) a solution inside


@dataclass(frozen=True, slots=True)
class _Level:
    """How fine cells are."""

    block: int
    yaws: int
    half_turn: float  # rad
    half_gauge: float  # rad
    most_turn: float  # rad, turns lie between minus and plus this

    def halved(self, *, step: float, yaw_step: float) -> "_Level":
        """Halve what is coarsest: everything that is at least half as coarse as the coarsest."""
        block = self.block * step if self.block > 1 else 0.0
        yaws = ARM * self.yaws * yaw_step if self.yaws > 1 else 0.0
        turn, gauge = 2 * ARM * self.half_turn, 2 * ARM * self.half_gauge
        limit = 0.5 * max(block, yaws, turn, gauge)
        return _Level(
            self.block // 2 if block >= limit and block > 0 else self.block,
            self.yaws // 2 if yaws >= limit and yaws > 0 else self.yaws,
            self.half_turn / 2 if turn >= limit else self.half_turn,
            self.half_gauge / 2 if gauge >= limit else self.half_gauge,
            self.most_turn,
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Branch:
    gauge: float  # rad, middle of the interval
    cells: tuple[_Cells, ...]


def best_chain(stages: Sequence[Stage], *, facing_weight: float, step: float, n_yaw: int) -> Chain:
    """The best chain and a proven lower bound (Shi et al., eqs 16 to 18, with the gauge free).

    Args:
        stages: none empty.
        facing_weight: lambda, m^2.
        step: of x and y between poses, m.
        n_yaw: yaw steps in a full turn.
    """
    costs = stage_costs(stages, facing_weight=facing_weight)
    yaw_step = 2 * np.pi / n_yaw
    best = first_chain(costs, yaw_step=yaw_step)
    most_turn = max(_most_turn(stage, best.cost) for stage in costs)
    level = _Level(FIRST_BLOCK, FIRST_YAWS, most_turn, FIRST_YAWS * yaw_step / 2, most_turn)
    gauges = np.arange(0, 2 * np.pi, 2 * level.half_gauge) + level.half_gauge
    branches = [_Branch(float(g), tuple(_all_cells(stage, level) for stage in costs)) for g in gauges]
    bound = 0.0
    for _ in range(MOST_ROUNDS):
        if sum(len(cells.slot) for branch in branches for cells in branch.cells) > MOST_CELLS:
            break
        best, round_bound, survivors = _round(costs, branches, level, best)
        bound = max(bound, round_bound)
        if not survivors or bound >= best.cost * (1 - GOOD_ENOUGH):
            break
        finer = level.halved(step=step, yaw_step=yaw_step)
        branches = [child for branch in survivors for child in _halves(costs, branch, level, finer)]
        level = finer
    return Chain(best.chosen, best.turns, best.gauge, best.cost, min(bound, best.cost))


def _round(
    costs: Sequence[StageCosts], branches: Sequence[_Branch], level: _Level, best: Chain
) -> tuple[Chain, float, list[_Branch]]:
    """Bound every branch; returns the best chain known, the least bound, and what of the branches is left."""
    bounded = [(branch, *_bounds(costs, branch, level, best.cost)) for branch in branches]
    for branch, through, members in sorted(bounded, key=lambda item: float(item[1][0].min()))[:3]:
        if through[0].min() < best.cost:
            better = polished(costs, members, branch.gauge)
            best = min(best, better, key=lambda chain: chain.cost)
    bound = min([best.cost, *(float(through[0].min()) for _, through, _ in bounded)])
    survivors = []
    for branch, through, _ in bounded:
        kept = [_kept(cells, least < best.cost) for cells, least in zip(branch.cells, through, strict=True)]
        if all(len(cells.slot) for cells in kept):
            survivors.append(_Branch(branch.gauge, tuple(kept)))
    return best, bound, survivors


def _most_turn(stage: StageCosts, cost: float) -> float:
    """A turn further than this costs more on its own."""
    return float(np.arccos(np.clip(1 - cost / stage.weight_a, -1, 1)))


def _kept(cells: _Cells, mask: BoolArray) -> _Cells:
    return _Cells(cells.block[mask], cells.slot[mask], cells.low[mask], cells.high[mask], cells.member[mask])


def _all_cells(stage: StageCosts, level: _Level) -> _Cells:
    blocks, low, high, member = _blocks(stage, np.arange(len(stage.yaws)), level)
    return _Cells(blocks, np.zeros(len(blocks), np.int64), low, high, member)


def _blocks(stage: StageCosts, rows: IntArray, level: _Level) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """Blocks of the lattice that hold some of the rows, the bounds of what they hold, and one row of each."""
    size = np.array([level.block, level.block, level.yaws])
    blocks, first, inverse = np.unique(stage.keys[rows] // size, axis=0, return_index=True, return_inverse=True)
    values = np.column_stack([stage.shifts[rows], stage.yaws[rows]])
    low, high = np.full((len(blocks), 3), np.inf), np.full((len(blocks), 3), -np.inf)
    np.minimum.at(low, inverse.ravel(), values)
    np.maximum.at(high, inverse.ravel(), values)
    return blocks, low, high, rows[first]


def _halves(costs: Sequence[StageCosts], branch: _Branch, level: _Level, finer: _Level) -> list[_Branch]:
    cells = tuple(_split(stage, cells, level, finer) for stage, cells in zip(costs, branch.cells, strict=True))
    if finer.half_gauge == level.half_gauge:
        return [_Branch(branch.gauge, cells)]
    return [_Branch(branch.gauge + side * finer.half_gauge, cells) for side in (-1, 1)]


def _split(stage: StageCosts, cells: _Cells, level: _Level, finer: _Level) -> _Cells:
    """Cut every cell to the finer level."""
    old = np.array([level.block, level.block, level.yaws])
    new = np.array([finer.block, finer.block, finer.yaws])
    parents, parent_of_cell = np.unique(cells.block, axis=0, return_inverse=True)
    in_parent = _find_rows(parents, stage.keys // old)
    rows = np.flatnonzero(in_parent >= 0)
    blocks, low, high, member = _blocks(stage, rows, finer)
    parent_of_block = _find_rows(parents, blocks // (old // new))
    order = np.argsort(parent_of_block, kind="stable")
    start = np.searchsorted(parent_of_block[order], np.arange(len(parents) + 1))
    count = np.diff(start)[parent_of_cell.ravel()]
    cell = np.repeat(np.arange(len(cells.slot)), count)
    step = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
    child = order[start[parent_of_cell.ravel()[cell]] + step]
    sides = 1 if finer.half_turn == level.half_turn else 2
    each, side = np.repeat(child, sides), np.tile(np.arange(sides), len(child))
    slots = sides * np.repeat(cells.slot[cell], sides) + side
    return _Cells(blocks[each], slots, low[each], high[each], member[each])


def _find_rows(table: IntArray, rows: IntArray) -> IntArray:
    """Where rows stand in a table of unique rows; -1 where they do not."""
    low = table.min(0)
    span = table.max(0) - low + 1
    inside = ((rows >= low) & (rows < low + span)).all(1)
    codes = np.ravel_multi_index(tuple((table - low).T), tuple(span))
    order = np.argsort(codes)
    wanted = np.ravel_multi_index(tuple((np.where(inside[:, None], rows, low) - low).T), tuple(span))
    at = np.minimum(np.searchsorted(codes[order], wanted), len(codes) - 1)
    return np.where(inside & (codes[order][at] == wanted), order[at], -1)


def _bounds(
    costs: Sequence[StageCosts], branch: _Branch, level: _Level, budget: float
) -> tuple[list[FloatArray], IntArray]:
    """For every cell the least that a chain through it can cost; and a member of each cell of the cheapest chain of cells.

    Chains of more than the budget need not be told apart: they may come out as infinite.
    """
    parts = [_cell_bounds(stage, cells, branch.gauge, level) for stage, cells in zip(costs, branch.cells, strict=True)]
    forward, back = [parts[0][0]], []
    for before, after in zip(parts, parts[1:], strict=False):
        least, nearest = _cheapest_step(forward[-1], before[2], after[1], before[3], after[3], budget)
        forward.append(least + after[0])
        back.append(nearest)
    behind = [np.zeros(len(parts[-1][0]))]
    for before, after in zip(parts[-2::-1], parts[:0:-1], strict=True):
        rest = behind[-1] + after[0]
        behind.append(_cheapest_step(rest, after[1], before[2], after[3], before[3], budget)[0])
    through = [f + b for f, b in zip(forward, reversed(behind), strict=True)]
    cell = int(np.argmin(forward[-1]))
    chain = [cell]
    for nearest in reversed(back):
        chain.append(int(nearest[chain[-1]]))
    members = np.array([cells.member[c] for cells, c in zip(branch.cells, reversed(chain), strict=True)])
    return through, members


def _cell_bounds(
    stage: StageCosts, cells: _Cells, gauge: float, level: _Level
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Of every cell: least facing cost, centre of e at its first and last roots, and the radius around both."""
    middle, half = 0.5 * (cells.low + cells.high), 0.5 * (cells.high - cells.low)
    turn = -level.most_turn + (2 * cells.slot + 1) * level.half_turn
    mismatch = wrap_angle(turn + middle[:, 2] - gauge)
    off_a = np.maximum(np.abs(turn) - level.half_turn, 0)
    off_b = np.maximum(np.abs(mismatch) - level.half_turn - half[:, 2] - level.half_gauge, 0)
    unary = stage.weight_a * (1 - np.cos(off_a)) + stage.weight_b * (1 - np.cos(off_b))
    centres, radii = [], []
    for which in (0, -1):
        a, b = stage.roots_a[which], stage.roots_b[which]
        arm = middle[:, :2] - a
        placed = (rotation(turn) @ arm[:, :, None])[..., 0] + rotation(turn + middle[:, 2]) @ b
        centres.append(placed - rotation(gauge) @ b + a)
        turned = level.half_turn + half[:, 2] + level.half_gauge
        moved = np.linalg.norm(half[:, :2], axis=1) + np.linalg.norm(arm, axis=1) * level.half_turn
        radii.append(moved + np.linalg.norm(b) * turned)
    return np.asarray(unary), centres[0], centres[1], np.maximum(radii[0], radii[1])


@njit(cache=True, nogil=True)
def _cheapest_step(
    value: FloatArray,
    source: FloatArray,
    target: FloatArray,
    source_radius: FloatArray,
    target_radius: FloatArray,
    budget: float,
) -> tuple[FloatArray, IntArray]:
    """min over i of value_i + 1/2 max(0, |target_j - source_i| - radii)^2, for every j; and which i.

    Sources too far away along x for the budget are not looked at.
    """
    least = np.full(target.shape[0], np.inf)
    nearest = np.zeros(target.shape[0], np.int64)
    order = np.argsort(source[:, 0])
    along = source[order, 0]
    reach = np.sqrt(2 * budget) + source_radius.max()
    for j in range(target.shape[0]):
        first = np.searchsorted(along, target[j, 0] - reach - target_radius[j])
        stop = np.searchsorted(along, target[j, 0] + reach + target_radius[j], side="right")
        for at in range(first, stop):
            i = order[at]
            if value[i] >= least[j]:
                continue
            x, y = target[j, 0] - source[i, 0], target[j, 1] - source[i, 1]
            far = max(0.0, np.sqrt(x * x + y * y) - source_radius[i] - target_radius[j])
            cost = value[i] + 0.5 * far * far
            if cost < least[j]:
                least[j] = cost
                nearest[j] = i
    return least, nearest
