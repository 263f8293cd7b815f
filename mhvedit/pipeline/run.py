"""From a scene file to a full output folder, and back: what the commands do."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mhvedit.errors import CaptureError
from mhvedit.pipeline.job import Job, Progress, Result, load, solve
from mhvedit.pipeline.measure import measure_scene
from mhvedit.pipeline.output import (
    CACHE,
    EDIT,
    PAGE,
    REPORT,
    SOLUTIONS,
    SOURCE,
    claimed,
    result_as_dict,
    write_json,
    write_result,
)
from mhvedit.pipeline.people import Person, meet_people
from mhvedit.pipeline.segments import segment_key, segment_pair
from mhvedit.pipeline.store import hashed
from mhvedit.pipeline.story import report_content
from mhvedit.project.schema import SceneFile
from mhvedit.scene.edit import EditedScene, edit_as_dict, read_edit
from mhvedit.scene.report import SceneReport, Thresholds, failures
from mhvedit.sequences.inspect import capture_warnings, inspect_capture
from mhvedit.view.report import write_report

VERSION = 1  # of what is written; raise it when the reports change
FINISHED = f"{CACHE}/finished.json"


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
    report: bool = True,
    progress: Progress | None = None,
    warn: Callable[[str], None] | None = None,
) -> Outcome:
    """Solve a scene file and write everything; a second run redoes only what its inputs changed.

    Args:
        scene: the scene file.
        out: output folder.
        workers: threads.
        report: whether to draw the HTML report.
        progress: told what is being done.
        warn: told what looks wrong with the captures, as soon as it is known.

    Raises:
        MhveditError: bad input, or the folder is busy.
    """
    tell = progress or (lambda stage, share: None)
    load(scene)  # bad input is found before anything is written
    with claimed(out):
        job = load(scene, cache=out / CACHE)
        warnings = scene_warnings(job.scene, out / CACHE)
        for sentence in warnings:
            (warn or (lambda text: None))(sentence)
        result = solve(job, workers=workers, progress=progress)
        key = _outcome_key(result)
        if _is_finished(out, result, key, report=report):
            return Outcome(result, json.loads((out / REPORT).read_text()), redone=False)
        (out / FINISHED).unlink(missing_ok=True)
        write_result(out, result)
        content = _checked(out, result, warnings, workers=workers, report=report, tell=tell)
        write_json(out / FINISHED, {"key": key, "files": _stamps(out, _written(result, report=report))})
    return Outcome(result, content, redone=True)


def _outcome_key(result: Result) -> str:
    """A name for everything that the files in the output folder depend on."""
    scene, people = result.job.scene, result.people
    answer = str(result.failure) if result.assembly is None else edit_as_dict(result.assembly.scene)
    segments = [(segment_key(scene, s.spec, people, s.pair, s.cones), s.facing) for s in result.segments]
    return hashed(("outcome", VERSION, scene, [p.signature for p in people.values()], segments, answer))


def _written(result: Result, *, report: bool) -> list[str]:
    """The files of an answer."""
    names = [REPORT, SOURCE, *([EDIT] if result.assembly else []), *([PAGE] if report else [])]
    return names + [f"{SOLUTIONS}/{segment.spec.name}.npz" for segment in result.segments]


def _stamps(out: Path, names: list[str]) -> dict[str, list[int]]:
    """Size and time of files."""
    return {name: [(stat := (out / name).stat()).st_size, stat.st_mtime_ns] for name in names}


def _is_finished(out: Path, result: Result, key: str, *, report: bool) -> bool:
    """Whether an earlier run wrote all files for the very same answer, and nobody touched them since."""
    try:
        kept = json.loads((out / FINISHED).read_text())
        return bool(
            kept["key"] == key and _stamps(out, _written(result, report=report)).items() <= kept["files"].items()
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False


def _checked(
    out: Path, result: Result, warnings: tuple[str, ...], *, workers: int, report: bool, tell: Progress
) -> dict[str, Any]:
    """Check the scene on its meshes and write both reports; returns the content of `report.json`."""
    check: SceneReport | None = None
    problems: tuple[str, ...] = ()
    if result.assembly is not None:
        check = measure_scene(
            result.job,
            result.people,
            result.assembly.scene,
            workers=workers,
            progress=lambda done, count: tell("check on the meshes", done / count),
        )
        problems = failures(check, Thresholds())
    content = result_as_dict(result, check, problems) | {"warnings": list(warnings)}
    write_json(out / REPORT, content)
    if report:
        tell("report", 0.0)
        limit = Thresholds().penetration_mm
        story = report_content(result, check, problems=problems, warnings=warnings, limit_mm=limit)
        write_report(out / PAGE, story)
    return content


def scene_warnings(scene: SceneFile, cache: Path) -> tuple[str, ...]:
    """What looks wrong with the captures of a scene, in sentences."""
    found: list[str] = []
    for name, spec in scene.subjects.items():
        summary = inspect_capture(
            spec.path.path, name=name, fps=spec.fps, units=spec.units, up=spec.up, most=6, cache=cache / "frames"
        )
        found += capture_warnings(summary)
    return tuple(found)


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
    """
    tell = progress or (lambda stage, share: None)
    edit = read_edit(out / EDIT)
    job = job_of(out)
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
    return report, failures(report, thresholds)


def _check_belongs(out: Path, edit: EditedScene, job: Job, people: Mapping[str, Person]) -> None:
    """Refuse an edit whose scene file was changed since in a way that the check would trip over."""
    asked = [
        (s.name, s.between, segment_pair(job.scene, s, people, job.fps).n_frames, s.interaction.value)
        for s in job.scene.segments
    ]
    there = [(s.name, s.between, s.stop - s.start, s.interaction) for s in edit.segments]
    if asked != there or set(edit.subjects) != set(people):
        raise CaptureError(
            out / EDIT, f"the edit of {job.scene.file} as it is now", "an earlier one's: run `mhvedit solve` again"
        )


def job_of(out: Path) -> Job:
    """The scene that an output folder was made from.

    Raises:
        CaptureError: the folder does not say.
    """
    try:
        scene = out / json.loads((out / SOURCE).read_text())["scene"]
    except (OSError, ValueError, KeyError, TypeError) as fault:
        raise CaptureError(out / SOURCE, "the scene file that `mhvedit solve` noted", "nothing readable") from fault
    return load(scene, cache=out / CACHE)
