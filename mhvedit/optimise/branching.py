"""The best chain where no single pose serves all segments, with a proof: branch and bound over poses, turns and gauge.

A branch is an interval of the gauge; a cell of it holds the solutions of one stage in a block of the pose lattice, with
an interval for the pair's turn in the world. A forward and a backward pass over the cells give the least that any chain
through a cell can cost. Cells that cannot beat the best chain known are dropped, the others are cut where they are
coarsest, until nothing can be better than the best by more than rounding. Branches that promise most go ahead.
"""

import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from mhvedit.geometry.arrays import BoolArray, ComplexArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.planar import wrap_angle
from mhvedit.optimise.blocks import (
    COARSEST,
    MAPPED,
    BlockMap,
    Blocks,
    Curve,
    coarsest_blocks,
    curve_of,
    curve_of_map,
    smaller_blocks,
)
from mhvedit.optimise.bounds import Links, bound_branches, loss_of, play_of, split_cells
from mhvedit.optimise.chains import Chain, StageCosts, Start, chain_from, steps_of, with_best_turns
from mhvedit.optimise.sampling import first_chain
from mhvedit.optimise.ties import TIE

EXACT = 1e-9  # relative gap at which refinement stops
SPARE = 1e-6  # share of a cost that floating point may lose, and more
NOTHING = 1e-15  # m^2; a chain that may be better by less is as good
MOST_CELLS = 12_000_000  # in one round; more stops refinement, and the gap says so
MOST_ROUNDS = 60
FIRST_YAWS = 8  # steps of yaw in a branch of the gauge at first
TRIED_FROM = 1  # level of blocks from which on the chain of the least bound is tried
PARTED_AT, FIRST_PART = 2, 8  # level of blocks, one branch in so many: see `_searched_in_parts`
THREADS = 2
PORTIONS = 16  # in which the branches are handed to the threads
ARM = 3.0  # m that a radian of turn or gauge counts for when choosing what to halve
LOSE_MOST, LOSE_MUCH, LOSE_HALF, LOSE_LITTLE = 1.5, 0.8, 0.5, 0.3  # of the best cost: see `_views` and `_finer`
SMOOTHINGS = 100  # rounds, of forces
STRAIGHT = 0.05  # of the way that the best cost allows: a path that bends by less


