from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.geometry.arrays import IntArray
from mhvedit.sequences.align import FramesOf, KeyRange, TimeLine, key_pair, time_line
from mhvedit.sequences.segments import Retiming

ENDS = Retiming.ENDPOINTS
BETWEEN = st.tuples(st.integers(0, 6), st.integers(0, 6))
KEY = st.tuples(st.integers(1, 6), st.integers(1, 6))


def key(a: range, b: range, between: str = "ab", how: Retiming = ENDS) -> KeyRange:
    return KeyRange((between[0], between[1]), a, b, how)


def scene(keys: list[KeyRange], **lengths: int) -> TimeLine:
    """All captures at the scene's own rate."""
    return time_line(keys, {name: np.arange(n) for name, n in lengths.items()}, rates=dict.fromkeys(lengths, 1.0))


def test_key_pairs_follow_their_own_rule() -> None:
    floor = key_pair(key(range(10, 20), range(4), how=Retiming.FLOOR))
    assert floor.a.tolist() == [10, 12, 15, 17] and floor.b.tolist() == [0, 1, 2, 3]
    ends = key_pair(key(range(10, 20), range(4)))
    assert ends.a.tolist() == [10, 13, 16, 19]


# Two


def test_what_precedes_separates_and_follows_is_transitional() -> None:
    line = scene([key(range(5, 10), range(2, 6)), key(range(15, 18), range(10, 15))], a=20, b=16)
    assert line.spans == (range(2, 6), range(10, 13)) and line.n_frames == 14
    assert line.left_out == line.held == ()
    assert line.sources["a"][:2].tolist() == [0, 4] and line.sources["b"][:2].tolist() == [0, 1]


def test_segments_with_nothing_between_adjoin() -> None:
    assert scene([key(range(4), range(4)), key(range(4, 8), range(4, 8))], a=8, b=8).spans == (range(4), range(4, 8))


def test_frames_that_only_one_has_are_left_out_and_reported() -> None:
    line = scene([key(range(4), range(3, 7)), key(range(6, 8), range(7, 9))], a=8, b=12)
    assert line.spans == (range(4), range(4, 6)) and line.n_frames == 6
    assert line.left_out == (FramesOf("b", 0, 3), FramesOf("a", 4, 2), FramesOf("b", 6, 3))


def test_gaps_in_the_numbering_are_no_frames() -> None:
    numbers = {"a": np.array([3, 4, 7, 9, 10, 11, 15]), "b": np.arange(2, 9)}
    line = time_line([key(range(9, 12), range(5, 8))], numbers, rates={"a": 1.0, "b": 1.0})
    assert line.sources["a"].tolist() == [3, 4, 7, 9, 10, 11, 15]
    assert line.sources["b"].tolist() == [2, 3, 4, 5, 6, 7, 8]


@pytest.mark.parametrize("rates", [(1.0, 0.5), (0.5, 1.0), (2.0, 1.0)])
def test_rates_hold_in_every_stretch(rates: tuple[float, float]) -> None:
    numbers = {"a": np.arange(50), "b": np.arange(100)}
    line = time_line([key(range(10, 30), range(20, 60))], numbers, rates=dict(zip("ab", rates, strict=True)))
    before, during, after = (min(round(rates[0] * a), round(rates[1] * b)) for a, b in ((10, 20), (20, 40), (20, 40)))
    assert line.spans == (range(before, before + during),) and line.n_frames == before + during + after


def laid_out(gaps: list[tuple[int, int]], keys: list[tuple[int, int]]) -> tuple[list[KeyRange], IntArray]:
    """Key ranges with so many frames before each, and after the last; and how long either capture is."""
    done, ranges = np.zeros(2, np.int64), []
    for gap, long in zip(gaps, keys, strict=False):
        start = done + gap
        done = start + long
        ranges.append(key(range(int(start[0]), int(done[0])), range(int(start[1]), int(done[1]))))
    return ranges, done + gaps[len(keys)]


