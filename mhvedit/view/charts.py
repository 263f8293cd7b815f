"""Charts: where people went, and how the scene holds together over time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.planar import apply_pose
from mhvedit.scene.edit import EditedScene, SegmentEdit
from mhvedit.view.style import (
    GRID,
    INK,
    MUTED,
    OK,
    PAPER,
    SEGMENT_BANDS,
    SMALL,
    SUBJECTS,
    TEXT,
    WARNING,
    dress,
    new_figure,
    shorter,
    subject_colours,
)

LABEL_GAP = 0.05  # of a chart's extent, between numbers of segments
MANY_SEGMENTS = 12
HEADROOM = 0.16  # of a chart over time, for its legend


@dataclass(frozen=True, slots=True, eq=False)
class SceneCheck:
    """What was measured on the meshes in every frame of the scene; NaN where it was not."""

    penetration_mm: FloatArray  # (N,) deepest, mm
    gap_mm: FloatArray  # (N,) smallest distance between the subjects, mm
    contact: BoolArray  # (N,) whether they touch
    added_skate: Mapping[
        str, FloatArray
    ]  # by subject, (N,) m/s that the edit adds to the speed of feet on the floor; may be empty

    def __post_init__(self) -> None:
        expected = self.penetration_mm.shape
        named = {"gap_mm": self.gap_mm, "contact": self.contact, **self.added_skate}
        for name, values in named.items():
            if values.shape != expected:
                raise ShapeError(name, values.shape, expected)


def trajectories(scene: EditedScene, centres: Mapping[str, FloatArray]) -> Figure:
    """Top view of where everybody goes: as captured, each in a world of its own, and as edited, in one.

    Args:
        scene: the edit.
        centres: by subject, (N, 2) m: its centre in each frame of the scene, in its capture's frame.
    """
    names = list(scene.subjects)
    words = fill(" · ".join(f"{i + 1}\u00a0{s.name}" for i, s in enumerate(scene.segments)), 145)
    figure = new_figure(13.0, 7.2)
    figure.text(0.085, 0.02, words, fontsize=SMALL, color=MUTED, va="bottom")
    after = figure.add_axes((0.5, 0.175, 0.48, 0.765))
    for row, name in enumerate(names):
        high = (0.765 - 0.115 * (len(names) - 1)) / len(names)
        before = figure.add_axes((0.085, 0.175 + (high + 0.115) * (len(names) - 1 - row), 0.335, high))
        _draw_paths(before, scene, {name: centres[name]}, names, LABEL_GAP / high)
        dress(before, title=f"Before: {shorter(name, 16)} as captured", x="x, m", y="y, m")
        if row < len(names) - 1:
            before.set_xlabel("")
    _draw_paths(after, scene, {name: placed_centres(scene, name, centres[name]) for name in names}, names, LABEL_GAP)
    dress(after, title="After: one scene", x="x, m", y="y, m")
    after.legend(fontsize=TEXT, frameon=False, labelcolor=INK, loc="best")
    return figure


def placed_centres(scene: EditedScene, name: str, centres: FloatArray) -> FloatArray:
    """(N, 2) m in the world, of centres in a subject's capture frame."""
    placements = scene.subjects[name].placements
    return np.array([apply_pose(pose, centre) for pose, centre in zip(placements, centres[:, :2], strict=True)])


def over_time(scene: EditedScene, check: SceneCheck, *, limit_mm: float | None = None) -> Figure:
    """Penetration, gap, contact and added skate in every frame, with the key segments shaded and named.

    Args:
        scene: the edit.
        check: what was measured.
        limit_mm: how deep bodies may sink into each other, drawn as a line.
    """
    rows = 3 if check.added_skate else 2
    figure = new_figure(13.0, 2.0 + 1.75 * rows)
    charts = figure.subplots(rows, 1, sharex=True)
    figure.subplots_adjust(
        left=0.09, right=0.92, bottom=0.75 / (2.0 + 1.75 * rows), top=1 - 1.15 / (2.0 + 1.75 * rows), hspace=0.18
    )
    frames = np.arange(scene.n_frames)
    _fill(charts[0], frames, check.penetration_mm, WARNING)
    _fill(charts[1], frames, check.gap_mm, SUBJECTS[0])
    if limit_mm is not None:
        charts[0].axhline(limit_mm, color=INK, linewidth=1.2, linestyle=(0, (5, 3)))
        charts[0].text(0, limit_mm, " limit", fontsize=SMALL, color=INK, va="bottom")
    dress(charts[0], y="deepest\npenetration, mm")
    dress(charts[1], y="smallest\ngap, mm")
    _draw_contact(charts[1], frames, check.contact)
    for name, colour in subject_colours(list(check.added_skate)).items():
        charts[-1].plot(frames, check.added_skate[name], color=colour, linewidth=2, label=shorter(name, 16))
    if check.added_skate:
        dress(charts[-1], y="added foot\nskate, m/s")
        charts[-1].legend(
            fontsize=SMALL,
            frameon=False,
            labelcolor=INK,
            loc="upper right",
            borderaxespad=0.1,
            ncols=len(check.added_skate),
        )
    charts[-1].set_xlabel("frame of the scene", fontsize=TEXT, color=INK)
    for axes in charts:
        shade_segments(axes, scene.segments)
        axes.set_xlim(-0.5, scene.n_frames - 0.5)
        low, high = axes.get_ylim()
        axes.set_ylim(min(0.0, low), high + HEADROOM * (high - min(0.0, low)))
    _name_segments(charts[0], scene.segments)
    return figure


