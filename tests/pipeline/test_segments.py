"""Few solutions are told as many are, and lattice poses as the grid tells them."""

from pathlib import Path

import numpy as np
import pytest

from mhvedit import api
from mhvedit.pipeline import segments
from mhvedit.pipeline.segments import SolvedSegment

COLUMNS = ("keys", "poses", "distance", "theta_a", "theta_b", "region", "clearance")


@pytest.fixture
def solved(folder: Path) -> tuple[SolvedSegment, ...]:
    return api.solve(api.load(folder / "scene.toml")).segments


def test_few_solutions_are_described_as_all_are(solved: tuple[SolvedSegment, ...]) -> None:
    for segment in solved:
        rows = np.arange(segment.n_solutions)
        assert len(rows) > segments.FEW
        for some in np.split(rows, range(segments.FEW, len(rows), segments.FEW)):
            few = segment.rows(some)
            for column in COLUMNS:
                np.testing.assert_array_equal(getattr(few, column), getattr(segment.group, column)[some], column)
        assert len(segment.rows(rows[:0])) == 0


def test_lattice_poses_there_and_back(solved: tuple[SolvedSegment, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    for many in (0, 10**9):
        monkeypatch.setattr(segments, "MANY", many)
        for segment in solved:
            rows = np.arange(segment.n_solutions)[::3]
            keys = segment.keys(rows)
            np.testing.assert_array_equal(keys, segment.group.keys[rows])
            np.testing.assert_array_equal(segment.rows_at(keys), rows)
            assert (segment.rows_at(keys + np.array([0, 10**4, 0])) == -1).all()
