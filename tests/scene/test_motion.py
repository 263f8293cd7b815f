"""What an edit adds to a motion, in closed form."""

import numpy as np
import pytest

from mhvedit.geometry.arrays import FloatArray
from mhvedit.scene.motion import AddedMotion, added_motion, sole_points

FOOT = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.01]])


def measure(placements: FloatArray, centres: FloatArray | None = None, soles: FloatArray = FOOT) -> AddedMotion:
    n = len(placements)
    still = np.tile([0.0, 0.0, 0.9], (n, 1)) if centres is None else centres
    return added_motion("anna", placements, soles=[soles] * n, centres=still)


def test_a_placement_that_never_changes_adds_nothing() -> None:
    walk = np.cumsum(np.full((6, 3), [0.05, 0.01, 0.0]), axis=0)
    found = measure(np.tile([1.0, 2.0, 0.7], (6, 1)), walk)
    for values in (found.skate, found.step, found.shift, found.turn, found.jump):
        assert values == pytest.approx(0, abs=1e-12)
    assert (len(found.skate), len(found.jump)) == (5, 4)


def test_a_slide_is_the_skate() -> None:
    slide = np.zeros((5, 3))
    slide[:, 0] = [0, 0.01, 0.02, 0.03, 0.03]
    found = measure(slide)
    assert found.skate == pytest.approx([0.01, 0.01, 0.01, 0])
    assert found.shift == pytest.approx(found.skate) and found.step == pytest.approx(found.skate)
    assert found.jump == pytest.approx([0, 0, 0.01])


def test_a_turn_moves_the_sole_that_is_further_off() -> None:
    turn = np.zeros((2, 3))
    turn[1, 2] = 0.1
    found = measure(turn)
    assert found.skate == pytest.approx([2 * 0.2 * np.sin(0.05)])
    assert found.turn == pytest.approx([0.1]) and found.shift == pytest.approx([0])


def test_a_whole_turn_is_no_turn() -> None:
    assert measure(np.array([[0, 0, np.pi - 0.01], [0, 0, -np.pi + 0.01]])).turn == pytest.approx([0.02])


def test_a_step_may_get_shorter() -> None:
    centres = np.array([[0.0, 0, 1], [0.1, 0, 1]])
    found = measure(np.array([[0.0, 0, 0], [-0.04, 0, 0]]), centres)
    assert found.step == pytest.approx([-0.04]) and found.shift == pytest.approx([0.04])


def test_nobody_skates_in_the_air() -> None:
    assert len(sole_points(FOOT + np.array([0, 0, 0.2]))) == 0
    assert len(sole_points(np.array([[0.0, 0, -0.03], [0, 0, -0.02], [0, 0, 0.01]]))) == 2
    assert np.isnan(measure(np.zeros((3, 3)), soles=np.zeros((0, 3))).skate).all()


def test_one_frame_has_no_motion() -> None:
    found = measure(np.zeros((1, 3)))
    assert len(found.skate) == len(found.step) == len(found.jump) == 0
