"""Pictures in three dimensions, drawn offscreen: volumes, frames, what somebody sees, filmstrips."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import StrEnum

import numpy as np
import pyvista
from skimage.measure import marching_cubes

from mhvedit.geometry.arrays import ByteArray, FloatArray
from mhvedit.geometry.offsets import offset_of, without_offset
from mhvedit.geometry.planar import apply_pose
from mhvedit.scene.edit import EditedScene, placed_mesh, placed_prop
from mhvedit.sequences.meshes import Mesh, MeshSequence, joined
from mhvedit.view.captions import captioned, ringed
from mhvedit.view.stage import add_floor, add_ghost, add_person, add_prop, add_voxels, colours_by_label, colours_by_time
from mhvedit.view.studio import UP, Camera, camera_axes, distance_needed, empty_stage, framing, studio, take_picture
from mhvedit.view.style import SUBJECTS, subject_colours
from mhvedit.volumes.history import MotionHistoryVolume
from mhvedit.volumes.surface import surface_voxels

Size = tuple[int, int]  # width, height in pixels
FRAME_SIZE: Size = (560, 520)
STRIP_HEIGHT = 420  # pixels
STRIP_ASPECT = 3  # of the widest frame
STRIP_NARROWEST = 0.6  # of the height
STRIP_AIR = 0.06  # of the height, on either side
ELEVATION = np.radians(12.0)  # from which a side view looks down
VOLUME_ELEVATION = np.radians(24.0)
EYE_ANGLE = 75.0  # degrees, from top to bottom of what a person sees
EYE_NEAR = 0.1  # m
OWN_HEAD = 0.3  # m from the eye
VOLUME_MARGIN = 1.45


class View(StrEnum):
    """Where a picture of two people is taken from; A is left of B."""

    SIDE = "side"
    TOP = "top"
    FRONT = "front"


class Colouring(StrEnum):
    """What the colours of a volume say."""

    TIME = "time"
    LABEL = "label"


def frame_picture(
    meshes: Mapping[str, Mesh],
    *,
    props: Sequence[Mesh] = (),
    view: View | Camera = View.SIDE,
    size: Size = FRAME_SIZE,
    plotter: pyvista.Plotter | None = None,
) -> ByteArray:
    """One frame of a scene.

    Args:
        meshes: of each subject, in the world; the first is A.
        props: in the world; the camera of a named view does not go by them.
        view: a named one, or a camera.
        size: of a plotter of its own, where none is given.
        plotter: of `studio`, to draw many pictures with.

    Returns:
        (H, W, 3).

    Raises:
        MissingLibrary: nothing can be drawn on this machine.
    """
    with _on(plotter, size) as stage:
        width, height = stage.window_size
        camera = view if isinstance(view, Camera) else camera_of(view, meshes, aspect=width / height)
        offset = _set_stage(stage, meshes, props)
        return take_picture(stage, camera.moved(-offset))


def first_person(
    meshes: Mapping[str, Mesh],
    eye: FloatArray,
    direction: FloatArray,
    *,
    props: Sequence[Mesh] = (),
    own: str | None = None,
    half_angle: float | None = None,
    plotter: pyvista.Plotter | None = None,
) -> ByteArray:
    """What somebody sees.

    Args:
        meshes: of each subject, in the world.
        eye: (3,) m, in the world.
        direction: (3,) of the gaze, in the world.
        props: in the world.
        own: whose eye it is: that one's head is left out, and with it what is as near.
        half_angle: of the cone of sight, rad, drawn as a ring.
        plotter: of `studio`, to draw many pictures with.

    Returns:
        (H, W, 3).

    Raises:
        MissingLibrary: nothing can be drawn on this machine.
    """
    forward = direction / np.linalg.norm(direction)
    up = UP if abs(forward[2]) < 0.99 else np.array([1.0, 0.0, 0.0])
    with _on(plotter, FRAME_SIZE) as stage:
        shown = {name: without_head(m, eye) if name == own else m for name, m in meshes.items()}
        offset = _set_stage(stage, shown, props)
        picture = take_picture(stage, Camera(eye, eye + forward, up, EYE_ANGLE, EYE_NEAR).moved(-offset))
    if half_angle is None:
        return picture
    return ringed(picture, np.tan(half_angle) / np.tan(np.radians(EYE_ANGLE) / 2) * picture.shape[0] / 2)


def without_head(mesh: Mesh, eye: FloatArray) -> Mesh:
    """One's own body as one sees it: without what is as near to the eye as one's own head."""
    near = ((mesh.vertices - eye) ** 2).sum(1) < OWN_HEAD**2
    return Mesh(mesh.vertices, mesh.faces[~near[mesh.faces].any(1)])


def volume_picture(
    parts: tuple[MotionHistoryVolume, MotionHistoryVolume],
    pose: FloatArray,
    *,
    colouring: Colouring = Colouring.TIME,
    bodies: tuple[MotionHistoryVolume, MotionHistoryVolume] | None = None,
    frame: int = -1,
    plotter: pyvista.Plotter | None = None,
) -> ByteArray:
    """The two interest volumes of a segment where they meet.

    Args:
        parts: A's and B's motion history volumes, each in its canonical frame.
        pose: (3,) of B in A's canonical frame, x, y m and yaw rad.
        colouring: by the last frame in which a voxel is filled, or by surface label.
        bodies: of A and B, shown faintly in one frame.
        frame: of the segment, in which the bodies are shown.
        plotter: of `studio`, to draw many pictures with.

    Returns:
        (H, W, 3).

    Raises:
        MissingLibrary: nothing can be drawn on this machine.
    """
    poses = (np.zeros(3), np.asarray(pose, np.float64))
    colours = colours_by_time if colouring is Colouring.TIME else colours_by_label
    with _on(plotter, FRAME_SIZE) as stage:
        width, height = stage.window_size
        empty_stage(stage)
        points = [apply_pose(p, _surface_points(part)) for part, p in zip(parts, poses, strict=True)]
        for part, at in zip(parts, poses, strict=True):
            add_voxels(stage, part, colours(part), at)
        for body, at, colour in zip(bodies or (), poses, SUBJECTS, strict=False):
            ghost = solid_mesh(body, frame % body.n_frames)
            add_ghost(stage, Mesh(apply_pose(at, ghost.vertices), ghost.faces), colour)
        along = points[1].mean(0) - points[0].mean(0) if bodies is None else _between(bodies, poses)
        looks = _side_direction(along, VOLUME_ELEVATION)
        camera = framing(np.concatenate(points), looks, aspect=width / height, margin=VOLUME_MARGIN)
        return take_picture(stage, camera)


def filmstrip(
    frames: Sequence[Mapping[str, Mesh]],
    captions: Sequence[str],
    *,
    props: Sequence[Sequence[Mesh]] | None = None,
    height: int = STRIP_HEIGHT,
    plotter: pyvista.Plotter | None = None,
) -> ByteArray:
    """Frames side by side, all from one side and at one scale; the camera goes along, each is as wide as it needs.

    Args:
        frames: of each the subjects' meshes, in the world; at least one.
        captions: of each.
        props: of each the meshes of props, in the world.
        height: pixels, of a plotter of its own, where none is given.
        plotter: of `studio`, wide enough for the widest frame, to draw many pictures with.

    Returns:
        (H, W, 3).

    Raises:
        MissingLibrary: nothing can be drawn on this machine.
    """
    with _on(plotter, (STRIP_ASPECT * height, height)) as stage:
        width, height = stage.window_size
        panels = []
        cameras = strip_cameras(frames, width / height)
        beside = [()] * len(frames) if props is None else props
        for meshes, own, camera, caption in zip(frames, beside, cameras, captions, strict=True):
            picture = frame_picture(meshes, props=own, view=camera, plotter=stage)
            panels.append(captioned(_as_wide_as_needed(picture, meshes, camera), caption))
    gutter = np.full((height, max(2, height // 90), 3), 255, np.uint8)
    return np.concatenate([piece for panel in panels for piece in (gutter, panel)][1:], axis=1)


def _as_wide_as_needed(picture: ByteArray, meshes: Mapping[str, Mesh], camera: Camera) -> ByteArray:
    """The middle of a picture, with some air beside the people."""
    height, width = picture.shape[:2]
    forward = (camera.target - camera.eye) / np.linalg.norm(camera.target - camera.eye)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    points = np.concatenate([mesh.vertices for mesh in meshes.values()]) - camera.eye
    slope = float(np.abs((points @ right) / (points @ forward)).max())
    half = slope / np.tan(np.radians(camera.view_angle) / 2) * height / 2 + STRIP_AIR * height
    half_width = int(min(width / 2, max(half, STRIP_NARROWEST * height / 2)))
    return picture[:, width // 2 - half_width : width // 2 + half_width]


def camera_of(view: View, meshes: Mapping[str, Mesh], *, aspect: float) -> Camera:
    """The camera of a named view that sees all meshes whole.

    Args:
        view: named.
        meshes: of each subject; the first is A.
        aspect: width of the picture over its height.
    """
    points = np.concatenate([mesh.vertices for mesh in meshes.values()])
    along = _apart(meshes)
    if view is View.TOP:
        return framing(points, -UP, aspect=aspect, up=np.array([-along[1], along[0], 0.0]))
    if view is View.FRONT:
        along = np.array([-along[1], along[0], 0.0])
    return framing(points, _side_direction(along, ELEVATION), aspect=aspect)


def strip_cameras(frames: Sequence[Mapping[str, Mesh]], aspect: float) -> list[Camera]:
    """Cameras of a filmstrip: one direction, one distance, one height."""
    ways = np.array([_apart(meshes) for meshes in frames])
    main = np.linalg.eigh(ways.T @ ways)[1][:, -1] * [1.0, 1.0, 0.0]
    along = main if main @ ways.sum(0) >= 0 else -main
    looks = _side_direction(along, ELEVATION)
    clouds = [np.concatenate([mesh.vertices for mesh in meshes.values()]) for meshes in frames]
    single = [framing(cloud, looks, aspect=aspect) for cloud in clouds]
    height = (min(c[:, 2].min() for c in clouds) + max(c[:, 2].max() for c in clouds)) / 2
    targets = [np.array([camera.target[0], camera.target[1], height]) for camera in single]
    axes = camera_axes(looks, UP)
    away = max(distance_needed(c, t, axes, aspect=aspect) for c, t in zip(clouds, targets, strict=True))
    return [Camera(target - away * looks, target, UP) for target in targets]


def scene_meshes(
    scene: EditedScene,
    captures: Mapping[str, MeshSequence],
    frame: int,
    *,
    things: Mapping[str, Sequence[MeshSequence]] | None = None,
) -> dict[str, Mesh]:
    """All subjects in one frame of the scene, in the world, each with the things that it holds.

    Args:
        scene: the edit.
        captures: by subject.
        frame: of the scene, from 0.
        things: by subject, meshes of their own in the frame of its capture.
    """
    placed = {}
    for name, edit in scene.subjects.items():
        body = placed_mesh(scene, captures, name, frame)
        held = [thing.mesh(int(edit.source[frame])) for thing in (things or {}).get(name, ())]
        moved = [Mesh(apply_pose(edit.placements[frame], mesh.vertices), mesh.faces) for mesh in held]
        placed[name] = joined([body, *moved])
    return placed


def prop_meshes(scene: EditedScene, captures: Mapping[str, MeshSequence], frame: int) -> list[Mesh]:
    """All props in one frame of the scene, in the world.

    Args:
        scene: the edit.
        captures: by name, of props as of subjects; props that are not there are left out.
        frame: of the scene, from 0.
    """
    return [placed_prop(scene, captures, name, frame) for name in scene.props if name in captures]


def solid_mesh(volume: MotionHistoryVolume, frame: int) -> Mesh:
    """The surface of what is filled in one frame, in the volume's canonical frame."""
    filled = np.pad(volume.at(frame), 1).astype(np.float32)
    if not filled.any():
        return Mesh(np.empty((0, 3)), np.empty((0, 3), np.int32))
    vertices, faces, _, _ = marching_cubes(filled, 0.5)
    places = (vertices - 1 + np.array(volume.grid.start)) * volume.grid.pitch
    return Mesh(np.asarray(places, np.float64), np.asarray(faces[:, ::-1], np.int32))


