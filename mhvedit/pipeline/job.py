"""The whole job, stage by stage: load, solve, choose, write."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from mhvedit.errors import SceneError
from mhvedit.optimise.stages import NoSolution
from mhvedit.pipeline.assemble import Assembly, assemble
from mhvedit.pipeline.misses import Miss, explain_empty
from mhvedit.pipeline.people import Person, meet_people
from mhvedit.pipeline.segments import SolvedSegment, solve_segment
from mhvedit.pipeline.store import Store
from mhvedit.project.captures import open_subjects, scene_fps
from mhvedit.project.scene_file import load_scene
from mhvedit.project.schema import SceneFile, SegmentSpec
from mhvedit.project.subjects import Subject

Progress = Callable[[str, float], None]  # stage in words, share of it that is done


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """A scene file with its captures open, ready to be solved."""

    scene: SceneFile
    subjects: Mapping[str, Subject]
    fps: float  # Hz, of the edited scene
    store: Store


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


def load(path: Path | str, *, cache: Path | None = None) -> Job:
    """Load a scene file and open what it names.

    Args:
        path: of the scene file.
        cache: folder for converted frames and intermediate results; None keeps nothing.

    Raises:
        MhveditError: something is wrong with the scene file or a capture.
    """
    scene = oriented(load_scene(Path(path)))
    subjects = open_subjects(scene, cache=None if cache is None else cache / "frames")
    return Job(scene, subjects, scene_fps(scene, subjects), Store(None if cache is None else cache / "results"))


def solve(job: Job, *, workers: int = 2, progress: Progress | None = None) -> Result:
    """Solve a scene: people, then every key segment, then the chain and the paths.

    Args:
        job: loaded.
        workers: threads; the result does not depend on it.
        progress: told what is being done.
    """
    tell = progress or (lambda stage, share: None)
    seconds: dict[str, float] = {}
    started = time.perf_counter()
    tell("looking at the captures", 0.0)
    people = meet_people(job.scene, job.subjects, job.store)
    seconds["captures"] = time.perf_counter() - started
    solved, misses = [], {}
    for spec in job.scene.segments:
        started = time.perf_counter()
        stage = f"segment {spec.name}"
        segment = solve_segment(
            job.scene,
            spec,
            people,
            fps=job.fps,
            store=job.store,
            workers=workers,
            progress=lambda share, stage=stage: tell(stage, share),  # type: ignore[misc]
        )
        solved.append(segment)
        if len(segment.group) == 0:
            tell(f"{stage}: why nothing fits", 0.0)
            misses[spec.name] = explain_empty(job.scene, segment, people, store=job.store, workers=workers)
        seconds[stage] = time.perf_counter() - started
    tell("chain and paths", 0.0)
    started = time.perf_counter()
    result = Result(job, people, tuple(solved), None, None, misses, seconds)
    result = choose(result, {})
    seconds["chain and paths"] = time.perf_counter() - started
    return result


def choose(result: Result, picked: Mapping[str, int]) -> Result:
    """The scene again, with some solutions picked by the editor.

    Args:
        result: of `solve`.
        picked: row of the solution group by segment name; the chain chooses the others.

    Raises:
        SceneError: there is no such segment, or no such row.
    """
    for name, row in picked.items():
        known = {s.spec.name: len(s.group) for s in result.segments}
        if name not in known:
            raise SceneError(result.job.scene.file, "pick", f"a segment of {', '.join(known)}", repr(name))
        if not 0 <= row < known[name]:
            expected = f"a row from 0 to {known[name] - 1}" if known[name] else "a segment that has solutions"
            raise SceneError(result.job.scene.file, f"pick {name}", expected, str(row))
    try:
        assembly = assemble(result.job.scene, result.people, result.segments, fps=result.job.fps, picked=picked)
    except NoSolution as failure:
        return replace(result, assembly=None, failure=failure)
    return replace(result, assembly=assembly, failure=None)


def oriented(scene: SceneFile) -> SceneFile:
    """The scene with all segments told from the same side: the first segment's first subject is A everywhere.

    Raises:
        SceneError: more than two subjects take part, which this version cannot solve.
    """
    a, b = scene.segments[0].between
    for spec in scene.segments:
        if set(spec.between) != {a, b}:
            raise SceneError(
                scene.file, f"{spec.key}.between", f'the same two subjects in all segments ("{a}" and "{b}")',
                " and ".join(f'"{name}"' for name in spec.between),
            )  # fmt: skip
    idle = [subject.key for name, subject in scene.subjects.items() if name not in (a, b)]
    if idle:
        raise SceneError(scene.file, idle[0], f'no subjects but the two of the segments ("{a}" and "{b}")', "another")
    return replace(scene, segments=tuple(s if s.between == (a, b) else _mirrored(s) for s in scene.segments))


def _mirrored(spec: SegmentSpec) -> SegmentSpec:
    apart = None if spec.apart is None else tuple((second, first) for first, second in spec.apart)
    return replace(spec, between=(spec.between[1], spec.between[0]), interaction=spec.interaction.mirrored, apart=apart)
