"""Planar poses form a group, and act on points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose, compose, invert, rotation, wrap_angle

POSES = arrays(np.float64, 3, elements=st.floats(-10, 10))
NOWHERE = np.zeros(3)


@given(p=POSES, q=POSES, r=POSES)
def test_composition_is_associative(p: FloatArray, q: FloatArray, r: FloatArray) -> None:
    np.testing.assert_allclose(compose(compose(p, q), r), compose(p, compose(q, r)), atol=1e-9)


@given(p=POSES)
def test_the_inverse_undoes_a_pose_on_either_side(p: FloatArray) -> None:
    np.testing.assert_allclose(compose(p, invert(p)), NOWHERE, atol=1e-9)
    np.testing.assert_allclose(compose(invert(p), p), NOWHERE, atol=1e-9)
    np.testing.assert_allclose(compose(p, NOWHERE), p, atol=1e-9)


@given(p=POSES, q=POSES, points=arrays(np.float64, (4, 3), elements=st.floats(-5, 5)))
def test_placing_by_a_composition_is_placing_twice(p: FloatArray, q: FloatArray, points: FloatArray) -> None:
    np.testing.assert_allclose(apply_pose(compose(p, q), points), apply_pose(p, apply_pose(q, points)), atol=1e-9)


def test_a_quarter_turn_is_counter_clockwise_and_leaves_height() -> None:
    np.testing.assert_allclose(apply_pose(np.array([1, 2, np.pi / 2]), np.array([1.0, 0, 5])), [1, 3, 5])
    np.testing.assert_allclose(apply_pose(np.array([1, 2, np.pi / 2]), np.array([[0.0, 1]])), [[0, 2]])


def test_points_and_poses_are_left_as_they_were() -> None:
    points, pose = np.ones((2, 3)), np.array([1.0, 2, 3])
    points.flags.writeable = pose.flags.writeable = False
    assert apply_pose(pose, points) is not points
    compose(pose, pose)
    invert(pose)


def test_poses_broadcast() -> None:
    many = np.random.default_rng(0).normal(size=(5, 1, 3))
    others = np.random.default_rng(1).normal(size=(4, 3))
    both = compose(many, others)
    assert both.shape == (5, 4, 3)
    np.testing.assert_allclose(both[3, 2], compose(many[3, 0], others[2]))
    np.testing.assert_allclose(invert(many)[3, 0], invert(many[3, 0]))


@given(angle=st.floats(-50, 50))
def test_a_wrapped_angle_is_the_same_direction_within_half_a_turn(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -np.pi <= wrapped < np.pi
    np.testing.assert_allclose(rotation(wrapped), rotation(angle), atol=1e-9)


@pytest.mark.parametrize(("angle", "wrapped"), [(np.pi, -np.pi), (-np.pi, -np.pi), (0, 0), (3.5 * np.pi, -0.5 * np.pi)])
def test_wrapping_at_the_seam(angle: float, wrapped: float) -> None:
    assert wrap_angle(angle) == pytest.approx(wrapped)


def test_a_rotation_keeps_lengths_and_orientation() -> None:
    matrices = rotation(np.linspace(-4, 4, 9))
    np.testing.assert_allclose(matrices @ matrices.transpose(0, 2, 1), np.tile(np.eye(2), (9, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(matrices), 1)
