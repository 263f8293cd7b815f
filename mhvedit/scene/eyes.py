"""Where somebody's eyes are in an edited scene, and where they look."""

from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import rotation
from mhvedit.scene.edit import SubjectEdit
from mhvedit.sequences.meshes import Gaze


@dataclass(frozen=True, slots=True, eq=False)
class Eyes:
    """What somebody looks with in every frame of the scene, in the world; NaN where that is not known."""

    subject: str
    eye: FloatArray  # (N, 3) m, midpoint of the eyes
    direction: FloatArray  # (N, 3) unit


def eyes_in(name: str, edit: SubjectEdit, gaze: Gaze) -> Eyes:
    """A gaze as the scene has it.

    Args:
        name: of the subject.
        edit: of the subject; its source frames are the captured ones.
        gaze: in the capture's frame; need not be known in all frames.
    """
    known = np.isin(edit.source, gaze.numbers)
    row, placements = np.searchsorted(gaze.numbers, edit.source[known]), edit.placements[known]
    found = np.full((2, len(edit.source), 3), np.nan)
    found[:, known] = gaze.eye[row], gaze.direction[row]
    found[:, known, :2] = (rotation(placements[:, 2]) @ found[:, known, :2, None])[..., 0]
    found[0, known, :2] += placements[:, :2]
    return Eyes(name, *found)