@contextmanager
def _on(plotter: pyvista.Plotter | None, size: Size) -> Iterator[pyvista.Plotter]:
    """The given plotter, or one that lives for one picture."""
    if plotter is not None:
        yield plotter
        return
    with studio(*size) as own:
        yield own


def _set_stage(stage: pyvista.Plotter, meshes: Mapping[str, Mesh], props: Sequence[Mesh] = ()) -> FloatArray:
    """Put everything on the stage, without a round offset where it is far from the origin; returns that, (3,) m."""
    empty_stage(stage)
    offset = offset_of(np.concatenate([mesh.vertices for mesh in meshes.values()]))
    people, things = [_without(mesh, offset) for mesh in meshes.values()], [_without(mesh, offset) for mesh in props]
    colours = subject_colours(list(meshes))
    for name, mesh in zip(meshes, people, strict=True):
        add_person(stage, mesh, colours[name])
    for mesh in things:
        add_prop(stage, mesh)
    clouds = [mesh.vertices for mesh in people]
    middle = np.concatenate(clouds)[:, :2].mean(0)
    add_floor(stage, middle, clouds + [mesh.vertices for mesh in things])
    return np.array([*offset, 0.0])


def _without(mesh: Mesh, offset: FloatArray) -> Mesh:
    return Mesh(without_offset(mesh.vertices, offset), mesh.faces)


