from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from mhvedit import api
from mhvedit.geometry.arrays import BoolArray, ByteArray, FloatArray
from mhvedit.geometry.planar import apply_pose, compose
from mhvedit.geometry.quaternions import rotation_matrices
from mhvedit.scene.edit import PropEdit
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.view.renders import Colouring
from mhvedit.view.studio import studio
from mhvedit.viewer.frames import FrameCache, read_frame
from mhvedit.viewer.material import SetPiece
from mhvedit.viewer.scene3d import Scene3D, camera_for, prepare, scene_picture
from mhvedit.viewer.state import CameraPreset, Layer, ViewerState, at_frame, looked_at_row, placements_at, seen_from
from mhvedit.volumes.subject import part_of

SIZE = (320, 240)


def blue(picture: ByteArray) -> BoolArray:
    return np.asarray(picture[..., 2].astype(int) - picture[..., 0] > 40)


def orange(picture: ByteArray) -> BoolArray:
    return np.asarray(picture[..., 0].astype(int) - picture[..., 2] > 40)


@pytest.fixture
def scene() -> Iterator[Scene3D]:
    with studio(*SIZE) as plotter:
        prepare(plotter)
        yield Scene3D(plotter)


def plain(state: ViewerState) -> ViewerState:
    return replace(state, layers=frozenset({Layer.BODIES}))


def projected(scene: Scene3D, state: ViewerState, name: str) -> FloatArray:
    """(V, 2) pixels at which the camera sees a person's vertices."""
    camera = camera_for(scene, state, aspect=SIZE[0] / SIZE[1])
    number, pose = placements_at(state, state.frame)[name]
    points = apply_pose(pose, state.material.cast[name].sequence.mesh(number).vertices) - camera.eye
    ahead = camera.target - camera.eye
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, camera.up)
    right /= np.linalg.norm(right)
    scale = SIZE[1] / 2 / np.tan(np.radians(camera.view_angle) / 2) / (points @ ahead)
    return np.stack([SIZE[0] / 2 + points @ right * scale, SIZE[1] / 2 - points @ np.cross(right, ahead) * scale], 1)


@pytest.mark.parametrize("camera", [CameraPreset.SIDE, CameraPreset.TOP])
@pytest.mark.parametrize("frame", [0, 2, 14])  # when their hands are apart
def test_people_are_seen_where_geometry_says(
    scene: Scene3D, state: ViewerState, camera: CameraPreset, frame: int
) -> None:
    now = at_frame(seen_from(plain(state), camera), frame)
    picture = scene_picture(scene, now)
    for name, seen in (("anna", blue(picture)), ("ben", orange(picture))):
        pixels = projected(scene, now, name)
        rows, columns = np.nonzero(seen)
        np.testing.assert_allclose([columns.min(), columns.max()], [pixels[:, 0].min(), pixels[:, 0].max()], atol=3)
        np.testing.assert_allclose([rows.min(), rows.max()], [pixels[:, 1].min(), pixels[:, 1].max()], atol=3)


def test_a_preview_moves_b_and_nobody_else(scene: Scene3D, state: ViewerState) -> None:
    now = plain(state)
    scene_picture(scene, now)
    other = looked_at_row(now, 40)

    def seen(state: ViewerState) -> ByteArray:
        scene.draw(state)
        scene.plotter.render()
        return np.asarray(scene.plotter.screenshot(return_img=True))[..., :3]

    before, after = seen(now), seen(other)
    assert (blue(before) ^ blue(after)).sum() < 0.1 * blue(before).sum()
    assert (orange(before) & orange(after)).sum() < 0.8 * orange(before).sum()


def test_frames_are_put_into_the_same_actors(scene: Scene3D, state: ViewerState) -> None:
    scene.draw(plain(state))
    actors = {name: body.actor for name, body in scene.bodies.items()}
    count = len(scene.plotter.actors)
    pictures = []
    for frame in range(state.material.n_frames):
        pictures.append(scene_picture(scene, at_frame(plain(state), frame)))
    assert {name: body.actor for name, body in scene.bodies.items()} == actors
    assert len(scene.plotter.actors) == count
    assert any((pictures[0] != picture).any() for picture in pictures[1:])


