import numpy as np
import pytest
import trimesh
from pytest import approx

from mhvedit.collision.filling import (
    as_spheres,
    convex_envelope,
    filled_one_by_one,
    filled_with_spheres,
    octree_spheres,
    quality,
)
from mhvedit.errors import ShapeError
from mhvedit.sequences.meshes import Mesh
from tests.shapes import mesh_of

BALL = mesh_of(trimesh.creation.icosphere(subdivisions=2, radius=0.1))
BAR = mesh_of(trimesh.creation.box((0.6, 0.1, 0.1)))
ASIDE = np.array([0.5, 0.0, 0.3])
RING = mesh_of(trimesh.creation.torus(0.2, 0.03))


def test_one_sphere_in_a_ball_is_the_ball() -> None:
    filling = filled_with_spheres(BALL, 1)
    assert filling.centres[0] == approx(np.zeros(3), abs=1e-3)
    assert filling.radii[0] == approx(0.1, abs=1e-3)
    result = quality(filling, BALL)
    assert result.coverage == 1.0
    assert result.protrusion < 0.006  # the mesh is inscribed
    assert result.count == 1


@pytest.mark.parametrize(("n_few", "n_many"), [(1, 3), (3, 6), (3, 24)])
def test_all_of_the_envelope_is_covered_and_more_spheres_protrude_less(n_few: int, n_many: int) -> None:
    few, many = (quality(filled_with_spheres(BAR, n), BAR) for n in (n_few, n_many))
    assert few.coverage == many.coverage == 1.0
    assert many.protrusion < few.protrusion
    assert (few.count, many.count) == (n_few, n_many)


def test_spheres_of_six_cubes_are_those_round_them() -> None:
    filling = filled_with_spheres(BAR, 6)
    assert np.sort(filling.centres[:, 0]) == approx(np.linspace(-0.25, 0.25, 6), abs=0.02)
    assert filling.radii == approx(np.full(6, 0.05 * np.sqrt(3)), abs=0.012)


def test_less_cover_protrudes_less() -> None:
    tight = quality(filled_with_spheres(BAR, 6, cover=0.9), BAR)
    assert 0.85 < tight.coverage < 1.0
    assert tight.protrusion < quality(filled_with_spheres(BAR, 6), BAR).protrusion


def test_the_envelope_of_a_ring_closes_its_hole() -> None:
    """B4.3: limbs must not pass through it between frames."""
    wrapped, open_ring = filled_with_spheres(convex_envelope([RING]), 20), filled_with_spheres(RING, 20)
    assert (np.linalg.norm(wrapped.centres, axis=1) - wrapped.radii).min() < 0
    assert (np.linalg.norm(open_ring.centres, axis=1) - open_ring.radii).min() > 0.08


def test_an_envelope_is_closed_convex_and_wound_outwards() -> None:
    hull = convex_envelope([BAR, Mesh(BALL.vertices + ASIDE, BALL.faces)])
    made = trimesh.Trimesh(hull.vertices, hull.faces, process=False)
    assert made.is_watertight
    assert made.volume > 0.006 + 0.004
    inner = np.concatenate([BAR.vertices, BALL.vertices + ASIDE])
    assert (((inner[:, None] - made.triangles_center) * made.face_normals).sum(2) < 1e-9).all()


def test_meshes_one_by_one_share_the_spheres_by_volume() -> None:
    far = Mesh(BALL.vertices + 4 * ASIDE, BALL.faces)
    filling = filled_one_by_one([BAR, far], 10)
    assert (filling.centres[:, 0] > 1).sum() == 4  # 4.0 of 10.0 litres
    assert len(filling.radii) == 10


@pytest.mark.parametrize("levels", [1, 2, 3, 4])
def test_an_octree_of_a_cube_is_all_its_octants(levels: int) -> None:
    cube = mesh_of(trimesh.creation.box((0.4, 0.4, 0.4)))
    filling = octree_spheres(cube, levels)
    assert len(filling.radii) == 8**levels
    assert filling.radii == approx(np.full(8**levels, 0.4 / 2**levels * np.sqrt(3) / 2))


def test_an_octree_covers_and_gets_tighter() -> None:
    results = [quality(octree_spheres(BALL, levels), BALL) for levels in (2, 3)]
    assert [r.coverage for r in results] == [1.0, 1.0]
    assert results[0].protrusion > results[1].protrusion
    assert len(octree_spheres(BAR, 2).radii) == 16  # a bar through the middle of 4 x 4 x 4


def test_equipment_moves_with_its_joint() -> None:
    spheres = as_spheres(filled_with_spheres(BAR, 4), "pack", 3, np.array([0.0, 0.0, 1.0]), 0)
    assert spheres.names == ("pack_1", "pack_2", "pack_3", "pack_4")
    assert spheres.centre[:, 2] == approx(np.full(4, -1.0), abs=0.02)
    assert set(spheres.joint) == {3}


@pytest.mark.parametrize("fill", [lambda m: filled_with_spheres(m, 4), lambda m: octree_spheres(m, 2)])
def test_an_open_mesh_is_refused_with_the_number_of_open_edges(fill) -> None:  # type: ignore[no-untyped-def] # noqa: ANN001
    with pytest.raises(ShapeError, match="equipment: expected a watertight mesh, or its convex envelope, found 3 open"):
        fill(Mesh(BAR.vertices, BAR.faces[1:]))


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ShapeError, match="without volume"):
        convex_envelope([Mesh(BAR.vertices * [1.0, 1.0, 0.0], BAR.faces)])
    with pytest.raises(ShapeError, match="at least 1 sphere, found 0"):
        filled_with_spheres(BAR, 0)
    with pytest.raises(ShapeError, match="levels: expected 1 to 4, found 5"):
        octree_spheres(BAR, 5)
