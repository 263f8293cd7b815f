"""The placement map of a segment, from above: a picture that knows which pose each of its pixels means."""

from dataclasses import dataclass

import numpy as np
from matplotlib.patches import Patch
from PIL import Image, ImageDraw

from mhvedit.geometry.arrays import BoolArray, ByteArray, FloatArray
from mhvedit.geometry.planar import rotation
from mhvedit.search.solve import ACCEPTED
from mhvedit.view.captions import font_of
from mhvedit.view.placement import (
    across,
    ahead,
    draw_reasons,
    legend_entries,
    map_colours,
    map_extent,
    set_extent,
    summarise,
)
from mhvedit.view.plan import PlanFrame
from mhvedit.view.style import (
    DPI,
    INK,
    MUTED,
    OK,
    PAPER,
    SMALL,
    SUBJECTS,
    WARNING,
    dress,
    figure_picture,
    new_figure,
    rgb,
    shorter,
)
from mhvedit.viewer.deciding import left_rows, pinned_row
from mhvedit.viewer.material import SegmentView
from mhvedit.viewer.preview import Cell, best_cell, cell_of_row
from mhvedit.viewer.state import ViewerState, shown_row

EXCLUDED = "#8d939b"
LEGEND_LINE = 20  # pixels
MARGINS = (98, 12, 34, 56)  # pixels: left, right, top, bottom of the map itself
DIAL = (20, 30)  # pixels, inner and outer radius of the ring of yaws around a place
NARROWEST_SECTOR = 8.0  # degrees
ARROW = 44  # pixels
EMPTY_PAGE = "not solved yet"


@dataclass(frozen=True, slots=True, eq=False)
class MapPicture:
    """A drawn map without marks, and where it is on the picture."""

    picture: ByteArray  # (H, W, 3)
    view: SegmentView
    frame: PlanFrame
    left: BoolArray  # (S,) solutions that are not excluded
    corner: tuple[float, float]  # pixels, of the map's upper left corner
    side: float  # pixels, of the square map
    low: FloatArray  # (2,) m on the page, of its lower left corner
    span: float  # m on the page, of its side

    def pixels(self, points: FloatArray) -> FloatArray:
        """(..., 2) pixels from the upper left corner, of points in A's canonical frame."""
        across_up = (self.frame.points(points) - self.low) / self.span * self.side
        return np.stack([self.corner[0] + across_up[..., 0], self.corner[1] + self.side - across_up[..., 1]], -1)

    def place(self, x: float, y: float) -> tuple[int, int] | None:
        """The place on the map under a pixel; None beside it."""
        right, down = (x - self.corner[0]) / self.side, (y - self.corner[1]) / self.side
        if not (0 <= right <= 1 and 0 <= down <= 1):
            return None
        page = self.low + self.span * np.array([right, 1 - down])
        grid = self.view.grid
        i, j = np.rint((self.frame.back(page) - grid.root_a - grid.offsets[0]) / grid.step).astype(int)
        return (int(i), int(j)) if 0 <= i < grid.size and 0 <= j < grid.size else None

    def cell(self, x: float, y: float, *, yaw: int | None = None) -> Cell | None:
        """The pose that somebody means who clicks on a pixel; None beside the map.

        Args:
            x: pixels from the left.
            y: pixels from the top.
            yaw: index of the yaw to stay near to.
        """
        place = self.place(x, y)
        return None if place is None else best_cell(self.view, place, yaw=yaw, left=self.left)

    def words(self, x: float, y: float) -> str:
        """Why B can or cannot stand under a pixel."""
        place = self.place(x, y)
        return "" if place is None else words_at(self.view, place, self.left)


