"""The cost of a chain of placements, and the best chain for given turns: what branching is made of."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import BoolArray, ComplexArray, FloatArray, Int32Array, IntArray
from mhvedit.optimise.stages import Stage
from mhvedit.optimise.steps import cheapest_step, exactly

MOST_POLISHES = 20
MOST_STEPS = 200  # of Newton's method
LEAST_DAMPING = 1e-6  # m^2, of its steps
SETTLED = 1e-7  # rad


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """A choice for every stage."""

    chosen: IntArray  # (G,) row of each stage
    turns: FloatArray  # (G,) rad, A's yaw in the world
    gauge: float  # rad
    cost: float  # m^2
    lower_bound: float = 0.0  # m^2, of every chain


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """A good chain, whatever the rows of its solutions are."""

    keys: IntArray  # (G, 3) on the pose lattice
    gauge: float  # rad


@dataclass(frozen=True, slots=True, eq=False)
class StageCosts:
    """One stage with both origins moved to the middle of all roots, so that a turn moves the roots little."""

    keys: IntArray  # (S, 3) on the pose lattice
    shifts: ComplexArray  # (S,) m, B's origin in A's frame
    yaws: FloatArray  # (S,) rad
    by_yaw: Int32Array  # (S,) rows, those of one yaw together, each yaw's ascending
    yaw_starts: IntArray  # (K + 1,) where each yaw starts in `by_yaw`
    roots_a: ComplexArray  # (2,) m, first and last, from the middle
    roots_b: ComplexArray  # (2,) m
    middle_a: complex  # m, of all roots of A
    middle_b: complex  # m
    weight_a: float  # m^2, of 1 - cos(turn)
    weight_b: float  # m^2, of 1 - cos(turn + yaw - gauge)


def stage_costs(stages: Sequence[Stage], *, facing_weight: float) -> tuple[StageCosts, ...]:
    """Prepare stages.

    Args:
        stages: in order.
        facing_weight: lambda, m^2.
    """
    middle_a = complex_of(np.concatenate([s.roots_a for s in stages])).mean()
    middle_b = complex_of(np.concatenate([s.roots_b for s in stages])).mean()
    prepared = []
    for s in stages:
        inner = [2 * float((np.diff(roots, axis=0) ** 2).sum()) for roots in (s.roots_a, s.roots_b)]
        facing = 2 * facing_weight * len(s.names)
        yaws = s.poses[:, 2]
        by_yaw = np.argsort(s.keys[:, 2].astype(np.int16), kind="stable").astype(np.int32)
        turned = s.keys[by_yaw, 2]
        yaw_of_key = np.zeros(turned[-1] + 1)
        yaw_of_key[s.keys[:, 2]] = yaws
        prepared.append(
            StageCosts(
                keys=s.keys,
                shifts=complex_of(s.poses) + (np.exp(1j * yaw_of_key) * middle_b - middle_a)[s.keys[:, 2]],
                yaws=yaws,
                by_yaw=by_yaw,
                yaw_starts=np.append(np.flatnonzero(np.diff(turned, prepend=-1)), len(turned)),
                roots_a=complex_of(s.roots_a[[0, -1]]) - middle_a,
                roots_b=complex_of(s.roots_b[[0, -1]]) - middle_b,
                middle_a=complex(middle_a),
                middle_b=complex(middle_b),
                weight_a=facing + inner[0],
                weight_b=facing + inner[1],
            )
        )
    return tuple(prepared)


def change_of_offset(stage: StageCosts, rows: IntArray, turn: FloatArray, gauge: float, which: int) -> ComplexArray:
    """The change e = d - D at the stage's first (0) or last (-1) roots.

    Args:
        stage: of the chain.
        rows: (N,) solutions.
        turn: (N,) rad.
        gauge: rad.
        which: 0 or -1.

    Returns:
        (N,) m.
    """
    kept = np.exp(1j * gauge) * stage.roots_b[which] - stage.roots_a[which]
    return np.asarray(np.exp(1j * turn) * vectors(stage, rows, which) - kept)


def vectors(stage: StageCosts, rows: IntArray, which: int) -> ComplexArray:
    """(N,) m, from A's root to B's in A's frame, of some solutions, at the first (0) or last (-1) roots."""
    return np.asarray(stage.shifts[rows] + np.exp(1j * stage.yaws[rows]) * stage.roots_b[which] - stage.roots_a[which])


def facing_cost(stage: StageCosts, mismatch: FloatArray, turn: FloatArray) -> FloatArray:
    """What turning both away from how they faced costs; `mismatch` is yaw - gauge."""
    return np.asarray(stage.weight_a * one_less_cos(turn) + stage.weight_b * one_less_cos(turn + mismatch))


def one_less_cos(angle: FloatArray) -> FloatArray:
    """1 - cos, exact for small angles too."""
    return np.asarray(2 * np.sin(0.5 * angle) ** 2)


def cheapest_turn(stage: StageCosts, mismatch: FloatArray) -> FloatArray:
    """The turn at which `facing_cost` is least."""
    return np.asarray(-np.angle(stage.weight_a + stage.weight_b * np.exp(1j * mismatch)))


