"""Plan views: everything seen from above, turned so that A looks up the page."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Ellipse, FancyArrowPatch, PathPatch
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Affine2D
from skimage.measure import find_contours

from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.planar import apply_pose, rotation
from mhvedit.view.style import INK, PAPER, SMALL
from mhvedit.volumes.history import MotionHistoryVolume

SHOULDERS, CHEST, HEAD = 0.44, 0.22, 0.095  # m, of the glyph of a person
SCALE_BARS = (0.1, 0.2, 0.5, 1.0, 2.0)  # m


@dataclass(frozen=True, slots=True, eq=False)
class PlanFrame:
    """Page coordinates (m): A's root is the origin, A's facing points up."""

    root_a: FloatArray  # (2,) m, in A's canonical frame
    facing_a: float  # rad, in A's canonical frame

    @property
    def turn(self) -> float:
        """From A's canonical frame to the page, rad."""
        return float(np.pi / 2 - self.facing_a)

    def points(self, points: FloatArray) -> FloatArray:
        """(..., 2) on the page, of points in A's canonical frame."""
        return np.asarray((points - self.root_a) @ rotation(self.turn).T)

    def back(self, points: FloatArray) -> FloatArray:
        """(..., 2) in A's canonical frame, of points on the page: where somebody clicked."""
        return np.asarray(points @ rotation(self.turn) + self.root_a)

    def of_roots(self) -> Affine2D:
        """From places of B's root relative to A's, in A's canonical frame, to the page."""
        return Affine2D().rotate(self.turn)


def plan_outlines(volume: MotionHistoryVolume, frame: int, pose: FloatArray) -> list[FloatArray]:
    """What of a volume is seen from above in one frame.

    Args:
        volume: in its canonical frame.
        frame: of the segment, from 0.
        pose: (3,) where it is put, x, y m and yaw rad.

    Returns:
        Closed outlines, (N, 2) m each.
    """
    seen = np.pad(volume.at(frame).any(2), 1)
    return [apply_pose(pose, _lattice(outline, volume)) for outline in find_contours(seen.astype(float), 0.5)]


def _lattice(outline: FloatArray, volume: MotionHistoryVolume) -> FloatArray:
    return np.asarray((outline - 1 + np.array(volume.grid.start[:2])) * volume.grid.pitch)


def draw_outlines(axes: Axes, outlines: list[FloatArray], colour: str) -> None:
    """Fill outlines (page coordinates); what is cut out stays empty."""
    if not outlines:
        return
    path = Path.make_compound_path(*[Path(outline, closed=True) for outline in outlines])
    axes.add_patch(PathPatch(path, facecolor=colour, edgecolor="none", alpha=0.55, zorder=5))
    axes.add_patch(PathPatch(path, facecolor="none", edgecolor=PAPER, linewidth=3.6, zorder=5.1))
    axes.add_patch(PathPatch(path, facecolor="none", edgecolor=colour, linewidth=2.0, zorder=5.2))


def draw_person(axes: Axes, at: FloatArray, facing: float, colour: str) -> None:
    """A person from above in life size: shoulders and head.

    Args:
        axes: in metres.
        at: (2,) m.
        facing: rad, 0 along the page's x.
        colour: of the subject.
    """
    degrees = float(np.degrees(facing))
    centre = (float(at[0]), float(at[1]))
    shoulders = Ellipse(
        centre, CHEST, SHOULDERS, angle=degrees, facecolor=colour, edgecolor=PAPER, linewidth=2, alpha=0.9
    )
    shoulders.set_zorder(5)
    axes.add_patch(shoulders)
    axes.add_patch(Circle(centre, HEAD, facecolor=colour, edgecolor=PAPER, linewidth=1.6, zorder=5.2))


def draw_facing(axes: Axes, at: FloatArray, facing: float, colour: str, *, length: float) -> None:
    """An arrow from where somebody stands towards where they face; `gid` tells tests and viewers what it is."""
    tip = at + length * np.array([np.cos(facing), np.sin(facing)])
    arrow = FancyArrowPatch(
        (at[0], at[1]), (tip[0], tip[1]), arrowstyle="-|>", mutation_scale=18, linewidth=3, color=colour, shrinkA=0,
        shrinkB=0, zorder=6, path_effects=[withStroke(linewidth=6, foreground=PAPER)],
    )  # fmt: skip
    arrow.set_gid("facing")
    axes.add_patch(arrow)
    axes.add_patch(Circle((at[0], at[1]), length / 14, facecolor=PAPER, edgecolor=colour, linewidth=2, zorder=6.1))


def draw_name(axes: Axes, at: FloatArray, name: str, colour: str) -> None:
    """A subject's name on a light plate, centred."""
    axes.text(
        at[0], at[1], name, fontsize=SMALL, color=colour, fontweight="bold", ha="center", va="center", zorder=7,
        bbox={"facecolor": PAPER, "edgecolor": "none", "alpha": 0.85, "boxstyle": "round,pad=0.2"},
    )  # fmt: skip


def draw_scale(axes: Axes) -> None:
    """A scale bar in the lower left corner; the axes are square, in metres, with their limits set."""
    low, high = axes.get_xlim()
    span = high - low
    length = max((bar for bar in SCALE_BARS if bar < span / 3), default=SCALE_BARS[0])
    x, y = low + 0.05 * span, axes.get_ylim()[0] + 0.05 * span
    axes.plot([x, x + length], [y, y], color=INK, linewidth=4, solid_capstyle="butt", zorder=8)
    text = f"{length:g} m"
    axes.text(x + length / 2, y + 0.012 * span, text, fontsize=SMALL, color=INK, ha="center", va="bottom", zorder=8)


def around(points: FloatArray, *, least: float) -> tuple[FloatArray, float]:
    """The middle and the half side of a square around points, with a margin.

    Args:
        points: (N, 2) m, at least one.
        least: smallest half side, m.
    """
    low, high = points.min(0), points.max(0)
    return (low + high) / 2, max(least, float((high - low).max()) / 2 * 1.08 + 0.05)


def cells_of(mask: BoolArray, offsets: FloatArray) -> FloatArray:
    """(N, 2) m places of the cells of a map that are marked."""
    where = np.argwhere(mask)
    return np.stack([offsets[where[:, 0]], offsets[where[:, 1]]], 1) if len(where) else np.empty((0, 2))
