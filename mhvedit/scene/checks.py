"""Checks of an edited scene on the meshes themselves, in every frame, transitional ones too."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from mhvedit.constraints.dictionary import InteractionType
from mhvedit.constraints.visibility import SightCone, sees
from mhvedit.errors import MissingFrame, ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.planar import apply_pose, invert, rotation
from mhvedit.scene.contact import ContactSlack, PartSeries, cut_part, judge_contact
from mhvedit.scene.edit import EditedScene, SegmentEdit
from mhvedit.scene.motion import added_motion, sole_points
from mhvedit.scene.pairs import (
    Pair,
    PairFrame,
    Standing,
    pair_clearances,
    pair_frame,
    pair_report,
    stand,
    sub_step_gaps,
)
from mhvedit.scene.report import SceneReport, SegmentReport, SightReport
from mhvedit.scene.surfaces import Clearance, boxes_apart, clearance, open_surface
from mhvedit.sequences.meshes import Mesh, MeshSequence

REACH: Final = 0.25  # m, wider gaps are not measured

PartVertices = Callable[[str, str, int, Mesh], BoolArray]  # subject, part, frame number, captured mesh -> (V,)
Progress = Callable[[int, int], None]  # frames done, frames in all


@dataclass(frozen=True, slots=True, eq=False)
class SegmentSight:
    """The cones of sight of one segment, each in its subject's capture frame, and where they are asked for."""

    a: SightCone
    b: SightCone
    first: int = 0  # counted in the segment
    stop: int | None = None  # past the last; None for the segment's end


@dataclass(frozen=True, slots=True, eq=False)
class _PartFrame:
    """One frame of one segment; places and meshes in the frame of A's capture."""

    body_gap: float
    reach_gap: float
    part_gap: float
    place: FloatArray  # (3,)
    a: Mesh | None
    b: Mesh | None
    sight: tuple[bool, bool] | None


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """What is kept of one frame of the scene."""

    pairs: Mapping[Pair, PairFrame]
    soles: Mapping[str, FloatArray]  # (K, 3) m by subject, in the capture's frame
    centres: Mapping[str, FloatArray]  # (3,) m


@dataclass(frozen=True, slots=True, eq=False)
class _Check:
    """What the whole check needs to know."""

    scene: EditedScene
    captures: Mapping[str, MeshSequence]
    part_vertices: PartVertices
    parts: Mapping[str, tuple[str, str]]
    slack: Mapping[str, ContactSlack]
    sight: Mapping[str, SegmentSight]
    held: Mapping[str, Mapping[str, MeshSequence]]
    first: int
    reach: float
    sub_steps: int
    workers: int


def check_scene(
    scene: EditedScene,
    captures: Mapping[str, MeshSequence],
    *,
    part_vertices: PartVertices,
    parts_of_segment: Mapping[str, tuple[str, str]],
    slack: Mapping[str, ContactSlack] | None = None,
    sight: Mapping[str, SegmentSight] | None = None,
    held: Mapping[str, Mapping[str, MeshSequence]] | None = None,
    first: int = 0,
    between_frames: int = 0,
    reach: float = REACH,
    workers: int = 1,
    progress: Progress | None = None,
) -> SceneReport:
    """Measure an edited scene on its meshes: penetration, contact against type, sight, skate, continuity.

    Args:
        scene: the edit.
        captures: by subject name.
        part_vertices: tells which vertices of a captured mesh belong to a part (never asked for `body` or things held).
        parts_of_segment: by segment name, the interest parts of its two subjects, in the order of `between`.
        slack: by segment name, tolerances of its contact; none where missing.
        sight: by segment name, cones of sight; not checked where missing.
        held: by subject and part name, things with meshes of their own, in the capture's frame and numbering.
        first: number of the first frame, where the scene is a stretch of a longer one; sentences name frames by it.
        between_frames: sub-steps between frames (see `pairs`).
        reach: m, gaps wider than this are not measured.
        workers: threads for distances, 0 for all; the result does not depend on it.
        progress: is told after every frame.

    Raises:
        ShapeError: a segment lies outside the scene.
        MissingFrame: the edit names a frame that a capture does not have.
        MissingLibrary: open3d cannot be loaded.
    """
    check = _Check(
        scene=scene,
        captures=captures,
        part_vertices=part_vertices,
        parts=parts_of_segment,
        slack=slack or {},
        sight=sight or {},
        held=held or {},
        first=first,
        reach=reach,
        sub_steps=between_frames,
        workers=workers,
    )
    _require_checkable(scene, captures)
    frames: list[_Frame] = []
    rows: dict[str, list[_PartFrame]] = {segment.name: [] for segment in scene.segments}
    segments: dict[str, SegmentReport] = {}
    for k in range(scene.n_frames):
        kept, parts = _measure_frame(check, k)
        frames.append(kept)
        for name, part in parts.items():
            rows[name].append(part)
        for segment in (s for s in scene.segments if s.stop == k + 1):
            segments[segment.name] = _segment_report(check, segment, rows.pop(segment.name))  # meshes are let go here
        if progress is not None:
            progress(k + 1, scene.n_frames)
    return _scene_report(check, frames, tuple(segments[s.name] for s in scene.segments))


