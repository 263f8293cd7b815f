import numpy as np
import pytest
from scipy.optimize import minimize

from mhvedit.avoidance.constraints import (
    BodyPointTarget,
    ContactGaps,
    DirectionTarget,
    PlaneTarget,
    PointTargets,
    SkinPoints,
    world_point,
)
from mhvedit.avoidance.posture import Constraint, effort, limits_around, place, predict_posture
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray
from tests.avoidance.figures import crossed_arms, figure, spheres

FIGURE = figure()
SPHERES = spheres(FIGURE)
HAND, OTHER = FIGURE.names.index("left_hand"), FIGURE.names.index("right_hand")
STEP = 1e-6


def contact_gaps() -> ContactGaps:
    rng = np.random.default_rng(3)
    joints = rng.integers(0, FIGURE.n_joints, (4, 2))
    weights = np.tile([0.7, 0.3], (4, 1))
    normals = rng.normal(size=(4, 3))
    return ContactGaps(
        SkinPoints(joints, weights, rng.normal(0, 0.1, (4, 2, 3))),
        SkinPoints(joints[::-1], weights, rng.normal(0, 0.1, (4, 2, 3))),
        joints[:, 0],
        normals / np.linalg.norm(normals, axis=1, keepdims=True),
        np.zeros(4),
        reach=np.inf,
    )


def hand_at(target: FloatArray, *, point: FloatArray | None = None, slack: float = 0.0) -> PointTargets:
    """A point of the left hand at a place."""
    mine = np.zeros(3) if point is None else point
    return PointTargets(np.array([HAND]), mine[None], target[None], np.array([slack]))


CONSTRAINTS: list[Constraint] = [
    hand_at(np.array([0.3, -0.3, 1.1]), point=np.array([0.0, 0.01, -0.1])),
    hand_at(np.array([0.3, -0.3, 1.1]), slack=0.05),
    BodyPointTarget(HAND, np.array([0.0, 0.01, -0.1]), OTHER, np.array([0.1, 0.0, 0.0])),
    PlaneTarget(HAND, np.zeros(3), np.array([0.1, 0.2, 1.0]), np.array([0.0, 0.6, 0.8])),
    DirectionTarget(HAND, np.array([0.0, 0.0, -1.0]), OTHER, np.array([0.6, 0.0, 0.8])),
    DirectionTarget(HAND, np.array([0.0, 0.0, -1.0]), -1, np.array([0.6, 0.0, 0.8])),
    SPHERES,
]


@pytest.mark.parametrize("constraint", CONSTRAINTS, ids=lambda c: type(c).__name__)
def test_every_jacobian_against_finite_differences(constraint: Constraint) -> None:
    q = crossed_arms(FIGURE, 1)[0]
    rows = constraint.rows(place(FIGURE, q))
    assert len(rows.low) > 0
    for dof in range(FIGURE.n_dofs):
        step = np.zeros(FIGURE.n_dofs)
        step[dof] = STEP
        ahead, behind = constraint.rows(place(FIGURE, q + step)), constraint.rows(place(FIGURE, q - step))
        change = -(ahead.low - behind.low) / (2 * STEP)
        assert np.allclose(rows.jacobian[:, dof], change, atol=1e-6)


def test_contacts_change_as_the_skin_moves_except_for_what_turns_their_normals() -> None:
    """Normals are held while the posture changes: for contacts that are closed this is exact."""
    gaps, q = contact_gaps(), crossed_arms(FIGURE, 1)[0]
    placed = place(FIGURE, q)
    rows, (_, normals, at) = gaps.rows(placed), gaps.missing(placed)
    for dof in range(FIGURE.n_dofs):
        step = np.zeros(FIGURE.n_dofs)
        step[dof] = STEP
        ends = []
        for sign in (1, -1):
            moved = place(FIGURE, q + sign * step)
            there = (gaps.surface.weights[..., None] * gaps.surface.terms(moved)).sum(1)
            ends.append((gaps.missing(moved)[2] - there) @ np.eye(3))
        change = ((ends[0] - ends[1]) / (2 * STEP) * normals).sum(1)
        assert np.allclose(rows.jacobian[:, dof], change, atol=1e-6)
    assert at.shape == (4, 3)


