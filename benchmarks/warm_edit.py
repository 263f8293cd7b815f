"""Solves a scene and changes it again and again through the Python interface, in one process; prints seconds as JSON.

    python -m benchmarks.warm_edit SCENE OUT

OUT was written by `mhvedit solve` from the bundled sword fight; only its cache is used.
"""

import argparse
import json
import time
from pathlib import Path

from benchmarks.duel import edits, edits_of_all
from mhvedit import api
from mhvedit.pipeline.kept import entries_in
from mhvedit.pipeline.output import CACHE

RUNS = 3


def answer_again(scene: Path, out: Path, before: api.Result, text: str) -> dict[str, float]:
    """Seconds to a new answer after a change of the scene file, fastest and first of some times, and to its files."""
    scene.write_text(text)
    there, seconds = {entry.file for entry in entries_in(out)}, []
    for _ in range(RUNS):
        for entry in entries_in(out):
            if entry.file not in there:
                entry.file.unlink()
        began = time.perf_counter()
        result = api.solve(api.load(scene, cache=out / CACHE), previous=before)
        seconds.append(time.perf_counter() - began)
    began = time.perf_counter()
    api.write(result, out / "written")
    return {"answer": min(seconds), "first": seconds[0], "write": time.perf_counter() - began}


def main() -> None:
    """All changes, one after the other, each from the unchanged scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("out", type=Path)
    asked = parser.parse_args()
    text = asked.scene.read_text()
    before = api.solve(api.load(asked.scene, cache=asked.out / CACHE))
    try:
        changes = edits() | edits_of_all()
        print(json.dumps({what: answer_again(asked.scene, asked.out, before, new) for what, new in changes.items()}))
    finally:
        asked.scene.write_text(text)


if __name__ == "__main__":
    main()
