"""The canonical frame moves with the capture, so that nothing computed in it depends on the capture's world frame."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose, compose, wrap_angle
from mhvedit.sequences.canonical import capture_from_canonical, in_canonical_frame
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.volumes.history import history
from mhvedit.volumes.voxelise import solid_voxels

SHIFT = st.floats(-20, 20)
MOTIONS = st.tuples(SHIFT, SHIFT, st.floats(-7, 7))
SOME = settings(max_examples=25, derandomize=True)


def someone(seed: int = 0) -> Mesh:
    """A lopsided body: no symmetry in plan, so that its axis has a direction."""
    rng = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.3)
    vertices = np.asarray(ball.vertices) * [0.6, 0.35, 2.5] + [0, 0, 0.8]
    vertices[:, 0] += 0.8 * np.clip(vertices[:, 0], 0, None) ** 2 + 0.02 * np.sin(
        9 * vertices[:, 2] + rng.uniform(0, 6)
    )
    return Mesh(vertices, np.asarray(ball.faces, np.int32), np.arange(len(vertices), dtype=np.int32))


def captured(mesh: Mesh, motion: FloatArray) -> MeshSequence:
    moved = Mesh(apply_pose(motion, mesh.vertices), mesh.faces, mesh.labels)
    return MeshSequence("someone", (4, 7), 30.0, lambda number: moved if number == 4 else mesh)


@given(motion=MOTIONS)
@SOME
def test_the_canonical_frame_turns_and_shifts_with_the_capture(motion: tuple[float, float, float]) -> None:
    still = capture_from_canonical(captured(someone(), np.zeros(3)))
    moved = capture_from_canonical(captured(someone(), np.array(motion)))
    expected = compose(np.array(motion), still)
    np.testing.assert_allclose(moved[:2], expected[:2], atol=1e-9)
    assert wrap_angle(moved[2] - expected[2]) == pytest.approx(0, abs=1e-9)


@given(motion=MOTIONS)
@SOME
def test_volumes_in_the_canonical_frame_do_not_depend_on_the_capture_frame(motion: tuple[float, float, float]) -> None:
    volumes = []
    for placed in (np.zeros(3), np.array(motion)):
        sequence = captured(someone(), placed)
        mesh = in_canonical_frame(sequence.mesh(4), capture_from_canonical(sequence))
        volumes.append(history([solid_voxels(mesh, 0.03)]))
    assert volumes[0].grid == volumes[1].grid
    np.testing.assert_array_equal(volumes[0].frames, volumes[1].frames)


def test_the_origin_is_the_area_centroid_and_x_the_long_axis_towards_the_longer_tail() -> None:
    """A big block and a small one far to its side: the tail points to the small one."""
    blocks = trimesh.util.concatenate(
        [trimesh.creation.box((0.4, 0.4, 1)), trimesh.creation.box((0.1, 0.1, 1)).apply_translation([0, 2, 0])]
    )
    mesh = Mesh(np.asarray(blocks.vertices), np.asarray(blocks.faces, np.int32))
    x, y, yaw = capture_from_canonical(MeshSequence("blocks", (0,), 30.0, lambda number: mesh))
    big, small = 2 * 0.16 + 1.6, 2 * 0.01 + 0.4
    assert (x, y) == pytest.approx((0, 2 * small / (big + small)))
    assert yaw == pytest.approx(np.pi / 2)


def test_how_a_surface_is_cut_into_triangles_does_not_matter() -> None:
    """Area counts, not vertices: connectivity changes from frame to frame."""
    mesh = someone()
    fine = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).subdivide(np.arange(300))
    other = Mesh(np.asarray(fine.vertices), np.asarray(fine.faces, np.int32))
    np.testing.assert_allclose(
        capture_from_canonical(captured(other, np.zeros(3))),
        capture_from_canonical(captured(mesh, np.zeros(3))),
        atol=1e-3,
    )


def test_labels_and_faces_come_along_and_the_mesh_is_left_as_it_was() -> None:
    mesh = someone()
    mesh.vertices.flags.writeable = False
    placed = in_canonical_frame(mesh, np.array([1.0, 2, 3]))
    assert placed.faces is mesh.faces and placed.labels is mesh.labels
    np.testing.assert_allclose(apply_pose(np.array([1.0, 2, 3]), placed.vertices), mesh.vertices, atol=1e-12)
