"""The way from one key segment to the next: a planar rigid motion per frame that changes the motion least (Shi et al., 19-25).

What moves a frame is the turn of its facing and the shift of its centre. Both are solved for directly, so that noise in an
estimated facing or centre cannot reach the edit; the pivot of the turn is a smoothed centre, for the same reason. With turn
phi_k and shift s_k of the centre, the paper's terms acc(C) - acc(c) and vel(C) - vel(c) are acc(s) and vel(s) up to sign.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded
from scipy.ndimage import gaussian_filter1d
from scipy.special import expit

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import rotation, wrap_angle

PIVOT_SMOOTHING = 4.0  # frames, standard deviation


@dataclass(frozen=True, slots=True)
class PathSettings:
    """Weights of the path (Shi et al., eqs 19, 22 and 23)."""

    acceleration: float = 0.5  # delta
    alpha: float = 10.0
    slow_speed: float = 0.01  # m a frame
    slow_turn: float = 0.01  # rad a frame


def smoothed(centres: FloatArray) -> FloatArray:
    """Centres without the noise of single frames.

    Args:
        centres: (N, 2) m.
    """
    if len(centres) < 3:
        return centres
    return np.asarray(gaussian_filter1d(centres, PIVOT_SMOOTHING, axis=0, mode="nearest"))


def placement_path(
    fixed: FloatArray, *, centres: FloatArray, facing: FloatArray, settings: PathSettings
) -> FloatArray:
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
    pivot = smoothed(centres)
    turn, shift = np.empty(len(fixed)), np.empty((len(fixed), 2))
    turn[known] = np.unwrap(fixed[known, 2])
    shift[known] = _moved(fixed[known], pivot[known]) - pivot[known]
    placements = np.array(fixed)
    placements[: known[0]], placements[known[-1] + 1 :] = fixed[known[0]], fixed[known[-1]]
    slow_shift = slowness(np.linalg.norm(np.diff(pivot, axis=0), axis=1), settings.slow_speed, settings.alpha)
    turned = np.abs(wrap_angle(np.diff(np.unwrap(facing))))
    slow_turn = slowness(turned, settings.slow_turn, settings.alpha)
    for before, after in zip(known[:-1], known[1:], strict=True):
        if after - before < 2:
            continue
        inside = slice(before + 1, after)
        lead, tail = _neighbour(known, before, -1), _neighbour(known, after, 1)
        ends = [lead, before], [after, tail]
        turn[inside] = _bridge(turn[ends[0]], turn[ends[1]], slow_turn[before + 1 : after], settings.acceleration)
        shift[inside] = _bridge(shift[ends[0]], shift[ends[1]], slow_shift[before + 1 : after], settings.acceleration)
        placements[inside, 2] = turn[inside]
        turned_pivot = (rotation(turn[inside]) @ pivot[inside, :, None])[..., 0]
        placements[inside, :2] = pivot[inside] + shift[inside] - turned_pivot
    return placements


def slowness(steps: FloatArray, slow: float, alpha: float) -> FloatArray:
    """How much a frame's speed counts: most where it is slow (Shi et al., eqs 22 to 25).

    Args:
        steps: (N - 1,) length of each step between frames.
        slow: speed at which the weight is one half.
        alpha: steepness, relative to `slow`.

    Returns:
        (N,) weights in (0, 1).
    """
    before, after = np.concatenate([steps[:1], steps]), np.concatenate([steps, steps[-1:]])
    return np.asarray(expit(-alpha * (0.5 * (before + after) - slow)))


def _moved(placements: FloatArray, points: FloatArray) -> FloatArray:
    return np.asarray((rotation(placements[:, 2]) @ points[:, :, None])[..., 0] + placements[:, :2])


def _neighbour(known: FloatArray, frame: int, step: int) -> int:
    """The next frame of the same key segment, or the frame itself where the segment is one frame long."""
    return frame + step if frame + step in known else frame


def _bridge(before: FloatArray, after: FloatArray, weight: FloatArray, delta: float) -> FloatArray:
    """Minimise delta |acc|^2 + (1 - delta) w |vel|^2 over the frames between two known ends of two frames each.

    Args:
        before: (2, ...) values of the last two known frames.
        after: (2, ...) values of the first two known frames that follow.
        weight: (M,) w of each frame between.
        delta: share of the acceleration.

    Returns:
        (M, ...).
    """
    count = len(weight)
    values = np.concatenate([before, np.zeros((count, *before.shape[1:])), after]).reshape(count + 4, -1)
    normal, target = np.zeros((count, count)), np.zeros((count, values.shape[1]))
    for k in range(1, count + 3):
        w = weight[min(max(k - 2, 0), count - 1)]
        for stencil, share in (((1.0, -2.0, 1.0), delta), ((-0.5, 0.0, 0.5), (1 - delta) * w)):
            _add_square(normal, target, values, k, np.array(stencil), share)
    ridge = 1e-12 * max(1.0, float(np.trace(normal)) / count)
    bands = np.zeros((5, count))
    for offset in range(-2, 3):
        diagonal = np.diagonal(normal, offset)
        bands[2 - offset, max(offset, 0) : count + min(offset, 0)] = diagonal
    bands[2] += ridge
    return np.asarray(solve_banded((2, 2), bands, target).reshape(count, *before.shape[1:]))


def _add_square(
    normal: FloatArray, target: FloatArray, values: FloatArray, k: int, stencil: FloatArray, share: float
) -> None:
    """Add share * (stencil . values around k)^2 to the normal equations; unknowns are values[2:-2]."""
    count = len(normal)
    places = np.arange(k - 1, k + 2) - 2
    free = (places >= 0) & (places < count)
    known = stencil[~free] @ values[places[~free] + 2]
    for i in np.flatnonzero(free):
        target[places[i]] -= share * stencil[i] * known
        for j in np.flatnonzero(free):
            normal[places[i], places[j]] += share * stencil[i] * stencil[j]
