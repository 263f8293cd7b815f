"""The whole job, stage by stage: load, solve, choose, write."""

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, CancelledError, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event
from typing import TypeVar

import numpy as np

from mhvedit.errors import SceneError
from mhvedit.geometry.planar import invert
from mhvedit.optimise.stages import NoSolution
from mhvedit.pipeline.arrange import arranged
from mhvedit.pipeline.assemble import Assembly
from mhvedit.pipeline.misses import Miss, explain_empty
from mhvedit.pipeline.people import Person, meet_people
from mhvedit.pipeline.picks import rows_left
from mhvedit.pipeline.progress import Progress, silent
from mhvedit.pipeline.props_pass import with_props
from mhvedit.pipeline.segments import SolvedSegment, solve_segment
from mhvedit.pipeline.stops_pass import with_stops
from mhvedit.pipeline.store import Store, open_store
from mhvedit.project.captures import open_subjects, scene_fps
from mhvedit.project.props import Prop, open_props
from mhvedit.project.scene_file import load_scene
from mhvedit.project.schema import SceneFile, SegmentSpec, Spot
from mhvedit.project.subjects import Subject

T = TypeVar("T")
AT_ONCE = 2  # segments that are worked on at a time: one is voxelised while another is searched


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """A scene file with its captures open, ready to be solved."""

    scene: SceneFile
    subjects: Mapping[str, Subject]
    fps: float  # Hz, of the edited scene
    store: Store
    props: Mapping[str, Prop]


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """What a solve found."""

    job: Job
    people: Mapping[str, Person]
    segments: tuple[SolvedSegment, ...]
    assembly: Assembly | None  # None where there is no answer
    failure: NoSolution | None
    misses: Mapping[str, Miss]  # by segment, for empty groups
    seconds: Mapping[str, float]  # by stage

    def segment(self, name: str) -> SolvedSegment:
        """A key segment by name."""
        return next(s for s in self.segments if s.spec.name == name)


def load(path: Path | str, *, cache: Path | None = None, workers: int = 2) -> Job:
    """Load a scene file and open what it names.

    Args:
        path: of the scene file.
        cache: folder for converted frames and intermediate results; None keeps nothing.
        workers: threads where a capture is repaired; the result does not depend on it.

    Raises:
        MhveditError: something is wrong with the scene file or a capture.
    """
    scene = oriented(load_scene(Path(path)))
    store = open_store(cache)
    subjects = open_subjects(scene, cache=None if cache is None else cache / "frames", known=store.contents)
    props = open_props(scene, cache=None if cache is None else cache / "frames")
    if any(spec.kind == "simulated" for spec in scene.props.values()):
        from mhvedit.pipeline.props_world import require_simulable  # takes a second to load, and few scenes need it

        require_simulable(scene, props)
    if any(spec.self_collision is not None for spec in scene.subjects.values()):
        from mhvedit.pipeline.repair import repaired_subjects  # likewise

        subjects = repaired_subjects(scene, subjects, store, workers=workers)
    return Job(scene, subjects, scene_fps(scene, subjects), store, props)


def solve(
    job: Job,
    *,
    workers: int = 2,
    progress: Progress | None = None,
    previous: Result | None = None,
    solved: Callable[[SolvedSegment], None] | None = None,
) -> Result:
    """Solve a scene: people, then every key segment, then the chain and the paths.

    Args:
        job: loaded.
        workers: threads; the result does not depend on it.
        progress: told what is being done.
        previous: of an earlier solve in this process; what has not changed since is taken from it.
        solved: given each segment as soon as it is solved, in the thread that did.
    """
    if previous is not None:
        job = replace(job, store=replace(job.store, earlier=previous.job.store.used, used={}))
    tell = progress or silent
    seconds: dict[str, float] = {}
    started = time.perf_counter()
    tell("looking at the captures", 0.0)
    people = meet_people(job.scene, job.subjects, job.store, workers=workers)
    seconds["captures"] = time.perf_counter() - started
    found = _solve_segments(job, people, workers=workers, tell=tell, previous=previous, solved=solved)
    misses = {segment.name: miss for segment, miss, _ in found if miss is not None}
    seconds |= {f"segment {segment.name}": spent for segment, _, spent in found}
    tell("chain and paths", 0.0)
    started = time.perf_counter()
    result = Result(job, people, tuple(segment for segment, _, _ in found), None, None, misses, seconds)
    result = choose(result, {}, workers=workers)
    seconds["chain and paths"] = time.perf_counter() - started
    return result


