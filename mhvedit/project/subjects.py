"""Opens what a scene file names: the capture of a subject, its parts, facing, gaze and skeleton."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from mhvedit.errors import SceneError
from mhvedit.geometry.arrays import IntArray
from mhvedit.project.schema import (
    FilePath,
    GazeSpec,
    InBoxSpec,
    NearBonesSpec,
    NearTrackSpec,
    OwnMeshSpec,
    PartSpec,
    SubjectSpec,
    WithLabelSpec,
)
from mhvedit.project.values import dotted, listed, shown, suggestion
from mhvedit.sequences.axes import to_metres_z_up
from mhvedit.sequences.contents import Contents
from mhvedit.sequences.meshes import BODY, JointTracks, MeshSequence
from mhvedit.sequences.read import open_capture
from mhvedit.sequences.tracks import read_tracks
from mhvedit.skeleton.bvh import BvhMotion, read_bvh
from mhvedit.volumes.parts import InBox, NearBones, NearTrack, OwnMesh, Part, WholeBody, WithLabel

FACING, EYE, TARGET = "facing", "eye", "target"  # joints


@dataclass(frozen=True, slots=True, eq=False)
class GazeTracks:
    """Where the eyes are (joint `eye`) and what they look at (`target`); a file of one joint may call it anything."""

    eye: JointTracks
    target: JointTracks


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """A subject whose files are open; all in metres and z up, in the capture's own frame."""

    name: str
    sequence: MeshSequence
    parts: Mapping[str, Part]  # `body` first, then those of the scene file in its order
    facing: float | JointTracks | None  # rad about z from +x | a track with a joint `facing` | None: to be estimated
    gaze: GazeTracks | None  # None: to be estimated
    skeleton: BvhMotion | None

    @property
    def held(self) -> dict[str, MeshSequence]:
        """What the subject holds, by part: things with meshes of their own, as a sword."""
        return {name: part.sequence for name, part in self.parts.items() if isinstance(part, OwnMesh)}


Tracks = Mapping[FilePath, JointTracks]


def open_subject(spec: SubjectSpec, *, cache: Path | None, known: Contents | None = None) -> Subject:
    """Open the files of one subject; meshes are read later, one by one.

    Lengths that stand in the scene file are metres, whatever the capture's units: a part's `radius`, and a box's
    `center` and `size`, which lie along the capture's axes as on disk and turn with its up axis. What stands in
    files (tracks, skeleton, a part's own meshes) is in the capture's units and axes. A facing in degrees counts
    anticlockwise seen from above, 0 along the capture's axis that becomes +x: x for z up and y up, -z for x up.
    Frame k of a skeleton belongs to frame number k of the capture.

    Args:
        spec: from `load_scene`.
        cache: folder for converted meshes, or None for none.
        known: hashes of files that are remembered.

    Raises:
        SceneError: a joint, bone or frame that the scene file names is not there.
        CaptureError: a file cannot be used.
        MissingLibrary: a USD stage, and usd-core is not installed.
    """
    reading = partial(open_capture, units=spec.units, up=spec.up, cache=cache, known=known)
    whole = reading(spec.path.path, name=spec.name, fps=spec.fps)
    sequence = _cut(whole, spec)
    tracks = {file: read_tracks(file.path, units=spec.units, up=spec.up) for file in _track_files(spec)}
    skeleton = None if spec.skeleton is None else read_bvh(spec.skeleton.path, units=spec.units, up=spec.up)
    parts: dict[str, Part] = {BODY: WholeBody()}
    for name, part in spec.parts.items():
        parts[name] = _part(part, name, spec, sequence=sequence, tracks=tracks, skeleton=skeleton, reading=reading)
    return Subject(
        name=spec.name,
        sequence=sequence,
        parts=parts,
        facing=_facing(spec, sequence, tracks),
        gaze=None if spec.gaze is None else _gaze(spec, spec.gaze, tracks),
        skeleton=skeleton,
    )


def missing_frames(tracks: JointTracks, joint: str, numbers: Iterable[int]) -> list[int]:
    """Of some frame numbers, those in which a joint is not given.

    Args:
        tracks: that have the joint.
        joint: its name.
        numbers: frame numbers.
    """
    known = np.isfinite(tracks.positions[:, tracks.joints.index(joint)]).all(-1)
    given: IntArray = tracks.numbers[known]
    return sorted(set(numbers) - set(given.tolist()))


def some(numbers: Iterable[int]) -> str:
    """Frame numbers for a sentence: the first few, and how many more."""
    found = list(numbers)
    first = ", ".join(map(str, found[:3]))
    more = f" and {len(found) - 3} more" if len(found) > 3 else ""
    return f"{'frame' if len(found) == 1 else 'frames'} {first}{more}"


