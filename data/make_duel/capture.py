"""Pulls the fight apart: each fencer gets a world frame and a clock of their own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from .duel import SEGMENTS
from .figure import Posed
from .vectors import Floats, Ints, turn, unit, vec

SEED = 20
FIRST = {"anna": 4.0, "ben": 7.0}  # frame of the fight at which each recording starts
LAST = {"anna": 428.0, "ben": 426.0}
# how many frames more Ben's recording has of what lies before, between and after the key segments
TRANSITIONS = (0, 3, 0, -3, 3, -3, 2, -2, 0, 3)
JOINTS = (
    "Hips Spine Neck Head right_shoulder left_shoulder right_elbow left_elbow right_wrist left_wrist right_hand "
    "left_hand right_hip left_hip right_knee left_knee right_ankle left_ankle right_foot left_foot eye target"
).split()


@dataclass(frozen=True, slots=True, eq=False)
class Clock:
    """Which time of the fight each captured frame shows, and where the key segments lie in the capture."""

    times: Floats  # (T,) frames of the fight
    segments: tuple[tuple[int, int], ...]  # inclusive


def clock(name: str) -> Clock:
    """Anna's recording runs with the fight's clock, Ben's a little slower here and faster there."""
    more = [segment.stretch for segment in SEGMENTS] if name == "ben" else [0] * len(SEGMENTS)
    between = TRANSITIONS if name == "ben" else (0,) * len(TRANSITIONS)
    knots, here, now, ranges = [(0, FIRST[name])], 0, FIRST[name], []
    for segment, extra, gap in zip(SEGMENTS, more, between, strict=False):
        start = here + int(segment.start - now) + gap
        stop = start + segment.stop - segment.start + extra
        ranges.append((start, stop))
        inside = np.linspace(0.0, 1.0, 5)
        knots += [(start + u * (stop - start), segment.start + u * (segment.stop - segment.start)) for u in inside]
        here, now = stop, float(segment.stop)
    end = here + int(LAST[name] - now) + between[-1]
    table = np.array([*knots, (end, LAST[name])])
    return Clock(np.asarray(PchipInterpolator(table[:, 0], table[:, 1])(np.arange(end + 1))), tuple(ranges))


def capture_from_world(name: str) -> tuple[float, Floats]:
    """Yaw (rad) and shift (3,) m of a fencer's own world frame: p_capture = Rz(yaw) p_world + shift."""
    rng = np.random.default_rng((SEED, 1 if name == "anna" else 2))
    x, y, yaw = rng.uniform((-1.5, -1.5, -np.pi), (1.5, 1.5, np.pi))
    return float(yaw), vec(float(x), float(y), 0.0)


def relative_pose() -> tuple[float, float, float]:
    """The truth: x, y (m) and yaw (rad) of Ben's capture frame in Anna's."""
    (yaw_a, shift_a), (yaw_b, shift_b) = capture_from_world("anna"), capture_from_world("ben")
    yaw = (yaw_a - yaw_b + np.pi) % (2.0 * np.pi) - np.pi
    shift = shift_a - turn(yaw) @ shift_b
    return float(shift[0]), float(shift[1]), float(yaw)


def place(points: Floats, name: str) -> Floats:
    """World points (N, 3) in a fencer's capture frame."""
    yaw, shift = capture_from_world(name)
    return np.asarray(points @ turn(yaw).T + shift)


def sword_mesh(posed: Posed, rest: tuple[Floats, Ints], *, seed: tuple[int, ...], noise: float) -> tuple[Floats, Ints]:
    """The sword in the fist, rolled about itself at random so that no two frames share vertices."""
    vertices, faces = rest
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(vertices))
    rank = np.argsort(order)
    moved = vertices @ posed.frames["fist"].T + posed.joints["right_hand"]
    moved = moved + rng.normal(0.0, noise, moved.shape)
    return moved[order], rank[faces].astype(np.int32)


def joint_rows(posed: Posed, name: str, frame: int) -> list[str]:
    """The lines of a track file for one frame, `facing` as a unit vector."""
    points = place(np.array([posed.joints[joint] for joint in JOINTS]), name)
    yaw, _ = capture_from_world(name)
    ahead = posed.frames["pelvis"][:, 0] + posed.frames["chest"][:, 0] + 2.0 * posed.frames["head"][:, 0]
    facing = turn(yaw) @ unit(ahead * vec(1, 1, 0))
    rows = [*zip(JOINTS, points, strict=True), ("facing", facing)]
    return [f"{frame},{joint},{x:.4f},{y:.4f},{z:.4f}" for joint, (x, y, z) in rows]
