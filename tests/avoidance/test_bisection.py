from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.avoidance.bisection import (
    Bisected,
    BisectionSettings,
    Interpolation,
    bisect,
    check_and_correct,
    collision_groups,
)
from mhvedit.avoidance.posture import Posture
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray

RADIUS = 0.5


def free_posture(q: FloatArray) -> Posture:
    """The nearest point outside of a disc about the origin; of a DOF pair."""
    length = float(np.linalg.norm(q))
    out = q if length >= RADIUS else (q / length if length > 1e-9 else np.array([0.0, 1.0])) * RADIUS
    return Posture(out, 0.0, 0.0, 1, True)


def in_disc(_: IntArray, q: FloatArray) -> BoolArray:
    return np.asarray(np.linalg.norm(q, axis=1) < RADIUS - 1e-9)


def past_the_disc(n: int, start: float = -1.0, stop: float = 1.0) -> FloatArray:
    return np.stack([np.linspace(start, stop, n), np.full(n, 0.1)], 1)


def solve(captured: FloatArray, settings: BisectionSettings | None = None) -> Bisected:
    return bisect(
        captured,
        predict=lambda frame, q, away: free_posture(q[frame]),
        collides=in_disc,
        limits=np.broadcast_to([-np.inf, np.inf], (*captured.shape, 2)),
        settings=settings,
    )


def colliding(q: FloatArray) -> int:
    return int(in_disc(np.arange(len(q)), q).sum())


@given(st.lists(st.booleans(), min_size=1, max_size=40), st.integers(0, 5))
def test_b5_2_groups_are_the_runs_and_an_open_one_is_closed_b5_e1(mask: list[bool], start: int) -> None:
    groups = collision_groups(np.array(mask), start=start)
    frames = {frame for first, last in groups for frame in range(first, last + 1)}
    assert frames == {i + start for i, hit in enumerate(mask) if hit}
    assert all(b[0] > a[1] + 1 for a, b in pairwise(groups))


@pytest.mark.parametrize("interpolation", Interpolation)
@pytest.mark.parametrize("of_changes", [True, False])
@pytest.mark.parametrize("buffer", [0, 1])
def test_b5_9_no_collision_remains(interpolation: Interpolation, of_changes: bool, buffer: int) -> None:
    settings = BisectionSettings(interpolation, of_changes, least_buffer=buffer, blend=2)
    found = solve(past_the_disc(61), settings)
    assert colliding(found.q) == 0
    assert len(found.colliding) == 0
    assert 0 < found.predictions


def test_b5_4_fewer_frames_are_predicted_than_collide() -> None:
    captured = past_the_disc(201)
    found = solve(captured)
    assert found.predictions < colliding(captured) / 2


def test_b5_5_frames_beyond_the_buffer_are_not_touched() -> None:
    captured = past_the_disc(101)
    hit = np.flatnonzero(in_disc(np.arange(101), captured))
    found = solve(captured, BisectionSettings(smooth=20.0, blend=0))
    touched = np.flatnonzero((found.q != captured).any(1))
    reach = 2 * round((hit[-1] - hit[0]) * 0.2)
    assert touched[0] >= hit[0] - reach
    assert touched[-1] <= hit[-1] + reach


@pytest.mark.parametrize("last", [True, False])
def test_b5_e2_e7_a_collision_at_either_end_is_fixed(last: bool) -> None:
    captured = past_the_disc(40, stop=0.1) if last else past_the_disc(40, start=0.1)
    found = solve(captured)
    assert colliding(found.q) == 0
    assert (0 if not last else 39) in found.predicted


def test_b5_e3_e4_groups_of_one_and_two_frames_are_fixed() -> None:
    for n in (1, 2):
        captured = np.full((20, 2), 2.0)
        captured[9 : 9 + n] = [0.2, 0.1]
        for interpolation in Interpolation:
            found = solve(captured, BisectionSettings(interpolation, least_buffer=0))
            assert colliding(found.q) == 0
            assert np.isfinite(found.q).all()


