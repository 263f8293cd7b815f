"""How long the best chain takes, and how much memory, for nine segments of many solutions each; prints a table.

Generated groups are shells of poses as real ones are: B stands at some distance from A and faces it at some angle, both
of which wander with the bearing and from segment to segment. `agree`: all segments have poses in common. `cut`: those
poses are taken out of one segment. `apart`: the last four segments want B 30 mm further away than the others accept.
`--real` adds the groups of the shared scene `greeting`, cut. Every case runs in a process of its own, after a small one
that compiles; its peak memory counts the groups themselves too.

`cost` and `bound` are those of the cheapest chain; `taken` is the cost of the deepest chain among those that cost as
good as the same, which is what the edit uses; `seconds` is for all of it.

The baseline is the recursion over all pairs of states, in NumPy, for one gauge and without turns, on a random subset of
the solutions; its time is scaled by the square of the number of states, and by the 180 gauges.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import wrap_angle
from mhvedit.optimise.branching import best_chain
from mhvedit.optimise.chains import change_of_offset, facing_cost, stage_costs
from mhvedit.optimise.keys import KeyPlacements, best_placements
from mhvedit.optimise.stages import KeySegment, Stage, common_codes, pose_codes, stages_of
from mhvedit.pipeline.job import load, solve

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
STEP, N_YAW, HALF = 0.01, 180, 200  # m, steps of a turn, cells on either side
SEGMENTS, SUBSET = 9, 1000
HEADER = ["groups", "states", "seconds", "peak MB", "cost m²", "bound m²", "gap %", "taken m²", "plain s, scaled"]


def shell(rng: np.random.Generator, size: int, *, distance: float, angle: float) -> IntArray:
    """The poses nearest to a curved surface of B's distance and facing over its bearing, (size, 3) on the lattice."""
    x, y = np.meshgrid(np.arange(-HALF, HALF + 1), np.arange(-HALF, HALF + 1), indexing="ij")
    bearing = np.arctan2(y, x)
    waves = rng.uniform(0, 2 * np.pi, 4)
    distance = distance + 0.04 * np.sin(2 * bearing + waves[0]) + 0.01 * np.sin(5 * bearing + waves[1])
    wanted = bearing + angle + 0.25 * np.sin(bearing + waves[2]) + 0.05 * np.sin(4 * bearing + waves[3])
    off = ((np.hypot(x, y) * STEP - distance) / 0.06).astype(np.float32)
    score = np.empty((*x.shape, N_YAW), np.float32)
    for k in range(N_YAW):
        score[:, :, k] = off**2 + (wrap_angle(wanted - k * 2 * np.pi / N_YAW) / 0.35) ** 2
    best = np.argpartition(score.ravel(), size)[:size]
    keys = np.column_stack(np.unravel_index(np.sort(best), score.shape))
    return np.asarray(keys - np.array([HALF, HALF, 0]), np.int64)


def generated(case: str, size: int) -> list[tuple[IntArray, FloatArray]]:
    """Lattice poses and roots (2, 2) of all segments."""
    rng = np.random.default_rng(0)
    roots = np.cumsum(rng.normal(0, 0.2, (SEGMENTS, 2, 2)), axis=0)
    centre, keys = [0.9, np.pi], []
    for i in range(SEGMENTS):
        further = 0.03 if case == "apart" and i >= 5 else 0.0
        place = centre + rng.normal(0, (0.01, 0.05))
        keys.append(shell(rng, size, distance=place[0] + further, angle=place[1]))
    if case != "agree":
        keys[4] = without_common(keys)
    return list(zip(keys, roots, strict=True))


def without_common(keys: list[IntArray]) -> IntArray:
    """What the fifth segment accepts without the poses that all accept."""
    common = common_codes([np.sort(pose_codes(own)) for own in keys])
    return keys[4][~np.isin(pose_codes(keys[4]), common)]


def real() -> list[tuple[IntArray, FloatArray]]:
    """The groups of `greeting`, cut."""
    solved = solve(load(SHARED / "scenes" / "greeting" / "scene.toml")).segments
    keys = [segment.group.keys for segment in solved]
    roots = [np.array([segment.found.grid.root_a, segment.found.grid.root_b]) for segment in solved]
    keys[4] = without_common(keys)
    return list(zip(keys, roots, strict=True))


