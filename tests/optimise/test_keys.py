from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pytest import approx

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import compose, invert, wrap_angle
from mhvedit.optimise.keys import KeyPlacements, best_placements
from mhvedit.optimise.stages import KeySegment, stages_of
from tests.optimise.problems import (
    N_YAW,
    STEP,
    plain_cost,
    poses_of,
    problem,
    segment_of,
    some_keys,
    some_segments,
)

QUARTER = N_YAW // 4


def solved(segments: list[KeySegment], *, weight: float = 1.0, adjoins: list[bool] | None = None) -> KeyPlacements:
    stages = stages_of(segments, adjoins or [False] * (len(segments) - 1))
    return best_placements(stages, facing_weight=weight, step=STEP, n_yaw=N_YAW)


def shuffled(segment: KeySegment, rng: np.random.Generator) -> KeySegment:
    order = rng.permutation(len(segment.keys))
    return replace(segment, keys=segment.keys[order], poses=segment.poses[order], merit=segment.merit[order])


def chosen_keys(segments: list[KeySegment], placed: KeyPlacements) -> list[list[int]]:
    stages = stages_of(segments, [False] * (len(segments) - 1))
    return [stage.keys[row].tolist() for stage, row in zip(stages, placed.chosen, strict=True)]


# One pose for all


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.integers(1, 5))
def test_a_pose_that_all_segments_accept_costs_nothing(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    common = some_keys(rng, 5)
    segments = [
        segment_of(s.name, np.unique(np.concatenate([s.keys, common]), axis=0), root_a=(i, 1), root_b=(2, i))
        for i, s in enumerate(some_segments(rng, count, 12))
    ]
    placed = solved(segments)
    assert (placed.cost, placed.lower_bound) == (0, 0)
    assert np.ptp(placed.a, axis=0) == approx(np.zeros(3)) and np.ptp(placed.b, axis=0) == approx(np.zeros(3))
    assert placed.a[0] == approx(np.zeros(3))
    stages = stages_of(segments, [False] * (count - 1))
    assert plain_cost(stages, placed.a, placed.b, gauge=placed.gauge, facing_weight=1.0) == approx(0, abs=1e-20)
    assert placed.equals >= len(common)


def test_of_equal_poses_the_one_of_most_merit_is_taken() -> None:
    keys = [(x, y, 3) for x in range(4) for y in range(4)]
    one = segment_of("one", keys, merit=[0.1 * min(x, y) for x, y, _ in keys])
    two = segment_of("two", keys, merit=[0.3 - 0.1 * x for x, _, _ in keys])
    placed = solved([one, two])
    assert placed.equals == 16
    assert chosen_keys([one, two], placed) == [[1, 1, 3]] * 2  # of those with 0.1 in both, the smallest


def test_of_equal_merit_the_smallest_pose_is_taken() -> None:
    keys = [(2, 0, 1), (0, 5, 2), (0, 5, 0), (1, -3, 0)]
    assert chosen_keys([segment_of("one", keys)], solved([segment_of("one", keys)])) == [[0, 5, 0]]


def test_a_scene_of_one_segment() -> None:
    placed = solved([segment_of("only", [(3, 4, QUARTER), (0, 0, 0)], merit=[1, 0], root_a=(5, 6))])
    assert placed.a == approx(np.zeros((1, 3)))
    assert placed.b == approx(np.array([[0.3, 0.4, np.pi / 2]]))
    assert placed.gauge == approx(np.pi / 2)


def test_adjoining_segments_have_one_placement() -> None:
    rng = np.random.default_rng(0)
    segments = some_segments(rng, 3, 150)
    placed = solved(segments, adjoins=[True, False])
    assert placed.a.shape == (2, 3) and len(placed.chosen) == 2


# Ties that cost something


def corridor(merit_at: int) -> list[KeySegment]:
    """Two segments that are one step apart everywhere; only merit tells where along y the pair should be."""
    keys = [[(x, y, k) for y in range(10) for k in (2, 7)] for x in (0, 1)]
    merits = [[-0.01 * abs(y - merit_at) - 0.001 * k for _, y, k in own] for own in keys]
    return [segment_of(str(i), own, merit=merit) for i, (own, merit) in enumerate(zip(keys, merits, strict=True))]


@pytest.mark.parametrize("merit_at", [0, 4, 6, 9])
def test_chains_that_cost_the_same_are_told_apart_by_merit(merit_at: int) -> None:
    segments = corridor(merit_at)
    placed = solved(segments, weight=1e5)
    assert placed.cost == approx(0.5 * STEP**2, rel=1e-3)
    assert chosen_keys(segments, placed) == [[0, merit_at, 2], [1, merit_at, 2]]
    assert placed.lower_bound >= 0.99 * placed.cost


def test_chains_of_the_same_cost_and_merit_are_told_apart_by_their_poses() -> None:
    segments = [segment_of(str(x), [(x, y, 5) for y in (3, 1, 2)]) for x in (0, 1)]
    placed = solved(segments, weight=1e5)
    assert chosen_keys(segments, placed) == [[0, 1, 5], [1, 1, 5]]


@pytest.mark.parametrize("seed", range(3))
def test_the_answer_does_not_depend_on_the_order_of_rows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    segments = corridor(5) if seed == 0 else some_segments(rng, 4, 15)
    first = solved(segments)
    mixed = [shuffled(segment, rng) for segment in segments]
    again = solved(mixed)
    assert chosen_keys(mixed, again) == chosen_keys(segments, first)
    assert (again.a == first.a).all() and (again.b == first.b).all() and again.gauge == first.gauge


# What is free


@pytest.mark.parametrize("seed", range(4))
def test_the_plain_cost_of_the_answer_is_what_it_says(seed: int) -> None:
    stages = problem(seed, count=4, size=12)
    placed = best_placements(stages, facing_weight=0.6, step=STEP, n_yaw=N_YAW)
    assert plain_cost(stages, placed.a, placed.b, gauge=placed.gauge, facing_weight=0.6) == approx(placed.cost)
    assert 0.99 * placed.cost <= placed.lower_bound <= placed.cost


def square_keys(rng: np.random.Generator, size: int) -> IntArray:
    """Poses of quarter turns, which the inverse and a shift of either frame leave on the lattice."""
    keys = some_keys(rng, size, reach=4, yaws=0)
    keys[:, 2] = rng.integers(0, 4, len(keys)) * QUARTER
    return np.unique(keys, axis=0)


def square_segments(seed: int) -> list[KeySegment]:
    rng = np.random.default_rng(seed)
    roots = rng.normal(0, 0.5, (3, 2, 2))
    while True:
        keys = [square_keys(rng, 5) for _ in range(3)]
        if not set.intersection(*({tuple(key) for key in own.tolist()} for own in keys)):
            break
    return [
        KeySegment(str(i), own, poses_of(own), np.zeros(len(own)), root[0], root[1])
        for i, (own, root) in enumerate(zip(keys, roots, strict=True))
    ]


def moved(segment: KeySegment, *, frame_a: FloatArray, frame_b: FloatArray) -> KeySegment:
    """The same segment, told in other frames of both: old_from_new is `frame_a` and `frame_b`."""
    poses = compose(invert(frame_a), compose(segment.poses, frame_b))
    keys = np.rint(np.column_stack([poses[:, :2] / STEP, poses[:, 2] * N_YAW / (2 * np.pi)])).astype(np.int64)
    keys[:, 2] %= N_YAW
    roots = (frame_a, segment.root_a), (frame_b, segment.root_b)
    back = [compose(invert(frame), np.array([*root, 0.0]))[:2] for frame, root in roots]
    assert np.allclose(keys[:, :2] * STEP, poses[:, :2])
    return KeySegment(segment.name, keys, poses_of(keys), segment.merit, *back)


def same_place(placed: FloatArray, expected: FloatArray) -> None:
    assert placed[:, :2] == approx(expected[:, :2], abs=1e-5)
    assert wrap_angle(placed[:, 2] - expected[:, 2]) == approx(np.zeros(len(placed)), abs=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_turning_and_shifting_a_capture_changes_nothing(seed: int) -> None:
    """Of B: its meshes stand where they stood. Of A: the scene moves along, since A's frame is the scene's."""
    segments = square_segments(seed)
    before = solved(segments, weight=0.5)
    frame_a = np.array([3 * STEP, -2 * STEP, np.pi / 2])
    frame_b = np.array([-7 * STEP, 4 * STEP, np.pi])
    after = solved([moved(s, frame_a=frame_a, frame_b=frame_b) for s in segments], weight=0.5)
    assert after.cost == approx(before.cost)
    same_place(after.a, compose(invert(frame_a), compose(before.a, frame_a)))
    same_place(after.b, compose(invert(frame_a), compose(before.b, frame_b)))


@pytest.mark.parametrize("steps", [1, 13, 23])
def test_turning_b_by_any_step_changes_nothing(steps: int) -> None:
    segments = some_segments(np.random.default_rng(steps), 4, 12)
    before = solved(segments)
    frame_b = np.array([0, 0, steps * 2 * np.pi / N_YAW])
    after = solved([moved(s, frame_a=np.zeros(3), frame_b=frame_b) for s in segments])
    assert after.cost == approx(before.cost)
    same_place(after.a, before.a)
    same_place(after.b, compose(before.b, frame_b))


@pytest.mark.parametrize("seed", range(4))
def test_the_roles_may_be_swapped(seed: int) -> None:
    segments = square_segments(seed)
    before = solved(segments, weight=0.5)
    inverse = [invert(segment.poses) for segment in segments]
    keys = [
        np.rint(np.column_stack([p[:, :2] / STEP, p[:, 2] * N_YAW / (2 * np.pi)])).astype(np.int64) for p in inverse
    ]
    other = [
        KeySegment(s.name, wrapped(k), poses_of(wrapped(k)), s.merit, s.root_b, s.root_a)
        for s, k in zip(segments, keys, strict=True)
    ]
    after = solved(other, weight=0.5)
    assert after.cost == approx(before.cost)
    same_place(compose(invert(after.b), after.a), compose(invert(before.a), before.b))


def wrapped(keys: IntArray) -> IntArray:
    return np.column_stack([keys[:, :2], keys[:, 2] % N_YAW])