def chain_cost(stages: Sequence[StageCosts], chosen: IntArray, turns: FloatArray, gauge: float) -> float:
    """The cost of a chain (Shi et al., eq. 16, positions eliminated)."""
    return _cost(_picked(stages, chosen), np.concatenate([[gauge], turns]))


def steps_of(stages: Sequence[StageCosts], chain: Chain) -> ComplexArray:
    """How far the vector between the roots goes from stage to stage beyond what both moved there by themselves.

    Args:
        stages: in order.
        chain: with its turns and gauge.

    Returns:
        (G - 1,) m.
    """
    change = _changes(_picked(stages, chain.chosen), np.concatenate([[chain.gauge], chain.turns]))[1]
    return np.asarray(change[0, 1:] - change[1, :-1])


@dataclass(frozen=True, slots=True, eq=False)
class _Picked:
    """One solution per stage, in complex numbers; first index: first or last root."""

    yaws: FloatArray  # (G,)
    arms: ComplexArray  # (2, G) from A's root to B's origin
    roots_a: ComplexArray  # (2, G)
    roots_b: ComplexArray  # (2, G)
    weights: FloatArray  # (2, G) of A and B


def _picked(stages: Sequence[StageCosts], chosen: IntArray) -> _Picked:
    roots_a = np.array([s.roots_a for s in stages]).T
    return _Picked(
        yaws=np.array([s.yaws[r] for s, r in zip(stages, chosen, strict=True)]),
        arms=np.array([s.shifts[r] for s, r in zip(stages, chosen, strict=True)]) - roots_a,
        roots_a=roots_a,
        roots_b=np.array([s.roots_b for s in stages]).T,
        weights=np.array([[s.weight_a for s in stages], [s.weight_b for s in stages]]),
    )


def complex_of(points: FloatArray) -> ComplexArray:
    """Points (..., 2 or more) as x + iy, so that turning is a product."""
    return np.asarray(points[..., 0] + 1j * points[..., 1])


def _cost(picked: _Picked, free: FloatArray) -> float:
    """The cost at (gauge, turns)."""
    off, change = _changes(picked, free)[:2]
    step = change[0, 1:] - change[1, :-1]
    return float((picked.weights * one_less_cos(off)).sum() + 0.5 * (np.abs(step) ** 2).sum())


def _changes(picked: _Picked, free: FloatArray) -> tuple[FloatArray, ComplexArray, ComplexArray, ComplexArray]:
    """All (2, G): turns of A and B; then, first and last, changes e, turned vectors between roots, kept roots of B."""
    gauge, turns = free[0], free[1:]
    off = np.stack([turns, turns + picked.yaws - gauge])
    turned = np.exp(1j * turns) * (picked.arms + np.exp(1j * picked.yaws) * picked.roots_b)
    kept = np.exp(1j * gauge) * picked.roots_b
    return off, turned - kept + picked.roots_a, turned, kept


