"""Pictures of a viewer without a window: the scene, the map and the time line as one."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista
from PIL import Image, ImageDraw

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import ByteArray
from mhvedit.view.captions import font_of
from mhvedit.view.studio import studio
from mhvedit.view.style import INK
from mhvedit.viewer.layout import layout_of
from mhvedit.viewer.map2d import draw_map, empty_map, marked
from mhvedit.viewer.scene3d import Scene3D, Volumes, prepare, scene_picture
from mhvedit.viewer.state import ViewerState
from mhvedit.viewer.timeline import timeline_picture
from mhvedit.viewer.words import status

SIZE = (1600, 900)
LONGEST = 96  # characters of a line of words
ENDINGS = (".png", ".webp", ".jpg", ".jpeg")


def shot(
    state: ViewerState,
    *,
    volumes: Volumes | None = None,
    size: tuple[int, int] = SIZE,
    plotter: pyvista.Plotter | None = None,
) -> ByteArray:
    """(H, W, 3) what a viewer shows of a state.

    Args:
        state: to be shown.
        volumes: of the current segment's interest parts, where they are to be seen.
        size: width and height, pixels.
        plotter: of `studio`, of the size of the layout's scene; one of its own where none is given.

    Raises:
        MissingLibrary: nothing can be drawn on this machine.
    """
    panels = layout_of(*size)
    if plotter is None:
        with studio(panels.scene.width, panels.scene.height) as own:
            return shot(state, volumes=volumes, size=size, plotter=own)
    prepare(plotter)
    picture = np.empty((size[1], size[0], 3), np.uint8)
    drawn = draw_map(state, width=panels.map.width, height=panels.map.height)
    map_picture = empty_map(panels.map.width, panels.map.height) if drawn is None else marked(drawn, state)
    for box, part in (
        (panels.scene, with_words(scene_picture(Scene3D(plotter), state, volumes), status(state))),
        (panels.map, map_picture),
        (panels.timeline, timeline_picture(state, width=panels.timeline.width, height=panels.timeline.height)),
    ):
        picture[box.top : box.top + box.height, box.left : box.left + box.width] = part
    return picture


def with_words(picture: ByteArray, lines: Sequence[str]) -> ByteArray:
    """The picture with lines of text on a light plate in its upper left corner."""
    if not lines:
        return picture
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    font = font_of(15)
    text = "\n".join(line if len(line) <= LONGEST else line[: LONGEST - 1] + "…" for line in lines)
    left, top, right, bottom = draw.multiline_textbbox((14, 12), text, font=font, spacing=5)
    draw.rounded_rectangle((left - 6, top - 6, right + 6, bottom + 6), radius=6, fill=(255, 255, 255, 215))
    draw.multiline_text((14, 12), text, font=font, fill=INK, spacing=5)
    return np.asarray(image, np.uint8)


def check_shot(path: Path) -> None:
    """Refuse a file that pictures cannot be written to.

    Raises:
        CaptureError: with the endings that are known; or there is no folder around it.
    """
    if path.suffix.lower() not in ENDINGS:
        raise CaptureError(path, f"a picture's name ending in {', '.join(ENDINGS)}", f"{path.suffix or 'none'}")
    folder = path.parent
    if not folder.is_dir():
        raise CaptureError(path, f"a folder {folder} to write into", "a file" if folder.exists() else "nothing there")


def save_shot(picture: ByteArray, path: Path) -> None:
    """Write a picture beside, then rename; the name's ending says how.

    Raises:
        CaptureError: it cannot be written there.
    """
    beside = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        Image.fromarray(picture).save(beside)
        beside.replace(path)
    except OSError as fault:
        raise CaptureError(path, "a file that can be written", fault.strerror or str(fault)) from fault
    finally:
        beside.unlink(missing_ok=True)
