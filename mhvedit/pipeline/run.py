"""From a scene file to a full output folder, and back: what the commands do."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mhvedit.errors import CaptureError
from mhvedit.pipeline.job import Job, Progress, Result, load, solve
from mhvedit.pipeline.measure import measure_scene
from mhvedit.pipeline.output import (
    CACHE,
    EDIT,
    PAGE,
    REPORT,
    SOURCE,
    claimed,
    result_as_dict,
    write_json,
    write_result,
)
from mhvedit.pipeline.people import meet_people
from mhvedit.pipeline.story import report_content
from mhvedit.project.schema import SceneFile
from mhvedit.scene.edit import read_edit
from mhvedit.scene.report import SceneReport, Thresholds, failures
from mhvedit.sequences.inspect import capture_warnings, inspect_capture
from mhvedit.view.report import write_report


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a run came to."""

    result: Result
    check: SceneReport | None
    problems: tuple[str, ...]  # thresholds that are passed
    warnings: tuple[str, ...]  # about the captures


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
        write_result(out, result)
        check: SceneReport | None = None
        problems: tuple[str, ...] = ()
        if result.assembly is not None:
            check = measure_scene(
                job,
                result.people,
                result.assembly.scene,
                workers=workers,
                progress=lambda done, count: tell("check on the meshes", done / count),
            )
            problems = failures(check, Thresholds())
        write_json(out / REPORT, result_as_dict(result, check, problems) | {"warnings": list(warnings)})
        if report:
            tell("report", 0.0)
            limit = Thresholds().penetration_mm
            content = report_content(result, check, problems=problems, warnings=warnings, limit_mm=limit)
            write_report(out / PAGE, content)
    return Outcome(result, check, problems, warnings)


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
        CaptureError: the folder holds no edit.
    """
    tell = progress or (lambda stage, share: None)
    edit = read_edit(out / EDIT)
    job = job_of(out)
    people = meet_people(job.scene, job.subjects, job.store)
    report = measure_scene(
        job,
        people,
        edit,
        between_frames=between_frames,
        workers=workers,
        progress=lambda done, count: tell("check on the meshes", done / count),
    )
    return report, failures(report, thresholds)


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
