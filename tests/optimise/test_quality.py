import numpy as np
import pytest
from pytest import approx

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose, invert
from mhvedit.optimise.quality import (
    HOLD_WEIGHT,
    OPPOSITION_WEIGHT,
    SHORTEST_HOLD,
    ContactMotion,
    contact_penalty,
    opposition,
    relative_motion,
)

TRUE_POSE = np.array([0.8, -0.3, 2.1])


def rigid_hold(frames: int, *, held: bool = True, reach: float = 0.2) -> ContactMotion:
    """B's hand stays where it is in A's hand, as it is seen from B at the true pose."""
    t = np.linspace(0, 2 * np.pi, frames)
    hand = np.column_stack([reach * np.cos(t), 0.3 * reach * np.sin(2 * t), 1 + 0.1 * t])
    other = apply_pose(invert(TRUE_POSE), hand + np.array([0.02, 0.01, 0.03]))
    return ContactMotion(hand, other, np.zeros(2), np.zeros(2), held)


def poses_of(yaws: FloatArray) -> FloatArray:
    return np.column_stack([np.tile(TRUE_POSE[:2], (len(yaws), 1)), yaws])


def test_a_rigid_hold_is_still_at_the_true_yaw_alone() -> None:
    yaws = np.append(np.radians(np.arange(0, 360, 2)), TRUE_POSE[2])
    motion = relative_motion(rigid_hold(40), yaws)
    assert motion[-1] == approx(0, abs=1e-12)
    assert np.argmin(motion[:-1]) == round(np.degrees(TRUE_POSE[2]) / 2)


def test_relative_motion_of_circles_has_a_closed_form() -> None:
    """Hands on circles of radius r, one turned by delta: they are 2 r sin(delta / 2) apart, on a circle."""
    t = np.radians(np.arange(0, 360, 5))
    circle = np.column_stack([0.2 * np.cos(t), 0.2 * np.sin(t), np.ones(len(t))])
    contact = ContactMotion(circle, circle, np.zeros(2), np.zeros(2), True)
    yaws = np.array([0.0, 0.5, np.pi, 5.0])
    assert relative_motion(contact, yaws) == approx(0.4 * np.abs(np.sin(yaws / 2)))


def test_height_counts_too() -> None:
    still, rising = np.zeros((4, 3)), np.zeros((4, 3))
    rising[:, 2] = (0, 1, 0, 1)
    contact = ContactMotion(still, rising, np.zeros(2), np.zeros(2), True)
    assert relative_motion(contact, np.array([0.0, 1.0])) == approx(np.full(2, 0.5))


@pytest.mark.parametrize(("angle", "expected"), [(0, 2.0), (60, 1.5), (90, 1.0), (180, 0.0), (270, 1.0)])
@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_opposition_is_the_angle_at_the_contact(angle: int, expected: float, yaw: float) -> None:
    """Both touch at (1, 0), A stands at the origin, B a metre from the contact at an angle to A."""
    direction = np.pi + np.radians(angle)
    root_b = np.array([1 + np.cos(direction), np.sin(direction)])
    pose = np.array([0.4, 0.7, yaw])
    touch = np.array([[1.0, 0.0, 1.0]])
    contact = ContactMotion(
        touch, apply_pose(invert(pose), touch), np.zeros(2), apply_pose(invert(pose), root_b[None])[0], False
    )
    assert opposition(contact, pose[None]) == approx([expected])


def test_long_holds_count_and_short_ones_do_not() -> None:
    yaws = np.radians(np.arange(0, 360, 10))
    mild = [OPPOSITION_WEIGHT * opposition(rigid_hold(n), poses_of(yaws)) for n in (SHORTEST_HOLD - 1, SHORTEST_HOLD)]
    short = contact_penalty(rigid_hold(SHORTEST_HOLD - 1), poses_of(yaws))
    assert short == approx(mild[0])
    hold = rigid_hold(SHORTEST_HOLD)
    assert contact_penalty(hold, poses_of(yaws)) == approx(mild[1] + HOLD_WEIGHT * relative_motion(hold, yaws))


def test_what_is_no_hold_or_hardly_moves_tells_nothing() -> None:
    yaws = np.radians(np.arange(0, 360, 10))
    for contact in (rigid_hold(40, held=False), rigid_hold(40, reach=0.003)):
        assert contact_penalty(contact, poses_of(yaws)) == approx(
            OPPOSITION_WEIGHT * opposition(contact, poses_of(yaws))
        )
