"""The search of one segment by itself, with its volumes made beforehand and kept in a file."""

import pickle
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from mhvedit.constraints.clauses import Clause
from mhvedit.geometry.arrays import BoolArray
from mhvedit.pipeline.job import load
from mhvedit.pipeline.people import meet_people
from mhvedit.pipeline.stages import grid_of, segment_stages, volumes_of
from mhvedit.pipeline.terms import segment_clauses
from mhvedit.search.poses import PoseGrid
from mhvedit.search.solve import OUTSIDE, ReasonMap, SightTest, search_poses

WORKERS = 2
RUNS = 3
T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class SearchCase:
    """All that the search of one segment needs."""

    name: str
    interaction: str
    n_frames: int
    grid: PoseGrid
    clauses: tuple[Clause, ...]
    sight: SightTest | None


def make_cases(scene: Path, cache: Path, folder: Path, names: Sequence[str]) -> None:
    """Keep segments of a scene, all if none is named."""
    job = load(scene, cache=cache)
    people = meet_people(job.scene, job.subjects, job.store)
    folder.mkdir(parents=True, exist_ok=True)
    for spec in job.scene.segments:
        if names and spec.name not in names:
            continue
        stages = segment_stages(job.scene, spec, people, fps=job.fps, store=job.store, workers=WORKERS)
        a, b = volumes_of(stages)
        clauses = segment_clauses(spec, a, b, pitch=job.scene.search.voxel)
        sight = None if stages.cones is None else SightTest(stages.cones, a.body, b.body)
        case = SearchCase(spec.name, spec.interaction.value, stages.pair.n_frames, grid_of(stages), clauses, sight)
        keep_case(case, folder)


def keep_case(case: SearchCase, folder: Path) -> Path:
    """Write a case, and say where."""
    path = folder / f"{case.name}.pickle"
    with path.open("wb") as file:
        pickle.dump(case, file, protocol=pickle.HIGHEST_PROTOCOL)
    return path


def read_case(path: Path) -> SearchCase:
    """A case that was kept."""
    with path.open("rb") as file:
        case: SearchCase = pickle.load(file)
    return case


def best_of(function: Callable[[], T], *, runs: int = RUNS) -> tuple[float, T]:
    """Seconds of the fastest run, and what the last returned."""
    times = []
    for _ in range(runs):
        began = time.perf_counter()
        found = function()
        times.append(time.perf_counter() - began)
    return min(times), found


def best_search(case: SearchCase, *, runs: int = RUNS) -> tuple[float, ReasonMap]:
    """Seconds that the search of a case takes without sight, and what it found."""
    return best_of(lambda: search_poses(case.grid, case.clauses, workers=WORKERS), runs=runs)


def boundary(found: ReasonMap) -> BoolArray:
    """(X, Y, Yaw) poses in the window of which some neighbour along x or y has another reason."""
    reason = found.reason
    edge = np.zeros(reason.shape, np.bool_)
    for axis in (0, 1):
        first, second = (np.moveaxis(edge, axis, 0)[part] for part in (slice(-1), slice(1, None)))
        along = np.moveaxis(reason, axis, 0)
        differs = along[1:] != along[:-1]
        first |= differs
        second |= differs
    return np.asarray(edge & (reason != OUTSIDE))


def peak_mb() -> float:
    """The most memory that this process has had, MB; unlike the system's own figure, none of its parent's."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024