def _slope_and_curvature(picked: _Picked, free: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and second derivatives of the cost by (gauge, turns)."""
    off, change, turned, kept = _changes(picked, free)
    step = change[0, 1:] - change[1, :-1]
    pull, spring = picked.weights * np.sin(off), picked.weights * np.cos(off)
    count = len(step)
    by_free = np.zeros((count, len(free)), np.complex128)  # of each step
    here = np.arange(count)
    by_free[:, 0] = -1j * (kept[0, 1:] - kept[1, :-1])
    by_free[here, here + 2] = 1j * turned[0, 1:]
    by_free[here, here + 1] = -1j * turned[1, :-1]
    slope = (np.conj(step) @ by_free).real
    slope[0] -= pull[1].sum()
    slope[1:] += pull.sum(0)
    curvature = (np.conj(by_free.T) @ by_free).real
    curvature[np.diag_indices(len(free))] += (np.conj(step) @ (1j * by_free)).real
    curvature[0, 0] += spring[1].sum()
    inner = np.arange(1, len(free))
    curvature[inner, inner] += spring.sum(0)
    curvature[0, 1:] -= spring[1]
    curvature[1:, 0] -= spring[1]
    return slope, curvature


def cheapest_chain(
    unary: Sequence[FloatArray], first: Sequence[ComplexArray], last: Sequence[ComplexArray], budget: float = np.inf
) -> tuple[IntArray, float]:
    """The best choice of a state per stage, exactly: each step of the recursion is a nearest-neighbour query.

    Args:
        unary: G of (S,) cost of each state, m^2.
        first: G of (S,) e at the stage's first roots, m.
        last: G of (S,) e at its last roots.
        budget: m^2; chains that cost more need not be told apart.

    Returns:
        (G,) states, and the cost.
    """
    value = np.asarray(unary[0], np.float64)
    back: list[IntArray] = []
    for g in range(1, len(unary)):
        least, nearest = cheapest_step(value, exactly(last[g - 1]), exactly(first[g]), budget - unary[g])
        back.append(nearest)
        value = unary[g] + least
    state = int(np.argmin(value))
    states = [state]
    for nearest in reversed(back):
        states.append(int(nearest[states[-1]]))
    return np.array(states[::-1]), float(value[state])


def chain_near(stages: Sequence[StageCosts], gauge: float) -> Chain:
    """The cheapest chain at a gauge if everybody turns so as to face best; then turned best.

    Args:
        stages: in order, of few solutions.
        gauge: rad.
    """
    rows = [np.arange(len(stage.yaws)) for stage in stages]
    turns = [cheapest_turn(stage, stage.yaws - gauge) for stage in stages]
    return with_best_turns(stages, _best_of(stages, rows, turns, gauge, np.inf)[0], gauge)


def start_of(stages: Sequence[StageCosts], chain: Chain) -> Start:
    """A chain for stages that hold other solutions too, or fewer."""
    return Start(np.array([stage.keys[row] for stage, row in zip(stages, chain.chosen, strict=True)]), chain.gauge)


def chain_from(stages: Sequence[StageCosts], start: Start) -> Chain:
    """A chain that is there, turned best.

    Args:
        stages: in order; its solutions are among theirs.
        start: see there.
    """
    rows = [np.flatnonzero((s.keys == key).all(1))[0] for s, key in zip(stages, start.keys, strict=True)]
    return with_best_turns(stages, np.array(rows), start.gauge)


def polished(stages: Sequence[StageCosts], chosen: IntArray, gauge: float) -> Chain:
    """Improve a chain: turns and gauge continuously, solutions by an exact pass over all, until nothing improves.

    Args:
        stages: in order.
        chosen: (G,) row of each.
        gauge: to start from, rad.
    """
    best = with_best_turns(stages, chosen, gauge)
    for _ in range(MOST_POLISHES):
        rows = [_affordable(s, t, best.gauge, best.cost) for s, t in zip(stages, best.turns, strict=True)]
        if not all(map(len, rows)):
            return best
        turns = [np.full(len(r), t) for r, t in zip(rows, best.turns, strict=True)]
        states, cost = _best_of(stages, rows, turns, best.gauge, best.cost)
        if cost >= best.cost * (1 - 1e-9):
            return best
        better = with_best_turns(stages, np.array([r[i] for r, i in zip(rows, states, strict=True)]), best.gauge)
        if better.cost >= best.cost * (1 - 1e-9):
            return best
        best = better
    return best


def with_best_turns(stages: Sequence[StageCosts], chosen: IntArray, gauge: float) -> Chain:
    """The chain of chosen solutions with the turns, and the gauge near a given one, at which it costs least.

    Args:
        stages: in order.
        chosen: (G,) row of each.
        gauge: to start from, rad.
    """
    start = [float(cheapest_turn(s, s.yaws[[r]] - gauge)[0]) for s, r in zip(stages, chosen, strict=True)]
    picked = _picked(stages, chosen)
    free = np.array([gauge, *start])
    cost, damping = _cost(picked, free), LEAST_DAMPING
    for _ in range(MOST_STEPS):
        slope, curvature = _slope_and_curvature(picked, free)
        values, directions = np.linalg.eigh(curvature)
        step = -directions @ ((directions.T @ slope) / (np.abs(values) + damping))
        if (tried := _cost(picked, free + step)) < cost:
            free, cost, damping = free + step, tried, 0.1 * damping
        elif np.abs(step).max() < SETTLED:
            break
        else:
            damping = 10 * max(damping, LEAST_DAMPING)
    return Chain(chosen, free[1:], float(free[0]), cost)


def _best_of(
    stages: Sequence[StageCosts], rows: Sequence[IntArray], turns: Sequence[FloatArray], gauge: float, budget: float
) -> tuple[IntArray, float]:
    triples = list(zip(stages, rows, turns, strict=True))
    return cheapest_chain(
        [facing_cost(s, s.yaws[r] - gauge, t) for s, r, t in triples],
        [change_of_offset(s, r, t, gauge, 0) for s, r, t in triples],
        [change_of_offset(s, r, t, gauge, -1) for s, r, t in triples],
        budget,
    )


def _affordable(stage: StageCosts, turn: float, gauge: float, budget: float) -> IntArray:
    """Solutions whose facing alone does not already cost more than the budget."""
    mismatch = yaws_of(stage) - gauge
    every = facing_cost(stage, mismatch, np.full(len(mismatch), turn))
    return rows_of_yaws(stage, every <= budget)


def yaws_of(stage: StageCosts) -> FloatArray:
    """(K,) rad, all yaws that a stage's solutions have."""
    return np.asarray(stage.yaws[stage.by_yaw[stage.yaw_starts[:-1]]])


def rows_of_yaws(stage: StageCosts, wanted: BoolArray) -> IntArray:
    """The solutions of some of a stage's yaws.

    Args:
        stage: of the chain.
        wanted: (K,) which yaws.
    """
    runs = [stage.by_yaw[stage.yaw_starts[k] : stage.yaw_starts[k + 1]] for k in np.flatnonzero(wanted)]
    return np.concatenate([np.zeros(0, np.int32), *runs]).astype(np.int64)
