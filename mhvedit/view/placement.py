"""The placement map: from above, where B can stand beside A, and what rejects the rest."""

from collections.abc import Mapping
from dataclasses import dataclass
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator

from mhvedit.geometry.arrays import ByteArray, FloatArray, IntArray
from mhvedit.geometry.planar import rotation, wrap_angle
from mhvedit.search.groups import SolutionGroup
from mhvedit.search.poses import PoseGrid
from mhvedit.search.solve import ACCEPTED, OUTSIDE, ReasonMap
from mhvedit.view.plan import (
    PlanFrame,
    around,
    cells_of,
    draw_facing,
    draw_name,
    draw_outlines,
    draw_person,
    draw_scale,
    plan_outlines,
)
from mhvedit.view.style import (
    GRID,
    INK,
    MUTED,
    PAPER,
    SMALL,
    SUBJECTS,
    TEXT,
    dress,
    new_figure,
    reason_colours,
    rgb,
    shorter,
    solution_colour,
    solution_ramp,
)
from mhvedit.volumes.history import MotionHistoryVolume

NEAREST_VIEW = 0.8  # m, half the side of the smallest map
ARROW_BINS = 30  # arrows of facing along a map's side
FACING_BINS = 24  # directions of facing that are told apart
DIAL_BINS = 36
SHORTEST_ARROW = 0.42  # m
EMPTY = "no pose fits"


@dataclass(frozen=True, slots=True, eq=False)
class MapSummary:
    """A reason map seen from above: some kB instead of some 30 MB."""

    grid: PoseGrid
    fits: IntArray  # (X, Y) how many yaws are accepted
    furthest: ByteArray  # (X, Y) index into reasons: the last constraint that the best yaw failed
    reasons: tuple[str, ...]
    counts: Mapping[str, int]  # reason -> poses, all yaws


@dataclass(frozen=True, slots=True, eq=False)
class ShownBodies:
    """The two bodies to draw in a plan view, each in its canonical frame, in one frame of the segment."""

    a: MotionHistoryVolume
    b: MotionHistoryVolume
    frame: int


def summarise(found: ReasonMap) -> MapSummary:
    """Reduce a reason map to what is drawn of it (0.2 s for 401 x 401 x 180 poses)."""
    rejected = found.reason.max(-1)
    fits = np.empty(rejected.shape, np.int64)
    for i, row in enumerate(found.reason):
        fits[i] = np.count_nonzero(row == ACCEPTED, axis=-1)
    return MapSummary(found.grid, fits, rejected, found.reasons, found.counts())


def placement_map(
    found: ReasonMap | MapSummary,
    group: SolutionGroup,
    chosen: int | None,
    *,
    facing_a: float,
    facing_b: float,
    names: tuple[str, str],
    bodies: ShownBodies | None = None,
) -> Figure:
    """Where B can stand beside A, from above, with A facing up the page.

    Left: for each place how many of B's yaws fit, and where none does, the last constraint that stood in the way of the
    best yaw. Middle: which way B faces in the solutions. Right: all facings on a dial, and the legend with counts.

    Args:
        found: what the search said, or its summary.
        group: the solutions.
        chosen: row of the chosen one, or None.
        facing_a: rad in A's canonical frame.
        facing_b: rad in B's.
        names: of A and B.
        bodies: to draw instead of glyphs.
    """
    seen = found if isinstance(found, MapSummary) else summarise(found)
    frame = PlanFrame(seen.grid.root_a, facing_a)
    figure = new_figure(14.0, 6.4)
    best = figure.add_axes((0.062, 0.115, 0.3625, 0.793))
    ways = figure.add_axes((0.437, 0.115, 0.3625, 0.793))
    dial = figure.add_axes((0.846, 0.62, 0.112, 0.245), projection="polar")
    assert isinstance(dial, PolarAxes)
    middle, half = map_extent(seen, frame)
    draw_reasons(best, seen, frame)
    _draw_ways(ways, seen.grid, group, frame, facing_b, half)
    for axes in (best, ways):
        _draw_people(axes, seen.grid, group, chosen, frame, facing_b, names, bodies, max(SHORTEST_ARROW, 0.17 * half))
        set_extent(axes, middle, half)
    dress(best, title=f"Where {shorter(names[1], 16)} can stand", x=across(names[0]), y=ahead(names[0]))
    dress(ways, title=f"… and which way {shorter(names[1], 16)} faces there", x=across(names[0]))
    ways.tick_params(labelleft=False)
    draw_dial(dial, group, chosen, turn=frame.turn + facing_b, name=names[1])
    _draw_legend(figure, seen)
    return figure


