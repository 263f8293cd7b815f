"""The paper's workload: the whole bundled sword fight at 10 mm, 2 degrees and 4 m, from OBJ files to a written edit.

    python -m benchmarks.paper_scale [--parts solve,edits,...] [--slower] [--write]

Nine pairs of key segments of two captures of 409 frames and 20,000 faces, their swords beside them. The captures are
first written as OBJ files into a scratch folder, which is not timed; nor is the compilation of kernels, except where
that is what is measured. Figures are kept in docs/performance.json part by part, so that one part can be measured again
alone; `--slower` keeps them in docs/performance_slower.json, and `--write` makes docs/performance.md of both.
"""

import argparse
import os
import shutil
import statistics
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.duel import BUNDLED, FINE, edits, edits_of_all, with_search
from benchmarks.kept_figures import FILE, SLOWER, keep, kept
from benchmarks.performance_page import write_page
from benchmarks.process import COMMAND, Ran, measured, run, solve

SCRATCH = Path(tempfile.gettempdir()) / "mhvedit-paper-scale"
# Not imported from the package: a child inherits what its parent has had of memory.
CACHE, FRAMES, CONTENTS = ".cache", "frames", "contents.json"
RUNS = 3  # of a whole solve, and of one after a change
STARTS = 5  # of `mhvedit --help`
FULL = ("02-cut-parried", "03-blades-part")  # compared with the search by correlation at every yaw
FINE_SEGMENTS = ("02-cut-parried", "06-blades-locked", "08-thrust-hits")
SAMPLED_YAWS = 6
Figures = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Place:
    """Where things are, under the scratch folder."""

    scratch: Path
    scene: Path

    @property
    def out(self) -> Path:
        """The output folder of the whole solve."""
        return self.scratch / "out"

    def solved(self) -> Path:
        """The output folder, with an answer and a cache that this version has made."""
        solve(self.scene, self.out, "--answer-only")
        return self.out

    def cases(self, *names: str, fine: bool = False) -> list[Path]:
        """Segments kept for the search alone."""
        folder, scene, cache = self.scratch / "cases", self.scene, self.solved() / CACHE
        if fine:
            folder, cache = self.scratch / "fine", self.scratch / "fine-cache"
            scene = self.scene.with_name("fine.toml")
            scene.write_text(with_search(self.scene.read_text(), **FINE))
        measured("measure_search", "make", scene, cache, folder, *names)
        return sorted(path for path in folder.glob("*.pickle") if not names or path.stem in names)


def from_files(place: Place) -> Figures:
    """From OBJ files with nothing kept, from kept frames, and the check on the meshes."""
    cold, warm = [], []
    for _ in range(RUNS):
        shutil.rmtree(place.out, ignore_errors=True)
        cold.append(solved_in(solve(place.scene, place.out, "--answer-only")))
        forget_all_but_frames(place.out)
        warm.append(solved_in(solve(place.scene, place.out, "--answer-only")))
    checked = run(COMMAND, "check", place.out, "--json")
    check = {"seconds": checked.seconds, "peak_mb": checked.peak_mb}
    return {"files": fastest(cold), "frames": fastest(warm), "check": check}


def solved_in(ran: Ran) -> Figures:
    """What a whole solve took."""
    report = ran.figures
    poses = sum(sum(s["rejected"].values()) + s["solutions"] for s in report["segments"])
    outside = sum(s["rejected"].get("outside the window", 0) for s in report["segments"])
    return {
        "seconds": ran.seconds,
        "answer": report["answer_seconds"],
        "stages": report["seconds"],
        "peak_mb": ran.peak_mb,
        "poses": poses - outside,
    }


def fastest(runs: list[Figures]) -> Figures:
    """The fastest of several runs."""
    return min(runs, key=lambda one: one["seconds"])


def forget_all_but_frames(out: Path) -> None:
    """Leave only the converted frames in an output folder, and what is known of the files that they come from."""
    for path in [*out.iterdir(), *(out / CACHE).iterdir()]:
        if path.name in (CACHE, FRAMES, CONTENTS):
            continue
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def warm_edits(place: Place) -> Figures:
    """One change of the scene file at a time: the command again, and the Python interface in one process."""
    text, solved, by_command = place.scene.read_text(), place.solved(), {}
    try:
        for what, new in (edits() | edits_of_all()).items():
            place.scene.write_text(new)
            runs = []
            for _ in range(RUNS):
                ran = solve(place.scene, copied(solved, place.scratch / "edited"), "--answer-only")
                runs.append({"seconds": ran.seconds, "peak_mb": ran.peak_mb})
            by_command[what] = fastest(runs)
            place.scene.write_text(text)
    finally:
        place.scene.write_text(text)
    by_python = measured("warm_edit", place.scene, copied(solved, place.scratch / "edited"))
    unchanged = min(solve(place.scene, place.out, "--answer-only").seconds for _ in range(RUNS))
    python = {"python": by_python.figures, "python_peak_mb": by_python.peak_mb}
    return {"command": by_command, "unchanged": unchanged} | python


