"""The cost of a chain of placements, and the best chain for given turns: what branching is made of."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import rotation
from mhvedit.optimise.stages import Stage

ComplexArray = NDArray[np.complex128]

SAMPLE = 500  # solutions a stage when looking for a first chain
NEAR = np.radians(12)  # yaw against the gauge of solutions that a first chain may use
MOST_POLISHES = 20


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """A choice for every stage."""

    chosen: IntArray  # (G,) row of each stage
    turns: FloatArray  # (G,) rad, A's yaw in the world
    gauge: float  # rad
    cost: float  # m^2
    lower_bound: float = 0.0  # m^2, of every chain


@dataclass(frozen=True, slots=True, eq=False)
class StageCosts:
    """One stage with both origins moved to the middle of all roots, so that a turn moves the roots little."""

    keys: IntArray  # (S, 3) on the pose lattice
    shifts: FloatArray  # (S, 2) m, B's origin in A's frame
    yaws: FloatArray  # (S,) rad
    roots_a: FloatArray  # (n, 2) m
    roots_b: FloatArray  # (n, 2) m
    weight_a: float  # m^2, of 1 - cos(turn)
    weight_b: float  # m^2, of 1 - cos(turn + yaw - gauge)


def stage_costs(stages: Sequence[Stage], *, facing_weight: float) -> tuple[StageCosts, ...]:
    """Prepare stages.

    Args:
        stages: in order.
        facing_weight: lambda, m^2.
    """
    middle_a = np.concatenate([s.roots_a for s in stages]).mean(0)
    middle_b = np.concatenate([s.roots_b for s in stages]).mean(0)
    prepared = []
    for s in stages:
        inner = [2 * float((np.diff(roots, axis=0) ** 2).sum()) for roots in (s.roots_a, s.roots_b)]
        facing = 2 * facing_weight * len(s.names)
        shifts = s.poses[:, :2] + rotation(s.poses[:, 2]) @ middle_b - middle_a
        roots = s.roots_a - middle_a, s.roots_b - middle_b
        weights = facing + inner[0], facing + inner[1]
        prepared.append(StageCosts(s.keys, shifts, s.poses[:, 2], *roots, *weights))
    return tuple(prepared)


def change_of_offset(stage: StageCosts, rows: IntArray, turn: FloatArray, gauge: float, which: int) -> FloatArray:
    """The change e = d - D at the stage's first (0) or last (-1) roots.

    Args:
        stage: of the chain.
        rows: (N,) solutions.
        turn: (N,) rad.
        gauge: rad.
        which: 0 or -1.

    Returns:
        (N, 2) m.
    """
    a, b = stage.roots_a[which], stage.roots_b[which]
    yaws = stage.yaws[rows]
    placed = (rotation(turn) @ (stage.shifts[rows] - a)[:, :, None])[..., 0] + rotation(turn + yaws) @ b
    return np.asarray(placed - rotation(gauge) @ b + a)


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
    return _cost_and_slope(_picked(stages, chosen), np.concatenate([[gauge], turns]))[0]


@dataclass(frozen=True, slots=True, eq=False)
class _Picked:
    """One solution per stage, in complex numbers; first index: first or last root."""

    yaws: FloatArray  # (G,)
    arms: ComplexArray  # (2, G) from A's root to B's origin
    roots_a: ComplexArray  # (2, G)
    roots_b: ComplexArray  # (2, G)
    weights: FloatArray  # (2, G) of A and B


def _picked(stages: Sequence[StageCosts], chosen: IntArray) -> _Picked:
    shifts = complex_of(np.array([s.shifts[r] for s, r in zip(stages, chosen, strict=True)]))
    roots_a = complex_of(np.array([[s.roots_a[which] for s in stages] for which in (0, -1)]))
    return _Picked(
        yaws=np.array([s.yaws[r] for s, r in zip(stages, chosen, strict=True)]),
        arms=shifts - roots_a,
        roots_a=roots_a,
        roots_b=complex_of(np.array([[s.roots_b[which] for s in stages] for which in (0, -1)])),
        weights=np.array([[s.weight_a for s in stages], [s.weight_b for s in stages]]),
    )


def complex_of(points: FloatArray) -> ComplexArray:
    """Points (..., 2) as x + iy, so that turning is a product."""
    return np.asarray(points[..., 0] + 1j * points[..., 1])


def _cost_and_slope(picked: _Picked, free: FloatArray) -> tuple[float, FloatArray]:
    """The cost and its derivative by (gauge, turns)."""
    gauge, turns = free[0], free[1:]
    off = np.stack([turns, turns + picked.yaws - gauge])
    turned = np.exp(1j * turns) * (picked.arms + np.exp(1j * picked.yaws) * picked.roots_b)
    kept = np.exp(1j * gauge) * picked.roots_b
    change = turned - kept + picked.roots_a
    step = change[0, 1:] - change[1, :-1]
    pull = picked.weights * np.sin(off)
    by_turn = pull.sum(0)
    by_turn[1:] -= (np.conj(step) * turned[0, 1:]).imag
    by_turn[:-1] += (np.conj(step) * turned[1, :-1]).imag
    by_gauge = (np.conj(step) * (kept[0, 1:] - kept[1, :-1])).imag.sum() - pull[1].sum()
    cost = float((picked.weights * one_less_cos(off)).sum() + 0.5 * (np.abs(step) ** 2).sum())
    return cost, np.concatenate([[by_gauge], by_turn])


def cheapest_chain(
    unary: Sequence[FloatArray], first: Sequence[FloatArray], last: Sequence[FloatArray]
) -> tuple[IntArray, float]:
    """The best choice of a state per stage, exactly: each step of the recursion is a nearest-neighbour query.

    Args:
        unary: G of (S,) cost of each state, m^2.
        first: G of (S, 2) e at the stage's first roots, m.
        last: G of (S, 2) e at its last roots.

    Returns:
        (G,) states, and the cost.
    """
    value = np.array(unary[0])
    back: list[IntArray] = []
    for g in range(1, len(unary)):
        lift = np.sqrt(2 * (value - value.min()))
        tree = cKDTree(np.column_stack([last[g - 1], lift]))
        far, nearest = tree.query(np.column_stack([first[g], np.zeros(len(first[g]))]))
        back.append(np.asarray(nearest, np.int64))
        value = unary[g] + value.min() + 0.5 * far**2
    state = int(np.argmin(value))
    states = [state]
    for nearest in reversed(back):
        states.append(int(nearest[states[-1]]))
    return np.array(states[::-1]), float(value[state])


def first_chain(stages: Sequence[StageCosts], *, yaw_step: float) -> Chain:
    """A good chain to start from: every gauge on the lattice, a sample of the solutions that nearly fit it."""
    best = None
    orders = [np.argsort(stage.yaws, kind="stable") for stage in stages]
    for gauge in np.arange(0, 2 * np.pi, yaw_step):
        rows = [_sample(stage, order, gauge) for stage, order in zip(stages, orders, strict=True)]
        if any(len(r) == 0 for r in rows):
            continue
        turns = [cheapest_turn(s, s.yaws[r] - gauge) for s, r in zip(stages, rows, strict=True)]
        states, cost = _best_of(stages, rows, turns, gauge)
        if best is None or cost < best.cost:
            chosen = np.array([r[i] for r, i in zip(rows, states, strict=True)])
            best = Chain(chosen, np.array([t[i] for t, i in zip(turns, states, strict=True)]), float(gauge), cost)
    if best is None:
        chosen = np.zeros(len(stages), np.int64)
        best = Chain(chosen, np.zeros(len(stages)), float(stages[0].yaws[0]), np.inf)
    return polished(stages, best.chosen, best.gauge)


def polished(stages: Sequence[StageCosts], chosen: IntArray, gauge: float) -> Chain:
    """Improve a chain: turns and gauge continuously, solutions by an exact pass over all, until nothing improves."""
    best = with_best_turns(stages, chosen, gauge)
    for _ in range(MOST_POLISHES):
        rows = [_affordable(s, t, best) for s, t in zip(stages, best.turns, strict=True)]
        turns = [np.full(len(r), t) for r, t in zip(rows, best.turns, strict=True)]
        states, cost = _best_of(stages, rows, turns, best.gauge)
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
    guess = np.array([gauge, *start])
    found = minimize(_cost_and_slope_at, guess, args=(picked,), jac=True, method="BFGS", tol=1e-12)
    cost, kept = min(((_cost_and_slope(picked, x)[0], x) for x in (guess, found.x)), key=lambda pair: pair[0])
    return Chain(chosen, kept[1:], float(kept[0]), cost)


def _cost_and_slope_at(free: FloatArray, picked: _Picked) -> tuple[float, FloatArray]:
    return _cost_and_slope(picked, free)


def _best_of(
    stages: Sequence[StageCosts], rows: Sequence[IntArray], turns: Sequence[FloatArray], gauge: float
) -> tuple[IntArray, float]:
    triples = list(zip(stages, rows, turns, strict=True))
    return cheapest_chain(
        [facing_cost(s, s.yaws[r] - gauge, t) for s, r, t in triples],
        [change_of_offset(s, r, t, gauge, 0) for s, r, t in triples],
        [change_of_offset(s, r, t, gauge, -1) for s, r, t in triples],
    )


def _affordable(stage: StageCosts, turn: float, best: Chain) -> IntArray:
    """Solutions whose facing alone does not already cost more than the chain."""
    every = facing_cost(stage, stage.yaws - best.gauge, np.full(len(stage.yaws), turn))
    return np.flatnonzero(every <= best.cost * (1 + 1e-9))


def _sample(stage: StageCosts, order: IntArray, gauge: float) -> IntArray:
    """Some of the solutions whose yaw, in which `order` sorts them, is near the gauge."""
    yaws = stage.yaws[order]
    turns = np.arange(np.floor((yaws[0] - gauge) / (2 * np.pi)), np.ceil((yaws[-1] - gauge) / (2 * np.pi)) + 1)
    starts = np.searchsorted(yaws, gauge + 2 * np.pi * turns - NEAR)
    stops = np.searchsorted(yaws, gauge + 2 * np.pi * turns + NEAR, side="right")
    near = np.concatenate([order[start:stop] for start, stop in zip(starts, stops, strict=True)])
    return np.sort(near)[:: max(1, len(near) // SAMPLE)]
