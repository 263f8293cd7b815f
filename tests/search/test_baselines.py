"""The searches that the benchmarks compare with are oracles too: written otherwise, and equal pose for pose."""

from collections.abc import Sequence

import numpy as np
import pytest

from benchmarks.fft_search import FftSearch
from benchmarks.plain_search import Turned, reason_at
from benchmarks.search_case import boundary
from mhvedit.constraints.clauses import Clause
from mhvedit.constraints.dictionary import InteractionType, Slack, temporal_clauses
from mhvedit.constraints.fidelity import fidelity_clauses
from mhvedit.search.poses import PoseGrid, pose_grid
from mhvedit.search.solve import OUTSIDE, ReasonMap, search_poses
from tests.search.shapes import HAND, PITCH, SWORD, random_subject

Problem = tuple[PoseGrid, tuple[Clause, ...], ReasonMap]


def problem(kind: InteractionType, *, seed: int, tau: int, stride: int = 1, n_yaw: int = 12) -> Problem:
    """A toy, and what the search finds."""
    rng = np.random.default_rng(seed)
    a, b = random_subject(rng, tau), random_subject(rng, tau)
    grid = pose_grid(a.root, b.root, pitch=PITCH, stride=stride, n_yaw=n_yaw, window=25 * PITCH)
    parts = SWORD, HAND
    clauses = temporal_clauses(
        kind, a.volumes.parts[SWORD].volume, b.volumes.parts[HAND].volume, slack=Slack(1, 1.0)
    ) + fidelity_clauses(
        kind, a.volumes, b.volumes, parts=parts, apart=None, depth=PITCH, overlap=0.5 * PITCH, pitch=PITCH
    )
    return grid, clauses, search_poses(grid, clauses)


def plainly(grid: PoseGrid, clauses: Sequence[Clause], found: ReasonMap) -> list[int]:
    """Reasons of all poses in the window, pose by pose."""
    turned: list[Turned] = [{} for _ in range(grid.n_yaw)]
    return [reason_at(grid, clauses, cell, turned[cell[2]]) for cell in np.argwhere(found.reason != OUTSIDE)]


@pytest.mark.parametrize("kind", InteractionType)
@pytest.mark.parametrize(("seed", "tau", "stride"), [(2, 5, 1), (7, 4, 2), (0, 66, 3)])
def test_both_baselines_find_the_reasons_that_the_search_finds(
    kind: InteractionType, seed: int, tau: int, stride: int
) -> None:
    grid, clauses, found = problem(kind, seed=seed, tau=tau, stride=stride)
    search = FftSearch(grid, np.arange(grid.n_yaw))
    np.testing.assert_array_equal(search.reasons(clauses), found.reason)
    assert search.worst < 0.01
    assert plainly(grid, clauses, found) == found.reason[found.reason != OUTSIDE].tolist()


def test_the_toys_know_all_kinds_of_reasons() -> None:
    told = {name for kind in InteractionType for name, n in problem(kind, seed=2, tau=5)[2].counts().items() if n > 0}
    assert told == {
        "accepted",
        "outside the window",
        "no contact",
        "no contact at the right moment",
        "contact at a wrong moment",
        "contact is lost in some frame",
        "never in contact at the same moment",
        "neither passes strictly after the other",
        "bodies meet",
    }


def test_correlation_at_some_yaws_is_that_part_of_the_whole() -> None:
    grid, clauses, found = problem(InteractionType.SOMETIMES, seed=2, tau=4)
    yaws = np.array([1, 5, 11])
    np.testing.assert_array_equal(FftSearch(grid, yaws, workers=1).reasons(clauses), found.reason[:, :, yaws])


def test_a_pose_is_on_the_boundary_if_a_neighbour_has_another_reason() -> None:
    _, _, found = problem(InteractionType.SOMETIMES, seed=2, tau=4, n_yaw=4)
    padded = np.pad(found.reason, ((1, 1), (1, 1), (0, 0)), mode="edge")
    neighbours = [padded[2:, 1:-1], padded[:-2, 1:-1], padded[1:-1, 2:], padded[1:-1, :-2]]
    expected = np.any([found.reason != other for other in neighbours], axis=0) & (found.reason != OUTSIDE)
    np.testing.assert_array_equal(boundary(found), expected)
    assert 0 < expected.sum() < expected.size
