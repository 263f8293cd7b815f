"""The stages that lead to the solutions of one segment, from volumes to group; what is kept is not made again."""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from mhvedit.errors import CaptureError, SceneError
from mhvedit.geometry.arrays import ByteArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.planar import wrap_angle
from mhvedit.geometry.runs import byte_counts
from mhvedit.optimise.quality import contact_penalty
from mhvedit.pipeline.decided import decided, decided_further
from mhvedit.pipeline.ground import ground_clauses, ground_key
from mhvedit.pipeline.keys import (
    bodies_key,
    centres_key,
    contact_key,
    group_key,
    segment_parts,
    sight_key,
    used_parts,
    volumes_key,
)
from mhvedit.pipeline.packing import BODY_ARRAYS, packed, unpacked, unpacked_body
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.store import Arrays, Key, Store
from mhvedit.pipeline.terms import (
    bodies_clauses,
    contact_clauses,
    segment_cones,
    segment_contact,
    segment_grid,
    segment_pair,
)
from mhvedit.project.schema import SceneFile, SegmentSpec
from mhvedit.search.groups import located_solutions
from mhvedit.search.poses import PoseGrid
from mhvedit.search.sight import MutualSight
from mhvedit.search.solve import ReasonMap, SightTest, search_poses
from mhvedit.sequences.segments import SegmentPair
from mhvedit.volumes.history import MotionHistoryVolume, frame_centres, word_count
from mhvedit.volumes.subject import SubjectVolumes, part_of, subject_volumes

MOST_WORDS = 1 << 29  # 64-bit words that one volume may take: 4 GB
LEVER = 0.5  # m, what a radian of yaw counts for in clearances
Progress = Callable[[float], None]
Pair = tuple[SubjectVolumes, SubjectVolumes]


@dataclass(frozen=True, slots=True, eq=False)
class Stages:
    """What the stages of one segment work with, and the keys that their results are kept under."""

    scene: SceneFile
    spec: SegmentSpec
    people: Mapping[str, Person]
    pair: SegmentPair
    cones: MutualSight | None
    facing: tuple[float, float]  # rad, of A and B over the segment, canonical frames
    store: Store
    workers: int
    of_volumes: tuple[Key, Key]
    of_contact: Key
    of_bodies: Key
    of_sight: Key | None
    of_group: Key


def segment_stages(
    scene: SceneFile, spec: SegmentSpec, people: Mapping[str, Person], *, fps: float, store: Store, workers: int
) -> Stages:
    """Find out what a segment depends on; nothing is made yet.

    Args:
        scene: the scene file.
        spec: the segment.
        people: by name.
        fps: of the scene.
        store: where results are kept.
        workers: threads.
    """
    pair = segment_pair(spec, people, fps)
    sides = list(zip((0, 1), spec.between, (pair.a, pair.b), strict=True))
    a, b = (volumes_key(scene, spec, side, people[name], numbers, store.contents) for side, name, numbers in sides)
    facing_a, facing_b = (
        float(wrap_angle(people[name].facing_over(numbers) - people[name].pose[2])) for _, name, numbers in sides
    )
    cones, facing = segment_cones(spec, people, pair), (facing_a, facing_b)
    of_contact = contact_key(scene, spec, (a, b))
    of_bodies = bodies_key(scene, spec, (a, b), ground_key(scene, spec, store.contents))
    of_sight = sight_key(scene, (a, b), cones)
    maps = of_contact, of_bodies, of_sight
    return Stages(
        scene=scene,
        spec=spec,
        people=people,
        pair=pair,
        cones=cones,
        facing=facing,
        store=store,
        workers=workers,
        of_volumes=(a, b),
        of_contact=of_contact,
        of_bodies=of_bodies,
        of_sight=of_sight,
        of_group=group_key(maps, window=scene.window_of(spec), facing=facing, lever=LEVER),
    )


def volumes_of(stages: Stages) -> Pair:
    """Both subjects' volumes.

    Raises:
        CaptureError: a part is empty in some frame of the segment.
        SceneError: the voxels are too small for a subject of that size.
    """
    with ThreadPoolExecutor(stages.workers) as pool:
        a, b = pool.map(partial(_volumes, stages), (0, 1))
    return a, b


def grid_of(stages: Stages) -> PoseGrid:
    """The candidate poses."""
    return segment_grid(stages.scene, stages.spec, _centres(stages, 0)["root"], _centres(stages, 1)["root"])


def found_by(stages: Stages, grid: PoseGrid, *, progress: Progress | None = None) -> ReasonMap:
    """What accepted or first rejected each pose: contact, then bodies where that accepts it, then sight likewise.

    It is what one search with all constraints finds, since such a search tests them in this order.

    Args:
        stages: of a segment.
        grid: its candidate poses.
        progress: told the share of the search that is done.
    """
    volumes = cache(lambda: volumes_of(stages))
    spec, search = stages.spec, partial(search_poses, grid, workers=stages.workers)

    def contact(among: ByteArray | None, value: int) -> ReasonMap:
        return search(contact_clauses(spec, *volumes()), among=among, value=value, progress=progress)

    def bodies(among: ByteArray | None, value: int) -> ReasonMap:
        clauses = bodies_clauses(spec, *volumes(), pitch=stages.scene.search.voxel)
        clauses += ground_clauses(stages.scene, spec, stages.people, *volumes())
        return search(clauses, among=among, value=value, progress=progress)

    def sight(among: ByteArray | None, value: int) -> ReasonMap:
        assert stages.cones is not None
        loaded = volumes.cache_info().currsize > 0
        a, b = (volumes()[side].body if loaded else _body(stages, side) for side in (0, 1))
        return search((), sight=SightTest(stages.cones, a, b), among=among, value=value)

    found = decided(stages.store, stages.of_contact, grid, contact)
    found = decided_further(stages.store, stages.of_bodies, found, bodies)
    return found if stages.of_sight is None else decided_further(stages.store, stages.of_sight, found, sight)


