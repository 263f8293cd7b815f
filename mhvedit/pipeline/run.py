"""From a scene file to a full output folder, and back: what the commands do."""

import json
import os
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.pipeline.folders import EDIT, PAGE, REPORT, SOURCE, check_answered, noted_scene
from mhvedit.pipeline.job import Job, Result, load, solve
from mhvedit.pipeline.kept import cache_limit, trim
from mhvedit.pipeline.measure import measure_scene
from mhvedit.pipeline.output import (
    CACHE,
    Staging,
    claimed,
    result_as_dict,
    solutions_path,
    staging,
    touched_files,
    write_json,
)
from mhvedit.pipeline.people import Person, meet_people
from mhvedit.pipeline.picks import idle_exclusions
from mhvedit.pipeline.progress import Progress, silent
from mhvedit.pipeline.segments import SolvedSegment
from mhvedit.pipeline.standing import Standing, answer_files, forget, holds, note, standing_in
from mhvedit.pipeline.store import Arrays, Store, capture_signature, hashed
from mhvedit.pipeline.terms import segment_pair
from mhvedit.project.schema import SubjectSpec
from mhvedit.project.subjects import Subject
from mhvedit.scene.edit import EditedScene, edit_as_dict, read_edit
from mhvedit.scene.report import SceneReport, Thresholds, failures

VERSION = 4  # of what is written; raise it when the reports change
WARNINGS = 3  # of what is kept of them; raise it when they change
CLOCK = 2.0  # s, by which times of files may be behind
MEASURED_FRAMES = 6  # of a capture, for warnings


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a run came to."""

    result: Result
    report: Mapping[str, Any]  # the content of `report.json`
    redone: bool  # False where everything on disk was still true


def run_scene(
    scene: Path,
    out: Path,
    *,
    workers: int = 2,
    check: bool = True,
    report: bool = True,
    cache_gb: float | None = None,
    progress: Progress | None = None,
    warn: Callable[[str], None] | None = None,
    answered: Callable[[Outcome], None] | None = None,
) -> Outcome:
    """Solve a scene file and write everything; a second run redoes only what its inputs changed.

    The answer comes first: once `edit.json` and the solution groups are in place, with a `report.json` that says that
    the meshes were not checked yet, `answered` is told. Then they are checked, and the reports written.

    Args:
        scene: the scene file.
        out: output folder.
        workers: threads.
        check: whether to check the answer on the meshes; without it there is no HTML report either.
        report: whether to draw the HTML report.
        cache_gb: how large the cache may grow, GB; None for what the environment says, or else 8.
        progress: told what is being done.
        warn: told what looks wrong with the captures, as soon as it is known.
        answered: told the answer as soon as it is in place.

    Raises:
        MhveditError: bad input, or the folder is busy.
    """
    started, began = time.perf_counter(), time.time()
    limit = cache_limit() if cache_gb is None else cache_gb
    warn = warn or (lambda text: None)
    job = load(scene, cache=out / CACHE, workers=workers)  # bad input is found before anything is written
    job = replace(job, store=replace(job.store, holds=False))
    with claimed(out):
        warnings = scene_warnings(job, workers=workers)
        for sentence in warnings:
            warn(sentence)
        with staging(out) as staged:
            standing = standing_in(out)

            def solved(segment: SolvedSegment) -> None:
                if not _stands(segment, standing):
                    staged.write_group(segment)

            result = solve(job, workers=workers, progress=progress, solved=solved)
            idle = idle_exclusions(job.scene.segments, result.segments, result.people)
            for sentence in idle:
                warn(sentence)
            job.store.contents.save()
            notes = () if result.assembly is None else result.assembly.notes
            for sentence in notes:
                warn(sentence)
            outcome = _answered(out, staged, standing, result, warnings + idle + notes, started=started)
        if answered is not None:
            answered(outcome)
        if check:
            outcome = _verified(out, outcome, workers=workers, page=report, tell=progress or silent)
        trim(out, limit=limit, since=began - CLOCK)
    return outcome


def _answered(
    out: Path, staged: Staging, standing: Standing, result: Result, warnings: tuple[str, ...], *, started: float
) -> Outcome:
    """Put the answer in place, unless it is there."""
    key, names = _answer_key(result, warnings), _solutions_names(result)
    files = answer_files(names, solved=result.assembly is not None) + list(_touched(result))
    if standing.answer == key and holds(standing, [*files, REPORT]):
        return Outcome(result, json.loads((out / REPORT).read_text()), redone=False)
    there = [segment.name for segment in result.segments if _stands(segment, standing)]
    forget(out)
    content = result_as_dict(result, None, ()) | {"warnings": list(warnings)}
    content["answer_seconds"] = round(time.perf_counter() - started, 3)
    staged.put(result, report=content, standing=there)
    note(out, key, names, [*files, REPORT])
    return Outcome(result, content, redone=True)


def _stands(segment: SolvedSegment, standing: Standing) -> bool:
    """Whether a segment's solution group is in the output folder as it would be written."""
    there = standing.solutions.get(segment.name) == _solutions_name(segment)
    return there and holds(standing, [solutions_path(segment.name)])


