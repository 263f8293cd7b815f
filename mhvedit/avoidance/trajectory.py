"""Constraint trajectories: the captured path of an effector, displaced at key frames (collision-free editing, 4.1).

M(t) = M_org(t) + d(t), where d(t) goes through the key displacements. What is interpolated is the displacement and not
the path, so that every detail of the captured motion stays, and what is added is as smooth as the interpolation.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray, IntArray


class Curve(StrEnum):
    """How the displacement goes from one key to the next."""

    LINEAR = "linear"
    NATURAL = "natural"  # cubic, no curvature at the ends
    CLAMPED = "clamped"  # cubic, no slope at the ends
    PCHIP = "pchip"  # cubic, never beyond the keys
    CATMULL_ROM = "catmull-rom"  # cubic, slope at a key from its two neighbours


class Ends(StrEnum):
    """What the displacement is where the scope ends."""

    ZERO = "zero"  # the edit fades out: no step towards the frames that are not edited
    FREE = "free"  # the first and last key hold to the ends of the scope


@dataclass(frozen=True, slots=True, eq=False)
class KeyDisplacements:
    """Where the path of an effector has to be moved to, at key frames of a scope."""

    scope: tuple[int, int]  # first and last frame of the constraint
    frames: IntArray  # (K,) key frames, increasing, within the scope
    displacements: FloatArray  # (K, 3) m, off the captured path

    def __post_init__(self) -> None:
        if self.displacements.shape != (len(self.frames), 3):
            raise ShapeError("displacements", self.displacements.shape, (len(self.frames), 3))
        first, last = self.scope
        inside = len(self.frames) > 0 and self.frames[0] >= first and self.frames[-1] <= last
        if not inside or (np.diff(self.frames) <= 0).any():
            raise ShapeError(
                "key frames", self.frames.tolist(), f"increasing frames from {first} to {last}, at least one"
            )


def displacement_curve(keys: KeyDisplacements, *, curve: Curve = Curve.CLAMPED, ends: Ends = Ends.ZERO) -> FloatArray:
    """d(t) over a scope (collision-free editing, 4.1, step 2).

    One key with the ends at zero is a hat (its shape given by the curve); one key with the ends free is a constant.

    Args:
        keys: the key displacements and their scope.
        curve: what to put between them.
        ends: what to do where the scope ends.

    Returns:
        (last - first + 1, 3) m, one row a frame of the scope.
    """
    first, last = keys.scope
    frames, values = _with_ends(keys, ends)
    wanted = np.arange(first, last + 1, dtype=np.float64)
    if len(frames) == 1:
        return np.repeat(values, len(wanted), axis=0)
    return np.asarray(_CURVES[curve](frames, values)(wanted))


def constraint_trajectory(
    captured: FloatArray, keys: KeyDisplacements, *, curve: Curve = Curve.CLAMPED, ends: Ends = Ends.ZERO
) -> FloatArray:
    """M(t): the captured path of an effector with the displacement on top (collision-free editing, 4.1).

    Args:
        captured: (T, 3) m, M_org: the effector when the captured joint angles drive the target skeleton.
        keys: key displacements.
        curve: between the keys.
        ends: at the ends of the scope.

    Returns:
        (last - first + 1, 3) m, one row a frame of the scope; outside of it nothing is constrained.
    """
    first, last = keys.scope
    return np.asarray(captured[first : last + 1] + displacement_curve(keys, curve=curve, ends=ends))


def keys_through(captured: FloatArray, scope: tuple[int, int], positions: dict[int, FloatArray]) -> KeyDisplacements:
    """Key displacements d_k = c_k - M_org(t_k) from the positions that an editor wants.

    Args:
        captured: (T, 3) m, M_org.
        scope: first and last frame of the constraint.
        positions: (3,) m, c_k by frame.
    """
    frames = np.array(sorted(positions), np.int64)
    wanted = np.array([positions[int(frame)] for frame in frames], np.float64).reshape(-1, 3)
    return KeyDisplacements(scope, frames, wanted - captured[frames])


def _with_ends(keys: KeyDisplacements, ends: Ends) -> tuple[FloatArray, FloatArray]:
    """The keys, with one of no displacement (zero), or of the nearest key's (free), at each end that has none."""
    frames, values = keys.frames.astype(np.float64), keys.displacements
    if ends is Ends.FREE and len(frames) == 1:
        return frames, values
    first, last = keys.scope
    if frames[0] > first:
        edge = np.zeros((1, 3)) if ends is Ends.ZERO else values[:1]
        frames, values = np.r_[float(first), frames], np.r_[edge, values]
    if frames[-1] < last:
        edge = np.zeros((1, 3)) if ends is Ends.ZERO else values[-1:]
        frames, values = np.r_[frames, float(last)], np.r_[values, edge]
    return frames, values


def _linear(frames: FloatArray, values: FloatArray) -> Callable[[FloatArray], FloatArray]:
    return lambda t: np.stack([np.interp(t, frames, column) for column in values.T], 1)


def _catmull_rom(frames: FloatArray, values: FloatArray) -> Callable[[FloatArray], FloatArray]:
    slopes = np.zeros_like(values)
    slopes[1:-1] = (values[2:] - values[:-2]) / (frames[2:] - frames[:-2])[:, None]
    return CubicHermiteSpline(frames, values, slopes)  # type: ignore[no-any-return]


def _pchip(frames: FloatArray, values: FloatArray) -> Callable[[FloatArray], FloatArray]:
    slopes = PchipInterpolator(frames, values).derivative()(frames)
    slopes[[0, -1]] = 0.0
    return CubicHermiteSpline(frames, values, slopes)  # type: ignore[no-any-return]


_CURVES: dict[Curve, Callable[[FloatArray, FloatArray], Callable[[FloatArray], FloatArray]]] = {
    Curve.LINEAR: _linear,
    Curve.NATURAL: lambda frames, values: CubicSpline(frames, values, bc_type="natural"),
    Curve.CLAMPED: lambda frames, values: CubicSpline(frames, values, bc_type="clamped"),
    Curve.PCHIP: _pchip,
    Curve.CATMULL_ROM: _catmull_rom,
}
