"""The best placements for any number of people: block by block, each exactly where that can be done.

A block that is one pair's chain is solved as such, exactly. So is a block in which every pair has a pose that suits all
its meetings, if nobody can be come to in two ways: then everybody keeps the own motion as a whole, and that costs
nothing. Any other block gets the best that is found, with a bound. Blocks are then put together at their bridges.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from math import prod

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import apply_pose, compose, invert, rotation
from mhvedit.optimise.chains import Start
from mhvedit.optimise.graph import Graph, Pair, Step, graph_of, groups
from mhvedit.optimise.keys import best_placements
from mhvedit.optimise.network import Network, best_standing
from mhvedit.optimise.stages import Stage, common_codes, pose_codes


@dataclass(frozen=True, slots=True, eq=False)
class CompanyPlacements:
    """The chosen solution of every stage, and where its pair stands; canonical frames throughout.

    People who have nothing to do with each other, not by others either, form groups of their own; each group is placed
    in a world of its own, in which its first stage's A is kept in direction.
    """

    chosen: IntArray  # (G,) row of each stage
    a: FloatArray  # (G, 3) x, y m and yaw rad: world_from_a
    b: FloatArray  # (G, 3) world_from_b
    gauges: Mapping[str, float]  # rad, by person: turn of her frame in which her motion is kept
    groups: tuple[tuple[int, ...], ...]  # stages of each group
    cost: float  # m^2
    lower_bound: float  # m^2
    equals: int  # choices that cost nothing, among which merit decided (1 where there are none)

    @property
    def gap(self) -> float:
        """How far the cost may be above the optimum, percent of the cost."""
        return 0.0 if self.cost <= 0 else 100 * (self.cost - self.lower_bound) / self.cost


@dataclass(frozen=True, slots=True, eq=False)
class _Block:
    """Some stages solved, in a frame of their own."""

    chosen: Mapping[int, int]  # row by stage
    at: Mapping[tuple[str, int], FloatArray]  # (3,) placement by person and stage
    gauges: Mapping[str, float]  # rad, by person
    cost: float
    lower_bound: float
    equals: int


@dataclass(frozen=True, slots=True)
class _Terms:
    """What a solve is told besides its stages."""

    facing_weight: float
    step: float
    n_yaw: int
    start: Start | None


def place_company(
    stages: Sequence[Stage],
    between: Sequence[Pair],
    *,
    facing_weight: float,
    step: float,
    n_yaw: int,
    start: Start | None = None,
) -> CompanyPlacements:
    """Choose a solution per stage and where its pair stands.

    Args:
        stages: in an order that is that of each person's own, none empty; those of one pair all told from one side.
        between: A and B of each.
        facing_weight: lambda, m^2.
        step: of x and y between poses, m.
        n_yaw: yaw steps in a full turn.
        start: what `near_best` starts from, where the stages are those of one pair and hold no more than it leaves.
    """
    graph, terms = graph_of(between), _Terms(facing_weight, step, n_yaw, start)
    blocks = [_solved(own, graph, stages, between, terms) for own in graph.blocks]
    links = [(graph.block_of(bridge.before), graph.block_of(bridge.after)) for bridge in graph.bridges]
    together = groups(len(blocks), links)
    found = [_bridged([blocks[i] for i in group], graph.bridges, stages, between) for group in together]
    chosen = {stage: row for group in found for stage, row in group.chosen.items()}
    at = {who: pose for group in found for who, pose in group.at.items()}
    return CompanyPlacements(
        chosen=np.array([chosen[g] for g in range(len(stages))]),
        a=np.array([at[pair[0], g] for g, pair in enumerate(between)]),
        b=np.array([at[pair[1], g] for g, pair in enumerate(between)]),
        gauges={name: gauge for group in found for name, gauge in group.gauges.items()},
        groups=tuple(tuple(sorted(group.chosen)) for group in found),
        cost=sum(group.cost for group in found),
        lower_bound=sum(group.lower_bound for group in found),
        equals=prod(group.equals for group in found),
    )


def _solved(
    own: Sequence[int], graph: Graph, stages: Sequence[Stage], between: Sequence[Pair], terms: _Terms
) -> _Block:
    """One block of the graph."""
    meetings: dict[Pair, list[int]] = {}
    for g in own:
        meetings.setdefault(between[g], []).append(g)
    common = [common_codes([pose_codes(stages[g].keys) for g in of_pair]) for of_pair in meetings.values()]
    if len(meetings) == 1 or (_is_forest(meetings) and all(map(len, common))):
        return _kept_together([_chain(pair, of_pair, stages, terms) for pair, of_pair in meetings.items()])
    place = {g: n for n, g in enumerate(own)}
    inside = tuple(replace(s, before=place[s.before], after=place[s.after]) for s in graph.steps if s.before in place)
    network = Network(tuple(stages[g] for g in own), tuple(between[g] for g in own), inside, terms.facing_weight)
    standing, bound = best_standing(network, step=terms.step, n_yaw=terms.n_yaw)
    at = {}
    for n, g in enumerate(own):
        pose = np.array([standing.at[n].real, standing.at[n].imag, np.angle(standing.turns[n])])
        at[between[g][0], g], at[between[g][1], g] = pose, compose(pose, stages[g].poses[standing.chosen[n]])
    gauges = dict(zip(network.people, np.angle(standing.gauges).tolist(), strict=True))
    return _Block(dict(zip(own, standing.chosen.tolist(), strict=True)), at, gauges, standing.cost, bound, 1)


def _is_forest(pairs: Collection[Pair]) -> bool:
    """Whether nobody can be come to in two ways."""
    names = list(dict.fromkeys(chain(*pairs)))
    parts = groups(len(names), ((names.index(a), names.index(b)) for a, b in pairs))
    return len(pairs) == len(names) - len(parts)


def _chain(pair: Pair, meetings: Sequence[int], stages: Sequence[Stage], terms: _Terms) -> _Block:
    """All meetings of one pair, one after the other."""
    found = best_placements(
        [stages[g] for g in meetings],
        facing_weight=terms.facing_weight,
        step=terms.step,
        n_yaw=terms.n_yaw,
        start=terms.start,
    )
    at = {(name, g): poses[n] for name, poses in zip(pair, (found.a, found.b), strict=True)
          for n, g in enumerate(meetings)}  # fmt: skip
    chosen = dict(zip(meetings, found.chosen.tolist(), strict=True))
    gauges = {pair[0]: 0.0, pair[1]: found.gauge}
    return _Block(chosen, at, gauges, found.cost, found.lower_bound, found.equals)


def _kept_together(chains: Sequence[_Block]) -> _Block:
    """Chains of one block: of several each costs nothing, so everybody stands at one place in the own frame."""
    together, *left = chains
    while left:
        block = next(own for own in left if own.gauges.keys() & together.gauges.keys())
        left.remove(block)
        person = next(name for name in block.gauges if name in together.gauges)
        there, here = (next(pose for who, pose in own.at.items() if who[0] == person) for own in (block, together))
        together = _with(together, _moved(block, compose(here, invert(there))))
    return together


def _bridged(
    blocks: Sequence[_Block], bridges: Sequence[Step], stages: Sequence[Stage], between: Sequence[Pair]
) -> _Block:
    """Blocks that bridges hold together, each placed so that the step over its bridge is as it was captured."""
    together, *left = blocks
    while left:
        block, bridge = next(
            (own, bridge)
            for own in left
            for bridge in bridges
            if {bridge.before, bridge.after} & own.chosen.keys()
            and {bridge.before, bridge.after} & together.chosen.keys()
        )
        left.remove(block)
        forwards = bridge.before in together.chosen
        here, there = (bridge.before, bridge.after) if forwards else (bridge.after, bridge.before)
        person = bridge.person
        roots = [_roots(stages[g], between[g], person)[which] for g, which in (
            (here, -1 if forwards else 0), (there, 0 if forwards else -1))]  # fmt: skip
        turn = together.gauges[person] - block.gauges[person]
        kept = apply_pose(together.at[person, here], roots[0]) + rotation(together.gauges[person]) @ (
            roots[1] - roots[0]
        )
        shift = kept - rotation(turn) @ apply_pose(block.at[person, there], roots[1])
        together = _with(together, _moved(block, np.array([*shift, turn])))
    return together


def _roots(stage: Stage, pair: Pair, person: str) -> FloatArray:
    """(n, 2) m, of one of a stage's people."""
    return stage.roots_a if person == pair[0] else stage.roots_b


def _moved(block: _Block, pose: FloatArray) -> _Block:
    """A block placed as a whole."""
    at = {who: compose(pose, own) for who, own in block.at.items()}
    return replace(block, at=at, gauges={name: gauge + float(pose[2]) for name, gauge in block.gauges.items()})


def _with(one: _Block, other: _Block) -> _Block:
    """Two blocks in one frame."""
    return _Block(
        {**one.chosen, **other.chosen},
        {**one.at, **other.at},
        {**other.gauges, **one.gauges},
        one.cost + other.cost,
        one.lower_bound + other.lower_bound,
        one.equals * other.equals,
    )