def _answer_key(result: Result, warnings: tuple[str, ...]) -> str:
    """A name for everything that the files in the output folder depend on."""
    scene, people = result.job.scene, result.people
    answer = str(result.failure) if result.assembly is None else edit_as_dict(result.assembly.scene)
    captures = [
        (person.signature, _things_key(person, result.job.store), _looks_key(person)) for person in people.values()
    ]
    props = [result.job.store.contents.of(prop.sequence.files) for prop in result.job.props.values()]
    touched = [result.job.store.contents.of([file]) for file in _touched(result).values()]
    segments = [segment.identity for segment in result.segments]
    return hashed(("answer", VERSION, scene, captures, props, segments, answer, touched, warnings))


def _touched(result: Result) -> dict[str, Path]:
    """Files of stopped meshes, and where they are kept."""
    return {} if result.assembly is None else touched_files(result.assembly.scene)


def _solutions_names(result: Result) -> dict[str, str]:
    """By segment, a name for everything that its file of solutions depends on."""
    return {segment.name: _solutions_name(segment) for segment in result.segments}


def _solutions_name(segment: SolvedSegment) -> str:
    return f"{VERSION}/{segment.identity}"


def _things_key(person: Person, store: Store) -> list[str]:
    """What the meshes of the things that a person holds are like."""
    return [store.contents.of(thing.files) for thing in person.subject.held.values()]


def _looks_key(person: Person) -> str:
    """Which way a person faces and looks, as the report draws it."""
    facing, gaze = person.facing, person.gaze
    parts = (facing.numbers, facing.yaw, facing.trust, gaze.numbers, gaze.eye, gaze.direction)
    return hashed([part.tobytes() for part in parts])


def _verified(out: Path, answer: Outcome, *, workers: int, page: bool, tell: Progress) -> Outcome:
    """Check the answer on its meshes and write the reports on it, unless they are there."""
    result, standing = answer.result, standing_in(out)
    checked = answer.report["check"] is not None or result.assembly is None
    if checked and (not page or holds(standing, [PAGE])):
        return answer
    found: SceneReport | None = None
    problems: tuple[str, ...] = ()
    if result.assembly is not None:
        found = measure_scene(
            result.job,
            result.people,
            result.assembly.scene,
            workers=workers,
            progress=lambda done, count: tell("check on the meshes", done / count),
        )
        problems = failures(found, Thresholds())
    kept = {name: answer.report[name] for name in ("warnings", "answer_seconds")}
    content = result_as_dict(result, found, problems) | kept
    forget(out)
    write_json(out / REPORT, content)
    names = _solutions_names(result)
    files = [*standing.files, REPORT]
    note(out, standing.answer, names, files)
    if page:
        tell("report", 0.0)
        warnings = (*answer.report["warnings"], *(run["sentence"] for run in content.get("entered", ())))
        _draw(out / PAGE, result, found, problems=problems, warnings=warnings)
        note(out, standing.answer, names, [*files, PAGE])
    return Outcome(result, content, redone=True)


def _draw(
    path: Path, result: Result, found: SceneReport | None, *, problems: tuple[str, ...], warnings: tuple[str, ...]
) -> None:
    """Write the HTML report. Its libraries take longer to import than an answer takes, so they are imported here."""
    from mhvedit.pipeline.story import report_content
    from mhvedit.view.report import write_report

    limit = Thresholds().penetration_mm
    write_report(path, report_content(result, found, problems=problems, warnings=warnings, limit_mm=limit))