@dataclass(frozen=True, slots=True)
class _Level:
    """How fine cells are."""

    blocks: int  # level of the blocks
    half_turn: float  # rad
    half_gauge: float  # rad
    most_turn: float  # rad, turns lie between minus and plus this

    def halved(self, step: float, *, turn: float, gauge: float) -> "_Level":
        """Halve what is coarsest: everything that is at least half as coarse as the coarsest.

        Args:
            step: of x and y between poses, m.
            turn: m that a radian of turn counts for.
            gauge: m that a radian of gauge counts for.
        """
        block = step * 2**self.blocks if self.blocks > 0 else 0.0
        sizes = block, 2 * turn * self.half_turn, 2 * gauge * self.half_gauge
        halves = [size >= 0.5 * max(sizes) and size > 0 for size in sizes]
        return _Level(
            self.blocks - 1 if halves[0] else self.blocks,
            self.half_turn / 2 if halves[1] else self.half_turn,
            self.half_gauge / 2 if halves[2] else self.half_gauge,
            self.most_turn,
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """The cells of all branches, one branch after the other, in each one stage after the other."""

    gauges: FloatArray  # (B,) rad, middle of each branch
    bounds: IntArray  # (B, G + 1) where the cells of each stage start and stop
    block: Int32Array  # (N,) row of the blocks
    slot: Int32Array  # (N,) index of the interval of the turn

    def __len__(self) -> int:
        return len(self.block)


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """How a bound deals with turns and gauge.

    Where these are wide everything may move in its cell, which is good at first. Where they are 0 turns and gauge are
    held in the middle of their cells: a chain's cost is at rest at its best turns and gauge, so no more than a share of
    the square of the width is lost, and that is good at last. Between the two, forces keep together what a wide view
    lets move apart.
    """

    wide_turn: float  # rad
    wide_gauge: float  # rad
    forces: ComplexArray | None = None  # (G - 1,) m, see `bounds`; None for none


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """What stays the same in all rounds."""

    costs: Sequence[StageCosts]
    curves: tuple[Curve, ...]
    links: Links
    reach: FloatArray  # (G,) m, no vector between the roots of a stage is longer
    pool: ThreadPoolExecutor

    def loss(self, half_turn: float, half_gauge: float, cost: float) -> float:
        """What a view that holds turns and gauge that are uncertain by so much loses, at most."""
        return float(loss_of(self.links, self.reach, half_turn, half_gauge, cost))


@dataclass(slots=True)
class _Known:
    """The best chain so far, and what has been tried."""

    best: Chain
    tried: set[tuple[int, ...]]
    rivals: list[BoolArray]  # G of (S,) solutions that chains which tie with the best can be made of, and maybe others

    def budget(self, *, ties: bool) -> float:
        """What a chain may cost to count, m^2: less than the best one, or little more."""
        return self.best.cost * (1 + TIE) * (1 + SPARE) + NOTHING if ties else self.best.cost

    def is_proven_by(self, bound: float) -> bool:
        """Whether chains that cost no less than the bound are no better than the best, but for rounding."""
        return bound >= min(self.best.cost * (1 - EXACT), self.best.cost - NOTHING)


def best_chain(costs: Sequence[StageCosts], *, step: float, n_yaw: int, start: Start | None = None) -> Chain:
    """The best chain and a proven lower bound (Shi et al., eqs 16 to 18, with the gauge free).

    Args:
        costs: of all stages, none empty.
        step: of x and y between poses, m.
        n_yaw: yaw steps in a full turn.
        start: a good chain, if there is one.
    """
    return best_and_rivals(costs, step=step, n_yaw=n_yaw, start=start)[0]


def best_and_rivals(
    costs: Sequence[StageCosts], *, step: float, n_yaw: int, start: Start | None = None
) -> tuple[Chain, list[IntArray]]:
    """The best chain, as `best_chain` tells, and what ties with it.

    Returns:
        The chain; and of each stage the rows of the solutions that chains can be made of which cost no more than it but
        for `TIE`, and maybe others, ascending.
    """
    best = first_chain(costs) if start is None else chain_from(costs, start)
    known = _Known(best, set(), [np.zeros(len(stage.yaws), np.bool_) for stage in costs])
    with ThreadPoolExecutor(THREADS) as pool:
        problem = _problem(costs, list(pool.map(curve_of, costs)), pool)
        blocks = coarsest_blocks(problem.curves, pool)
        level, cells = _everything(costs, blocks, known.budget(ties=True), n_yaw)
        bound = _searched(problem, blocks, cells, level, known, step)
    best = known.best
    best = Chain(best.chosen, best.turns, best.gauge, best.cost, min(bound, best.cost))
    for own, row in zip(known.rivals, best.chosen, strict=True):
        own[row] = True
    return best, [np.flatnonzero(own) for own in known.rivals]


def blocks_within(
    costs: Sequence[StageCosts], maps: Sequence[BlockMap], *, budget: float, step: float, n_yaw: int
) -> list[BoolArray]:
    """The blocks that chains within a budget can go through, and maybe others.

    Args:
        costs: of all stages, with some of their solutions.
        maps: in which blocks the solutions of each are.
        budget: m^2.
        step: of x and y between poses, m.
        n_yaw: yaw steps in a full turn.

    Returns:
        Of each stage, as in its map.
    """
    within = Chain(np.zeros(len(costs), np.int64), np.zeros(len(costs)), 0.0, budget)
    with ThreadPoolExecutor(THREADS) as pool:
        curves = [curve_of_map(own, stage, step=step, n_yaw=n_yaw) for own, stage in zip(maps, costs, strict=True)]
        problem = _problem(costs, curves, pool)
        blocks = coarsest_blocks(curves, pool)
        level, cells = _everything(costs, blocks, budget, n_yaw)
        known = _Known(within, set(), [])
        while True:
            cells, _ = _round(problem, blocks, cells, level, known, ties=False)
            if level.blocks == MAPPED or len(cells) > MOST_CELLS // 8:
                break
            finer = _finer(problem, level, step, budget)
            blocks, cells = _refined(problem, blocks, cells, level, finer)
            level = finer
    flags = [np.zeros_like(own.there) for own in maps]
    _flag([own.reshape(-1) for own in flags], curves, blocks, cells)
    return flags


def _flag(flags: Sequence[BoolArray], curves: Sequence[Curve], blocks: Blocks, cells: _Cells) -> None:
    """Flag the rows of each stage that are in some cells."""
    alive = np.unique(cells.block)
    for g, (own, curve) in enumerate(zip(flags, curves, strict=True)):
        starts, stops = (np.bincount(edges, minlength=len(curve.rows) + 1)
                         for edges in blocks.run[alive[blocks.stage[alive] == g]].T)  # fmt: skip
        own[curve.rows[np.cumsum(starts - stops)[:-1] > 0]] = True


def _problem(costs: Sequence[StageCosts], curves: Sequence[Curve], pool: ThreadPoolExecutor) -> _Problem:
    reach = [max(np.abs(curve.first).max(), np.abs(curve.last).max()) + abs(curve.half) for curve in curves]
    return _Problem(costs, tuple(curves), _links(costs), np.array(reach), pool)


def _links(costs: Sequence[StageCosts]) -> Links:
    pairs = list(itertools.pairwise(costs))
    return Links(
        weight_a=np.array([stage.weight_a for stage in costs]),
        weight_b=np.array([stage.weight_b for stage in costs]),
        kept_a=np.array([after.roots_a[0] - before.roots_a[-1] for before, after in pairs], np.complex128),
        kept_b=np.array([after.roots_b[0] - before.roots_b[-1] for before, after in pairs], np.complex128),
    )


def _everything(costs: Sequence[StageCosts], blocks: Blocks, cost: float, n_yaw: int) -> tuple[_Level, _Cells]:
    """All that can be part of a chain of the given cost, in as few cells as can be."""
    most_turn = max(_most_turn(stage, cost) for stage in costs)
    n_gauges = -(-n_yaw // FIRST_YAWS)
    gauges = (np.arange(n_gauges) + 0.5) * 2 * np.pi / n_gauges
    stops = np.concatenate([[0], np.cumsum(np.bincount(blocks.stage, minlength=len(costs)))])
    bounds = np.arange(n_gauges)[:, None] * len(blocks) + stops
    block = np.tile(np.arange(len(blocks), dtype=np.int32), n_gauges)
    level = _Level(COARSEST, most_turn, np.pi / n_gauges, most_turn)
    return level, _Cells(gauges, bounds, block, np.zeros(len(block), np.int32))


def _most_turn(stage: StageCosts, cost: float) -> float:
    """A turn further than this costs more on its own."""
    if cost >= 2 * stage.weight_a:
        return float(np.pi)
    return float(2 * np.arcsin(np.sqrt(cost / (2 * stage.weight_a))))


def _searched(problem: _Problem, blocks: Blocks, cells: _Cells, level: _Level, known: _Known, step: float) -> float:
    """Search some cells until nothing in them is better than the best chain known by more than rounding.

    What ties with it is flagged as soon as blocks are single poses; then it is left out too.

    Returns:
        What every chain in them costs at least, if not more than the best.
    """
    bound, ties = 0.0, True
    for _ in range(MOST_ROUNDS):
        cells, through = _round(problem, blocks, cells, level, known, ties=ties)
        if ties and level.blocks == 0:
            _flag(known.rivals, problem.curves, blocks, cells)
            ties = False
            cells, through = _kept(cells, through, known.budget(ties=ties))
        bound = max(bound, float(through.min(initial=known.best.cost)))
        if known.is_proven_by(bound):
            break
        finer = _finer(problem, level, step, known.best.cost)
        if finer.blocks < PARTED_AT == level.blocks:
            return max(bound, _searched_in_parts(problem, blocks, cells, through, level, known, step))
        blocks, cells = _refined(problem, blocks, cells, level, finer)
        level = finer
        if len(cells) > MOST_CELLS:
            break
    if ties:
        _flag(known.rivals, problem.curves, blocks, cells)
    return bound


def _searched_in_parts(
    problem: _Problem,
    blocks: Blocks,
    cells: _Cells,
    through: FloatArray,
    level: _Level,
    known: _Known,
    step: float,
) -> float:
    """As `_searched`, the most promising branches first: the chain that they lead to may spare much of the others."""
    least = np.minimum.reduceat(through, cells.bounds[:, 0])
    away = np.abs(wrap_angle(cells.gauges - known.best.gauge))
    order = np.lexsort((away, np.round(100 * least / known.best.cost)))
    promising = np.zeros(len(least), np.bool_)
    promising[order[: -(-len(least) // FIRST_PART)]] = True
    bounds = []
    for some in (promising, ~promising):
        wanted = np.repeat(some, cells.bounds[:, -1] - cells.bounds[:, 0])
        part, _ = _kept(cells, np.where(wanted, through, np.inf), known.budget(ties=True))
        finer = _finer(problem, level, step, known.best.cost)
        fine, part = _refined(problem, blocks, part, level, finer)
        bounds.append(_searched(problem, fine, part, finer, known, step))
    return min(bounds)


def _round(
    problem: _Problem, blocks: Blocks, cells: _Cells, level: _Level, known: _Known, *, ties: bool
) -> tuple[_Cells, FloatArray]:
    """Bound every branch in all views that promise something.

    Returns:
        The cells that a better chain may be in, or one that ties, and the least cost of chains through each.
    """
    through = np.zeros(len(cells))
    for view in _views(problem, blocks, level, known.best):
        bounds, least, chains = _bounded(problem, blocks, cells, level, view, known.budget(ties=ties))
        if level.blocks <= TRIED_FROM and least.min(initial=np.inf) < known.best.cost:
            _try(problem, blocks, chains[least.argmin()], float(cells.gauges[least.argmin()]), known)
        through = np.maximum(through, bounds)
        cells, through = _kept(cells, through, known.budget(ties=ties))
    return cells, through


def _finer(problem: _Problem, level: _Level, step: float, cost: float) -> _Level:
    """The next level.

    As long as the paths of turns are straight the wide view needs no cutting of turns; it does until the gauge can be
    held. Then turns are cut at once as finely as the flat view needs them.
    """
    if problem.reach.max() * level.half_turn**2 > STRAIGHT * np.sqrt(2 * cost):
        return level.halved(step, turn=ARM, gauge=ARM)
    by_gauge = problem.loss(0.0, level.half_gauge, cost)
    if level.blocks > 0 or by_gauge > LOSE_LITTLE * cost:
        return level.halved(step, turn=0.0, gauge=ARM)
    if problem.loss(level.half_turn, level.half_gauge, cost) > LOSE_MUCH * cost:
        parts = 2
        while problem.loss(level.half_turn / parts, level.half_gauge, cost) > LOSE_MUCH * cost:
            parts *= 2
        return replace(level, half_turn=level.half_turn / parts)
    return replace(level, half_turn=level.half_turn / 2, half_gauge=level.half_gauge / 2)


def _views(problem: _Problem, blocks: Blocks, level: _Level, best: Chain) -> list[_View]:
    """Wide until the flat view loses little, with forces where they have little play; flat where that loses little.

    Forces are those of the best chain, so there are none while blocks are those of maps, through which none is known.
    """
    cost = best.cost
    lost = problem.loss(level.half_turn, level.half_gauge, cost)
    views = []
    if lost > LOSE_MUCH * cost:
        held = problem.loss(0.0, level.half_gauge, cost) < LOSE_LITTLE * cost
        wide = _View(level.half_turn, 0.0 if held else level.half_gauge)
        views.append(wide)
        forces = _forces(problem, blocks, wide, best) if level.blocks < MAPPED else None
        if forces is not None:
            views.append(replace(wide, forces=forces))
    if lost < LOSE_MOST * cost:
        views.append(_View(0.0, 0.0))
    return views


def _forces(problem: _Problem, blocks: Blocks, wide: _View, best: Chain) -> ComplexArray | None:
    """(G - 1,) m, forces with which a bound keeps half of what the best chain costs, if there are any."""
    steps = steps_of(problem.costs, best)
    half = complex(blocks.half.real.max(initial=0.0), blocks.half.imag.max(initial=0.0))
    forces = _least_losing(steps, half)
    off = 0.5 * float((np.abs(forces - steps) ** 2).sum())
    lost = off + play_of(problem.links, forces, half, best.gauge, wide.wide_gauge)
    return forces if lost < LOSE_HALF * best.cost else None


def _least_losing(steps: ComplexArray, half: complex) -> ComplexArray:
    """The forces with which a bound loses least of a chain, if its blocks are of one size.

    It loses half of the squares of what forces are off the chain's steps, and their play, which grows with the
    differences of one force and the next: so these are the steps with their total variation reduced, by descent on the
    dual with momentum (Beck and Teboulle, 2009).

    Args:
        steps: (G - 1,) m, of the chain.
        half: m, half of the sides of the blocks.
    """
    both, most = np.array([steps.real, steps.imag]), np.array([[half.real], [half.imag]])
    dual = ahead = np.zeros((2, len(steps) + 1))
    for n in range(SMOOTHINGS):
        before = dual
        dual = np.clip(ahead + 0.25 * np.diff(both + np.diff(ahead), prepend=0.0, append=0.0), -most, most)
        ahead = dual + n / (n + 3) * (dual - before)
    smooth = both + np.diff(dual)
    return np.asarray(smooth[0] + 1j * smooth[1])


def _bounded(
    problem: _Problem, blocks: Blocks, cells: _Cells, level: _Level, view: _View, budget: float
) -> tuple[FloatArray, FloatArray, IntArray]:
    """The least cost of chains through each cell and of each branch, and the blocks of each branch's cheapest chain."""
    n_branches, n_stages = len(cells.gauges), len(problem.costs)
    through, least = np.empty(len(cells)), np.empty(n_branches)
    forces = np.zeros(n_stages - 1, np.complex128) if view.forces is None else view.forces
    chains = np.zeros((n_branches, n_stages), np.int64)

    def bound(branches: IntArray) -> None:
        bound_branches(
            branches,
            (cells.gauges, cells.bounds, cells.block, cells.slot),
            (blocks.first, blocks.last, blocks.half, blocks.yaw, blocks.half_yaw),
            problem.links,
            (level.half_turn, level.half_gauge, level.most_turn, view.wide_turn, view.wide_gauge),
            forces,
            budget,
            (through, least, chains),
        )

    list(problem.pool.map(bound, [np.arange(k, n_branches, PORTIONS) for k in range(PORTIONS)]))
    return through, least, chains


def _try(problem: _Problem, blocks: Blocks, chain: IntArray, gauge: float, known: _Known) -> None:
    """Turn a chain of one solution from each of some blocks best, once."""
    rows = np.array([curve.rows[blocks.run[block, 0]] for curve, block in zip(problem.curves, chain, strict=True)])
    if tuple(rows.tolist()) not in known.tried:
        known.tried.add(tuple(rows.tolist()))
        known.best = min(known.best, with_best_turns(problem.costs, rows, gauge), key=lambda chain: chain.cost)


def _kept(cells: _Cells, through: FloatArray, cost: float) -> tuple[_Cells, FloatArray]:
    """The cells through which a chain can cost less, and what; branches in which a stage has none are left out."""
    mask = through < cost
    starts = np.concatenate([[0], np.cumsum(mask)])[cells.bounds]
    alive = (np.diff(starts, axis=1) > 0).all(1)
    mask = mask & np.repeat(alive, cells.bounds[:, -1] - cells.bounds[:, 0])
    starts = np.concatenate([[0], np.cumsum(mask)])[cells.bounds[alive]]
    return _Cells(cells.gauges[alive], starts, cells.block[mask], cells.slot[mask]), through[mask]


def _refined(problem: _Problem, blocks: Blocks, cells: _Cells, level: _Level, finer: _Level) -> tuple[Blocks, _Cells]:
    """Cut every cell to the finer level, and the branches too where their gauge is halved."""
    if finer.blocks == level.blocks:
        fine, child_starts = blocks, np.arange(len(blocks) + 1)
    else:
        used = np.flatnonzero(np.bincount(cells.block, minlength=len(blocks)))
        fine, child_starts = smaller_blocks(problem.curves, blocks, used, problem.pool)
    sides = round(level.half_turn / finer.half_turn)
    stops = np.concatenate([[0], np.cumsum(np.diff(child_starts)[cells.block] * sides)])
    block, slot = split_cells(cells.block, cells.slot, child_starts, sides, int(stops[-1]))
    gauges, bounds = cells.gauges, stops[cells.bounds]
    if finer.half_gauge == level.half_gauge:
        return fine, _Cells(gauges, bounds, block, slot)
    gauges = np.concatenate([gauges - finer.half_gauge, gauges + finer.half_gauge])
    return fine, _Cells(gauges, np.concatenate([bounds, bounds + len(block)]), np.tile(block, 2), np.tile(slot, 2))
