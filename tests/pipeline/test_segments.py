"""Some solutions are told as all are, and lattice poses as the grid tells them."""

from pathlib import Path

import numpy as np
import pytest

from mhvedit import api
from mhvedit.pipeline.segments import SolvedSegment

COLUMNS = ("keys", "poses", "distance", "theta_a", "theta_b", "region", "clearance")


@pytest.fixture
def solved(folder: Path) -> tuple[SolvedSegment, ...]:
    return api.solve(api.load(folder / "scene.toml")).segments


def test_some_solutions_are_described_as_all_are(solved: tuple[SolvedSegment, ...]) -> None:
    for segment in solved:
        for rows in (np.arange(segment.n_solutions)[::7], np.zeros(0, np.int64)):
            some = segment.rows(rows)
            for column in COLUMNS:
                np.testing.assert_array_equal(getattr(some, column), getattr(segment.group, column)[rows], column)


def test_lattice_poses_there_and_back(solved: tuple[SolvedSegment, ...]) -> None:
    for segment in solved:
        rows = np.arange(segment.n_solutions)[::3]
        keys = segment.keys(rows)
        np.testing.assert_array_equal(keys, segment.group.keys[rows])
        np.testing.assert_array_equal(segment.rows_at(keys), rows)
        assert (segment.rows_at(keys + np.array([0, 10**4, 0])) == -1).all()
