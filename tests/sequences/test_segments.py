"""Eqs 12 and 13: both ranges of a pair are brought to the shorter's length."""

from math import floor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.sequences.segments import Retiming, paired, retimed, round_half_up, shared_length

lengths = st.integers(1, 300)


@given(lengths, lengths)
def test_floor_is_the_papers(length: int, count: int) -> None:
    assert retimed(length, count, Retiming.FLOOR).tolist() == [floor(m * length / count) for m in range(count)]


@given(lengths, st.integers(2, 300))
def test_endpoints_spread_evenly_and_keep_both_ends(length: int, count: int) -> None:
    frames = retimed(length, count, Retiming.ENDPOINTS)
    exact = np.arange(count) * (length - 1) / (count - 1)
    assert np.abs(frames - exact).max() <= 0.5
    assert (frames[0], frames[-1]) == (0, length - 1)


@given(lengths, lengths, st.sampled_from(Retiming))
def test_frames_are_in_order_and_in_range(length: int, count: int, how: Retiming) -> None:
    frames = retimed(length, count, how)
    assert len(frames) == count
    assert (np.diff(frames) >= (1 if count <= length else 0)).all()
    assert frames.min() >= 0 and frames.max() < length


@given(lengths, st.sampled_from(Retiming))
def test_a_range_of_the_right_length_is_kept(length: int, how: Retiming) -> None:
    assert retimed(length, length, how).tolist() == list(range(length))


@pytest.mark.parametrize("how", Retiming)
def test_one_frame_is_the_first_and_none_is_none(how: Retiming) -> None:
    assert retimed(9, 1, how).tolist() == [0]
    assert retimed(9, 0, how).tolist() == retimed(0, 0, how).tolist() == []


@given(lengths, lengths, st.sampled_from(Retiming))
def test_the_shorter_is_kept_and_the_roles_may_be_swapped(length_a: int, length_b: int, how: Retiming) -> None:
    a, b = np.arange(length_a) + 100, 3 * np.arange(length_b)
    pair, swapped = paired(a, b, how=how), paired(b, a, how=how)
    assert pair.n_frames == len(pair.a) == len(pair.b) == min(length_a, length_b)
    shorter, kept = (a, pair.a) if length_a <= length_b else (b, pair.b)
    assert kept.tolist() == shorter.tolist()
    assert pair.a.tolist() == swapped.b.tolist() and pair.b.tolist() == swapped.a.tolist()


def test_only_endpoints_reach_the_end_of_the_longer() -> None:
    long, short = np.arange(10), np.arange(4)
    assert paired(long, short, how=Retiming.ENDPOINTS).a.tolist() == [0, 3, 6, 9]
    assert paired(long, short, how=Retiming.FLOOR).a.tolist() == [0, 2, 5, 7]


@pytest.mark.parametrize(
    ("a", "b", "rates", "expected"),
    [
        (50, 30, (1.0, 1.0), 30),
        (50, 30, (0.5, 1.0), 25),  # A has twice as many frames a second
        (25, 60, (1.0, 0.5), 25),
        (25, 10, (1.0, 3.0), 25),
        (10, 10, (2.5, 2.0), 20),
        (1, 100, (0.1, 1.0), 1),
        (0, 100, (1.0, 1.0), 0),
        (100, 0, (1.0, 1.0), 0),
    ],
)
def test_a_pair_lasts_as_long_as_what_is_over_sooner(a: int, b: int, rates: tuple[float, float], expected: int) -> None:
    assert shared_length(a, b, rates=rates) == expected
    assert shared_length(b, a, rates=(rates[1], rates[0])) == expected
    assert paired(np.arange(a), np.arange(b), how=Retiming.ENDPOINTS, rates=rates).n_frames == expected


@given(st.integers(-1000, 1000))
def test_halves_go_up(number: int) -> None:
    assert round_half_up(number + 0.5) == number + 1
    assert round_half_up(number - 0.25) == number
