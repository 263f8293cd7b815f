import numpy as np
import pytest

from mhvedit.errors import MissingLibrary
from mhvedit.geometry.arrays import BoolArray, ByteArray
from mhvedit.scene.edit import EditedScene
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.view import studio as studio_module
from mhvedit.view.captions import captioned, ringed, webp_bytes
from mhvedit.view.renders import (
    Colouring,
    View,
    filmstrip,
    first_person,
    frame_picture,
    scene_meshes,
    solid_mesh,
    volume_picture,
    without_head,
)
from mhvedit.view.stage import FLOOR_SIDE, colours_by_label, floor_picture, voxel_faces
from mhvedit.view.story_pictures import scene_filmstrip, spread_frames
from mhvedit.view.studio import Camera, framing, studio
from mhvedit.view.style import LABELS, rgb
from mhvedit.volumes.surface import SurfaceLabel
from tests.view.shapes import PITCH, box, person, solid_block, standing, sweep

SIZE = (200, 160)


def blue(picture: ByteArray) -> BoolArray:
    return np.asarray(picture[..., 2].astype(int) - picture[..., 0] > 40)


def orange(picture: ByteArray) -> BoolArray:
    return np.asarray(picture[..., 0].astype(int) - picture[..., 2] > 40)


def test_a_is_left_of_b_from_the_side_and_from_above() -> None:
    meshes = {"anna": person(-0.5), "ben": person(0.5)}
    with studio(*SIZE) as plotter:
        for view in (View.SIDE, View.TOP):
            picture = frame_picture(meshes, view=view, plotter=plotter)
            assert picture.shape == (160, 200, 3)
            assert np.argwhere(blue(picture))[:, 1].max() < np.argwhere(orange(picture))[:, 1].min()


@pytest.mark.parametrize("view", View)
def test_far_from_the_origin_pictures_are_as_near_it(view: View) -> None:
    away = np.array([500000.0, -300000.0, 0.0])
    near = {"anna": person(-0.5), "ben": person(0.5)}
    far = {name: Mesh(mesh.vertices + away, mesh.faces) for name, mesh in near.items()}
    prop = box((0.0, -1.0, 0.0), (0.3, -0.8, 0.4))
    moved = Mesh(prop.vertices + away, prop.faces)
    with studio(*SIZE) as plotter:
        pictures = [frame_picture(m, props=[p], view=view, plotter=plotter) for m, p in ((near, prop), (far, moved))]
        eye, ahead = np.array([-0.5, 0.0, 1.6]), np.array([1.0, 0.0, -0.1])
        seen = [first_person(m, e, ahead, plotter=plotter) for m, e in ((near, eye), (far, eye + away))]
    for one, other in (pictures, seen):
        assert (np.abs(one.astype(int) - other).max(2) > 8).mean() < 0.002


def test_the_one_in_front_hides_the_other() -> None:
    picture = frame_picture({"anna": person(-0.5), "ben": person(0.5)}, view=View.FRONT, size=SIZE)
    assert orange(picture).sum() > 3 * blue(picture).sum()


def test_a_silhouette_is_where_geometry_says() -> None:
    camera = Camera(np.array([0.0, -10.0, 1.0]), np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0]), 20.0)
    picture = frame_picture({"anna": box((-0.5, -0.01, 0.5), (0.5, 0.01, 1.5))}, view=camera, size=(300, 300))
    rows, columns = np.nonzero(blue(picture))
    half = 0.5 / (9.99 * np.tan(np.radians(10))) * 150
    np.testing.assert_allclose([columns.min(), columns.max()], [150 - half, 149 + half], atol=1.5)
    np.testing.assert_allclose([rows.min(), rows.max()], [150 - half, 149 + half], atol=1.5)


def test_nobody_is_cut_off() -> None:
    meshes = {"anna": person(-1.5), "ben": person(1.2, 0.7)}
    with studio(*SIZE) as plotter:
        for view in View:
            seen = frame_picture(meshes, view=view, plotter=plotter)
            body = blue(seen) | orange(seen)
            assert body.any()
            assert not (body[0].any() or body[-1].any() or body[:, 0].any() or body[:, -1].any())


def test_framing_is_tight() -> None:
    points = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.4]])
    camera = framing(points, np.array([0.0, 1.0, 0.0]), aspect=1.0, margin=1.0)
    slopes = (points - camera.eye)[:, 0] / (points - camera.eye)[:, 1]
    np.testing.assert_allclose(np.abs(slopes).max(), np.tan(np.radians(camera.view_angle / 2)))


def test_one_sees_who_stands_ahead_and_not_oneself() -> None:
    meshes = {"anna": person(0.0), "ben": person(2.0)}
    eye = np.array([0.1, 0.0, 1.6])
    with studio(*SIZE) as plotter:
        ahead = first_person(meshes, eye, np.array([1.0, 0.0, 0.0]), own="anna", half_angle=0.3, plotter=plotter)
        behind = first_person(meshes, eye, np.array([-1.0, 0.0, 0.0]), own="anna", plotter=plotter)
    assert orange(ahead)[80:, 90:110].any()
    assert not blue(ahead).any()
    assert not orange(behind).any()


def test_only_what_is_near_the_eye_is_left_out() -> None:
    body = person(0.0)
    assert len(without_head(body, np.array([0.15, 0.2, 1.7])).faces) < len(body.faces)
    assert len(without_head(body, np.array([3.0, 0.0, 1.7])).faces) == len(body.faces)


