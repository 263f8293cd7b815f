"""Simulated bodies in a frame: flight to the next impact, impulses, and on (Schmidl and Lin, C1.2)."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.world.contacts import Contacts, Meeting, touching
from mhvedit.world.impact import time_of_impact
from mhvedit.world.impulses import struck, supported
from mhvedit.world.motion import Moving, flown, rates
from mhvedit.world.narrow import Narrow

LONGEST: Final = 1 / 240  # s, of a step in which contacts stay the same
EVENTS: Final = 12  # impacts in a step; then what is left of it is spent without further stops
SUNK: Final = 5e-5  # m, overlap of touching bodies from which they are moved apart


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """What contacts carry; the next step begins with it."""

    frames: IntArray  # (N, 2)
    force: FloatArray  # (N, 3) N, along the normal and two tangents


@dataclass(frozen=True, slots=True, eq=False)
class Advanced:
    """Bodies after a frame."""

    moving: Moving
    carried: Carried
    impacts: int  # how often the way was stopped


NOTHING: Final = Carried(np.zeros((0, 2), np.int64), np.zeros((0, 3)))


def advanced(
    narrow: Narrow,
    moving: Moving,
    meeting: Meeting,
    gravity: FloatArray,
    time: float,
    *,
    carried: Carried = NOTHING,
) -> Advanced:
    """Move all bodies for a time, stopping wherever some of them meet.

    Args:
        narrow: pieces and which may meet.
        moving: the bodies; those of inverse mass 0 keep their velocity and spin.
        meeting: restitution and friction of two frames.
        gravity: (3,) m/s2.
        time: s.
        carried: what contacts carried before.
    """
    if not moving.inverse_inertia.any():  # nothing is simulated
        rotations, positions = flown(moving, moving.velocity, moving.spin, time)
        return Advanced(replace(moving, rotations=rotations, positions=positions), carried, 0)
    steps = max(1, int(np.ceil(time / LONGEST - 1e-9)))
    impacts = 0
    for _ in range(steps):
        left = time / steps
        for event in range(EVENTS):
            touch = touching(narrow, moving.rotations, moving.positions, meeting)
            gone, moving, carried = _to_next_impact(
                narrow, moving, touch, gravity, left, carried, last=event == EVENTS - 1
            )
            impacts += gone < left
            left -= gone
            if left <= 1e-12:
                break
    return Advanced(moving, carried, impacts)


def _to_next_impact(
    narrow: Narrow,
    moving: Moving,
    touch: Contacts,
    gravity: FloatArray,
    left: float,
    before: Carried,
    *,
    last: bool,
) -> tuple[float, Moving, Carried]:
    """Impulses now, support on the way, and the way to the next impact or to the end; how long that took."""
    velocity, momentum = struck(moving, touch)
    moving = replace(moving, velocity=velocity, momentum=momentum)
    falls = (moving.inverse_mass > 0) & (moving.inverse_inertia.any((1, 2)))
    pull = np.where(falls[:, None], gravity, 0.0)
    ahead, turned, pressed = supported(moving, touch, left * pull, start=_again(touch, before, left))
    carried = Carried(touch.frames, pressed / left)
    speed, spin = (velocity + ahead) / 2, rates(moving, (momentum + turned) / 2, left)
    gone = left
    if not last:
        known = [(int(min(pair)), int(max(pair))) for pair in touch.frames]
        gone = time_of_impact(narrow, moving, speed, spin, left, leaving_out=known)
    if gone < left:  # rates over the shorter time, so that energy is kept to the last digit
        share = gone / left
        ahead, turned = velocity + share * (ahead - velocity), momentum + share * (turned - momentum)
        speed, spin = (velocity + ahead) / 2, rates(moving, (momentum + turned) / 2, gone)
    rotations, positions = flown(moving, speed, spin, gone)
    positions = positions + _apart(moving, touch)
    return gone, replace(moving, rotations=rotations, positions=positions, velocity=ahead, momentum=turned), carried


def _again(touch: Contacts, before: Carried, time: float) -> FloatArray:
    """(N, 3) N s, the impulses of the step before, shared out anew where a pair now touches at more or fewer points."""
    start = np.zeros((len(touch.gap), 3))
    for pair in np.unique(touch.frames, axis=0):
        now, then = (touch.frames == pair).all(1), (before.frames == pair).all(1)
        if now.sum() == then.sum():
            start[now] = before.force[then]
        else:
            start[now, 0] = before.force[then, 0].sum() / now.sum()
    return start * time


def _apart(moving: Moving, touch: Contacts) -> FloatArray:
    """(F, 3) m, by which touching bodies that rounding has let sink into each other are moved apart."""
    shift = np.zeros_like(moving.positions)
    for k in np.flatnonzero(touch.gap < -SUNK):
        a, b = touch.frames[k]
        share = moving.inverse_mass[[a, b]] / max(moving.inverse_mass[[a, b]].sum(), 1e-300)
        missing = -touch.gap[k] - touch.normal[k] @ (shift[a] - shift[b])
        if missing > 0:
            shift[a] += share[0] * missing * touch.normal[k]
            shift[b] -= share[1] * missing * touch.normal[k]
    return shift
