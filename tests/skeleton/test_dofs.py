from itertools import permutations

import numpy as np
import pytest
from pytest import approx
from scipy.spatial.transform import Rotation

from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.dofs import body_skeleton, euler_angles, nearest_solution

ORDERS = ["".join(order) for order in permutations("xyz")]
NAMES = ("Hips", "LeftArm", "LeftForeArm", "LeftUpLeg", "LeftLeg", "RightUpLeg", "RightLeg")
PARENTS = np.array([-1, 0, 1, 0, 3, 0, 5])
ALONG = np.array([[0, 0, 0], [2, 0, 5], [3, 0, 0], [1, 0, 0], [0, 0, -4], [-1, 0, 0], [0, 0, -4]]) / 10.0


@pytest.mark.parametrize("order", ORDERS)
def test_angles_give_back_their_rotations_at_gimbal_lock_too(order: str) -> None:
    rng = np.random.default_rng(0)
    locked = rng.normal(size=(50, 3))
    locked[:, 1] = np.pi / 2 * rng.choice([-1, 1], 50) + 1e-9 * rng.normal(size=50)
    for turns in (Rotation.random(200, rng=rng), Rotation.from_euler(order.upper(), locked)):
        angles = euler_angles(turns.as_matrix(), order)
        assert Rotation.from_euler(order.upper(), angles).as_matrix() == approx(turns.as_matrix(), abs=1e-9)


@pytest.mark.parametrize("order", ORDERS)
def test_a_smooth_motion_has_smooth_angles_through_whole_turns_and_past_a_quarter(order: str) -> None:
    t = np.linspace(0, 1, 200)
    curves = np.stack([9 * t, 2.2 * np.sin(5 * t), -7 * t], 1)
    turns = Rotation.from_euler(order.upper(), curves).as_matrix()
    assert euler_angles(turns, order) == approx(curves, abs=1e-9)


def test_the_nearest_solution_is_the_same_rotation() -> None:
    rng = np.random.default_rng(1)
    for angles, target in zip(rng.uniform(-3, 3, (50, 3)), rng.uniform(-9, 9, (50, 3)), strict=True):
        near = nearest_solution(angles, target)
        turns = Rotation.from_euler("XYZ", [angles, near]).as_matrix()
        assert turns[0] == approx(turns[1])
        assert np.abs(near - target).sum() <= np.abs(angles - target).sum() + 1e-12


@pytest.mark.parametrize(
    ("turn", "limited"),
    [(np.eye(3), True), (np.diag([-1.0, -1.0, 1.0]), False), (np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), False)],
)
def test_limits_hold_for_bodies_that_stand_as_in_the_tables(turn: FloatArray, limited: bool) -> None:
    """One that faces the other way, or lies, has other axes: its joints are free."""
    skeleton = body_skeleton(NAMES, PARENTS, ALONG @ turn.T, turning=dict.fromkeys(NAMES), sliding=("Hips",))
    assert np.isfinite(skeleton.limits[6:]).all() == limited
    assert np.isinf(skeleton.limits[:6]).all()


def test_axes_can_be_chosen_and_turned_round() -> None:
    skeleton = body_skeleton(NAMES, PARENTS, ALONG, turning={"LeftLeg": ["-x"]}, sliding=())
    plain = body_skeleton(NAMES, PARENTS, ALONG, turning={"LeftLeg": ["x"]}, sliding=())
    assert skeleton.dof_axis.tolist() == [[-1.0, 0.0, 0.0]]
    assert skeleton.limits[0] == approx(-plain.limits[0, ::-1])
    assert skeleton.dof_names == ("LeftLeg.x",)
