"""The output folder: written beside and renamed, one run at a time."""

import fcntl
import json
import os
import shutil
from collections.abc import Collection, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from mhvedit.errors import CaptureError, MhveditError, OutputBusy
from mhvedit.files import Column, replacing, write_arrays
from mhvedit.geometry.planar import invert
from mhvedit.pipeline.folders import EDIT, PAGE, REPORT, SOURCE, Owner, check_owner
from mhvedit.pipeline.job import Result
from mhvedit.pipeline.props_pass import entered
from mhvedit.pipeline.segments import SolvedSegment
from mhvedit.pipeline.stops_pass import stop_in_words
from mhvedit.scene.edit import TOUCHED, EditedScene, edit_as_dict, touched_path
from mhvedit.scene.report import SceneReport, report_as_dict
from mhvedit.search.listing import listed, reasons_listed, rounded

SOLUTIONS, CACHE = "solutions", ".cache"
UNCHECKED = "the edit has not been checked on the meshes yet: `mhvedit check` does it"
STAGED = ".new"  # files of an answer while it is being written


class OutputUnusable(MhveditError, OSError):
    """There is something at the output folder's place that cannot be written into."""

    def __init__(self, folder: Path | str, found: str) -> None:
        super().__init__(f"{folder}: expected a folder that can be written to, found {found}")
        self.folder = Path(folder)


def require_output(folder: Path) -> None:
    """Refuse a folder that is none of `mhvedit solve`.

    Raises:
        CaptureError: it is none.
    """
    if not (folder / CACHE).is_dir():
        raise CaptureError(folder, "an output folder of `mhvedit solve`", "another" if folder.is_dir() else "nothing")


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Hold an output folder for one run.

    Args:
        folder: made if it is not there.

    Raises:
        CaptureError: `mhvedit avoid` wrote it.
        OutputBusy: another run holds it.
        OutputUnusable: it is no folder, or a read-only one.
    """
    check_owner(folder, Owner.SOLVE)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / ".lock").open("a+")
    except (FileExistsError, NotADirectoryError):
        raise OutputUnusable(folder, "a file") from None
    except OSError as fault:
        raise OutputUnusable(folder, str(fault.strerror)) from fault
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            raise OutputBusy(folder, f"process {lock.read().strip() or '?'} at work there") from None
        try:
            lock.truncate(0)
            lock.write(str(os.getpid()))
            lock.flush()
            yield
        except OSError as fault:
            if fault.filename is None:  # a write that failed, by which Python names no file
                fault.filename = str(folder)
            raise


def write_result(folder: Path, result: Result) -> None:
    """Write `edit.json`, the solution groups and where the scene came from, all of it or nothing.

    Args:
        folder: of the output.
        result: of a solve.
    """
    with staging(folder) as staged:
        for segment in result.segments:
            staged.write_group(segment)
        staged.put(result)


@contextmanager
def staging(folder: Path) -> Iterator["Staging"]:
    """Write an answer beside the one that stands in an output folder; what is not put in its place is gone at the end.

    Args:
        folder: of the output.
    """
    staged = folder / STAGED
    shutil.rmtree(staged, ignore_errors=True)  # of a run that was killed
    with ThreadPoolExecutor(1) as pool:  # one group at a time: they are large
        try:
            (staged / SOLUTIONS).mkdir(parents=True)
            yield Staging(folder, pool)
        finally:
            pool.shutdown(cancel_futures=True)
            shutil.rmtree(staged, ignore_errors=True)


class Staging:
    """An answer that is being written."""

    def __init__(self, folder: Path, pool: ThreadPoolExecutor) -> None:
        self._folder, self._pool = folder, pool
        self._groups: list[Future[None]] = []

    def write_group(self, segment: SolvedSegment) -> None:
        """Begin to write a solution group, while others are still being looked for."""
        path = self._folder / STAGED / solutions_path(segment.name)
        self._groups.append(self._pool.submit(write_solutions, path, segment))

    def put(self, result: Result, *, report: Mapping[str, Any] | None = None, standing: Collection[str] = ()) -> None:
        """Put the answer in place, once all groups are written.

        What no longer holds is taken away: other solution groups, an edit where there is none now, reports on another.

        Args:
            result: of a solve; all groups of its segments were begun, but for those that stand.
            report: the content of `report.json`; None for no such file.
            standing: segments whose solution groups stand in the folder already.
        """
        folder, staged = self._folder, self._folder / STAGED
        write_json(staged / SOURCE, {"scene": os.path.relpath(result.job.scene.file.resolve(), folder.resolve())})
        if result.assembly is not None:
            write_json(staged / EDIT, edit_as_dict(result.assembly.scene))
            _copy_touched(staged, result.assembly.scene)
        if report is not None:
            write_json(staged / REPORT, report)
        for group in self._groups:
            group.result()
        _replace(staged, folder, {Path(solutions_path(name)) for name in standing})


def _copy_touched(staged: Path, scene: EditedScene) -> None:
    """The stopped meshes of everybody who has some."""
    for name, own in touched_files(scene).items():
        (staged / name).parent.mkdir(exist_ok=True)
        shutil.copyfile(own, staged / name)


def touched_files(scene: EditedScene) -> dict[str, Path]:
    """Where stopped meshes are in the output folder, and where they are kept.

    Args:
        scene: the edit.
    """
    return {touched_path(name): own.touched.file for name, own in scene.subjects.items() if own.touched is not None}


def solutions_path(segment: str) -> str:
    """Where a segment's solution group is in the output folder."""
    return f"{SOLUTIONS}/{segment}.npz"