def test_volumes_show_the_colours_of_their_labels() -> None:
    a, b = sweep(1), sweep(-1)
    with studio(*SIZE) as plotter:
        pose = np.array([0.9, 0.0, 0.0])
        labels = volume_picture(
            (a, b), pose, colouring=Colouring.LABEL, bodies=(standing(), standing()), plotter=plotter
        )
        times = volume_picture((a, b), pose, plotter=plotter)
    green = (labels[..., 1].astype(int) - labels[..., 0] > 40) & (labels[..., 1] > labels[..., 2])
    pink = (labels[..., 0].astype(int) - labels[..., 1] > 25) & (labels[..., 2].astype(int) - labels[..., 1] > 10)
    assert green.sum() > 50 and pink.sum() > 50
    yellow = times[..., 1].astype(int) - times[..., 2] > 60
    assert yellow.any()


def test_a_voxel_has_six_outward_faces() -> None:
    volume = solid_block(1)
    points, normals, shades = voxel_faces(volume, colours_by_label(volume))
    assert points.shape == (6, 4, 3) and len(shades) == 6
    middle = np.array(volume.grid.start) * PITCH
    outwards = points.mean(1) - middle
    assert ((outwards * normals).sum(1) > 0).all()
    edges = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 1])
    assert ((edges * outwards).sum(1) > 0).all()


def test_faces_between_voxels_are_not_drawn() -> None:
    volume = solid_block(3)
    points, _, _ = voxel_faces(volume, colours_by_label(volume))
    assert len(points) == 6 * 9


def test_labels_have_their_colours() -> None:
    volume = sweep(1)
    colours = colours_by_label(volume)
    start, end = SurfaceLabel.START.value, SurfaceLabel.END.value
    np.testing.assert_array_equal(colours[0, 0, 0], np.rint(255 * rgb(LABELS[start])))
    np.testing.assert_array_equal(colours[-1, 0, 0], np.rint(255 * rgb(LABELS[end])))


def test_a_solid_becomes_a_mesh_of_its_size() -> None:
    mesh = solid_mesh(standing(), 0)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), np.array([6, 8, 34]) * PITCH)


def test_the_floor_is_darker_where_somebody_stands() -> None:
    floor = floor_picture(
        np.zeros(2), [np.random.default_rng(0).uniform([0.8, -0.2, 0], [1.2, 0.2, 0.5], (2000, 3))]
    ).mean(-1)
    middle, metre = floor.shape[0] // 2, floor.shape[0] / FLOOR_SIDE

    def around(x: float, y: float) -> float:
        row, column = round(middle - y * metre), round(middle + x * metre)
        return float(floor[row - 25 : row + 25, column - 25 : column + 25].mean())

    assert around(1.0, 0.0) < min(around(-1.0, 0.0), around(0.0, 1.0), around(0.0, -1.0)) - 10


def test_a_filmstrip_is_one_row_at_one_scale() -> None:
    frames = [{"anna": person(-0.3), "ben": person(0.3)}, {"anna": person(-1.0), "ben": person(1.0)}]
    strip = filmstrip(frames, ["one", "two"], height=120)
    assert strip.shape[0] == 120
    gutters = np.flatnonzero((strip == 255).all((0, 2)))
    assert len(gutters) == 2
    near, far = strip[:, : gutters[0]], strip[:, gutters[-1] + 1 :]
    assert far.shape[1] > near.shape[1]
    heights = [np.ptp(np.nonzero(blue(part))[0]) for part in (near, far)]
    assert abs(heights[0] - heights[1]) <= 0.06 * max(heights)


def test_the_scene_in_a_row_shows_telling_moments(scene: EditedScene, captures: dict[str, MeshSequence]) -> None:
    frames = spread_frames(scene, 4)
    assert len(frames) == len(set(frames)) == 4
    assert set(frames) & {2, 9, 11, 18}
    assert scene_filmstrip(scene, captures, 3).ndim == 3


def test_held_things_are_placed_with_their_owner(scene: EditedScene, captures: dict[str, MeshSequence]) -> None:
    sword = MeshSequence("sword", captures["ben"].numbers, 25.0, lambda number: box((0.5, 0, 1), (0.6, 0.1, 1.1)))
    meshes = scene_meshes(scene, captures, 3, things={"ben": [sword]})
    assert len(meshes["ben"].faces) == 24 and len(meshes["anna"].faces) == 12
    np.testing.assert_allclose(meshes["ben"].vertices[8:, 0].max(), 0.1, atol=1e-12)


def test_where_nothing_can_be_drawn_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(studio_module, "_has_egl_device", lambda: False)
    monkeypatch.setattr(studio_module, "has_screen", lambda: False)
    with pytest.raises(MissingLibrary, match="libegl1"):
        frame_picture({"anna": person(0.0)}, size=SIZE)


def test_words_and_rings_leave_the_size_alone() -> None:
    picture = np.full((90, 120, 3), 200, np.uint8)
    captured = captioned(picture, "a caption that is much too long for such a small picture")
    assert captured.shape == picture.shape and captured.std() > 0
    ring = ringed(picture, 30.0)
    assert ring[45, 60, 0] == 200 and ring[45, 60 + 30, 0] < 150 and ring[2, 2, 0] > 200
    assert webp_bytes(picture, quality=None)[8:12] == b"WEBP"
