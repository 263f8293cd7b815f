"""Makes docs/performance.md of figures that were kept: targets beside what was measured, then each part."""

from collections.abc import Callable
from pathlib import Path

from benchmarks.growth_tables import growth_section
from benchmarks.targets import Figures, ratio, segments, table, targets

PAGE = Path(__file__).resolve().parents[1] / "docs" / "performance.md"
INTRODUCTION = """# Performance

The workload of the paper, measured: nine pairs of key segments, two captures of 409 frames and 20,000 faces with their
swords, placements every 10 mm and 2° in a window of 4 m. Every number on this page was written by
`python -m benchmarks.paper_scale --write` and `python -m benchmarks.growth --write`; none by hand.

The paper reports 287 minutes for a workload of this size, on a machine of its day.
"""
NOTE_SOLVE = """\
*Answer*: `edit.json` and all solution groups are written; what `mhvedit solve` does after that, the check on the
meshes and the report, is told apart. Seconds are of the whole process with `--answer-only`, from its start to its end;
the fastest of three runs. Two segments are worked on at a time, so that their times overlap. Kernels are compiled
already, and the system may have the OBJ files in memory. Kept frames are converted meshes, and where each is (its
centre and bounds).
"""
NOTE_EDITS = """\
The scene file is changed in one place, and solved again on the same folder. *Command*: `mhvedit solve --answer-only`,
from the start of the process to its end, the fastest of three runs. *Python*: `api.solve(api.load(...),
previous=...)` in a process that has solved the scene before, the fastest of three times; the *first* also loads
compiled kernels that nothing before it had need of, and reads what is kept. *Written* adds `api.write`, which writes
all solution groups anew. The targets are for a change of one segment; the last two rows change all nine. Where the
segments keep a pose in common, the chain costs nothing; the changes of `tolerance.voxels` and `tolerance.apart` take
the last one away, so that a chain of different placements has to be found, and proven best.
"""
NOTE_MEASURED = """\
In brackets how long `import numba` took when a part had been measured: the machine's speed varies by a factor of two
from hour to hour.
"""
NOTE_SLOWER = """\
What a target says in seconds depends on the machine. The same, measured by `--slower` on one that takes two to three
times as long:
"""
NOTE_SEARCH = """\
`search_poses` with the clauses of each segment: contact, its moments, what keeps apart. Sight is told apart, since the
baselines leave it out; it is looked at only where the rest accepts.

- *boundary*: poses beside which, along x or y, a pose has another reason. No method that tells all poses apart can
  do without looking at these; all others can be settled in blocks.
- *plain*: the paper's method in NumPy, pose by pose, one thread: move B's voxels, intersect, test. Timed on a random
  sample, scaled up. B is turned and shifted at each pose; *turned before* is the same without the turning.
- *FFT*: correlation per yaw, two threads, by `scipy.fft`; see `benchmarks/fft_search.py` for what it leaves out.
  Where not all yaws were searched, the time is scaled up from evenly spread ones.
- *differ*: poses at which the reasons differ, of those that were compared.

Ratios are of times measured in one process, one after the other.
"""


def write_page(figures: Figures, slower: Figures, *, into_docs: bool) -> str:
    """The page; `into_docs` to put it into docs/performance.md.

    Args:
        figures: of all parts.
        slower: of parts that were measured on a slower machine as well.
        into_docs: whether to write the file.
    """
    lines = [INTRODUCTION, "## Targets", *targets(figures)]
    if slower:
        lines += ["", "### On a slower machine", NOTE_SLOWER, *targets(slower), "", *measured_when(slower)]
    for part, section in SECTIONS.items():
        if part in figures:
            lines += ["", *section(figures)]
    page = "\n".join([*lines, "", "## Measured", NOTE_MEASURED, *measured_when(figures)]) + "\n"
    if into_docs:
        PAGE.write_text(page, encoding="utf-8")
    return page


