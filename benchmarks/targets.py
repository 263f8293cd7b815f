"""What the search, the chain, the cache and the start are meant to reach, beside what was measured."""

from collections.abc import Callable, Sequence
from typing import Any

from benchmarks.duel import edits

Figures = dict[str, Any]
Target = tuple[str, str, str, bool]


def targets(figures: Figures) -> list[str]:
    """All targets, each with what was measured and whether it is met."""
    rows = [row for part, of_part in TARGETS.items() if part in figures for row in of_part(figures[part])]
    told = [[what, said, found, "yes" if met else "**missed**"] for what, said, found, met in rows]
    return table(["what", "target", "measured", "met"], told)


def at_most(what: str, limit: float, found: float, unit: str) -> Target:
    """A target that less is better for."""
    return what, f"≤ {limit:g} {unit}", f"{_short(found)} {unit}", found <= limit


def at_least(what: str, limit: float, found: float) -> Target:
    """A ratio that more is better for."""
    return what, f"≥ {limit:,.0f}", f"{found:,.0f}", found >= limit


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 100 else f"{value:.2g}" if value < 1 else f"{value:.1f}"


def solve_targets(own: Figures) -> list[Target]:
    """Of the whole solve."""
    return [
        at_most("from OBJ files, nothing kept, to the answer", 30, own["files"]["seconds"], "s"),
        at_most("from kept frames to the answer", 10, own["frames"]["seconds"], "s"),
        at_most("peak memory of these", 2048, max(own[way]["peak_mb"] for way in ("files", "frames")), "MB"),
    ]


def edit_targets(own: Figures) -> list[Target]:
    """Of answers after a change of one segment."""
    command = max(own["command"][what]["seconds"] for what in edits())
    python = max(own["python"][what]["answer"] for what in edits())
    return [
        at_most("after a change of one segment, by the command, slowest", 2, command, "s"),
        at_most("after a change of one segment, in Python, slowest", 1, python, "s"),
    ]


def plain_targets(own: Figures) -> list[Target]:
    """Of the ratio to the paper's method."""
    return [at_least("search: times faster than the paper's method in NumPy", 10_000, ratio(own, "seconds"))]


def fft_targets(own: Figures) -> list[Target]:
    """Of the ratio to the search by FFT, and its agreement."""
    full = [one for one in segments(own).values() if one["yaws"] >= 180]
    differ = sum(one["different"] for one in segments(own).values())
    same = f"{differ:,} of {sum(one['compared'] for one in segments(own).values()):,}"
    return [
        at_least("search: times faster than correlation by FFT", 30, ratio(own, "seconds")),
        ("poses that differ from correlation by FFT", "0", same, differ == 0),
        at_least("segments compared on the full grid", 2, len(full)),
    ]


def fine_targets(own: Figures) -> list[Target]:
    """Of 16 times the poses at 8 times the voxels."""
    worst = max(one["fine"]["seconds"] / one["usual"]["seconds"] for one in segments(own).values())
    peak = max(one["fine"]["peak_mb"] for one in segments(own).values())
    return [
        at_most("5 mm and 1° beside 10 mm and 2°, search, slowest", 20, worst, "times"),
        at_most("5 mm and 1°, peak memory of the search", 4096, peak, "MB"),
    ]


def frame_targets(own: Figures) -> list[Target]:
    """Of single frames."""
    return [
        at_most("voxels of 40,000 faces, closed", 5, own["closed"], "ms"),
        at_most("voxels of 40,000 faces, torn", 20, own["torn"], "ms"),
        at_most("kept frame, read", 2, own["cached"], "ms"),
    ]


def chain_targets(own: Figures) -> list[Target]:
    """Of the chain."""
    states = [int(row["states"].split("x")[1].replace(",", "")) for row in own["rows"]]
    slowest = max(float(row["seconds"]) for row, count in zip(own["rows"], states, strict=True) if count <= 200_000)
    return [at_most("chain of 9 segments of up to 200,000 states, slowest", 3, slowest, "s")]


def start_targets(own: Figures) -> list[Target]:
    """Of starting up."""
    return [
        at_most("`mhvedit --help`", 0.3, own["help"], "s"),
        at_most("first demo ever, compilation included", 60, own["demo_first"], "s"),
    ]


def segments(own: Figures) -> dict[str, Figures]:
    """A part's figures by segment, without what is noted of the part."""
    return {name: one for name, one in own.items() if isinstance(one, dict)}


def ratio(own: Figures, what: str) -> float:
    """All segments' time by a baseline to all segments' time by ours."""
    ours = sum(one["ours"] for one in segments(own).values())
    return float(sum(one[what] for one in segments(own).values()) / ours)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A table in Markdown."""
    return ["| " + " | ".join(row) + " |" for row in [header, ["---"] * len(header), *rows]]


TARGETS: dict[str, Callable[[Figures], list[Target]]] = {
    "solve": solve_targets,
    "edits": edit_targets,
    "plain": plain_targets,
    "fft": fft_targets,
    "fine": fine_targets,
    "frames": frame_targets,
    "chain": chain_targets,
    "start": start_targets,
}
