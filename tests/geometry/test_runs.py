"""Runs of equal bytes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_numpy

from mhvedit.geometry import runs
from mhvedit.geometry.arrays import ByteArray
from mhvedit.geometry.runs import byte_counts, run_lengths, runs_along_rows


@given(st.lists(st.tuples(st.integers(0, 255), st.integers(1, 300)), max_size=12))
def test_runs_give_back_what_they_were_made_of(parts: list[tuple[int, int]]) -> None:
    values = np.repeat(*np.array(parts, np.int64).reshape(-1, 2).T).astype(np.uint8)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(runs, "PIECE", 64)
        of_run, lengths = run_lengths(values)
    np.testing.assert_array_equal(np.repeat(of_run, lengths), values)
    assert (lengths > 0).all()
    assert (of_run[1:] != of_run[:-1]).all()  # none could be longer


@given(st.lists(st.integers(0, 255), max_size=30))
def test_bytes_are_counted(values: list[int]) -> None:
    found = byte_counts(np.array(values, np.uint8), 200)
    assert found.tolist() == [values.count(kind) for kind in range(200)]


@given(
    st_numpy.arrays(np.uint8, st_numpy.array_shapes(min_dims=3, max_dims=3, max_side=7), elements=st.integers(0, 2)),
    st.permutations(range(3)),
)
def test_runs_along_rows_hold_the_cells_of_a_value(values: ByteArray, order: list[int]) -> None:
    inside = np.ascontiguousarray(values.transpose(order)).transpose(np.argsort(order)) == 1
    found, starts = runs_along_rows(values, 1)
    np.testing.assert_array_equal(runs_along_rows(inside.view(np.uint8), 1)[0], found)
    again = np.zeros(values.shape, np.bool_).reshape(-1, values.shape[2])
    for row in range(len(again)):
        for low, high in found[starts[row] : starts[row + 1]]:
            again[row, low:high] = True
    np.testing.assert_array_equal(again.reshape(values.shape), inside)
    assert starts[-1] == len(found) == np.diff(inside.astype(int), axis=2, prepend=0).clip(0).sum()
