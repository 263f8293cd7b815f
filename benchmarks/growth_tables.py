"""The part of the performance page on how the search grows."""

from typing import Any

Figures = dict[str, Any]
NOTE_GROWTH = """\
One segment of type `0&0b`, sword and sword, cut out of the bundled fight, with one setting changed at a time; the
others stay at 10 mm, 2°, 10 mm voxels and 16 successive frames. Seconds and memory are of the search alone, in a
process of its own; *growth* is in seconds, against the row above.
"""


def growth_section(figures: Figures) -> list[str]:
    """A table for each setting."""
    lines = ["## How the search grows", NOTE_GROWTH]
    for axis, rows in figures["growth"].items():
        if isinstance(rows, list):
            lines += [f"| {axis} | poses | boundary | s | growth | MB |", "|" + " --- |" * 6, *_rows(rows), ""]
    return lines[:-1]


def _rows(rows: list[Figures]) -> list[str]:
    """One row for each value."""
    before: float | None = None
    lines = []
    for row in rows:
        growth = "" if before is None else f"x {row['seconds'] / before:.2f}"
        cells = row["value"], f"{row['poses']:,}", f"{row['boundary']:,}", f"{row['seconds']:.2f}", growth
        lines.append("| " + " | ".join([*cells, f"{row['peak_mb']:.0f}"]) + " |")
        before = row["seconds"]
    return lines
