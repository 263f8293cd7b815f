from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from pytest import approx

from mhvedit.collision.triangles import triangle_intersections, triangles_meet
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray
from tests.collision import exact

PAIRS = Path(__file__).resolve().parents[3] / "shared" / "data" / "tritri" / "pairs.npz"
HALF: list[list[float]] = [[0, 0, 0], [0, 1, 0], [1, 0, 0]]  # a right triangle in the plane z = 0
FLAT: list[list[float]] = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]

# The cases of CGAL's test of two triangles: what they have in common is "area", "segment", "point" or "nothing".
Case = tuple[str, list[list[float]], list[list[float]], str]
COPLANAR: list[Case] = [
    ("same", HALF, HALF, "area"),
    ("larger, three corners on edges", HALF, [[0, 0, 0], [0, 2, 0], [2, 0, 0]], "area"),
    ("two corners on edges", HALF, [[0.25, 0.25, 0], [0, 0.25, 0], [0.25, 0, 0]], "area"),
    ("three corners on edges", HALF, [[0.5, 0.5, 0], [0, 0.25, 0], [0.25, 0, 0]], "area"),
    ("inside", HALF, [[0.25, 0.25, 0], [0.25, 0.3, 0], [0.3, 0.25, 0]], "area"),
    ("one edge in common", HALF, [[0, 0, 0], [0, 1, 0], [0.1, 0.1, 0]], "area"),
    ("edge in edge, one corner in common", HALF, [[0, 0, 0], [0, 0.9, 0], [0.1, 0.1, 0]], "area"),
    ("edge in edge", HALF, [[0, 0.1, 0], [0, 0.9, 0], [0.1, 0.1, 0]], "area"),
    ("one corner inside", HALF, [[0, -1, 0], [0.25, 0.25, 0], [1, -1, 0]], "area"),
    ("a corner of each inside", HALF, [[0, -1, 0], [0, 0.25, 0], [1, -1, 0]], "area"),
    ("one corner on an edge", HALF, [[-1, -1, 0], [0.25, 0.25, 0], [0.25, -1, 0]], "area"),
    (
        "two corners on edges of it",
        [[0, 0, 0], [0.5, 1, 0], [1, 0, 0]],
        [[-1, -1, 0], [0.5, 0.5, 0], [2, -1, 0]],
        "area",
    ),
    ("star", [[0, 0, 0], [1, 0, 0], [0.5, 1.5, 0]], [[0, 1, 0], [1, 1, 0], [0.5, -0.5, 0]], "area"),
    ("two tips", [[0, 0, 0], [1, 0, 0], [0.5, 1, 0]], [[0, 1, 0], [1, 1, 0], [0.5, 0, 0]], "area"),
    ("pierces two edges", FLAT, [[-0.1, 0.1, 0], [-0.1, 0.2, 0], [0.5, 0.8, 0]], "area"),
    ("edges in line, one corner in common", HALF, [[0, 0, 0], [-0.25, 0, 0], [0, -0.25, 0]], "point"),
    ("one corner in common", [[0, 0, 0], [0.1, 1, 0], [1, 0.1, 0]], [[0, 0, 0], [-0.25, 0, 0], [0, -0.25, 0]], "point"),
    ("corner on edge", HALF, [[0, 0.1, 0], [-0.25, 0.1, 0], [-0.25, -0.1, 0]], "point"),
    ("edge in common", HALF, [[0, 0, 0], [0, 1, 0], [-1, 0, 0]], "segment"),
    ("edge within edge", HALF, [[0, 0.1, 0], [0, 0.9, 0], [-1, 0, 0]], "segment"),
    ("edge within edge, corner in common", HALF, [[0, 0, 0], [0, 0.9, 0], [-1, 0, 0]], "segment"),
    ("edges overlap", HALF, [[0, -0.1, 0], [0, 0.9, 0], [-1, 0, 0]], "segment"),
    ("long edges overlap", [[-10, 0, 0], [10, 0, 0], [0, -3, 0]], [[-8, 0, 0], [12, 0, 0], [1, 5, 0]], "segment"),
    ("apart", HALF, [[-0.1, -0.1, 0], [-0.1, -0.9, 0], [-1, -0.1, 0]], "nothing"),
]
IN_SPACE: list[Case] = [
    ("through", HALF, [[0.1, 0.1, 1], [0.2, 0.1, 1], [0.25, 0.25, -1]], "segment"),
    ("edge in common, upright", FLAT, [[0, 0, 0], [1, 0, 0], [0, 0, 1]], "segment"),
    ("edge within edge, upright", FLAT, [[0.1, 0, 0], [0.9, 0, 0], [0, 0, 1]], "segment"),
    ("edge within edge from the corner", FLAT, [[0, 0, 0], [0.9, 0, 0], [0, 0, 1]], "segment"),
    ("edges overlap, upright", FLAT, [[-0.1, 0, 0], [0.9, 0, 0], [0, 0, 1]], "segment"),
    ("corner in common, upright", FLAT, [[0, 0, 0], [0.9, 0, 1], [0, 0, 1]], "point"),
    ("corner on edge, upright", FLAT, [[0.1, 0, 0], [0.9, 0, 1], [0, 0, 1]], "point"),
    ("corner inside", FLAT, [[0.1, 0.1, 0], [0.9, 0, 1], [0, 0, 1]], "point"),
    ("parallel", FLAT, [[0, 0, 1], [1, 0, 1], [0, 1, 1]], "nothing"),
    ("above", FLAT, [[0, 0, 1], [1, 0, 2], [0, 1, 1]], "nothing"),
    ("beside", [[0, 0, 0], [0, 1, 1], [0, 1, 0]], [[-1, -1, 0], [0, -1, 0], [-1, 0, 0]], "nothing"),
]