def _replace(staged: Path, folder: Path, standing: set[Path]) -> None:
    """Put what is staged into its place, and take away what there is no successor to."""
    (folder / SOLUTIONS).mkdir(exist_ok=True)
    new = {file.relative_to(staged) for file in staged.rglob("*") if file.is_file()}
    old = [folder / name for name in (EDIT, REPORT, PAGE)] + list((folder / SOLUTIONS).glob("*.npz"))
    old += list((folder / TOUCHED).glob("*.npz"))
    for stale in old:
        if stale.relative_to(folder) not in new | standing:
            stale.unlink(missing_ok=True)
    for name in sorted(new, key=lambda name: (name == Path(EDIT), name)):  # what it names is there before it
        (folder / name).parent.mkdir(exist_ok=True)
        os.replace(staged / name, folder / name)


def write_solutions(path: Path, segment: SolvedSegment) -> None:
    """Write a whole solution group and its map of reasons; poses are of B's capture frame in A's."""
    a, b = (segment.stages.people[name] for name in segment.spec.between)
    grid, found = segment.grid, segment.found
    rows = listed(grid, segment.cells, facing=segment.facing, left=a.pose, right=invert(b.pose))
    arrays: dict[str, np.ndarray[Any, Any] | Column] = {
        **rows,
        "region": segment.region,
        "clearance": rounded(segment.clearance),
        "penalty": rounded(segment.penalties),
        "reason": reasons_listed(found),
        "reasons": np.array(found.reasons),
        "axes_x": grid.offsets,
        "axes_y": grid.offsets,
        "axes_yaw": grid.yaws,
        "root_a": grid.root_a,
        "root_b": grid.root_b,
        "facing": np.array(segment.facing),
        "base": grid.base,
        "step": np.array(grid.step),
        "canonical_a": a.pose,
        "canonical_b": b.pose,
    }
    write_arrays(path, arrays)


def result_as_dict(result: Result, check: SceneReport | None, problems: tuple[str, ...]) -> dict[str, Any]:
    """The content of `report.json`."""
    assembly = result.assembly
    chosen = assembly.chosen if assembly else (None,) * len(result.segments)
    return {
        "name": result.job.scene.name,
        "solved": assembly is not None,
        "failure": str(result.failure) if result.failure else None,
        "cost": assembly.scene.cost if assembly else None,
        "lower_bound": assembly.scene.lower_bound if assembly else None,
        "gap": assembly.scene.gap if assembly else None,
        "chains_of_equal_cost": assembly.placements.equals if assembly else None,
        "segments": [_segment_as_dict(s, row, result) for s, row in zip(result.segments, chosen, strict=True)],
        "left_out": [asdict(frames) for frames in assembly.line.left_out] if assembly else [],
        "bends": [asdict(bend) for bend in assembly.bends] if assembly else [],
        "held": [asdict(frames) for frames in assembly.line.held] if assembly else [],
        "estimated": {name: list(person.estimated) for name, person in result.people.items()},
        "seconds": {stage: round(spent, 3) for stage, spent in result.seconds.items()},
        "check": None if check is None else report_as_dict(check),
        "unchecked": UNCHECKED if assembly and check is None else None,
        "problems": list(problems),
    } | _props_as_dict(result, check)


def _props_as_dict(result: Result, check: SceneReport | None) -> dict[str, Any]:
    """What there is to say about people in fixed props, where there are props."""
    stops = result.assembly.stops if result.assembly else ()
    found: dict[str, Any] = (
        {"stops": [asdict(stop) | {"sentence": stop_in_words(stop)} for stop in stops]} if stops else {}
    )
    return found | ({"entered": entered(check, result.job.props)} if check is not None and result.job.props else {})


def _segment_as_dict(segment: SolvedSegment, row: int | None, result: Result) -> dict[str, Any]:
    miss = result.misses.get(segment.spec.name)
    found: dict[str, Any] = {
        "name": segment.spec.name,
        "interaction": segment.spec.interaction.value,
        "between": list(segment.spec.between),
        "frames": segment.pair.n_frames,
        "solutions": segment.n_solutions,
        "regions": segment.n_regions,
        "rejected": {name: count for name, count in segment.counts.items() if name != "accepted"},
    }
    if row is not None:
        chosen = segment.rows(np.array([row]))
        found["chosen"] = {
            "row": row,
            "clearance_m": float(chosen.clearance[0]),
            "penalty_m": float(segment.penalty[row]),
            "distance_m": float(chosen.distance[0]),
            "theta_a_deg": float(np.degrees(chosen.theta_a[0])),
            "theta_b_deg": float(np.degrees(chosen.theta_b[0])),
        }
    if miss is not None:
        found["killed_by"] = miss.killed_by
        found["poses_that_got_that_far"] = miss.poses
        found["nearest"] = miss.nearest
    return found


def write_json(path: Path, content: Any) -> None:  # noqa: ANN401
    """Write JSON, all of it or nothing; not-a-number is refused."""
    with replacing(path) as beside:
        beside.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
