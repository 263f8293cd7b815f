import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.optimise.graph import Graph, Pair, graph_of, groups


def pairs(*words: str) -> list[Pair]:
    return [(word[0], word[1]) for word in words]


def blocks(*words: str) -> tuple[tuple[int, ...], ...]:
    return graph_of(pairs(*words)).blocks


def test_one_pair_is_one_block() -> None:
    graph = graph_of(pairs("ab", "ab", "ab"))
    assert graph.blocks == ((0, 1, 2),) and graph.bridges == () and len(graph.steps) == 4


def test_who_goes_on_to_another_crosses_a_bridge() -> None:
    graph = graph_of(pairs("ab", "ab", "ac", "dc"))
    assert graph.blocks == ((0, 1), (2,), (3,))
    assert [(s.person, s.before, s.after) for s in graph.bridges] == [("a", 1, 2), ("c", 2, 3)]


def test_who_comes_back_ties_a_knot() -> None:
    assert blocks("ab", "ac", "ab") == ((0, 1, 2),)
    assert blocks("ab", "bc", "ac") == ((0, 1, 2),)
    assert blocks("ab", "cd", "ac", "bd") == ((0, 1, 2, 3),)


def test_strangers_are_apart() -> None:
    graph = graph_of(pairs("ab", "cd", "ab", "cd"))
    assert graph.blocks == ((0, 2), (1, 3)) and graph.bridges == ()
    assert graph.block_of(3) == 1


@given(st.lists(st.permutations("abcde").map(lambda p: (p[0], p[1])), min_size=1, max_size=8))
def test_without_a_bridge_its_sides_are_apart(between: list[Pair]) -> None:
    graph = graph_of(between)
    assert sorted(g for block in graph.blocks for g in block) == list(range(len(between)))
    steps = (*graph.steps, *graph.bridges)
    whole = len(groups(len(between), ((s.before, s.after) for s in steps)))
    for step in steps:
        left = len(groups(len(between), ((s.before, s.after) for s in steps if s is not step)))
        assert left == whole + (step in graph.bridges)
    assert isinstance(graph, Graph) and np.all(
        [graph.block_of(s.before) == graph.block_of(s.after) for s in graph.steps]
    )
