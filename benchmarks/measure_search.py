"""Measures the search of one segment in a process of its own, and prints figures as JSON.

    python -m benchmarks.measure_search make SCENE CACHE FOLDER [SEGMENT ...]
    python -m benchmarks.measure_search run CASE [--runs N]
    python -m benchmarks.measure_search plain CASE [--sample POSES]
    python -m benchmarks.measure_search fft CASE [--sample YAWS]

The first keeps segments as FOLDER/SEGMENT.pickle. `run` measures `search_poses` by itself; `plain` beside the search
pose by pose, on a random sample of the poses, scaled up to all; `fft` beside the search by correlation, at all yaws or
at some, evenly spread, scaled up to all. Both compare what they find pose for pose.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

from benchmarks.fft_search import FftSearch
from benchmarks.plain_search import Turned, reason_at
from benchmarks.search_case import (
    RUNS,
    WORKERS,
    SearchCase,
    best_of,
    best_search,
    boundary,
    make_cases,
    peak_mb,
    read_case,
)
from mhvedit.search.solve import OUTSIDE, search_poses

POSES = 300
SEED = 0
WORST = 0.25  # furthest that a count of shared voxels may be from a whole number
Figures = dict[str, float | int | str]


def alone(case: SearchCase, runs: int) -> Figures:
    """The search without sight, then sight alone where the rest accepts."""
    seconds, found = best_search(case, runs=runs)
    sight_seconds, peak = 0.0, peak_mb()
    if case.sight is not None:
        sight, accepted = case.sight, found.accepted
        sight_seconds, _ = best_of(
            lambda: search_poses(case.grid, (), sight=sight, among=accepted, workers=WORKERS), runs=runs
        )
    return {
        "interaction": case.interaction,
        "frames": case.n_frames,
        "seconds": seconds,
        "sight_seconds": sight_seconds,
        "peak_mb": peak,
        "poses": int((found.reason != OUTSIDE).sum()),
        "boundary": int(boundary(found).sum()),
        "accepted": found.counts()["accepted"],
    }


def beside_plain(case: SearchCase, poses: int) -> Figures:
    """The search pose by pose, on a sample; its voxels are turned at each pose, or all yaws were turned beforehand."""
    ours, found = best_search(case)
    inside = np.flatnonzero(found.reason != OUTSIDE)
    chosen = np.random.default_rng(SEED).choice(inside, poses, replace=False)
    spent, without_turning, different = 0.0, 0.0, 0
    for cell in np.column_stack(np.unravel_index(chosen, found.reason.shape)):
        turned: Turned = {}
        began = time.perf_counter()
        reason = reason_at(case.grid, case.clauses, cell, turned)
        middle = time.perf_counter()
        reason_at(case.grid, case.clauses, cell, turned)
        without_turning += time.perf_counter() - middle
        spent += middle - began
        different += int(reason != found.reason[tuple(cell)])
    scale = len(inside) / poses
    figures: Figures = {"ours": ours, "seconds": spent * scale, "without_turning": without_turning * scale}
    return figures | {"compared": poses, "different": different}


def beside_fft(case: SearchCase, sample: int) -> Figures:
    """The search by correlation, at all yaws (0) or at so many."""
    ours, found = best_search(case)
    n_yaw = case.grid.n_yaw
    count = sample or n_yaw
    yaws = np.arange(count) * n_yaw // count
    search = FftSearch(case.grid, yaws, workers=WORKERS)
    began = time.perf_counter()
    reason = search.reasons(case.clauses)
    spent = time.perf_counter() - began
    if search.worst > WORST:
        raise ArithmeticError(f"counts of shared voxels are {search.worst} from whole numbers")
    scaled = search.resting_seconds + (spent - search.resting_seconds) * n_yaw / count
    figures: Figures = {"ours": ours, "seconds": scaled, "spent": spent, "yaws": count, "worst": search.worst}
    different = int((reason != found.reason[:, :, yaws]).sum())
    return figures | {"compared": reason.size, "different": different, "peak_mb": peak_mb()}


def main() -> None:
    """Make cases, or measure one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ways = parser.add_subparsers(dest="way", required=True)
    make = ways.add_parser("make")
    for name in ("scene", "cache", "folder"):
        make.add_argument(name, type=Path)
    make.add_argument("names", nargs="*")
    for way, option, usual in (("run", "--runs", RUNS), ("plain", "--sample", POSES), ("fft", "--sample", 0)):
        measured = ways.add_parser(way)
        measured.add_argument("case", type=Path)
        measured.add_argument(option, type=int, default=usual)
    asked = parser.parse_args()
    if asked.way == "make":
        make_cases(asked.scene, asked.cache, asked.folder, asked.names)
        return
    case = read_case(asked.case)
    if asked.way == "run":
        print(json.dumps(alone(case, asked.runs)))
    else:
        print(json.dumps((beside_plain if asked.way == "plain" else beside_fft)(case, asked.sample)))


if __name__ == "__main__":
    main()
