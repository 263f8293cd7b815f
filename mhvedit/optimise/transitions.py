"""The way from one key segment to the next: a planar rigid motion per frame that changes the motion least.

This is Shi et al., eqs 19 to 25. What moves a frame is the turn of its facing and the shift of its centre. Both are
solved for directly, so that noise in an estimated facing or centre cannot reach the edit; the pivot of the turn is a
smoothed centre, for the same reason. With turn phi_k and shift s_k of the centre, the paper's terms acc(C) - acc(c) and
vel(C) - vel(c) are acc(s) and vel(s) up to sign. The capture's frame has no meaning in the scene: C is seen from one
that is turned half-way between the key segments on either side, so one rigid motion joins two that stand alike.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.band import band_solution
from mhvedit.geometry.planar import apply_pose, rotation
from mhvedit.geometry.smoothing import smoothed

SMOOTHING = 4.0  # frames, standard deviation
LEAST_ACCELERATION = 1e-9  # its share where only velocity is asked for, so that fast frames are tied down too


@dataclass(frozen=True, slots=True)
class PathSettings:
    """Weights of the path (Shi et al., eqs 19, 22 and 23)."""

    acceleration: float = 0.5  # delta
    alpha: float = 10.0  # per m a frame, and per rad a frame
    slow_speed: float = 0.01  # m a frame
    slow_turn: float = 0.01  # rad a frame


def calmed(values: FloatArray) -> FloatArray:
    """Centres or angles without the noise of single frames.

    Args:
        values: (N, ...).
    """
    return values if len(values) < 3 else smoothed(values, SMOOTHING)


def placement_path(fixed: FloatArray, *, centres: FloatArray, facing: FloatArray, settings: PathSettings) -> FloatArray:
    """Placements of one subject in every frame, key segments given.

    Args:
        fixed: (N, 3) x, y m and yaw rad world_from_capture in key segments, NaN rows elsewhere.
        centres: (N, 2) m, in the capture's frame.
        facing: (N,) rad, in the capture's frame.
        settings: weights.

    Returns:
        (N, 3) placements; before the first and after the last key segment they move rigidly with it.
    """
    known = np.flatnonzero(~np.isnan(fixed[:, 0]))
    pivot = calmed(centres)
    slow_shift = shift_weights(centres, settings)
    placements = np.array(fixed)
    placements[known, 2] = np.unwrap(fixed[known, 2])
    placements[: known[0]], placements[known[-1] + 1 :] = placements[known[0]], placements[known[-1]]
    turned = np.abs(np.diff(calmed(np.unwrap(facing))))
    slow_turn = slowness(turned, settings.slow_turn, settings.alpha)
    for before, after in itertools.pairwise(known.tolist()):
        if after - before > 1:
            ends = np.array([_neighbour(fixed, before, -1), before, after, _neighbour(fixed, after, 1)])
            around = slice(before, after + 1)
            placements[before + 1 : after] = _transition(
                placements[ends],
                pivot[ends],
                pivot[before + 1 : after],
                weights=(slow_turn[around], slow_shift[around]),
                delta=settings.acceleration,
            )
    return placements


def shift_weights(centres: FloatArray, settings: PathSettings) -> FloatArray:
    """(N,) how much a change of speed counts, w of eq. 22.

    Args:
        centres: (N, 2) m, in the capture's frame.
        settings: weights.
    """
    steps = np.linalg.norm(np.diff(calmed(centres), axis=0), axis=1)
    return slowness(steps, settings.slow_speed, settings.alpha)


def slowness(steps: FloatArray, slow: float, alpha: float) -> FloatArray:
    """How much a frame's speed counts: most where it is slow (Shi et al., eqs 22 to 25).

    Args:
        steps: (N - 1,) length of each step between frames.
        slow: speed at which the weight is one half.
        alpha: steepness, per unit of speed.

    Returns:
        (N,) weights in (0, 1).
    """
    before, after = np.concatenate([steps[:1], steps]), np.concatenate([steps, steps[-1:]])
    return np.asarray(0.5 - 0.5 * np.tanh(0.5 * alpha * (0.5 * (before + after) - slow)))


def motion_bands(weight: FloatArray, delta: float) -> FloatArray:
    """The quadratic form delta |acc|^2 + (1 - delta) w |vel|^2 over a row of frames.

    Args:
        weight: (M,) w of each frame but the first and the last.
        delta: share of the acceleration.

    Returns:
        (3, M + 2), in row o the entries at (k, k + o).
    """
    bands = np.zeros((3, len(weight) + 2))
    shares = np.full(len(weight), max(delta, LEAST_ACCELERATION)), (1 - delta) * weight
    for stencil, share in zip(((1.0, -2.0, 1.0), (-0.5, 0.0, 0.5)), shares, strict=True):
        for i, j in itertools.combinations_with_replacement(range(3), 2):
            bands[j - i, i : i + len(weight)] += share * stencil[i] * stencil[j]
    return bands


def _neighbour(fixed: FloatArray, frame: int, step: int) -> int:
    """The next frame of the same key segment, or the frame itself where the segment is one frame long."""
    inside = 0 <= frame + step < len(fixed) and not np.isnan(fixed[frame + step, 0])
    return frame + step if inside else frame


def _transition(
    ends: FloatArray,
    pivot_at_ends: FloatArray,
    pivot: FloatArray,
    *,
    weights: tuple[FloatArray, FloatArray],
    delta: float,
) -> FloatArray:
    """Placements between two key segments, from those of the two frames on either side."""
    reference = rotation(0.5 * (ends[1, 2] + ends[2, 2]))
    placed = np.array([apply_pose(pose, point) for pose, point in zip(ends, pivot_at_ends, strict=True)])
    shift = _bridge(placed - pivot_at_ends @ reference.T, weights[1], delta)
    turn = _bridge(ends[:, 2], weights[0], delta)
    at = pivot @ reference.T + shift - (rotation(turn) @ pivot[:, :, None])[..., 0]
    return np.column_stack([at, turn])


def _bridge(ends: FloatArray, weight: FloatArray, delta: float) -> FloatArray:
    """Minimise delta |acc|^2 + (1 - delta) w |vel|^2 over the frames between two known ends of two frames each.

    Args:
        ends: (4, ...) values of the last two known frames and of the first two known frames that follow.
        weight: (M + 2,) w of the last known frame, each frame between and the first known one that follows.
        delta: share of the acceleration.

    Returns:
        (M, ...).
    """
    count = len(weight) - 2
    known = ends.reshape(4, -1)
    bands = motion_bands(weight, delta)
    target = np.zeros((count, known.shape[1]))
    for place, value in zip((0, 1, count + 2, count + 3), known, strict=True):
        for offset in range(-2, 3):
            if 0 <= place + offset - 2 < count:
                target[place + offset - 2] -= bands[abs(offset), min(place, place + offset)] * value
    inner = np.zeros((3, count))
    for offset in range(3):
        inner[offset, : max(count - offset, 0)] = bands[offset, 2 : count + 2 - offset]
    return band_solution(inner, target).reshape(count, *ends.shape[1:])
