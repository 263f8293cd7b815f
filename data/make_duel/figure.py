"""The two people: their proportions, and where their joints are in a given stance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .vectors import UP, Floats, bend, smoothstep, turn, unit, vec

ANKLE = 0.078  # m, above the sole
GRIP_TO_WRIST = 0.078  # m


@dataclass(frozen=True, slots=True)
class Figure:
    """One person's proportions."""

    name: str
    height: float  # m
    girth: float  # limbs and trunk, about 1
    shoulder: float  # half the breadth between the shoulder joints, in heights
    hip: float  # half the breadth between the hip joints, in heights
    bust: float  # 0 or 1
    head: float  # size of the head, about 1
    ponytail: bool
    beard: bool


ANNA = Figure("anna", 1.69, 0.93, 0.098, 0.055, 1.0, 0.96, True, False)
BEN = Figure("ben", 1.84, 1.05, 0.112, 0.050, 0.0, 1.02, False, True)


@dataclass(frozen=True, slots=True, eq=False)
class Stance:
    """What an instant of the choreography fixes, in the world; the rest follows."""

    hips: Floats  # (3,) m, between the hip joints
    hip_yaw: float  # rad
    chest: tuple[float, float, float]  # yaw, pitch (forward), roll, rad
    grip: Floats  # (3,) m, centre of the sword's grip
    blade: Floats  # (3,) unit, from grip to point
    off_hand: Floats  # (3,) m, the free wrist
    soles: tuple[Floats, Floats]  # right and left, (3,) m under the ankle
    foot_yaw: tuple[float, float]  # rad
    foot_pitch: tuple[float, float]  # rad, positive lifts the heel
    look: Floats  # (3,) m, what the eyes are on
    breath: float  # -1..1
    tail: Floats  # (3,) unit, where the ponytail hangs to


@dataclass(frozen=True, slots=True, eq=False)
class Posed:
    """Joints (3,) m and bone frames (3, 3) of one instant."""

    joints: dict[str, Floats]
    frames: dict[str, Floats]
    stance: Stance
    short: float  # m, by how much the sword arm missed its grip

    def at(self, frame: str, joint: str, x: float, y: float, z: float) -> Floats:
        """A point given in a bone's frame, relative to a joint."""
        return np.asarray(self.joints[joint] + self.frames[frame] @ vec(x, y, z))


def pose(figure: Figure, stance: Stance) -> Posed:
    """All joints and bone frames of a person in a stance."""
    frames = _trunk_frames(stance)
    joints = _trunk_joints(figure, stance, frames)
    _add_head(figure, stance, joints, frames)
    for side, index in (("right", 0), ("left", 1)):
        _add_leg(figure, stance, joints, frames, side, index)
    short = _add_sword_arm(figure, stance, joints, frames)
    _add_free_arm(figure, stance, joints, frames)
    return Posed(joints, frames, stance, short)


def _trunk_frames(stance: Stance) -> dict[str, Floats]:
    """Pelvis, waist and chest."""
    yaw, pitch, roll = stance.chest
    pelvis = turn(stance.hip_yaw, 0.4 * pitch, 0.3 * roll)
    waist = turn(0.5 * (stance.hip_yaw + yaw), 0.7 * pitch, 0.65 * roll)
    return {"pelvis": pelvis, "waist": waist, "chest": turn(yaw, pitch, roll)}


def _trunk_joints(figure: Figure, stance: Stance, frames: dict[str, Floats]) -> dict[str, Floats]:
    """Hips, spine, neck, shoulders and hip joints before arms and legs pull on them."""
    h = figure.height
    spine = stance.hips + frames["pelvis"] @ vec(0, 0, 0.10 * h)
    joints = {"Hips": stance.hips, "Spine": spine, "Neck": spine + frames["chest"] @ vec(-0.004 * h, 0, 0.207 * h)}
    for side, sign in (("right", -1.0), ("left", 1.0)):
        joints[f"{side}_hip"] = stance.hips + frames["pelvis"] @ vec(0, sign * figure.hip * h, -0.012 * h)
        joints[f"{side}_shoulder"] = spine + frames["chest"] @ vec(-0.004 * h, sign * figure.shoulder * h, 0.180 * h)
    return joints


def _add_head(figure: Figure, stance: Stance, joints: dict[str, Floats], frames: dict[str, Floats]) -> None:
    """Head, turned to what it looks at as far as the neck allows, and the eyes."""
    h, size = figure.height, figure.head
    lean = unit(0.55 * frames["chest"][:, 2] + 0.45 * UP)
    head = joints["Neck"] + lean * 0.098 * h + frames["chest"] @ vec(0.012 * h, 0, 0)
    yaw, pitch, _ = stance.chest
    gaze = stance.look - head
    wanted = float(np.arctan2(gaze[1], gaze[0])) - yaw
    wanted = (wanted + np.pi) % (2.0 * np.pi) - np.pi
    dip = -float(np.arctan2(gaze[2], np.hypot(gaze[0], gaze[1])))
    dip = float(np.clip(dip, 0.55 * pitch - 0.7, pitch + 0.6))
    frames["head"] = turn(yaw + float(np.clip(wanted, -1.25, 1.25)), dip)
    joints["Head"] = head
    joints["eye"] = head + frames["head"] @ vec(0.088 * size, 0, 0.003)
    joints["target"] = joints["eye"] + frames["head"] @ vec(2.0, 0, 0)


