"""Stages that are knotted: the best placement found, and a proven bound, where no recursion along a chain is exact.

With x_g where A's frame stands in each stage, u_g = e^(i turn) how it is turned, and v_p = e^(i gauge) in what
direction each person's own motion is kept, the cost is a sum of squares that are linear in all of these:

- a person's step from one stage to the next: |p(g') - p(g) - v_p C|^2, edited less captured way
- a person's turn in a stage: lambda n |turn - v_p|^2, and as much again as the square of the captured way in it.

So for given solutions the places eliminate, and each turn's best value is a closed form of the others. For one stage,
all others standing, so are the place and turn that suit each of its solutions best: the best solution is found exactly.
The search places stage after stage in the ways that suit best, and descends from the best of these. The bound is the
sum of bounds of pairs, each with a share of the steps that it goes over.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from mhvedit.geometry.arrays import ComplexArray, FloatArray, IntArray
from mhvedit.optimise.branching import best_chain
from mhvedit.optimise.chains import StageCosts, complex_of, stage_costs
from mhvedit.optimise.graph import Pair, Step
from mhvedit.optimise.stages import Stage, common_codes, pose_codes

BRANCHES = 32  # solutions of a stage that are tried with each beginning
BEAM = 256  # beginnings that are gone on with
DESCENTS = 32  # of the whole ones that are followed down
MOST_SWEEPS = 100
MOST_TURNS = 2000  # passes over all turns
NOTHING = 1e-15  # m^2
SETTLED = 1e-12  # share of the cost, by which a pass must improve it


Thing = TypeVar("Thing")


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """A block of stages."""

    stages: tuple[Stage, ...]
    between: tuple[Pair, ...]  # who meets in each
    steps: tuple[Step, ...]  # their stages are indices into `stages`
    facing_weight: float  # lambda, m^2

    @property
    def people(self) -> tuple[str, ...]:
        """Everybody, as they come."""
        return tuple(dict.fromkeys(name for pair in self.between for name in pair))


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """A solution and a placement for every stage, and the gauges."""

    chosen: IntArray  # (G,) row of each stage
    at: ComplexArray  # (G,) m, where A's frame stands
    turns: ComplexArray  # (G,) e^(i turn) of A's frame
    gauges: ComplexArray  # (P,) e^(i gauge), as `Network.people`
    cost: float  # m^2


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """One of the two of a stage in all solutions: the root is at x + u (arm + bend root)."""

    person: int
    arm: ComplexArray  # (S,) m
    bend: ComplexArray  # (S,) e^(i yaw) in A's frame
    roots: ComplexArray  # (n,) m
    weight: float  # m^2, of the square of turn less gauge

    def lever(self, which: int, rows: IntArray | slice = slice(None)) -> ComplexArray:
        """(N,) m, from where A's frame stands to the first (0) or last (-1) root, before the turn."""
        return np.asarray(self.arm[rows] + self.bend[rows] * self.roots[which])


Sides = tuple[tuple[_Side, _Side], ...]


def best_standing(network: Network, *, step: float, n_yaw: int) -> tuple[Standing, float]:
    """The best that is found, and a lower bound of all there are.

    Args:
        network: a block.
        step: of x and y between poses, m.
        n_yaw: yaw steps in a full turn.
    """
    sides = _sides(network)
    whole = [
        _relaxed(network, sides, start.chosen, np.concatenate([start.turns, start.gauges]))
        for start in _beginnings(network, sides)
    ]
    starts = sorted(whole, key=lambda found: found.cost)[:DESCENTS]
    best = min((_descended(network, sides, start) for start in starts), key=lambda found: found.cost)
    if best.cost < NOTHING:
        return replace(best, cost=0.0), 0.0
    return best, min(lower_bound(network, step=step, n_yaw=n_yaw), best.cost)


def lower_bound(network: Network, *, step: float, n_yaw: int) -> float:
    """What every placement costs at least: pair by pair, each with its share of the steps that it goes over.

    A way over several steps shares its stretch between them, so it is as stiff as one step of 1 / sum(1 / share).

    Args:
        network: a block.
        step: of x and y between poses, m.
        n_yaw: yaw steps in a full turn.
    """
    pairs = list(dict.fromkeys(map(unordered, network.between)))
    ways = {pair: _ways(network, pair) for pair in pairs}
    covered = [step for own in ways.values() for both in own for way in both for step in way]
    total = 0.0
    for pair, own in ways.items():
        stages = [s for s, between in zip(network.stages, network.between, strict=True) if unordered(between) == pair]
        if len(common_codes([pose_codes(stage.keys) for stage in stages])):
            continue
        stiffness = [[1 / sum(covered.count(s) for s in way) if way else 0.0 for way in both] for both in own]
        shares = [one * other / (one + other) if one and other else 0.0 for one, other in stiffness]
        scale = float(np.sqrt(2 * min(shares)))  # a step of a chain of two costs half the square
        if scale == 0:
            continue
        costs = [_scaled(stage, scale) for stage in stage_costs(stages, facing_weight=network.facing_weight)]
        total += best_chain(costs, step=step * scale, n_yaw=n_yaw).lower_bound
    return total


