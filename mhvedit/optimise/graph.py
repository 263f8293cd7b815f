"""Who meets whom in which order: a graph of stages, and the blocks that it falls into.

Stages are joined by what costs something: a person who goes from one to the next. Where such a step is the only way
between two sides of the graph, either side can be placed and turned as a whole so that the step is as it was captured,
and it costs nothing. So these bridges fall away, and each block that is left has an optimum of its own.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

Pair = tuple[str, str]


@dataclass(frozen=True, slots=True)
class Step:
    """A person goes from one stage to the next of hers."""

    person: str
    before: int  # index of a stage
    after: int


@dataclass(frozen=True, slots=True)
class Graph:
    """Blocks of stages, each held together without bridges, and the bridges between them."""

    blocks: tuple[tuple[int, ...], ...]  # stages of each, ascending; the blocks by their first stages
    steps: tuple[Step, ...]  # inside blocks
    bridges: tuple[Step, ...]  # between them

    def block_of(self, stage: int) -> int:
        """Which block a stage is in."""
        return next(i for i, block in enumerate(self.blocks) if stage in block)


def graph_of(between: Sequence[Pair]) -> Graph:
    """The graph of stages.

    Args:
        between: who meets in each stage, in an order that is that of each person's own.
    """
    people = dict.fromkeys(name for pair in between for name in pair)
    steps = [
        Step(person, before, after)
        for person in people
        for before, after in pairwise(i for i, pair in enumerate(between) if person in pair)
    ]
    count = len(between)
    bridges = tuple(s for s in steps if not _connected(s.before, s.after, (t for t in steps if t is not s), count))
    inside = tuple(s for s in steps if s not in bridges)
    return Graph(groups(count, ((s.before, s.after) for s in inside)), inside, bridges)


def groups(count: int, links: Iterable[tuple[int, int]]) -> tuple[tuple[int, ...], ...]:
    """Connected groups of things.

    Args:
        count: of things.
        links: which are joined.

    Returns:
        The things of each group, ascending; the groups by their first things.
    """
    label = list(range(count))
    for one, other in links:
        old, new = max(label[one], label[other]), min(label[one], label[other])
        label = [new if own == old else own for own in label]
    return tuple(tuple(i for i in range(count) if label[i] == own) for own in dict.fromkeys(label))


def _connected(one: int, other: int, steps: Iterable[Step], count: int) -> bool:
    """Whether steps lead from a stage to another, in any direction."""
    found = groups(count, ((s.before, s.after) for s in steps))
    return any(one in group and other in group for group in found)
