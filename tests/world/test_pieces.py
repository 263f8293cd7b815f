import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.world.bodies import BodyClass, Pose, body_of_mesh, body_of_pieces
from mhvedit.world.materials import Materials, Surfaces, load_materials, materials_of
from mhvedit.world.pieces import (
    NO_FACES,
    Piece,
    box,
    capsule,
    ellipsoid,
    hull,
    mass_properties,
    mesh_mass,
    sphere,
    surface,
    together,
)
from mhvedit.world.problems import WorldError
from tests.world.things import MATERIALS, cube

NAMES = ("wood", "human", "metal")


def test_c4_6_table_1_and_its_symmetry() -> None:
    table = load_materials()
    rows = {("wood", "wood"): (0.3, 0.3), ("human", "wood"): (0.2, 0.2), ("wood", "metal"): (0.2, 0.1)}
    rows |= {("human", "human"): (0.1, 0.1), ("metal", "human"): (0.2, 0.1), ("metal", "metal"): (0.3, 0.1)}
    for (a, b), (restitution, friction) in rows.items():
        assert table.between(a, b) == table.between(b, a) == Surfaces(restitution, friction)
    assert {frozenset(pair) for pair in rows} == set(table.pairs)
    assert set(NAMES) == set(table.density)


@pytest.mark.parametrize("value", [-0.1, 1.1, float("nan")])
def test_restitution_is_from_0_to_1(value: float) -> None:
    with pytest.raises(WorldError, match="restitution: expected a number from 0 to 1"):
        Surfaces(value, 0.1)


def test_bad_tables() -> None:
    with pytest.raises(WorldError, match="friction"):
        Surfaces(0.1, -1.0)
    with pytest.raises(WorldError, match="density of air: expected a number above 0, found 0"):
        materials_of({"density": {"air": 0.0}, "pairs": []})
    with pytest.raises(WorldError, match='materials "wood" and "ice"'):
        load_materials().between("wood", "ice")


@pytest.mark.parametrize(
    "piece",
    [
        sphere(0.2, np.array([1.0, 2.0, 3.0])),
        capsule(np.zeros(3), np.array([0.1, 0.2, 0.5]), 0.1),
        box(np.zeros(3), np.array([1.0, 2.0, 3.0])),
        ellipsoid(np.ones(3), np.diag([0.1, 0.2, 0.3])),
    ],
    ids=["sphere", "capsule", "box", "ellipsoid"],
)
def test_masses_against_those_of_fine_meshes(piece: Piece) -> None:
    mesh = trimesh.Trimesh(*surface(piece))
    found, coarse = mass_properties(piece), 0.0 if piece.is_hull else 0.06
    assert found.volume == pytest.approx(mesh.volume, rel=coarse + 1e-9)
    assert found.centre == pytest.approx(mesh.center_mass, abs=1e-9)
    assert found.inertia == pytest.approx(
        mesh.moment_inertia, rel=coarse + 1e-7, abs=1e-9 + coarse * mesh.moment_inertia.max()
    )


def test_a_capsules_inertia_is_that_of_its_points() -> None:
    piece = capsule(np.zeros(3), np.array([0.0, 0.0, 0.4]), 0.1)
    rng = np.random.default_rng(0)
    points = rng.uniform([-0.1, -0.1, -0.1], [0.1, 0.1, 0.5], (400_000, 3))
    inside = np.linalg.norm(points - np.clip(points, [0, 0, 0], [0, 0, 0.4]), axis=1) < 0.1
    found = mass_properties(piece)
    away = points[inside] - found.centre
    sampled = (np.eye(3) * (away**2).sum(1)[:, None, None] - away[:, :, None] * away[:, None]).mean(0) * found.volume
    assert found.volume == pytest.approx(inside.mean() * 0.2 * 0.2 * 0.6, rel=0.01)
    assert found.inertia == pytest.approx(sampled, rel=0.01, abs=1e-5)


