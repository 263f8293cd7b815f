"""One key segment, from the meshes to its solution group."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from mhvedit.constraints.clauses import Clause
from mhvedit.constraints.dictionary import Slack, temporal_clauses
from mhvedit.constraints.fidelity import fidelity_clauses
from mhvedit.constraints.visibility import SightCone, sight_cone
from mhvedit.errors import CaptureError, SceneError
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import wrap_angle
from mhvedit.optimise.quality import ContactMotion, contact_penalty
from mhvedit.pipeline.people import Person, canonical_gaze
from mhvedit.pipeline.store import Store, file_signatures
from mhvedit.project.schema import SceneFile, SegmentSpec
from mhvedit.search.groups import SolutionGroup, solution_group
from mhvedit.search.poses import PoseGrid, pose_grid
from mhvedit.search.sight import MutualSight
from mhvedit.search.solve import ReasonMap, SightTest, search_poses
from mhvedit.sequences.align import KeyRange, key_pair
from mhvedit.sequences.segments import SegmentPair
from mhvedit.volumes.history import frame_centres, word_count
from mhvedit.volumes.parts import OwnMesh
from mhvedit.volumes.subject import BODY, SubjectVolumes, part_of, subject_volumes

VERSION = 1  # of what is kept; raise it when any stage up to here changes its results
MOST_WORDS = 1 << 29  # 64-bit words that one volume may take: 4 GB
LEVER = 0.5  # m, what a radian of yaw counts for in clearances
Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True, eq=False)
class SolvedSegment:
    """A key segment and all its solutions; canonical frames throughout."""

    spec: SegmentSpec
    pair: SegmentPair
    found: ReasonMap
    group: SolutionGroup
    facing: tuple[float, float]  # rad, of A and B
    contact: ContactMotion | None  # None where the interest parts need not touch
    cones: MutualSight | None

    @property
    def penalty(self) -> FloatArray:
        """(S,) what the contact's quality speaks against each solution, m."""
        return np.zeros(len(self.group)) if self.contact is None else contact_penalty(self.contact, self.group.poses)


def segment_parts(spec: SegmentSpec) -> tuple[str, str]:
    """Names of the two interest parts."""
    a, b = spec.between
    return spec.parts.get(a, BODY), spec.parts.get(b, BODY)


def segment_pair(scene: SceneFile, spec: SegmentSpec, people: Mapping[str, Person], fps: float) -> SegmentPair:
    """The frames of a segment, both at one length."""
    a, b = spec.between
    rates = fps / people[a].sequence.fps, fps / people[b].sequence.fps
    return key_pair(KeyRange(spec.frames[a], spec.frames[b], spec.retime), rates=rates)


def segment_volumes(
    scene: SceneFile, spec: SegmentSpec, people: Mapping[str, Person], pair: SegmentPair
) -> tuple[SubjectVolumes, SubjectVolumes]:
    """Both subjects' volumes through a segment.

    Raises:
        CaptureError: a part is empty in some frame of the segment.
        SceneError: the voxels are too small for a subject of that size.
    """
    wanted = [set(segment_parts(spec)[:1]), set(segment_parts(spec)[1:])]
    for first, second in spec.apart or ():
        wanted[0].add(first)
        wanted[1].add(second)
    volumes = []
    for name, numbers, parts in zip(spec.between, (pair.a, pair.b), wanted, strict=True):
        person = people[name]
        _check_size(scene, person, numbers)
        made = subject_volumes(
            person.sequence,
            person.subject.parts,
            numbers=tuple(int(n) for n in numbers),
            pose=person.pose,
            pitch=scene.search.voxel,
            wanted=frozenset(parts),
        )
        _check_parts(spec, name, parts, made, numbers)
        volumes.append(made)
    return volumes[0], volumes[1]


def segment_cones(spec: SegmentSpec, people: Mapping[str, Person], pair: SegmentPair) -> MutualSight | None:
    """Both cones of sight in canonical frames; None where visibility is not asked for."""
    if spec.visibility is None:
        return None
    frames = spec.visibility.frames or range(pair.n_frames)
    chosen = np.array(frames)
    cones: list[SightCone] = []
    for name, numbers in zip(spec.between, (pair.a, pair.b), strict=True):
        gaze = canonical_gaze(people[name])
        cones.append(sight_cone(gaze, numbers[chosen], half_angle=spec.visibility.half_angle))
    return MutualSight(cones[0], cones[1])


def segment_clauses(spec: SegmentSpec, a: SubjectVolumes, b: SubjectVolumes, *, pitch: float) -> tuple[Clause, ...]:
    """What a segment asks, in the order in which it is blamed."""
    parts, tolerance = segment_parts(spec), spec.tolerance
    slack = Slack(tolerance.frames, tolerance.voxels)
    return temporal_clauses(
        spec.interaction, part_of(a, parts[0]), part_of(b, parts[1]), slack=slack
    ) + fidelity_clauses(
        spec.interaction,
        a,
        b,
        parts=parts,
        apart=spec.apart,
        depth=tolerance.depth,
        overlap=tolerance.apart,
        pitch=pitch,
    )


