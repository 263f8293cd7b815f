"""All pictures of a report, drawn with two plotters and handed on as bytes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyvista

from mhvedit.geometry.arrays import ByteArray
from mhvedit.scene.edit import EditedScene
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.view.captions import webp_bytes
from mhvedit.view.content import ReportContent, SegmentStory
from mhvedit.view.renders import (
    Colouring,
    View,
    filmstrip,
    first_person,
    frame_picture,
    prop_meshes,
    scene_meshes,
    volume_picture,
)
from mhvedit.view.studio import studio
from mhvedit.view.words import edit_of, shown_frame

STILL_SIZE = (560, 520)
STRIP_SIZE = (1140, 380)
STRIP_FRAMES = 5
SCENE_FRAMES = 6
QUALITY = 82


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture with its words."""

    data: bytes  # WebP
    width: int
    height: int
    alt: str
    caption: str


@dataclass(frozen=True, slots=True)
class StoryPictures:
    """The rendered pictures of one segment."""

    strip: tuple[Picture, ...] = ()
    frame: tuple[Picture, ...] = ()
    eyes: tuple[Picture, ...] = ()
    volumes: tuple[Picture, ...] = ()


@dataclass(frozen=True, slots=True)
class ReportPictures:
    """The rendered pictures of a report."""

    scene: Picture | None
    stories: tuple[StoryPictures, ...]


def draw_pictures(content: ReportContent) -> ReportPictures:
    """Render everything that is rendered.

    Raises:
        MissingLibrary: nothing can be drawn on this machine.
    """
    with studio(*STILL_SIZE) as stills, studio(*STRIP_SIZE) as strips:
        scene = _scene_strip(content, strips)
        stories = tuple(_story_pictures(content, story, stills, strips) for story in content.stories)
    return ReportPictures(scene, stories)


def scene_filmstrip(
    scene: EditedScene,
    captures: Mapping[str, MeshSequence],
    n: int = SCENE_FRAMES,
    *,
    things: Mapping[str, Sequence[MeshSequence]] | None = None,
    plotter: pyvista.Plotter | None = None,
) -> ByteArray:
    """The whole scene in one row of pictures.

    Args:
        scene: the edit.
        captures: by subject.
        n: how many frames.
        things: by subject, meshes of their own.
        plotter: of `studio`, about three times as wide as high.

    Returns:
        (H, W, 3).

    Raises:
        MissingLibrary: nothing can be drawn on this machine.
    """
    numbers = spread_frames(scene, n)
    frames = [scene_meshes(scene, captures, number, things=things) for number in numbers]
    captions = [f"{number / scene.fps:.1f} s" for number in numbers]
    props = [prop_meshes(scene, captures, number) for number in numbers]
    return filmstrip(frames, captions, props=props, plotter=plotter)


def spread_frames(scene: EditedScene, n: int) -> list[int]:
    """Frames spread over the scene, each moved to the nearest end of a key segment, if one is near."""
    even = np.linspace(0, scene.n_frames - 1, n)
    reach = 0.4 * scene.n_frames / max(1, n - 1)
    moments = np.array([frame for s in scene.segments for frame in (s.start, s.stop - 1)] or [0])
    chosen: list[int] = []
    for frame in even:
        nearest = int(moments[np.argmin(np.abs(moments - frame))])
        moved = nearest if abs(nearest - frame) <= reach and nearest not in chosen else round(float(frame))
        chosen.append(moved)
    return sorted(set(chosen))


def as_picture(array: ByteArray, alt: str, caption: str, *, quality: int | None = QUALITY) -> Picture:
    """Compress a picture; lossless where no quality is given, which suits charts."""
    return Picture(webp_bytes(array, quality=quality), array.shape[1], array.shape[0], alt, caption)


def _scene_strip(content: ReportContent, strips: pyvista.Plotter) -> Picture | None:
    if content.scene is None or not content.captures:
        return None
    picture = scene_filmstrip(content.scene, content.captures, things=content.things, plotter=strips)
    names = " and ".join(content.scene.subjects)
    seconds = ", ".join(f"{f / content.scene.fps:.1f}" for f in spread_frames(content.scene, SCENE_FRAMES))
    return as_picture(
        picture, f"{names} at {seconds} seconds of the edited scene, seen from the side", "The edited scene"
    )


