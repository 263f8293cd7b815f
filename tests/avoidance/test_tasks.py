import numpy as np
import pytest

from mhvedit.avoidance.constraints import world_point
from mhvedit.avoidance.ground import StandingSettings, at_joints, frames_to, ground_joints, keep_standing, standing
from mhvedit.avoidance.planes import path_planes, plane_normals
from mhvedit.avoidance.posture import place, predict_posture
from mhvedit.avoidance.tasks import frozen_dofs, two_handed
from mhvedit.errors import ShapeError
from mhvedit.skeleton.model import Motion
from tests.avoidance.figures import crossed_arms, figure

FIGURE = figure()


def test_b10_a_foot_stands_where_it_is_slow_and_low_for_some_frames() -> None:
    path = np.zeros((12, 1, 3))
    path[5:, 0, 0] = np.arange(7) * 0.1
    path[:3, 0, 2] = 0.5
    still = standing(path, fps=30.0)[:, 0]
    assert still.tolist() == [False] * 3 + [True] * 3 + [False] * 6
    assert not standing(path, fps=30.0, settings=StandingSettings(least=4)).any()


def test_b10_between_two_stands_a_foot_may_go_as_far_as_it_can_come_back() -> None:
    q = np.zeros((20, FIGURE.n_dofs))
    q[8:13, FIGURE.dof_names.index("left_thigh.0")] = [-0.3, -0.6, -0.8, -0.6, -0.3]
    keep = keep_standing(FIGURE, Motion(q, 30.0), at_joints(ground_joints(FIGURE)))
    column = keep.joints.tolist().index(FIGURE.names.index("left_foot"))
    assert (keep.slack[:7, column] == 0).all()
    assert (keep.slack[14:, column] == 0).all()
    assert keep.stands[:7, column].all()
    assert not keep.stands[10, column]
    assert keep.slack[10, column] > keep.slack[8, column] > 0
    other = keep.joints.tolist().index(FIGURE.names.index("right_foot"))
    assert (keep.slack[:, other] == 0).all()


def test_frames_to_nothing_is_never() -> None:
    assert np.isinf(frames_to(np.zeros((4, 2), np.bool_))).all()


def test_b6_1_planes_face_along_the_path_and_b6_2_skip_joints_at_rest() -> None:
    pair = np.array([[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]], [[0.0, 0.3, 0.4], [1.0, 1.0, 1.0]]])
    normals = plane_normals(pair)
    assert np.allclose(normals[0], [0.0, 0.6, 0.8])
    assert np.isnan(normals[1]).all()


def test_b6_3_elbows_and_wrists_have_planes_of_their_own() -> None:
    q = crossed_arms(FIGURE, 3)
    both = path_planes(FIGURE)
    names = [FIGURE.names[joint] for joint in both.joints]
    assert names == ["left_forearm", "left_hand", "right_forearm", "right_hand"]
    assert [FIGURE.names[j] for j in path_planes(FIGURE, wrists=False).joints] == ["left_forearm", "right_forearm"]
    for frame in range(3):
        for plane, joint in zip(both.constraints(frame, q), both.joints, strict=True):
            assert plane.joint == joint  # type: ignore[attr-defined]
            at = world_point(place(FIGURE, q[frame]), int(joint), np.zeros(3))
            assert np.allclose(plane.origin, at)  # type: ignore[attr-defined]


def test_b6_5_with_planes_postures_stay_on_the_path() -> None:
    """The distance to the plane is what eq. 3.3 constrains."""
    q = crossed_arms(FIGURE, 2)
    planes = path_planes(FIGURE, wrists=False).constraints(0, q)
    start = q[0] + np.random.default_rng(0).normal(0, 0.1, FIGURE.n_dofs)
    posture = predict_posture(FIGURE, start, planes)
    placed = place(FIGURE, posture.q)
    for plane in planes:
        assert plane.rows(placed).violation < 1e-3
        assert plane.rows(place(FIGURE, start)).violation > 1e-3


def test_b7_2_the_grip_is_that_of_the_frame_it_is_taken_from() -> None:
    q = crossed_arms(FIGURE, 4)
    grip = np.array([0.0, 0.0, -0.1])
    task = two_handed(FIGURE, Motion(q, 30.0), hand="left_hand", holder="right_hand", point=grip)
    assert all(c.rows(place(FIGURE, q[-1])).violation < 1e-12 for c in task.constraints(3, q))
    assert max(c.rows(place(FIGURE, q[0])).violation for c in task.constraints(0, q)) > 0.01
    held = predict_posture(FIGURE, q[0], task.constraints(0, q))
    assert held.converged


def test_b7_4_frozen_joints_keep_all_their_dofs() -> None:
    free = frozen_dofs(FIGURE, ["left_thigh", "hips"])
    assert (~free).sum() == 9
    with pytest.raises(ShapeError, match="right_shin"):
        frozen_dofs(FIGURE, ["left_wing"])
