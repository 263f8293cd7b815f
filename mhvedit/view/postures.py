"""One self-contained page on a motion that avoids itself: colliding limbs on the body, before and after."""

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path

import numpy as np
import pyvista
from matplotlib.figure import Figure

from mhvedit.errors import MissingLibrary, counted
from mhvedit.files import replacing
from mhvedit.geometry.arrays import BoolArray, ByteArray, FloatArray, Int32Array
from mhvedit.geometry.offsets import offset_of, without_offset
from mhvedit.sequences.meshes import Mesh
from mhvedit.view import markup
from mhvedit.view.stage import add_floor, add_person
from mhvedit.view.story_pictures import Picture, as_picture
from mhvedit.view.studio import empty_stage, framing, studio, take_picture
from mhvedit.view.style import INK, MUTED, OK, SUBJECTS, TEXT, WARNING, dress, figure_picture, new_figure

SIZE = (420, 460)  # pixels of one picture
LOOK = np.array([0.75, 0.9, -0.25])  # from the eye to the body, where no side is better than another
IN_THE_MIDDLE = 0.02  # m: limbs that collide are on neither side
WORDS = {
    "frames": "Frames",
    "colliding_before": "Colliding frames before",
    "colliding_after": "Colliding frames after",
    "effort": "Effort",
    "change_rms": "Joint change, root mean square, rad",
    "change_max": "Largest joint change, rad",
    "touched": "Touched frames",
    "step_ratio": "Largest step, as a ratio to the captured",
    "jerk_ratio": "Jerk, as a ratio to the captured",
    "slip_mm": "What stood still moved, mm",
    "solved": "Frames solved",
    "seconds": "Seconds",
}


@dataclass(frozen=True, slots=True, eq=False)
class PostureStory:
    """All that the page shows."""

    name: str
    method: str
    fps: float  # Hz
    frames: tuple[int, ...]  # K frames with pictures
    faces: Int32Array  # (F, 3)
    before: tuple[FloatArray, ...]  # K of (V, 3) m
    after: tuple[FloatArray, ...]
    coloured_before: tuple[BoolArray, ...]  # K of (F,) triangles of colliding limbs
    coloured_after: tuple[BoolArray, ...]
    depth_before: FloatArray  # (T,) mm deeper than at rest
    depth_after: FloatArray  # (T,) mm
    touched: BoolArray  # (T,)
    limit_mm: float
    converged: bool
    why: tuple[str, ...]
    numbers: Mapping[str, float]


def write_posture_report(path: Path, story: PostureStory) -> None:
    """Write the page; where this machine cannot draw in 3D, a sentence stands in for those pictures.

    Args:
        path: of the HTML file; replaced as a whole or not at all.
        story: all that it shows.
    """
    with replacing(path) as beside:
        beside.write_text(posture_page(story), encoding="utf-8")


def posture_page(story: PostureStory) -> str:
    """The page as HTML."""
    try:
        strips, missing = posture_strips(story), ""
    except MissingLibrary as fault:
        strips, missing = [], str(fault)
    inner = markup.paragraph(f"Self-collision, removed by {story.method}", "eyebrow")
    inner += markup.element("h1", escape(story.name))
    inner += markup.paragraph(_verdict(story), f"verdict {'good' if story.converged else 'bad'}")
    inner += markup.bullets(story.why, "warnings")
    inner += markup.tiles(_tiles(story))
    sections = markup.figures(strips, "") + markup.paragraph(missing, "nopicture")
    alt = f"Depth in each of {len(story.depth_before)} frames before and after"
    caption = "Deepest pair of limbs in every frame, beyond what it is at rest; grey frames were touched."
    drawn = as_picture(figure_picture(depth_chart(story)), alt, caption, quality=None)
    sections += markup.element("div", markup.figure(drawn), class_="row")
    rows = {words: f"{story.numbers[key]:g}" for key, words in WORDS.items() if key in story.numbers}
    sections += markup.table(rows, "Numbers")
    body = markup.element("header", markup.element("div", inner)) + markup.element("main", sections)
    folder = files("mhvedit.view")
    style, script = folder.joinpath("page.css").read_text("utf-8"), folder.joinpath("page.js").read_text("utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en-GB"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(story.name)} · mhvedit</title><style>{style}</style></head>\n<body>{body}"
        f'<dialog><img src="data:," alt=""></dialog><script>{script}</script></body></html>\n'
    )


