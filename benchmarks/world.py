"""Measure the paper's scenes of a driven body in a world, frame by frame, and what each solver stage adds.

    python -m benchmarks.world [--frames 600] [-o FILE]

A line a scene: median and 95th percentile of a frame on one core without rendering, the deepest overlap that was left
and the frames that were stuck, beside the paper's own time for the same stages (1.7 GHz Xeon) and beside MuJoCo, which
steps a figure of the same capsules, held to the same motion by its joint actuators, in the same run.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.world_mujoco import mujoco_frames
from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.avatar_scenes import AVATAR_SCENES, WorldScene, avatar_scene
from mhvedit.world.hand_scenes import HAND_SCENES, hand_scene
from mhvedit.world.resolve import CHEAPEST_FIRST, PAPER, ResolveSettings, Stage, stage_counts
from mhvedit.world.simulate import FrameReport, Simulation
from mhvedit.world.world import start

PAPER_MS: Final = {"two arms": 4.40, "self-collision": 5.71, "two arms and leg": 7.25, "arm in corner": 10.20}
ORDERS: Final = {
    "default": ResolveSettings(),
    "descent": PAPER,
    "least squares": ResolveSettings((Stage.LEAST_SQUARES, Stage.BACK)),
    "descent, least squares, posture": CHEAPEST_FIRST,
    "least squares, posture": ResolveSettings((Stage.LEAST_SQUARES, Stage.POSTURE, Stage.BACK)),
}
RUNS: Final = 3  # of which the fastest counts, frame by frame


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """One scene by one order of stages."""

    times: FloatArray  # (T,) ms
    reports: tuple[FrameReport, ...]
    largest_step: float  # rad or m, largest change of a DOF from frame to frame; 0 without a figure
    effort: float  # mean of sum gamma (q - tracked)^2

    @property
    def deepest_mm(self) -> float:
        """Overlap that was left in some frame."""
        return 1000 * max(report.deepest for report in self.reports)

    @property
    def stuck(self) -> int:
        """Frames that say so."""
        return sum(bool(report.stuck) for report in self.reports)

    def times_text(self) -> str:
        """Median, 95th percentile and largest."""
        return " | ".join(f"{value:.2f}" for value in (*np.percentile(self.times, [50, 95]), self.times.max()))


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("-o", "--out", type=Path)
    chosen = parser.parse_args()
    scenes = [avatar_scene(name, n_frames=chosen.frames) for name in AVATAR_SCENES]
    hands = [hand_scene(name, n_frames=chosen.frames) for name in HAND_SCENES]
    text = scene_table([*scenes, *hands]) + "\n" + order_table(scenes)
    print(text)
    if chosen.out is not None:
        chosen.out.write_text(text, encoding="utf-8")


def measured(scene: WorldScene, settings: ResolveSettings | None = None) -> Measured:
    """All frames, as often as RUNS says after one run that compiles."""
    times, reports = [], tuple[FrameReport, ...]()
    for _ in range(RUNS + 1):
        simulation, state = Simulation(scene.world, settings=settings), start(scene.world, scene.poses)
        run, found = [], []
        for tracked in scene.tracked:
            began = time.perf_counter()
            state, report = simulation.step(state, tracked, 1 / scene.fps)
            run.append(1000 * (time.perf_counter() - began))
            found.append(report)
        times.append(run)
        reports = tuple(found)
    q = np.array([report.resolved.q for report in reports if report.resolved is not None])
    best = np.array(times[1:]).min(0)
    if scene.world.figure is None:
        return Measured(best, reports, 0.0, 0.0)
    off = q - np.array([tracked.posture for tracked in scene.tracked])
    effort = float((scene.world.figure.effort * off**2).sum(1).mean())
    return Measured(best, reports, float(np.abs(np.diff(q, axis=0)).max()), effort)


def scene_table(scenes: Sequence[WorldScene]) -> str:
    """A line a scene."""
    text = (
        "| scene | frames | median ms | 95 % ms | max ms | deepest mm | stuck | paper ms | MuJoCo ms a frame | "
        "MuJoCo deepest mm |\n|" + "---|" * 10 + "\n"
    )
    for scene in scenes:
        found = measured(scene)
        beside = "– | –"
        if scene.world.figure is not None:
            steps = mujoco_frames(scene)
            beside = f"{np.median(steps.times):.2f} | {steps.deepest_mm:.1f}"
        text += (
            f"| {scene.name} | {len(scene.tracked)} | {found.times_text()} | {found.deepest_mm:.2f} | {found.stuck} | "
            f"{PAPER_MS.get(scene.name, '–')} | {beside} |\n"
        )
    return text


def order_table(scenes: Sequence[WorldScene]) -> str:
    """What stages add: which had the last word in how many frames, and what that costs."""
    text = (
        "| scene | stages in order | free | posture | least squares | descent | back | stuck | median ms | 95 % ms | "
        "max ms | largest step, rad | effort |\n|" + "---|" * 13 + "\n"
    )
    for scene in scenes:
        for name, settings in ORDERS.items():
            found = measured(scene, settings)
            counts = stage_counts([report.resolved for report in found.reports if report.resolved is not None])
            shares = " | ".join(f"{counts[stage]}" for stage in Stage)
            text += (
                f"| {scene.name} | {name} | {shares} | {found.times_text()} | {found.largest_step:.2f} | "
                f"{found.effort:.2f} |\n"
            )
    return text


if __name__ == "__main__":
    main()