def draw_map(state: ViewerState, *, width: int, height: int) -> MapPicture | None:
    """Draw the map of the current segment; None where it was not searched.

    Args:
        state: to be shown.
        width: pixels.
        height: pixels.
    """
    view = state.view
    if view is None:
        return None
    seen = summarise(view.found)
    left = left_rows(state, view)
    frame = PlanFrame(view.grid.root_a, view.facing[0])
    entries = legend_entries(seen, width=200)
    foot = MARGINS[3] + LEGEND_LINE * (len(entries) + 1)
    side = min(width - MARGINS[0] - MARGINS[1], height - MARGINS[2] - foot)
    corner = (MARGINS[0] + (width - MARGINS[0] - MARGINS[1] - side) / 2, float(MARGINS[2]))
    figure = new_figure(width / DPI, height / DPI)
    axes = figure.add_axes((corner[0] / width, 1 - (corner[1] + side) / height, side / width, side / height))
    colours = map_colours(seen)
    gone = excluded_places(view, left)
    colours[gone] = np.rint(255 * rgb(EXCLUDED))
    draw_reasons(axes, seen, frame, colours=colours)
    middle, half = map_extent(seen, frame)
    set_extent(axes, middle, half)
    a, b = view.between
    dress(axes, x=across(a), y=ahead(a))
    axes.set_title(
        f"{shorter(view.name, 22)}: where {shorter(b, 12)} can stand", fontsize=SMALL + 1, color=INK, loc="left"
    )
    for label in (axes.xaxis.label, axes.yaxis.label):
        label.set_fontsize(SMALL - 1)
    if not left.all():
        entries.insert(1, (Patch(facecolor=EXCLUDED), f"excluded: {int((~left).sum()):,} solutions"))
    figure.legend(
        [patch for patch, _ in entries], [text for _, text in entries], loc="upper left",
        bbox_to_anchor=(corner[0] / width - 0.02, 1 - (corner[1] + side + MARGINS[3]) / height), borderaxespad=0.0,
        fontsize=SMALL - 1.5, frameon=False, labelcolor=INK, handlelength=1.2, handleheight=1.0, labelspacing=0.3,
    )  # fmt: skip
    return MapPicture(figure_picture(figure), view, frame, left, corner, float(side), middle - half, 2 * half)


def excluded_places(view: SegmentView, left: BoolArray) -> BoolArray:
    """(X, Y) places at which all solutions are excluded."""
    size = view.grid.size
    gone, stay = np.zeros((size, size), np.bool_), np.zeros((size, size), np.bool_)
    cells = view.group.keys[:, :2] - view.grid.base[view.group.keys[:, 2]]
    gone[tuple(cells[~left].T)] = True
    stay[tuple(cells[left].T)] = True
    return gone & ~stay


def words_at(view: SegmentView, place: tuple[int, int], left: BoolArray) -> str:
    """Why B can or cannot stand at a place.

    Args:
        view: of the segment.
        place: i, j on its map.
        left: (S,) solutions that are not excluded.
    """
    column = view.found.reason[place]
    n_yaw = len(column)
    fitting = int((column == ACCEPTED).sum())
    if not fitting:
        code = int(column.max())
        share = int((column == code).sum())
        return f"no solution: {view.found.reasons[code]} (at {share} of {n_yaw} facings, the nearest misses)"
    cells = view.group.keys[:, :2] - view.grid.base[view.group.keys[:, 2]]
    here = (cells == np.array(place)).all(1)
    room = float(view.group.clearance[here].max())
    gone = int((~left[here]).sum())
    more = f", {gone} of them excluded" if gone else ""
    return f"{fitting} of {n_yaw} facings fit{more}; most room {100 * room:.0f} cm"


def marked(map_: MapPicture, state: ViewerState) -> ByteArray:
    """(H, W, 3) the map with A, with B as chosen, pinned and looked at, and the yaws that fit at that place."""
    image = Image.fromarray(map_.picture)
    draw = ImageDraw.Draw(image, "RGBA")
    view = map_.view
    _arrow(draw, map_, np.zeros(3), view.facing[0], view.grid.root_a, SUBJECTS[0])
    pinned, row = pinned_row(state, view), shown_row(state)
    if view.chosen is not None and state.preview is not None:
        _arrow(draw, map_, view.group.poses[view.chosen], view.facing[1], view.grid.root_b, SUBJECTS[1], faint=True)
    pose, cell, colour = None, None, OK
    if state.preview is not None:
        pose, cell = np.array(state.preview.pose), state.preview.cell
        colour = WARNING if state.preview.row is None else OK
    elif row is not None:
        pose, cell = view.group.poses[row], cell_of_row(view, row)
    if pose is not None and cell is not None:
        _dial(draw, map_, pose, cell, colour)
        _arrow(draw, map_, pose, view.facing[1], view.grid.root_b, SUBJECTS[1])
    if pinned is not None:
        _pin(draw, map_, view.group.poses[pinned])
    return np.asarray(image, np.uint8)


