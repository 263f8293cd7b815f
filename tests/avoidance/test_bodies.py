import numpy as np
import pytest
import trimesh

from mhvedit.avoidance.capsules import capsule_body
from mhvedit.avoidance.constraints import ContactGaps
from mhvedit.avoidance.correct import Body, correct_posture
from mhvedit.avoidance.effort import effort_weights
from mhvedit.avoidance.equipment import attach, open_edges
from mhvedit.avoidance.guards import mesh_guard, skin_points
from mhvedit.avoidance.posture import place
from mhvedit.avoidance.retarget import likeness, retargeted, stature, with_proportions
from mhvedit.errors import ShapeError
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.model import Motion
from mhvedit.skeleton.skin import posed_vertices
from tests.avoidance.figures import crossed_arms, figure
from tests.avoidance.scenes import APART, plain_body, problem_of, walk
from tests.collision.bodies import boxes_on_sliders

FIGURE = figure()


def test_capsules_are_closed_and_lie_round_their_bones() -> None:
    body = capsule_body(FIGURE)
    assert open_edges(body.faces) == 0
    thigh, shin = (FIGURE.names.index(f"left_{name}") for name in ("thigh", "shin"))
    mine = body.vertices[body.weights[:, thigh] == 1]
    ends = FIGURE.rest_positions[[thigh, shin]]
    assert np.allclose((mine.min(0) + mine.max(0)) / 2, ends.mean(0), atol=1e-6)
    assert mine[:, 2].min() < ends[:, 2].min()
    assert mine[:, 2].max() > ends[:, 2].max()


def test_b4_1_equipment_moves_with_its_limb() -> None:
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.1)
    body = attach(plain_body(), ball.vertices, ball.faces.astype(np.int32)[:, ::-1], limb="left_hand")
    assert open_edges(body.faces) == 0
    q = crossed_arms(FIGURE, 1)
    rotations, positions = joint_frames(FIGURE, q)
    hand = FIGURE.names.index("left_hand")
    moved = (ball.vertices - FIGURE.rest_positions[hand]) @ rotations[0, hand].T + positions[0, hand]
    assert np.allclose(posed_vertices(body, q)[0, -len(ball.vertices) :], moved, atol=1e-6)


def test_equipment_that_is_not_closed_or_hangs_nowhere_is_refused() -> None:
    box = trimesh.creation.box([1, 1, 1])
    faces = box.faces.astype(np.int32)
    with pytest.raises(ShapeError, match="3 open edges"):
        attach(plain_body(), box.vertices, faces[1:], limb="hips")
    with pytest.raises(ShapeError, match="right_toe"):
        attach(plain_body(), box.vertices, faces, limb="belt")


def test_a_guard_measures_boxes_exactly() -> None:
    """Two boxes, one 40 mm into the other, held 20 mm apart at rest."""
    body = boxes_on_sliders(np.full((2, 3), 0.2), np.array([[0.0, 0.0, 0.0], [0.22, 0.0, 0.0]]), cuts=3)
    guard = mesh_guard(body)
    q = np.zeros((2, body.skeleton.n_dofs))
    q[1, body.skeleton.dof_names.index("box1.tx")] = -0.06
    found = guard.look(q[1])
    assert guard.excess(q)[0] < 0
    assert found.excess == pytest.approx(0.04 - guard.allowed, abs=1e-6)
    assert isinstance(found.contacts, ContactGaps)
    missing, normals, _ = found.contacts.missing(place(body.skeleton, q[1]))
    assert missing.max() == pytest.approx(0.04 - guard.aim, abs=1e-6)
    assert np.abs(normals[:, 0]).max() == pytest.approx(1.0)
    free = correct_posture(
        Body(body.skeleton, np.ones(body.skeleton.n_dofs), np.ones(body.skeleton.n_dofs, np.bool_), guard), q[1]
    )
    assert free.converged
    assert guard.excess(free.q[None])[0] <= 0
    assert free.effort == pytest.approx(2 * ((0.04 - guard.aim) / 2) ** 2, rel=0.05)  # half of the way each


def test_points_of_the_skin_are_where_the_skin_is() -> None:
    body = plain_body()
    q = crossed_arms(FIGURE, 1)
    vertices = np.arange(0, len(body.vertices), 97)
    points = skin_points(body, vertices)
    at = (points.weights[..., None] * points.terms(place(FIGURE, q[0]))).sum(1)
    assert np.allclose(at, posed_vertices(body, q)[0, vertices], atol=1e-9)


def test_b2_1_a_hand_moves_before_a_thigh_and_a_thigh_before_the_body() -> None:
    weights = effort_weights(FIGURE)
    order = [weights[FIGURE.dof_names.index(name)] for name in ("left_hand.0", "left_thigh.0", "hips.0")]
    assert order[0] < order[1] < order[2]


def test_a5_2_a_motion_on_longer_arms_is_freed_and_keeps_its_character() -> None:
    motion = walk()
    body = with_proportions(plain_body(), {"left_hand": 1.3, "left_forearm": 1.2, "left_thigh": 1.5})
    moved = retargeted(motion, FIGURE, body.skeleton)
    assert np.array_equal(moved.q[:, 6:], motion.q[:, 6:])
    assert not np.allclose(body.skeleton.rest_positions, FIGURE.rest_positions)
    again = retargeted(motion, FIGURE, FIGURE)
    assert np.allclose(again.q, motion.q)
    assert (likeness(motion, again) < 1e-9).all()
    assert mesh_guard(body, nearest=APART).excess(moved.q).shape == (24,)


def test_a5_2_the_root_goes_as_far_as_the_legs_carry_it() -> None:
    motion = walk()
    q = motion.q.copy()
    q[:, 1] = np.linspace(0, -1, len(q))
    factors = {f"{side}_{part}": 2.0 for side in ("left", "right") for part in ("thigh", "shin", "foot", "toe")}
    body = with_proportions(plain_body(), factors)
    moved = retargeted(Motion(q, 30.0), FIGURE, body.skeleton)
    assert stature(body.skeleton) == pytest.approx(2 * stature(FIGURE))
    assert np.ptp(joint_frames(body.skeleton, moved.q)[1][:, 0, 1]) == pytest.approx(2.0)


def test_retargeting_lists_the_joints_that_there_are() -> None:
    with pytest.raises(ShapeError, match="right_toe"):
        with_proportions(plain_body(), {"tail": 2.0})
    with pytest.raises(ShapeError, match="positive"):
        with_proportions(plain_body(), {"head": 0.0})


def test_problems_of_figures_have_feet_that_stand() -> None:
    assert len(problem_of(plain_body(), walk()).tasks) == 1