def group_of(
    stages: Stages,
    grid: PoseGrid,
    *names: str,
    progress: Progress | None = None,
    made: Callable[[ReasonMap], None] | None = None,
) -> Arrays:
    """The solutions in columns, and what became of the other poses.

    Args:
        stages: of a segment.
        grid: its candidate poses.
        names: of the arrays that are asked for, all if none is named: `cells` (S,) in the flattened grid, ascending;
            `region`, `clearance` (S,); `penalty` (S,), or (1,) where all have the same; `n_regions`; `reasons`,
            `counts`.
        progress: told the share of the search that is done.
        made: given the map, if it had to be made.
    """

    def build() -> Arrays:
        found = found_by(stages, grid, progress=progress)
        cells, region, clearance = located_solutions(found, lever=LEVER)
        if made is not None:
            made(found)
        return {
            "cells": cells,
            "region": region,
            "clearance": clearance,
            "penalty": _penalties(stages, grid, cells),
            "n_regions": region.max(initial=-1) + 1,
            "reasons": np.array(found.reasons),
            "counts": byte_counts(found.reason, len(found.reasons)),
        }

    return stages.store.arrays(stages.of_group, build, names=names)


def _penalties(stages: Stages, grid: PoseGrid, cells: IntArray | Int32Array) -> FloatArray:
    """(S,) what the contact's quality speaks against the poses of cells, m; (1,) where there is no contact."""
    contact = segment_contact(stages.spec, _centres(stages, 0), _centres(stages, 1), stages.pair.n_frames)
    if contact is None:
        return np.zeros(1)
    i, j, k = np.unravel_index(cells, (grid.size, grid.size, grid.n_yaw))
    return contact_penalty(contact, grid.poses(np.stack([i, j, k], 1)))


def _centres(stages: Stages, side: int) -> Arrays:
    """A subject's `root`, and the centre of its interest `part` in every frame."""
    part, of_volumes = segment_parts(stages.spec)[side], stages.of_volumes[side]

    def build() -> Arrays:
        volumes = _volumes(stages, side)
        return {"root": volumes.body.centre[:2], "part": frame_centres(part_of(volumes, part))}

    return stages.store.arrays(centres_key(of_volumes, part), build)


def _volumes(stages: Stages, side: int) -> SubjectVolumes:
    name, numbers = stages.spec.between[side], (stages.pair.a, stages.pair.b)[side]

    def build() -> Arrays:
        person, parts = stages.people[name], used_parts(stages.spec, side)
        _check_size(stages.scene, person, numbers)
        made = subject_volumes(
            person.sequence,
            person.subject.parts,
            numbers=tuple(int(n) for n in numbers),
            pose=person.pose,
            pitch=stages.scene.search.voxel,
            wanted=parts,
            workers=stages.workers,
        )
        _check_parts(stages.spec, name, parts, made, numbers)
        return packed(made)

    return unpacked(stages.store.arrays(stages.of_volumes[side], build))


def _body(stages: Stages, side: int) -> MotionHistoryVolume:
    """A subject's body alone, where the rest is not needed."""
    kept = stages.store.kept(stages.of_volumes[side], names=BODY_ARRAYS)
    return _volumes(stages, side).body if kept is None else unpacked_body(kept)


def _check_size(scene: SceneFile, person: Person, numbers: IntArray) -> None:
    """Refuse what memory cannot hold: most often the units are wrong."""
    rows = np.searchsorted(np.array(person.sequence.numbers), numbers)
    size = person.bounds[rows, 1].max(0) - person.bounds[rows, 0].min(0)
    words = word_count(len(numbers)) * float(np.prod(size / scene.search.voxel + 1))
    if words > MOST_WORDS:
        least = scene.search.voxel * (words / MOST_WORDS) ** (1 / 3)
        box = " x ".join(f"{x:.3g}" for x in size)
        expected = f"at least {least:.2g} m, as {person.subject.name} takes {box} m (units?)"
        raise SceneError(scene.file, "search.voxel", expected, f"{scene.search.voxel:g}")


def _check_parts(spec: SegmentSpec, name: str, parts: frozenset[str], made: SubjectVolumes, numbers: IntArray) -> None:
    for part in sorted(parts):
        volume = part_of(made, part)
        seen = np.bitwise_or.reduce(volume.frames.reshape(-1, volume.frames.shape[-1]), axis=0)
        bits = np.unpackbits(seen.astype("<u8").view(np.uint8), bitorder="little")[: len(numbers)]
        missing = numbers[bits == 0]
        if len(missing):
            where = "every frame" if len(missing) == len(numbers) else f"frame {missing[0]}"
            more = f" and {len(missing) - 1} more" if 1 < len(missing) < len(numbers) else ""
            raise CaptureError(
                f'{name}, segment "{spec.name}"', f'part "{part}" to hold some of the subject', f"none in {where}{more}"
            )