def scene_warnings(job: Job, *, workers: int = 1) -> tuple[str, ...]:
    """What looks wrong with the captures of a scene, in sentences."""
    subjects = job.scene.subjects
    with ThreadPoolExecutor(workers) as pool:
        found = pool.map(lambda name: _capture_warnings(subjects[name], job.subjects[name], job.store), subjects)
        return tuple(chain.from_iterable(found))


def _capture_warnings(spec: SubjectSpec, subject: Subject, store: Store) -> list[str]:
    """Of one capture; kept until it, what lies beside its files, or a picture that it names comes or goes."""

    def build() -> Arrays:
        from mhvedit.sequences.inspect import capture_warnings, inspect_capture  # takes long to load, and is kept

        cache = None if store.folder is None else store.folder.parent / "frames"
        summary = inspect_capture(
            spec.path.path,
            name=spec.name,
            fps=spec.fps,
            units=spec.units,
            up=spec.up,
            most=MEASURED_FRAMES,
            cache=cache,
        )
        sentences, named = capture_warnings(summary), (*summary.textures, *summary.missing_textures)
        return {
            "sentences": np.array(sentences, np.str_),
            "named": np.array([str(file) for file in named], np.str_),
            "there": np.array([file.is_file() for file in named], np.bool_),  # not those within a mesh file
        }

    signature = capture_signature(subject.sequence, store.contents, units=spec.units, up=spec.up)
    key = ("warnings", WARNINGS, spec.name, signature, spec.fps, _beside(spec))
    found = store.kept(key)
    if found is None or [Path(str(file)).is_file() for file in found["named"]] != found["there"].tolist():
        found = store.keep(key, build())
    return [str(sentence) for sentence in found["sentences"]]


def _beside(spec: SubjectSpec) -> object:
    """When something came or went beside a capture's files; of frames that are left out, how they stand."""
    path = spec.path.path
    if spec.frames is None or not path.is_dir():
        return path.stat().st_mtime_ns
    with os.scandir(path) as entries:
        return sorted((entry.name, entry.stat().st_size, entry.stat().st_mtime_ns) for entry in entries)


def check_output(
    out: Path, *, thresholds: Thresholds, between_frames: int = 0, workers: int = 2, progress: Progress | None = None
) -> tuple[SceneReport, tuple[str, ...]]:
    """Check the edited scene in an output folder.

    Args:
        out: written by `run_scene`.
        thresholds: what is good enough.
        between_frames: sub-steps between frames.
        workers: threads.
        progress: told what is being done.

    Raises:
        CaptureError: the folder holds no edit, or none of its scene file as that is now.
        NoAnswer: nothing fitted, so there is no edit.
    """
    check_answered(out, to_be="checked")
    tell = progress or silent
    edit = read_edit(out / EDIT)
    job = job_of(out, workers=workers)
    people = meet_people(job.scene, job.subjects, job.store)
    _check_belongs(out, edit, job, people)
    report = measure_scene(
        job,
        people,
        edit,
        between_frames=between_frames,
        workers=workers,
        progress=lambda done, count: tell("check on the meshes", done / count),
    )
    job.store.contents.save()
    return report, failures(report, thresholds)


def _check_belongs(out: Path, edit: EditedScene, job: Job, people: Mapping[str, Person]) -> None:
    """Refuse an edit whose scene file was changed since in a way that the check would trip over."""
    asked = [
        (s.name, s.between, segment_pair(s, people, job.fps).n_frames, s.interaction.value) for s in job.scene.segments
    ]
    there = [(s.name, s.between, s.stop - s.start, s.interaction) for s in edit.segments]
    if asked != there or set(edit.subjects) != set(people):
        raise CaptureError(
            out / EDIT, f"the edit of {job.scene.file} as it is now", "an earlier one's: run `mhvedit solve` again"
        )


def job_of(out: Path, *, workers: int = 2) -> Job:
    """The scene that an output folder was made from.

    Args:
        out: of `mhvedit solve`.
        workers: as in `job.load`.

    Raises:
        CaptureError: the folder does not say.
    """
    scene = noted_scene(out)
    if scene is None:
        raise CaptureError(out / SOURCE, "the scene file that `mhvedit solve` noted", "nothing readable")
    return load(scene, cache=out / CACHE, workers=workers)
