"""Solves every scene whose truth is known, has an independent judge measure the output, and writes docs/results.md."""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.targets import table
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import apply_pose, invert, rotation, wrap_angle
from mhvedit.optimise.stages import pose_codes
from mhvedit.pipeline.assemble import Assembly, assemble
from mhvedit.pipeline.job import Result
from mhvedit.pipeline.run import run_scene

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"
PAGE = ROOT / "docs" / "results.md"
SELF_COLLISION = (
    "What `mhvedit avoid` makes of captured motions, by both methods and by the baseline, the thesis's scenes, and its",
    "kernels beside other libraries: see [avoidance results](avoidance_results.md). Detection beside other libraries:",
    "see [collision results](collision_results.md).",
)
NEAR_MM, NEAR_DEG = 20.0, 3.0  # a truth this near to a solution counts as found
SEGMENT_HEADER = [
    "segment",
    "type",
    "solutions",
    "nearest mm / °",
    "chosen mm / °",
    "equal cost mm / °",
    "chosen without quality mm / °",
    "deepest mm",
]
SCENE_HEADER = ["scene", "frames", "cost m²", "gap %", "chains of equal cost", "deepest mm", "added step mm", "seconds"]
INTRODUCTION = """# Results

Five takes of two people who were motion-captured together, dressed in body models, meshed anew in every frame and
then pulled apart: own world frame, own speed, own start. The true pose is known only to the judge, a program that
shares no code with mhvedit. Made by `python -m benchmarks.results`; facing and gaze are estimated from the meshes.

- *nearest*: how far the nearest solution of the group is from the truth, at B's hips: does the truth pass?
- *chosen*: how far the solution that the chain chose is from the truth.
- *equal cost*: the size of the set of poses that all segments of the scene accept: its largest extent at B's hips,
  and the smallest arc that holds all its yaws. All of them cost nothing, so the paper's cost cannot tell them apart; a
  dash means that there is none, and the chain is the cheapest compromise.
- *without quality*: what is chosen if clearance alone breaks ties.
- *deepest*: deepest penetration of the two bodies in the segment, from the judge. In the motion capture itself rigid
  hands overlap by 10 to 20 mm and held bodies by up to 45 mm.
- *added step*: the most that the edit adds to anyone's motion from one frame to the next.
- *seconds*: a first solve with its check on the meshes, two threads, without drawing the report.

A type alone leaves much open. Where a scene has one segment and nobody touches anybody (`box_follow`, `crawl_out`),
metres and all directions are left, and the chosen pose says nothing about the truth. Many segments (`greeting`) narrow
it down by themselves; a long hold (`pushup_grab`) does by how the parts move in it, which is what quality measures.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """A scene, solved and judged."""

    name: str
    result: Result
    judged: dict[str, Any]
    truth: dict[str, Any]
    seconds: float


def main() -> None:
    """All scenes, or those named on the command line; the page is only written for all."""
    chosen = sys.argv[1:]
    scenes = [path for path in sorted((SHARED / "data" / "scenes").iterdir()) if not chosen or path.name in chosen]
    solved = []
    for path in scenes:
        solved.append(solve_and_judge(path))
        print("\n".join(segment_table([solved[-1]])), flush=True)
    page = [INTRODUCTION, "## Segments", *segment_table(solved), "", found_in_words(solved)]
    page += ["", "## Scenes", *table(SCENE_HEADER, [scene_row(one) for one in solved]), "", *touch_list(solved)]
    if chosen:
        print("\n".join(page))
        return
    page += ["", "## Self-collision", *SELF_COLLISION]
    page += ["", "## Facing and gaze", "See [facing](facing.md) for what is measured.", "", facing_tables()]
    PAGE.write_text("\n".join(page).rstrip() + "\n", encoding="utf-8")


def solve_and_judge(folder: Path) -> Solved:
    """Solve one scene from nothing, and judge what was written."""
    with tempfile.TemporaryDirectory() as kept:
        out = Path(kept) / folder.name
        began = time.perf_counter()
        outcome = run_scene(folder / "scene.toml", out, report=False)
        seconds = time.perf_counter() - began
        verdict = out / "judged.json"
        judge = [sys.executable, str(SHARED / "tools" / "judge.py"), str(folder / "scene.toml"), str(out)]
        judge += ["--truth", str(folder / "truth.json"), "--json", str(verdict)]
        subprocess.run(judge, check=True, stdout=subprocess.DEVNULL)
        judged = json.loads(verdict.read_text())
    truth = json.loads((folder / "truth.json").read_text())
    return Solved(folder.name, outcome.result, judged, truth, seconds)


def segment_table(solved: Sequence[Solved]) -> list[str]:
    """One row for each segment."""
    return table(SEGMENT_HEADER, [row for one in solved for row in segment_rows(one)])


def segment_rows(one: Solved) -> list[list[str]]:
    """What was found in each segment of a scene, against the truth."""
    common, plain, rows = common_poses(one.result), without_quality(one.result), []
    for index, judged in enumerate(one.judged["segments"]):
        hips = np.array(one.truth["segments"][judged["name"]]["hips_b"])[:2]
        nearest, chosen = (f"{judged[f'{k}_mm']:.0f} / {judged[f'{k}_deg']:.1f}" for k in ("nearest", "chosen"))
        other = off(plain.scene.segments[index].relative, one.truth["relative"], hips)
        shown = f"{one.name} {judged['name']}", f"`{judged['interaction']}`", f"{judged['solutions']:,}"
        rows.append([*shown, nearest, chosen, extent(common, one.result, hips), other, f"{judged['deepest_mm']:.0f}"])
    return rows


def common_poses(result: Result) -> FloatArray:
    """(N, 3) the poses, in canonical frames, that all segments accept."""
    codes: list[IntArray] = [pose_codes(segment.group.keys) for segment in result.segments]
    kept = np.ones(len(codes[0]), np.bool_)
    for other in codes[1:]:
        kept &= np.isin(codes[0], other)
    return np.asarray(result.segments[0].group.poses[kept])


def without_quality(result: Result) -> Assembly:
    """The same scene if the quality of contacts says nothing."""
    plain = [replace(segment, quality=False) for segment in result.segments]
    return assemble(result.job.scene, result.people, plain, fps=result.job.fps)


def extent(poses: FloatArray, result: Result, hips: FloatArray) -> str:
    """Largest distance between two places of B's hips, mm, and the smallest arc that holds all yaws, degrees."""
    if not len(poses):
        return "–"
    name = result.job.scene.segments[0].between[1]
    own = apply_pose(invert(result.people[name].pose), hips)
    places = rotation(poses[:, 2]) @ own + poses[:, :2]
    ways = np.linspace(0, np.pi, 90, endpoint=False)
    widest = np.ptp(places @ np.array([np.cos(ways), np.sin(ways)]), axis=0).max()
    yaws = np.sort(poses[:, 2] % (2 * np.pi))
    hole = np.diff(np.append(yaws, yaws[0] + 2 * np.pi)).max()
    return f"{widest * 1000:.0f} / {np.degrees(2 * np.pi - hole):.0f}"


