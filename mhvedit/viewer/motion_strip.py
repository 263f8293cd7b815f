"""Depth over time as a picture: before and after, in the colours of the limbs, with the touched frames marked."""

import numpy as np
from matplotlib import colormaps
from PIL import Image, ImageDraw

from mhvedit.geometry.arrays import ByteArray, FloatArray
from mhvedit.pipeline.posture_file import Take
from mhvedit.view.captions import font_of
from mhvedit.view.stage import PALER
from mhvedit.view.style import GRID, INK, MUTED, OK, PAPER, SUBJECTS, WARNING, lighter, rgb
from mhvedit.viewer.motion import MotionMaterial, MotionState
from mhvedit.viewer.timeline import MARGIN, x_of

HEIGHT = 130  # pixels
WORDS, AXIS, BAND = 24, 6, 10  # pixels: of the line above, below the axis, of the band of touched frames
RAMP, RAMP_FROM = "YlOrRd", 0.25  # of limbs that collide, and where it begins
RAMP_WIDTH = 8  # pixels
TOUCHED = "#b4bac2"


def top_of(material: MotionMaterial) -> float:
    """The depth at the upper end of the strip and of the colours, mm."""
    return max(float(material.postures.deepest.max()), 2 * float(material.postures.limit))


def depth_colours(depth: FloatArray, *, limit: float, top: float) -> ByteArray:
    """(..., 3) the body's own colour up to the limit, then from yellow to dark red.

    Args:
        depth: (...) mm deeper than at rest.
        limit: mm, from which on it is a collision.
        top: mm, of the darkest.
    """
    shares = RAMP_FROM + (1.0 - RAMP_FROM) * np.clip((depth - limit) / (top - limit), 0.0, 1.0)
    over = (depth > limit)[..., None]
    colours = np.where(over, colormaps[RAMP](shares)[..., :3], rgb(lighter(SUBJECTS[0], PALER)))
    return np.asarray(np.rint(255 * colours), np.uint8)


def strip_picture(state: MotionState, *, width: int, height: int) -> ByteArray:
    """(H, W, 3) depth over frames, and where the state is.

    Args:
        state: to be shown.
        width: pixels.
        height: pixels, about `HEIGHT`.
    """
    material = state.material
    postures, n, limit, top = material.postures, material.n_frames, float(material.postures.limit), top_of(material)
    floor = height - BAND - AXIS
    image = Image.new("RGB", (width, height), PAPER)
    draw, font = ImageDraw.Draw(image), font_of(12)

    def y_of(depth: float) -> float:
        return floor - depth / top * (floor - WORDS)

    draw.rectangle((x_of(0, width, n), floor + 3, x_of(n, width, n), floor + 3 + BAND), fill=GRID)
    for frame in np.flatnonzero(postures.touched).tolist():
        draw.rectangle((x_of(frame, width, n), floor + 3, x_of(frame + 1, width, n), floor + 3 + BAND), fill=TOUCHED)
    rows = np.arange(WORDS, floor)
    ramp = depth_colours((floor - rows) / (floor - WORDS) * top, limit=limit, top=top)
    image.paste(Image.fromarray(np.repeat(ramp[:, None], RAMP_WIDTH, 1)), (2, WORDS))
    for mark, colour, anchor in ((limit, MUTED, "ls"), (top, GRID, "la")):
        draw.line([(MARGIN, y_of(mark)), (width - MARGIN, y_of(mark))], fill=colour)
        draw.text((MARGIN + 3, y_of(mark)), f"{mark:.0f} mm", font=font, fill=MUTED, anchor=anchor)
    for take, colour in ((Take.CAPTURED, WARNING), (Take.EDITED, OK)):
        points = [(x_of(frame + 0.5, width, n), y_of(depth)) for frame, depth in enumerate(postures.deepest[take])]
        draw.line(points if n > 1 else [(MARGIN, points[0][1]), (width - MARGIN, points[0][1])], fill=colour, width=2)
    x = x_of(state.frame + 0.5, width, n)
    draw.line([(x, WORDS - 2), (x, height)], fill=INK, width=2)
    _say(draw, state, width)
    return np.asarray(image, np.uint8)


def _say(draw: ImageDraw.ImageDraw, state: MotionState, width: int) -> None:
    """The line above: where it is, and what the lines and the band are."""
    font, material = font_of(14), state.material
    words = f"frame {state.frame} of {material.n_frames} · {state.frame / material.fps:.2f} s · x{state.speed:g}"
    draw.text((MARGIN, 4), words, font=font, fill=INK)
    x = float(width - MARGIN)
    for text, colour in (("touched", TOUCHED), ("after", OK), ("before", WARNING)):
        x -= draw.textlength(text, font=font)
        draw.text((x, 4), text, font=font, fill=MUTED)
        draw.rectangle((x - 18, 9, x - 6, 15), fill=colour)
        x -= 34
    draw.text((x, 4), "deeper than at rest:", font=font, fill=MUTED, anchor="ra")