def test_b5_6_groups_below_the_minimum_are_left_to_the_last_pass() -> None:
    captured = np.full((30, 2), 2.0)
    captured[9:11] = [0.2, 0.1]
    found = solve(captured, BisectionSettings(least_buffer=3))
    assert found.predicted.tolist() == [9, 10]
    assert (np.delete(found.q, [9, 10], 0) == np.delete(captured, [9, 10], 0)).all()


def test_b5_7_evaluation_points_are_fixed_first() -> None:
    captured = past_the_disc(61)
    found = solve(captured, BisectionSettings(evaluation=(20, 25, 55)))
    assert {20, 25} <= set(found.predicted.tolist())
    assert 55 not in found.predicted
    assert np.allclose(found.q[25], free_posture(captured[25]).q)
    assert colliding(found.q) == 0


def test_b5_8_interpolation_is_clamped_to_the_limits() -> None:
    captured = past_the_disc(61)
    limits = np.broadcast_to([-1.0, 0.52], (61, 2, 2))
    found = bisect(
        captured,
        predict=lambda frame, q, away: free_posture(q[frame]),
        collides=in_disc,
        limits=limits,
        settings=BisectionSettings(Interpolation.QUADRATIC, of_changes=False),
    )
    assert found.q[:, 1].max() <= 0.52


def test_b5_4_quadratic_is_the_parabola_through_three_keys() -> None:
    """One group, one prediction: the frames between are on a parabola."""
    t = np.arange(21.0)
    captured = np.stack([np.zeros(21), np.where((t > 5) & (t < 15), 0.4, 2.0)], 1)

    def predict(frame: int, q: FloatArray, away: int) -> Posture:
        return Posture(np.array([0.0, 3.0]), 0.0, 0.0, 1, True)

    found = bisect(
        captured,
        predict=predict,
        collides=in_disc,
        limits=np.broadcast_to([-9.0, 9.0], (21, 2, 2)),
        settings=BisectionSettings(Interpolation.QUADRATIC, of_changes=False, blend=0, smooth=0),
    )
    parabola = 3.0 - ((t - 10) / 5) ** 2
    assert np.allclose(found.q[5:16, 1], parabola[5:16])


def test_changes_keep_the_detail_that_curves_lose() -> None:
    rng = np.random.default_rng(0)
    captured = past_the_disc(101)
    captured[:, 0] += 0.02 * rng.normal(size=101)
    detail = np.diff(captured[:, 0], 2)
    kept, lost = (solve(captured, BisectionSettings(of_changes=changes)).q for changes in (True, False))
    assert np.abs(np.diff(kept[:, 0], 2) - detail).mean() < 0.5 * np.abs(np.diff(lost[:, 0], 2) - detail).mean()


def test_a_frame_that_cannot_be_freed_is_said_to_collide() -> None:
    captured = past_the_disc(41)
    found = bisect(
        captured,
        predict=lambda frame, q, away: Posture(q[frame], 0.1, 0.0, 1, False),
        collides=in_disc,
        limits=np.broadcast_to([-np.inf, np.inf], (41, 2, 2)),
    )
    assert found.colliding.tolist() == np.flatnonzero(in_disc(np.arange(41), captured)).tolist()


def test_b5_10_nebel_starts_from_key_frames_and_ends_without_collision() -> None:
    captured = past_the_disc(61)
    captured[:, 1] += 0.02 * np.sin(np.arange(61))
    found = check_and_correct(
        captured,
        predict=lambda frame, q, away: free_posture(q[frame]),
        collides=in_disc,
        limits=np.broadcast_to([-np.inf, np.inf], (61, 2, 2)),
        keys=range(0, 61, 20),
    )
    assert colliding(found.q) == 0
    assert np.abs(np.diff(found.q[:15, 1], 2)).max() < 1e-9  # straight between keys: the detail is gone


def test_one_frame_motions() -> None:
    found = solve(np.array([[0.1, 0.1]]))
    assert colliding(found.q) == 0
    assert solve(np.array([[1.0, 1.0]])).predictions == 0
