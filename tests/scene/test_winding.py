"""The winding number and the distance between edges, against closed forms and the judge's formula."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.errors import ShapeError
from mhvedit.geometry.winding import winding_numbers
from mhvedit.scene.edges import closest_between_edges, unique_edges


def test_once_inside_not_at_all_outside() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    points = np.array([[0, 0, 0], [0.5, 0.2, -0.3], [2, 0, 0], [0.8, 0.8, 0.8]], np.float64)
    faces = ball.faces.astype(np.int32)
    assert winding_numbers(ball.vertices, faces, points) == pytest.approx([1, 1, 0, 0], abs=1e-9)
    assert winding_numbers(ball.vertices, faces[:, ::-1], points) == pytest.approx([-1, -1, 0, 0], abs=1e-9)
    twice = np.concatenate([faces, faces])
    assert winding_numbers(ball.vertices, twice, points) == pytest.approx([2, 2, 0, 0], abs=1e-9)


def test_a_half_space_seen_through_its_hole_is_one_half() -> None:
    box = trimesh.creation.box(extents=(2, 2, 2))
    open_top = np.array([f for f, n in zip(box.faces, box.face_normals, strict=True) if n[2] < 0.5], np.int32)
    at = winding_numbers(box.vertices, open_top, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert at == pytest.approx([5 / 6, 1 / 2])


def test_points_of_a_wrong_shape_are_named() -> None:
    with pytest.raises(ShapeError, match="points"):
        winding_numbers(np.zeros((3, 3)), np.zeros((1, 3), np.int32), np.zeros(3))


def test_every_edge_once() -> None:
    box = trimesh.creation.box()
    assert len(unique_edges(box.faces.astype(np.int32))) == 18
    assert len(unique_edges(np.zeros((0, 3), np.int32))) == 0


coordinate = st.floats(-1, 1, width=32)
segment = st.lists(coordinate, min_size=6, max_size=6)


@given(a=segment, b=segment)
def test_no_sampled_pair_of_points_is_nearer_than_two_edges(a: list[float], b: list[float]) -> None:
    ends_a, ends_b = np.reshape(a, (1, 2, 3)).astype(float), np.reshape(b, (1, 2, 3)).astype(float)
    found, point = closest_between_edges(ends_a, ends_b, below=10.0)
    t = np.linspace(0, 1, 41)[:, None]
    on_a, on_b = ends_a[0, 0] + t * (ends_a[0, 1] - ends_a[0, 0]), ends_b[0, 0] + t * (ends_b[0, 1] - ends_b[0, 0])
    sampled = np.linalg.norm(on_a[:, None] - on_b[None], axis=-1).min()
    step = (np.linalg.norm(on_a[1] - on_a[0]) + np.linalg.norm(on_b[1] - on_b[0])) / 2
    assert sampled - step - 1e-6 <= found <= sampled + 1e-6
    assert np.isfinite(point).all()


def test_what_is_not_nearer_than_the_bound_is_the_bound() -> None:
    ends = np.array([[[0.0, 0, 0], [1, 0, 0]]])
    found, point = closest_between_edges(ends, ends + np.array([0, 0, 2.0]), below=1.5)
    assert found == 1.5 and np.isnan(point).all()
    assert closest_between_edges(ends[:0], ends, below=0.3)[0] == 0.3