def draw_reasons(axes: Axes, seen: MapSummary, frame: PlanFrame, *, colours: ByteArray | None = None) -> None:
    """The map itself: solutions dark, rejected places in the light colour of what rejected them.

    Args:
        axes: of the page.
        seen: the map.
        frame: of the page.
        colours: (X, Y, 3) of the places, instead of `map_colours`.
    """
    edge = (seen.grid.offsets[0] - seen.grid.step / 2, seen.grid.offsets[-1] + seen.grid.step / 2)
    picture = map_colours(seen) if colours is None else colours
    axes.imshow(
        picture.transpose(1, 0, 2), extent=(*edge, *edge), origin="lower", interpolation="nearest",
        interpolation_stage="rgba", transform=frame.of_roots() + axes.transData, zorder=1,
    )  # fmt: skip


def map_colours(seen: MapSummary) -> ByteArray:
    """(X, Y, 3) the colour of each place of B's root."""
    table = np.array([rgb(colour) for colour in reason_colours(seen.reasons)])
    picture = table[seen.furthest]
    fitting = seen.fits > 0
    most = max(1, int(seen.fits.max()))
    picture[fitting] = solution_ramp(np.sqrt(seen.fits[fitting] / most))[:, :3]
    return np.asarray(np.rint(255 * picture), np.uint8)


