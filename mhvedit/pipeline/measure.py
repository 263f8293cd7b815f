"""The check on the meshes, fed from the scene file: parts, cones, things held, tolerances."""

from collections.abc import Mapping

import numpy as np

from mhvedit.constraints.visibility import sight_cone
from mhvedit.geometry.arrays import BoolArray
from mhvedit.pipeline.job import Job
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.segments import segment_pair, segment_parts
from mhvedit.project.schema import SegmentSpec
from mhvedit.scene.checks import Progress, SegmentSight, check_scene
from mhvedit.scene.contact import TOUCH, ContactSlack
from mhvedit.scene.edit import EditedScene
from mhvedit.scene.report import SceneReport
from mhvedit.sequences.meshes import Mesh
from mhvedit.volumes.parts import OwnMesh, select_points


def measure_scene(
    job: Job,
    people: Mapping[str, Person],
    scene: EditedScene,
    *,
    between_frames: int = 0,
    workers: int = 1,
    progress: Progress | None = None,
) -> SceneReport:
    """Check an edited scene on its meshes.

    Args:
        job: the scene file it was made from.
        people: by name.
        scene: the edit.
        between_frames: sub-steps between frames.
        workers: threads.
        progress: told after every frame.
    """
    specs = {spec.name: spec for spec in job.scene.segments}

    def part_vertices(subject: str, part: str, number: int, mesh: Mesh) -> BoolArray:
        chosen = job.subjects[subject].parts[part]
        if isinstance(chosen, OwnMesh):
            return np.ones(len(mesh.vertices), np.bool_)
        return select_points(chosen, mesh.vertices, mesh=mesh, number=number)

    return check_scene(
        scene,
        {name: subject.sequence for name, subject in job.subjects.items()},
        part_vertices=part_vertices,
        parts_of_segment={name: segment_parts(spec) for name, spec in specs.items()},
        slack={name: _slack(job, spec) for name, spec in specs.items()},
        sight={name: sight for name, spec in specs.items() if (sight := _sight(job, spec, people)) is not None},
        held={
            name: {part: own.sequence for part, own in subject.parts.items() if isinstance(own, OwnMesh)}
            for name, subject in job.subjects.items()
        },
        between_frames=between_frames,
        workers=workers,
        progress=progress,
    )


def _slack(job: Job, spec: SegmentSpec) -> ContactSlack:
    tolerance = spec.tolerance
    near = max(TOUCH, tolerance.voxels * job.scene.search.voxel)
    return ContactSlack(tolerance.frames, near, tolerance.apart)


def _sight(job: Job, spec: SegmentSpec, people: Mapping[str, Person]) -> SegmentSight | None:
    if spec.visibility is None:
        return None
    pair = segment_pair(job.scene, spec, people, job.fps)
    frames = spec.visibility.frames or range(pair.n_frames)
    a, b = spec.between
    cones = [
        sight_cone(people[name].gaze, numbers[np.array(frames)], half_angle=spec.visibility.half_angle)
        for name, numbers in ((a, pair.a), (b, pair.b))
    ]
    return SegmentSight(cones[0], cones[1], frames.start, frames.stop)
