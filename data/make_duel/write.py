"""Writes the captures, the scenes and the truth."""

from __future__ import annotations

import json
from pathlib import Path

import DracoPy
import numpy as np

from .capture import Clock, relative_pose
from .duel import SEGMENTS, Segment
from .vectors import Floats, Ints

BITS = 12
BODY_STEP, SWORD_STEP = 0.0005, 0.00025  # m
CUTS = {"short": (1, 2, 3), "demo": (1, 2)}  # the segments of the smaller scenes
COARSE = "[search]\nstep = 0.02\nyaw_step = 4\n"  # their search: the demo is to take less than a minute
LEAD = 4  # frames before the first and after the last of them


def write_mesh(path: Path, vertices: Floats, faces: Ints, step: float) -> None:
    """One Draco file, vertices on whole multiples of `step` (m)."""
    origin = np.floor(vertices.min(axis=0) / step) * step
    span = step * (2**BITS - 1)
    if float((vertices.max(axis=0) - origin).max()) > span:
        raise ValueError(f"{path.name}: expected at most {span:.2f} m across, got {np.ptp(vertices, axis=0).max():.2f}")
    packed = DracoPy.encode(
        vertices,
        faces.astype(np.uint32),
        quantization_bits=BITS,
        compression_level=10,
        quantization_range=span,
        quantization_origin=origin,
    )
    path.write_bytes(packed)


def write_track(path: Path, lines: list[str]) -> None:
    """A joint track."""
    path.write_text("\n".join(["frame,joint,x,y,z", *lines]) + "\n")


def write_truth(path: Path, clocks: dict[str, Clock]) -> None:
    """Where Ben really stood, and what really held there."""
    x, y, yaw = relative_pose()
    segments = [
        {
            "name": segment.name,
            "interaction": segment.interaction,
            "parts": {"anna": segment.anna, "ben": segment.ben},
            "frames": {who: list(clocks[who].segments[index]) for who in ("anna", "ben")},
        }
        for index, segment in enumerate(SEGMENTS)
    ]
    frames = {who: len(clocks[who].times) for who in ("anna", "ben")}
    truth = {"relative": {"x": x, "y": y, "yaw": yaw}, "fps": 25, "frames": frames, "segments": segments}
    path.write_text(json.dumps(truth, indent=1) + "\n")


def write_scenes(folder: Path, clocks: dict[str, Clock], made: int) -> None:
    """The whole scene, and smaller ones over the same captures; `made` frames of each are there."""
    there = [i for i in range(len(SEGMENTS)) if all(clocks[who].segments[i][1] < made for who in clocks)]
    (folder / "scene.toml").write_text(_scene("duel", clocks, there, short=False))
    for name, chosen in CUTS.items():
        if set(chosen) <= set(there):
            (folder / f"{name}.toml").write_text(_scene(f"duel-{name}", clocks, list(chosen), short=True))


def _scene(name: str, clocks: dict[str, Clock], chosen: list[int], *, short: bool) -> str:
    """A scene file."""
    subjects = []
    for who in ("anna", "ben"):
        ranges = [clocks[who].segments[i] for i in chosen]
        cut = f"frames = [{ranges[0][0] - LEAD}, {ranges[-1][1] + LEAD}]\n" if short else ""
        subjects.append(_subject(who, cut))
    segments = [_segment(SEGMENTS[i], {who: clocks[who].segments[i] for who in clocks}) for i in chosen]
    search = [COARSE] if short else []
    return "\n".join([f'version = 1\nname = "{name}"\nfps = 25\n', *subjects, *segments, *search])


def _subject(who: str, cut: str) -> str:
    """One subject of a scene file."""
    return f"""[subjects.{who}]
path = "{who}"
{cut}fps = 25
units = "m"
up = "z"
facing = "{who}.csv"
gaze = {{eye = "{who}.csv", target = "{who}.csv"}}
[subjects.{who}.parts]
sword = {{path = "{who}_sword"}}
right_hand = {{track = "{who}.csv", joint = "right_hand", radius = 0.11}}
head = {{track = "{who}.csv", joint = "Head", radius = 0.16}}
"""


def _segment(segment: Segment, frames: dict[str, tuple[int, int]]) -> str:
    """One key segment of a scene file."""
    a, b = frames["anna"], frames["ben"]
    return f"""[[segments]]
name = "{segment.name}"
between = ["anna", "ben"]
frames = {{anna = [{a[0]}, {a[1]}], ben = [{b[0]}, {b[1]}]}}
interaction = "{segment.interaction}"
parts = {{anna = "{segment.anna}", ben = "{segment.ben}"}}
visibility = {"{half_angle = 40}" if segment.visibility else "false"}
tolerance = {{frames = 2, voxels = 2, depth = 0.03, apart = 0.02}}
"""
