"""What a segment asks, in the terms of the search: its frames, clauses, cones of sight, candidate poses, contact."""

from collections.abc import Mapping

import numpy as np

from mhvedit.constraints.clauses import Clause
from mhvedit.constraints.dictionary import Slack, temporal_clauses
from mhvedit.constraints.fidelity import fidelity_clauses
from mhvedit.constraints.visibility import SightCone, sight_cone
from mhvedit.geometry.arrays import FloatArray
from mhvedit.optimise.quality import ContactMotion
from mhvedit.pipeline.keys import segment_parts
from mhvedit.pipeline.people import Person, canonical_gaze
from mhvedit.pipeline.store import Arrays
from mhvedit.project.schema import SceneFile, SegmentSpec
from mhvedit.search.poses import PoseGrid, pose_grid
from mhvedit.search.sight import MutualSight
from mhvedit.sequences.align import KeyRange, key_pair
from mhvedit.sequences.meshes import BODY
from mhvedit.sequences.segments import SegmentPair
from mhvedit.volumes.subject import SubjectVolumes, part_of


def segment_key(spec: SegmentSpec) -> KeyRange:
    """A segment as the time line takes it."""
    a, b = spec.between
    return KeyRange(spec.between, spec.frames[a], spec.frames[b], spec.retime)


def segment_pair(spec: SegmentSpec, people: Mapping[str, Person], fps: float) -> SegmentPair:
    """The frames of a segment, both at one length."""
    a, b = spec.between
    rates = fps / people[a].sequence.fps, fps / people[b].sequence.fps
    return key_pair(segment_key(spec), rates=rates)


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
    return contact_clauses(spec, a, b) + bodies_clauses(spec, a, b, pitch=pitch)


def contact_clauses(spec: SegmentSpec, a: SubjectVolumes, b: SubjectVolumes) -> tuple[Clause, ...]:
    """What a segment asks of its interest parts."""
    parts, slack = segment_parts(spec), Slack(spec.tolerance.frames, spec.tolerance.voxels)
    return temporal_clauses(spec.interaction, part_of(a, parts[0]), part_of(b, parts[1]), slack=slack)


def bodies_clauses(spec: SegmentSpec, a: SubjectVolumes, b: SubjectVolumes, *, pitch: float) -> tuple[Clause, ...]:
    """What must not meet, or not deeply."""
    return fidelity_clauses(
        spec.interaction,
        a,
        b,
        parts=segment_parts(spec),
        apart=spec.apart,
        depth=spec.tolerance.depth,
        overlap=spec.tolerance.apart,
        pitch=pitch,
    )


def segment_grid(scene: SceneFile, spec: SegmentSpec, root_a: FloatArray, root_b: FloatArray) -> PoseGrid:
    """Candidate poses of a segment whose roots are known."""
    search, window = scene.search, scene.window_of(spec)
    return pose_grid(root_a, root_b, pitch=search.voxel, stride=search.stride, n_yaw=search.n_yaw, window=window)


def segment_contact(spec: SegmentSpec, a: Arrays, b: Arrays, n_frames: int) -> ContactMotion | None:
    """The frames in which the parts touch, as the type says: the end, the start, or throughout.

    Args:
        spec: the segment.
        a: `root` and `part`, where A's root is, and the centre of its part in every frame.
        b: the same of B.
        n_frames: of the segment.

    Returns:
        None where the interest parts need not touch.
    """
    if not spec.interaction.touches or segment_parts(spec) == (BODY, BODY):
        return None
    kind, slack = spec.interaction.value, spec.tolerance.frames + 1
    held = kind == "0&0a"
    frames = slice(0, n_frames)
    if "+" in kind:
        frames = slice(max(0, n_frames - slack), n_frames)
    elif "-" in kind:
        frames = slice(0, min(slack, n_frames))
    return ContactMotion(a["part"][frames], b["part"][frames], a["root"], b["root"], held)
