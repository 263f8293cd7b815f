"""The unscented filter that meets constraints in each frame (collision-free editing, section 5).

The captured pose is the prediction, a diagonal covariance says how freely each DOF may give way, and the constraint is
the measurement. The mean of the sigma points is biased by the curvature of f, so the covariance is scaled down (without
noise the gain does not depend on its scale) and the update is repeated from where it arrived until the constraint
holds.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numba import njit

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.forward import forward_axes_into
from mhvedit.skeleton.model import Skeleton


class Limits(IntEnum):
    """How joint limits enter the filter."""

    PROJECT = 0  # what passes a limit is set to it and held there
    ROWS = 1  # what passes a limit is measured, with the limit as its value


@dataclass(frozen=True, slots=True)
class FilterSettings:
    """What the paper leaves open."""

    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0
    largest_variance: float = 1e-6  # rad^2: the largest of the covariance after scaling
    noise: float = 1e-9  # of the measurement, relative to the mean variance of the constrained values
    tolerance: float = 1e-4  # m: the constraint holds
    iterations: int = 12
    limits: Limits = Limits.PROJECT


@dataclass(frozen=True, slots=True, eq=False)
class Update:
    """One step of the filter."""

    mean: FloatArray  # (D,)
    covariance: FloatArray  # (D, D)
    predicted: FloatArray  # (M,) mean of f over the sigma points


@dataclass(frozen=True, slots=True, eq=False)
class Resolved:
    """Poses that meet their constraints as far as they can be met."""

    q: FloatArray  # (T, D) rad or m
    residuals: FloatArray  # (T,) m, largest distance of an effector from its target
    iterations: IntArray  # (T,)
    converged: BoolArray  # (T,)


@dataclass(frozen=True, slots=True, eq=False)
class Effectors:
    """Points on limbs that are to be somewhere."""

    joints: IntArray  # (E,) that carry them
    points: FloatArray  # (E, 3) m, in the joints' frames

    def __post_init__(self) -> None:
        if self.points.shape != (len(self.joints), 3):
            raise ShapeError("effector points", self.points.shape, (len(self.joints), 3))


def sigma_weights(n: int, *, alpha: float, beta: float, kappa: float) -> tuple[FloatArray, FloatArray, float]:
    """Weights of the 2n + 1 sigma points, the centre first (Wan and van der Merwe 2000, eq. 15).

    Returns:
        of the mean (2n + 1,), of the covariance (2n + 1,), and n + lambda, which spreads the points.
    """
    spread = alpha**2 * (n + kappa)
    mean = np.full(2 * n + 1, 1 / (2 * spread))
    mean[0] = (spread - n) / spread
    covariance = mean.copy()
    covariance[0] += 1 - alpha**2 + beta
    return mean, covariance, spread


def scaled_variances(variances: FloatArray, largest: float) -> FloatArray:
    """(D,) the same ratios, with the largest as given; 0 still freezes a DOF."""
    top = float(variances.max(initial=0.0))
    return variances * (largest / top) if top > 0 else variances.copy()


def unscented_update(
    f: Callable[[FloatArray], FloatArray],
    mean: FloatArray,
    variances: FloatArray,
    *,
    target: FloatArray,
    noise: FloatArray,
    settings: FilterSettings | None = None,
) -> Update:
    """One update towards f(q) = target (collision-free editing, section 5, steps 2 to 5).

    Args:
        f: (D,) to (M,).
        mean: (D,) predicted pose.
        variances: (D,) diagonal of its covariance, taken as it is; 0 freezes a DOF.
        target: (M,).
        noise: (M, M) covariance of the measurement.
        settings: for alpha, beta and kappa.
    """
    chosen = settings or FilterSettings()
    weights_mean, weights_cov, spread = sigma_weights(
        len(mean), alpha=chosen.alpha, beta=chosen.beta, kappa=chosen.kappa
    )
    offsets = np.diag(np.sqrt(spread * variances))
    points = np.concatenate([mean[None], mean + offsets, mean - offsets])
    values = np.stack([f(point) for point in points])
    predicted = weights_mean @ values
    off_value, off_point = values - predicted, points - mean
    innovation = (weights_cov[:, None] * off_value).T @ off_value + noise
    gain = np.linalg.solve(innovation, (weights_cov[:, None] * off_value).T @ off_point).T
    return Update(mean + gain @ (target - predicted), np.diag(variances) - gain @ innovation @ gain.T, predicted)


def resolve(
    f: Callable[[FloatArray], FloatArray],
    q: FloatArray,
    variances: FloatArray,
    *,
    target: FloatArray,
    limits: FloatArray,
    settings: FilterSettings | None = None,
) -> Resolved:
    """Meet any constraint f(q) = target in one frame, limits by projection.

    Args:
        f: (D,) to (M,), in m or made comparable to it.
        q: (D,) captured pose.
        variances: (D,) how freely each DOF may give way.
        target: (M,).
        limits: (D, 2) rad or m.
        settings: of the filter.
    """
    chosen = settings or FilterSettings()
    pose, free = q.copy(), scaled_variances(variances, chosen.largest_variance)
    best, least, used = pose, float(np.abs(target - f(pose)).max(initial=0.0)), 0
    while least > chosen.tolerance and used < chosen.iterations:
        spread = _spread_of(f, pose, free)
        noise = np.eye(len(target)) * max(chosen.noise * spread, 1e-30)
        raw = unscented_update(f, pose, free, target=target, noise=noise, settings=chosen).mean
        pose = np.clip(raw, limits[:, 0], limits[:, 1])
        free = np.where(pose == raw, free, 0.0)
        residual, used = float(np.abs(target - f(pose)).max(initial=0.0)), used + 1
        if residual < least:
            best, least = pose, residual
    return Resolved(best[None], np.array([least]), np.array([used]), np.array([least <= chosen.tolerance]))


def resolve_effectors(
    skeleton: Skeleton,
    q: FloatArray,
    variances: FloatArray,
    *,
    effectors: Effectors,
    targets: FloatArray,
    limits: FloatArray | None = None,
    settings: FilterSettings | None = None,
) -> Resolved:
    """Bring effectors to their targets in every frame, each frame from its captured pose.

    A sigma point turns one DOF, so all that hangs on it turns about one axis in the world: forward kinematics runs
    once an update and not once a sigma point, and the result is the same.

    Args:
        skeleton: the target skeleton.
        q: (T, D) captured poses, rad or m.
        variances: (D,) how freely each DOF may give way; 0 freezes it.
        effectors: what is constrained.
        targets: (T, E, 3) m; NaN where an effector is free in a frame.
        limits: (T, D, 2) or (D, 2) rad or m; the skeleton's by default.
        settings: of the filter.
    """
    chosen = settings or FilterSettings()
    expected = (len(q), len(effectors.joints), 3)
    if targets.shape != expected:
        raise ShapeError("targets", targets.shape, expected)
    bounds = np.broadcast_to(skeleton.limits if limits is None else limits, (*q.shape, 2))
    out, residuals, used = q.copy(), np.zeros(len(q)), np.zeros(len(q), np.int64)
    _resolve_frames(
        (skeleton.parents, skeleton.offsets, skeleton.dof_joint, skeleton.dof_axis, skeleton.dof_slides),
        np.ascontiguousarray(q, np.float64),
        scaled_variances(variances, chosen.largest_variance),
        (effectors.joints, effectors.points),
        np.ascontiguousarray(targets, np.float64),
        bounds,
        (chosen.alpha, chosen.beta, chosen.kappa, chosen.noise, chosen.tolerance),
        chosen.iterations,
        int(chosen.limits),
        out,
        residuals,
        used,
    )
    return Resolved(out, residuals, used, residuals <= chosen.tolerance)


def _spread_of(f: Callable[[FloatArray], FloatArray], q: FloatArray, variances: FloatArray) -> float:
    """Mean variance of f, to first order: what the measurement noise is relative to."""
    centre, total = f(q), 0.0
    for dof in np.flatnonzero(variances):
        step = np.zeros_like(q)
        step[dof] = np.sqrt(variances[dof])
        total += float(((f(q + step) - centre) ** 2).mean())
    return total


Tree = tuple[IntArray, FloatArray, IntArray, FloatArray, BoolArray]


@njit(cache=True, nogil=True)
def _resolve_frames(
    tree: Tree,
    q: FloatArray,
    variances: FloatArray,
    effectors: tuple[IntArray, FloatArray],
    targets: FloatArray,
    limits: FloatArray,
    numbers: tuple[float, float, float, float, float],
    iterations: int,
    mode: int,
    out: FloatArray,
    residuals: FloatArray,
    used: IntArray,
) -> None:
    """All frames, one by one."""
    moves = _moved_by(tree[0], tree[2], effectors[0])
    for t in range(q.shape[0]):
        active = np.flatnonzero(~np.isnan(targets[t, :, 0]))
        if active.shape[0] == 0:
            continue
        chosen = (effectors[0][active], effectors[1][active])
        residuals[t], used[t] = _resolve_frame(
            tree,
            q[t],
            variances,
            chosen,
            moves[active],
            targets[t][active],
            limits[t],
            numbers,
            iterations,
            mode,
            out[t],
        )


@njit(cache=True, nogil=True)
def _resolve_frame(
    tree: Tree,
    q: FloatArray,
    variances: FloatArray,
    effectors: tuple[IntArray, FloatArray],
    moves: BoolArray,
    targets: FloatArray,
    limits: FloatArray,
    numbers: tuple[float, float, float, float, float],
    iterations: int,
    mode: int,
    out: FloatArray,
) -> tuple[float, int]:
    """One frame: the best pose into out; its residual and the number of updates."""
    n, n_joints, n_points = q.shape[0], tree[0].shape[0], effectors[0].shape[0]
    rotations, positions = np.empty((n_joints, 3, 3)), np.empty((n_joints, 3))
    axes, at = np.empty((n, 3)), np.empty((n_points, 3))
    pose, free = q.copy(), variances.copy()
    held = np.zeros(n, np.bool_)
    least = np.inf
    for step in range(iterations + 1):
        forward_axes_into(tree[0], tree[1], tree[2], tree[3], tree[4], pose, rotations, positions, axes)
        residual = _place(rotations, positions, effectors, targets, at)
        if residual < least:
            least = residual
            out[:] = pose
        if least <= numbers[4] or step == iterations:
            return least, step
        rows = np.flatnonzero(held) if mode == 1 else np.zeros(0, np.int64)
        change = _update(tree, axes, positions, at, free, moves, targets, rows, numbers)
        for d in range(n):
            pose[d] += change[d]
            if free[d] > 0 and (pose[d] < limits[d, 0] or pose[d] > limits[d, 1]):
                pose[d] = min(max(pose[d], limits[d, 0]), limits[d, 1])
                held[d] = True
                if mode == 0:
                    free[d] = 0.0
    return least, iterations


@njit(cache=True, nogil=True)
def _update(
    tree: Tree,
    axes: FloatArray,
    positions: FloatArray,
    at: FloatArray,
    free: FloatArray,
    moves: BoolArray,
    targets: FloatArray,
    rows: IntArray,
    numbers: tuple[float, float, float, float, float],
) -> FloatArray:
    """(D,) change of the pose by one unscented update; `rows` are DOFs measured at the limit where they are."""
    n, n_points, n_rows = free.shape[0], at.shape[0], rows.shape[0]
    size = 3 * n_points + n_rows
    spread = numbers[0] ** 2 * (n + numbers[2])
    weight = 1 / (2 * spread)
    ahead, behind = np.zeros((n, size)), np.zeros((n, size))  # sigma values, off the centre's
    for d in range(n):
        if free[d] > 0:
            reach = np.sqrt(spread * free[d])
            for e in range(n_points):
                if moves[e, d]:
                    _moved(axes[d], positions[tree[2][d]], tree[4][d], reach, at[e], ahead[d, 3 * e : 3 * e + 3])
                    _moved(axes[d], positions[tree[2][d]], tree[4][d], -reach, at[e], behind[d, 3 * e : 3 * e + 3])
            for k in range(n_rows):
                if rows[k] == d:
                    ahead[d, 3 * n_points + k], behind[d, 3 * n_points + k] = reach, -reach
    mean = weight * (ahead.sum(0) + behind.sum(0))
    innovation = ((spread - n) / spread + 1 - numbers[0] ** 2 + numbers[1]) * np.outer(mean, mean)
    innovation += weight * ((ahead - mean).T @ (ahead - mean) + (behind - mean).T @ (behind - mean))
    noise = max(numbers[3] * np.trace(innovation) / size, 1e-30)
    wanted = np.empty(size)
    for i in range(size):
        innovation[i, i] += noise
        if i < 3 * n_points:
            wanted[i] = targets[i // 3, i % 3] - at[i // 3, i % 3] - mean[i]
        else:
            wanted[i] = -mean[i]
    pull = (ahead - behind) @ np.linalg.solve(innovation, wanted)
    for d in range(n):
        pull[d] *= weight * np.sqrt(spread * free[d])
    return pull


@njit(cache=True, nogil=True)
def _moved(
    axis: FloatArray, centre: FloatArray, slides: bool, reach: float, point: FloatArray, out: FloatArray
) -> None:
    """How far a point goes when one DOF above it changes by `reach`."""
    if slides:
        for r in range(3):
            out[r] = axis[r] * reach
        return
    s, v = np.sin(reach), 2 * np.sin(reach / 2) ** 2
    x, y, z = point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]
    along = axis[0] * x + axis[1] * y + axis[2] * z
    out[0] = (axis[1] * z - axis[2] * y) * s + (axis[0] * along - x) * v
    out[1] = (axis[2] * x - axis[0] * z) * s + (axis[1] * along - y) * v
    out[2] = (axis[0] * y - axis[1] * x) * s + (axis[2] * along - z) * v


@njit(cache=True, nogil=True)
def _place(
    rotations: FloatArray,
    positions: FloatArray,
    effectors: tuple[IntArray, FloatArray],
    targets: FloatArray,
    at: FloatArray,
) -> float:
    """Effectors in the world, and the largest distance to a target."""
    worst = 0.0
    for e in range(at.shape[0]):
        joint, square = effectors[0][e], 0.0
        for r in range(3):
            at[e, r] = positions[joint, r]
            for c in range(3):
                at[e, r] += rotations[joint, r, c] * effectors[1][e, c]
            square += (targets[e, r] - at[e, r]) ** 2
        worst = max(worst, np.sqrt(square))
    return worst


@njit(cache=True, nogil=True)
def _moved_by(parents: IntArray, dof_joint: IntArray, joints: IntArray) -> BoolArray:
    """(E, D) whether a DOF moves an effector."""
    moves = np.zeros((joints.shape[0], dof_joint.shape[0]), np.bool_)
    for e in range(joints.shape[0]):
        joint = joints[e]
        while joint >= 0:
            for d in range(dof_joint.shape[0]):
                if dof_joint[d] == joint:
                    moves[e, d] = True
            joint = parents[joint]
    return moves
