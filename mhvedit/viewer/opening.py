"""Opens a scene file or an output folder, with whatever of it is there."""

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mhvedit.errors import CaptureError, MhveditError, SceneError
from mhvedit.files import UNREADABLE, load_npz
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import wrap_angle
from mhvedit.pipeline.folders import EDIT, REPORT, SOURCE, noted_scene
from mhvedit.pipeline.job import Job, load
from mhvedit.pipeline.output import CACHE, solutions_path
from mhvedit.pipeline.people import Person, meet_people
from mhvedit.pipeline.run import job_of
from mhvedit.pipeline.shown import shown_people
from mhvedit.pipeline.store import open_store
from mhvedit.project.scene_file import read_text
from mhvedit.project.schema import SceneFile
from mhvedit.project.subject_keys import subject_spec
from mhvedit.project.subjects import open_subject
from mhvedit.project.values import Value, dotted
from mhvedit.scene.edit import SegmentEdit, SubjectEdit, read_edit
from mhvedit.scene.shown import shown_scene
from mhvedit.search.groups import SolutionGroup
from mhvedit.search.poses import PoseGrid
from mhvedit.search.solve import ReasonMap
from mhvedit.viewer.material import Material, Searched, SegmentView, actor_of, assembled, unsolved

CHANGED = "the scene file was changed since this output was written; this is the answer of before"
SMALL = (
    "step", "axes_x", "axes_yaw", "base", "root_a", "root_b", "facing", "canonical_a", "canonical_b", "x", "y",
    "yaw",
)  # fmt: skip
COLUMNS = ("distance", "theta_a", "theta_b", "region", "clearance", "penalty")
SAME = 1e-6  # m and rad, between a pose and itself after a detour through files
READ_ONLY = "nothing can be solved or saved until it is there"


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A scene, ready to be looked at."""

    job: Job | None  # None where something is missing on disk: then nothing can be solved
    people: Mapping[str, Person]
    material: Material
    out: Path | None  # the output folder, where one was opened
    stale: bool  # whether it should be solved before anybody believes it


def open_scene(path: Path) -> Opened:
    """Open what `mhvedit view` is given.

    Args:
        path: a scene file, or an output folder of `mhvedit solve`.

    Raises:
        MhveditError: it is neither, or there is nothing at all to show.
    """
    if path.is_dir():
        return _open_output(path)
    if not path.exists():
        raise CaptureError(path, "a scene file or an output folder of `mhvedit solve` or `mhvedit avoid`", "nothing")
    try:
        job = load(path)
    except MhveditError as fault:
        return _open_rest(path, None, fault)
    people = meet_people(job.scene, job.subjects, job.store)
    return Opened(job, people, unsolved(job, people), None, stale=True)


def _open_output(out: Path) -> Opened:
    source = _source_of(out)
    try:
        job = job_of(out)
    except MhveditError as fault:
        return _open_rest(source, out, fault)
    people = meet_people(job.scene, job.subjects, job.store)
    edit = read_edit(out / EDIT) if (out / EDIT).exists() else None
    plain = unsolved(job, people, (CHANGED,))
    segments = _segments(out, plain.spans if edit is None else edit.segments)
    names = [spec.name for spec in job.scene.segments]
    if [view.name for view in segments] != names or (edit is not None and set(edit.subjects) != set(people)):
        return Opened(job, people, plain, out, stale=True)
    stale = source.stat().st_mtime_ns > (out / SOURCE).stat().st_mtime_ns
    notes: tuple[str, ...] = (CHANGED,) if stale else ()
    if edit is None:
        notes += (f"no answer: {_report(out).get('failure') or 'nothing fits'}",)
    return Opened(job, people, assembled(job, people, segments, edit, notes), out, stale=stale)


def _source_of(out: Path) -> Path:
    """The scene file that an output folder was made from."""
    found = noted_scene(out)
    if found is None:
        raise CaptureError(out, "an output folder of `mhvedit solve` or `mhvedit avoid`", f"no readable {SOURCE}")
    return found


def _open_rest(source: Path, out: Path | None, fault: MhveditError) -> Opened:
    """What can be shown although a capture is missing.

    Raises:
        MhveditError: the fault itself, where no capture is to blame or nothing can be shown.
    """
    known = _people_there(source, out)
    people = {name: person for name, person in known.items() if isinstance(person, Person)}
    missing = [sentence for sentence in known.values() if isinstance(sentence, str)]
    edit = read_edit(out / EDIT) if out is not None and (out / EDIT).exists() else None
    if not missing or (not people and edit is None):
        raise fault
    notes = tuple(f"{sentence} ({READ_ONLY})" for sentence in missing)
    shown = people if edit is None else shown_people(people, edit)
    cast = {name: actor_of(person) for name, person in shown.items()}
    if edit is not None and out is not None:
        segments = _segments(out, edit.segments)
        material = Material(
            edit.name,
            edit.fps,
            edit.n_frames,
            shown_scene(edit).subjects,
            cast,
            segments,
            edit.segments,
            placed=True,
            notes=notes,
        )
        return Opened(None, people, material, out, stale=False)
    shortest = min(len(actor.numbers) for actor in cast.values())
    unknown = np.zeros(shortest, np.int64)
    tracks = {
        name: SubjectEdit(cast[name].numbers[:shortest] if name in cast else unknown, np.zeros((shortest, 3)))
        for name in known
    }
    fps = next(iter(cast.values())).sequence.fps
    material = Material(source.stem, fps, shortest, tracks, cast, (), (), placed=False, notes=notes)
    return Opened(None, people, material, out, stale=False)


def _people_there(source: Path, out: Path | None) -> dict[str, Person | str]:
    """The subjects of a scene file in its order, or what keeps them from being opened, in a sentence."""
    try:
        tables = tomllib.loads(read_text(source))["subjects"].items()
    except (SceneError, tomllib.TOMLDecodeError, KeyError, AttributeError):
        return {}
    cache = None if out is None else out / CACHE
    frames, store = None if cache is None else cache / "frames", open_store(cache)
    there: dict[str, Person | str] = {}
    for name, table in tables:
        try:
            spec = subject_spec(Value(source, dotted("subjects", name), table), name)
            subject = open_subject(spec, cache=frames)
            there |= meet_people(SceneFile(source, source.stem, None, {name: spec}, ()), {name: subject}, store)
        except MhveditError as fault:
            there[name] = str(fault)
    return there


def _report(out: Path) -> dict[str, Any]:
    try:
        return dict(json.loads((out / REPORT).read_text()))
    except (OSError, ValueError, TypeError):
        return {}


def _segments(out: Path, spans: Sequence[SegmentEdit]) -> tuple[SegmentView, ...]:
    """All solution groups in an output folder; none where one is not there or of an older version."""
    told = {str(entry["name"]): entry for entry in _report(out).get("segments", [])}
    views = [_segment(out / solutions_path(span.name), span, _why(told.get(span.name, {}))) for span in spans]
    found = tuple(view for view in views if view is not None)
    return found if len(found) == len(views) else ()


def _segment(path: Path, span: SegmentEdit, why: str) -> SegmentView | None:
    """One solution group in its file; None where the file is of an older version or not there."""
    try:
        kept = load_npz(path, *SMALL)
    except UNREADABLE:
        return None
    size, n_yaw, step = len(kept["axes_x"]), len(kept["axes_yaw"]), float(kept["step"])
    grid = PoseGrid(step, 1, n_yaw, (size - 1) * step, kept["root_a"], kept["root_b"], kept["base"], size)
    return SegmentView(
        name=span.name,
        interaction=span.interaction,
        between=span.between,
        start=span.start,
        stop=span.stop,
        fetch=lambda: _searched(path, grid),
        n_solutions=len(kept["x"]),
        grid=grid,
        facing=(float(kept["facing"][0]), float(kept["facing"][1])),
        frames=(kept["canonical_a"], kept["canonical_b"]),
        chosen=_row_at(span.relative, kept),
        why=why,
    )


def _row_at(relative: FloatArray, kept: Mapping[str, FloatArray]) -> int | None:
    """The solution that an edit has chosen; None where there is none."""
    away = np.hypot(kept["x"] - relative[0], kept["y"] - relative[1]) + np.abs(wrap_angle(kept["yaw"] - relative[2]))
    row = int(np.argmin(away)) if len(away) else 0
    return row if len(away) and away[row] < SAME else None


def _searched(path: Path, grid: PoseGrid) -> Searched:
    """What is large of a solution file."""
    kept = load_npz(path, *COLUMNS, "reason", "reasons")
    found = ReasonMap(grid, kept["reason"], tuple(str(name) for name in kept["reasons"]))
    cells = np.argwhere(found.accepted)
    group = SolutionGroup(
        keys=np.concatenate([grid.base[cells[:, 2]] + cells[:, :2], cells[:, 2:]], 1),
        poses=grid.poses(cells),
        distance=kept["distance"],
        theta_a=kept["theta_a"],
        theta_b=kept["theta_b"],
        region=kept["region"].astype(np.int32),
        clearance=kept["clearance"].astype(np.float64),
    )
    return Searched(found, group, np.broadcast_to(kept["penalty"].astype(np.float64), len(cells)))


def _why(entry: Mapping[str, Any]) -> str:
    if "killed_by" not in entry:
        return ""
    return f"{entry['killed_by']} ({entry['poses_that_got_that_far']:,} poses got that far); {entry['nearest']}"
