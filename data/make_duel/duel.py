"""The choreography: key poses of both fencers in one world, and what happens between them.

Each fencer has a stage of their own in which the opponent is ahead: x forward, y to the left, origin half-way. Anna's
is the world; Ben's is turned by half a turn. Times are frames at 25 fps of the fight's own clock.
"""

from __future__ import annotations

from dataclasses import dataclass

from .motion import Row, Step
from .vectors import unit, vec

END = 432.0
TOUCH = 0.0055  # m, from the plane of contact to the middle line of either blade


@dataclass(frozen=True, slots=True)
class Part:
    """All keys of one fencer, on their own stage."""

    hips: tuple[Row, ...]  # frame, x, y, z m, yaw rad
    chest: tuple[Row, ...]  # frame, yaw, pitch, roll rad
    sword: tuple[Row, ...]  # frame, grip m, blade direction
    strikes: tuple[float, ...]  # frames at which the blade stops or starts abruptly
    off_hand: tuple[Row, ...]  # frame, free wrist from the hips, m
    right: tuple[tuple[float, float, float], tuple[Step, ...]]  # first place and yaw, steps
    left: tuple[tuple[float, float, float], tuple[Step, ...]]


@dataclass(frozen=True, slots=True)
class Segment:
    """One key segment, in frames of the fight's clock, inclusive."""

    name: str
    start: int
    stop: int
    interaction: str
    anna: str  # part
    ben: str
    visibility: bool
    stretch: int  # how many frames more Ben's capture has of it


SEGMENTS = (
    Segment("01-salute", 14, 38, "none", "body", "body", True, 2),
    Segment("02-cut-parried", 78, 96, "+&+", "sword", "sword", True, -1),
    Segment("03-blades-part", 97, 111, "-&-", "sword", "sword", False, 1),
    Segment("04-blades-brush", 142, 158, "0&0b", "sword", "sword", False, -1),
    Segment("05-cut-ducked", 190, 212, "0&0c", "sword", "body", False, 2),
    Segment("06-blades-locked", 254, 278, "0&0a", "sword", "sword", True, -2),
    Segment("07-blade-displaced", 302, 317, "+&-", "sword", "sword", False, 1),
    Segment("08-thrust-hits", 352, 368, "+&0", "sword", "body", False, -1),
    Segment("09-thrust-withdrawn", 372, 387, "-&0", "sword", "body", False, 1),
)


def crossed(frame: float, point: Row, direction: Row, along: float, *, ben: bool = False, clear: float = 0.0) -> Row:
    """A sword key whose blade lies in an upright plane along the fight and passes through a point of the world.

    Args:
        frame: of the key.
        point: (3,) m, in the world, where the blades cross.
        direction: (2,) forward and up, of the blade on its own stage.
        along: m, from the grip to the crossing.
        ben: whose blade; Ben's keeps to the world's left of the point, Anna's to its right.
        clear: m, how far from touching.
    """
    blade = unit(vec(direction[0], 0.0, direction[1]))
    x, y, z = point
    if ben:
        x, y = -x, -y
    grip = vec(x, y - TOUCH - clear, z) - blade * along
    return (frame, *grip.tolist(), *blade.tolist())
