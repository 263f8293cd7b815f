"""What the edit adds to a subject's own motion: skate of the soles, steps, turns and jumps between frames.

Captures have no correspondence between frames, so nobody can tell how fast a sole slides in the capture itself. What
the edit adds is known exactly: between two frames its placement changes by a rigid motion of the plane, and that
moves every point of the surface by so much more (or less) than the capture does.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose, wrap_angle

FLOOR: Final = 0.05  # m, a lowest point below this is on the floor
SOLE: Final = 0.02  # m, what lies within this of the lowest point is sole


@dataclass(frozen=True, slots=True, eq=False)
class AddedMotion:
    """What the edit adds to one subject, from each frame to the next."""

    subject: str
    skate: (
        FloatArray  # (N - 1,) m, the furthest that a point of the soles is moved; NaN where nothing is near the floor
    )
    step: FloatArray  # (N - 1,) m, how much longer the step of the mean vertex became (negative: shorter)
    shift: FloatArray  # (N - 1,) m, how far the mean vertex is moved
    turn: FloatArray  # (N - 1,) rad, how far the placement turns
    jump: FloatArray  # (N - 2,) m a frame, change of the shift (as a vector) at the inner frames


def sole_points(vertices: FloatArray) -> FloatArray:
    """The lowest part of a surface while it is on the floor.

    Args:
        vertices: (V, 3) m, floor at z = 0.

    Returns:
        (K, 3) m, none while the subject is in the air.
    """
    lowest = vertices[:, 2].min()
    if lowest > FLOOR:
        return np.zeros((0, 3))
    return np.asarray(vertices[vertices[:, 2] <= lowest + SOLE])


def added_motion(subject: str, placements: FloatArray, *, soles: list[FloatArray], centres: FloatArray) -> AddedMotion:
    """Measure what the edit adds.

    Args:
        subject: name.
        placements: (N, 3) world_from_capture.
        soles: (N) arrays (K, 3) m, in the capture's frame.
        centres: (N, 3) m, mean vertices in the capture's frame.
    """
    n = len(placements)
    moved = [_moved(placements, k, centres[[k + 1]])[0, :2] for k in range(n - 1)]
    shift = np.array(moved).reshape(-1, 2)
    skate = [np.linalg.norm(_moved(placements, k, soles[k]), axis=1).max(initial=-1.0) for k in range(n - 1)]
    slid = np.array(skate, np.float64)
    placed = np.array([apply_pose(placements[k], centres[k]) for k in range(n)]).reshape(n, 3)
    edited = np.linalg.norm(np.diff(placed[:, :2], axis=0), axis=1)
    captured = np.linalg.norm(np.diff(centres[:, :2], axis=0), axis=1)
    return AddedMotion(
        subject,
        skate=np.where(slid < 0, np.nan, slid),
        step=edited - captured,
        shift=np.linalg.norm(shift, axis=1),
        turn=np.abs(wrap_angle(np.diff(placements[:, 2]))),
        jump=np.linalg.norm(np.diff(shift, axis=0), axis=1),
    )


def _moved(placements: FloatArray, k: int, points: FloatArray) -> FloatArray:
    """How far the change of placement from frame k to k + 1 moves points of the capture."""
    return apply_pose(placements[k + 1], points) - apply_pose(placements[k], points)