def shade_segments(axes: Axes, segments: Sequence[SegmentEdit]) -> None:
    """Light bands behind a chart over time, one for each key segment."""
    for i, segment in enumerate(segments):
        axes.axvspan(segment.start - 0.5, segment.stop - 0.5, color=SEGMENT_BANDS[i % 2], linewidth=0, zorder=0)


def _name_segments(axes: Axes, segments: Sequence[SegmentEdit]) -> None:
    """Names above a chart, slanted, since segments can be short."""
    limit = 22 if len(segments) <= MANY_SEGMENTS else 12
    for segment in segments:
        axes.annotate(
            shorter(segment.name, limit), ((segment.start + segment.stop - 1) / 2, 1.0), (0, 4),
            textcoords="offset points", xycoords=("data", "axes fraction"), rotation=32, rotation_mode="anchor",
            ha="left", va="bottom", fontsize=SMALL, color=INK,
        )  # fmt: skip


def _fill(axes: Axes, frames: IntArray, values: FloatArray, colour: str) -> None:
    axes.fill_between(frames, 0, np.nan_to_num(values), color=colour, alpha=0.25, linewidth=0, step="mid")
    axes.step(frames, values, color=colour, linewidth=1.8, where="mid")


def _draw_contact(axes: Axes, frames: IntArray, contact: BoolArray) -> None:
    """Ticks along the lower edge in the frames in which they touch."""
    if contact.any():
        at = frames[contact]
        across = axes.get_xaxis_transform()
        axes.plot(
            at, np.full(len(at), 0.05), "s", markersize=5, color=OK, transform=across, clip_on=False, label="in contact"
        )
        axes.legend(fontsize=SMALL, frameon=False, labelcolor=INK, loc="upper right", borderaxespad=0.1)


def _draw_paths(
    axes: Axes, scene: EditedScene, paths: Mapping[str, FloatArray], names: Sequence[str], gap: float
) -> None:
    """Thin where people only pass, thick in key segments; numbers tell which, a ring where each begins."""
    colours = subject_colours(names)
    for name, path in paths.items():
        colour = colours[name]
        axes.plot(path[:, 0], path[:, 1], color=colour, linewidth=1.4, alpha=0.75)
        axes.plot(path[:1, 0], path[:1, 1], "o", markersize=9, color=PAPER, markeredgecolor=colour, markeredgewidth=2)
        thick = [path[s.start : s.stop] for s in scene.segments if name in s.between]
        for i, piece in enumerate(thick):
            axes.plot(
                piece[:, 0], piece[:, 1], color=colour, linewidth=5, solid_capstyle="round", label="" if i else name
            )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.14)
    axes.grid(color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    _number_segments(axes, scene, paths, colours, gap)


def _number_segments(
    axes: Axes, scene: EditedScene, paths: Mapping[str, FloatArray], colours: Mapping[str, str], gap: float
) -> None:
    """Numbers of the key segments around each path, pushed apart, with a line to where they happen."""
    extent = np.ptp(np.concatenate(list(paths.values())), axis=0).max() + 1e-3
    for name in paths:
        numbers = [i for i, segment in enumerate(scene.segments) if name in segment.between]
        spots = np.array([paths[name][(scene.segments[i].start + scene.segments[i].stop - 1) // 2] for i in numbers])
        for i, spot, place in zip(numbers, spots, spread_labels(spots, gap=gap * extent), strict=True):
            axes.plot([spot[0], place[0]], [spot[1], place[1]], color=MUTED, linewidth=0.8)
            axes.text(
                place[0], place[1], str(i + 1), fontsize=SMALL, color=PAPER, ha="center", va="center", zorder=6,
                fontweight="bold", bbox={"boxstyle": "circle,pad=0.22", "facecolor": colours[name], "edgecolor": PAPER},
            )  # fmt: skip


def spread_labels(spots: FloatArray, *, gap: float) -> FloatArray:
    """Places for labels that are near their spots and apart from each other.

    Args:
        spots: (N, 2).
        gap: between labels, and from a label to its spot.

    Returns:
        (N, 2); the same for the same input.
    """
    if not len(spots):
        return np.empty((0, 2))
    turn = np.arange(len(spots)) * 2.4  # the golden angle: no two start out alike
    outwards = spots - spots.mean(0) + 0.3 * gap * np.stack([np.cos(turn), np.sin(turn)], 1)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    places = spots + 1.5 * gap * outwards
    for _ in range(200):
        apart = places[:, None] - places[None]
        far = np.linalg.norm(apart, axis=2) + np.eye(len(spots)) * 9 * gap
        push = (apart / far[..., None] * np.clip(gap - far, 0, None)[..., None]).sum(1)
        off = places - spots
        distance = np.linalg.norm(off, axis=1, keepdims=True)
        places = places + 0.4 * push + 0.1 * off / np.maximum(distance, 1e-9) * np.clip(gap - distance, 0, None)
    return np.asarray(places)
