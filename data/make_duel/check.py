"""Checks the captures on the files alone: placed at the true pose, does every segment do what it says?

Run it by itself with `python -m data.make_duel.check [FOLDER]`. Nothing of the generator is used here.
"""

from __future__ import annotations

import json
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
import numpy.typing as npt
import open3d as o3d
from scipy.ndimage import binary_dilation, generate_binary_structure, iterate_structure
from scipy.spatial import cKDTree

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Mesh = tuple[Floats, npt.NDArray[np.int32]]

VOXEL = 0.01  # m
PAD = 0.03  # m


@dataclass(frozen=True, slots=True)
class SegmentCheck:
    """What one key segment does at the true pose."""

    name: str
    interaction: str
    frames: tuple[int, int]  # Anna's, Ben's, how many
    contact: tuple[int, ...]  # aligned frames in which the interest parts share a voxel
    shared: int  # voxels both sweep
    holds: bool


@dataclass(frozen=True, slots=True)
class Clearance:
    """Least distances (m) over some aligned frames; negative: inside."""

    name: str
    bodies: float
    sword_a: float  # Anna's sword to Ben's body
    sword_b: float
    blades: float
    own: float  # either blade to its own body
    floor: tuple[float, float]  # lowest and highest of the lowest points


@dataclass(frozen=True, slots=True)
class Outcome:
    """Everything that was checked."""

    segments: tuple[SegmentCheck, ...]
    clearances: tuple[Clearance, ...]


def check_folder(folder: Path) -> Outcome:
    """Checks every segment of `scene.toml` and the clearances of all frames."""
    scene = tomllib.loads((folder / "scene.toml").read_text())
    relative = json.loads((folder / "truth.json").read_text())["relative"]
    segments = []
    for segment in scene["segments"]:
        segments.append(_check_segment(folder, segment, relative))
        print(f"\rchecked {segment['name']}          ", end="", file=sys.stderr, flush=True)
    clearances = [_clearance(folder, name, pairs, relative) for name, pairs in _spans(folder, scene["segments"])]
    print(file=sys.stderr)
    return Outcome(tuple(segments), tuple(clearances))


def align(a: tuple[int, int], b: tuple[int, int]) -> list[tuple[int, int]]:
    """Pairs of frames of two inclusive ranges, brought to the shorter one's length, ends on ends."""
    length = min(a[1] - a[0], b[1] - b[0])

    def pick(span: tuple[int, int], m: int) -> int:
        """The frame shown at m."""
        return span[0] + round(m * (span[1] - span[0]) / length) if length else span[0]

    return [(pick(a, m), pick(b, m)) for m in range(length + 1)]


def read(folder: Path, part: str, frame: int, relative: dict[str, float] | None = None) -> Mesh:
    """One mesh, moved into Anna's capture frame if a pose is given."""
    mesh = DracoPy.decode((folder / part / f"{part}_{frame:04d}.drc").read_bytes())
    vertices = np.asarray(mesh.points, dtype=np.float64)
    if relative:
        c, s = np.cos(relative["yaw"]), np.sin(relative["yaw"])
        vertices = vertices @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + [relative["x"], relative["y"], 0.0]
    return vertices, np.asarray(mesh.faces, dtype=np.int32)


def signed_distance(mesh: Mesh, points: Floats) -> Floats:
    """Distance (N,) m of points from a closed mesh, negative inside."""
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(mesh[0].astype(np.float32)), o3d.core.Tensor.from_numpy(mesh[1].astype(np.uint32))
    )
    asked = o3d.core.Tensor.from_numpy(points.astype(np.float32))
    inside = scene.compute_occupancy(asked, nthreads=1, nsamples=3).numpy() > 0.5
    distance = scene.compute_distance(asked, nthreads=1).numpy().astype(np.float64)
    return np.asarray(np.where(inside, -distance, distance))


def _check_segment(folder: Path, segment: dict[str, Any], relative: dict[str, float]) -> SegmentCheck:
    """Brute force over all voxels that both parts could sweep."""
    frames, parts = segment["frames"], segment["parts"]
    pairs = align(tuple(frames["anna"]), tuple(frames["ben"]))
    part_a, part_b = (who if parts[who] == "body" else f"{who}_{parts[who]}" for who in ("anna", "ben"))
    a = [read(folder, part_a, i) for i, _ in pairs]
    b = [read(folder, part_b, j, relative) for _, j in pairs]
    low, high = _common_box(a, b)
    lengths = (frames["anna"][1] - frames["anna"][0] + 1, frames["ben"][1] - frames["ben"][0] + 1)
    if (high <= low).any():
        return SegmentCheck(segment["name"], segment["interaction"], lengths, (), 0, segment["interaction"] == "none")
    axes = [np.arange(np.floor(lo / VOXEL), np.ceil(hi / VOXEL) + 1) * VOXEL for lo, hi in zip(low, high, strict=True)]
    filled_a = np.stack([_voxels(mesh, axes) for mesh in a])
    filled_b = np.stack([_voxels(mesh, axes) for mesh in b])
    tolerance = segment["tolerance"]
    holds = TYPES[segment["interaction"]](filled_a, filled_b, tolerance["frames"], tolerance["voxels"])
    contact = tuple(int(i) for i in np.flatnonzero((filled_a & filled_b).any(axis=(1, 2, 3))))
    shared = int((filled_a.any(axis=0) & filled_b.any(axis=0)).sum())
    return SegmentCheck(segment["name"], segment["interaction"], lengths, contact, shared, holds)