def _apart(meshes: Mapping[str, Mesh]) -> FloatArray:
    """(3,) horizontal, from the first subject to the others."""
    middles = [mesh.vertices.mean(0) for mesh in meshes.values()]
    way = np.mean(middles[1:], axis=0) - middles[0] if len(middles) > 1 else np.array([1.0, 0.0, 0.0])
    return _level(way)


def _between(
    bodies: tuple[MotionHistoryVolume, MotionHistoryVolume], poses: tuple[FloatArray, FloatArray]
) -> FloatArray:
    return apply_pose(poses[1], bodies[1].centre) - apply_pose(poses[0], bodies[0].centre)


def _side_direction(along: FloatArray, elevation: float) -> FloatArray:
    """(3,) where to look so that a horizontal vector points right, from somewhat above."""
    level = _level(along)
    ahead = np.array([-level[1], level[0], 0.0])
    return np.asarray(np.cos(elevation) * ahead - np.sin(elevation) * UP)


def _level(way: FloatArray) -> FloatArray:
    """(3,) the horizontal part, unit; x where there is none."""
    flat = way * [1.0, 1.0, 0.0]
    length = float(np.linalg.norm(flat))
    return np.asarray(flat / length) if length > 1e-6 else np.array([1.0, 0.0, 0.0])


def _surface_points(volume: MotionHistoryVolume) -> FloatArray:
    where = np.argwhere(surface_voxels(volume.filled))
    if not len(where):
        return np.zeros((1, 3))
    return np.asarray((where + np.array(volume.grid.start)) * volume.grid.pitch)
