"""Gaze: the eyes and the front of a head of known shape, equivariance, tracks that are given."""

import numpy as np
import pytest
import trimesh

from mhvedit.errors import SceneError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose, rotation
from mhvedit.sequences.bodies import track_body
from mhvedit.sequences.body_model import rotation_from_vector
from mhvedit.sequences.gaze import gaze_from_tracks, gaze_of_body
from mhvedit.sequences.meshes import Gaze, JointTracks, Mesh, MeshSequence
from tests.shapes import mesh_of

TRUNK = (  # ellipsoids of a person who looks along +x: centre, half axes
    ((0.0, 0.0, 1.05), (0.11, 0.17, 0.22)),
    ((0.0, 0.0, 1.32), (0.11, 0.19, 0.15)),
    ((0.0, 0.23, 1.14), (0.05, 0.05, 0.30)),
    ((0.0, -0.23, 1.14), (0.05, 0.05, 0.30)),
    ((0.0, 0.10, 0.68), (0.08, 0.08, 0.26)),
    ((0.0, -0.10, 0.68), (0.08, 0.08, 0.26)),
    ((-0.01, 0.10, 0.27), (0.055, 0.055, 0.24)),
    ((-0.01, -0.10, 0.27), (0.055, 0.055, 0.24)),
    ((0.05, 0.10, 0.04), (0.13, 0.045, 0.04)),
    ((0.05, -0.10, 0.04), (0.13, 0.045, 0.04)),
)
HEAD = (  # skull, face, nose, neck, about the middle between the ears
    ((0.0, 0.0, 0.02), (0.098, 0.076, 0.085)),
    ((0.045, 0.0, -0.05), (0.045, 0.05, 0.065)),
    ((0.10, 0.0, -0.04), (0.02, 0.012, 0.02)),
    ((-0.025, 0.0, -0.12), (0.055, 0.055, 0.11)),
)
SKULL = np.array([0.0, 0.0, 1.65])


def figure(turn: float, nod: float = 0.0) -> Mesh:
    head = rotation_from_vector(np.array([0.0, 0.0, turn])) @ rotation_from_vector(np.array([0.0, nod, 0.0]))
    balls = []
    for centre, axes in TRUNK:
        balls.append(trimesh.creation.icosphere(subdivisions=2))
        balls[-1].vertices = balls[-1].vertices * axes + centre
    for centre, axes in HEAD:
        balls.append(trimesh.creation.icosphere(subdivisions=3))
        balls[-1].vertices = (balls[-1].vertices * axes + centre) @ head.T + SKULL
    return mesh_of(trimesh.util.concatenate(balls))


def sequence(mesh: Mesh) -> MeshSequence:
    return MeshSequence("figure", (5,), 25.0, lambda _: mesh)


def gaze_of(capture: MeshSequence, *, yaw: float) -> Gaze:
    return gaze_of_body(capture, track_body(capture, yaw=np.array([yaw])))


@pytest.mark.parametrize(("turn", "nod"), [(0.0, 0.0), (0.5, 0.0), (-0.6, 0.0), (0.0, 0.3)])
def test_the_gaze_is_where_the_face_points(turn: float, nod: float) -> None:
    gaze = gaze_of(sequence(figure(turn, nod)), yaw=0.0)
    truth = np.array([np.cos(turn) * np.cos(nod), np.sin(turn) * np.cos(nod), -np.sin(nod)])
    assert np.degrees(np.arccos(gaze.direction[0] @ truth)) < 15
    assert np.linalg.norm(gaze.eye[0] - SKULL - 0.09 * truth) < 0.035
    assert gaze.numbers.tolist() == [5]


def test_the_gaze_turns_and_shifts_with_the_capture() -> None:
    mesh, pose = figure(0.3), np.array([4.0, -9.0, 2.0])
    gaze = gaze_of(sequence(mesh), yaw=0.1)
    moved = gaze_of(sequence(Mesh(apply_pose(pose, mesh.vertices), mesh.faces)), yaw=2.1)
    assert moved.eye == pytest.approx(apply_pose(pose, gaze.eye), abs=1e-6)
    assert moved.direction[0, :2] == pytest.approx(rotation(2.0) @ gaze.direction[0, :2], abs=1e-6)
    assert moved.direction[0, 2] == pytest.approx(gaze.direction[0, 2], abs=1e-6)


def track(numbers: list[int], joints: tuple[str, ...], positions: FloatArray) -> JointTracks:
    return JointTracks(np.array(numbers), joints, positions)


def test_given_tracks_are_joined_where_both_have_a_frame() -> None:
    eye = track([0, 1, 2], ("hat", "eye"), np.tile([[9.0, 9.0, 9.0], [0.0, 0.0, 1.6]], (3, 1, 1)))
    target = track([1, 2, 3], ("ball",), np.array([[[2.0, 0, 1.6]], [[0, 3.0, 1.6]], [[1.0, 1, 1]]]))
    gaze = gaze_from_tracks(eye, target)
    assert gaze.numbers.tolist() == [1, 2]
    assert gaze.eye == pytest.approx(np.tile([0.0, 0.0, 1.6], (2, 1)))
    assert gaze.direction == pytest.approx(np.array([[1.0, 0, 0], [0, 1.0, 0]]))


def test_tracks_without_a_direction_are_refused() -> None:
    eye = track([0], ("eye",), np.zeros((1, 1, 3)))
    with pytest.raises(SceneError, match="frame 0"):
        gaze_from_tracks(eye, track([0], ("target",), np.zeros((1, 1, 3))))
    with pytest.raises(SceneError, match="both eye and target"):
        gaze_from_tracks(eye, track([1], ("target",), np.ones((1, 1, 3))))
    with pytest.raises(SceneError, match="`target`"):
        gaze_from_tracks(eye, track([0], ("a", "b"), np.ones((1, 2, 3))))
