"""The check on the meshes, fed from the scene file: parts, cones, things held, tolerances.

Everybody is checked against everybody else and every fixed prop, two by two, and each two in stretches: a key segment
of theirs, or what lies between two. Each stretch is measured with A's capture at rest and B placed beside it, so that
what was found holds wherever the two stand, and is kept until the frames, their relative placements or what is asked of
them change.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations, pairwise, product
from typing import Any, Final

import numpy as np

from mhvedit.constraints.visibility import sight_cone
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.planar import apply_pose
from mhvedit.pipeline.bodies import bodies_of, frames_off_floor
from mhvedit.pipeline.depths import relative_placements
from mhvedit.pipeline.job import Job
from mhvedit.pipeline.keys import frames_key, part_key, segment_parts
from mhvedit.pipeline.people import Person
from mhvedit.pipeline.shown import shown_people, shown_subjects
from mhvedit.pipeline.store import Arrays, Key
from mhvedit.pipeline.terms import segment_pair
from mhvedit.project.schema import SegmentSpec
from mhvedit.scene.checks import REACH, Progress, SegmentSight, check_scene
from mhvedit.scene.contact import TOUCH, ContactSlack, Verdict
from mhvedit.scene.edit import EditedScene, SubjectEdit
from mhvedit.scene.motion import AddedMotion, added_motion, sole_points
from mhvedit.scene.report import PairReport, SceneReport, SegmentReport, SightReport
from mhvedit.scene.shown import shown_scene
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.volumes.parts import OwnMesh, select_points

CHECK: Final = 1  # of what is kept of a stretch; raise it when the check changes
SOLES: Final = 1  # of what is kept of a capture


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
        between_frames: sub-steps between frames; with any, nothing is kept.
        workers: threads.
        progress: told after every frame.
    """
    people, job = shown_people(people, scene), replace(job, subjects=shown_subjects(job.subjects, scene))
    scene = shown_scene(scene)
    pairs = [*combinations(scene.subjects, 2), *product(scene.subjects, _obstacles(job))]
    reports: list[SceneReport] = []
    for done, pair in enumerate(pairs):
        own = pair_scene(job, scene, pair)

        def tell(frames: int, _: int, done: int = done) -> None:
            if progress is not None:
                progress(done * scene.n_frames + frames, len(pairs) * scene.n_frames)

        if between_frames:
            found = _measured(job, people, own, between_frames=between_frames, workers=workers, progress=tell)
        else:
            found = _in_stretches(job, people, own, workers=workers, progress=tell)
        reports.append(found)
    segments = {segment.name: segment for report in reports for segment in report.segments}
    return SceneReport(
        name=scene.name,
        n_frames=scene.n_frames,
        fps=scene.fps,
        reach=REACH,
        between_frames=between_frames,
        pairs=tuple(pair for report in reports for pair in report.pairs),
        segments=tuple(segments[segment.name] for segment in scene.segments),
        motions=tuple(_motion(job, name, edit) for name, edit in scene.subjects.items()),
        off_floor=_off_floor(job, people, scene),
    )


def _off_floor(job: Job, people: Mapping[str, Person], scene: EditedScene) -> dict[str, tuple[int, ...]]:
    """Frames in which somebody leaves the floor; empty where there is none."""
    floor = np.array(job.scene.stage.floor)
    if not len(floor):
        return {}
    sources = {name: edit.source for name, edit in scene.subjects.items()}
    bodies = bodies_of(job.scene, people, sources, job.store)
    return {
        name: tuple(frames_off_floor(bodies[name], edit.placements, floor)) for name, edit in scene.subjects.items()
    }


def pair_scene(job: Job, scene: EditedScene, pair: tuple[str, str]) -> EditedScene:
    """A scene with two of its subjects alone, or with one and a prop.

    Args:
        job: the scene file it was made from.
        scene: the edit.
        pair: their names.
    """
    subjects = {name: scene.subjects[name] for name in pair if name in scene.subjects}
    for name in pair:
        if name in job.props:
            prop, n = job.props[name], scene.n_frames
            subjects[name] = SubjectEdit(np.full(n, prop.sequence.numbers[0]), np.tile(prop.place, (n, 1)))
    return replace(scene, subjects=subjects, segments=tuple(s for s in scene.segments if set(s.between) == set(pair)))


def _obstacles(job: Job) -> list[str]:
    """Props that do not move."""
    return [name for name, prop in job.props.items() if prop.spec.kind == "fixed"]


def _in_stretches(
    job: Job, people: Mapping[str, Person], scene: EditedScene, *, workers: int, progress: Progress
) -> SceneReport:
    """The check of two people from its stretches."""
    found = []
    for start, stop in stretches(scene):
        part = _stretch(scene, start, stop)

        def tell(done: int, _: int, start: int = start) -> None:
            progress(start + done, scene.n_frames)

        def build(part: EditedScene = part, start: int = start, tell: Progress = tell) -> Arrays:
            return _as_arrays(_measured(job, people, part, first=start, workers=workers, progress=tell))

        found.append(job.store.arrays(_key(job, people, part, start), build))
        progress(stop, scene.n_frames)
    return _joined(job, scene, found)


