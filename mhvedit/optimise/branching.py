"""The best chain where no single pose serves all segments, with a proof: branch and bound over poses, turns and gauge.

A branch is an interval of the gauge; a cell of it holds the solutions of one stage in a block of the pose lattice, with
an interval for the pair's turn in the world. Within a cell e lies in a disc and the facing cost has a lower bound, so a
forward and a backward pass over the cells give the least that any chain through a cell can cost. Cells that cannot beat
the best chain known are dropped; the others are cut where they are coarsest. What is dropped is never better than the
best chain, so the least bound of the cells that are left is a bound for all chains.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.planar import wrap_angle
from mhvedit.optimise.chains import (
    Chain,
    ComplexArray,
    StageCosts,
    complex_of,
    first_chain,
    one_less_cos,
    polished,
    stage_costs,
)
from mhvedit.optimise.stages import Stage, pose_codes

GOOD_ENOUGH = 0.009  # relative gap at which refinement stops
NOTHING = 1e-9  # m^2; a chain that may be better by less is as good
MOST_CELLS = 3_000_000  # in one round; more stops refinement, and the gap says so
MOST_ROUNDS = 40
FIRST_BLOCK = 32  # steps of x and y in a block at first
FIRST_YAWS = 8  # steps of yaw in a block, and in a branch of the gauge, at first
ARM = 2.0  # m that a radian of yaw, turn or gauge counts for when choosing what to halve


@dataclass(frozen=True, slots=True, eq=False)
class _Blocks:
    """All blocks of the pose lattice that hold solutions of one stage."""

    index: IntArray  # (N, 3) of the block, ascending
    middle: FloatArray  # (N, 3) of the shifts (about the middle of all roots) and yaws of what the block holds
    half: FloatArray  # (N, 3) half their extent
    member: IntArray  # (N,) a solution inside


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """Cells of one stage in one branch."""

    block: IntArray  # (N,) row of the blocks
    slot: IntArray  # (N,) index of the interval of the turn


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
    blocks = [_blocks(stage, level) for stage in costs]
    everything = tuple(_Cells(np.arange(len(own.member)), np.zeros(len(own.member), np.int64)) for own in blocks)
    gauges = np.arange(0, 2 * np.pi, 2 * level.half_gauge) + level.half_gauge
    branches = [_Branch(float(gauge), everything) for gauge in gauges]
    bound = 0.0
    for _ in range(MOST_ROUNDS):
        if sum(len(cells.slot) for branch in branches for cells in branch.cells) > MOST_CELLS:
            break
        best, round_bound, branches = _round(costs, blocks, branches, level, best)
        bound = max(bound, round_bound)
        if not branches or bound >= best.cost * (1 - GOOD_ENOUGH) or bound >= best.cost - NOTHING:
            break
        finer = level.halved(step=step, yaw_step=yaw_step)
        blocks, branches = _refined(costs, blocks, branches, level, finer)
        level = finer
    return Chain(best.chosen, best.turns, best.gauge, best.cost, min(bound, best.cost))


def _round(
    costs: Sequence[StageCosts], blocks: Sequence[_Blocks], branches: Sequence[_Branch], level: _Level, best: Chain
) -> tuple[Chain, float, list[_Branch]]:
    """Bound every branch; returns the best chain known, the least bound, and what of the branches is left."""
    bounded = [(branch, *_bounds(costs, blocks, branch, level, best.cost)) for branch in branches]
    promising, through, members = min(bounded, key=lambda item: float(item[1][0].min()))
    if through[0].min() < best.cost:
        best = min(best, polished(costs, members, promising.gauge), key=lambda chain: chain.cost)
    bound = min([best.cost, *(float(through[0].min()) for _, through, _ in bounded)])
    survivors = []
    for branch, through, _ in bounded:
        kept = [_kept(cells, least < best.cost) for cells, least in zip(branch.cells, through, strict=True)]
        if all(len(cells.slot) for cells in kept):
            survivors.append(_Branch(branch.gauge, tuple(kept)))
    return best, bound, survivors


def _most_turn(stage: StageCosts, cost: float) -> float:
    """A turn further than this costs more on its own."""
    if cost >= 2 * stage.weight_a:
        return float(np.pi)
    return float(2 * np.arcsin(np.sqrt(cost / (2 * stage.weight_a))))


def _kept(cells: _Cells, mask: BoolArray) -> _Cells:
    return _Cells(cells.block[mask], cells.slot[mask])


def _blocks(stage: StageCosts, level: _Level) -> _Blocks:
    """Cut the lattice into blocks; those that hold no solution are left out."""
    index = stage.keys // np.array([level.block, level.block, level.yaws])
    codes = pose_codes(index)
    order = np.argsort(codes, kind="stable")
    starts = np.flatnonzero(np.diff(codes[order], prepend=-1))
    values = np.column_stack([stage.shifts, stage.yaws])[order]
    low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    member = order[starts]
    return _Blocks(index[member], 0.5 * (low + high), 0.5 * (high - low), member)


def _refined(
    costs: Sequence[StageCosts], blocks: Sequence[_Blocks], branches: Sequence[_Branch], level: _Level, finer: _Level
) -> tuple[list[_Blocks], list[_Branch]]:
    """Cut every cell of every branch to the finer level, and the branches too where their gauge is halved."""
    fine = [_blocks(stage, finer) for stage in costs]
    ratio = np.array([level.block // finer.block, level.block // finer.block, level.yaws // finer.yaws])
    children = [_children(before, after, ratio) for before, after in zip(blocks, fine, strict=True)]
    sides = 1 if finer.half_turn == level.half_turn else 2
    split = []
    for branch in branches:
        cells = tuple(_split(own, *child, sides) for own, child in zip(branch.cells, children, strict=True))
        if finer.half_gauge == level.half_gauge:
            split.append(_Branch(branch.gauge, cells))
        else:
            split += [_Branch(branch.gauge + side * finer.half_gauge, cells) for side in (-1, 1)]
    return fine, split


def _children(coarse: _Blocks, fine: _Blocks, ratio: IntArray) -> tuple[IntArray, IntArray]:
    """The finer blocks, sorted by the coarse block they are in, and where those of each coarse block start."""
    parents = np.searchsorted(pose_codes(coarse.index), pose_codes(fine.index // ratio))
    order = np.argsort(parents, kind="stable")
    return order, np.searchsorted(parents[order], np.arange(len(coarse.member) + 1))


def _split(cells: _Cells, children: IntArray, start: IntArray, sides: int) -> _Cells:
    """Every cell's finer blocks, each with the halves of its interval of the turn where `sides` is 2."""
    count = np.diff(start)[cells.block]
    cell = np.repeat(np.arange(len(count)), count)
    nth = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
    block = children[start[cells.block[cell]] + nth]
    slot = sides * np.repeat(cells.slot[cell], sides) + np.tile(np.arange(sides), len(cell))
    return _Cells(np.repeat(block, sides), slot)


