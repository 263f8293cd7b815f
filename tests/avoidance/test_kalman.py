import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.avoidance.kalman import (
    Effectors,
    FilterSettings,
    Limits,
    resolve,
    resolve_effectors,
    sigma_weights,
    unscented_update,
)
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.forward import points_on_joints
from mhvedit.skeleton.model import Skeleton
from tests.avoidance.figures import crossed_arms, figure

FIGURE = figure()
HANDS = Effectors(
    np.array([FIGURE.names.index("left_hand"), FIGURE.names.index("right_hand")]), np.full((2, 3), [0, 0, -0.1])
)
MOBILE = np.where(FIGURE.dof_joint == 0, 0.0, 1e-2)


def reachable(n: int, *, seed: int = 1) -> tuple[FloatArray, FloatArray]:
    """Postures, and targets 10 cm away that other postures reach."""
    q = crossed_arms(FIGURE, n, seed=seed)
    there = q + np.random.default_rng(seed).normal(0, 0.08, q.shape) * (MOBILE > 0)
    return q, points_on_joints(FIGURE, there, HANDS.joints, HANDS.points)


def reached(q: FloatArray) -> FloatArray:
    return points_on_joints(FIGURE, q, HANDS.joints, HANDS.points)


@given(
    st.integers(1, 80),
    st.floats(1e-3, 2.0),
    st.floats(0.0, 3.0),
    st.floats(0.0, 3.0),
)
def test_a2_4_weights_of_the_mean_sum_to_one(n: int, alpha: float, beta: float, kappa: float) -> None:
    mean, covariance, spread = sigma_weights(n, alpha=alpha, beta=beta, kappa=kappa)
    assert mean.sum() == pytest.approx(1.0, abs=1e-6)
    assert covariance.sum() == pytest.approx(1.0 + 1 - alpha**2 + beta, abs=1e-6)
    assert len(mean) == 2 * n + 1
    assert spread == pytest.approx(alpha**2 * (n + kappa))


def test_a2_4_the_textbooks_alpha_has_the_weight_that_the_notes_give() -> None:
    assert sigma_weights(69, alpha=1e-3, beta=2.0, kappa=0.0)[0][0] == pytest.approx(-999999)


