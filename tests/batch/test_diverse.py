import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.batch.diverse import LEVER, better_half, farthest, placed
from mhvedit.geometry.arrays import FloatArray, IntArray

SOME = settings(max_examples=60, derandomize=True)


@st.composite
def groups(draw: st.DrawFn) -> tuple[FloatArray, IntArray]:
    """Places and regions of some solutions."""
    size = draw(st.integers(1, 40))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return random.uniform(-2, 2, (size, 3)), random.integers(0, draw(st.integers(1, 8)), size)


def apart(one: FloatArray, other: FloatArray) -> float:
    """Brute force: the shortest way, over all full turns."""
    turns = [one[2] - other[2] + 2 * np.pi * LEVER * k for k in range(-3, 4)]
    return float(np.hypot(np.hypot(*(one - other)[:2]), min(map(abs, turns))))


@SOME
@given(group=groups(), count=st.integers(1, 12))
def test_other_regions_come_first(group: tuple[FloatArray, IntArray], count: int) -> None:
    places, region = group
    rows = farthest(places, region, np.ones(len(region), np.bool_), first=0, count=count)
    assert len(rows) == len(set(rows)) == min(count, len(region)) and rows[0] == 0
    new = min(len(rows), len(np.unique(region)))
    assert len(set(region[rows[:new]].tolist())) == new


@SOME
@given(group=groups(), count=st.integers(1, 12))
def test_each_is_the_farthest_of_those_that_may_come(group: tuple[FloatArray, IntArray], count: int) -> None:
    places, region = group
    rows = farthest(places, region, np.ones(len(region), np.bool_), first=0, count=count)
    for i, row in enumerate(rows[1:], start=1):
        before = rows[:i]
        unused = [r for r in range(len(region)) if region[r] not in region[before]]
        among = unused or [r for r in range(len(region)) if r not in before]
        distances = {r: min(apart(places[r], places[b]) for b in before) for r in among}
        assert row in among
        assert distances[row] >= max(distances.values()) - 1e-9


@SOME
@given(group=groups())
def test_the_better_half_of_every_region(group: tuple[FloatArray, IntArray]) -> None:
    places, region = group
    merit = places[:, 0]
    good = better_half(merit, region)
    for own in np.unique(region):
        inside = region == own
        assert good[inside].sum() == (inside.sum() + 1) // 2
        assert merit[inside & good].min() >= merit[inside & ~good].max(initial=-np.inf)


def test_turns_count_the_shorter_way_round() -> None:
    poses = np.array([[0.0, 0.0, 3.1], [0.0, 0.0, -3.1], [0.0, 0.0, 2.0]])
    places = placed(poses, np.zeros(2))
    assert farthest(places, np.zeros(3, np.int64), np.ones(3, np.bool_), first=0, count=2) == [0, 2]


def test_a_turn_about_another_place_moves_the_root() -> None:
    there = placed(np.array([[1.0, 0.0, np.pi / 2]]), np.array([2.0, 0.0]))
    assert np.allclose(there, [[1.0, 2.0, LEVER * np.pi / 2]])