def copied(out: Path, to: Path) -> Path:
    """A copy of an output folder; what is large is linked, since it is only ever replaced as a whole.

    Half a gigabyte written anew would take the memory of the run that is measured next.
    """
    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(
        out, to, ignore=lambda folder, names: [FRAMES] if Path(folder).name == CACHE else [], copy_function=_copy
    )
    (to / CACHE / FRAMES).symlink_to(out / CACHE / FRAMES, target_is_directory=True)
    return to


def _copy(source: str, to: str) -> None:
    """Link arrays, copy what else there is."""
    if source.endswith(".npz"):
        os.link(source, to)
    else:
        shutil.copy2(source, to)


def search(place: Place) -> Figures:
    """The search of each segment by itself."""
    return {case.stem: measured("measure_search", "run", case).figures for case in place.cases()}


def plain(place: Place) -> Figures:
    """Beside the paper's method, pose by pose."""
    return {case.stem: measured("measure_search", "plain", case).figures for case in place.cases()}


def correlation(place: Place) -> Figures:
    """Beside the search by FFT: at all yaws of some segments, at a sample of those of the others."""
    found = {}
    for case in place.cases():
        sample = 0 if case.stem in FULL else SAMPLED_YAWS
        found[case.stem] = measured("measure_search", "fft", case, "--sample", str(sample)).figures
        print(f"  {case.stem}: {found[case.stem]}", flush=True)
    return found


def fine(place: Place) -> Figures:
    """Some segments at 5 mm and 1 degree, beside 10 mm and 2 degrees."""
    cases = zip(place.cases(*FINE_SEGMENTS), place.cases(*FINE_SEGMENTS, fine=True), strict=True)
    return {
        usual.stem: {
            "usual": measured("measure_search", "run", usual).figures,
            "fine": measured("measure_search", "run", small, "--runs", "1").figures,
        }
        for usual, small in cases
    }


def frames(place: Place) -> Figures:
    """What one frame costs."""
    return measured("one_frame").figures


def chain(place: Place) -> Figures:
    """The best chain of nine generated segments."""
    lines = measured("chain").output.splitlines()
    header, _, *rows = [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in lines]
    return {"rows": [dict(zip(header, row, strict=True)) for row in rows]}


def start(place: Place) -> Figures:
    """The help, and the first demo ever: kernels are compiled."""
    helps = [run(COMMAND, "--help").seconds for _ in range(STARTS)]
    with tempfile.TemporaryDirectory() as folder:
        where = Path(folder)
        first = run(COMMAND, "demo", "-o", where / "demo", env={"NUMBA_CACHE_DIR": str(where / "numba")})
        shutil.rmtree(where / "demo")
        second = run(COMMAND, "demo", "-o", where / "demo", env={"NUMBA_CACHE_DIR": str(where / "numba")})
    times = {"help": min(helps), "help_median": statistics.median(helps)}
    return times | {"demo_first": first.seconds, "demo_again": second.seconds}


PARTS: dict[str, Callable[[Place], Figures]] = {
    "solve": from_files,
    "edits": warm_edits,
    "search": search,
    "plain": plain,
    "fft": correlation,
    "fine": fine,
    "frames": frames,
    "chain": chain,
    "start": start,
}


def main() -> None:
    """Measure all parts or some, and print what is known of all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", default=",".join(PARTS), help="which, with commas; '' for none")
    parser.add_argument("--scratch", type=Path, default=SCRATCH, help="folder for captures and outputs, about 3 GB")
    parser.add_argument("--write", action="store_true", help="write docs/performance.md")
    parser.add_argument("--slower", action="store_true", help="keep what is measured as that of a slower machine")
    asked = parser.parse_args()
    chosen = [part for part in asked.parts.split(",") if part]
    unknown = set(chosen) - set(PARTS)
    if unknown:
        parser.error(f"parts: expected some of {', '.join(PARTS)}, found {', '.join(sorted(unknown))}")
    place = Place(asked.scratch, duel_in(asked.scratch / "duel"))
    for part in chosen:
        if part == chosen[0] and part != "start":
            compile_kernels(asked.scratch)
        print(f"{part} ...", flush=True)
        keep(part, PARTS[part](place), SLOWER if asked.slower else FILE)
    print(write_page(kept(), kept(SLOWER), into_docs=asked.write))


def duel_in(folder: Path) -> Path:
    """The scene file in a folder that holds the captures as OBJ files; they are written if they are not there."""
    scene = folder / "scene.toml"
    if not scene.exists():
        measured("write_duel", folder)
    shutil.copy(BUNDLED / "scene.toml", scene)
    return scene


def compile_kernels(scratch: Path) -> None:
    """Let whatever is measured find its kernels compiled: solve the bundled demo."""
    run(COMMAND, "demo", "-o", scratch / "compiled")


if __name__ == "__main__":
    main()