def solve_section(figures: Figures) -> list[str]:
    """Stages of a whole solve."""
    own = figures["solve"]
    files, frames = own["files"], own["frames"]
    stages = [[name, f"{spent:.2f}", f"{frames['stages'][name]:.2f}"] for name, spent in files["stages"].items()]
    ways = (files, frames)
    stages.append(["from the start of the work to the answer", *(f"{way['answer']:.2f}" for way in ways)])
    stages.append(["starting and ending the process", *(f"{way['seconds'] - way['answer']:.2f}" for way in ways)])
    stages.append(["**whole**", *(f"**{way['seconds']:.2f}**" for way in ways)])
    stages.append(["peak memory, MB", *(f"{way['peak_mb']:.0f}" for way in ways)])
    stages.append(["poses a second", *(f"{way['poses'] / way['seconds']:,.0f}" for way in ways)])
    check = f"{own['check']['seconds']:.1f} s more, and {own['check']['peak_mb']:.0f} MB"
    return [
        "## From files to an edit",
        NOTE_SOLVE,
        *table(["stage", "from OBJ files, s", "from kept frames, s"], stages),
        "",
        f"All {files['poses']:,} poses of the nine windows are decided. The check on the meshes, `mhvedit check`,",
        f"takes {check}.",
    ]


def edit_section(figures: Figures) -> list[str]:
    """Answers after a change."""
    own = figures["edits"]
    rows = [
        [
            what,
            f"{ran['seconds']:.2f}",
            f"{own['python'][what]['answer']:.2f}",
            f"{own['python'][what]['first']:.2f}",
            f"{_with_write(own['python'][what]):.2f}",
        ]
        for what, ran in own["command"].items()
    ]
    peak = max(ran["peak_mb"] for ran in own["command"].values())
    rows.append(["nothing", f"{own['unchanged']:.2f}", "", "", ""])
    rows.append(["peak memory, MB", f"{peak:.0f}", "", "", f"{own['python_peak_mb']:.0f}"])
    header = ["changed", "command, s", "Python, s", "first, s", "written, s"]
    return ["## After a change", NOTE_EDITS, *table(header, rows)]


def _with_write(spent: Figures) -> float:
    return float(spent["answer"] + spent["write"])


def search_section(figures: Figures) -> list[str]:
    """The search alone, beside baselines."""
    own, header = segments(figures["search"]), ["segment", "type", "frames", "poses", "boundary", "s", "sight, s", "MB"]
    rows = [
        [
            name,
            f"`{one['interaction']}`",
            str(one["frames"]),
            f"{one['poses']:,}",
            f"{one['boundary']:,}",
            f"{one['seconds']:.2f}",
            f"{one['sight_seconds']:.2f}" if one["sight_seconds"] else "–",
            f"{one['peak_mb']:.0f}",
        ]
        for name, one in own.items()
    ]
    lines = ["## The search", NOTE_SEARCH, *table(header, rows)]
    for part, baseline in (("plain", plain_table), ("fft", fft_table)):
        if part in figures:
            lines += ["", *baseline(figures[part])]
    return [*lines, "", *bound(list(own.values()))]


def plain_table(own: Figures) -> list[str]:
    """Beside the paper's method."""
    rows = [
        [
            name,
            f"{one['ours']:.2f}",
            f"{one['seconds']:,.0f}",
            f"{one['seconds'] / one['ours']:,.0f}",
            f"{one['without_turning'] / one['ours']:,.0f}",
            f"{one['different']} of {one['compared']}",
        ]
        for name, one in segments(own).items()
    ]
    rows.append(
        ["**all**", "", "", f"**{ratio(own, 'seconds'):,.0f}**", f"**{ratio(own, 'without_turning'):,.0f}**", ""]
    )
    return table(["segment", "ours, s", "plain, s", "ratio", "ratio, turned before", "differ"], rows)


