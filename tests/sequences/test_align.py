from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.geometry.arrays import IntArray
from mhvedit.sequences.align import KeyRange, Stretch, key_pair, time_line
from mhvedit.sequences.segments import Retiming

ENDS = Retiming.ENDPOINTS
BETWEEN = st.tuples(st.integers(0, 6), st.integers(0, 6))
KEY = st.tuples(st.integers(1, 6), st.integers(1, 6))


def scene(keys: list[KeyRange], length_a: int, length_b: int) -> tuple[Stretch, ...]:
    return time_line(keys, np.arange(length_a), np.arange(length_b))


def kinds(stretches: tuple[Stretch, ...]) -> list[tuple[int | None, int, int]]:
    return [(s.segment, s.start, s.stop) for s in stretches]


def test_key_pairs_follow_their_own_rule() -> None:
    floor = key_pair(KeyRange(range(10, 20), range(4), Retiming.FLOOR))
    assert floor.a.tolist() == [10, 12, 15, 17] and floor.b.tolist() == [0, 1, 2, 3]
    ends = key_pair(KeyRange(range(10, 20), range(4), ENDS))
    assert ends.a.tolist() == [10, 13, 16, 19]


def test_what_precedes_separates_and_follows_is_transitional() -> None:
    keys = [KeyRange(range(5, 10), range(2, 6), ENDS), KeyRange(range(15, 18), range(10, 15), ENDS)]
    stretches = scene(keys, 20, 16)
    assert kinds(stretches) == [(None, 0, 2), (0, 2, 6), (None, 6, 10), (1, 10, 13), (None, 13, 14)]
    assert all(s.left_out == (0, 0) for s in stretches)
    assert stretches[0].pair.a.tolist() == [0, 4] and stretches[0].pair.b.tolist() == [0, 1]


def test_segments_with_nothing_between_adjoin() -> None:
    keys = [KeyRange(range(4), range(4), ENDS), KeyRange(range(4, 8), range(4, 8), ENDS)]
    assert kinds(scene(keys, 8, 8)) == [(0, 0, 4), (1, 4, 8)]


def test_frames_that_only_one_has_are_left_out_and_reported() -> None:
    keys = [KeyRange(range(4), range(3, 7), ENDS), KeyRange(range(6, 8), range(7, 9), ENDS)]
    stretches = scene(keys, 8, 12)
    assert kinds(stretches) == [(None, 0, 0), (0, 0, 4), (None, 4, 4), (1, 4, 6), (None, 6, 6)]
    assert [s.left_out for s in stretches if s.segment is None] == [(0, 3), (2, 0), (0, 3)]


def test_gaps_in_the_numbering_are_no_frames() -> None:
    numbers = np.array([3, 4, 7, 9, 10, 11, 15])
    (before, key, after) = time_line([KeyRange(range(9, 12), range(5, 8), ENDS)], numbers, np.arange(2, 9))
    assert before.pair.a.tolist() == [3, 4, 7] and before.pair.b.tolist() == [2, 3, 4]
    assert key.pair.a.tolist() == [9, 10, 11]
    assert after.pair.a.tolist() == [15] and after.pair.b.tolist() == [8]


@pytest.mark.parametrize("rates", [(1.0, 0.5), (0.5, 1.0), (2.0, 1.0)])
def test_rates_hold_in_every_stretch(rates: tuple[float, float]) -> None:
    stretches = time_line([KeyRange(range(10, 30), range(20, 60), ENDS)], np.arange(50), np.arange(100), rates=rates)
    assert [s.pair.n_frames for s in stretches] == [
        min(round(rates[0] * a), round(rates[1] * b)) for a, b in ((10, 20), (20, 40), (20, 40))
    ]


def laid_out(gaps: list[tuple[int, int]], keys: list[tuple[int, int]]) -> tuple[list[KeyRange], IntArray]:
    """Key ranges with so many frames before each, and after the last; and how long either capture is."""
    done, ranges = np.zeros(2, np.int64), []
    for gap, key in zip(gaps, keys, strict=False):
        start = done + gap
        done = start + key
        ranges.append(KeyRange(range(int(start[0]), int(done[0])), range(int(start[1]), int(done[1])), ENDS))
    return ranges, done + gaps[len(keys)]


@given(st.lists(BETWEEN, min_size=5, max_size=5), st.lists(KEY, min_size=1, max_size=4))
def test_the_time_line_is_whole(gaps: list[tuple[int, int]], keys: list[tuple[int, int]]) -> None:
    ranges, (length_a, length_b) = laid_out(gaps, keys)
    stretches = scene(ranges, int(length_a), int(length_b))
    assert [s.segment for s in stretches if s.segment is not None] == list(range(len(keys)))
    assert stretches[0].start == 0
    assert all(before.stop == after.start for before, after in pairwise(stretches))
    between = gaps[: len(keys) + 1]
    assert stretches[-1].stop == sum(min(pair) for pair in (*between, *keys))
    lost = np.sum([s.left_out for s in stretches], axis=0)
    assert lost.tolist() == [sum(g[i] for g in between if g[1 - i] == 0) for i in (0, 1)]
    for side in ("a", "b"):
        frames = np.concatenate([getattr(s.pair, side) for s in stretches])
        assert (np.diff(frames) > 0).all()
