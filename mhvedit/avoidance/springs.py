"""Springs along a run of frames: the change of least cost where everything that is not met pushes.

The cost of a change is its size and its second differences, so the system of all frames and DOFs is a band of two
frames on either side.
"""

from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.band import solve_band


@dataclass(frozen=True, slots=True, eq=False)
class Springs:
    """Rows low <= jacobian @ change <= high of one frame each, which push where they are not met."""

    frame: IntArray  # (M,) ascending
    jacobian: FloatArray  # (M, F)
    low: FloatArray  # (M,)
    high: FloatArray  # (M,)
    stiffness: FloatArray  # (M,)


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """How far each DOF may go from one frame to the next, with the frames beside the window."""

    before: FloatArray  # (N + 1, F) steps as they are; NaN beyond the ends of the motion
    most: FloatArray  # (F,)
    stiffness: float


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """The change from the captured motion along a run of N frames, with two frames on either side that stand."""

    change: FloatArray  # (N + 4, F) rad or m; of no matter beyond the ends of the motion
    there: BoolArray  # (N + 4,) which frames there are
    weights: FloatArray  # (F,) gamma
    scale: float  # frames: changes that come and go faster than this cost more by it than by their size

    @property
    def bends(self) -> FloatArray:
        """(N + 2, F) second differences about every frame of the run and one beside it; 0 beyond the ends."""
        whole = self.there[:-2] & self.there[1:-1] & self.there[2:]
        return np.where(whole[:, None], np.diff(self.change, 2, axis=0), 0.0)


def least_cost_move(course: Course, springs: Springs, steps: Steps, *, updates: int) -> FloatArray:
    """(N, F) move of least cost: springs that push are found by pushing where the last move did not meet them.

    Args:
        course: the run as it is.
        springs: what has to be met.
        steps: speeds.
        updates: how often to ask which springs push.
    """
    n, f = len(course.change) - 4, course.change.shape[1]
    move, pushing = np.zeros((n, f)), np.zeros(0)
    for _ in range(updates):
        value = (springs.jacobian * move[springs.frame]).sum(1)
        up, down = value < springs.low, value > springs.high
        step = steps.before + np.diff(np.pad(move, ((1, 1), (0, 0))), axis=0)
        fast = np.where(np.abs(step) > steps.most, np.sign(step), 0.0)
        now = np.concatenate([up, down, fast.ravel()])
        if len(pushing) and (now == pushing).all():
            break
        pushing = now
        band, pull = _cost_band(course)
        _add_springs(band, pull, springs, up, down)
        _add_steps(band, pull, steps, fast)
        if not solve_band(band.reshape(n * f, 2 * f + 1), pull.reshape(n * f, 1)):
            break
        move = pull
    return move


def _cost_band(course: Course) -> tuple[FloatArray, FloatArray]:
    """(N, F, 2 F + 1) rows of the cost's matrix up to the diagonal, which is last, and (N, F) its right side."""
    n, f = len(course.change) - 4, course.change.shape[1]
    whole = (course.there[:-2] & course.there[1:-1] & course.there[2:]).astype(np.float64)
    steep = course.scale**4 * course.weights
    band = np.zeros((n, f, 2 * f + 1))
    band[:, :, 2 * f] = course.weights + (whole[:n] + 4 * whole[1:-1] + whole[2:])[:, None] * steep
    band[1:, :, f] = -2 * (whole[1:n] + whole[2 : n + 1])[:, None] * steep
    band[2:, :, 0] = whole[2:n, None] * steep
    bends = course.bends
    pull = -course.weights * course.change[2:-2] - steep * np.diff(bends, 2, axis=0)
    return band, pull


def _add_springs(band: FloatArray, pull: FloatArray, springs: Springs, up: BoolArray, down: BoolArray) -> None:
    """Add the rows that push to a band and its right side."""
    n, f = pull.shape
    push = np.flatnonzero(up | down)
    root = np.sqrt(springs.stiffness[push])
    rows = springs.jacobian[push] * root[:, None]
    wanted = np.where(up[push], springs.low[push], springs.high[push]) * root
    i, j = np.tril_indices(f)
    ends = np.searchsorted(springs.frame[push], np.arange(n + 1))
    for t in np.flatnonzero(np.diff(ends)):
        mine = rows[ends[t] : ends[t + 1]]
        band[t, i, 2 * f - (i - j)] += (mine.T @ mine)[i, j]
        pull[t] += mine.T @ wanted[ends[t] : ends[t + 1]]


def _add_steps(band: FloatArray, pull: FloatArray, steps: Steps, fast: FloatArray) -> None:
    """Add the steps that are too long one way (1) or the other (-1), with what stands beside the run at either end."""
    f = pull.shape[1]
    push = steps.stiffness * np.abs(fast)
    wanted = push * np.where(fast == 0, 0.0, fast * steps.most - steps.before)
    band[:, :, 2 * f] += push[:-1] + push[1:]
    pull += wanted[:-1] - wanted[1:]
    band[1:, :, f] -= push[1:-1]
