"""Why a segment has no solution: which constraint kills it, and how far the nearest pose is from passing."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mhvedit.constraints.dictionary import NO_CONTACT, TOUCHES_AT_A_WRONG_MOMENT
from mhvedit.constraints.fidelity import BODIES_MEET, TOO_DEEP
from mhvedit.constraints.visibility import NOT_SEEN_BY_A, NOT_SEEN_BY_B
from mhvedit.geometry.arrays import BoolArray
from mhvedit.pipeline.ground import ground_clauses
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.segments import SolvedSegment
from mhvedit.pipeline.store import Store
from mhvedit.pipeline.terms import segment_clauses, segment_cones
from mhvedit.project.schema import SceneFile, SegmentSpec
from mhvedit.search.solve import OUTSIDE, SightTest, search_poses
from mhvedit.volumes.subject import SubjectVolumes

VERSION = 1  # of what is kept; raise it when the explanation changes
LOOSER_VOXELS = (1, 2, 3, 4, 6, 8, 12, 16, 24)
LOOSER_FRAMES = (1, 2, 3, 4, 6, 8)
LOOSER_METRES = (0.01, 0.02, 0.03, 0.05, 0.08, 0.12)
LOOSER_DEGREES = (5, 10, 15, 20, 30, 45, 60, 90)
MOST_POSES = 2_000_000  # poses that a looser constraint is tried on; more are thinned out evenly


@dataclass(frozen=True, slots=True)
class Miss:
    """What an empty solution group has to say."""

    killed_by: str  # the constraint that the poses which got furthest failed
    poses: int  # how many got that far
    nearest: str  # what would let one pass
    passes_with: str  # the setting that does, as it would stand in the scene file; empty where none was found


def explain_empty(
    scene: SceneFile, segment: SolvedSegment, people: Mapping[str, Person], *, store: Store, workers: int
) -> Miss:
    """Find out what an empty group would need.

    Args:
        scene: the scene file.
        segment: solved, and empty.
        people: by name.
        store: where the explanation is kept between runs.
        workers: threads.
    """

    def build() -> dict[str, np.ndarray[Any, Any]]:
        miss = _explained(scene, segment, people, workers)
        return {
            "words": np.array([miss.killed_by, miss.nearest, miss.passes_with]),
            "poses": np.array(miss.poses),
        }

    kept = store.arrays(("miss", VERSION, segment.identity, _window_key(segment.spec)), build)
    killed_by, nearest, passes_with = (str(word) for word in kept["words"])
    return Miss(killed_by, int(kept["poses"]), nearest, passes_with)


def _explained(scene: SceneFile, segment: SolvedSegment, people: Mapping[str, Person], workers: int) -> Miss:
    reason = segment.found.reason
    if not (reason > OUTSIDE).any():
        return Miss("the window", 0, f"the window holds no pose at all: enlarge {_window_key(segment.spec)}", "")
    furthest = int(reason.max())
    among = _thinned(np.asarray(reason == furthest))
    killed_by, count = segment.found.reasons[furthest], int((reason == furthest).sum())
    volumes = segment.volumes()
    needed = _side_by_side(volumes)
    if scene.window_of(segment.spec) < needed:
        words = f"{_window_key(segment.spec)} = {needed:.2g}"
        return Miss(
            killed_by, count, f"the window is too small for the bodies to stand side by side: try {words}", words
        )
    for spec, words in _loosened(segment.spec, killed_by):
        cones = segment_cones(spec, people, segment.pair)
        sight = None if cones is None else SightTest(cones, volumes[0].body, volumes[1].body)
        clauses = segment_clauses(spec, *volumes, pitch=scene.search.voxel)
        clauses += ground_clauses(scene, spec, people, *volumes)
        found = search_poses(segment.grid, clauses, sight=sight, among=among, workers=workers)
        passing = int(found.accepted.sum())
        if passing:
            return Miss(killed_by, count, f"with {words} there would be {passing:,} solutions", words)
    return Miss(killed_by, count, "no pose passes even with a much larger tolerance of that constraint alone", "")


def _window_key(spec: SegmentSpec) -> str:
    """Where the scene file says how large a segment's window is."""
    return "search.window" if spec.window is None else "window"


def _side_by_side(volumes: tuple[SubjectVolumes, SubjectVolumes]) -> float:
    """Side of the smallest window in which two bodies can stand clear of each other, their thin sides together, m."""
    thin = [min(v.body.grid.shape[:2]) * v.body.grid.pitch for v in volumes]
    return float(sum(thin))


def _thinned(among: BoolArray) -> BoolArray:
    count = int(among.sum())
    if count <= MOST_POSES:
        return among
    kept = np.zeros_like(among)
    where = np.argwhere(among)[:: -(-count // MOST_POSES)]
    kept[tuple(where.T)] = True
    return kept


def _loosened(spec: SegmentSpec, killed_by: str) -> Iterator[tuple[SegmentSpec, str]]:
    """Ever looser versions of the setting behind a reason, smallest change first."""
    tolerance = spec.tolerance
    if killed_by == BODIES_MEET:
        for more in LOOSER_METRES:
            value = round(tolerance.apart + more, 4)
            yield replace(spec, tolerance=replace(tolerance, apart=value)), f"tolerance.apart = {value:g}"
    elif killed_by == TOO_DEEP:
        for more in LOOSER_METRES:
            value = round(tolerance.depth + more, 4)
            yield replace(spec, tolerance=replace(tolerance, depth=value)), f"tolerance.depth = {value:g}"
    elif killed_by in (NOT_SEEN_BY_A, NOT_SEEN_BY_B) and spec.visibility is not None:
        for more in LOOSER_DEGREES:
            angle = min(180.0, np.degrees(spec.visibility.half_angle) + more)
            wider = replace(spec.visibility, half_angle=float(np.radians(angle)))
            yield replace(spec, visibility=wider), f"visibility.half_angle = {angle:g}"
    else:
        yield from _looser_contact(spec, killed_by)


def _looser_contact(spec: SegmentSpec, killed_by: str) -> Iterator[tuple[SegmentSpec, str]]:
    tolerance = spec.tolerance
    if killed_by != NO_CONTACT:
        for frames in LOOSER_FRAMES:
            value = tolerance.frames + frames
            yield replace(spec, tolerance=replace(tolerance, frames=value)), f"tolerance.frames = {value}"
    if killed_by != TOUCHES_AT_A_WRONG_MOMENT:
        for voxels in LOOSER_VOXELS:
            near = tolerance.voxels + voxels
            yield replace(spec, tolerance=replace(tolerance, voxels=near)), f"tolerance.voxels = {near:g}"