def unordered(pair: Pair) -> Pair:
    """A pair, whoever is A."""
    return min(pair), max(pair)


def _sides(network: Network) -> Sides:
    names = network.people
    found = []
    for stage, (a, b) in zip(network.stages, network.between, strict=True):
        facing = network.facing_weight * len(stage.names)
        inner_a, inner_b = (float((np.diff(roots, axis=0) ** 2).sum()) for roots in (stage.roots_a, stage.roots_b))
        here, straight = np.zeros(len(stage), np.complex128), np.ones(len(stage), np.complex128)
        side_a = _Side(names.index(a), here, straight, complex_of(stage.roots_a), facing + inner_a)
        bend = np.exp(1j * stage.poses[:, 2])
        side_b = _Side(names.index(b), complex_of(stage.poses), bend, complex_of(stage.roots_b), facing + inner_b)
        found.append((side_a, side_b))
    return tuple(found)


def _side_of(network: Network, sides: Sides, step: Step, g: int) -> _Side:
    """Who steps, in one of the step's stages."""
    return sides[g][network.between[g].index(step.person)]


def _way(network: Network, sides: Sides, step: Step) -> complex:
    """The way of a step as it was captured, m."""
    after, before = (_side_of(network, sides, step, g) for g in (step.after, step.before))
    return complex(after.roots[0] - before.roots[-1])


def _relaxed(network: Network, sides: Sides, chosen: IntArray, phases: ComplexArray) -> Standing:
    """The best turns and gauges (downhill from some) and places, for given solutions."""
    by_place, by_phase = _residuals(network, sides, chosen)
    places = -np.linalg.pinv(by_place) @ by_phase
    left = by_phase + by_place @ places
    quadratic = np.conj(left.T) @ left
    phases, cost = phases.copy(), np.inf
    for _ in range(MOST_TURNS):
        for k in range(len(phases)):
            pull = quadratic[k] @ phases - quadratic[k, k] * phases[k]
            if abs(pull) > 0:
                phases[k] = -pull / abs(pull)
        before, cost = cost, float((np.abs(left @ phases) ** 2).sum())
        if cost >= before * (1 - SETTLED):
            break
    count = len(network.stages)
    return Standing(chosen, places @ phases, phases[:count], phases[count:], cost)


def _residuals(network: Network, sides: Sides, chosen: IntArray) -> tuple[ComplexArray, ComplexArray]:
    """What the squares are of, by places (R, G) and by turns and gauges (R, G + P)."""
    count, people = len(network.stages), len(network.people)
    turns = [(g, side) for g, both in enumerate(sides) for side in both]
    by_place = np.zeros((len(turns) + len(network.steps), count), np.complex128)
    by_phase = np.zeros((len(by_place), count + people), np.complex128)
    for row, (g, side) in enumerate(turns):
        root = np.sqrt(side.weight)
        by_phase[row, g], by_phase[row, count + side.person] = root * side.bend[chosen[g]], -root
    for row, step in enumerate(network.steps, len(turns)):
        for g, which, sign in ((step.after, 0, 1), (step.before, -1, -1)):
            by_place[row, g] = sign
            lever = _side_of(network, sides, step, g).lever(which, chosen[[g]])
            by_phase[row, g] = sign * lever[0]
        person = network.people.index(step.person)
        by_phase[row, count + person] = -_way(network, sides, step)
    return by_place, by_phase


def _beginnings(network: Network, sides: Sides) -> list[Standing]:
    """Stages placed one after the other, each in some of the ways that suit those before it best."""
    count = len(network.stages)
    nobody = Standing(
        np.zeros(count, np.int64), np.zeros(count, np.complex128), np.ones(count, np.complex128),
        np.full(len(network.people), np.nan, np.complex128), 0.0,
    )  # fmt: skip
    beam = [nobody]
    for g in range(count):
        grown = [
            _come(replace(placed, cost=now.cost + placed.cost), sides[g], g)
            for now in beam
            for placed in _suited(network, sides, now, g, frozenset(range(g)), most=BRANCHES)
        ]
        beam = _some(grown, np.array([standing.cost for standing in grown]), BEAM)
    return beam


def _come(now: Standing, both: tuple[_Side, _Side], g: int) -> Standing:
    """Whoever is new in a stage faces as in the own capture."""
    gauges = now.gauges.copy()
    for side in both:
        if np.isnan(gauges[side.person]):
            gauges[side.person] = now.turns[g] * side.bend[now.chosen[g]]
    return replace(now, gauges=gauges)