def stretches(scene: EditedScene) -> Iterator[tuple[int, int]]:
    """First frame, and the one past the last, of every key segment and of what lies before, between and after them."""
    bounds = {0, scene.n_frames, *(s.start for s in scene.segments), *(s.stop for s in scene.segments)}
    ordered = sorted(bounds)
    yield from pairwise(ordered)


def _stretch(scene: EditedScene, start: int, stop: int) -> EditedScene:
    """Some frames of a scene of two, with A's capture at rest."""
    (a, first), (b, second) = scene.subjects.items()
    beside = relative_placements(first.placements[start:stop], second.placements[start:stop])
    subjects = {
        a: SubjectEdit(first.source[start:stop], np.zeros((stop - start, 3))),
        b: SubjectEdit(second.source[start:stop], beside),
    }
    segments = tuple(
        replace(s, start=s.start - start, stop=s.stop - start)
        for s in scene.segments
        if start <= s.start and s.stop <= stop
    )
    return replace(scene, n_frames=stop - start, subjects=subjects, segments=segments)


def _key(job: Job, people: Mapping[str, Person], part: EditedScene, start: int) -> Key:
    """Everything that the check of a stretch depends on; its sentences name frames, so where it starts counts."""
    known, specs = job.store.contents, {spec.name: spec for spec in job.scene.segments}
    sides = []
    for name, edit in part.subjects.items():
        own = job.scene.props[name] if name in job.props else job.scene.subjects[name]
        held = {} if name in job.props else job.subjects[name].held
        things = {n: frames_key(thing, edit.source, known) for n, thing in held.items()}
        frames = frames_key(_captures(job)[name], edit.source, known)
        sides.append((frames, things, own.units, own.up, edit.placements.tolist()))
    asked = []
    for segment in part.segments:
        spec, subjects = specs[segment.name], [job.subjects[name] for name in segment.between]
        numbers = [
            np.array(
                [subject.sequence.origin(n) for n in part.subjects[name].source[segment.start : segment.stop].tolist()]
            )
            for name, subject in zip(segment.between, subjects, strict=True)
        ]
        parts = [
            (name, part_key(subject.parts[name], own, known))
            for name, subject, own in zip(segment_parts(spec), subjects, numbers, strict=True)
        ]
        sight = _sight(job, spec, people)
        looks = None if sight is None else (
            sight.first, sight.stop, [(c.eye.tolist(), c.direction.tolist(), c.half_angle) for c in (sight.a, sight.b)],
        )  # fmt: skip
        span = (segment.start, segment.stop)
        asked.append((span, segment.interaction, segment.between, parts, _slack(job, spec), looks))
    return ("check", CHECK, REACH, start, sides, asked)


def _as_arrays(report: SceneReport) -> Arrays:
    """A stretch as it is kept: of the pair, and of its segment if it is one."""
    pair = report.pairs[0]
    arrays: dict[str, np.ndarray[Any, Any]] = {
        "gap": pair.gap,
        "crossing": pair.crossing,
        "where": pair.where,
        "solids": np.array([solids or ("", "") for solids in pair.solids], np.str_).reshape(-1, 2),
    }
    for segment in report.segments:
        arrays |= {
            "body_gap": segment.body_gap,
            "part_gap": segment.part_gap,
            "reach_gap": segment.reach_gap,
            "part_place": segment.part_place,
            "verdict": np.array([segment.verdict.sentence, "yes" if segment.verdict.agrees else ""]),
        }
        if segment.sight is not None:
            arrays["sight"] = np.array([segment.sight.a_sees_b, segment.sight.b_sees_a], np.bool_)
            arrays["sight_first"] = np.array(segment.sight.first)
    return arrays