def segment_of(name: str, keys: IntArray, roots: FloatArray) -> KeySegment:
    """A key segment of which only what the chain looks at is filled in; depth stands for merit."""
    poses = np.column_stack([keys[:, :2] * STEP, keys[:, 2] * (2 * np.pi / N_YAW)])
    merit = 0.1 * np.sin(0.05 * keys[:, 0]) * np.sin(0.07 * keys[:, 1])
    return KeySegment(name, keys, poses, merit, roots[0], roots[1])


def measure(folder: Path) -> dict[str, float]:
    """Time, memory and quality of one case; runs in a process of its own."""
    count = len(list(folder.glob("keys*.npy")))
    groups = [(np.load(folder / f"keys{i}.npy"), np.load(folder / f"roots{i}.npy")) for i in range(count)]
    chosen([(keys[:: max(1, len(keys) // 2000)], roots) for keys, roots in groups])  # compiles
    segments = [segment_of(str(i), *group) for i, group in enumerate(groups)]
    del groups
    began = time.perf_counter()
    stages = stages_of(segments, [False] * (len(segments) - 1))
    placed = best_placements(stages, facing_weight=1.0, step=STEP, n_yaw=N_YAW)
    spent = time.perf_counter() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    figures = {"seconds": spent, "peak": peak, "taken": placed.cost, "cost": placed.cost, "bound": placed.lower_bound}
    if placed.cost > 0:
        chain = best_chain(stage_costs(stages, facing_weight=1.0), step=STEP, n_yaw=N_YAW)
        figures |= {"cost": chain.cost, "bound": chain.lower_bound}
    states = int(np.mean([len(stage) for stage in stages]))
    return figures | {"states": states, "plain": plain_search(stages) * (states / SUBSET) ** 2 * N_YAW}


def chosen(groups: list[tuple[IntArray, FloatArray]]) -> KeyPlacements:
    """Everything once, from the groups on."""
    segments = [segment_of(str(i), *group) for i, group in enumerate(groups)]
    stages = stages_of(segments, [False] * (len(segments) - 1))
    return best_placements(stages, facing_weight=1.0, step=STEP, n_yaw=N_YAW)


def plain_search(stages: Sequence[Stage]) -> float:
    """Seconds that the recursion over all pairs takes for one gauge, no turns and a subset of the solutions."""
    costs = stage_costs(stages, facing_weight=1.0)
    rng = np.random.default_rng(0)
    began = time.perf_counter()
    value, before = np.zeros(SUBSET), np.zeros(SUBSET, np.complex128)
    for stage in costs:
        rows, still = rng.integers(0, len(stage.yaws), SUBSET), np.zeros(SUBSET)
        first, last = (change_of_offset(stage, rows, still, 0.0, which) for which in (0, -1))
        steps = value[None, :] + 0.5 * np.abs(first[:, None] - before[None, :]) ** 2
        value, before = steps.min(1) + facing_cost(stage, stage.yaws[rows], still), last
    return time.perf_counter() - began


def row_of(name: str, groups: list[tuple[IntArray, FloatArray]]) -> list[str]:
    """One row of the table, measured in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        for i, (keys, roots) in enumerate(groups):
            np.save(Path(folder) / f"keys{i}.npy", keys)
            np.save(Path(folder) / f"roots{i}.npy", roots)
        done = subprocess.run([sys.executable, __file__, "--measure", folder], check=True, capture_output=True)
    found = json.loads(done.stdout)
    gap = 0.0 if found["cost"] <= 0 else 100 * (found["cost"] - found["bound"]) / found["cost"]
    costs = f"{found['cost']:.9e}", f"{found['bound']:.9e}", f"{gap:.1e}", f"{found['taken']:.6e}"
    states = f"{len(groups)} x {found['states']:,}"
    return [name, states, f"{found['seconds']:.2f}", f"{found['peak']:.0f}", *costs, f"{found['plain']:,.0f}"]


def main() -> None:
    """All cases, or with `--real` those of `greeting` too."""
    if "--measure" in sys.argv:
        print(json.dumps(measure(Path(sys.argv[-1]))))
        return
    print("| " + " | ".join(HEADER) + " |\n|" + " --- |" * len(HEADER))
    for size in (200_000, 1_000_000):
        for case in ("agree", "cut", "apart"):
            print("| " + " | ".join(row_of(case, generated(case, size))) + " |", flush=True)
    if "--real" in sys.argv:
        print("| " + " | ".join(row_of("greeting", real())) + " |")


if __name__ == "__main__":
    main()