def _some(things: Sequence[Thing], cost: FloatArray, most: int) -> list[Thing]:
    """The cheapest; where more than enough cost the same, some all through them."""
    order = np.argsort(cost, kind="stable")
    equal = int((cost <= cost.min() + SETTLED).sum())
    chosen = order[np.linspace(0, equal - 1, most).astype(np.int64)] if equal > most else order[:most]
    return [things[i] for i in chosen.tolist()]


def _descended(network: Network, sides: Sides, now: Standing) -> Standing:
    """A standing improved, stage by stage, until nothing improves."""
    everyone = frozenset(range(len(network.stages)))
    for _ in range(MOST_SWEEPS):
        moved = now
        for g in range(len(network.stages)):
            (moved,) = _suited(network, sides, moved, g, everyone - {g}, most=1)
        moved = _relaxed(network, sides, moved.chosen, np.concatenate([moved.turns, moved.gauges]))
        if moved.cost >= now.cost * (1 - SETTLED):
            return now
        now = moved
    return now


def _best_rows(cost: FloatArray, merit: FloatArray, most: int) -> list[int]:
    """Rows of the cheapest solutions; of equal ones those of most merit, and some all through them."""
    limit = np.partition(cost, most - 1)[most - 1] if len(cost) > most else np.inf
    rows = np.flatnonzero(cost <= limit + SETTLED)
    rows = rows[np.argsort(-merit[rows], kind="stable")]
    return _some(rows.tolist(), cost[rows], most)


def _suited(
    network: Network, sides: Sides, now: Standing, g: int, others: frozenset[int], *, most: int
) -> list[Standing]:
    """The solutions of a stage, each with turn and place, that suit some others best, and what each costs more."""
    levers, aims = _aims(network, sides, now, g, others)
    count = len(network.stages[g])
    pull, cost = np.zeros(count, np.complex128), np.zeros(count)
    for side in sides[g]:
        gauge = now.gauges[side.person]
        if not np.isnan(gauge):
            pull += side.weight * gauge * np.conj(side.bend)
            cost += 2 * side.weight
    middle, aim = np.zeros(count, np.complex128), 0j
    if levers:
        middle, aim = np.mean(levers, axis=0), complex(np.mean(aims))
        spread, wanted = np.array(levers) - middle, np.array(aims) - aim
        pull += wanted @ np.conj(spread)
        cost += (np.abs(spread) ** 2).sum(0) + (np.abs(wanted) ** 2).sum()
    cost -= 2 * np.abs(pull)
    found = []
    for row in _best_rows(cost, network.stages[g].merit, most):
        turn = complex(pull[row] / abs(pull[row])) if abs(pull[row]) > 0 else 1 + 0j
        chosen, turns, at = now.chosen.copy(), now.turns.copy(), now.at.copy()
        chosen[g], turns[g], at[g] = row, turn, aim - turn * middle[row]
        found.append(replace(now, chosen=chosen, turns=turns, at=at, cost=float(cost[row])))
    return found


def _aims(
    network: Network, sides: Sides, now: Standing, g: int, others: frozenset[int]
) -> tuple[list[ComplexArray], list[complex]]:
    """For every step between a stage and some others: (S,) levers of its roots, and where the others want them."""
    levers, aims = [], []
    for step in network.steps:
        for own, which, other, its, sign in ((step.after, 0, step.before, -1, 1), (step.before, -1, step.after, 0, -1)):
            if own == g and other in others:
                side = _side_of(network, sides, step, other)
                lever = side.lever(its, now.chosen[[other]])[0]
                way = now.gauges[side.person] * _way(network, sides, step)
                levers.append(_side_of(network, sides, step, g).lever(which))
                aims.append(complex(now.at[other] + now.turns[other] * lever + sign * way))
    return levers, aims


def _ways(network: Network, pair: Pair) -> list[tuple[tuple[Step, ...], ...]]:
    """From each stage of a pair to the next the steps of the one and of the other.

    None where they lead through a stage of several segments: there a person's place may also shift by turning.
    """
    own = [g for g, between in enumerate(network.between) if unordered(between) == pair]
    return [tuple(_steps_over(network, person, before, after) for person in pair) for before, after in pairwise(own)]


def _steps_over(network: Network, person: str, before: int, after: int) -> tuple[Step, ...]:
    way = tuple(s for s in network.steps if s.person == person and before <= s.before and s.after <= after)
    return way if all(len(network.stages[s.after].names) == 1 for s in way[:-1]) else ()


def _scaled(costs: StageCosts, scale: float) -> StageCosts:
    """A stage whose steps cost the square of a scale as much."""
    return replace(costs, shifts=costs.shifts * scale, roots_a=costs.roots_a * scale, roots_b=costs.roots_b * scale)
