"""A motion that `mhvedit avoid` freed of self-collision, before and after: what is shown of it, without drawing."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.errors import CaptureError, counted
from mhvedit.geometry.arrays import IntArray
from mhvedit.pipeline.folders import REPORT, is_of_motion, report_in
from mhvedit.pipeline.posture_file import POSTURES, Postures, Take, read_postures
from mhvedit.viewer import state as playing


class Side(StrEnum):
    """Where the body is seen from."""

    NEAR = "near"  # the side on which limbs are deepest in each other
    FAR = "far"
    TOP = "top"


@dataclass(frozen=True, slots=True, eq=False)
class MotionMaterial:
    """What there is to be shown."""

    name: str
    method: str
    converged: bool
    why: tuple[str, ...]  # sentences on why it did not converge
    postures: Postures

    @property
    def n_frames(self) -> int:
        """Of both motions."""
        return self.postures.n_frames

    @property
    def fps(self) -> float:
        """Hz."""
        return float(self.postures.fps)

    @property
    def colliding(self) -> IntArray:
        """(K,) frames that collide before or after."""
        return np.flatnonzero((self.postures.deepest > float(self.postures.limit)).any(0))


@dataclass(frozen=True, slots=True, eq=False)
class MotionState:
    """A frozen snapshot of all that is shown."""

    material: MotionMaterial
    position: float = 0.0  # frames, with a fraction while it plays
    playing: bool = False
    speed: float = 1.0
    loop: bool = True
    side: Side = Side.NEAR

    @property
    def frame(self) -> int:
        """The frame that is shown."""
        return int(self.position)


Change = Callable[[MotionState], MotionState]


def open_motion_folder(out: Path) -> MotionMaterial:
    """What is in a folder of `mhvedit avoid`.

    Raises:
        CaptureError: it is none, its postures are not there, or they are not those that its report is on.
    """
    report = report_in(out)
    if not is_of_motion(report):
        raise CaptureError(out, "an output folder of `mhvedit avoid`", f"no {REPORT} of it")
    postures = read_postures(out / POSTURES)
    if report.get("frames") != postures.n_frames:
        found = f"{counted(postures.n_frames, 'frame')}; run `mhvedit avoid` again"
        raise CaptureError(out / POSTURES, f"the {report.get('frames')} frames of {REPORT}", found)
    return MotionMaterial(
        Path(str(report["motion"])).stem,
        str(report["method"]),
        bool(report["converged"]),
        tuple(str(sentence) for sentence in report["why"]),
        postures,
    )


def started(material: MotionMaterial) -> MotionState:
    """The first state: the frame in which the captured body is deepest in itself."""
    return MotionState(material, position=float(material.postures.deepest[Take.CAPTURED].argmax()))


def next_collision(state: MotionState, step: int) -> MotionState:
    """At the first frame of the run of colliding frames so many runs further, round and round."""
    frames = state.material.colliding
    if not len(frames):
        return state
    starts = frames[np.diff(frames, prepend=-2) > 1]
    here = int(np.searchsorted(starts, state.frame, side="right")) - 1
    if step < 0 and (here < 0 or starts[here] != state.frame):
        here += 1
    return replace(playing.at_frame(state, int(starts[(here + step) % len(starts)])), playing=False)


def seen_from(state: MotionState, side: Side) -> MotionState:
    """From another side."""
    return replace(state, side=side)


CHANGES: Final[Mapping[str, tuple[Change, str]]] = {  # key -> what it does, in words
    "space": (playing.toggled_play, "play, pause"),
    "Left": (partial(playing.stepped, frames=-1), "one frame back"),
    "Right": (partial(playing.stepped, frames=1), "one frame ahead"),
    "Home": (lambda now: playing.at_frame(now, 0), "first frame"),
    "End": (lambda now: playing.at_frame(now, now.material.n_frames - 1), "last frame"),
    "bracketleft": (partial(playing.sped, places=-1), "play slower"),
    "bracketright": (partial(playing.sped, places=1), "play faster"),
    "l": (lambda now: playing.looped(now, not now.loop), "loop or not"),
    "n": (partial(next_collision, step=1), "next collision"),
    "b": (partial(next_collision, step=-1), "collision before"),
    "1": (partial(seen_from, side=Side.NEAR), "from the side that collides"),
    "2": (partial(seen_from, side=Side.FAR), "from the other side"),
    "3": (partial(seen_from, side=Side.TOP), "from above"),
}


def status(state: MotionState) -> tuple[str, ...]:
    """Lines about what is shown."""
    material, frame = state.material, state.frame
    free = "all frames are free" if material.converged else "not all of it could be removed"
    touched = "touched" if material.postures.touched[frame] else "as it was captured"
    return (
        f"{material.name}, freed by {material.method}: {free}",
        *material.why,
        f"frame {frame}, {touched}",
        *(f"{words}: {_deepest(state, take)}" for words, take in (("before", Take.CAPTURED), ("after", Take.EDITED))),
    )


def _deepest(state: MotionState, take: Take) -> str:
    """Which limbs are deepest in each other in the frame that is shown, and by how much beyond rest."""
    postures = state.material.postures
    depth = postures.depth[take, state.frame]
    top = float(depth.max(initial=0.0))
    if top == 0.0:
        return "nothing deeper than at rest"
    limbs = " and ".join(str(postures.limb_names[limb]) for limb in np.flatnonzero(depth == top))
    return f"{limbs}, {top:.1f} mm deeper than at rest"