def off(relative: FloatArray, truth: dict[str, float], hips: FloatArray) -> str:
    """How far a pose of B in A is from the true one: mm at the hips, and degrees."""
    true = np.array([truth["x"], truth["y"], truth["yaw"]])
    apart = apply_pose(relative, hips) - apply_pose(true, hips)
    turn = abs(np.degrees(wrap_angle(relative[2] - true[2])))
    return f"{np.linalg.norm(apart) * 1000:.0f} / {turn:.1f}"


def found_in_words(solved: Sequence[Solved]) -> str:
    """For how many segments the truth passes."""
    rows = [row for one in solved for row in one.judged["segments"]]
    found = sum(row["nearest_mm"] <= NEAR_MM and row["nearest_deg"] <= NEAR_DEG for row in rows)
    return f"In {found} of {len(rows)} segments the truth lies within {NEAR_MM:g} mm and {NEAR_DEG:g}° of a solution."


def scene_row(one: Solved) -> list[str]:
    """The figures of a whole scene."""
    scene, assembly = one.judged["scene"], one.result.assembly
    assert assembly is not None
    step = max(own["mm"] for own in scene["largest_added_step"].values())
    figures = f"{scene['cost']:.3g}", f"{scene['gap']:.2g}", f"{assembly.placements.equals:,}"
    return [one.name, str(scene["frames"]), *figures, f"{scene['deepest_mm']:.0f}", f"{step:.0f}", f"{one.seconds:.0f}"]


def touch_list(solved: Sequence[Solved]) -> list[str]:
    """In which frames of each segment the two parts touch."""
    lines = [
        "## Touch",
        "Frames of each segment in which the two parts are within 10 mm (`#`), from the judge.",
        "",
        "```text",
    ]
    for one in solved:
        lines += [
            f"{row['interaction']:5} {row['part_touch']}  {one.name} {row['name']}" for row in one.judged["segments"]
        ]
    return [*lines, "```"]


def facing_tables() -> str:
    """What benchmarks/facing.py measures."""
    run = [sys.executable, str(ROOT / "benchmarks" / "facing.py"), "--markdown"]
    return subprocess.run(run, check=True, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    main()
