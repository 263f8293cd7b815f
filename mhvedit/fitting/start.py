"""Where a fit begins: the plain adult of the facing estimate, and the frame that is bound to its joints."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from mhvedit.fitting.fit import Pose
from mhvedit.fitting.joints import joint, places_in, turns_in
from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.bodies import BodyTrack

WIDE_OPEN: Final = 0.25  # m between limbs: more makes no frame a better one
POOR_FIT: Final = 0.05  # m that a frame may be less open if the plain adult fits it as usual instead of not at all
_LIMBS: Final = ("left_arm", "right_arm", "left_leg", "right_leg")
_BONES: Final = {"arm": ("upper_arm", "forearm", "hand"), "leg": ("thigh", "shin", "foot")}
_INNER: Final = {"arm": (0.6, 1.0), "leg": (0.5, 0.75, 1.0)}  # along each bone: limbs are always near at their roots


def binding_frame(track: BodyTrack) -> int:
    """Index of the frame in which the limbs are farthest from each other and the trunk: nothing is merged there."""
    open_by = np.array([openness(places) for places in places_in(track)])
    poor = np.sqrt(track.misfit / max(float(np.median(track.misfit)), 1e-12))
    return int((open_by - POOR_FIT * poor).argmax())


def openness(places: FloatArray) -> float:
    """How far limbs are from each other, and arms from the trunk, m; at most `WIDE_OPEN`.

    Args:
        places: (J, 3) m.
    """
    limbs = {name: _points_along(places, name) for name in _LIMBS}
    trunk = np.linspace(places[joint("pelvis")], places[joint("neck")], 5)
    pairs = [(limbs[a], limbs[b]) for i, a in enumerate(_LIMBS) for b in _LIMBS[i + 1 :]]
    pairs += [(limbs[arm], trunk) for arm in _LIMBS[:2]]
    nearest = min(float(np.linalg.norm(a[:, None] - b[None], axis=-1).min()) for a, b in pairs)
    return min(nearest, WIDE_OPEN)


def starting_poses(track: BodyTrack, bound: int) -> Sequence[Pose]:
    """The plain adult's poses as turns from the frame in which the subject is bound."""
    turns, places = turns_in(track), places_in(track)
    back = np.swapaxes(turns[bound], 1, 2)
    return [Pose(turn @ back, place[0]) for turn, place in zip(turns, places, strict=True)]


def _points_along(places: FloatArray, limb: str) -> FloatArray:
    """(N, 3) m, some points of the two bones of a limb."""
    side, kind = limb.split("_")
    upper, middle, lower = (places[joint(f"{side}_{bone}")] for bone in _BONES[kind])
    share = np.array(_INNER[kind])[:, None]
    return np.concatenate([upper + share * (middle - upper), middle + share * (lower - middle)])