def _common_box(a: list[Mesh], b: list[Mesh]) -> tuple[Floats, Floats]:
    """Corners of the box in which both could be."""
    boxes = [(np.min([v.min(0) for v, _ in s], axis=0), np.max([v.max(0) for v, _ in s], axis=0)) for s in (a, b)]
    return np.maximum(boxes[0][0], boxes[1][0]) - PAD, np.minimum(boxes[0][1], boxes[1][1]) + PAD


def _voxels(mesh: Mesh, axes: list[Floats]) -> Bools:
    """Which voxels a mesh fills: centre inside it, or within half a voxel of its surface."""
    filled = np.zeros([len(axis) for axis in axes], dtype=np.bool_)
    box = zip(axes, mesh[0].min(axis=0) - VOXEL, mesh[0].max(axis=0) + VOXEL, strict=True)
    near = [np.flatnonzero((axis >= lo) & (axis <= hi)) for axis, lo, hi in box]
    if all(len(n) for n in near):
        grid = np.stack(np.meshgrid(*[axis[n] for axis, n in zip(axes, near, strict=True)], indexing="ij"), axis=-1)
        distance = signed_distance(mesh, grid.reshape(-1, 3))
        filled[np.ix_(*near)] = (distance <= 0.5 * VOXEL).reshape(grid.shape[:3])
    return filled


def _first(filled: Bools) -> npt.NDArray[np.int64]:
    """t_start of every voxel; past the end where it is never filled."""
    return np.where(filled.any(axis=0), filled.argmax(axis=0), len(filled) + 99)


def _last(filled: Bools) -> npt.NDArray[np.int64]:
    """t_end of every voxel; -99 where it is never filled."""
    return np.where(filled.any(axis=0), len(filled) - 1 - filled[::-1].argmax(axis=0), -99)


def _near(a: Bools, b: Bools, voxels: int) -> bool:
    """Whether two voxel sets come within so many voxels."""
    if not voxels:
        return bool((a & b).any())
    star = iterate_structure(generate_binary_structure(3, 3), voxels)
    return bool((a & binary_dilation(b, star)).any())


def _timed(start_a: str, start_b: str) -> Callable[[Bools, Bools, int, int], bool]:
    """The types that ask for the end (+) or start (-) of either motion, or nothing (0)."""

    def good(filled: Bools, sign: str, slack: int) -> Bools:
        """Filled voxels that have the asked time."""
        ever = filled.any(axis=0)
        late, early = _last(filled) >= len(filled) - 1 - slack, _first(filled) <= slack
        return np.asarray(ever & {"+": late, "-": early, "0": ever}[sign])

    def holds(a: Bools, b: Bools, slack: int, voxels: int) -> bool:
        """Some near pair, and all shared voxels."""
        good_a, good_b = good(a, start_a, slack), good(b, start_b, slack)
        shared = a.any(axis=0) & b.any(axis=0)
        return _near(good_a, good_b, voxels) and bool((good_a & good_b)[shared].all())

    return holds


def _always(a: Bools, b: Bools, slack: int, voxels: int) -> bool:
    """0&0a: in touch in every frame but the first and last few."""
    return all(_near(x, y, voxels) for x, y in zip(a[slack : len(a) - slack], b[slack : len(b) - slack], strict=True))


def _sometimes(a: Bools, b: Bools, slack: int, voxels: int) -> bool:
    """0&0b: in touch in some frame."""
    return any(_near(x, y, voxels) for x, y in zip(a, b, strict=True))


def _passes(a: Bools, b: Bools, slack: int, voxels: int) -> bool:
    """0&0c: one passes, later, where the other has been."""
    shared = a.any(axis=0) & b.any(axis=0)
    a_later, b_later = _first(a) > _last(b) - slack, _first(b) > _last(a) - slack
    return bool(shared.any() and (a_later[shared].all() or b_later[shared].all()))


def _never(a: Bools, b: Bools, slack: int, voxels: int) -> bool:
    """None: no shared voxel in any frame."""
    return not (a & b).any()