def test_memory_stays_bounded_however_long_the_clip_is(state: ViewerState) -> None:
    actor = state.material.cast["anna"]
    size = read_frame(actor, 0).n_bytes
    big = Mesh(np.zeros((1000, 3)), np.zeros((2000, 3), np.int32))
    long = replace(actor, sequence=replace(actor.sequence, numbers=tuple(range(1000)), load=lambda number: big))
    cache = FrameCache(most_bytes=3_000_000)
    most = 0
    for number in (*range(1000), *range(1000)):
        cache.frame("anna", long, number)
        most = max(most, cache.n_bytes)
    assert size < most <= 3_000_000 and most > 2_900_000
    kept = cache.frame("anna", long, 999)
    assert cache.frame("anna", long, 999) is kept


def test_one_sees_the_other_and_not_ones_own_head(scene: Scene3D, state: ViewerState) -> None:
    through_a = scene_picture(scene, seen_from(at_frame(plain(state), 0), CameraPreset.EYES_A))
    through_b = scene_picture(scene, seen_from(at_frame(plain(state), 0), CameraPreset.EYES_B))
    middle = np.s_[60:180, 120:200]
    assert orange(through_a)[middle].sum() > blue(through_a)[middle].sum()
    assert blue(through_b)[middle].sum() > orange(through_b)[middle].sum()
    back = scene_picture(scene, at_frame(plain(state), 0))
    rows = np.nonzero(blue(back))[0]
    assert rows.min() < 40  # the head is there again


def test_layers_come_and_go(scene: Scene3D, state: ViewerState, result: api.Result) -> None:
    sides = result.segment("raise").volumes()
    volumes = part_of(sides[0], "hand"), part_of(sides[1], "hand")
    bare = replace(walking(state), layers=frozenset())
    empty = scene_picture(scene, bare)
    for layer in Layer:
        shown = scene_picture(scene, replace(bare, layers=frozenset({layer})), volumes)
        assert (shown != empty).any(-1).sum() > 20, layer
    again = scene_picture(scene, bare, volumes)
    assert (again != empty).any(-1).sum() == 0


def walking(state: ViewerState) -> ViewerState:
    """They go along both in the scene and in their captures."""
    material = state.material
    steps = np.arange(material.n_frames)[:, None] * np.array([0.04, 0.02, 0.0])
    tracks = {name: replace(track, placements=track.placements + steps) for name, track in material.tracks.items()}
    cast = {name: replace(actor, centres=actor.centres - steps[:, :2]) for name, actor in material.cast.items()}
    return replace(state, material=replace(material, tracks=tracks, cast=cast))


def test_volumes_are_coloured_by_time_or_by_label(scene: Scene3D, state: ViewerState, result: api.Result) -> None:
    sides = result.segment("raise").volumes()
    volumes = part_of(sides[0], "hand"), part_of(sides[1], "hand")
    only = replace(state, layers=frozenset({Layer.VOLUMES}))
    times = scene_picture(scene, only, volumes)
    labels = scene_picture(scene, replace(only, colouring=Colouring.LABEL), volumes)
    yellow = (times[..., 0].astype(int) - times[..., 2] > 60) & (times[..., 1].astype(int) - times[..., 2] > 60)
    green = (labels[..., 1].astype(int) - labels[..., 0] > 40) & (labels[..., 1] > labels[..., 2])
    assert yellow.sum() > 30 and green.sum() > 30