@given(st.lists(BETWEEN, min_size=5, max_size=5), st.lists(KEY, min_size=1, max_size=4))
def test_the_time_line_of_two_is_whole(gaps: list[tuple[int, int]], keys: list[tuple[int, int]]) -> None:
    ranges, (length_a, length_b) = laid_out(gaps, keys)
    line = scene(ranges, a=int(length_a), b=int(length_b))
    between = gaps[: len(keys) + 1]
    assert line.n_frames == sum(min(pair) for pair in (*between, *keys)) and line.held == ()
    assert [len(span) for span in line.spans] == [min(pair) for pair in keys]
    for i, name in enumerate("ab"):
        lost = sum(own.count for own in line.left_out if own.subject == name)
        assert lost == sum(g[i] for g in between if g[1 - i] == 0)
        assert len(line.sources[name]) == line.n_frames and (np.diff(line.sources[name]) > 0).all()


# More


def test_segments_of_different_people_run_at_once() -> None:
    line = scene([key(range(3, 9), range(3, 9)), key(range(1, 5), range(2, 6), "cd")], a=12, b=12, c=12, d=12)
    assert line.spans == (range(3, 9), range(1, 5))
    assert line.n_frames == 12 and all(len(source) == 12 for source in line.sources.values())


def test_who_joins_later_stands_still_at_first() -> None:
    line = scene([key(range(4, 8), range(4, 8)), key(range(12, 15), range(2, 5), "ac")], a=17, b=9, c=7)
    assert line.spans == (range(4, 8), range(12, 15))
    assert line.sources["a"].tolist() == list(range(17))  # at its own pace
    assert line.sources["c"].tolist() == [0] * 11 + [1, 2, 3, 4, 5, 6]
    assert line.sources["b"].tolist() == [*range(9), *[8] * 8]
    assert line.held == (FramesOf("c", 0, 10), FramesOf("b", 9, 8))


def test_who_was_busy_for_longer_keeps_the_own_pace() -> None:
    keys = [key(range(2), range(2)), key(range(10), range(10), "cd"), key(range(4, 6), range(13, 15), "ac")]
    line = scene(keys, a=6, b=2, c=15, d=10)
    assert line.spans[2] == range(13, 15)
    assert line.sources["c"].tolist() == list(range(15))
    assert line.sources["a"].tolist() == [0, 1, *[2] * 5, *[3] * 6, 4, 5]


def test_who_is_in_no_segment_goes_at_the_own_pace() -> None:
    line = scene([key(range(3), range(3))], a=6, b=6, e=4, f=9)
    assert line.n_frames == 6
    assert line.sources["e"].tolist() == [0, 1, 2, 3, 3, 3] and line.sources["f"].tolist() == list(range(6))
    assert line.held == (FramesOf("e", 4, 2),) and line.left_out == (FramesOf("f", 6, 3),)


@st.composite
def several(draw: st.DrawFn) -> tuple[list[KeyRange], dict[str, int]]:
    """Segments among four people, each with some frames before."""
    done = dict.fromkeys("abcd", 0)
    keys = []
    for _ in range(draw(st.integers(1, 5))):
        between = draw(st.permutations("abcd"))[:2]
        ranges = {}
        for name in between:
            start = done[name] + draw(st.integers(0, 5))
            done[name] = start + draw(st.integers(1, 5))
            ranges[name] = range(start, done[name])
        keys.append(key(ranges[between[0]], ranges[between[1]], "".join(between)))
    return keys, {name: end + draw(st.integers(1, 5)) for name, end in done.items()}


@given(several())
def test_everybody_goes_through_the_own_segments_in_order(given: tuple[list[KeyRange], dict[str, int]]) -> None:
    keys, lengths = given
    line = scene(keys, **lengths)
    for name in lengths:
        source = line.sources[name]
        assert len(source) == line.n_frames and (np.diff(source) >= 0).all()
        own = [(k, span) for k, span in zip(keys, line.spans, strict=True) if name in k.between]
        assert all(one[1].stop <= other[1].start for one, other in pairwise(own))
        for k, span in own:
            pair = key_pair(k)
            shown = pair.a if k.between[0] == name else pair.b
            assert source[span.start : span.stop].tolist() == shown.tolist()