def _bounds(
    costs: Sequence[StageCosts], blocks: Sequence[_Blocks], branch: _Branch, level: _Level, budget: float
) -> tuple[list[FloatArray], IntArray]:
    """The least that a chain through each cell can cost; and a member of each cell of the cheapest chain of cells.

    Chains of more than the budget need not be told apart: they may come out as infinite.
    """
    parts = [
        _cell_bounds(stage, own, cells, branch.gauge, level)
        for stage, own, cells in zip(costs, blocks, branch.cells, strict=True)
    ]
    forward, back = [parts[0].unary], []
    for before, after in itertools.pairwise(parts):
        least, nearest = _cheapest_step(forward[-1], before.last, after.first, before.radius, after.radius, budget)
        forward.append(least + after.unary)
        back.append(nearest)
    behind = [np.zeros(len(parts[-1].unary))]
    for after, before in itertools.pairwise(reversed(parts)):
        rest = behind[-1] + after.unary
        behind.append(_cheapest_step(rest, after.first, before.last, after.radius, before.radius, budget)[0])
    through = [f + b for f, b in zip(forward, reversed(behind), strict=True)]
    chain = [int(np.argmin(forward[-1]))]
    for nearest in reversed(back):
        chain.append(int(nearest[chain[-1]]))
    zipped = zip(blocks, branch.cells, reversed(chain), strict=True)
    return through, np.array([own.member[cells.block[cell]] for own, cells, cell in zipped])


@dataclass(frozen=True, slots=True, eq=False)
class _CellBounds:
    """What is known of every cell of a stage."""

    unary: FloatArray  # (N,) least facing cost, m^2
    first: ComplexArray  # (N,) centre of e at the stage's first roots, m
    last: ComplexArray  # (N,) and at its last
    radius: FloatArray  # (N,) m, around both


def _cell_bounds(stage: StageCosts, blocks: _Blocks, cells: _Cells, gauge: float, level: _Level) -> _CellBounds:
    middle, half = blocks.middle[cells.block], blocks.half[cells.block]
    turn = -level.most_turn + (2 * cells.slot + 1) * level.half_turn
    turned = level.half_turn + half[:, 2] + level.half_gauge
    off_a = np.maximum(np.abs(turn) - level.half_turn, 0)
    off_b = np.maximum(np.abs(wrap_angle(turn + middle[:, 2] - gauge)) - turned, 0)
    spin, spin_b, shift = np.exp(1j * turn), np.exp(1j * (turn + middle[:, 2])), complex_of(middle)
    reach = np.hypot(half[:, 0], half[:, 1])
    centres, radii = [], []
    for which in (0, -1):
        a, b = complex_of(stage.roots_a[which]), complex_of(stage.roots_b[which])
        arm = shift - a
        centres.append(spin * arm + (spin_b - np.exp(1j * gauge)) * b + a)
        radii.append(reach + np.abs(arm) * level.half_turn + np.abs(b) * turned)
    unary = stage.weight_a * one_less_cos(off_a) + stage.weight_b * one_less_cos(off_b)
    return _CellBounds(np.asarray(unary), centres[0], centres[1], np.maximum(radii[0], radii[1]))


@njit(cache=True, nogil=True)
def _cheapest_step(
    value: FloatArray,
    source: ComplexArray,
    target: ComplexArray,
    source_radius: FloatArray,
    target_radius: FloatArray,
    budget: float,
) -> tuple[FloatArray, IntArray]:
    """The least over i of value_i + 1/2 max(0, |target_j - source_i| - radii)^2, for every j; and which i.

    Sources too far away along x for the budget are not looked at.
    """
    least = np.full(target.shape[0], np.inf)
    nearest = np.zeros(target.shape[0], np.int64)
    order = np.argsort(source.real)
    along = source.real[order]
    reach = np.sqrt(2 * budget) + source_radius.max()
    for j in range(target.shape[0]):
        first = np.searchsorted(along, target[j].real - reach - target_radius[j])
        stop = np.searchsorted(along, target[j].real + reach + target_radius[j], side="right")
        for at in range(first, stop):
            i = order[at]
            if value[i] >= least[j]:
                continue
            far = max(0.0, abs(target[j] - source[i]) - source_radius[i] - target_radius[j])
            cost = value[i] + 0.5 * far * far
            if cost < least[j]:
                least[j] = cost
                nearest[j] = i
    return least, nearest