TYPES: dict[str, Callable[[Bools, Bools, int, int], bool]] = {
    **{f"{a}&{b}": _timed(a, b) for a in "+-0" for b in "+-0" if (a, b) != ("0", "0")},
    "0&0a": _always,
    "0&0b": _sometimes,
    "0&0c": _passes,
    "none": _never,
}


def _spans(folder: Path, segments: list[dict[str, Any]]) -> list[tuple[str, list[tuple[int, int]]]]:
    """Aligned frame pairs of every key and transitional segment between the first and the last."""
    spans, before = [], None
    for segment in segments:
        a, b = tuple(segment["frames"]["anna"]), tuple(segment["frames"]["ben"])
        if before is None:
            before = (a[0] - min(a[0], b[0]) - 1, b[0] - min(a[0], b[0]) - 1)
        if a[0] - before[0] > 1:
            spans.append(("  between", align((before[0] + 1, a[0] - 1), (before[1] + 1, b[0] - 1))))
        spans.append((segment["name"], align((a[0], a[1]), (b[0], b[1]))))
        before = (a[1], b[1])
    counts = [len(list((folder / who).glob("*.drc"))) for who in ("anna", "ben")]
    if before and all(count > last + 1 for count, last in zip(counts, before, strict=True)):
        rest = min(counts[0] - before[0], counts[1] - before[1]) - 2
        spans.append(("  after", align((before[0] + 1, before[0] + 1 + rest), (before[1] + 1, before[1] + 1 + rest))))
    return spans


def _clearance(folder: Path, name: str, pairs: list[tuple[int, int]], relative: dict[str, float]) -> Clearance:
    """The least distances over some aligned frames."""
    print(f"\rclearance {name}          ", end="", file=sys.stderr, flush=True)
    rows = np.array([_distances(folder, i, j, relative) for i, j in pairs])
    least, most = rows.min(axis=0), rows.max(axis=0)
    bodies, sword_a, sword_b, blades, own, floor = (float(d) for d in least)
    return Clearance(name, bodies, sword_a, sword_b, blades, own, (floor, float(most[5])))


def _distances(folder: Path, i: int, j: int, relative: dict[str, float]) -> tuple[float, ...]:
    """Bodies, swords to the other's body, blades, blade to own body and lowest point, in one frame."""
    a, b = read(folder, "anna", i), read(folder, "ben", j, relative)
    sword_a, sword_b = read(folder, "anna_sword", i), read(folder, "ben_sword", j, relative)
    bodies = float(np.min(cKDTree(a[0]).query(b[0])[0]))
    own = min(_blade_gap(sword_a, a), _blade_gap(sword_b, b))
    blades = min(float(signed_distance(sword_a, sword_b[0]).min()), float(signed_distance(sword_b, sword_a[0]).min()))
    lowest = max(float(a[0][:, 2].min()), float(b[0][:, 2].min()))
    across = (float(signed_distance(b, sword_a[0]).min()), float(signed_distance(a, sword_b[0]).min()))
    return bodies, *across, blades, own, lowest


def _blade_gap(sword: Mesh, body: Mesh) -> float:
    """Distance of the blade, without hilt and hand's breadth of the forte, to the body."""
    heights = (sword[0] - sword[0].mean(axis=0)) @ np.linalg.svd(sword[0] - sword[0].mean(axis=0))[2][0]
    order = heights * (1.0 if abs(heights.max()) > abs(heights.min()) else -1.0)
    return float(signed_distance(body, sword[0][order > order.min() + 0.26]).min())


def table(outcome: Outcome) -> str:
    """What was found, as text."""
    lines = ["segment               type   frames   in contact   shared voxels  holds"]
    for s in outcome.segments:
        when = f"{s.contact[0]}..{s.contact[-1]} ({len(s.contact)})" if s.contact else "-"
        counts = f"{s.frames[0]}+{s.frames[1]}"
        lines.append(f"{s.name:21} {s.interaction:6} {counts:8} {when:12} {s.shared:13}  {'yes' if s.holds else 'NO'}")
    lines += ["", "least distance, mm    bodies  A's sword/B  B's sword/A  blades  own blade  lowest point"]
    for c in outcome.clearances:
        mm = [round(1000 * d) for d in (c.bodies, c.sword_a, c.sword_b, c.blades, c.own)]
        floor = f"{1000 * c.floor[0]:.1f}..{1000 * c.floor[1]:.1f}"
        lines.append(f"{c.name:21} {mm[0]:6} {mm[1]:12} {mm[2]:12} {mm[3]:7} {mm[4]:10}  {floor}")
    return "\n".join(lines)


if __name__ == "__main__":
    found = check_folder(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent.parent / "duel")
    print(table(found))
    sys.exit(0 if all(segment.holds for segment in found.segments) else 1)