def linear_problem(seed: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    matrix, offset = rng.normal(size=(3, 7)), rng.normal(size=3)
    return matrix, offset, rng.normal(size=7), rng.uniform(0.1, 1.0, 7), rng.normal(size=3)


@pytest.mark.parametrize("seed", range(5))
def test_a2_5_on_linear_problems_it_is_the_kalman_filter(seed: int) -> None:
    matrix, offset, mean, variances, target = linear_problem(seed)
    noise = 0.01 * np.eye(3)
    found = unscented_update(lambda x: matrix @ x + offset, mean, variances, target=target, noise=noise)
    prior = np.diag(variances)
    gain = prior @ matrix.T @ np.linalg.inv(matrix @ prior @ matrix.T + noise)
    assert np.allclose(found.mean, mean + gain @ (target - matrix @ mean - offset))
    assert np.allclose(found.covariance, prior - gain @ matrix @ prior)


@pytest.mark.parametrize("seed", range(5))
def test_a2_5_on_linear_problems_filterpy_agrees(seed: int) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    matrix, offset, mean, variances, target = linear_problem(seed)
    points = MerweScaledSigmaPoints(7, alpha=0.5, beta=2.0, kappa=1.0)
    oracle = UnscentedKalmanFilter(7, 3, 1.0, hx=lambda x: matrix @ x + offset, fx=lambda x, _: x, points=points)
    oracle.x, oracle.P, oracle.R, oracle.Q = mean.copy(), np.diag(variances), 0.01 * np.eye(3), np.zeros((7, 7))
    oracle.predict()
    oracle.update(target)
    found = unscented_update(
        lambda x: matrix @ x + offset,
        mean,
        variances,
        target=target,
        noise=0.01 * np.eye(3),
        settings=FilterSettings(alpha=0.5, beta=2.0, kappa=1.0),
    )
    assert np.allclose(found.mean, oracle.x, atol=1e-9)
    assert np.allclose(found.covariance, oracle.P, atol=1e-9)


def test_a2_2_zero_variance_freezes_a_dof() -> None:
    q, targets = reachable(20)
    found = resolve_effectors(FIGURE, q, MOBILE, effectors=HANDS, targets=targets)
    assert (found.q[:, MOBILE == 0] == q[:, MOBILE == 0]).all()
    assert (found.q != q).any()


def test_a2_7_less_than_a_millimetre_is_left() -> None:
    q, targets = reachable(50)
    found = resolve_effectors(FIGURE, q, MOBILE, effectors=HANDS, targets=targets)
    assert found.converged.all()
    assert np.linalg.norm(reached(found.q) - targets, axis=2).max() < 1e-3
    assert found.residuals.max() < 1e-3


def test_a2_7_one_update_with_a_large_covariance_is_biased() -> None:
    """Why the covariance is scaled: with 0.1 rad the mean of the sigma points is far from f of the mean."""
    q = crossed_arms(FIGURE, 20)
    targets = reached(q) + np.array([0.0, 0.002, 0.0])
    once = FilterSettings(iterations=1)
    biased = FilterSettings(iterations=1, largest_variance=1e-2)
    small = resolve_effectors(FIGURE, q, MOBILE, effectors=HANDS, targets=targets, settings=once).residuals
    large = resolve_effectors(FIGURE, q, MOBILE, effectors=HANDS, targets=targets, settings=biased).residuals
    assert np.median(large) > 10 * np.median(small)


def test_a2_7_the_gain_does_not_depend_on_the_scale_of_the_covariance() -> None:
    q, targets = reachable(5)
    one = resolve_effectors(FIGURE, q, MOBILE, effectors=HANDS, targets=targets)
    other = resolve_effectors(FIGURE, q, 1e4 * MOBILE, effectors=HANDS, targets=targets)
    assert np.allclose(one.q, other.q, atol=1e-12)


@pytest.mark.parametrize("iterations", [1, 3])
def test_a2_3_turning_points_about_world_axes_is_forward_kinematics(iterations: int) -> None:
    """The compiled filter moves effectors about axes; the plain one runs forward kinematics for each sigma point."""
    q, targets = reachable(3)
    settings = FilterSettings(iterations=iterations, tolerance=0.0)
    fast = resolve_effectors(FIGURE, q, MOBILE, effectors=HANDS, targets=targets, settings=settings)
    for i in range(len(q)):
        slow = resolve(
            lambda x: reached(x).ravel(),
            q[i],
            MOBILE,
            target=targets[i].ravel(),
            limits=FIGURE.limits,
            settings=settings,
        )
        assert np.allclose(fast.q[i], slow.q[0], atol=1e-7)


@pytest.mark.parametrize("limits", Limits)
def test_a1_5_limits_hold_and_the_constraint_is_met_all_the_same(limits: Limits) -> None:
    q, targets = reachable(30)
    room = np.where(MOBILE > 0, 0.12, 0.0)[:, None] * [-1, 1]
    bounds = q[..., None] + room
    found = resolve_effectors(
        FIGURE, q, MOBILE, effectors=HANDS, targets=targets, limits=bounds, settings=FilterSettings(limits=limits)
    )
    assert (found.q >= bounds[..., 0] - 1e-12).all()
    assert (found.q <= bounds[..., 1] + 1e-12).all()
    free = resolve_effectors(FIGURE, q, MOBILE, effectors=HANDS, targets=targets)
    hit = (np.abs(free.q - q) > 0.12).any(1)
    assert hit.any()
    assert found.converged[hit].mean() > 0.5


def test_a2_6_frozen_bodies_and_contradictions_stay_finite() -> None:
    q, targets = reachable(2)
    frozen = resolve_effectors(FIGURE, q, np.zeros(FIGURE.n_dofs), effectors=HANDS, targets=targets)
    assert (frozen.q == q).all()
    assert not frozen.converged.any()
    twice = Effectors(np.repeat(HANDS.joints[:1], 2), np.repeat(HANDS.points[:1], 2, axis=0))
    torn = resolve_effectors(FIGURE, q, MOBILE, effectors=twice, targets=targets)
    assert np.isfinite(torn.q).all()
    assert not torn.converged.any()


def test_a1_6_frames_without_constraints_are_not_touched() -> None:
    q, targets = reachable(4)
    targets = targets.copy()
    targets[[0, 2]] = np.nan
    found = resolve_effectors(FIGURE, q, MOBILE, effectors=HANDS, targets=targets)
    assert (found.q[[0, 2]] == q[[0, 2]]).all()
    assert (found.q[[1, 3]] != q[[1, 3]]).any(1).all()


def test_targets_of_another_shape_are_refused() -> None:
    with pytest.raises(ShapeError, match="targets"):
        resolve_effectors(FIGURE, np.zeros((2, FIGURE.n_dofs)), MOBILE, effectors=HANDS, targets=np.zeros((2, 1, 3)))


def test_the_figure_has_55_dofs() -> None:
    assert isinstance(FIGURE, Skeleton)
    assert FIGURE.n_dofs == 55
