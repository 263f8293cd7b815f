"""A figure through a run of frames that are all known: free of bodies in each, and calm from one to the next.

`resolve` sees one frame after the other, as a tracker gives them, and takes back a correction when it can. In a
recorded motion what comes is known. So first each frame is freed, from the posture of the one before, which keeps limbs
on the side from which they came. Then the corrections are made calm over the run, and what that lets in is freed
again, in turn: what remains is near to a calm movement that begins before the touch and ends after it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import diags_array
from scipy.sparse.linalg import splu

from mhvedit.avoidance.posture import PostureSettings, limits_around, predict_posture
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.world.depth import TOLERANCE
from mhvedit.world.surroundings import Frames, PieceGaps, Surroundings

TRUST: Final = 0.3  # rad or m, largest step of a DOF in one programme
PROGRAMMES: Final = 20  # of one posture
REACH: Final = 0.2  # m beyond the margin, how far postures look
TURNS: Final = 2  # in which corrections are made calm and frames are freed
TENSION: Final = 4.0  # weight of what corrections change from frame to frame, which keeps them from swinging over ...
STIFFNESS: Final = 4.0  # ... and of how that changes
HELD: Final = 300.0  # weight of corrections that something asked for ...
LOOSE: Final = 0.1  # ... and of those of frames that are free by themselves
ENDS: Final = 1e6  # weight of the frames around the run, in which nothing changes
ASKED: Final = 1e-5  # rad or m: a correction this small was not asked for


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """One frame of a run."""

    tracked: FloatArray  # (D,) rad or m
    surroundings: Surroundings  # the figure with its flesh as it is there, and the bodies
    frames: Frames  # where the bodies are
    margin: float  # m, that pieces keep


@dataclass(frozen=True, slots=True, eq=False)
class Yielding:
    """What may give way, and how the run joins what is around it."""

    free: BoolArray  # (D,) DOFs that may change; all others stay exactly
    begins: bool  # whether something comes before the run that stays as it is ...
    ends: bool  # ... and after it


def freed_run(run: Sequence[Moment], how: Yielding) -> FloatArray:
    """Postures near the tracked ones that are free and calm; where there is no free one, the least deep.

    Args:
        run: at least one frame, one after the other.
        how: what may change.

    Returns:
        (T, D) rad or m.
    """
    tracked = np.array([moment.tracked for moment in run])
    q = _freed_in_turn(run, how)
    asked = (np.abs(q - tracked) > ASKED).any(1)
    for _ in range(TURNS):
        wanted = tracked + calm(q - tracked, asked, how)
        q = np.array([freed(moment, w, how.free, start=w) for moment, w in zip(run, wanted, strict=True)])
        asked |= (np.abs(q - wanted) > ASKED).any(1)
    return q


def freed(moment: Moment, wanted: FloatArray, free: BoolArray, *, start: FloatArray) -> FloatArray:
    """(D,) the posture nearest to a wanted one in which the figure is free.

    Args:
        moment: of the run.
        wanted: (D,) rad or m.
        free: (D,) DOFs that may change.
        start: (D,) where the search begins; it decides on which side limbs pass.
    """
    figure = moment.surroundings.figure
    return predict_posture(
        figure.skeleton,
        wanted,
        (PieceGaps(moment.surroundings, moment.frames, moment.margin, REACH),),
        start=start,
        weights=figure.effort,
        free=free,
        limits=limits_around(figure.skeleton.limits, moment.tracked),
        settings=PostureSettings(tolerance=TOLERANCE / 2, trust=TRUST, iterations=PROGRAMMES),
    ).q


def calm(changes: FloatArray, asked: BoolArray, how: Yielding) -> FloatArray:
    """Changes through a run, made smooth: least squares of what they were, and of their first and second differences.

    Args:
        changes: (T, D) rad or m.
        asked: (T,) frames whose change something asked for.
        how: at which ends the changes come from nothing.
    """
    around = 2 * np.array([how.begins, how.ends], np.int64)  # frames beyond each end in which nothing changes
    padded = np.pad(changes, (tuple(around), (0, 0)))
    weights = np.full(len(padded), ENDS)
    weights[around[0] : len(padded) - around[1]] = np.where(asked, HELD, LOOSE)
    n = len(padded)
    if n < 3:
        return changes
    steps = diags_array([-1.0, 1.0], offsets=[0, 1], shape=(n - 1, n))
    bends = diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(n - 2, n))
    system = diags_array(weights) + TENSION * (steps.T @ steps) + STIFFNESS * (bends.T @ bends)
    found = splu(system.tocsc()).solve(weights[:, None] * padded)
    return np.asarray(found[around[0] : n - around[1]])


def _freed_in_turn(run: Sequence[Moment], how: Yielding) -> FloatArray:
    """(T, D) each frame freed from the one before, from that end of the run that is free."""
    order = range(len(run))
    depths = [run[k].surroundings.look(run[k].tracked, run[k].frames, reach=0.0).gaps.deepest for k in order]
    if depths[0] > TOLERANCE >= depths[-1]:
        order = range(len(run) - 1, -1, -1)
    q, last = np.array([moment.tracked for moment in run]), None
    for k in order:
        if depths[k] > TOLERANCE:
            start = q[k] if last is None else np.where(how.free, last, q[k])
            q[k] = freed(run[k], q[k], how.free, start=start)
        else:
            q[k] = freed(run[k], q[k], how.free, start=q[k])
        last = q[k]
    return q