def posture_strips(story: PostureStory) -> list[Picture]:
    """The telling frames as captured and as edited, with the colliding limbs in colour.

    Raises:
        MissingLibrary: nothing can be drawn on this machine.
    """
    numbers = ", ".join(map(str, story.frames))
    with studio(*SIZE) as plotter:
        rows = []
        looks = [telling_look(v, story.faces[c]) for v, c in zip(story.before, story.coloured_before, strict=True)]
        for vertices, coloured in ((story.before, story.coloured_before), (story.after, story.coloured_after)):
            drawn = zip(vertices, coloured, looks, strict=True)
            rows.append(np.concatenate([_body(plotter, story, v, c, look) for v, c, look in drawn], 1))
    return [
        as_picture(row, f"The body {words} in frames {numbers}", f"{words.capitalize()}: frames {numbers}.")
        for row, words in zip(rows, ("as captured", "as edited"), strict=True)
    ]


def depth_chart(story: PostureStory) -> Figure:
    """Depth over time, before and after, with the touched frames shaded."""
    figure = new_figure(13.0, 3.4)
    axes = figure.subplots()
    figure.subplots_adjust(left=0.07, right=0.98, bottom=0.2, top=0.94)
    frames = np.arange(len(story.depth_before))
    top = max(float(story.depth_before.max()), float(story.depth_after.max()), 2 * story.limit_mm)
    axes.fill_between(frames, 0, top, where=story.touched.tolist(), color="#eceef0", step="mid", linewidth=0)
    axes.plot(frames, story.depth_before, color=WARNING, linewidth=1.6, label="as captured")
    axes.plot(frames, story.depth_after, color=OK, linewidth=1.8, label="as edited")
    axes.axhline(story.limit_mm, color=INK, linewidth=1.2, linestyle=(0, (5, 3)))
    dress(axes, y="deeper than\nat rest, mm")
    axes.set_xlabel("frame", fontsize=TEXT, color=INK)
    axes.set_xlim(-0.5, len(frames) - 0.5)
    axes.set_ylim(0, top)
    axes.legend(fontsize=TEXT, frameon=False, labelcolor=MUTED, loc="upper right", ncols=2)
    return figure


def telling_look(vertices: FloatArray, coloured: Int32Array) -> FloatArray:
    """(3,) from the eye to the body: from the side on which limbs collide, a little from above.

    Args:
        vertices: (V, 3) m.
        coloured: (K, 3) triangles of the limbs that collide.
    """
    if not len(coloured):
        return LOOK
    side = (vertices[coloured].mean((0, 1)) - vertices.mean(0))[:2]
    length = float(np.linalg.norm(side))
    return LOOK if length < IN_THE_MIDDLE else np.array([*(-side / length * np.hypot(*LOOK[:2])), LOOK[2]])


def _body(
    plotter: pyvista.Plotter, story: PostureStory, vertices: FloatArray, coloured: BoolArray, look: FloatArray
) -> ByteArray:
    """One picture."""
    empty_stage(plotter)
    vertices = without_offset(vertices, offset_of(vertices))
    middle = vertices.mean(0) * np.array([1.0, 1.0, 0.0])
    add_floor(plotter, middle[:2], [vertices])
    add_person(plotter, Mesh(vertices, story.faces[~coloured]), SUBJECTS[0])
    add_person(plotter, Mesh(vertices, story.faces[coloured]), SUBJECTS[1])
    return take_picture(plotter, framing(vertices, look, aspect=SIZE[0] / SIZE[1]))


def _verdict(story: PostureStory) -> str:
    before = int((story.depth_before > story.limit_mm).sum())
    if story.converged:
        return f"{counted(before, 'frame')} collided; now none is more than {story.limit_mm:g} mm deeper than at rest."
    return f"{counted(before, 'frame')} collided; not all of it could be removed."


def _tiles(story: PostureStory) -> dict[str, tuple[str, str]]:
    after = int((story.depth_after > story.limit_mm).sum())
    before = int((story.depth_before > story.limit_mm).sum())
    return {
        "Colliding frames": (f"{before} → {after}", f"of {len(story.depth_before)}"),
        "Deepest": (f"{story.depth_before.max():.0f} → {story.depth_after.max():.0f} mm", "beyond rest"),
        "Touched": (counted(int(story.touched.sum()), "frame"), f"at {story.fps:g} fps"),
        "Jerk": (f"× {story.numbers['jerk_ratio']:.2f}", "against the captured"),
    }