@pytest.mark.parametrize("camera", CameraPreset)
def test_far_from_the_origin_all_is_seen_as_near_it(
    scene: Scene3D, state: ViewerState, result: api.Result, camera: CameraPreset
) -> None:
    sides = result.segment("raise").volumes()
    volumes = part_of(sides[0], "hand"), part_of(sides[1], "hand")
    near = replace(looked_at_row(with_table(walking(state)), 40), layers=frozenset(Layer), camera=camera)
    far = carried(near, np.array([500000.0, -300000.0, 0.0]))
    pictures = []
    for now in (near, far, near):
        scene.frames.clear()
        pictures.append(scene_picture(scene, now, volumes))
    seen, there, again = pictures
    assert not scene.origin.any() and (blue(seen).any() or orange(seen).any())
    for other in (there, again):
        assert (np.abs(seen.astype(int) - other).max(2) > 8).mean() < 0.002


def with_table(state: ViewerState) -> ViewerState:
    """A thing that stands beside them."""
    n = state.material.n_frames
    mesh = Mesh(np.array([(0, 0, 0), (0.4, 0, 0.4), (0, 0.4, 0.4)], np.float64), np.array([(0, 1, 2)], np.int32))
    turn = np.array([0.0, 0.0, 0.6, 0.8])
    edit = PropEdit("t.obj", "fixed", np.zeros(n, np.int64), np.tile([0.4, 0.9, 0.0], (n, 1)), np.tile(turn, (n, 1)))
    prop = SetPiece(MeshSequence("table", (0,), 30.0, lambda number: mesh), edit)
    return replace(state, material=replace(state.material, props={"table": prop}))


def carried(state: ViewerState, away: FloatArray) -> ViewerState:
    """All captures, and the scene, elsewhere; (3,) m."""

    def moved(sequence: MeshSequence) -> MeshSequence:
        def load(number: int) -> Mesh:
            mesh = sequence.load(number)
            return Mesh(mesh.vertices + away, mesh.faces, mesh.labels)

        return replace(sequence, load=load)

    material, back = state.material, -away
    cast = {
        name: replace(
            actor,
            sequence=moved(actor.sequence),
            things=tuple(moved(thing) for thing in actor.things),
            gaze=replace(actor.gaze, eye=actor.gaze.eye + away),
            centres=actor.centres + away[:2],
        )
        for name, actor in material.cast.items()
    }
    tracks = {
        name: replace(track, placements=compose(track.placements, back) + away)
        for name, track in material.tracks.items()
    }
    props = {}
    for name, prop in material.props.items():
        turned = rotation_matrices(prop.edit.rotations) @ away
        edit = replace(prop.edit, positions=prop.edit.positions - turned + away)
        props[name] = SetPiece(moved(prop.sequence), edit)
    segments = tuple(replace(view, frames=(view.frames[0] + away, view.frames[1] + away)) for view in material.segments)
    return replace(state, material=replace(material, cast=cast, tracks=tracks, segments=segments, props=props))


def test_a_capture_that_is_not_there_is_not_drawn(scene: Scene3D, state: ViewerState) -> None:
    scene.draw(plain(state))
    alone = replace(state.material, cast={"ben": state.material.cast["ben"]})
    picture = scene_picture(scene, replace(plain(state), material=alone))
    assert not blue(picture).any() and orange(picture).any()


def test_props_are_drawn_where_they_are(scene: Scene3D, state: ViewerState) -> None:
    corners = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
    mesh = Mesh(corners, np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)], np.int32))
    n, turn = state.material.n_frames, np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])  # a quarter about z
    places = np.outer(np.arange(n), [0.1, 0.0, 0.0]) + np.array([1.0, 2.0, 0.0])
    edit = PropEdit("box.obj", "simulated", np.zeros(n, np.int64), places, np.tile(turn, (n, 1)))
    prop = SetPiece(MeshSequence("box", (0,), 30.0, lambda number: mesh), edit)
    now = replace(state, material=replace(state.material, props={"box": prop}))
    for frame in (0, 5):
        scene.draw(at_frame(now, frame))
        placed = scene.plotter.actors["prop box"].user_matrix @ np.array([1.0, 0.0, 0.0, 1.0])
        np.testing.assert_allclose(placed[:3], [1.0 + 0.1 * frame, 3.0, 0.0], atol=1e-9)
    scene.draw(state)
    assert "prop box" not in scene.plotter.actors