def _require_checkable(scene: EditedScene, captures: Mapping[str, MeshSequence]) -> None:
    """Find what cannot be checked at once, not after a minute."""
    for segment in scene.segments:
        if not 0 <= segment.start < segment.stop <= scene.n_frames:
            span = (segment.start, segment.stop)
            raise ShapeError(f"segment {segment.name}: start, stop", span, f"frames within 0, {scene.n_frames}")
    for name, edit in scene.subjects.items():
        numbers = captures[name].numbers
        missing = np.setdiff1d(edit.source, numbers)
        if len(missing):
            raise MissingFrame(name, int(missing[0]), numbers)


def _measure_frame(check: _Check, k: int) -> tuple[_Frame, dict[str, _PartFrame]]:
    """One frame of the scene, and the interest parts of the segments that are under way."""
    scene = check.scene
    stood = {
        name: stand(scene, name, k, capture=check.captures[name], held=check.held.get(name, {}))
        for name in scene.subjects
    }
    found, opened = pair_clearances(stood, reach=check.reach, workers=check.workers)
    pairs = {}
    for pair in found:
        a, b = stood[pair[0]], stood[pair[1]]
        steps = sub_step_gaps(
            scene, (a, b), k, opened=opened, n_steps=check.sub_steps, reach=check.reach, workers=check.workers
        )
        pairs[pair] = pair_frame(a, b, found[pair], tuple(steps))
    under_way = (s for s in scene.segments if s.start <= k < s.stop)
    parts = {s.name: _part_frame(check, s, stood, found, k) for s in under_way}
    soles = {name: sole_points(solid.captured.vertices) for name, solid in stood.items()}
    centres = {name: np.asarray(solid.captured.vertices.mean(0)) for name, solid in stood.items()}
    return _Frame(pairs, soles, centres), parts


def _scene_report(check: _Check, frames: list[_Frame], segments: tuple[SegmentReport, ...]) -> SceneReport:
    scene = check.scene
    pairs = combinations(scene.subjects, 2)
    asked = check.sub_steps > 0
    return SceneReport(
        name=scene.name,
        n_frames=scene.n_frames,
        fps=scene.fps,
        reach=check.reach,
        between_frames=check.sub_steps,
        pairs=tuple(pair_report(p, [frame.pairs[p] for frame in frames], with_sub_steps=asked) for p in pairs),
        segments=segments,
        motions=tuple(
            added_motion(
                name,
                edit.placements,
                soles=[frame.soles[name] for frame in frames],
                centres=np.array([frame.centres[name] for frame in frames]).reshape(-1, 3),
            )
            for name, edit in scene.subjects.items()
        ),
    )


def _part_frame(
    check: _Check,
    segment: SegmentEdit,
    stood: Mapping[str, Standing],
    clearances: Mapping[Pair, Clearance | None],
    frame: int,
) -> _PartFrame:
    """The interest parts of a segment in one of its frames."""
    a, b = (stood[name] for name in segment.between)
    belongs = [_belongs(check, s, part) for s, part in zip((a, b), check.parts[segment.name], strict=True)]
    a_from_world = invert(check.scene.subjects[a.name].placements[frame])
    meshes = [
        cut_part(Mesh(apply_pose(a_from_world, s.mesh.vertices), s.mesh.faces), m)
        for s, m in zip((a, b), belongs, strict=True)
    ]
    found = _oriented(clearances, a.name, b.name)
    gap, place = np.inf, np.full(3, np.nan)
    if found is not None and np.isfinite(found.gap):
        if all(m.all() for m in belongs):
            gap, place = found.gap, apply_pose(a_from_world, found.point)
        else:
            gap, place = _part_gap(check, meshes)
    return _PartFrame(
        body_gap=np.inf if found is None else found.gap,
        reach_gap=np.inf if found is None else _reach_gap(found, belongs),
        part_gap=gap,
        place=place,
        a=meshes[0],
        b=meshes[1],
        sight=_look(check, segment, (a, b), frame),
    )