def only_joint(tracks: JointTracks, name: str) -> str:
    """The joint of that name, or the only one whatever its name; of several others, the name itself."""
    return tracks.joints[0] if len(tracks.joints) == 1 else name


def _cut(whole: MeshSequence, spec: SubjectSpec) -> MeshSequence:
    """The frames that the scene file asks for."""
    if spec.frames is None:
        return whole
    kept = [i for i, number in enumerate(whole.numbers) if number in spec.frames]
    if spec.frames[0] < whole.numbers[0] or spec.frames[-1] > whole.numbers[-1] or not kept:
        expected = f"frames of the capture, which has {whole.numbers[0]} to {whole.numbers[-1]}"
        raise SceneError(spec.file, f"{spec.key}.frames", expected, f"[{spec.frames[0]}, {spec.frames[-1]}]")
    files = tuple(whole.files[i] for i in kept) if whole.per_frame else whole.files
    return replace(whole, numbers=tuple(whole.numbers[i] for i in kept), files=files)


def _track_files(spec: SubjectSpec) -> set[FilePath]:
    """Every track file once."""
    files = {part.track for part in spec.parts.values() if isinstance(part, NearTrackSpec)}
    if isinstance(spec.facing, FilePath):
        files.add(spec.facing)
    return files if spec.gaze is None else files | {spec.gaze.eye, spec.gaze.target}


def _part(
    part: PartSpec,
    name: str,
    spec: SubjectSpec,
    *,
    sequence: MeshSequence,
    tracks: Tracks,
    skeleton: BvhMotion | None,
    reading: Callable[..., MeshSequence],
) -> Part:
    """An interest volume."""
    match part:
        case NearTrackSpec():
            known = tracks[part.track]
            _check_known(part.joints, known.joints, spec, f"{dotted(f'{spec.key}.parts', name)}.joint")
            return NearTrack(known, part.joints, part.radius)
        case OwnMeshSpec():
            return OwnMesh(reading(part.path.path, name=f"{spec.name}.{name}", fps=sequence.fps))
        case InBoxSpec():
            centre, size = np.array(part.centre), np.array(part.size)
            return InBox(
                to_metres_z_up(centre, units="m", up=spec.up), np.abs(to_metres_z_up(size, units="m", up=spec.up))
            )
        case WithLabelSpec():
            return WithLabel(part.label)
        case NearBonesSpec():
            assert skeleton is not None, "load_scene refuses bones without a skeleton"
            starts = {skeleton.tracks.joints[parent] for parent in skeleton.parents if parent >= 0}
            bones = tuple(joint for joint in skeleton.tracks.joints if joint in starts)
            _check_known(part.bones, bones, spec, f"{dotted(f'{spec.key}.parts', name)}.bones")
            return NearBones(skeleton.tracks, skeleton.parents, part.bones)


def _check_known(names: tuple[str, ...], known: tuple[str, ...], spec: SubjectSpec, key: str) -> None:
    """Joints or bones that the files have."""
    for name in names:
        if name not in known:
            raise SceneError(spec.file, key, listed(known), shown(name) + suggestion(name, known))


def _facing(spec: SubjectSpec, sequence: MeshSequence, tracks: Tracks) -> float | JointTracks | None:
    """As given, or None."""
    if not isinstance(spec.facing, FilePath):
        return spec.facing
    found = tracks[spec.facing]
    joint = _own_joint(found, FACING, spec, f"{spec.key}.facing")
    missing = missing_frames(found, joint, sequence.numbers)
    if missing:
        expected = "a direction in every frame of the capture"
        raise SceneError(spec.file, f"{spec.key}.facing", expected, f"none in {some(missing)}")
    return found


def _gaze(spec: SubjectSpec, gaze: GazeSpec, tracks: Tracks) -> GazeTracks:
    """As given."""
    _own_joint(tracks[gaze.eye], EYE, spec, f"{spec.key}.gaze.eye")
    _own_joint(tracks[gaze.target], TARGET, spec, f"{spec.key}.gaze.target")
    return GazeTracks(tracks[gaze.eye], tracks[gaze.target])


def _own_joint(tracks: JointTracks, name: str, spec: SubjectSpec, key: str) -> str:
    """The joint of that name, or the only one."""
    joint = only_joint(tracks, name)
    if joint not in tracks.joints:
        expected = f"a track file with a joint {shown(name)}, or with a single joint"
        raise SceneError(spec.file, key, expected, shown(", ".join(tracks.joints)))
    return joint
