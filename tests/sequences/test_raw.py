import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.errors import CaptureError
from mhvedit.sequences.raw import checked_mesh, same_places, triangulate

POINTS = np.eye(3)
FACE = np.array([[0, 1, 2]])


def fans(polygons: list[list[int]]) -> list[list[int]]:
    return [[p[0], p[i], p[i + 1]] for p in polygons for i in range(1, len(p) - 1)]


@given(st.lists(st.lists(st.integers(0, 50), min_size=3, max_size=7), min_size=1, max_size=12))
def test_polygons_become_fans_in_order(polygons: list[list[int]]) -> None:
    corners = np.array([c for p in polygons for c in p])
    assert triangulate(corners, np.array([len(p) for p in polygons])).tolist() == fans(polygons)


def test_type_of_vertices_is_kept() -> None:
    assert checked_mesh("f", POINTS.astype(np.float32), FACE).vertices.dtype == np.float32
    assert checked_mesh("f", POINTS, FACE).vertices.dtype == np.float64
    assert checked_mesh("f", POINTS.astype(np.int16), FACE).vertices.dtype == np.float64


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_vertices_must_be_finite(bad: float) -> None:
    points = POINTS.copy()
    points[1, 2] = bad
    with pytest.raises(
        CaptureError, match=rf"^f: expected finite vertices, found \(0, 1, {bad}\) at vertex 1 \(1 such\)"
    ):
        checked_mesh("f", points, FACE)


def test_faces_must_be_there() -> None:
    with pytest.raises(CaptureError, match="expected at least one face, found 3 vertices and no faces"):
        checked_mesh("f", POINTS, np.zeros((0, 3), int))


@pytest.mark.parametrize("index", [3, -1])
def test_faces_must_name_vertices(index: int) -> None:
    with pytest.raises(CaptureError, match=rf"face indices from 0 to 2, found \(0, 1, {index}\) in face 1"):
        checked_mesh("f", POINTS, np.array([[0, 1, 2], [0, 1, index]]))


@given(st.lists(st.tuples(*[st.sampled_from([0.0, -0.0, 1.0, -1.0, 0.5])] * 3), min_size=1, max_size=40))
def test_same_places_are_those_that_compare_equal(points: list[tuple[float, ...]]) -> None:
    seen = list(dict.fromkeys(tuple(x + 0.0 for x in p) for p in points))
    first, place = same_places(np.array(points))
    assert [tuple(np.array(points)[i]) for i in first] == seen
    assert [seen[i] for i in place] == [tuple(p) for p in points]
