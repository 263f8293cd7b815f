"""Bounds and shares of the area against closed forms and numpy."""

import numpy as np
import pytest
import trimesh

from mhvedit.geometry.arrays import Int32Array
from mhvedit.sequences.areas import area_shares, bounds
from mhvedit.sequences.meshes import Mesh


def test_shares_and_middles_of_random_triangles() -> None:
    rng = np.random.default_rng(2)
    mesh = Mesh(rng.normal(size=(40, 3)), rng.integers(0, 40, (90, 3)).astype(np.int32))
    share, middles = area_shares(mesh)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    np.testing.assert_allclose(share, area / area.sum(), rtol=1e-12)
    np.testing.assert_allclose(middles, (a + b + c) / 3, rtol=1e-12)
    assert share.sum() == pytest.approx(1)


def test_the_centroid_of_a_box_without_a_lid() -> None:
    box = trimesh.creation.box((2, 1, 3))
    open_box = box.faces[box.face_normals[:, 2] < 0.5]
    share, middles = area_shares(Mesh(np.asarray(box.vertices), np.asarray(open_box, np.int32)))
    walls = 2 * 3 * (2 + 1)
    assert share @ middles == pytest.approx([0, 0, -1.5 * 2 / (walls + 2)])


@pytest.mark.parametrize("faces", [np.zeros((0, 3), np.int32), np.array([[0, 1, 2], [1, 1, 0]], np.int32)])
def test_nothing_has_no_share(faces: Int32Array) -> None:
    share, middles = area_shares(Mesh(np.ones((3, 3)), faces))
    assert not share.any() and len(share) == len(middles) == len(faces)


def test_bounds() -> None:
    points = np.random.default_rng(1).normal(size=(100, 3))
    low, high = bounds(points)
    assert (low == points.min(0)).all() and (high == points.max(0)).all()
    assert [x.tolist() for x in bounds(points[:1])] == [points[0].tolist()] * 2