def draw_dial(axes: PolarAxes, group: SolutionGroup, chosen: int | None, *, turn: float, name: str) -> None:
    """How many solutions for each facing of B; up is A's facing."""
    facing = np.asarray(group.poses[:, 2] + turn)
    numbers, edges = np.histogram(wrap_angle(facing), DIAL_BINS, (-np.pi, np.pi))
    tallest = max(1, int(numbers.max()))
    heights = np.where(numbers > 0, 0.35 + 0.65 * np.sqrt(numbers / tallest), 0.0)
    axes.bar(
        edges[:-1], heights - 0.3 * (heights > 0), np.diff(edges), bottom=0.3, align="edge", color=solution_colour(0.6)
    )
    axes.set_ylim(0, 1.05)
    axes.set_yticks([])
    axes.set_xticks(np.radians([0, 90, 180, 270]), ["−90°", "0°", "90°", "180°"])
    axes.tick_params(labelsize=SMALL, colors=MUTED, pad=4)
    axes.spines["polar"].set_color(GRID)
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_title(f"{shorter(name, 14)}’s facing", fontsize=TEXT, color=INK, pad=9)
    if chosen is not None:
        axes.annotate(
            "", (float(facing[chosen]), 1.0), (0.0, 0.0),
            arrowprops={"arrowstyle": "-|>", "color": SUBJECTS[1], "linewidth": 2.6, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip


def map_extent(seen: MapSummary, frame: PlanFrame) -> tuple[FloatArray, float]:
    """What of the window is worth showing: A, the solutions and all that a later constraint than the first rejected.

    Args:
        seen: the map.
        frame: of the page.

    Returns:
        (2,) m the middle on the page, and half the side of the square, m.
    """
    first = OUTSIDE + 2 if len(seen.reasons) > OUTSIDE + 2 else OUTSIDE + 1
    telling = (seen.furthest >= first) | (seen.fits > 0)
    places = cells_of(telling, seen.grid.offsets) @ rotation(frame.turn).T
    middle, half = around(np.concatenate([places, np.zeros((1, 2))]), least=NEAREST_VIEW)
    return middle, half + 0.12


def set_extent(axes: Axes, middle: FloatArray, half: float) -> None:
    """Show a square of the page, m."""
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
    axes.set_facecolor(PAPER)
    axes.xaxis.set_major_locator(MaxNLocator(7, prune="both"))
    draw_scale(axes)


def across(name: str) -> str:
    """The label of the page's horizontal axis."""
    return f"left ← across {shorter(name, 16)}, m → right"


def ahead(name: str) -> str:
    """The label of the page's vertical axis."""
    return f"behind ← along {shorter(name, 16)}’s facing, m → ahead"


def _draw_ways(
    axes: Axes, grid: PoseGrid, group: SolutionGroup, frame: PlanFrame, facing_b: float, half: float
) -> None:
    """A fan of strokes wherever there are solutions, one for each facing that fits."""
    if not len(group):
        axes.text(0.5, 0.9, EMPTY, transform=axes.transAxes, ha="center", fontsize=TEXT, color=MUTED, zorder=9)
        return
    cell = 2 * half / ARROW_BINS
    roots = frame.points(rotation(group.poses[:, 2]) @ grid.root_b + group.poses[:, :2])
    facing = wrap_angle(group.poses[:, 2] + frame.turn + facing_b)
    low = roots.min(0)
    across = np.floor((roots - low) / cell).astype(np.int64)
    way = np.floor((facing + np.pi) / (2 * np.pi) * FACING_BINS).astype(np.int64) % FACING_BINS
    fan = np.zeros((*(across.max(0) + 1), FACING_BINS), bool)
    fan[across[:, 0], across[:, 1], way] = True
    fans = np.argwhere(fan)
    centre = low + (fans[:, :2] + 0.5) * cell
    angle = (fans[:, 2] + 0.5) * (2 * np.pi / FACING_BINS) - np.pi
    tips = centre + 0.85 * cell * np.stack([np.cos(angle), np.sin(angle)], 1)
    axes.add_collection(
        LineCollection(list(np.stack([centre, tips], 1)), colors=solution_colour(0.6), linewidths=1.3, zorder=2)
    )
    dots = low + (np.argwhere(fan.any(2)) + 0.5) * cell
    axes.scatter(dots[:, 0], dots[:, 1], s=5, color=solution_colour(1.0), zorder=2.1)


def _draw_people(
    axes: Axes,
    grid: PoseGrid,
    group: SolutionGroup,
    chosen: int | None,
    frame: PlanFrame,
    facing_b: float,
    names: tuple[str, str],
    bodies: ShownBodies | None,
    length: float,
) -> None:
    """A, and B in the chosen pose."""
    _draw_one(axes, np.zeros(2), np.pi / 2, names[0], SUBJECTS[0], length)
    if bodies is not None:
        outlines = plan_outlines(bodies.a, bodies.frame, np.zeros(3))
        draw_outlines(axes, [frame.points(outline) for outline in outlines], SUBJECTS[0])
    if chosen is None:
        if bodies is None:
            draw_person(axes, np.zeros(2), np.pi / 2, SUBJECTS[0])
        return
    pose = group.poses[chosen]
    at = frame.points(rotation(pose[2]) @ grid.root_b + pose[:2])
    facing = float(pose[2] + frame.turn + facing_b)
    _draw_one(axes, at, facing, names[1], SUBJECTS[1], length)
    if bodies is not None:
        outlines = plan_outlines(bodies.b, bodies.frame, pose)
        draw_outlines(axes, [frame.points(outline) for outline in outlines], SUBJECTS[1])
    else:
        draw_person(axes, np.zeros(2), np.pi / 2, SUBJECTS[0])
        draw_person(axes, at, facing, SUBJECTS[1])
    axes.plot([0, at[0]], [0, at[1]], color=INK, linewidth=1.2, linestyle=(0, (4, 3)), zorder=5.5)


def _draw_one(axes: Axes, at: FloatArray, facing: float, name: str, colour: str, length: float) -> None:
    draw_facing(axes, at, facing, colour, length=length)
    draw_name(axes, at - 0.64 * length * np.array([np.cos(facing), np.sin(facing)]), shorter(name, 12), colour)


def _draw_legend(figure: Figure, seen: MapSummary) -> None:
    """What the colours mean and how many poses each reason took, all yaws."""
    total = sum(seen.counts.values()) - seen.counts.get(seen.reasons[OUTSIDE], 0)
    entries = legend_entries(seen)
    figure.legend(
        [patch for patch, _ in entries], [text for _, text in entries], loc="upper left", bbox_to_anchor=(0.808, 0.545),
        fontsize=SMALL, frameon=False, labelcolor=INK, handlelength=1.2, handleheight=1.2, labelspacing=0.45,
        title=f"{short_count(total)} poses tried", title_fontsize=SMALL, alignment="left",
    )  # fmt: skip


def legend_entries(seen: MapSummary, *, width: int = 26) -> list[tuple[Patch, str]]:
    """A patch and words for each colour of a map, with how many poses it took, all yaws.

    Args:
        seen: the map.
        width: characters of a line.
    """
    colours = dict(zip(seen.reasons, reason_colours(seen.reasons), strict=True))
    entries = [
        (Patch(facecolor=solution_colour(0.5)), f"solutions: {short_count(seen.counts[seen.reasons[ACCEPTED]])}")
    ]
    for reason in reversed(seen.reasons[OUTSIDE + 1 :]):
        patch = Patch(facecolor=colours[reason], edgecolor=MUTED, linewidth=0.5)
        if seen.counts[reason]:
            entries.append((patch, fill(f"{reason}: {short_count(seen.counts[reason])}", width)))
    return entries


def short_count(number: int) -> str:
    """A count that can be read at a glance.

    >>> short_count(46730), short_count(812), short_count(28_523_533)
    ('46,730', '812', '28.5 million')
    """
    return f"{number / 1e6:.1f} million" if number >= 1_000_000 else f"{number:,}"