def _add_leg(
    figure: Figure, stance: Stance, joints: dict[str, Floats], frames: dict[str, Floats], side: str, index: int
) -> None:
    """Knee, ankle and foot; the knee bends over the toes."""
    h = figure.height
    frames[f"{side}_foot"] = foot = turn(stance.foot_yaw[index], stance.foot_pitch[index])
    ankle = _ankle(stance, index, h / 1.75)
    hint = turn(stance.foot_yaw[index]) @ vec(1, 0, 0.12) + 0.35 * frames["pelvis"][:, 0]
    knee, end = bend(joints[f"{side}_hip"], ankle, leg_lengths(figure), hint)
    joints[f"{side}_knee"], joints[f"{side}_ankle"] = knee, end
    joints[f"{side}_foot"] = end + foot @ vec(0.12, 0, -0.05) * (h / 1.75)


def _ankle(stance: Stance, index: int, size: float) -> Floats:
    """The ankle above its sole; a lifted heel turns the foot about its ball."""
    yaw, pitch = stance.foot_yaw[index], stance.foot_pitch[index]
    toes = turn(yaw) @ vec(0.12 if pitch > 0 else -0.05, 0, 0) * size
    rise = vec(0, 0, ANKLE * size) - toes
    tilted = turn(yaw, pitch) @ (turn(-yaw) @ rise)
    return np.asarray(stance.soles[index] + toes + tilted)


def leg_lengths(figure: Figure) -> tuple[float, float]:
    """Thigh and shank, m."""
    return 0.247 * figure.height, 0.242 * figure.height


def arm_lengths(figure: Figure) -> tuple[float, float]:
    """Upper arm and forearm, m."""
    return 0.176 * figure.height, 0.152 * figure.height


def lower_hips(figure: Figure, stance: Stance) -> float:
    """By how much (m) the hips must sink for both feet to stay where they are."""
    reach = 0.992 * sum(leg_lengths(figure))
    sink = 0.0
    for index, sign in ((0, -1.0), (1, 1.0)):
        pelvis = turn(stance.hip_yaw, 0.4 * stance.chest[1], 0.3 * stance.chest[2])
        hip = stance.hips + pelvis @ vec(0, sign * figure.hip * figure.height, -0.012 * figure.height)
        gap = hip - _ankle(stance, index, figure.height / 1.75)
        flat = float(gap[0] ** 2 + gap[1] ** 2)
        highest = float(np.sqrt(max(reach**2 - flat, 0.01)))
        sink = max(sink, float(gap[2]) - highest)
    return sink


def _shrug(figure: Figure, shoulder: Floats, wrist: Floats) -> Floats:
    """The shoulder as the shoulder blade moves it towards a far hand."""
    reach = wrist - shoulder
    stretch = float(np.sqrt(reach @ reach)) / sum(arm_lengths(figure))
    return np.asarray(shoulder + unit(reach) * (0.034 * figure.height * smoothstep((stretch - 0.6) / 0.5)))


def _add_sword_arm(figure: Figure, stance: Stance, joints: dict[str, Floats], frames: dict[str, Floats]) -> float:
    """Right arm and fist: the wrist sits square to the blade, a little behind it."""
    blade = unit(stance.blade)
    back = unit(joints["right_shoulder"] + vec(0, 0, -0.18) - stance.grip)
    across = back - blade * (back @ blade) + 0.30 * (vec(0, 0, -1) + blade * blade[2])
    toward_wrist = unit(0.9 * unit(across) - 0.42 * blade)
    wrist = stance.grip + toward_wrist * GRIP_TO_WRIST
    shoulder = _shrug(figure, joints["right_shoulder"], wrist)
    hint = turn(stance.chest[0]) @ vec(-0.32, -0.05, -0.95)
    elbow, end = bend(shoulder, wrist, arm_lengths(figure), hint)
    joints.update(right_shoulder=shoulder, right_elbow=elbow, right_wrist=end, right_hand=stance.grip + end - wrist)
    frames["fist"] = frame_of_fist(blade, toward_wrist)
    miss = end - wrist
    return float(np.sqrt(miss @ miss))


def frame_of_fist(blade: Floats, toward_wrist: Floats) -> Floats:
    """Columns: away from the wrist (where the edge points), across, along the blade."""
    edge = unit(-(toward_wrist - blade * (toward_wrist @ blade)))
    return np.column_stack([edge, np.cross(blade, edge), blade])


def _add_free_arm(figure: Figure, stance: Stance, joints: dict[str, Floats], frames: dict[str, Floats]) -> None:
    """Left arm; the hand carries the forearm on."""
    shoulder = _shrug(figure, joints["left_shoulder"], stance.off_hand)
    hint = frames["chest"] @ vec(-0.85, 0.1, -0.4)
    elbow, wrist = bend(shoulder, stance.off_hand, arm_lengths(figure), hint)
    along = unit(wrist - elbow)
    joints.update(left_shoulder=shoulder, left_elbow=elbow, left_wrist=wrist, left_hand=wrist + along * 0.08)
