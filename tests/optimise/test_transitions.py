"""The way between key segments, against eqs 19 to 25 solved densely for every frame's turn and centre."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pytest import approx

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose, rotation
from mhvedit.optimise.transitions import PathSettings, calmed, placement_path, slowness

SETTINGS = PathSettings()
HERE, THERE = (0.0, 0.0, 0.0), (1.5, -0.7, 1.2)


def walk(count: int, seed: int = 0, speed: float = 0.03) -> tuple[FloatArray, FloatArray]:
    """Centres and facings of somebody who wanders."""
    rng = np.random.default_rng(seed)
    facing = np.cumsum(rng.normal(0, 0.03, count))
    steps = speed * rng.uniform(0, 2, count)[:, None] * np.column_stack([np.cos(facing), np.sin(facing)])
    return np.cumsum(steps, axis=0), facing


def key_frames(count: int, *keys: tuple[int, int, tuple[float, float, float]]) -> FloatArray:
    fixed = np.full((count, 3), np.nan)
    for start, stop, pose in keys:
        fixed[start:stop] = pose
    return fixed


def centres_of(placements: FloatArray, centres: FloatArray) -> FloatArray:
    return np.array([apply_pose(pose, centre) for pose, centre in zip(placements, centres, strict=True)])


def dense_path(fixed: FloatArray, centres: FloatArray, facing: FloatArray, settings: PathSettings) -> FloatArray:
    """One transition, frame by frame: turns first, then centres, as plain least squares."""
    pivot, heading = calmed(centres), calmed(facing)
    known = np.flatnonzero(~np.isnan(fixed[:, 0]))
    first = int(np.flatnonzero(np.diff(known) > 1)[0])
    before, after = int(known[first]), int(known[first + 1])
    frames = list(range(before - 1, after + 2))
    free = frames[2:-2]
    middle = 0.5 * (fixed[before, 2] + fixed[after, 2])
    original = pivot @ rotation(middle).T

    def weight(values: FloatArray, k: int, slow: float) -> float:
        speed = 0.5 * (np.linalg.norm(values[k - 1] - values[k]) + np.linalg.norm(values[k] - values[k + 1]))
        return float(1 / (1 + np.exp(settings.alpha * (speed - slow))))

    def solve(kept: FloatArray, ends: FloatArray, weights: list[float]) -> FloatArray:
        """Eqs 19 to 21 for the unknown values x of the frames in between."""
        rows, right = [], []
        for k, w in zip(range(before, after + 1), weights, strict=True):
            for stencil, share in (
                ((1, -2, 1), settings.acceleration),
                ((-0.5, 0, 0.5), (1 - settings.acceleration) * w),
            ):
                row, value = np.zeros(len(free)), np.zeros(kept.shape[1])
                for frame, c in zip((k - 1, k, k + 1), stencil, strict=True):
                    value = value + c * kept[frame]
                    if frame in free:
                        row[free.index(frame)] += c
                    else:
                        value = value - c * ends[frame]
                rows.append(np.sqrt(share) * row)
                right.append(np.sqrt(share) * value)
        return np.asarray(np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0])

    placements = fixed.copy()
    inside = range(before, after + 1)
    turns = [weight(heading[:, None], k, settings.slow_turn) for k in inside]
    edited_facing = solve(heading[:, None], heading[:, None] + fixed[:, 2:], turns)[:, 0]
    at = solve(original, centres_of(fixed, pivot), [weight(pivot, k, settings.slow_speed) for k in inside])
    for frame, angle, centre in zip(free, edited_facing, at, strict=True):
        turn = angle - heading[frame]
        placements[frame] = *(centre - rotation(turn) @ pivot[frame]), turn
    return placements


@pytest.mark.parametrize("gap", [1, 2, 3, 4, 17])
@pytest.mark.parametrize("acceleration", [0.5, 0.05, 1.0])
def test_the_path_is_the_dense_least_squares_solution(gap: int, acceleration: float) -> None:
    settings = PathSettings(acceleration=acceleration, alpha=30.0)
    centres, facing = walk(8 + gap, seed=gap)
    fixed = key_frames(8 + gap, (0, 4, (0.3, 0.1, 0.4)), (4 + gap, 8 + gap, THERE))
    path = placement_path(fixed, centres=centres, facing=facing, settings=settings)
    assert path == approx(dense_path(fixed, centres, facing, settings), abs=1e-8)


def test_key_segments_keep_their_placement_and_what_is_outside_moves_with_them() -> None:
    centres, facing = walk(40)
    fixed = key_frames(40, (5, 12, HERE), (25, 31, THERE))
    path = placement_path(fixed, centres=centres, facing=facing, settings=SETTINGS)
    assert path[:12] == approx(np.tile(HERE, (12, 1)))
    assert path[25:] == approx(np.tile(THERE, (15, 1)))
    assert not np.isnan(path).any()


@settings(max_examples=40)
@given(st.tuples(*[st.floats(-3, 3)] * 3), st.integers(0, 1000))
def test_one_placement_of_all_key_segments_is_the_placement_of_all_frames(
    pose: tuple[float, float, float], seed: int
) -> None:
    centres, facing = walk(40, seed)
    fixed = key_frames(40, (3, 8, pose), (20, 21, pose), (30, 33, pose))
    path = placement_path(fixed, centres=centres, facing=facing, settings=SETTINGS)
    assert path == approx(np.tile(pose, (40, 1)), abs=1e-7)


def test_whole_turns_do_not_matter() -> None:
    centres, facing = walk(30)
    fixed = key_frames(30, (0, 5, (1, 2, 0.3)), (20, 30, (1, 2, 0.3 + 4 * np.pi)))
    path = placement_path(fixed, centres=centres, facing=facing, settings=SETTINGS)
    assert path == approx(np.tile((1, 2, 0.3), (30, 1)), abs=1e-9)


@pytest.mark.parametrize("start", [0, 80, 170, -100])
@pytest.mark.parametrize("turn", [100, -100, 150, -150, 179, 10])
def test_turns_go_the_short_way(start: int, turn: int) -> None:
    centres, facing = walk(60)
    ends = np.radians(start), (np.radians(start + turn) + np.pi) % (2 * np.pi) - np.pi
    fixed = key_frames(60, (0, 10, (0, 0, ends[0])), (40, 60, (0.5, 0, ends[1])))
    path = placement_path(fixed, centres=centres, facing=facing, settings=SETTINGS)
    turned = np.degrees(path[:, 2]) - start
    assert turned[-1] == approx(turn)
    assert (np.diff(turned) * np.sign(turn) >= -0.05 * abs(turn)).all()  # a smooth curve may swing out a little
    assert np.abs(np.diff(turned)).max() < 2.5 * abs(turn) / 30


@pytest.mark.parametrize("pose", [THERE, (30.0, -20.0, -2.8)])
@pytest.mark.parametrize("gap", [20, 60])
def test_velocity_is_continuous(pose: tuple[float, float, float], gap: int) -> None:
    """Where acceleration counts alone the way is a cubic: it changes speed by 6 / gap^2 of its length at most."""
    centres, facing = np.zeros((80 + gap, 2)), np.zeros(80 + gap)
    fixed = key_frames(80 + gap, (0, 40, HERE), (40 + gap, 80 + gap, pose))
    path = placement_path(fixed, centres=centres, facing=facing, settings=PathSettings(acceleration=1.0))
    assert (np.abs(np.diff(path, n=2, axis=0)).max(0) <= 6 * np.abs(pose) / gap**2 + 1e-9).all()


@pytest.mark.parametrize("pose", [THERE, (3.0, -2.0, -2.8)])
def test_velocity_does_not_jump_where_speed_counts_too(pose: tuple[float, float, float]) -> None:
    gap = 60
    fixed = key_frames(80 + gap, (0, 40, HERE), (40 + gap, 80 + gap, pose))
    path = placement_path(fixed, centres=np.zeros((140, 2)), facing=np.zeros(140), settings=SETTINGS)
    assert (np.abs(np.diff(path, n=2, axis=0)).max(0) <= 0.6 * np.abs(pose) / gap).all()  # 1 would be a kink


@pytest.mark.parametrize("gap", [1, 2, 3])
@pytest.mark.parametrize("lengths", [(1, 1), (1, 5), (5, 1), (2, 2)])
def test_short_transitions_and_key_segments_of_one_frame(gap: int, lengths: tuple[int, int]) -> None:
    count = sum(lengths) + gap
    fixed = key_frames(count, (0, lengths[0], (0, 0, 0)), (lengths[0] + gap, count, (0.4, 0, 0.2)))
    path = placement_path(fixed, centres=np.zeros((count, 2)), facing=np.zeros(count), settings=SETTINGS)
    inside = path[lengths[0] : lengths[0] + gap]
    assert (np.diff(path[:, 0]) >= -1e-9).all() and (np.diff(path[:, 2]) >= -1e-9).all()
    assert inside == approx(np.array([0.4, 0, 0.2]) - inside[::-1]) or lengths[0] != lengths[1]


def test_a_key_segment_alone_carries_everybody() -> None:
    path = placement_path(key_frames(1, (0, 1, THERE)), centres=np.ones((1, 2)), facing=np.zeros(1), settings=SETTINGS)
    assert path == approx(np.array([THERE]))
    path = placement_path(key_frames(9, (4, 5, THERE)), centres=np.ones((9, 2)), facing=np.zeros(9), settings=SETTINGS)
    assert path == approx(np.tile(THERE, (9, 1)))


@pytest.mark.parametrize("frame", [3, 12, 20, 37])
def test_a_wrong_centre_or_facing_of_one_frame_hardly_reaches_the_placements(frame: int) -> None:
    centres, facing = walk(40)
    fixed = key_frames(40, (0, 10, HERE), (30, 40, (0.3, 0.2, 0.8)))
    path = placement_path(fixed, centres=centres, facing=facing, settings=SETTINGS)
    wrong, astray = centres.copy(), facing.copy()
    wrong[frame] += (0.05, -0.05)
    astray[frame] += np.radians(20)
    moved = placement_path(fixed, centres=wrong, facing=facing, settings=SETTINGS) - path
    assert np.abs(moved[:, :2]).max() < 0.15 * 0.05
    turned = placement_path(fixed, centres=centres, facing=astray, settings=SETTINGS) - path
    assert np.abs(turned).max() < np.radians(1)


def test_noise_in_all_frames_leaves_the_path_smooth() -> None:
    rng = np.random.default_rng(0)
    centres, facing = walk(80)
    fixed = key_frames(80, (0, 20, HERE), (60, 80, (0.3, 0.2, 0.8)))
    path = placement_path(
        fixed,
        centres=centres + rng.normal(0, 0.02, (80, 2)),
        facing=facing + rng.normal(0, 0.2, 80),
        settings=SETTINGS,
    )
    still = placement_path(fixed, centres=centres, facing=facing, settings=SETTINGS)
    assert np.abs(np.diff(path - still, n=2, axis=0)).max() < 0.002


def test_frames_that_stand_still_are_moved_least() -> None:
    """Half the way the feet stand, half they walk: the shift is made while they walk (eq. 22)."""
    count = 100
    speed = np.where(np.arange(count) < 50, 0.0, 0.06)
    centres = np.column_stack([np.cumsum(speed), np.zeros(count)])
    fixed = key_frames(count, (0, 10, HERE), (90, 100, (0.0, 1.0, 0.0)))
    sharp = PathSettings(acceleration=0.02, alpha=200.0)
    path = placement_path(fixed, centres=centres, facing=np.zeros(count), settings=sharp)
    standing, walking = path[45, 1] - path[10, 1], path[89, 1] - path[55, 1]
    assert standing < 0.2 * walking


def test_weights_are_the_logistic_curve_of_the_mean_of_both_steps() -> None:
    weights = slowness(np.array([0.0, 0.02, 0.06]), 0.01, 50.0)
    speeds = np.array([0.0, 0.01, 0.04, 0.06])  # at either end of the capture only one step is known
    assert weights == approx(1 / (1 + np.exp(50 * (speeds - 0.01))))


def test_weights_of_great_speeds_do_not_overflow() -> None:
    assert slowness(np.array([1e6]), 0.01, 1e3) == approx(np.zeros(2))


def test_a_long_way_takes_no_time() -> None:
    count = 20_000
    fixed = key_frames(count, (0, 5, HERE), (count - 5, count, THERE))
    centres, facing = walk(count)
    path = placement_path(fixed, centres=centres, facing=facing, settings=PathSettings(acceleration=0.5))
    assert not np.isnan(path).any()
