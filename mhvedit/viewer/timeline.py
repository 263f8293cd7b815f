"""The time line as a picture: key segments marked and named, what lies between, and where the scene is now."""

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw
from PIL.ImageFont import FreeTypeFont

from mhvedit.geometry.arrays import ByteArray
from mhvedit.scene.edit import SegmentEdit
from mhvedit.view.captions import font_of
from mhvedit.view.style import GRID, INK, MUTED, PAPER, SUBJECTS, WARNING, lighter, shorter
from mhvedit.viewer.state import ViewerState

MARGIN = 16  # pixels on either side
BAR = (0.42, 0.80)  # of the height
TICKS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)  # frames between numbers
NARROWEST_TICK = 55  # pixels
BETWEEN = "transition"


def timeline_picture(state: ViewerState, *, width: int, height: int, now: bool = True) -> ByteArray:
    """(H, W, 3) the time line of a state.

    Args:
        state: to be shown.
        width: pixels.
        height: pixels, about 80.
        now: whether to mark the frame that is shown.
    """
    image = Image.new("RGB", (width, height), PAPER)
    draw = ImageDraw.Draw(image)
    top, bottom = (round(share * height) for share in BAR)
    n_frames = state.material.n_frames
    draw.rectangle((x_of(0, width, n_frames), top, x_of(n_frames, width, n_frames), bottom), fill=GRID)
    name_font, small = font_of(max(11, height // 6)), font_of(max(9, height // 8))
    done = 0
    spans = sorted(state.material.spans, key=lambda span: span.start)
    lanes = lanes_of(spans)
    high = (bottom - top) / (max(lanes, default=0) + 1)
    for span, lane in zip(spans, lanes, strict=True):
        _between(draw, done, span.start, state, width, (top + bottom) / 2, small)
        left, right = x_of(span.start, width, n_frames), x_of(span.stop, width, n_frames)
        upper, lower = top + lane * high, top + (lane + 1) * high
        current = span.name == state.segment
        draw.rectangle(
            (left, upper, right, lower), fill=SUBJECTS[0] if current else lighter(SUBJECTS[0], 0.55), outline=PAPER
        )
        _fitting(draw, span.name, left, right, (upper + lower) / 2, name_font, PAPER if current else INK)
        done = max(done, span.stop)
    _between(draw, done, n_frames, state, width, (top + bottom) / 2, small)
    _draw_ticks(draw, state, width, bottom, small)
    if now:
        x = x_of(state.frame + 0.5, width, n_frames)
        draw.line([(x, top - 7), (x, bottom + 5)], fill=WARNING, width=3)
        words = f"frame {state.frame} of {n_frames} · {state.frame / state.material.fps:.2f} s · x{state.speed:g}"
        draw.text((MARGIN, top - 7), words, font=name_font, fill=INK, anchor="ls")
    return np.asarray(image, np.uint8)


def lanes_of(spans: Sequence[SegmentEdit]) -> list[int]:
    """In which row each key segment goes, so that those of different people that run at once do not cover each other.

    Args:
        spans: by their first frames.
    """
    ends: list[int] = []
    lanes = []
    for span in spans:
        lane = next((n for n, end in enumerate(ends) if end <= span.start), len(ends))
        ends[lane : lane + 1] = [span.stop]
        lanes.append(lane)
    return lanes


def x_of(frame: float, width: int, n_frames: int) -> float:
    """Where a frame begins on the picture, pixels."""
    return MARGIN + frame / n_frames * (width - 2 * MARGIN)


def frame_at(x: float, width: int, n_frames: int) -> int:
    """The frame under a pixel, within the scene's ends."""
    frame = int((x - MARGIN) / (width - 2 * MARGIN) * n_frames)
    return min(max(frame, 0), n_frames - 1)


def _between(
    draw: ImageDraw.ImageDraw, start: int, stop: int, state: ViewerState, width: int, y: float, font: FreeTypeFont
) -> None:
    """What belongs to no key segment."""
    n_frames = state.material.n_frames
    if stop > start:
        _fitting(draw, BETWEEN, x_of(start, width, n_frames), x_of(stop, width, n_frames), y, font, MUTED)


def _fitting(
    draw: ImageDraw.ImageDraw, name: str, left: float, right: float, y: float, font: FreeTypeFont, colour: str
) -> None:
    """A name in the middle of a stretch, cut to its width; none where there is no room for three letters."""
    room = right - left - 6
    for limit in range(len(name), 2, -1):
        text = shorter(name, limit)
        if draw.textlength(text, font=font) <= room:
            draw.text(((left + right) / 2, y), text, font=font, fill=colour, anchor="mm")
            return


def _draw_ticks(draw: ImageDraw.ImageDraw, state: ViewerState, width: int, bottom: float, font: FreeTypeFont) -> None:
    n_frames = state.material.n_frames
    step = next((t for t in TICKS if t / n_frames * width > NARROWEST_TICK), TICKS[-1])
    for frame in range(0, n_frames, step):
        x = x_of(frame + 0.5, width, n_frames)
        draw.line([(x, bottom), (x, bottom + 3)], fill=MUTED)
        draw.text((x, bottom + 3), str(frame), font=font, fill=MUTED, anchor="mt")