def fft_table(own: Figures) -> list[str]:
    """Beside the search by FFT."""
    rows = [
        [
            name,
            f"{one['ours']:.2f}",
            f"{one['seconds']:,.0f}",
            f"{one['seconds'] / one['ours']:,.0f}",
            "all" if one["yaws"] >= 180 else str(one["yaws"]),
            f"{one['different']} of {one['compared']:,}",
            f"{one['peak_mb']:.0f}",
        ]
        for name, one in segments(own).items()
    ]
    rows.append(["**all**", "", "", f"**{ratio(own, 'seconds'):,.0f}**", "", "", ""])
    return table(["segment", "ours, s", "FFT, s", "ratio", "yaws", "differ", "FFT, MB"], rows)


def bound(own: list[Figures]) -> list[str]:
    """How far from what no search can do without."""
    poses, edge, spent = (sum(one[name] for one in own) for name in ("poses", "boundary", "seconds"))
    return [
        f"Of {poses:,} poses {edge:,} lie on the boundary, one in {poses / edge:.0f}. The search takes",
        f"{1e9 * spent / poses:.0f} ns a pose, or {1e6 * spent / edge:.1f} µs for each pose on the boundary,",
        "on two threads.",
    ]


def fine_section(figures: Figures) -> list[str]:
    """Beside finer voxels, steps and yaws."""
    rows = [
        [
            name,
            f"{one['usual']['seconds']:.2f}",
            f"{one['fine']['seconds']:.2f}",
            f"{one['fine']['seconds'] / one['usual']['seconds']:.1f}",
            f"{one['usual']['peak_mb']:.0f}",
            f"{one['fine']['peak_mb']:.0f}",
            f"{one['fine']['poses']:,}",
        ]
        for name, one in segments(figures["fine"]).items()
    ]
    header = ["segment", "10 mm, 2°: s", "5 mm, 1°: s", "ratio", "10 mm, 2°: MB", "5 mm, 1°: MB", "poses at 5 mm, 1°"]
    told = "16 times the poses and 8 times the voxels; the search without sight, volumes made beforehand."
    return ["## 5 mm and 1°", told, "", *table(header, rows)]


def frames_section(figures: Figures) -> list[str]:
    """What single frames cost."""
    own = figures["frames"]
    rows = [
        ["voxels at 10 mm, closed mesh", f"{own['closed']:.2f}"],
        ["voxels at 10 mm, the same without five faces: the rule that survives holes", f"{own['torn']:.2f}"],
        ["kept form of the frame, read", f"{own['cached']:.2f}"],
    ]
    return ["## One frame", f"A mesh of {own['faces']:,} faces, one core.", "", *table(["what", "ms"], rows)]


def chain_section(figures: Figures) -> list[str]:
    """The chain on generated groups."""
    rows = figures["chain"]["rows"]
    told = "Nine generated segments; `benchmarks/chain.py` tells what they are like, and what the columns mean."
    return ["## The chain", told, "", *table(list(rows[0]), [list(row.values()) for row in rows])]


def start_section(figures: Figures) -> list[str]:
    """Starting up."""
    own = figures["start"]
    rows = [
        ["`mhvedit --help`, fastest; median", f"{own['help']:.2f}; {own['help_median']:.2f}"],
        ["`mhvedit demo`, all kernels compiled on the way", f"{own['demo_first']:.1f}"],
        ["`mhvedit demo` again, into another folder", f"{own['demo_again']:.1f}"],
    ]
    return ["## Starting", *table(["what", "s"], rows)]


def measured_when(figures: Figures) -> list[str]:
    """On what machine each part was measured, when, and how fast it was then."""
    by_machine: dict[tuple[str, str], list[str]] = {}
    for part, own in figures.items():
        told = f"{part} ({own['speed']:.2f} s)" if "speed" in own else part
        by_machine.setdefault((own["machine"], own["measured"]), []).append(told)
    rows = [f"- {day}, {name}: {', '.join(parts)}" for (name, day), parts in by_machine.items()]
    return rows


SECTIONS: dict[str, Callable[[Figures], list[str]]] = {
    "solve": solve_section,
    "edits": edit_section,
    "search": search_section,
    "fine": fine_section,
    "growth": growth_section,
    "frames": frames_section,
    "chain": chain_section,
    "start": start_section,
}
