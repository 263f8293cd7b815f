"""Reads an output folder without mhvedit: what was found, what was rejected and why, what was chosen.

python examples/look_at_solutions.py      # reads out/demo, which `mhvedit demo` writes
"""

import json
from pathlib import Path

import numpy as np


def main(out: Path = Path("out/demo")) -> None:
    """All key segments in turn."""
    edit = json.loads((out / "edit.json").read_text())
    for segment in edit["segments"]:
        with np.load(out / "solutions" / f"{segment['name']}.npz") as found:
            look(segment, dict(found))


def look(segment: dict[str, object], found: dict[str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]) -> None:
    """One segment."""
    print(f"{segment['name']} {segment['interaction']}: {len(found['x']):,} of {found['reason'].size:,} poses pass")
    counts = np.bincount(found["reason"].ravel(), minlength=len(found["reasons"]))
    for name, count in zip(found["reasons"], counts, strict=True):
        print(f"  {count:12,} {name}")
    for region in range(min(3, int(found["region"].max(initial=-1)) + 1)):
        rows = np.flatnonzero(found["region"] == region)
        best = rows[found["clearance"][rows].argmax()]
        place = f"x {found['x'][best]:+.2f} m, y {found['y'][best]:+.2f} m, yaw {np.degrees(found['yaw'][best]):+.0f}°"
        print(f"  region {region}: {len(rows):,} solutions, deepest inside at {place}")
    print(f"  chosen: {segment['relative']}")


if __name__ == "__main__":
    main()