def distances(q: FloatArray) -> FloatArray:
    """(P,) m by which pairs of spheres are apart, without the module under test."""
    placed = place(FIGURE, q)
    at = np.array([world_point(placed, int(j), c) for j, c in zip(SPHERES.joints, SPHERES.centres, strict=True)])
    a, b = SPHERES.pairs.T
    return np.asarray(np.linalg.norm(at[a] - at[b], axis=1) - SPHERES.radii[a] - SPHERES.radii[b])


def test_b3_3_spheres_meet_where_their_distance_is_less_than_their_radii() -> None:
    for q in crossed_arms(FIGURE, 20):
        assert SPHERES.rows(place(FIGURE, q)).violation == pytest.approx(max(0.0, -distances(q).min()))


def test_b2_1_postures_get_free_and_stay_within_limits() -> None:
    postures = [q for q in crossed_arms(FIGURE, 40) if distances(q).min() < -0.005]
    assert len(postures) > 20
    solved = [predict_posture(FIGURE, q, [SPHERES]) for q in postures]
    assert np.mean([posture.converged for posture in solved]) > 0.9
    for posture, q in zip(solved, postures, strict=True):
        limits = limits_around(FIGURE.limits, q)
        assert (posture.q >= limits[:, 0] - 1e-9).all()
        assert (posture.q <= limits[:, 1] + 1e-9).all()
        if posture.converged:
            assert distances(posture.q).min() > -6e-4


def test_b2_1_effort_is_no_more_than_slsqp_needs() -> None:
    weights = np.linspace(1.0, 3.0, FIGURE.n_dofs)
    postures = [q for q in crossed_arms(FIGURE, 12) if distances(q).min() < -0.01][:4]
    for q in postures:
        mine = predict_posture(FIGURE, q, [SPHERES], weights=weights)
        near = np.flatnonzero(distances(q) < 0.1)
        oracle = minimize(
            lambda x, q=q: float(weights @ (x - q) ** 2),
            q,
            jac=lambda x, q=q: 2 * weights * (x - q),
            method="SLSQP",
            constraints={"type": "ineq", "fun": lambda x, near=near: distances(x)[near]},
            options={"maxiter": 60},
        )
        if mine.converged and oracle.success and distances(oracle.x).min() > -1e-4:
            assert mine.effort <= 1.1 * oracle.fun + 1e-4
        assert mine.effort == pytest.approx(effort(weights, mine.q, q))


def test_b2_2_targets_are_met_and_frozen_dofs_stay() -> None:
    q = np.zeros(FIGURE.n_dofs)
    target = world_point(place(FIGURE, q), HAND, np.zeros(3)) + np.array([0.05, -0.15, 0.1])
    free = np.isin(FIGURE.dof_joint, [FIGURE.names.index(f"left_{n}") for n in ("clavicle", "upper_arm", "forearm")])
    posture = predict_posture(FIGURE, q, [hand_at(target)], free=free)
    assert posture.converged
    assert np.allclose(world_point(place(FIGURE, posture.q), HAND, np.zeros(3)), target, atol=6e-4)
    assert (posture.q[~free] == 0).all()


def test_b2_2_a_target_out_of_reach_is_said_to_be() -> None:
    q = np.zeros(FIGURE.n_dofs)
    free = FIGURE.dof_joint != 0
    posture = predict_posture(FIGURE, q, [hand_at(np.array([3.0, 0.0, 1.0]))], free=free)
    assert not posture.converged
    assert posture.violation > 0.5
    assert np.isfinite(posture.q).all()


def test_a_posture_that_meets_everything_is_left_alone() -> None:
    q = np.zeros(FIGURE.n_dofs)
    posture = predict_posture(FIGURE, q, [])
    assert (posture.q == q).all()
    assert posture.converged


def test_limits_are_widened_by_a_captured_posture_that_is_outside() -> None:
    limits = limits_around(np.array([[-1.0, 1.0], [-1.0, 1.0]]), np.array([1.5, 0.0]))
    assert limits.tolist() == [[-1.0, 1.5], [-1.0, 1.0]]


def test_arrays_of_the_wrong_length_are_refused() -> None:
    with pytest.raises(ShapeError, match="weights"):
        predict_posture(FIGURE, np.zeros(FIGURE.n_dofs), [], weights=np.ones(3))
