"""Runs of equal bytes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.geometry.runs import run_lengths


@given(st.lists(st.tuples(st.integers(0, 255), st.integers(1, 300)), max_size=12))
def test_runs_give_back_what_they_were_made_of(parts: list[tuple[int, int]]) -> None:
    values = np.repeat(*np.array(parts, np.int64).reshape(-1, 2).T).astype(np.uint8)
    of_run, lengths = run_lengths(values)
    np.testing.assert_array_equal(np.repeat(of_run, lengths), values)
    assert (lengths > 0).all()
    assert (of_run[1:] != of_run[:-1]).all()  # none could be longer
