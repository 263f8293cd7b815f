"""More than two people, from takes that were captured in pairs: solves the scenes, and has the independent judge look.

`python -m benchmarks.company OUT` writes a scene file, its output folder and a line of figures for each: three people
of two takes who meet in turn, and two pairs who share a stage with a box on it.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

from mhvedit.pipeline.run import run_scene

SHARED = Path(__file__).resolve().parents[2] / "shared"
HAND: Final = '["{side}Hand", "{side}HandEnd", "{side}HandEnd_end", "{side}HandThumb1_end"], radius = 0.07'
PARTS: Final = {
    "right_hand": HAND.format(side="Right"),
    "left_hand": HAND.format(side="Left"),
    "right_leg": '["RightLeg", "RightFoot"], radius = 0.11',
}
THREE: Final = (
    ("anna", "greeting/a", "frames = [0, 130]", ("right_hand", "right_leg")),
    ("ben", "greeting/b", "frames = [0, 130]", ("right_hand", "right_leg")),
    ("carl", "salsa_open/b", "", ("right_hand",)),
)
MEETINGS: Final = (
    ("hands-touch", "+&+", ("anna", 11, 27, "right_hand"), ("ben", 13, 28, "right_hand"), 2, 2),
    ("slap", "+&+", ("anna", 72, 80, "right_hand"), ("carl", 9, 24, "right_hand"), 5, 2),
    ("shin-kick", "+&+", ("anna", 111, 122, "right_leg"), ("ben", 112, 123, "right_leg"), 2, 2),
)
PAIRS: Final = (
    ("a", "salsa_open/a", "", ("left_hand",)),
    ("b", "salsa_open/b", "", ("right_hand",)),
    ("c", "box_follow/a", "", ()),
    ("d", "box_follow/b", "", ()),
)
SHARING: Final = (
    ("hands-meet", "+&+", ("a", 11, 27, "left_hand"), ("b", 9, 24, "right_hand"), 2, 4),
    ("d-follows-c", "-&+", ("c", 9, 59, "body"), ("d", 7, 48, "body"), 2, 2),
)
STAGE: Final = """
[stage]
floor = [[-3, -3], [3, -3], [3, 3], [-3, 3]]
[[stage.marks]]
subject = "a"
frame = 30
at = [-1.2, 0.5]
[props.box]
path = "box.obj"
place = [0.8, 0, 20]
"""
CORNERS: Final = [(x, y, z) for x in (-0.4, 0.4) for y in (-0.4, 0.4) for z in (0.0, 0.75)]
QUADS: Final = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
Subject = tuple[str, str, str, tuple[str, ...]]  # name, take, another line, parts
Side = tuple[str, int, int, str]  # subject, first and last frame, part
Meeting = tuple[str, str, Side, Side, int, int]  # name, type, A, B, tolerance in frames and in voxels


def scene_text(name: str, subjects: tuple[Subject, ...], meetings: tuple[Meeting, ...], folder: Path) -> str:
    """A scene file for a folder; the takes stay where they are."""
    scenes = os.path.relpath(SHARED / "data" / "scenes", folder)
    lines = ["version = 1", f'name = "{name}"', "fps = 25"]
    for known_as, take, more, parts in subjects:
        lines += [
            f"[subjects.{known_as}]",
            f'path = "{scenes}/{take}"',
            "fps = 25",
            more,
            f"[subjects.{known_as}.parts]",
        ]
        lines += [f'{part} = {{track = "{scenes}/{take}.csv", joint = {PARTS[part]}}}' for part in parts]
    for title, kind, (a, *frames_a, part_a), (b, *frames_b, part_b), frames, voxels in meetings:
        lines += ["[[segments]]", f'name = "{title}"', f'between = ["{a}", "{b}"]', f'interaction = "{kind}"']
        lines += [f"frames = {{{a} = {frames_a}, {b} = {frames_b}}}", f'parts = {{{a} = "{part_a}", {b} = "{part_b}"}}']
        lines += [f"tolerance = {{frames = {frames}, voxels = {voxels}, depth = 0.03, apart = 0.02}}"]
    return "\n".join(lines) + "\n"


def main(out: Path) -> None:
    """Solve both scenes."""
    out.mkdir(parents=True, exist_ok=True)
    rows = [f"v {x} {y} {z}" for x, y, z in CORNERS] + [f"f {' '.join(map(str, quad))}" for quad in QUADS]
    (out / "box.obj").write_text("\n".join(rows) + "\n")
    scenes = {
        "three": scene_text("three", THREE, MEETINGS, out),
        "pairs": scene_text("pairs", PAIRS, SHARING, out) + STAGE,
    }
    for name, text in scenes.items():
        scene = out / f"{name}.toml"
        scene.write_text(text)
        started = time.perf_counter()
        outcome = run_scene(scene, out / name, report=False)
        spent = time.perf_counter() - started
        judge = [sys.executable, str(SHARED / "tools" / "judge.py"), str(scene), str(out / name)]
        said = subprocess.run(judge, capture_output=True, text=True, check=True).stdout.splitlines()[-1]
        found = {key: outcome.report[key] for key in ("cost", "gap", "bends", "problems")}
        print(json.dumps({"scene": name, "seconds": round(spent, 1), **found, "judge": json.loads(said)}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
