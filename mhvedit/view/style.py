"""How all pictures look: colours that colour-blind people can tell apart, sizes that stay legible at half size."""

from collections.abc import Sequence
from typing import Final

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mhvedit.geometry.arrays import ByteArray, FloatArray
from mhvedit.volumes.surface import SurfaceLabel

INK: Final = "#1f2933"
MUTED: Final = "#5f6b76"
GRID: Final = "#d9dee3"
PAPER: Final = "#ffffff"
FLOOR: Final = "#f3f4f6"
PROPS: Final = "#b3aa9c"

# Okabe and Ito's palette, strongest contrasts first
SUBJECTS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
SEGMENT_BANDS: Final = ("#dbe7f3", "#e9eff5")
OK: Final = "#009E73"
WARNING: Final = "#D55E00"

# Rejection reasons are light, solutions are dark: told apart by lightness alone where hue fails
REASONS: Final = {
    "outside the window": "#ffffff",
    "no contact": "#eceef0",
    "no contact at the right moment": "#f7e9a0",
    "contact at a wrong moment": "#f2bd63",
    "contact is lost in some frame": "#f2bd63",
    "never in contact at the same moment": "#f2bd63",
    "neither passes strictly after the other": "#f2bd63",
    "contact sinks in too deep": "#e8b5cf",
    "bodies meet": "#b4bac2",
    "B is out of A's sight": "#a9d6f2",
    "A is out of B's sight": "#a5dccb",
}
OTHER_REASONS: Final = ("#f7c9a9", "#d3cbe8", "#cfe3b8", "#e5d5bd")
TIME_MAP: Final = "viridis"
LABELS: Final = {
    SurfaceLabel.START.value: "#CC79A7",
    SurfaceLabel.END.value: "#009E73",
    SurfaceLabel.LATERAL.value: "#c9ccd1",
    SurfaceLabel.START.value | SurfaceLabel.END.value: "#F0E442",
}
LABEL_NAMES: Final = {
    SurfaceLabel.START.value: "start (−)",
    SurfaceLabel.END.value: "end (+)",
    SurfaceLabel.LATERAL.value: "lateral (0)",
    SurfaceLabel.START.value | SurfaceLabel.END.value: "does not move (− and +)",
}

TITLE, TEXT, SMALL = 14.0, 12.0, 10.5  # pt
DPI: Final = 120


def subject_colours(names: Sequence[str]) -> dict[str, str]:
    """A colour for each subject, by order.

    >>> subject_colours(["anna", "ben"])
    {'anna': '#0072B2', 'ben': '#D55E00'}
    """
    return {name: SUBJECTS[i % len(SUBJECTS)] for i, name in enumerate(names)}


def reason_colours(reasons: Sequence[str]) -> list[str]:
    """A light colour for each reason of a reason map, by name; names that are new get one of their own."""
    unknown = [reason for reason in reasons if reason not in REASONS and reason != "accepted"]
    spare = {reason: OTHER_REASONS[i % len(OTHER_REASONS)] for i, reason in enumerate(unknown)}
    return [
        solution_colour(0.5) if reason == "accepted" else REASONS.get(reason, spare.get(reason, ""))
        for reason in reasons
    ]


def solution_ramp(shares: FloatArray) -> FloatArray:
    """Colours of solutions: the dark part of viridis.

    Args:
        shares: (...) 0 for few yaws that fit, 1 for many.

    Returns:
        (..., 4) RGBA, darker for more.
    """
    return np.asarray(matplotlib.colormaps[TIME_MAP](0.55 * (1.0 - np.clip(shares, 0.0, 1.0))), np.float64)


def solution_colour(share: float) -> str:
    """One colour of the ramp of solutions, as hex."""
    red, green, blue = (round(255 * float(channel)) for channel in solution_ramp(np.array(share))[:3])
    return f"#{red:02x}{green:02x}{blue:02x}"


def lighter(colour: str, share: float) -> str:
    """A colour mixed with white.

    >>> lighter("#000000", 0.2)
    '#333333'
    """
    mixed = np.rint(255 * (rgb(colour) * (1 - share) + share)).astype(int)
    return "#" + "".join(f"{channel:02x}" for channel in mixed)


def rgb(colour: str) -> FloatArray:
    """(3,) 0 .. 1 of a hex colour.

    >>> rgb("#ff0000").tolist()
    [1.0, 0.0, 0.0]
    """
    return np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])


def time_colours(shares: FloatArray) -> ByteArray:
    """(..., 3) colours of moments; 0 is the first frame, 1 the last."""
    return np.asarray(255 * matplotlib.colormaps[TIME_MAP](np.clip(shares, 0.0, 1.0))[..., :3], np.uint8)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure that no global state knows of; it needs no closing.

    Args:
        width: inches, at `DPI` pixels each.
        height: inches.
    """
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor=PAPER)
    FigureCanvasAgg(figure)
    return figure


def figure_picture(figure: Figure) -> ByteArray:
    """(H, W, 3) the figure as it would be printed."""
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def dress(axes: Axes, *, title: str = "", x: str = "", y: str = "") -> None:
    """Titles, labels and lines of one house style."""
    axes.set_title(title, fontsize=TITLE, color=INK, loc="left", pad=8)
    axes.set_xlabel(x, fontsize=TEXT, color=INK)
    axes.set_ylabel(y, fontsize=TEXT, color=INK)
    axes.tick_params(labelsize=SMALL, colors=MUTED, length=3)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom", "polar"))
        spine.set_color(GRID)


def shorter(text: str, limit: int) -> str:
    """The text, cut in the middle where it is too long.

    >>> shorter("contact", 10), shorter("10-shoulder-bump", 9)
    ('contact', '10-s…bump')
    """
    if len(text) <= limit:
        return text
    half = (limit - 1) // 2
    return f"{text[: limit - 1 - half]}…{text[-half:]}"