def _joined(job: Job, scene: EditedScene, found: list[Arrays]) -> SceneReport:
    """The report on two people from its stretches."""
    a, b = scene.subjects
    at_rest = scene.subjects[a].placements
    where = np.concatenate([own["where"] for own in found])
    pair = PairReport(
        between=(a, b),
        gap=np.concatenate([own["gap"] for own in found]),
        crossing=np.concatenate([own["crossing"] for own in found]),
        where=_placed(at_rest, where),
        solids=tuple((str(x), str(y)) if x else None for own in found for x, y in own["solids"]),
        between_gap=None,
    )
    specs = {spec.name: spec for spec in job.scene.segments}
    by_start = {start: own for (start, _), own in zip(stretches(scene), found, strict=True)}
    segments = []
    for segment in scene.segments:
        own = by_start[segment.start]
        place = at_rest if segment.between[0] == a else scene.subjects[b].placements
        sentence, agrees = (str(word) for word in own["verdict"])
        sight = None
        if "sight" in own:
            looks = (tuple(bool(x) for x in row) for row in own["sight"])
            sight = SightReport(int(own["sight_first"]), *looks)
        segments.append(
            SegmentReport(
                name=segment.name,
                between=segment.between,
                interaction=segment.interaction,
                parts=segment_parts(specs[segment.name]),
                start=segment.start,
                stop=segment.stop,
                body_gap=own["body_gap"],
                part_gap=own["part_gap"],
                reach_gap=own["reach_gap"],
                part_place=_placed(place[segment.start : segment.stop], own["part_place"]),
                verdict=Verdict(bool(agrees), sentence),
                sight=sight,
            )
        )
    return SceneReport(
        name=scene.name,
        n_frames=scene.n_frames,
        fps=scene.fps,
        reach=REACH,
        between_frames=0,
        pairs=(pair,),
        segments=tuple(segments),
        motions=(),
    )


def _placed(placements: FloatArray, points: FloatArray) -> FloatArray:
    """(N, 3) points, one a frame, where a subject's capture stands in the world."""
    return np.array([apply_pose(pose, point) for pose, point in zip(placements, points, strict=True)]).reshape(-1, 3)


def _motion(job: Job, name: str, edit: SubjectEdit) -> AddedMotion:
    """What the edit adds to a subject's own motion."""
    subject, spec = job.subjects[name], job.scene.subjects[name]
    numbers = np.unique(edit.source)

    def build() -> Arrays:
        meshes = (subject.sequence.mesh(int(number)).vertices for number in numbers)
        soles, centres = zip(*((sole_points(vertices), vertices.mean(0)) for vertices in meshes), strict=True)
        sizes = np.cumsum([len(own) for own in soles])
        return {"soles": np.concatenate(soles), "stops": sizes, "centres": np.array(centres)}

    key = ("soles", SOLES, frames_key(subject.sequence, numbers, job.store.contents), spec.units, spec.up)
    kept = job.store.arrays(key, build)
    soles = np.split(kept["soles"], kept["stops"][:-1])
    rows = np.searchsorted(numbers, edit.source)
    return added_motion(name, edit.placements, soles=[soles[row] for row in rows], centres=kept["centres"][rows])


def _measured(
    job: Job,
    people: Mapping[str, Person],
    scene: EditedScene,
    *,
    first: int = 0,
    between_frames: int = 0,
    workers: int = 1,
    progress: Progress | None = None,
) -> SceneReport:
    """Check a scene, or a stretch of one."""
    specs = {spec.name: spec for spec in job.scene.segments}

    def part_vertices(subject: str, part: str, number: int, mesh: Mesh) -> BoolArray:
        chosen, sequence = job.subjects[subject].parts[part], job.subjects[subject].sequence
        if isinstance(chosen, OwnMesh):
            return np.ones(len(mesh.vertices), np.bool_)
        captured = sequence.origin(number)  # where tracks and boxes are right; vertices keep their order
        mesh = mesh if captured == number else sequence.mesh(captured)
        return select_points(chosen, mesh.vertices, mesh=mesh, number=captured)

    return check_scene(
        scene,
        _captures(job),
        part_vertices=part_vertices,
        parts_of_segment={name: segment_parts(spec) for name, spec in specs.items()},
        slack={name: _slack(job, spec) for name, spec in specs.items()},
        sight={name: sight for name, spec in specs.items() if (sight := _sight(job, spec, people)) is not None},
        held={name: subject.held for name, subject in job.subjects.items()},
        first=first,
        between_frames=between_frames,
        workers=workers,
        progress=progress,
    )


def _captures(job: Job) -> dict[str, MeshSequence]:
    """Of subjects and props."""
    people = {name: subject.sequence for name, subject in job.subjects.items()}
    return people | {name: prop.sequence for name, prop in job.props.items()}


def _slack(job: Job, spec: SegmentSpec) -> ContactSlack:
    tolerance = spec.tolerance
    near = max(TOUCH, tolerance.voxels * job.scene.search.voxel)
    return ContactSlack(tolerance.frames, near, tolerance.apart)


def _sight(job: Job, spec: SegmentSpec, people: Mapping[str, Person]) -> SegmentSight | None:
    if spec.visibility is None:
        return None
    pair = segment_pair(spec, people, job.fps)
    frames = spec.visibility.frames or range(pair.n_frames)
    a, b = spec.between
    cones = [
        sight_cone(people[name].gaze, numbers[np.array(frames)], half_angle=spec.visibility.half_angle)
        for name, numbers in ((a, pair.a), (b, pair.b))
    ]
    return SegmentSight(cones[0], cones[1], frames.start, frames.stop)