def solve_segment(
    scene: SceneFile,
    spec: SegmentSpec,
    people: Mapping[str, Person],
    *,
    fps: float,
    store: Store,
    workers: int,
    progress: Progress | None = None,
) -> SolvedSegment:
    """Find every placement in which a segment's interaction really happens.

    Args:
        scene: the scene file.
        spec: the segment.
        people: by name.
        fps: of the scene.
        store: where the search is kept between runs.
        workers: threads.
        progress: told the share of the search that is done.
    """
    pair = segment_pair(scene, spec, people, fps)
    cones = segment_cones(spec, people, pair)
    key = segment_key(scene, spec, people, pair, cones)
    kept = store.arrays(key, lambda: _searched(scene, spec, people, pair, cones, workers, progress))
    grid = segment_grid(scene, kept["root_a"], kept["root_b"])
    found = ReasonMap(grid, kept["reason"], tuple(str(name) for name in kept["reasons"]))
    a, b = (people[name] for name in spec.between)
    facing = tuple(
        float(wrap_angle(person.facing_over(numbers) - person.pose[2]))
        for person, numbers in ((a, pair.a), (b, pair.b))
    )
    group = solution_group(found, facing_a=facing[0], facing_b=facing[1], lever=LEVER)
    contact = None
    if spec.interaction.touches and segment_parts(spec) != (BODY, BODY):
        contact = _contact(spec, kept, pair.n_frames)
    return SolvedSegment(spec, pair, found, group, (facing[0], facing[1]), contact, cones)


def segment_key(
    scene: SceneFile, spec: SegmentSpec, people: Mapping[str, Person], pair: SegmentPair, cones: MutualSight | None
) -> tuple[object, ...]:
    """Everything that a segment's search depends on."""
    sides: list[object] = []
    for name, numbers in zip(spec.between, (pair.a, pair.b), strict=True):
        person, own = people[name], scene.subjects[name]
        things = {
            part: file_signatures(thing.sequence.files)
            for part, thing in person.subject.parts.items()
            if isinstance(thing, OwnMesh)
        }
        tracks = [file_signatures((part.track.path,)) for part in own.parts.values() if hasattr(part, "track")]
        skeleton = None if own.skeleton is None else file_signatures((own.skeleton.path,))
        sides.append((person.signature, numbers.tolist(), own.parts, things, tracks, skeleton, person.pose.tolist()))
    sight = None
    if cones is not None:
        sight = [(c.eye.tolist(), c.direction.tolist(), c.half_angle) for c in (cones.a, cones.b)]
    asked = (spec.interaction.value, segment_parts(spec), spec.apart, spec.tolerance, sight, scene.search)
    return ("segment", VERSION, sides, asked)


def _searched(
    scene: SceneFile,
    spec: SegmentSpec,
    people: Mapping[str, Person],
    pair: SegmentPair,
    cones: MutualSight | None,
    workers: int,
    progress: Progress | None,
) -> dict[str, FloatArray]:
    a, b = segment_volumes(scene, spec, people, pair)
    grid = segment_grid(scene, a.body.centre[:2], b.body.centre[:2])
    sight = None if cones is None else SightTest(cones, a.body, b.body)
    clauses = segment_clauses(spec, a, b, pitch=scene.search.voxel)
    found = search_poses(grid, clauses, sight=sight, workers=workers, progress=progress)
    parts = segment_parts(spec)
    return {
        "reason": found.reason,
        "reasons": np.array(found.reasons),
        "root_a": grid.root_a,
        "root_b": grid.root_b,
        "part_a": frame_centres(part_of(a, parts[0])),
        "part_b": frame_centres(part_of(b, parts[1])),
    }


def segment_grid(scene: SceneFile, root_a: FloatArray, root_b: FloatArray) -> PoseGrid:
    """Candidate poses of a segment whose roots are known."""
    search = scene.search
    return pose_grid(root_a, root_b, pitch=search.voxel, stride=search.stride, n_yaw=search.n_yaw, window=search.window)


def _contact(spec: SegmentSpec, kept: Mapping[str, FloatArray], n_frames: int) -> ContactMotion:
    """The frames in which the parts touch, as the type says: the end, the start, or throughout."""
    kind, slack = spec.interaction.value, spec.tolerance.frames + 1
    held = kind == "0&0a"
    frames = slice(0, n_frames)
    if "+" in kind:
        frames = slice(max(0, n_frames - slack), n_frames)
    elif "-" in kind:
        frames = slice(0, min(slack, n_frames))
    return ContactMotion(kept["part_a"][frames], kept["part_b"][frames], kept["root_a"], kept["root_b"], held)


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


def _check_parts(spec: SegmentSpec, name: str, parts: set[str], made: SubjectVolumes, numbers: IntArray) -> None:
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
