from collections.abc import Mapping

import numpy as np
import pytest
from numpy.testing import assert_allclose

from mhvedit.geometry.arrays import FloatArray
from mhvedit.scene.edit import EditedScene, SubjectEdit
from mhvedit.scene.eyes import Eyes
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.view import film as filming
from mhvedit.view.film import film, fixed_cameras, orbit_cameras, scene_boxes
from mhvedit.view.renders import frame_picture
from mhvedit.view.studio import UP, VIEW_ANGLE, Camera, camera_axes

N = 6
CUBE = np.array([(x, y, z) for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (0, 1.7)])
FACES = np.array([(0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6)], np.int32)


def box(number: int) -> Mesh:
    return Mesh(CUBE + np.array([0, 0, 0.01 * number]), FACES)


CAPTURES: Mapping[str, MeshSequence] = {w: MeshSequence(w, tuple(range(N)), 25.0, box) for w in ("a", "b")}


def scene() -> EditedScene:
    """A stands, B walks past."""
    still = np.zeros((N, 3))
    walk = np.stack([np.full(N, 1.5), np.linspace(-1, 1, N), np.linspace(0, 1, N)], 1)
    subjects = {"a": SubjectEdit(np.arange(N), still), "b": SubjectEdit(np.arange(N), walk)}
    return EditedScene("walk", 25.0, N, subjects, (), 0.0, 0.0, 0.0)


def seen(camera: Camera, points: FloatArray, aspect: float) -> FloatArray:
    """(P, 2) where points are in a picture; inside from -1 to 1."""
    local = (points - camera.eye) @ camera_axes(camera.target - camera.eye, camera.up)
    slope = np.tan(np.radians(VIEW_ANGLE) / 2)
    return np.asarray(local[:, :2] / local[:, 2:] / slope / [aspect, 1.0])


@pytest.mark.parametrize("cameras", [fixed_cameras, orbit_cameras])
@pytest.mark.parametrize("aspect", [16 / 9, 0.5])
def test_everybody_is_seen_in_every_frame(cameras: object, aspect: float) -> None:
    boxes = scene_boxes(scene(), CAPTURES)
    found = cameras(boxes, aspect=aspect)  # type: ignore[operator]
    assert len(found) == N
    for camera, frame in zip(found, boxes, strict=True):
        corners = np.array([[(c[i][k]) for k, i in enumerate(pick)] for c in frame for pick in np.ndindex(2, 2, 2)])
        places = seen(camera, corners, aspect)
        assert (np.abs(places) < 1).all() and camera.eye[2] > camera.target[2]


def test_a_fixed_camera_stands_still_with_a_on_the_left() -> None:
    found = fixed_cameras(scene_boxes(scene(), CAPTURES), aspect=1.5)
    assert all(camera is found[0] for camera in found)
    places = seen(found[0], np.array([(0, 0, 1.0), (1.5, 0, 1.0)]), 1.5)
    assert places[0, 0] < places[1, 0]


def test_an_orbit_starts_where_the_fixed_camera_looks_from_and_goes_round_once() -> None:
    boxes = scene_boxes(scene(), CAPTURES)
    fixed, orbit = fixed_cameras(boxes, aspect=1.5)[0], orbit_cameras(boxes, aspect=1.5)
    ways = np.array([(c.target - c.eye)[:2] / np.linalg.norm((c.target - c.eye)[:2]) for c in orbit])
    assert_allclose(ways[0], (fixed.target - fixed.eye)[:2] / np.linalg.norm((fixed.target - fixed.eye)[:2]), atol=1e-9)
    turns = np.diff(np.unwrap(np.arctan2(ways[:, 1], ways[:, 0])))
    assert_allclose(turns, 2 * np.pi / N)
    assert_allclose([c.eye[2] for c in orbit], orbit[0].eye[2])


def test_nobody_apart_from_anybody() -> None:
    still = {w: SubjectEdit(np.zeros(2, np.int64), np.zeros((2, 3))) for w in ("a", "b")}
    boxes = scene_boxes(EditedScene("same", 25.0, 2, still, (), 0.0, 0.0, 0.0), CAPTURES)
    for camera in (*fixed_cameras(boxes, aspect=1.0), *orbit_cameras(boxes, aspect=1.0)):
        assert np.isfinite(camera.eye).all()


def test_frames_that_repeat_are_drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []
    real = frame_picture

    def counted(*meshes: object, **options: object) -> object:
        drawn.append(1)
        return real(*meshes, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(filming, "frame_picture", counted)
    cameras = fixed_cameras(scene_boxes(scene(), CAPTURES), aspect=1.0)
    pictures = list(film(scene(), CAPTURES, frames=[0, 0, 3, 3, 3, 0], cameras=cameras, size=(64, 64)))
    assert len(drawn) == 3 and len(pictures) == 6
    assert (pictures[0] == pictures[5]).all() and (pictures[0] != pictures[2]).any()


def test_eyes_see_the_other_in_the_middle() -> None:
    """The picture that looks at B has B's colour in its middle; the one that looks away has not."""
    eye = np.tile([0.0, 0.0, 1.7], (N, 1))  # so that the own box counts as head
    towards = np.tile([1.0, 0.0, -0.3], (N, 1))
    size = (90, 60)
    middles = []
    for direction in (towards, -towards * [1, 1, -1]):
        [picture] = film(scene(), CAPTURES, frames=[3], cameras=Eyes("a", eye, direction), size=size)
        middles.append(picture[30, 45].astype(int))
    assert np.ptp(middles[0]) > 60 > np.ptp(middles[1])
    assert UP[2] == 1
