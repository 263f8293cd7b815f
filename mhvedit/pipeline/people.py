"""What is known of each subject before anyone meets: its canonical frame, where it faces and looks, where its centre is."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import rotation
from mhvedit.project.schema import SceneFile, SubjectSpec
from mhvedit.project.subjects import Subject
from mhvedit.sequences.bodies import track_body
from mhvedit.sequences.canonical import capture_from_canonical
from mhvedit.sequences.facing import facing_from_tracks, facing_of_body
from mhvedit.sequences.gaze import gaze_from_tracks, gaze_of_body
from mhvedit.sequences.meshes import Facing, Gaze, Mesh, MeshSequence
from mhvedit.pipeline.store import Store, capture_signature


@dataclass(frozen=True, slots=True, eq=False)
class Person:
    """A subject, ready to be placed. Facing, gaze and centres are in the capture's frame."""

    subject: Subject
    signature: tuple[object, ...]  # changes when the capture does
    pose: FloatArray  # (3,) capture_from_canonical
    facing: Facing
    gaze: Gaze
    centres: FloatArray  # (T, 2) m, area centroid of every frame in plan
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


def meet_people(scene: SceneFile, subjects: Mapping[str, Subject], store: Store) -> dict[str, Person]:
    """Find out about every subject; estimates are kept in the store.

    Args:
        scene: the scene file.
        subjects: opened.
        store: where estimates are kept between runs.
    """
    return {name: _person(subjects[name], spec, store) for name, spec in scene.subjects.items()}


def _person(subject: Subject, spec: SubjectSpec, store: Store) -> Person:
    sequence = subject.sequence
    given = subject.facing if isinstance(subject.facing, float) else None
    tracked = None if subject.facing is None or given is not None else facing_from_tracks(subject.facing)
    signature = capture_signature(sequence, units=spec.units, up=spec.up)
    key = ("person", 1, signature, given, tracked is not None and tracked.yaw.tobytes())
    arrays = store.arrays(key, lambda: _measured(sequence, given, tracked))
    numbers = np.array(sequence.numbers)
    gaze = Gaze(numbers, arrays["eye"], arrays["direction"])
    if subject.gaze is not None:
        gaze = gaze_from_tracks(subject.gaze.eye, subject.gaze.target)
    estimated = tuple(n for n, v in (("facing", subject.facing), ("gaze", subject.gaze)) if v is None)
    return Person(
        subject, signature, arrays["pose"], Facing(numbers, arrays["yaw"], arrays["trust"]), gaze, arrays["centres"], estimated
    )


def _measured(sequence: MeshSequence, given: float | None, tracked: Facing | None) -> dict[str, FloatArray]:
    """Everything that takes a look at all meshes."""
    count = len(sequence.numbers)
    yaw = None if given is None else np.full(count, given)
    if tracked is not None:
        yaw = tracked.yaw[np.searchsorted(tracked.numbers, sequence.numbers)]
    body = track_body(sequence, yaw=yaw)
    facing = facing_of_body(body, fps=sequence.fps)
    gaze = gaze_of_body(sequence, body)
    return {
        "pose": capture_from_canonical(sequence),
        "yaw": facing.yaw if yaw is None else yaw,
        "trust": facing.trust if yaw is None else np.ones(count),
        "eye": gaze.eye,
        "direction": gaze.direction,
        "centres": np.array([_centre(sequence.mesh(number)) for number in sequence.numbers]),
    }


def _centre(mesh: Mesh) -> FloatArray:
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return np.asarray(area @ corners.mean(1)[:, :2] / area.sum())


def canonical_gaze(person: Person) -> Gaze:
    """The gaze in the subject's canonical frame."""
    eye = np.array(person.gaze.eye)
    eye[:, :2] = (eye[:, :2] - person.pose[:2]) @ rotation(person.pose[2])
    direction = np.array(person.gaze.direction)
    direction[:, :2] = direction[:, :2] @ rotation(person.pose[2])
    return Gaze(person.gaze.numbers, eye, direction)
