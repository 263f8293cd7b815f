"""Each kind of part against direct geometry on voxel centres, in the capture's frame."""

import numpy as np
import pytest

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.grid import VoxelGrid
from mhvedit.geometry.planar import rotation
from mhvedit.sequences.meshes import JointTracks, Mesh
from mhvedit.volumes.parts import (
    InBox,
    NearBones,
    NearTrack,
    Selection,
    WholeBody,
    WithLabel,
    distance_to_polyline,
    joint_positions,
    select_voxels,
)

PITCH = 0.05
GRID = VoxelGrid((-6, -4, 0), (14, 11, 9), PITCH)
FILLED = np.random.default_rng(0).random(GRID.shape) < 0.7
POSE = np.array([1.3, -0.4, 2.1])  # capture_from_canonical
JOINTS = ("shoulder", "elbow", "wrist", "knee")
SPOTS = np.array([[1.2, -0.5, 0.2], [1.3, -0.3, 0.3], [1.45, -0.35, 0.1], [1.1, -0.2, 0.05]])
TRACKS = JointTracks(np.array([3, 8]), JOINTS, np.stack([SPOTS + 9, SPOTS]))
PARENTS = (-1, 0, 1, 0)


def somebody(labels: bool = True) -> Mesh:
    vertices = np.random.default_rng(1).uniform([0.8, -0.9, 0], [1.8, 0.1, 0.4], (40, 3))
    return Mesh(vertices, np.zeros((0, 3), np.int32), np.arange(40, dtype=np.int32) % 4 if labels else None)


def capture_centres() -> FloatArray:
    """(X, Y, Z, 3) voxel centres in the capture's frame, p' = Rz(yaw) p + (x, y, 0)."""
    centres = np.stack(np.meshgrid(*map(GRID.axis, range(3)), indexing="ij"), -1)
    centres[..., :2] = centres[..., :2] @ rotation(POSE[2]).T + POSE[:2]
    return centres


def chosen(part: Selection, *, number: int = 8, mesh: Mesh | None = None) -> BoolArray:
    return select_voxels(part, GRID, FILLED, mesh=mesh or somebody(), number=number, pose=POSE)


def distance_to_segment(point: FloatArray, start: FloatArray, end: FloatArray) -> float:
    """By sampling the segment finely: plain, and good to a micrometre here."""
    samples = start + np.linspace(0, 1, 2001)[:, None] * (end - start)
    return float(np.linalg.norm(samples - point, axis=1).min())


def where(test: object) -> BoolArray:
    """Filled voxels whose centre passes a test."""
    centres = capture_centres()
    out = np.zeros(GRID.shape, np.bool_)
    for cell in np.argwhere(FILLED):
        out[tuple(cell)] = test(centres[tuple(cell)])  # type: ignore[operator]
    return out


def test_the_whole_body_is_all_that_is_filled() -> None:
    np.testing.assert_array_equal(chosen(WholeBody()), FILLED)


def test_near_a_joint_is_what_lies_within_the_radius() -> None:
    found = chosen(NearTrack(TRACKS, ("elbow",), 0.16))
    np.testing.assert_array_equal(found, where(lambda p: np.linalg.norm(p - SPOTS[1]) < 0.16))
    assert 0 < found.sum() < FILLED.sum()


def test_near_several_joints_is_what_lies_near_the_polyline_through_them() -> None:
    found = chosen(NearTrack(TRACKS, ("shoulder", "elbow", "wrist"), 0.1))
    expected = where(
        lambda p: min(distance_to_segment(p, SPOTS[0], SPOTS[1]), distance_to_segment(p, SPOTS[1], SPOTS[2])) < 0.1
    )
    np.testing.assert_array_equal(found, expected)
    assert 0 < found.sum() < FILLED.sum()


def test_a_box_is_fixed_in_the_capture_frame_with_its_faces_in_it() -> None:
    centre, size = np.array([1.25, -0.35, 0.2]), np.array([0.3, 0.21, 0.2])
    found = chosen(InBox(centre, size))
    np.testing.assert_array_equal(found, where(lambda p: bool((abs(p - centre) <= size / 2).all())))
    assert 0 < found.sum() < FILLED.sum()
    upright = select_voxels(
        InBox(np.zeros(3), np.full(3, 2 * PITCH)), GRID, FILLED, mesh=somebody(), number=8, pose=np.zeros(3)
    )
    assert upright.sum() == FILLED[5:8, 3:6, 0:2].sum()


