import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from pytest import approx

from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.bodies import Pose
from mhvedit.world.depth import TOLERANCE, global_depth, normals_cancel, push_out
from mhvedit.world.turning import turn
from tests.world.things import at

WALLS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def room(low: FloatArray, high: FloatArray):  # type: ignore[no-untyped-def]  # noqa: ANN201
    """A point in a room: depth behind each of its walls."""

    def look(pose: Pose) -> tuple[FloatArray, FloatArray]:
        depths = np.concatenate([low - pose.position, pose.position - high])
        normals = np.concatenate([np.eye(3), -np.eye(3)])
        return depths[depths > 0], normals[depths > 0]

    return look


def test_c2_2_equation_1_is_the_mean_weighted_by_depth() -> None:
    depths = np.array([0.01, 0.03])
    assert global_depth(depths, WALLS) == approx([1e-4 / 0.04, 9e-4 / 0.04, 0.0])
    assert global_depth(depths[:1], WALLS[:1]) == approx([0.01, 0.0, 0.0])
    assert global_depth(np.zeros(0), np.zeros((0, 3))) == approx(np.zeros(3))


def test_c2_4_in_a_corner_overlap_halves_so_that_ten_applications_make_it_a_thousandth() -> None:
    depths = np.full(2, 1.0)
    for k in range(1, 11):
        depths = depths - WALLS @ global_depth(depths, WALLS)
        assert depths == approx(0.5**k)
    assert depths.max() < 1e-3


@given(st.floats(1e-3, 0.1), st.floats(0, 0.5))
def test_one_wall_takes_one_application(depth: float, along: float) -> None:
    out = push_out(at(-depth, along, 0.0), room(np.zeros(3) - [0, 9, 9], np.full(3, 9.0)))
    assert out.iterations == 1 and out.free
    assert out.pose.position[0] == approx(2e-4) and out.pose.position[1] == approx(along)


@given(st.floats(1e-3, 0.1), st.floats(1e-3, 0.1))
def test_a_corner_is_left_in_a_few_applications(x: float, y: float) -> None:
    out = push_out(at(-x, -y, 0.0), room(np.array([0.0, 0, -9]), np.full(3, 9.0)))
    assert out.free and not out.returned
    assert out.deepest <= TOLERANCE and out.iterations <= 12


def test_c2_3_opposing_normals_lead_back_to_the_last_free_pose() -> None:
    slot = room(np.array([-0.01, 0.0, -9]), np.array([0.01, 9.0, 9]))  # open at y > 0

    def wide(pose: Pose) -> tuple[FloatArray, FloatArray]:
        """A disc of 2 cm, which does not fit between the walls x = -1 cm and x = 1 cm that end at y = 1."""
        if pose.position[1] >= 1.0:
            return np.zeros(0), np.zeros((0, 3))
        return np.full(2, 0.01), np.array([[1.0, 0, 0], [-1.0, 0, 0]])

    assert normals_cancel(*wide(at(0, 0.5, 0))) and len(slot(at(0, 1, 0))[0]) == 0
    assert not push_out(at(0.0, 0.5, 0.0), wide).free
    out = push_out(at(0.0, 0.5, 0.0), wide, free=at(0.0, 2.0, 0.0))
    assert out.free and out.returned
    assert out.pose.position[1] == approx(1.0, abs=2e-3) and out.pose.position[1] >= 1.0


def test_the_way_back_turns_the_short_way() -> None:
    def tilted(pose: Pose) -> tuple[FloatArray, FloatArray]:
        angle = np.arccos(np.clip(pose.rotation[0, 0], -1, 1))
        deep = max(angle - 1.0, 0.0)
        return np.full(2, deep), np.array([[1.0, 0, 0], [-1.0, 0, 0]])

    out = push_out(Pose(turn(np.array([0, 0, 1.6])), np.zeros(3)), tilted, free=at(0, 0, 0))
    assert np.arccos(out.pose.rotation[0, 0]) == approx(1.0, abs=2e-3)


def test_a_last_pose_that_is_no_longer_free_is_of_no_use() -> None:
    def everywhere(pose: Pose) -> tuple[FloatArray, FloatArray]:
        return np.full(2, 0.02), np.array([[1.0, 0, 0], [-1.0, 0, 0]])

    out = push_out(at(0, 0, 0), everywhere, free=at(1, 0, 0))
    assert not out.free and out.deepest == approx(0.02)
