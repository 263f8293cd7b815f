"""The tasks of a scene: which there are, what they need, and which of them other scenes share."""

from dataclasses import dataclass, replace
from pathlib import Path

from mhvedit.batch.records import named_paths
from mhvedit.pipeline.store import hashed
from mhvedit.project.schema import SceneFile, SegmentSpec, SubjectSpec

NOWHERE = Path()


@dataclass(frozen=True, slots=True)
class Task:
    """A subject to look at or a segment to solve; two tasks of one key do the same."""

    key: str
    name: str  # of the subject or segment
    needs: tuple[str, ...]  # keys of tasks
    size: float  # poses times frames; 0 for a subject


def scene_tasks(scene: SceneFile) -> tuple[Task, ...]:
    """The tasks that come before a scene can be finished, each after those that it needs, large segments first.

    Args:
        scene: the scene file.
    """
    subjects = {name: Task(subject_key(spec), name, (), 0.0) for name, spec in scene.subjects.items()}
    segments = [
        Task(
            segment_key(scene, spec),
            spec.name,
            tuple(subjects[name].key for name in spec.between),
            segment_size(scene, spec),
        )
        for spec in scene.segments
    ]
    return (*subjects.values(), *sorted(segments, key=lambda task: -task.size))


def subject_key(spec: SubjectSpec) -> str:
    """Everything that looking at a subject depends on, wherever that is asked."""
    return f"look-{hashed(_anywhere(spec))}"


def segment_key(scene: SceneFile, spec: SegmentSpec) -> str:
    """Everything that the solutions of a segment depend on; not what only chooses among them."""
    asked = replace(spec, index=0, name="", pin=None, exclude=())
    subjects = [_anywhere(scene.subjects[name]) for name in spec.between]
    around = (scene.fps, scene.stage, list(scene.props.values()))
    return f"segment-{hashed((asked, subjects, scene.search, around, list(named_paths(around))))}"


def segment_size(scene: SceneFile, spec: SegmentSpec) -> float:
    """How much a segment is to search: poses times frames."""
    poses = (scene.window_of(spec) / scene.search.step) ** 2 * scene.search.n_yaw
    return poses * max(len(spec.frames[name]) for name in spec.between)


def _anywhere(spec: SubjectSpec) -> SubjectSpec:
    """A subject without the scene file that it stands in."""
    return replace(spec, file=NOWHERE, key="")