def test_a_label_takes_what_lies_nearest_to_a_vertex_that_has_it() -> None:
    mesh = somebody()
    found = chosen(WithLabel(2), mesh=mesh)
    nearest = where(lambda p: np.linalg.norm(mesh.vertices - p, axis=1).argmin() % 4 == 2)
    np.testing.assert_array_equal(found, nearest)
    everywhere = [chosen(WithLabel(label), mesh=mesh) for label in range(4)]
    np.testing.assert_array_equal(np.sum(everywhere, 0), FILLED.astype(int))


def test_a_label_that_no_vertex_has_and_a_mesh_without_labels_give_an_empty_part() -> None:
    assert not chosen(WithLabel(77)).any()
    assert not chosen(WithLabel(2), mesh=somebody(labels=False)).any()


def test_bones_take_what_lies_nearer_to_them_than_to_any_other() -> None:
    """A bone is named by the joint at its start: `elbow` is elbow to wrist, `shoulder` both bones that start there."""
    bones = {"upper arm": (0, 1), "lower arm": (1, 2), "thigh": (0, 3)}

    def nearest(p: FloatArray) -> str:
        return min(bones, key=lambda name: distance_to_segment(p, SPOTS[bones[name][0]], SPOTS[bones[name][1]]))

    found = chosen(NearBones(TRACKS, PARENTS, ("elbow",)))
    exact = where(lambda p: nearest(p) == "lower arm")
    # where the nearest point is the elbow itself both bones are equally far, and the named one gets it
    differs = np.argwhere(found != exact)
    for cell in differs:
        p = capture_centres()[tuple(cell)]
        assert found[tuple(cell)] and distance_to_segment(p, SPOTS[1], SPOTS[2]) == pytest.approx(
            distance_to_segment(p, SPOTS[0], SPOTS[1]), abs=1e-5
        )
    assert exact.any() and not exact[FILLED].all()
    np.testing.assert_array_equal(chosen(NearBones(TRACKS, PARENTS, ("shoulder", "elbow"))), FILLED)


@pytest.mark.parametrize("part", [NearTrack(TRACKS, ("elbow",), 0.16), NearBones(TRACKS, PARENTS, ("elbow",))])
def test_a_frame_that_the_tracks_lack_gives_an_empty_part(part: Selection) -> None:
    for number in (2, 5, 99):
        assert not chosen(part, number=number).any()


def test_a_joint_that_a_frame_lacks_gives_an_empty_part() -> None:
    positions = TRACKS.positions.copy()
    positions[1, 1] = np.nan
    gap = JointTracks(TRACKS.numbers, JOINTS, positions)
    assert not chosen(NearTrack(gap, ("elbow",), 0.3)).any()
    assert chosen(NearTrack(gap, ("wrist",), 0.3)).any()


def test_parts_of_nothing_are_nothing() -> None:
    nothing = np.zeros(GRID.shape, np.bool_)
    for part in (
        WholeBody(), NearTrack(TRACKS, ("elbow",), 1.0), InBox(SPOTS[0], np.ones(3)), WithLabel(1),
        NearBones(TRACKS, PARENTS, ("elbow",)),
    ):  # fmt: skip
        assert not select_voxels(part, GRID, nothing, mesh=somebody(), number=8, pose=POSE).any()


def test_joint_positions_come_in_the_order_asked_for() -> None:
    np.testing.assert_array_equal(joint_positions(TRACKS, ("wrist", "shoulder"), 8), SPOTS[[2, 0]])
    assert np.isnan(joint_positions(TRACKS, ("wrist",), 4)).all()


def test_distance_to_a_polyline_is_to_its_nearest_point() -> None:
    rng = np.random.default_rng(5)
    points, line = rng.normal(size=(50, 3)), rng.normal(size=(4, 3))
    expected = [min(distance_to_segment(p, line[i], line[i + 1]) for i in range(3)) for p in points]
    np.testing.assert_allclose(distance_to_polyline(points, line), expected, atol=1e-5)
    np.testing.assert_allclose(distance_to_polyline(points, line[:1]), np.linalg.norm(points - line[0], axis=1))
    np.testing.assert_allclose(distance_to_polyline(points, line[[0, 0]]), np.linalg.norm(points - line[0], axis=1))
    with pytest.raises(ShapeError, match="line"):
        distance_to_polyline(points, np.zeros((0, 3)))