def _solve_segments(
    job: Job,
    people: Mapping[str, Person],
    *,
    workers: int,
    tell: Progress,
    previous: Result | None,
    solved: Callable[[SolvedSegment], None] | None,
) -> list[tuple[SolvedSegment, Miss | None, float]]:
    """Every key segment, why nothing fits where it is empty, and the seconds that it took."""
    stopped = Event()

    def one(spec: SegmentSpec) -> tuple[SolvedSegment, Miss | None, float]:
        started = time.perf_counter()
        stage = f"segment {spec.name}"

        def told(share: float) -> None:
            if stopped.is_set():
                raise CancelledError
            tell(stage, share)

        segment = solve_segment(job.scene, spec, people, fps=job.fps, store=job.store, workers=workers, progress=told)
        segment, miss = _carried(segment, previous), None
        if segment.n_solutions == 0:
            tell(f"{stage}: why nothing fits", 0.0)
            miss = explain_empty(job.scene, segment, people, store=job.store, workers=workers)
        if solved is not None:
            solved(segment)
        return segment.kept(), miss, time.perf_counter() - started

    with ThreadPoolExecutor(min(workers, AT_ONCE)) as pool:
        futures = [pool.submit(one, spec) for spec in job.scene.segments]
        try:
            wait(futures, return_when=FIRST_EXCEPTION)
        except BaseException:  # Ctrl-C: what is under way stops; where a segment fails, the other is finished and kept
            stopped.set()
            raise
        finally:
            pool.shutdown(cancel_futures=True)
    return _results(futures)


def _results(futures: Sequence[Future[T]]) -> list[T]:
    """What has come of all, or the first error that is not just for having been called off."""
    for future in futures:
        if not future.cancelled() and future.exception() is not None:
            future.result()
    return [future.result() for future in futures]


def _carried(segment: SolvedSegment, previous: Result | None) -> SolvedSegment:
    """A segment with all that the earlier solve has in memory of it."""
    if previous is None:
        return segment
    stages = segment.stages
    for key in (*stages.of_volumes, stages.of_contact, stages.of_bodies, stages.of_sight, stages.of_group):
        if key is not None:
            stages.store.carry(key)
    same = (s for s in previous.segments if s.identity == segment.identity and s.spec == segment.spec)
    return next(same, segment)


def choose(result: Result, picked: Mapping[str, int], *, workers: int = 2) -> Result:
    """The scene again, with some solutions picked.

    Args:
        result: of `solve`.
        picked: row of the solution group by segment name, whatever `pin` and `exclude` in the scene file say; the
            chain chooses the others, among what these leave.
        workers: threads; the result does not depend on it.

    Raises:
        SceneError: there is no such segment, or no such row.
    """
    for name, row in picked.items():
        known = {s.spec.name: s.n_solutions for s in result.segments}
        if name not in known:
            raise SceneError(result.job.scene.file, "pick", f"a segment of {', '.join(known)}", repr(name))
        if not 0 <= row < known[name]:
            expected = f"a row from 0 to {known[name] - 1}" if known[name] else "a segment that has solutions"
            raise SceneError(result.job.scene.file, f"pick {name}", expected, str(row))
    scene, people = result.job.scene, result.people
    try:
        rows = [
            np.array([picked[spec.name]]) if spec.name in picked else rows_left(spec, segment, people)
            for spec, segment in zip(scene.segments, result.segments, strict=True)
        ]
        job = result.job
        assembly = arranged(
            scene, people, result.segments, rows, fps=job.fps, props=job.props, store=job.store, workers=workers
        )
    except NoSolution as failure:
        return replace(result, assembly=None, failure=failure)
    assembly = with_stops(scene, assembly, people, job.props, job.store, workers=workers)
    assembly = with_props(scene, assembly, job.subjects, job.props, job.store)
    return replace(result, assembly=assembly, failure=None)


def oriented(scene: SceneFile) -> SceneFile:
    """The scene with all segments of two people told from one side: A is who is A where they first meet."""
    first: dict[frozenset[str], tuple[str, str]] = {}
    for spec in scene.segments:
        first.setdefault(frozenset(spec.between), spec.between)
    return replace(scene, segments=tuple(s if s.between in first.values() else _mirrored(s) for s in scene.segments))


def _mirrored(spec: SegmentSpec) -> SegmentSpec:
    return replace(
        spec,
        between=(spec.between[1], spec.between[0]),
        interaction=spec.interaction.mirrored,
        apart=None if spec.apart is None else tuple((second, first) for first, second in spec.apart),
        pin=None if spec.pin is None else mirrored_spot(spec.pin),
        exclude=tuple(replace(e, at=mirrored_spot(e.at), of_a=not e.of_a) for e in spec.exclude),
    )


def mirrored_spot(spot: Spot) -> Spot:
    """The same placement, told as A beside B."""
    x, y, yaw = invert(np.array([spot.x, spot.y, spot.yaw])).tolist()
    return Spot(x, y, yaw)