def _belongs(check: _Check, solid: Standing, part: str) -> BoolArray:
    """(V,) which vertices of a subject belong to a part."""
    if part in solid.solids:
        return np.asarray(solid.owners == solid.solids.index(part))
    belongs = np.zeros(len(solid.owners), np.bool_)
    of_body = check.part_vertices(solid.name, part, solid.number, solid.captured)
    belongs[: len(of_body)] = of_body
    return belongs


def _part_gap(check: _Check, meshes: list[Mesh | None]) -> tuple[float, FloatArray]:
    """Gap between two parts and where, both in the frame they are given in."""
    a, b = meshes
    if a is None or b is None:
        return np.inf, np.full(3, np.nan)
    boxes = (a.vertices.min(0), a.vertices.max(0), b.vertices.min(0), b.vertices.max(0))
    if boxes_apart(*boxes) >= check.reach:
        return np.inf, np.full(3, np.nan)
    opened = [open_surface(mesh, workers=check.workers) for mesh in (a, b)]
    found = clearance(opened[0], opened[1], reach=check.reach)
    return found.gap, found.point


def _reach_gap(found: Clearance, belongs: list[BoolArray]) -> float:
    """Smallest distance of either part's points to all of the other."""
    if all(m.all() for m in belongs):
        return found.gap
    least = np.inf
    sides = ((found.near_a, found.signed_a), (found.near_b, found.signed_b))
    for (corners, signed), mask in zip(sides, belongs, strict=True):
        least = min(least, float(signed[mask[corners]].min(initial=np.inf)))
    return least


def _oriented(clearances: Mapping[Pair, Clearance | None], a: str, b: str) -> Clearance | None:
    """How two subjects stand to each other, told with A first."""
    if (a, b) in clearances:
        return clearances[a, b]
    found = clearances[b, a]
    return None if found is None else found.swapped()


def _look(check: _Check, segment: SegmentEdit, pair: tuple[Standing, Standing], frame: int) -> tuple[bool, bool] | None:
    """Whether A sees B and B sees A; None where the segment does not ask."""
    asked = check.sight.get(segment.name)
    i = frame - segment.start
    if asked is None or i < asked.first or (asked.stop is not None and i >= asked.stop):
        return None
    (a, b), placements = pair, check.scene.subjects
    cone_a = _placed_cone(asked.a, placements[a.name].placements[frame])
    cone_b = _placed_cone(asked.b, placements[b.name].placements[frame])
    return sees(cone_a, b.mesh.vertices), sees(cone_b, a.mesh.vertices)


def _placed_cone(cone: SightCone, placement: FloatArray) -> SightCone:
    direction = cone.direction.copy()
    direction[:2] = rotation(placement[2]) @ cone.direction[:2]
    return SightCone(apply_pose(placement, cone.eye), direction, cone.half_angle)


def _segment_report(check: _Check, segment: SegmentEdit, rows: list[_PartFrame]) -> SegmentReport:
    parts = PartSeries(
        start=check.first + segment.start,
        gap=np.array([row.part_gap for row in rows]),
        place=np.array([row.place for row in rows]).reshape(-1, 3),
        a=tuple(row.a for row in rows),
        b=tuple(row.b for row in rows),
        workers=check.workers,
    )
    placements = check.scene.subjects[segment.between[0]].placements[segment.start : segment.stop]
    places = [apply_pose(pose, place) for pose, place in zip(placements, parts.place, strict=True)]
    return SegmentReport(
        name=segment.name,
        between=segment.between,
        interaction=segment.interaction,
        parts=check.parts[segment.name],
        start=segment.start,
        stop=segment.stop,
        body_gap=np.array([row.body_gap for row in rows]),
        part_gap=parts.gap,
        reach_gap=np.array([row.reach_gap for row in rows]),
        part_place=np.array(places).reshape(-1, 3),
        verdict=judge_contact(
            InteractionType(segment.interaction), parts, slack=check.slack.get(segment.name, ContactSlack())
        ),
        sight=_sight_report(check, segment, rows),
    )


def _sight_report(check: _Check, segment: SegmentEdit, rows: list[_PartFrame]) -> SightReport | None:
    asked = check.sight.get(segment.name)
    if asked is None:
        return None
    looks = [row.sight for row in rows if row.sight is not None]
    first = check.first + segment.start + max(0, asked.first)
    return SightReport(first, tuple(a for a, _ in looks), tuple(b for _, b in looks))
