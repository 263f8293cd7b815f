"""Frames of a movie of the edited scene: from a fixed camera, one that goes round, or somebody's eyes."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from mhvedit.geometry.arrays import ByteArray, FloatArray
from mhvedit.scene.edit import EditedScene
from mhvedit.scene.eyes import Eyes
from mhvedit.sequences.meshes import MeshSequence
from mhvedit.view.renders import ELEVATION, Size, first_person, frame_picture, prop_meshes, scene_meshes
from mhvedit.view.studio import UP, Camera, camera_axes, distance_needed, studio

CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)


Cameras = Sequence[Camera] | Eyes  # one for each frame of the scene


def film(
    scene: EditedScene,
    captures: Mapping[str, MeshSequence],
    *,
    frames: Sequence[int],
    cameras: Cameras,
    size: Size,
    things: Mapping[str, Sequence[MeshSequence]] | None = None,
) -> Iterator[ByteArray]:
    """Draw frames of the scene one after the other; a frame that is asked for twice in a row is drawn once.

    Args:
        scene: the edit.
        captures: by subject, and by prop.
        frames: of the scene, in the order of the movie.
        cameras: a camera for each frame of the scene, or somebody's eyes.
        size: width and height in pixels.
        things: by subject, meshes of their own in the frame of its capture.

    Yields:
        (H, W, 3).

    Raises:
        MissingLibrary: nothing can be drawn on this machine.
    """
    with studio(*size) as stage:
        last = -1
        for frame in frames:
            if frame != last:
                meshes = scene_meshes(scene, captures, frame, things=things)
                props = prop_meshes(scene, captures, frame)
                if isinstance(cameras, Eyes):
                    eye, direction = cameras.eye[frame], cameras.direction[frame]
                    picture = first_person(meshes, eye, direction, props=props, own=cameras.subject, plotter=stage)
                else:
                    picture = frame_picture(meshes, props=props, view=cameras[frame], plotter=stage)
                last = frame
            yield picture


def scene_boxes(
    scene: EditedScene,
    captures: Mapping[str, MeshSequence],
    *,
    things: Mapping[str, Sequence[MeshSequence]] | None = None,
) -> FloatArray:
    """(N, subjects, 2, 3) m, lowest and highest coordinates of every subject in every frame, in the world."""
    found = []
    for frame in range(scene.n_frames):
        meshes = scene_meshes(scene, captures, frame, things=things)
        found.append([(mesh.vertices.min(0), mesh.vertices.max(0)) for mesh in meshes.values()])
    return np.array(found)


def fixed_cameras(boxes: FloatArray, *, aspect: float) -> list[Camera]:
    """One camera that sees everybody in all frames, from the side on which they hide each other least.

    Args:
        boxes: of `scene_boxes`.
        aspect: width of the picture over its height.
    """
    along = _main_way(boxes)
    looks = np.cos(ELEVATION) * np.array([-along[1], along[0], 0.0]) - np.sin(ELEVATION) * UP
    return [_camera(boxes, looks, aspect=aspect)] * len(boxes)


def orbit_cameras(boxes: FloatArray, *, aspect: float) -> list[Camera]:
    """A camera that goes once round the scene at one height and one distance, from which it always sees everybody.

    Args:
        boxes: of `scene_boxes`.
        aspect: width of the picture over its height.
    """
    along = _main_way(boxes)
    start = np.arctan2(along[0], -along[1])
    angles = start + 2 * np.pi * np.arange(len(boxes)) / len(boxes)
    ways = np.stack([np.cos(angles), np.sin(angles), np.zeros(len(boxes))], 1)
    looks = np.cos(ELEVATION) * ways - np.sin(ELEVATION) * UP
    target = (boxes[:, :, 0].min((0, 1)) + boxes[:, :, 1].max((0, 1))) / 2
    points = _corner_points(boxes)
    away = max(distance_needed(points, target, camera_axes(look, UP), aspect=aspect) for look in looks)
    return [Camera(target - away * look, target, UP) for look in looks]


def _camera(boxes: FloatArray, looks: FloatArray, *, aspect: float) -> Camera:
    """The nearest camera in a direction that sees all boxes."""
    points, axes = _corner_points(boxes), camera_axes(looks, UP)
    local = points @ axes
    target = axes @ ((local.min(0) + local.max(0)) / 2)
    away = distance_needed(points, target, axes, aspect=aspect)
    return Camera(target - away * axes[:, 2], target, axes[:, 1])


def _corner_points(boxes: FloatArray) -> FloatArray:
    """(8 N subjects, 3) corners of all boxes."""
    low, high = boxes.reshape(-1, 2, 3)[:, 0], boxes.reshape(-1, 2, 3)[:, 1]
    return np.asarray((low[:, None] + CORNERS * (high - low)[:, None]).reshape(-1, 3))


def _main_way(boxes: FloatArray) -> FloatArray:
    """(3,) unit, level: from the first subject to the others, over all frames; A is then left in the picture."""
    middles = boxes.mean(2) * [1.0, 1.0, 0.0]
    ways = middles[:, 1:].mean(1) - middles[:, 0] if boxes.shape[1] > 1 else np.zeros((len(boxes), 3))
    lengths = np.linalg.norm(ways, axis=1, keepdims=True)
    if not (lengths > 1e-6).any():
        return np.array([1.0, 0.0, 0.0])
    ways = ways / np.maximum(lengths, 1e-6)
    main = np.linalg.eigh(ways.T @ ways)[1][:, -1] * [1.0, 1.0, 0.0]
    main /= np.linalg.norm(main)
    return np.asarray(main if main @ ways.sum(0) >= 0 else -main)