@pytest.mark.parametrize(("name", "a", "b", "common"), COPLANAR + IN_SPACE)
def test_special_positions(name: str, a: list[list[float]], b: list[list[float]], common: str) -> None:
    one, two = np.array(a, float), np.array(b, float)
    for first in permutations(range(3)):
        for second in permutations(range(3)):
            for p, q in ((one[list(first)], two[list(second)]), (two[list(second)], one[list(first)])):
                hit, ends = triangle_intersections(p, q)
                assert hit == (common != "nothing"), name
                length = np.linalg.norm(ends[1] - ends[0])
                assert np.isnan(length) if common == "nothing" else (length < 1e-12) == (common == "point"), name


def test_ten_thousand_random_pairs_are_all_right() -> None:
    if not PAIRS.exists():
        pytest.skip("the shared triangle pairs are not here")
    with np.load(PAIRS) as data:
        for name in ("intersecting", "separated"):
            a, b = data[name][:, :3], data[name][:, 3:]
            for p, q in ((a, b), (b, a), (a[:, ::-1], b), (np.roll(a, 1, 1), np.roll(b, 2, 1))):
                assert (triangles_meet(p, q) == (name == "intersecting")).all()


def test_degenerate_pairs_as_exact_arithmetic_has_them() -> None:
    corners = exact.random_degenerate_pairs(np.random.default_rng(0), 180)
    expected = [exact.triangles_meet(pair[:3], pair[3:]) for pair in corners]
    assert 50 < sum(expected) < 160
    for scale in (1.0, 2.0**-20, 2.0**30):
        assert triangles_meet(corners[:, :3] * scale, corners[:, 3:] * scale).tolist() == expected
        assert triangles_meet(corners[:, 3:] * scale, corners[:, :3] * scale).tolist() == expected


def test_nearly_touching_pairs_are_never_missed() -> None:
    """Decimal fractions round: where exact arithmetic on the rounded numbers says they meet, so do we."""
    corners = exact.random_degenerate_pairs(np.random.default_rng(1), 150) * 0.1 + 0.3
    found = triangles_meet(corners[:, :3], corners[:, 3:])
    for pair, ours in zip(corners, found, strict=True):
        assert ours or not exact.triangles_meet(pair[:3], pair[3:])


def test_the_common_segment_lies_on_both() -> None:
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(300, 3, 3)), rng.normal(size=(300, 3, 3))
    hit, ends = triangle_intersections(a, b)
    assert (hit == triangles_meet(a, b)).all()
    assert 20 < hit.sum() < 280
    for triangle in (a[hit], b[hit]):
        for k in range(2):
            assert _barycentric(triangle, ends[hit][:, k]).min() > -1e-9
            assert _off_plane(triangle, ends[hit][:, k]) == approx(0.0, abs=1e-9)


def test_triangles_of_the_wrong_shape_are_refused() -> None:
    with pytest.raises(ShapeError, match=r"triangles: expected \(..., 3, 3\) twice"):
        triangles_meet(np.zeros((2, 3)), np.zeros((2, 3)))


def _off_plane(triangles: FloatArray, points: FloatArray) -> FloatArray:
    """Distance from the planes."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(((points - triangles[:, 0]) * normal).sum(1) / np.linalg.norm(normal, axis=1))


def _barycentric(triangles: FloatArray, points: FloatArray) -> FloatArray:
    """(N, 3) weights of the corners."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    square = (normal * normal).sum(1)
    weights = []
    for k in range(3):
        p, q = triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        weights.append((np.cross(q - p, points - p) * normal).sum(1) / square)
    return np.stack(weights, 1)
