import numpy as np
import pytest
from pytest import approx
from scipy.spatial.transform import Rotation

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.forward import joint_frames, point_jacobian, points_on_joints, turn_jacobian
from mhvedit.skeleton.model import Skeleton
from tests.skeleton.trees import planar_arm, random_skeleton

STEP = 1e-6


def test_a_planar_arm_in_closed_form() -> None:
    arm = planar_arm(np.array([2.0, 1.0]))
    _, positions = joint_frames(arm, np.array([0.3, 0.5]))
    tip = [2 * np.cos(0.3) + np.cos(0.8), 2 * np.sin(0.3) + np.sin(0.8), 0.0]
    assert positions[2] == approx(np.array(tip))


@pytest.mark.parametrize("seed", range(4))
def test_frames_are_the_products_of_scipys_rotations(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tree = random_skeleton(rng)
    q = rng.normal(size=tree.n_dofs)
    rotations, positions = joint_frames(tree, q)
    for joint in range(tree.n_joints):
        up = int(tree.parents[joint])
        turn, at = (np.eye(3), np.zeros(3)) if up < 0 else (rotations[up], positions[up])
        at = at + turn @ tree.offsets[joint]
        for d in np.flatnonzero(tree.dof_joint == joint):
            if tree.dof_slides[d]:
                at = at + turn @ tree.dof_axis[d] * q[d]
            else:
                turn = turn @ Rotation.from_rotvec(tree.dof_axis[d] * q[d]).as_matrix()
        assert rotations[joint] == approx(turn)
        assert positions[joint] == approx(at)


def test_a_batch_is_its_postures_one_by_one() -> None:
    rng = np.random.default_rng(5)
    tree = random_skeleton(rng)
    q = rng.normal(size=(2, 3, tree.n_dofs))
    rotations, positions = joint_frames(tree, q)
    assert rotations.shape == (2, 3, tree.n_joints, 3, 3)
    alone = joint_frames(tree, q[1, 2])
    assert np.array_equal(rotations[1, 2], alone[0])
    assert np.array_equal(positions[1, 2], alone[1])


@pytest.mark.parametrize("seed", range(4))
def test_point_jacobian_against_finite_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tree = random_skeleton(rng)
    q, point = rng.normal(size=(2, tree.n_dofs)), rng.normal(size=3)
    for joint in range(tree.n_joints):
        jacobians = point_jacobian(tree, q, joint, point)
        for i in range(2):
            assert jacobians[i] == approx(_moved(tree, q[i], joint, point), abs=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_turn_jacobian_against_finite_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tree = random_skeleton(rng)
    q = rng.normal(size=tree.n_dofs)
    for joint in range(tree.n_joints):
        columns = []
        for d in range(tree.n_dofs):
            step = np.zeros(tree.n_dofs)
            step[d] = STEP
            after, before = joint_frames(tree, q + step)[0][joint], joint_frames(tree, q - step)[0][joint]
            columns.append(Rotation.from_matrix(after @ before.T).as_rotvec() / (2 * STEP))
        assert turn_jacobian(tree, q, joint) == approx(np.stack(columns, 1), abs=1e-8)


def test_a_posture_of_the_wrong_length_is_refused() -> None:
    arm = planar_arm(np.ones(2))
    with pytest.raises(ShapeError, match=r"q: expected \(..., 2\), found \(4, 3\)"):
        joint_frames(arm, np.zeros((4, 3)))


def _moved(tree: Skeleton, q: FloatArray, joint: int, point: FloatArray) -> FloatArray:
    """(3, D) central differences."""
    columns = []
    for d in range(tree.n_dofs):
        step = np.zeros(tree.n_dofs)
        step[d] = STEP
        ends = points_on_joints(tree, np.stack([q + step, q - step]), np.array([joint]), point[None])[:, 0]
        columns.append((ends[0] - ends[1]) / (2 * STEP))
    return np.stack(columns, 1)
