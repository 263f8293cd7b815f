"""Mutual visibility: each stands in the other's cone of sight (Shi et al., eq. 14)."""

from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.meshes import Gaze

NOT_SEEN_BY_A = "B is out of A's sight"
NOT_SEEN_BY_B = "A is out of B's sight"


@dataclass(frozen=True, slots=True, eq=False)
class SightCone:
    """What a subject sees: all that lies within half an angle of the gaze, at any distance."""

    eye: FloatArray  # (3,) m
    direction: FloatArray  # (3,) unit
    half_angle: float  # rad


def sight_cone(gaze: Gaze, numbers: IntArray, *, half_angle: float) -> SightCone:
    """The cone from the average eye position along the average gaze (Shi et al., section 4.3.1).

    Args:
        gaze: of the whole capture.
        numbers: (K,) frame numbers to average over.
        half_angle: rad.
    """
    rows = np.searchsorted(gaze.numbers, numbers)
    direction = gaze.direction[rows].mean(0)
    length = float(np.linalg.norm(direction))
    unit = gaze.direction[rows[len(rows) // 2]] if length < 1e-9 else direction / length
    return SightCone(gaze.eye[rows].mean(0), unit, half_angle)


def sees(cone: SightCone, points: FloatArray) -> bool:
    """Whether some point lies in the cone.

    Args:
        cone: of sight.
        points: (N, 3) m.
    """
    towards = points - cone.eye
    return bool((towards @ cone.direction >= np.cos(cone.half_angle) * np.linalg.norm(towards, axis=1)).any())
