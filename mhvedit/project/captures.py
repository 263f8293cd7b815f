"""All subjects of a scene with their files open, and the frames that its segments ask of them."""

from collections.abc import Mapping
from pathlib import Path

from mhvedit.errors import SceneError
from mhvedit.project.schema import SceneFile, SegmentSpec, SubjectSpec
from mhvedit.project.segment_keys import check_visible_frames
from mhvedit.project.subjects import EYE, TARGET, Subject, missing_frames, only_joint, open_subject, some
from mhvedit.project.values import dotted, shown
from mhvedit.sequences.contents import Contents
from mhvedit.volumes.parts import NearBones, NearTrack, OwnMesh, Part


def open_subjects(scene: SceneFile, *, cache: Path | None, known: Contents | None = None) -> dict[str, Subject]:
    """Open all subjects of a scene, and check that they have the frames of its segments.

    Args:
        scene: from `load_scene`.
        cache: folder for converted meshes, or None for none.
        known: hashes of files that are remembered.

    Raises:
        SceneError: a joint, bone or frame that the scene file names is not there.
        CaptureError: a file cannot be used.
        MissingLibrary: a USD stage, and usd-core is not installed.
    """
    subjects = {name: open_subject(spec, cache=cache, known=known) for name, spec in scene.subjects.items()}
    check_frames(scene, subjects)
    return subjects


def scene_fps(scene: SceneFile, subjects: Mapping[str, Subject]) -> float:
    """Frames a second of the edited scene: as the file says, or those of the first subject's capture.

    Args:
        scene: from `load_scene`.
        subjects: opened, by name.
    """
    return subjects[next(iter(scene.subjects))].sequence.fps if scene.fps is None else scene.fps


def check_frames(scene: SceneFile, subjects: Mapping[str, Subject]) -> None:
    """Check that captures, own meshes, tracks and skeletons have the frames of the segments and marks that use them.

    Args:
        scene: from `load_scene`.
        subjects: opened, by name.

    Raises:
        SceneError: the first segment or mark that asks for frames that are not there, and some of these.
    """
    for segment in scene.segments:
        for who in segment.between:
            _check_capture(scene, segment, subjects[who])
            for name in _used_parts(segment, subjects[who]):
                _check_part(scene.subjects[who], segment, name, subjects[who].parts[name])
            if segment.visibility is not None:
                _check_gaze(scene.subjects[who], segment, subjects[who])
        a, b = (subjects[who].sequence.fps for who in segment.between)
        check_visible_frames(scene.file, segment, fps=scene_fps(scene, subjects), rates=(a, b))
    for mark in scene.stage.marks:
        numbers = subjects[mark.subject].sequence.numbers
        if mark.frame not in numbers:
            expected = f"a frame of {mark.subject}'s, {numbers[0]} to {numbers[-1]}"
            raise SceneError(scene.file, f"{mark.key}.frame", expected, str(mark.frame))


def _check_capture(scene: SceneFile, segment: SegmentSpec, subject: Subject) -> None:
    """The capture has the segment's frames."""
    wanted, numbers = segment.frames[subject.name], subject.sequence.numbers
    key, written = dotted(f"{segment.key}.frames", subject.name), f"[{wanted[0]}, {wanted[-1]}]"
    cut = scene.subjects[subject.name].frames is not None
    whose = f"{scene.subjects[subject.name].key}.frames" if cut else "the capture"
    if wanted[0] < numbers[0] or wanted[-1] > numbers[-1]:
        raise SceneError(scene.file, key, f"frames from {numbers[0]} to {numbers[-1]}, those of {whose}", written)
    missing = sorted(set(wanted) - set(numbers))
    if missing:
        raise SceneError(scene.file, key, f"frames that {whose} has", f"{written} without {some(missing)}")


def _used_parts(segment: SegmentSpec, subject: Subject) -> list[str]:
    """The segment's part, those that it keeps apart, and all that have meshes of their own, which are solid."""
    side = segment.between.index(subject.name)
    named = {segment.parts[subject.name]} | {pair[side] for pair in segment.apart or ()}
    return [name for name, part in subject.parts.items() if name in named or isinstance(part, OwnMesh)]


def _check_part(spec: SubjectSpec, segment: SegmentSpec, name: str, part: Part) -> None:
    """What marks a part is there in the segment's frames."""
    wanted = segment.frames[spec.name]
    key = dotted(f"{spec.key}.parts", name)
    span = f"frames {wanted[0]} to {wanted[-1]}, those of {segment.key}"
    match part:
        case OwnMesh():
            missing = sorted(set(wanted) - set(part.sequence.numbers))
            if missing:
                raise SceneError(spec.file, f"{key}.path", span, f"no {some(missing)}")
        case NearTrack():
            for joint in part.joints:
                missing = missing_frames(part.tracks, joint, wanted)
                if missing:
                    expected = f"joint {shown(joint)} in {span}"
                    raise SceneError(spec.file, f"{key}.track", expected, f"none in {some(missing)}")
        case NearBones():
            missing = sorted(set(wanted) - set(part.tracks.numbers.tolist()))
            if missing:
                raise SceneError(spec.file, f"{spec.key}.skeleton", span, f"no {some(missing)}")


def _check_gaze(spec: SubjectSpec, segment: SegmentSpec, subject: Subject) -> None:
    """A given gaze is there in the segment's frames."""
    if subject.gaze is None:
        return
    wanted = segment.frames[spec.name]
    for tracks, joint in ((subject.gaze.eye, EYE), (subject.gaze.target, TARGET)):
        missing = missing_frames(tracks, only_joint(tracks, joint), wanted)
        if missing:
            expected = f"a position in frames {wanted[0]} to {wanted[-1]}, those of {segment.key}"
            raise SceneError(spec.file, f"{spec.key}.gaze.{joint}", expected, f"none in {some(missing)}")