def test_two_halves_are_a_whole() -> None:
    halves = [box(np.zeros(3), np.array([1.0, 1.0, 1.0])), box(np.array([1.0, 0.0, 0.0]), np.array([2.0, 1.0, 1.0]))]
    whole, both = (
        mass_properties(box(np.zeros(3), np.array([2.0, 1.0, 1.0]))),
        together([mass_properties(h) for h in halves]),
    )
    assert both.volume == pytest.approx(whole.volume)
    assert both.inertia == pytest.approx(whole.inertia)


def test_a_mesh_turned_inside_out_has_a_negative_volume() -> None:
    mesh = cube(0.5)
    assert mesh_mass(mesh.points, mesh.faces[:, ::-1]).volume == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("points", "radius"),
    [(np.zeros((3, 3)), 0.1), (np.zeros((1, 3)), 0.0), (np.full((1, 3), np.nan), 0.1), (np.eye(4, 3), 0.1)],
)
def test_pieces_that_cannot_be(points: np.ndarray[tuple[int, int], np.dtype[np.float64]], radius: float) -> None:
    with pytest.raises(WorldError, match="piece: expected"):
        Piece(points, radius, NO_FACES)


def test_flat_hulls_and_turned_boxes() -> None:
    with pytest.raises(WorldError, match="points that span a volume"):
        hull(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]))
    with pytest.raises(WorldError, match="a low corner below the high one"):
        box(np.ones(3), np.zeros(3))


@given(mass=st.sampled_from([0.0, -1.0, float("inf"), float("nan")]))
def test_masses_that_cannot_be(mass: float) -> None:
    with pytest.raises(WorldError, match="mass of cube: expected a number above 0 kg"):
        body_of_pieces("cube", [cube(0.1)], MATERIALS, kind=BodyClass.SIMULATED, material="wood", mass=mass)


def test_a_bodys_frame_has_its_centre_of_mass_as_origin() -> None:
    body = body_of_pieces(
        "bar", [box(np.zeros(3), np.array([2.0, 1.0, 1.0]))], MATERIALS, kind=BodyClass.SIMULATED, material="wood"
    )
    assert body.mass == pytest.approx(1400.0)
    assert body.centre == pytest.approx([1.0, 0.5, 0.5])
    assert body.inertia == pytest.approx(np.diag([2.0, 5.0, 5.0]) * 1400 / 12)
    assert body.pieces[0].points.mean(0) == pytest.approx(np.zeros(3))


def test_unknown_materials_and_no_pieces() -> None:
    with pytest.raises(WorldError, match="material of cube: expected one of human, metal, wood, found cheese"):
        body_of_pieces("cube", [cube(0.1)], MATERIALS, kind=BodyClass.FIXED, material="cheese")
    with pytest.raises(WorldError, match="at least one convex piece"):
        body_of_pieces("cube", [], MATERIALS, kind=BodyClass.FIXED, material="wood")


def test_poses_that_cannot_be() -> None:
    for rotation, position in ((2 * np.eye(3), np.zeros(3)), (np.diag([1.0, 1, -1]), np.zeros(3))):
        with pytest.raises(WorldError, match="pose: expected a rotation"):
            Pose(rotation, position)
    with pytest.raises(WorldError, match="finite numbers"):
        Pose(np.eye(3), np.full(3, np.nan))
    with pytest.raises(WorldError, match="a place within 10000 m of the origin"):
        Pose(np.eye(3), np.array([2e4, 0.0, 0.0]))


def test_mesh_and_pieces_are_the_same_body() -> None:
    solid = cube(0.1)
    mesh = body_of_mesh("cube", solid.points, solid.faces, MATERIALS, kind=BodyClass.SIMULATED, material="metal")
    pieces = body_of_pieces(
        "cube", [solid], Materials({"metal": 7850.0}, {}), kind=BodyClass.SIMULATED, material="metal"
    )
    assert mesh.mass == pytest.approx(pieces.mass)
    assert mesh.inertia == pytest.approx(pieces.inertia)