def map_key(state: ViewerState) -> tuple[object, ...]:
    """What the map without marks depends on."""
    return (id(state.view), None if state.decision is None else state.decision.exclude)


def marks_key(state: ViewerState) -> tuple[object, ...]:
    """What the map with its marks depends on."""
    return (*map_key(state), state.preview, None if state.decision is None else state.decision.pin)


def empty_map(width: int, height: int, words: str = EMPTY_PAGE) -> ByteArray:
    """(H, W, 3) a page without a map."""
    image = Image.new("RGB", (width, height), PAPER)
    ImageDraw.Draw(image).text((width / 2, height / 2), words, font=font_of(15), fill=MUTED, anchor="mm")
    return np.asarray(image, np.uint8)


def _arrow(
    draw: ImageDraw.ImageDraw,
    map_: MapPicture,
    pose: FloatArray,
    facing: float,
    root: FloatArray,
    colour: str,
    *,
    faint: bool = False,
) -> None:
    """Somebody at a pose, and which way they face."""
    at = map_.pixels(rotation(pose[2]) @ root + pose[:2])
    way = facing + pose[2] + map_.frame.turn
    ahead_ = np.array([np.cos(way), -np.sin(way)])
    side = np.array([-ahead_[1], ahead_[0]])
    tip, neck = at + ARROW * ahead_, at + (ARROW - 13) * ahead_
    alpha = "70" if faint else "ff"
    for width, paint in ((8, PAPER + alpha), (4, colour + alpha)):
        draw.line([tuple(at), tuple(neck)], fill=paint, width=width)
    head = [tuple(tip), tuple(neck + 8 * side), tuple(neck - 8 * side)]
    draw.polygon(head, fill=colour + alpha, outline=PAPER + alpha)
    x, y = at
    draw.ellipse((x - 8, y - 8, x + 8, y + 8), fill=colour + alpha, outline=PAPER, width=2)


def _dial(draw: ImageDraw.ImageDraw, map_: MapPicture, pose: FloatArray, cell: Cell, colour: str) -> None:
    """A ring around B's place: dark where a facing fits, and light where it does not; PIL counts degrees clockwise."""
    view = map_.view
    x, y = map_.pixels(rotation(pose[2]) @ view.grid.root_b + pose[:2])
    column = view.found.reason[cell[0], cell[1]]
    inner, outer = DIAL
    draw.ellipse((x - outer, y - outer, x + outer, y + outer), outline=f"{PAPER}c0", width=outer - inner)
    step = max(360 / len(column), NARROWEST_SECTOR)
    for k in np.flatnonzero(column == ACCEPTED):
        middle = -np.degrees(view.grid.yaws[k] + view.facing[1] + map_.frame.turn)
        box = (x - outer + 1, y - outer + 1, x + outer - 1, y + outer - 1)
        draw.arc(box, middle - step / 2, middle + step / 2, fill=OK, width=outer - inner - 2)
    draw.ellipse((x - outer, y - outer, x + outer, y + outer), outline=colour, width=2)


def _pin(draw: ImageDraw.ImageDraw, map_: MapPicture, pose: FloatArray) -> None:
    x, y = map_.pixels(rotation(pose[2]) @ map_.view.grid.root_b + pose[:2])
    draw.line([(x, y), (x, y - 34)], fill=PAPER, width=6)
    draw.line([(x, y), (x, y - 34)], fill=INK, width=3)
    draw.ellipse((x - 9, y - 46, x + 9, y - 28), fill="#E69F00", outline=INK, width=2)
