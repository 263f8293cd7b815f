"""Command line of the generator: `python -m data.make_duel`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from .capture import Clock, clock, joint_rows, place, sword_mesh
from .check import check_folder, table
from .flesh import body_shapes
from .mesh import mesh_of
from .perform import performer, posed_at
from .sword import sword_rest
from .write import BODY_STEP, SWORD_STEP, write_mesh, write_scenes, write_track, write_truth

PITCH = {"anna": 0.0115, "ben": 0.0125}  # m
FACES = 20_000
NOISE = 0.0008  # m
SWORD_NOISE = 0.0003  # m


def make_capture(folder: Path, name: str, times: Clock, made: int) -> None:
    """All meshes and the joint track of one fencer."""
    who, other = performer(name), performer("ben" if name == "anna" else "anna")
    number = 1 if name == "anna" else 2
    rest, lines = sword_rest(), []
    for part in (name, f"{name}_sword"):
        (folder / part).mkdir(parents=True, exist_ok=True)
        for old in (folder / part).glob(f"{part}_*.drc"):
            old.unlink()
    for frame, time in enumerate(times.times[:made]):
        posed = posed_at(who, other, float(time))
        shapes = body_shapes(who.figure, posed)
        vertices, faces = mesh_of(shapes, pitch=PITCH[name], faces_about=FACES, seed=(number, frame), noise=NOISE)
        write_mesh(folder / name / f"{name}_{frame:04d}.drc", place(vertices, name), faces, BODY_STEP)
        vertices, faces = sword_mesh(posed, rest, seed=(number + 2, frame), noise=SWORD_NOISE)
        path = folder / f"{name}_sword" / f"{name}_sword_{frame:04d}.drc"
        write_mesh(path, place(vertices, name), faces, SWORD_STEP)
        lines += joint_rows(posed, name, frame)
        print(f"\r{name}: {frame + 1} of {min(made, len(times.times))} frames", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    write_track(folder / f"{name}.csv", lines)


def main() -> int:
    """Makes the demo, then checks it on the files; exit 1 if a segment does not hold."""
    parser = argparse.ArgumentParser(prog="python -m data.make_duel", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent.parent / "duel", help="folder to write")
    parser.add_argument("--frames", type=int, default=10_000, help="make only the first so many frames of each")
    parser.add_argument("--no-check", action="store_true", help="write only")
    options = parser.parse_args()
    clocks = {name: clock(name) for name in ("anna", "ben")}
    for name, times in clocks.items():
        make_capture(options.out, name, times, options.frames)
    write_scenes(options.out, clocks, options.frames)
    write_truth(options.out / "truth.json", clocks)
    if options.no_check:
        return 0
    outcome = check_folder(options.out)
    print(table(outcome))
    return 0 if all(segment.holds for segment in outcome.segments) else 1


if __name__ == "__main__":
    sys.exit(main())
