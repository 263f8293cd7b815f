"""A fitted skeleton drawn over the capture that it was fitted to: what to look at before an edit is trusted."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from mhvedit.files import replacing
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.view.captions import webp_bytes
from mhvedit.view.style import GRID, INK, SMALL, WARNING, figure_picture, new_figure

MOST_POINTS = 2500  # of a surface that are drawn


@dataclass(frozen=True, slots=True, eq=False)
class FittedStory:
    """Some frames of a capture with the joints that were fitted to them."""

    numbers: Sequence[int]  # F frame numbers
    points: Sequence[FloatArray]  # F of (V, 3) m, the captured surface
    joints: FloatArray  # (F, J, 3) m
    parents: IntArray  # (J,) -1 for the root
    marked: Sequence[bool]  # F, frames to be drawn in the colour of warnings


def fitted_strip(story: FittedStory) -> Figure:
    """Each frame seen from the side from which the skeleton looks widest."""
    figure = new_figure(2.0 * len(story.numbers), 3.2)
    for place, (number, points, joints) in enumerate(zip(story.numbers, story.points, story.joints, strict=True), 1):
        axes = figure.add_subplot(1, len(story.numbers), place)
        across = _widest(joints)
        shown = points[:: max(1, len(points) // MOST_POINTS)]
        axes.scatter(shown[:, :2] @ across, shown[:, 2], s=1.0, color=GRID, linewidths=0.0)
        for joint, parent in enumerate(story.parents):
            if parent >= 0:
                bone = joints[[parent, joint]]
                axes.plot(bone[:, :2] @ across, bone[:, 2], color=INK, linewidth=1.5, marker="o", markersize=2.5)
        colour = WARNING if story.marked[place - 1] else INK
        axes.set_title(f"frame {number}", fontsize=SMALL, color=colour)
        axes.set_aspect("equal")
        axes.set_axis_off()
    return figure


def write_fitted_strip(path: Path, story: FittedStory) -> None:
    """Write the picture as .webp, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as beside:
        beside.write_bytes(webp_bytes(figure_picture(fitted_strip(story)), quality=None))


def _widest(joints: FloatArray) -> FloatArray:
    """(2,) unit, the horizontal direction along which joints are spread most."""
    flat = joints[:, :2] - joints[:, :2].mean(0)
    return np.asarray(np.linalg.eigh(flat.T @ flat)[1][:, 1])
