"""Whether a fit may be used: measures of every frame and of the capture as a whole, and sentences where it may not.

The limits were set between what people give and what other things give; `docs/fitting_results.md` has both.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.errors import MhveditError
from mhvedit.fitting.fit import Pose, Target, nearest_facing, posed_samples, posed_template
from mhvedit.fitting.joints import NAMES
from mhvedit.fitting.template import Template, outward_normals
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.flags import frames_in_words, runs_of
from mhvedit.sequences.bodies import BodyTrack
from mhvedit.sequences.meshes import Mesh

FAR: Final = 0.1  # m: a gap that is larger counts as this
NEAR: Final = 0.025  # m across the surface, and three times that along it: the template is met
SAME_WAY: Final = 0.3  # cosine between normals that face the same way
EXPLAINED: Final = 0.04  # m from the template where it faces the same way
N_LOOKED: Final = 3000  # points of a captured surface that are looked at
LARGEST_GAP: Final = 0.0125  # m, mean of a frame
LEAST_MET: Final = 0.87  # share of the template that is met in a frame
LEAST_EXPLAINED: Final = 0.9  # share of the captured surface that the template explains in a frame
FASTEST: Final = 12.0  # m/s: a joint that is faster has jumped from one limb to another
LARGEST_MISFIT: Final = 8e-4  # m^2, of the plain adult, median of the frames: people up to 6e-4, furniture from 12e-4
LEAST_SHARE: Final = 0.4  # of a bone's usual share of the skin
_USUAL: Final = {  # shares of the skin, medians over 20 takes of people
    "pelvis": 0.069, "spine": 0.103, "chest": 0.097, "neck": 0.085, "clavicle": 0.019, "upper_arm": 0.047,
    "forearm": 0.029, "hand": 0.018, "thigh": 0.104, "shin": 0.079, "foot": 0.025,
}  # fmt: skip


class FitRefused(MhveditError, ValueError):
    """No skeleton may be fitted to a capture, or not in all of the frames that are to be edited."""

    def __init__(self, name: str, why: Sequence[str], *, picture: Path | None = None) -> None:
        seen = "" if picture is None else f" (a picture of it: {picture})"
        found = f"one that it does not: {'; '.join(why)}{seen}"
        super().__init__(f"{name}: expected a capture that a skeleton fits, found {found}")
        self.why, self.picture = tuple(why), picture


@dataclass(frozen=True, slots=True)
class FrameFit:
    """How well the template meets one frame."""

    gap: float  # m, mean distance of the template to the captured surface, along its normals
    met: float  # share of the template that lies on captured surface which faces the same way
    explained: float  # share of the captured surface that lies near the template

    @property
    def usable(self) -> bool:
        """Whether the frame may be edited."""
        return self.gap <= LARGEST_GAP and self.met >= LEAST_MET and self.explained >= LEAST_EXPLAINED


@dataclass(frozen=True, slots=True, eq=False)
class Likeness:
    """How like a person a capture is, whatever the template says, which is made of the capture itself."""

    misfit: float  # m^2, of the plain adult, median of the frames
    shares: FloatArray  # (J,) of the template's skin, by bone, against what is usual


def measure_frame(template: Template, goal: Target, pose: Pose) -> FrameFit:
    """Compare the template in a pose with a captured frame.

    Args:
        template: bound.
        goal: the frame.
        pose: of the template.
    """
    points, normals = posed_samples(template, pose)
    chosen, square, facing = nearest_facing(goal, points, normals)
    across = np.abs((goal.normals[chosen] * (points - goal.points[chosen])).sum(1))
    met = (across < NEAR) & (square < (3 * NEAR) ** 2) & (facing > SAME_WAY)
    every = slice(None, None, max(1, len(goal.points) // N_LOOKED))
    _, square, facing = nearest_facing(posed_template(template, pose), goal.points[every], goal.normals[every])
    explained = (square < EXPLAINED**2) & (facing > SAME_WAY)
    return FrameFit(float(np.minimum(across, FAR).mean()), float(met.mean()), float(explained.mean()))


def likeness(template: Template, track: BodyTrack) -> Likeness:
    """Compare a capture with what is known of people.

    Args:
        template: bound.
        track: the plain adult in the capture.
    """
    _, areas = outward_normals(Mesh(template.vertices, template.faces))
    usual = np.array([_USUAL[name.removeprefix("left_").removeprefix("right_")] for name in NAMES])
    return Likeness(float(np.median(track.misfit)), (template.weights * areas[:, None]).sum(0) / areas.sum() / usual)


def refusals(like: Likeness, numbers: Sequence[int], frames: Sequence[FrameFit]) -> tuple[str, ...]:
    """Why a fit may not be used, in sentences; nothing if it may.

    Args:
        like: of the capture.
        numbers: of the frames that are to be used.
        frames: how well these are met.
    """
    why = []
    if like.misfit > LARGEST_MISFIT:
        why.append(
            f"it does not look like one person: misfit {1e6 * like.misfit:.0f} mm^2, at most {1e6 * LARGEST_MISFIT:.0f}"
        )
    for name, share in zip(NAMES, like.shares, strict=True):
        if share < LEAST_SHARE:
            why.append(
                f"{name} has {100 * share:.0f} % of the skin that people have there, at least {100 * LEAST_SHARE:.0f}"
            )
    for run in runs_of(np.array([not frame.usable for frame in frames], np.bool_)):
        worst = min(frames[run.start : run.stop], key=lambda frame: frame.met + frame.explained)
        span = frames_in_words(numbers[run[0]], numbers[run[-1]])
        why.append(
            f"{span}: {1000 * worst.gap:.1f} mm between template and capture (at most {1000 * LARGEST_GAP:.1f}), "
            f"{100 * worst.met:.0f} % of the template met (at least {100 * LEAST_MET:.0f}), "
            f"{100 * worst.explained:.0f} % of the capture explained (at least {100 * LEAST_EXPLAINED:.0f})"
        )
    return tuple(why)


def jumps(numbers: Sequence[int], places: FloatArray, *, fps: float) -> tuple[str, ...]:
    """Where a joint moves faster than people do, in sentences: before or after that it is on another limb.

    Args:
        numbers: T frame numbers.
        places: (T, J, 3) m.
        fps: Hz.
    """
    seconds = np.diff(numbers)[:, None] / fps
    speed = np.linalg.norm(np.diff(places, axis=0), axis=-1) / seconds
    return tuple(
        f"{NAMES[int(speed[at].argmax())]} moves at {speed[at].max():.0f} m/s between frames {numbers[at]} and "
        f"{numbers[at + 1]}, at most {FASTEST:.0f}"
        for at in np.flatnonzero((speed > FASTEST).any(1)).tolist()
    )
