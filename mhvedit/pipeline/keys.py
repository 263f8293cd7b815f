"""What each stage of a segment depends on: one function a stage, which returns the key that its result is kept under.

Keys are made of what a stage really reads: what the files of the segment's own frames hold, not their places; where a
part's joints are in these frames, not the whole track file; the parts that the segment names, not the others. A stage
that builds on another one has that one's key in its own.
"""

from typing import Final

import numpy as np

from mhvedit.geometry.arrays import IntArray
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.store import Key, hashed
from mhvedit.project.schema import SceneFile, SegmentSpec
from mhvedit.search.sight import MutualSight
from mhvedit.sequences.cache import VERSION as PARSERS
from mhvedit.sequences.contents import Contents
from mhvedit.sequences.meshes import BODY, JointTracks, MeshSequence
from mhvedit.volumes.parts import InBox, NearBones, NearTrack, OwnMesh, Part, WithLabel

# Raise a stage's number when its results change.
FRAMES: Final = 1
VOLUMES: Final = 1
CONTACT: Final = 3
BODIES: Final = 5
SIGHT: Final = 4
CENTRES: Final = 1
GROUP: Final = 3


def segment_parts(spec: SegmentSpec) -> tuple[str, str]:
    """Names of the two interest parts."""
    a, b = spec.between
    return spec.parts.get(a, BODY), spec.parts.get(b, BODY)


def used_parts(spec: SegmentSpec, side: int) -> frozenset[str]:
    """The parts of A (0) or B (1) that a segment names, in `parts` or in `apart`."""
    return frozenset({segment_parts(spec)[side], *(pair[side] for pair in spec.apart or ())})


def frames_key(sequence: MeshSequence, numbers: IntArray, known: Contents) -> Key:
    """Some frames of a capture: what their files hold."""
    files = sequence.files
    if sequence.per_frame:
        place = {number: file for number, file in zip(sequence.numbers, files, strict=True)}
        files = tuple(place[number] for number in numbers.tolist())
    return ("frames", FRAMES, PARSERS, known.of(files), numbers.tolist())


def volumes_key(
    scene: SceneFile, spec: SegmentSpec, side: int, person: Person, numbers: IntArray, known: Contents
) -> Key:
    """A subject's voxels through a segment: its frames, its place in its canonical frame, the named parts, the pitch.

    Things with meshes of their own are solid, so they count whether they are named or not.
    """
    own = scene.subjects[person.subject.name]
    parts = person.subject.parts
    named = used_parts(spec, side) | {name for name, part in parts.items() if isinstance(part, OwnMesh)}
    marked = [(name, part_key(parts[name], numbers, known)) for name in sorted(named)]
    frames = frames_key(person.sequence, numbers, known)
    return ("volumes", VOLUMES, frames, own.units, own.up, person.pose.tolist(), marked, scene.search.voxel)


def centres_key(volumes: Key, part: str) -> Key:
    """Where a subject's root is, and the centre of an interest part in every frame."""
    return ("centres", CENTRES, volumes, part)


def contact_key(scene: SceneFile, spec: SegmentSpec, volumes: tuple[Key, Key]) -> Key:
    """Which poses have the contact that the type asks for; without the window: maps grow and are cut (`decided`)."""
    asked = (spec.interaction.value, segment_parts(spec), spec.tolerance.frames, spec.tolerance.voxels)
    return ("contact", CONTACT, volumes, asked, scene.search.step, scene.search.yaw_step)


def bodies_key(scene: SceneFile, spec: SegmentSpec, volumes: tuple[Key, Key], ground: Key | None = None) -> Key:
    """At which poses nothing meets that must not, in contact or not; `ground`: what the stage asks, if it does."""
    asked = (spec.interaction.value, segment_parts(spec), spec.apart, spec.tolerance.depth, spec.tolerance.apart)
    key = ("bodies", BODIES, volumes, asked, scene.search.step, scene.search.yaw_step)
    return key if ground is None else (*key, ground)


def sight_key(scene: SceneFile, volumes: tuple[Key, Key], cones: MutualSight | None) -> Key | None:
    """At which poses each is in the other's sight; None where that is not asked for."""
    if cones is None:
        return None
    seen = [(c.eye.tolist(), c.direction.tolist(), c.half_angle) for c in (cones.a, cones.b)]
    return ("sight", SIGHT, volumes, seen, scene.search.step, scene.search.yaw_step)


def group_key(maps: tuple[Key | None, ...], *, window: float, facing: tuple[float, float], lever: float) -> Key:
    """The solutions of a segment, named and measured: what all maps accept."""
    return ("group", GROUP, maps, window, facing, lever)


def part_key(part: Part, numbers: IntArray, known: Contents) -> Key:
    """What marks a part in some frames."""
    match part:
        case NearTrack():
            return ("track", _positions(part.tracks, part.joints, numbers), part.radius)
        case NearBones():
            return ("bones", _positions(part.tracks, part.tracks.joints, numbers), part.parents, part.bones)
        case OwnMesh():
            return ("mesh", frames_key(part.sequence, numbers, known))
        case InBox():
            return ("box", part.centre.tolist(), part.size.tolist())
        case WithLabel():
            return ("label", part.label)
        case _:
            return (BODY,)


def _positions(tracks: JointTracks, joints: tuple[str, ...], numbers: IntArray) -> Key:
    """Where joints are in some frames, as a hash."""
    rows = np.isin(tracks.numbers, numbers)
    points = tracks.positions[rows][:, [tracks.joints.index(joint) for joint in joints]]
    return (joints, tracks.numbers[rows].tolist(), hashed(points.tobytes()))
