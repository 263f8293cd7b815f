"""What workers do: a subject, a segment, a scene, its variants. All that is large goes through the shared cache."""

import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from mhvedit.batch.records import record
from mhvedit.batch.variants import variant_scenes
from mhvedit.errors import MhveditError, OutputBusy
from mhvedit.pipeline.folders import EDIT, PAGE, REPORT, SOURCE
from mhvedit.pipeline.job import Job, load
from mhvedit.pipeline.misses import explain_empty
from mhvedit.pipeline.output import CACHE, solutions_path
from mhvedit.pipeline.people import meet_people
from mhvedit.pipeline.run import Outcome, run_scene
from mhvedit.pipeline.segments import solve_segment

DONE, NO, BAD = "done", "no answer", "bad"
PATIENCE: Final = 60.0  # s, in which a worker that was given up lets go of a folder
UNLIMITED: Final = 1e9  # GB; the batch looks after the cache that its scenes share
SHARED: Final = ("results", "frames")  # folders of the cache that scenes share


@dataclass(frozen=True, slots=True)
class Spent:
    """What a task that only fills the cache came to."""

    stage: str
    seconds: float


@dataclass(frozen=True, slots=True)
class SceneDone:
    """What came of a scene."""

    name: str
    verdict: str  # DONE, NO or BAD
    sentences: tuple[str, ...] = ()  # why not, or what to look at
    frames: int = 0
    cost: float | None = None  # m^2
    deepest_mm: float | None = None  # None where the meshes were not checked
    chosen: Mapping[str, int] = field(default_factory=dict)  # row of the solution group by segment
    files: tuple[str, ...] = ()  # in the scene's folder
    seconds: float = 0.0
    details: str = ""  # of what should not have happened


def look_at(scene: Path, cache: Path, subject: str) -> Spent:
    """Convert a capture and find out about its subject; what goes wrong is told by those who need it."""

    def look(job: Job) -> None:
        only = replace(job.scene, subjects={subject: job.scene.subjects[subject]})
        meet_people(only, job.subjects, job.store)

    return _warmed("look", scene, cache, look)


def solve_one(scene: Path, cache: Path, segment: str, *needed: Spent) -> Spent:
    """Find every placement of a segment, or why there is none; what goes wrong is told by those who need it.

    Args:
        scene: the scene file.
        cache: of the batch.
        segment: by name.
        needed: what was done before.
    """

    def find(job: Job) -> None:
        spec = next(spec for spec in job.scene.segments if spec.name == segment)
        only = {name: job.scene.subjects[name] for name in spec.between}
        people = meet_people(replace(job.scene, subjects=only), job.subjects, job.store)
        solved = solve_segment(job.scene, spec, people, fps=job.fps, store=job.store, workers=1)
        if solved.n_solutions == 0:
            explain_empty(job.scene, solved, people, store=job.store, workers=1)

    return _warmed("segment", scene, cache, find)


def finish_scene(
    name: str, scene: Path, out: Path, *needed: Spent, under: str, check: bool = True, report: bool = True
) -> SceneDone:
    """Choose the chain, write the edit, check it, draw the report, from what the cache holds; record what came of it.

    Args:
        name: of the scene's folder.
        scene: the scene file.
        out: output folder of the batch.
        needed: what was done before.
        under: key to record it under.
        check: as in `run_scene`.
        report: as in `run_scene`.
    """
    began = time.perf_counter()
    try:
        _share_cache(out, name)
        outcome = _patiently(
            lambda: run_scene(scene, out / name, workers=1, check=check, report=report, cache_gb=UNLIMITED)
        )
    except (MhveditError, OSError) as fault:
        return SceneDone(name, BAD, (" ".join(str(fault).split()),))
    except Exception as fault:  # a mistake of ours must not cost the other scenes
        sentence = f"{scene}: expected an answer, found {type(fault).__name__}: {' '.join(str(fault).split())}"
        return SceneDone(name, BAD, (sentence,), details=traceback.format_exc())
    done = _summed_up(name, outcome, page=check and report)
    done = replace(done, seconds=time.perf_counter() - began)
    record(out, name, under, asdict(done))
    return done


def vary(scene: Path, out: Path, done: SceneDone, count: int, *, under: str) -> dict[str, str]:
    """Scene files for further solutions of a finished scene, by name; recorded."""
    made: dict[str, str] = {}
    if done.verdict == DONE:
        job = _opened(scene, out / CACHE)
        made = variant_scenes(job, done.chosen, name=done.name, count=count, out=out)
    record(out, variants_name(done.name), under, made)
    return made


def variants_name(scene: str) -> str:
    """What the further solutions of a scene are recorded under."""
    return f"{scene}.variants"


def scene_done(content: Mapping[str, Any]) -> SceneDone:
    """From a record."""
    return SceneDone(**{**content, "sentences": tuple(content["sentences"]), "files": tuple(content["files"])})


def _warmed(stage: str, scene: Path, cache: Path, work: Callable[[Job], None]) -> Spent:
    """Do something for the cache's sake."""
    began = time.perf_counter()
    try:
        job = _opened(scene, cache)
        work(job)
        job.store.contents.save()
    except Exception as fault:  # `finish_scene` comes to it again, in whichever scene needs it
        return Spent(f"{stage}: {type(fault).__name__}", time.perf_counter() - began)
    return Spent(stage, time.perf_counter() - began)


def _opened(scene: Path, cache: Path) -> Job:
    """A job that keeps its results on disk alone."""
    job = load(scene, cache=cache, workers=1)
    return replace(job, store=replace(job.store, holds=False))


def _share_cache(out: Path, name: str) -> None:
    """Let a scene's cache hold what the batch's holds; what is its own, as what stands there, stays its own."""
    own = out / name / CACHE
    own.mkdir(parents=True, exist_ok=True)
    for folder in SHARED:
        (out / CACHE / folder).mkdir(parents=True, exist_ok=True)
        if not (own / folder).exists():
            (own / folder).unlink(missing_ok=True)
            (own / folder).symlink_to(Path("..", "..", CACHE, folder), target_is_directory=True)


def _patiently(work: Callable[[], Outcome]) -> Outcome:
    """Wait for a folder while the worker that had this task before, and was given up, may still be at work."""
    until = time.monotonic() + PATIENCE
    while True:
        try:
            return work()
        except OutputBusy:
            if time.monotonic() > until:
                raise
            time.sleep(1.0)


def _summed_up(name: str, outcome: Outcome, *, page: bool) -> SceneDone:
    result, report = outcome.result, outcome.report
    chosen = {entry["name"]: entry["chosen"]["row"] for entry in report["segments"] if "chosen" in entry}
    solutions = tuple(solutions_path(segment.name) for segment in result.segments)
    files = (SOURCE, REPORT, *solutions, *((PAGE,) if page else ()))
    if result.assembly is None:
        misses = tuple(f"{segment}: {miss.killed_by}; {miss.nearest}" for segment, miss in result.misses.items())
        return SceneDone(name, NO, (str(result.failure), *misses), files=files)
    return SceneDone(
        name,
        DONE,
        tuple(report["problems"]),
        frames=result.assembly.scene.n_frames,
        cost=report["cost"],
        deepest_mm=None if report["check"] is None else report["check"]["deepest_mm"],
        chosen=chosen,
        files=(EDIT, *files),
    )