def _story_pictures(
    content: ReportContent, story: SegmentStory, stills: pyvista.Plotter, strips: pyvista.Plotter
) -> StoryPictures:
    edit = edit_of(content, story)
    volumes = _volume_pictures(content, story, stills)
    if edit is None or content.scene is None or not content.captures:
        return StoryPictures(volumes=volumes)
    number = edit.start + shown_frame(content, story)
    meshes = _pair(content, story, number)
    return StoryPictures(
        strip=_strip_pictures(content, story, edit.start, edit.stop, strips),
        frame=_frame_pictures(story, meshes, _props(content, number), number, stills),
        eyes=_eye_pictures(content, story, number, stills),
        volumes=volumes,
    )


def _pair(content: ReportContent, story: SegmentStory, number: int) -> dict[str, Mesh]:
    """The meshes of all subjects in a frame of the scene, the segment's two first."""
    assert content.scene is not None
    meshes = scene_meshes(content.scene, content.captures, number, things=content.things)
    first = (story.a.subject, story.b.subject)
    return {name: meshes[name] for name in (*first, *(name for name in meshes if name not in first))}


def _props(content: ReportContent, number: int) -> list[Mesh]:
    """The meshes of all props in a frame of the scene."""
    assert content.scene is not None
    return prop_meshes(content.scene, content.captures, number)


def _strip_pictures(
    content: ReportContent, story: SegmentStory, start: int, stop: int, strips: pyvista.Plotter
) -> tuple[Picture, ...]:
    numbers = [int(n) for n in np.unique(np.rint(np.linspace(start, stop - 1, STRIP_FRAMES)))]
    frames = [_pair(content, story, number) for number in numbers]
    props = [_props(content, number) for number in numbers]
    picture = filmstrip(frames, [f"frame {number}" for number in numbers], props=props, plotter=strips)
    alt = (
        f"{story.name}: {story.a.subject} and {story.b.subject} in frames {', '.join(map(str, numbers))}, from the side"
    )
    return (as_picture(picture, alt, f"The segment, frames {start} to {stop - 1} of the scene"),)


def _frame_pictures(
    story: SegmentStory, meshes: Mapping[str, Mesh], props: Sequence[Mesh], number: int, stills: pyvista.Plotter
) -> tuple[Picture, ...]:
    pair = f"{story.a.subject} and {story.b.subject}"
    words = {View.SIDE: "from the side", View.TOP: "from above"}
    return tuple(
        as_picture(
            frame_picture(meshes, props=props, view=view, plotter=stills),
            f"{story.name}: {pair} in frame {number}, {text}",
            f"Frame {number}, {text}",
        )
        for view, text in words.items()
    )


def _eye_pictures(
    content: ReportContent, story: SegmentStory, number: int, stills: pyvista.Plotter
) -> tuple[Picture, ...]:
    pictures = []
    meshes, props = _pair(content, story, number), _props(content, number)
    for side, other in ((story.a, story.b), (story.b, story.a)):
        eyes = content.eyes.get(side.subject)
        if eyes is None or np.isnan(eyes.eye[number]).any():
            continue
        eye, gaze = eyes.eye[number], eyes.direction[number]
        picture = first_person(
            meshes, eye, gaze, props=props, own=side.subject, half_angle=story.half_angle, plotter=stills
        )
        ring = "; the ring is the cone of sight" if story.half_angle is not None else ""
        alt = f"{story.name}: what {side.subject} sees in frame {number}, looking towards {other.subject}{ring}"
        pictures.append(as_picture(picture, alt, f"What {side.subject} sees in frame {number}{ring}"))
    return tuple(pictures)


def _volume_pictures(content: ReportContent, story: SegmentStory, stills: pyvista.Plotter) -> tuple[Picture, ...]:
    if story.chosen is None or story.group is None or story.a.part_volume is None or story.b.part_volume is None:
        return ()
    pose = story.group.poses[story.chosen]
    parts = (story.a.part_volume, story.b.part_volume)
    bodies = None
    if story.a.body_volume is not None and story.b.body_volume is not None:
        bodies = (story.a.body_volume, story.b.body_volume)
    frame = shown_frame(content, story)
    pair = f"{story.a.subject}’s {story.a.part} and {story.b.subject}’s {story.b.part}"
    words = {Colouring.TIME: "by the last moment they are there", Colouring.LABEL: "by what their surface is"}
    return tuple(
        as_picture(
            volume_picture(parts, pose, colouring=colouring, bodies=bodies, frame=frame, plotter=stills),
            f"{story.name}: the volumes that {pair} pass through, coloured {text}",
            f"Where {pair} pass, coloured {text}",
        )
        for colouring, text in words.items()
    )
