"""Words and marks on finished pictures, and pictures as bytes."""

from io import BytesIO
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from mhvedit.geometry.arrays import ByteArray
from mhvedit.view.style import INK

FONT = Path(matplotlib.get_data_path()) / "fonts/ttf/DejaVuSans.ttf"


def captioned(picture: ByteArray, text: str) -> ByteArray:
    """The picture with a line of text on a light plate in its upper left corner.

    Args:
        picture: (H, W, 3).
        text: made smaller where it does not fit.
    """
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    height, width = picture.shape[:2]
    size = max(11, height // 22)
    while size > 9 and draw.textlength(text, font=font_of(size)) > width - 3 * size:
        size -= 1
    font = font_of(size)
    left, top, right, bottom = draw.textbbox((size, size), text, font=font)
    pad = size // 3
    draw.rounded_rectangle((left - pad, top - pad, right + pad, bottom + pad), radius=pad, fill=(255, 255, 255, 215))
    draw.text((size, size), text, font=font, fill=INK)
    return np.asarray(image, np.uint8).copy()


def ringed(picture: ByteArray, radius: float) -> ByteArray:
    """The picture with a ring around its middle; what lies outside is paler.

    Args:
        picture: (H, W, 3).
        radius: pixels.
    """
    height, width = picture.shape[:2]
    y, x = np.mgrid[:height, :width]
    away = np.hypot(x - (width - 1) / 2, y - (height - 1) / 2) - radius
    pale = np.clip(away, 0.0, 1.0)[..., None] * 0.45
    ring = np.clip(1.6 - np.abs(away), 0.0, 1.0)[..., None]
    light = picture * (1.0 - pale) + 255.0 * pale
    return np.asarray(np.rint(light * (1.0 - ring) + 90.0 * ring), np.uint8)


def webp_bytes(picture: ByteArray, *, quality: int | None) -> bytes:
    """The picture as WebP; lossless where no quality is given."""
    out = BytesIO()
    if quality is None:
        Image.fromarray(picture).save(out, "WEBP", lossless=True, quality=40, method=2)
    else:
        Image.fromarray(picture).save(out, "WEBP", quality=quality, method=3)
    return out.getvalue()


def font_of(size: int) -> ImageFont.FreeTypeFont:
    """The font of words on pictures, of a size in pixels."""
    return ImageFont.truetype(str(FONT), size)
