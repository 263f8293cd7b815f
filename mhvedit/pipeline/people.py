"""What is known of each subject before anyone meets: canonical frame, facing and gaze, where its centre is."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mhvedit.errors import CaptureError, SceneError
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import rotation
from mhvedit.pipeline.store import Store, capture_signature
from mhvedit.project.schema import SceneFile, SubjectSpec
from mhvedit.project.subjects import Subject
from mhvedit.sequences.areas import place_of
from mhvedit.sequences.bodies import track_body
from mhvedit.sequences.canonical import capture_from_canonical
from mhvedit.sequences.facing import facing_from_tracks, facing_of_body
from mhvedit.sequences.gaze import gaze_from_tracks, gaze_of_body
from mhvedit.sequences.meshes import Facing, Gaze, JointTracks, MeshSequence

VERSION = 2  # of what is kept; raise it when an estimate changes


@dataclass(frozen=True, slots=True, eq=False)
class Person:
    """A subject, ready to be placed. Facing, gaze and centres are in the capture's frame."""

    subject: Subject
    signature: tuple[object, ...]  # changes when the capture does
    pose: FloatArray  # (3,) capture_from_canonical
    facing: Facing
    gaze: Gaze
    centres: FloatArray  # (T, 2) m, area centroid of every frame in plan
    bounds: FloatArray  # (T, 2, 3) m, lowest and highest coordinates of every frame
    estimated: tuple[str, ...]  # which of facing and gaze were estimated

    @property
    def sequence(self) -> MeshSequence:
        """The capture."""
        return self.subject.sequence

    def facing_over(self, numbers: IntArray) -> float:
        """Mean facing over frames, rad in the capture's frame; the middle frame's where the mean vanishes."""
        yaw = self.facing.yaw[np.searchsorted(self.facing.numbers, numbers)]
        mean = np.exp(1j * yaw).mean()
        return float(np.angle(mean) if abs(mean) > 1e-3 else yaw[len(yaw) // 2])

    def centres_at(self, numbers: IntArray) -> FloatArray:
        """(N, 2) m."""
        return self.centres[np.searchsorted(np.array(self.sequence.numbers), numbers)]


def meet_people(
    scene: SceneFile, subjects: Mapping[str, Subject], store: Store, *, workers: int = 1
) -> dict[str, Person]:
    """Find out about every subject; estimates are kept in the store.

    Args:
        scene: the scene file.
        subjects: opened.
        store: where estimates are kept between runs.
        workers: threads; the result does not depend on it.

    Raises:
        CaptureError: a frame of a capture cannot be used.
        SceneError: a given facing or gaze has no direction in some frame.
    """
    return {name: _person(subjects[name], spec, store, workers) for name, spec in scene.subjects.items()}


def _person(subject: Subject, spec: SubjectSpec, store: Store, workers: int) -> Person:
    sequence = subject.sequence
    signature = capture_signature(sequence, store.contents, units=spec.units, up=spec.up)
    numbers = np.array(sequence.numbers)
    facing = _given_facing(subject, spec, numbers)
    gaze = _given_gaze(subject, spec, numbers)
    plan = store.arrays(("plan", VERSION, signature), lambda: place_in_plan(sequence, workers=workers))
    if facing is None or gaze is None:
        given = None if facing is None else facing.yaw.tobytes()
        look = store.arrays(("look", VERSION, signature, given), lambda: _estimated(sequence, facing, workers))
        facing = facing or Facing(numbers, look["yaw"], look["trust"])
        gaze = gaze or Gaze(numbers, look["eye"], look["direction"])
    estimated = tuple(n for n, v in (("facing", subject.facing), ("gaze", subject.gaze)) if v is None)
    return Person(subject, signature, plan["pose"], facing, gaze, plan["centres"], plan["bounds"], estimated)


def _given_facing(subject: Subject, spec: SubjectSpec, numbers: IntArray) -> Facing | None:
    """The facing that the scene file gives, in every frame of the capture."""
    if subject.facing is None:
        return None
    if isinstance(subject.facing, float):
        return Facing(numbers, np.full(len(numbers), subject.facing), np.ones(len(numbers)))
    try:
        return facing_from_tracks(_in_frames(subject.facing, numbers))
    except SceneError as fault:
        raise SceneError(spec.file, f"{spec.key}.facing", fault.expected, fault.found) from fault


def _given_gaze(subject: Subject, spec: SubjectSpec, numbers: IntArray) -> Gaze | None:
    """The gaze that the scene file gives, in the frames of the capture that have one."""
    if subject.gaze is None:
        return None
    try:
        return gaze_from_tracks(_in_frames(subject.gaze.eye, numbers), _in_frames(subject.gaze.target, numbers))
    except SceneError as fault:
        raise SceneError(spec.file, f"{spec.key}.gaze", fault.expected, fault.found) from fault


def _in_frames(tracks: JointTracks, numbers: IntArray) -> JointTracks:
    """Tracks without the frames that the capture does not have."""
    kept = np.isin(tracks.numbers, numbers)
    return replace(tracks, numbers=tracks.numbers[kept], positions=tracks.positions[kept])


def place_in_plan(sequence: MeshSequence, *, workers: int) -> dict[str, FloatArray]:
    """Where the subject is in plan: its canonical frame, and its centre and bounds in every frame."""
    with ThreadPoolExecutor(workers) as pool:
        centres, spans = zip(*pool.map(partial(_place, sequence), sequence.numbers), strict=True)
    return {"pose": capture_from_canonical(sequence), "centres": np.array(centres), "bounds": np.array(spans)}


def _place(sequence: MeshSequence, number: int) -> tuple[FloatArray, FloatArray]:
    """Centre of area (2,) m and bounds (2, 3) m of one frame."""
    place = place_of(sequence.mesh(number)) if sequence.place is None else sequence.place(number)
    if np.isnan(place[0]):
        raise CaptureError(f"{sequence.name}, frame {number}", "faces that have an area", "none that has")
    return place[:2], place[2:].reshape(2, 3)


def _estimated(sequence: MeshSequence, facing: Facing | None, workers: int) -> dict[str, FloatArray]:
    """Facing and gaze from the meshes; a given facing is honoured."""
    body = track_body(sequence, yaw=None if facing is None else facing.yaw, workers=workers)
    found = facing_of_body(body, fps=sequence.fps)
    gaze = gaze_of_body(sequence, body, workers=workers)
    return {"yaw": found.yaw, "trust": found.trust, "eye": gaze.eye, "direction": gaze.direction}


def canonical_gaze(person: Person) -> Gaze:
    """The gaze in the subject's canonical frame."""
    eye = np.array(person.gaze.eye)
    eye[:, :2] = (eye[:, :2] - person.pose[:2]) @ rotation(person.pose[2])
    direction = np.array(person.gaze.direction)
    direction[:, :2] = direction[:, :2] @ rotation(person.pose[2])
    return Gaze(person.gaze.numbers, eye, direction)
