"""Subjects where they stand in one frame of a scene, and how every two of them stand to each other.

Between frames only placement can be interpolated, meshes cannot (their connectivity is their own): a sub-step shows
both subjects' meshes of the nearer frame at the placements in between. So it sees people pushed through each other by
the edit's own motion; it does not see a limb that passes through another between two frames of the captures.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.geometry.planar import apply_pose, compose, invert, wrap_angle
from mhvedit.scene.edit import EditedScene
from mhvedit.scene.report import PairReport
from mhvedit.scene.surfaces import Clearance, Surface, boxes_apart, clearance, open_surface
from mhvedit.sequences.meshes import BODY, Mesh, MeshSequence, joined

STILL: Final = 1e-9  # m and rad: placements that differ by less are the same

Pair = tuple[str, str]


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """A subject in one frame: all that is solid about it, in the world."""

    name: str
    number: int  # of the captured frame
    captured: Mesh  # the body, in the capture's frame
    mesh: Mesh  # body and things held, in the world
    owners: Int32Array  # (V,) index into solids
    solids: tuple[str, ...]  # `body`, and things held
    low: FloatArray  # (3,) m
    high: FloatArray  # (3,) m


@dataclass(frozen=True, slots=True, eq=False)
class PairFrame:
    """Two subjects in one frame; `sub_steps`: after which frame and how far apart, for those nearest to this one."""

    gap: float  # m, negative: how deep; inf where far
    crossing: bool
    point: FloatArray  # (3,) m, in the world; NaN where far
    solids: Pair | None
    sub_steps: tuple[tuple[int, float], ...]


def stand(
    scene: EditedScene, name: str, frame: int, *, capture: MeshSequence, held: Mapping[str, MeshSequence]
) -> Standing:
    """A subject with the things that it holds, where it stands.

    Args:
        scene: the edit.
        name: of the subject.
        frame: of the scene.
        capture: of the subject.
        held: things with meshes of their own, by name, in the capture's frame and numbering.
    """
    edit = scene.subjects[name]
    number = int(edit.source[frame])
    body = capture.mesh(number)
    meshes = [body, *(sequence.mesh(number) for sequence in held.values())]
    whole = joined(meshes)
    vertices = apply_pose(edit.placements[frame], whole.vertices)
    owners = np.repeat(np.arange(len(meshes), dtype=np.int32), [len(m.vertices) for m in meshes])
    low, high = vertices.min(0), vertices.max(0)
    return Standing(name, number, body, Mesh(vertices, whole.faces), owners, (BODY, *held), low, high)


def pair_clearances(
    stood: Mapping[str, Standing], *, reach: float, workers: int
) -> tuple[dict[Pair, Clearance | None], dict[str, Surface]]:
    """How all pairs stand to each other, None where their boxes are out of reach; and the surfaces opened for it.

    Args:
        stood: subjects in one frame.
        reach: m, wider gaps are not measured.
        workers: threads.
    """
    found: dict[Pair, Clearance | None] = {}
    opened: dict[str, Surface] = {}
    for a, b in combinations(stood.values(), 2):
        found[a.name, b.name] = None
        if boxes_apart(a.low, a.high, b.low, b.high) < reach:
            for solid in (a, b):
                if solid.name not in opened:
                    opened[solid.name] = open_surface(solid.mesh, workers=workers)
            found[a.name, b.name] = clearance(opened[a.name], opened[b.name], reach=reach)
    return found, opened


def pair_frame(
    a: Standing, b: Standing, found: Clearance | None, sub_steps: tuple[tuple[int, float], ...]
) -> PairFrame:
    """What to keep of a clearance.

    Args:
        a: first subject.
        b: second.
        found: how they stand to each other.
        sub_steps: see `sub_step_gaps`.
    """
    if found is None:
        return PairFrame(np.inf, False, np.full(3, np.nan), None, sub_steps)
    solids = None
    if np.isfinite(found.gap) and min(found.corner_a, found.corner_b) >= 0:
        solids = a.solids[a.owners[found.corner_a]], b.solids[b.owners[found.corner_b]]
    return PairFrame(found.gap, found.crossing, found.point, solids, sub_steps)


def sub_step_gaps(
    scene: EditedScene,
    pair: tuple[Standing, Standing],
    frame: int,
    *,
    opened: Mapping[str, Surface],
    n_steps: int,
    reach: float,
    workers: int,
) -> Iterator[tuple[int, float]]:
    """Gaps at the sub-steps that are nearer to this frame than to another, where the pair's relative placement differs.

    Args:
        scene: the edit.
        pair: two subjects in this frame.
        frame: of the scene.
        opened: surfaces of this frame that are open already.
        n_steps: sub-steps between two frames.
        reach: m, wider gaps are not measured.
        workers: threads.

    Yields:
        The frame that the sub-step follows, and the gap, m; nothing for those out of reach.
    """
    a, b = pair
    edits = [scene.subjects[solid.name].placements for solid in pair]
    a_from_b = compose(invert(edits[0][frame]), edits[1][frame])
    for step, part in _sub_steps(frame, scene.n_frames, n_steps):
        poses = [_between(edit[step], edit[step + 1], part) for edit in edits]
        moved = compose(invert(poses[0]), poses[1])
        if max(np.abs(moved - a_from_b)[:2].max(), float(abs(wrap_angle(moved[2] - a_from_b[2])))) < STILL:
            continue
        shift = compose(compose(edits[0][frame], moved), invert(edits[1][frame]))
        placed = Mesh(apply_pose(shift, b.mesh.vertices), b.mesh.faces)
        if boxes_apart(a.low, a.high, placed.vertices.min(0), placed.vertices.max(0)) < reach:
            fixed = opened.get(a.name) or open_surface(a.mesh, workers=workers)
            yield step, clearance(fixed, open_surface(placed, workers=workers), reach=reach).gap


def pair_report(pair: Pair, frames: Sequence[PairFrame], *, with_sub_steps: bool) -> PairReport:
    """One pair through the whole scene.

    Args:
        pair: names.
        frames: (N).
        with_sub_steps: whether sub-steps were asked for.
    """
    between = np.full(max(0, len(frames) - 1), np.inf)
    for frame in frames:
        for step, gap in frame.sub_steps:
            between[step] = min(between[step], gap)
    return PairReport(
        between=pair,
        gap=np.array([frame.gap for frame in frames], np.float64),
        crossing=np.array([frame.crossing for frame in frames], np.bool_),
        where=np.array([frame.point for frame in frames], np.float64).reshape(-1, 3),
        solids=tuple(frame.solids for frame in frames),
        between_gap=between if with_sub_steps else None,
    )


def _sub_steps(frame: int, n_frames: int, n_steps: int) -> Iterator[tuple[int, float]]:
    """Sub-steps nearer to a frame than to another: the frame each follows, and how far past it."""
    for j in range(1, n_steps + 1):
        part = j / (n_steps + 1)
        if part <= 0.5 and frame + 1 < n_frames:
            yield frame, part
        if part > 0.5 and frame > 0:
            yield frame - 1, part


def _between(start: FloatArray, end: FloatArray, part: float) -> FloatArray:
    """A placement between two, turning the shorter way."""
    change = end - start
    change[2] = wrap_angle(change[2])
    return np.asarray(start + part * change)
