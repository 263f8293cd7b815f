from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mhvedit.errors import ShapeError
from mhvedit.skeleton.model import Motion, ancestors, dofs_of, joint_index
from tests.skeleton.trees import planar_arm, random_skeleton

ARM = planar_arm(np.array([2.0, 1.0]))


def test_an_unknown_joint_is_answered_with_those_known() -> None:
    assert joint_index(ARM, "joint2") == 2
    with pytest.raises(ShapeError, match=r"joint: expected one of joint0, joint1, joint2, found 'hand'"):
        joint_index(ARM, "hand")


def test_dofs_by_joint_name() -> None:
    assert dofs_of(ARM, ("joint1",)).tolist() == [1]
    assert dofs_of(ARM, ("joint2",)).tolist() == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parents": np.array([-1, 2, 1])}, "parents before their children"),
        ({"parents": np.array([-1, -1, 1])}, "-1 for the first joint and for no other"),
        ({"names": ("a", "a", "b")}, "each name once"),
        ({"offsets": np.full((3, 3), np.nan)}, "finite numbers"),
        ({"offsets": np.zeros((2, 3))}, r"offsets: expected \(3, 3\), found \(2, 3\)"),
        ({"dof_axis": np.full((2, 3), 1.0)}, "unit vectors"),
        ({"dof_joint": np.array([1, 0])}, "never decreasing"),
        ({"dof_joint": np.array([0, 3])}, "joints 0 to 2"),
        ({"dof_joint": np.array([1, 1]), "dof_slides": np.array([False, True])}, "slides before turns"),
        ({"limits": np.array([[0.0, 1.0], [1.0, 0.0]])}, "the lower limit first"),
    ],
)
def test_a_tree_that_cannot_be_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        replace(ARM, **change)


def test_a_motion_is_finite() -> None:
    q = np.zeros((3, 2))
    q[1, 0] = np.nan
    with pytest.raises(ShapeError, match="q of frame 1, DOF 0: expected a finite number"):
        Motion(q, 30.0)
    with pytest.raises(ShapeError, match="fps: expected a positive number"):
        Motion(np.zeros((3, 2)), 0.0)


def test_ancestors_are_those_on_the_way_to_the_root() -> None:
    tree = random_skeleton(np.random.default_rng(0), 9)
    above = ancestors(tree)
    for joint in range(9):
        way, at = set(), joint
        while at >= 0:
            way.add(at)
            at = int(tree.parents[at])
        assert set(np.flatnonzero(above[joint])) == way
