"""Writes the bundled sword fight as numbered OBJ files, with the scene file that names them.

    python -m benchmarks.write_duel FOLDER

OBJ is how captures most often come; the bundled ones are stored compactly.
"""

import argparse
import shutil
from pathlib import Path

from benchmarks.duel import BUNDLED
from benchmarks.frames import write_obj
from mhvedit.sequences.read import open_capture

CAPTURES = ("anna", "ben", "anna_sword", "ben_sword")


def main() -> None:
    """Write all captures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    for name in CAPTURES:
        (folder / name).mkdir(parents=True, exist_ok=True)
        capture = open_capture(BUNDLED / name, name=name, fps=25)
        for number in capture.numbers:
            write_obj(folder / name / f"{name}_{number:04d}.obj", capture.mesh(number))
    for file in (*BUNDLED.glob("*.csv"), BUNDLED / "scene.toml"):  # the scene last: it says that all is there
        shutil.copy(file, folder)


if __name__ == "__main__":
    main()
