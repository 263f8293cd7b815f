"""Plays the choreography: the pose of each fencer, in the world, at any time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from . import anna, ben
from .duel import END, Part
from .figure import ANNA, BEN, Figure, Posed, Stance, lower_hips, pose
from .motion import Curve, Track, curve, foot_at, track
from .vectors import Floats, turn, unit, vec

TAIL_LAG = 5.0  # frames


@dataclass(frozen=True, slots=True, eq=False)
class Performer:
    """A fencer with their curves; `heading` turns their stage into the world."""

    figure: Figure
    part: Part
    heading: float
    hips: Curve
    chest: Curve
    sword: Track
    off_hand: Curve
    beat: float  # rad, where their breath starts


def performer(name: str) -> Performer:
    """Anna or Ben, ready to play."""
    figure, part, heading, beat = {"anna": (ANNA, anna.PART, 0.0, 0.3), "ben": (BEN, ben.PART, np.pi, 2.1)}[name]
    return Performer(
        figure,
        part,
        heading,
        curve(part.hips),
        curve(part.chest),
        track(part.sword, part.strikes),
        curve(part.off_hand, 3.0),
        beat,
    )


def _eye_level(who: Performer, time: float) -> Floats:
    """About where someone's face is, in the world."""
    hips, chest = who.hips.at(time), who.chest.at(time)
    up = turn(float(chest[0]), float(chest[1])) @ vec(0.02, 0, 0.37 * who.figure.height)
    return np.asarray(turn(who.heading) @ (hips[:3] + up))


def posed_at(who: Performer, other: Performer, time: float) -> Posed:
    """The whole person at a time of the fight's clock, eyes on the opponent."""
    stance = _stance(who, time)
    stance = _into_world(stance, who.heading, _eye_level(other, time))
    sink = lower_hips(who.figure, stance)
    if sink > 0.0:
        stance = replace(stance, hips=stance.hips - vec(0, 0, sink), off_hand=stance.off_hand - vec(0, 0, sink))
    return pose(who.figure, stance)


def _stance(who: Performer, time: float) -> Stance:
    """The stance on the fencer's own stage."""
    hips, chest, sword = who.hips.at(time), who.chest.at(time), who.sword.at(time)
    right, right_yaw, right_pitch = foot_at(*who.part.right, time)
    left, left_yaw, left_pitch = foot_at(*who.part.left, time)
    breath = float(np.sin(who.beat + 2.0 * np.pi * time / 62.0))
    bob = vec(0, 0, 0.004 * np.sin(who.beat + 2.0 * np.pi * time / 17.0))
    yaw, pitch, roll = (float(angle) for angle in chest)
    return Stance(
        hips=hips[:3] + bob,
        hip_yaw=float(hips[3]),
        chest=(yaw, pitch + 0.008 * breath, roll),
        grip=sword[:3],
        blade=unit(sword[3:]),
        off_hand=hips[:3] + bob + who.off_hand.at(time),
        soles=(right, left),
        foot_yaw=(right_yaw, left_yaw),
        foot_pitch=(right_pitch, left_pitch),
        look=vec(1, 0, 1.5),
        breath=breath,
        tail=_tail(who, time),
    )


def _tail(who: Performer, time: float) -> Floats:
    """Where loose hair hangs: down, and against the recent acceleration of the trunk."""
    before, now = who.hips.at(max(time - TAIL_LAG, 0.0)), who.hips.at(time)
    later = who.hips.at(min(time + 1.0, END))
    drag = 1.6 * (before[:3] - later[:3])
    swing = 0.8 * (before[3] - now[3])
    back = turn(float(now[3])) @ vec(-0.12, swing, 0.0)
    return unit(vec(0, 0, -1.0) + vec(float(drag[0]), float(drag[1]), 0.0) + back)


def _into_world(stance: Stance, heading: float, look: Floats) -> Stance:
    """The stance turned with its stage."""
    spin = turn(heading)
    yaw, pitch, roll = stance.chest
    return replace(
        stance,
        hips=spin @ stance.hips,
        hip_yaw=stance.hip_yaw + heading,
        chest=(yaw + heading, pitch, roll),
        grip=spin @ stance.grip,
        blade=spin @ stance.blade,
        off_hand=spin @ stance.off_hand,
        soles=(spin @ stance.soles[0], spin @ stance.soles[1]),
        foot_yaw=(stance.foot_yaw[0] + heading, stance.foot_yaw[1] + heading),
        look=look,
        tail=spin @ stance.tail,
    )
