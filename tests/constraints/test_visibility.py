import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.constraints.visibility import SightCone, sees, sight_cone
from mhvedit.sequences.meshes import Gaze

NUMBERS = np.array([3, 4, 5, 9])


def gaze_of(directions: list[list[float]]) -> Gaze:
    eye = np.arange(12, dtype=float).reshape(4, 3)
    return Gaze(NUMBERS, eye, np.array(directions, float))


def test_the_cone_starts_at_the_average_eye_and_follows_the_average_gaze() -> None:
    gaze = gaze_of([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]])
    cone = sight_cone(gaze, np.array([3, 4]), half_angle=0.5)
    np.testing.assert_allclose(cone.eye, [1.5, 2.5, 3.5])
    np.testing.assert_allclose(cone.direction, np.array([1, 1, 0]) / np.sqrt(2))
    assert cone.half_angle == 0.5


def test_a_frame_that_is_asked_for_twice_counts_twice() -> None:
    """A retimed segment shows some frames more than once."""
    gaze = gaze_of([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]])
    cone = sight_cone(gaze, np.array([3, 3, 9]), half_angle=0.5)
    np.testing.assert_allclose(cone.eye, [3, 4, 5])
    np.testing.assert_allclose(cone.direction, np.array([2, 0, 1]) / np.sqrt(5))


def test_gazes_that_cancel_leave_the_one_in_the_middle() -> None:
    gaze = gaze_of([[1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, 1]])
    assert sight_cone(gaze, np.array([3, 4]), half_angle=0.5).direction.tolist() == [-1, 0, 0]


@pytest.mark.parametrize("half_angle", [10.0, 40.0, 89.0, 120.0])
def test_a_point_is_seen_up_to_the_half_angle_at_any_distance(half_angle: float) -> None:
    cone = SightCone(np.array([1.0, 2, 3]), np.array([0.0, 1, 0]), np.deg2rad(half_angle))
    for far in (1e-3, 1.0, 1e3):
        for off, expected in ((half_angle - 0.1, True), (half_angle + 0.1, False)):
            point = cone.eye + far * np.array([np.sin(np.deg2rad(off)), np.cos(np.deg2rad(off)), 0])
            assert sees(cone, point[None]) == expected


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30, derandomize=True)
def test_seeing_is_the_angle_to_the_nearest_point(seed: int) -> None:
    rng = np.random.default_rng(seed)
    way = rng.normal(size=3)
    cone = SightCone(rng.normal(size=3), way / np.linalg.norm(way), float(rng.uniform(0.1, 3)))
    points = rng.normal(size=(5, 3))
    towards = points - cone.eye
    angles = np.arccos(towards @ cone.direction / np.linalg.norm(towards, axis=1))
    assert sees(cone, points) == (angles.min() <= cone.half_angle)


def test_nothing_is_seen_where_there_is_nothing() -> None:
    assert not sees(SightCone(np.zeros(3), np.array([1.0, 0, 0]), 3.0), np.zeros((0, 3)))
