"""The joints that are fitted, and where they lie in the plain adult of `sequences.body_model`.

The plain adult's own joints are where its round cones bend best, which is not where bones turn. `centre` says by how
much, as the median over the six skinned motions of the shared data, whose joints are known: the plain adult was tracked
through them and each joint's place was looked up in the frame that carries it.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.bodies import BodyTrack
from mhvedit.sequences.body_model import (
    CHEST,
    LEFT_ANKLE,
    LEFT_ELBOW,
    LEFT_HIP,
    LEFT_KNEE,
    LEFT_SHOULDER,
    LUMBAR,
    NECK,
    PELVIS,
    RIGHT_ANKLE,
    RIGHT_ELBOW,
    RIGHT_HIP,
    RIGHT_KNEE,
    RIGHT_SHOULDER,
)

_Place = tuple[float, float, float]
_ORIGIN: Final = (0.0, 0.0, 0.0)
_WRIST: Final = (0.02, 0.005, -0.25)  # m, in the frame of the plain adult's left elbow
_ELBOW: Final = (0.002, 0.005, 0.008)  # m, correction, as the others in the table below
_CLAVICLE: Final = (0.0, 0.03, 0.22)  # m, in the frame of its chest


@dataclass(frozen=True, slots=True)
class _Joint:
    """A row of the table."""

    name: str  # as the tables of `skeleton` know it
    parent: str
    at: int  # the plain adult's joint that it stands at
    offset: _Place  # m, from there, in the frame of that joint
    carrier: int  # the plain adult's joint in whose frame the centre is corrected
    centre: _Place  # m, correction
    turns: int  # the plain adult's joint that turns like it
    loose: float  # m, how far its place may differ from the plain adult's (standard deviation)


_MIDDLE: Final = (
    _Joint("pelvis", "", PELVIS, _ORIGIN, PELVIS, (-0.033, 0.0, -0.028), PELVIS, 0.0),
    _Joint("spine", "pelvis", LUMBAR, _ORIGIN, PELVIS, (-0.02, 0.0, 0.0), LUMBAR, 0.01),
    _Joint("chest", "spine", CHEST, _ORIGIN, LUMBAR, (-0.02, 0.0, 0.0), CHEST, 0.01),
    _Joint("neck", "chest", NECK, _ORIGIN, CHEST, (-0.029, 0.0, 0.017), NECK, 0.015),
)
_LEFT: Final = (
    _Joint("left_clavicle", "chest", CHEST, _CLAVICLE, CHEST, (-0.02, 0.0, 0.0), CHEST, 0.005),
    _Joint("left_upper_arm", "left_clavicle", LEFT_SHOULDER, _ORIGIN, CHEST, _ORIGIN, LEFT_SHOULDER, 0.01),
    _Joint("left_forearm", "left_upper_arm", LEFT_ELBOW, _ORIGIN, LEFT_SHOULDER, _ELBOW, LEFT_ELBOW, 0.02),
    _Joint("left_hand", "left_forearm", LEFT_ELBOW, _WRIST, LEFT_ELBOW, (-0.002, -0.008, 0.0), LEFT_ELBOW, 0.02),
    _Joint("left_thigh", "pelvis", LEFT_HIP, _ORIGIN, PELVIS, (-0.031, -0.003, -0.022), LEFT_HIP, 0.03),
    _Joint("left_shin", "left_thigh", LEFT_KNEE, _ORIGIN, LEFT_HIP, (-0.015, 0.006, -0.029), LEFT_KNEE, 0.02),
    _Joint("left_foot", "left_shin", LEFT_ANKLE, _ORIGIN, LEFT_KNEE, (0.026, -0.010, -0.027), LEFT_ANKLE, 0.02),
)  # fmt: skip
_RIGHT: Final = {
    LEFT_SHOULDER: RIGHT_SHOULDER,
    LEFT_ELBOW: RIGHT_ELBOW,
    LEFT_HIP: RIGHT_HIP,
    LEFT_KNEE: RIGHT_KNEE,
    LEFT_ANKLE: RIGHT_ANKLE,
}


def _mirrored(row: _Joint) -> _Joint:
    """The same joint of the right side."""
    (x, y, z), (cx, cy, cz) = row.offset, row.centre
    at, carrier, turns = (_RIGHT.get(joint, joint) for joint in (row.at, row.carrier, row.turns))
    name, parent = (text.replace("left_", "right_") for text in (row.name, row.parent))
    return _Joint(name, parent, at, (x, -y, z), carrier, (cx, -cy, cz), turns, row.loose)


_TABLE: Final = (*_MIDDLE, *_LEFT, *(_mirrored(row) for row in _LEFT))
NAMES: Final = tuple(row.name for row in _TABLE)
PARENTS: Final[IntArray] = np.array([NAMES.index(row.parent) if row.parent else -1 for row in _TABLE])
TURNS: Final[IntArray] = np.array([row.turns for row in _TABLE])  # the plain adult's joint that turns like each
LOOSE: Final[FloatArray] = np.array([row.loose for row in _TABLE])  # m
MIRROR: Final[IntArray] = np.array(
    [NAMES.index(name.replace("left_", "\0").replace("right_", "left_").replace("\0", "right_")) for name in NAMES]
)


def joint(name: str) -> int:
    """Which of the fitted joints has a name."""
    return NAMES.index(name)


def places_in(track: BodyTrack) -> FloatArray:
    """Where the fitted joints are according to the plain adult, (T, J, 3) m."""
    size = track.size[:, None]
    out = np.empty((len(track.numbers), len(_TABLE), 3))
    for j, row in enumerate(_TABLE):
        away = track.rotations[:, row.at] @ np.array(row.offset) + track.rotations[:, row.carrier] @ np.array(
            row.centre
        )
        out[:, j] = track.places[:, row.at] + size * away
    return out


def turns_in(track: BodyTrack) -> FloatArray:
    """The axes of the fitted joints according to the plain adult, (T, J, 3, 3)."""
    return np.asarray(track.rotations[:, TURNS])
