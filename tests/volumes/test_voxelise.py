"""Solid voxels against closed forms and against the generalised winding number."""

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.closed import has_no_boundary
from mhvedit.geometry.grid import VoxelGrid
from mhvedit.sequences.meshes import Mesh
from mhvedit.volumes.voxelise import SNAP, ray_votes, solid_voxels
from tests import oracles
from tests.oracles import Voxel
from tests.shapes import mesh_of

SEEDS = st.integers(0, 2**32 - 1)
SOME = settings(max_examples=12, derandomize=True)


def voxels(mesh: Mesh, pitch: float) -> set[Voxel]:
    grid, filled = solid_voxels(mesh, pitch)
    return {(int(x), int(y), int(z)) for x, y, z in np.argwhere(filled) + grid.start}


def centres(grid: VoxelGrid) -> FloatArray:
    return np.stack(np.meshgrid(*map(grid.axis, range(3)), indexing="ij"), -1).reshape(-1, 3)


def by_winding_number(mesh: Mesh, grid: VoxelGrid) -> BoolArray:
    """What lies inside by brute force; an inside-out mesh has the same inside."""
    winding = oracles.winding_numbers(centres(grid), mesh.vertices, mesh.faces)
    return np.asarray(np.abs(winding).reshape(grid.shape) > 0.5)


def shares_wrong(mesh: Mesh, sound: Mesh, pitch: float) -> float:
    """Voxels in which a damaged mesh differs from the sound one, as a share of the sound one's."""
    damaged, right = voxels(mesh, pitch), voxels(sound, pitch)
    return len(damaged ^ right) / len(right)


# Closed forms


@pytest.mark.parametrize("shift", [-0.3, 0.0, 0.13, 0.5])
def test_a_box_off_the_lattice_holds_the_voxels_whose_centres_it_holds(shift: float) -> None:
    box = trimesh.creation.box((0.35, 0.5, 0.21)).apply_translation([shift, -shift, 1.004])
    mesh, pitch = mesh_of(box), 0.04
    grid, filled = solid_voxels(mesh, pitch)
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    inside = ((centres(grid) > low) & (centres(grid) < high)).all(1).reshape(grid.shape)
    np.testing.assert_array_equal(filled, inside)


@pytest.mark.parametrize("pitch", [1 / 64, 0.25])
@pytest.mark.parametrize("start", [-7, 0, 3])
def test_a_box_with_its_faces_on_lattice_planes_has_exactly_its_volume(pitch: float, start: int) -> None:
    """Each voxel on a face belongs to one of the two boxes that share it."""
    unit = np.asarray(trimesh.creation.box((1, 1, 1)).vertices) + 0.5
    faces = np.asarray(trimesh.creation.box((1, 1, 1)).faces, np.int32)
    mesh = Mesh((unit * [3, 4, 5] + start) * pitch, faces)
    expected = {(start + x, start + y, start + z) for x, y, z in np.ndindex(3, 4, 5)}
    assert voxels(mesh, pitch) == expected
    soup = Mesh(mesh.vertices[faces].reshape(-1, 3), np.arange(36, dtype=np.int32).reshape(-1, 3))
    assert voxels(soup, pitch) == expected


@pytest.mark.parametrize("pitch", [0.01, 0.02, 0.03])
def test_boxes_on_lattice_planes_have_their_volume_at_any_pitch(pitch: float) -> None:
    box = trimesh.creation.box((1, 1, 1))
    unit, faces = np.asarray(box.vertices) + 0.5, np.asarray(box.faces, np.int32)
    for start in range(-30, 30):
        assert len(voxels(Mesh((unit * 5 + start) * pitch, faces), pitch)) == 125


@pytest.mark.parametrize("pitch", [0.02, 0.05])
def test_a_sphere_has_its_volume_within_the_error_of_its_shell(pitch: float) -> None:
    radius = 0.4
    ball = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    grid, filled = solid_voxels(mesh_of(ball), pitch)
    far = np.linalg.norm(centres(grid), axis=1).reshape(grid.shape)
    flat = radius - np.linalg.norm(ball.triangles_center, axis=1).min()  # how far faces cut below the sphere
    assert filled[far < radius - flat].all() and not filled[far > radius].any()
    shell = 4 * np.pi * radius**2 * (flat + 0.1 * pitch)
    assert filled.sum() * pitch**3 == pytest.approx(4 / 3 * np.pi * radius**3, abs=shell)


# The winding number


def ball_at(rng: np.random.Generator, radius: float = 0.3) -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    return ball.apply_transform(anywhere(rng))


def two_overlapping_balls(rng: np.random.Generator) -> trimesh.Trimesh:
    other = trimesh.creation.icosphere(subdivisions=1, radius=0.2).apply_translation([0.25, 0.05, 0])
    return trimesh.util.concatenate([trimesh.creation.icosphere(subdivisions=1, radius=0.25), other]).apply_transform(
        anywhere(rng)
    )


def ring(rng: np.random.Generator) -> trimesh.Trimesh:
    return trimesh.creation.annulus(0.15, 0.3, 0.25, sections=12).apply_transform(anywhere(rng))


def box(rng: np.random.Generator) -> trimesh.Trimesh:
    return trimesh.creation.box((0.4, 0.3, 0.2)).apply_transform(anywhere(rng))


def ball_with_a_cavity(rng: np.random.Generator) -> trimesh.Trimesh:
    inner = trimesh.creation.icosphere(subdivisions=1, radius=0.15)
    inner.invert()
    return trimesh.util.concatenate([trimesh.creation.icosphere(subdivisions=1, radius=0.3), inner]).apply_transform(
        anywhere(rng)
    )


def dented_ball(rng: np.random.Generator) -> trimesh.Trimesh:
    """A star-shaped solid: a ball whose corners are pulled in and out."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.25)
    ball.vertices = np.asarray(ball.vertices) * rng.uniform(0.6, 1.3, (len(ball.vertices), 1))
    return ball.apply_transform(anywhere(rng))


def anywhere(rng: np.random.Generator) -> FloatArray:
    motion = trimesh.transformations.random_rotation_matrix(rng.random(3))
    motion[:3, 3] = rng.uniform(-1, 1, 3)
    return np.asarray(motion)


SOLIDS = [ball_at, two_overlapping_balls, ring, box, ball_with_a_cavity, dented_ball]


@pytest.mark.parametrize("solid", SOLIDS)
@given(seed=SEEDS)
@settings(SOME, max_examples=6)
def test_closed_meshes_are_filled_where_the_winding_number_says(
    solid: Callable[[np.random.Generator], trimesh.Trimesh], seed: int
) -> None:
    mesh = mesh_of(solid(np.random.default_rng(seed)))
    grid, filled = solid_voxels(mesh, 0.04)
    assert filled.any()
    np.testing.assert_array_equal(filled, by_winding_number(mesh, grid))


@given(seed=SEEDS)
@SOME
def test_the_six_rays_agree_on_a_closed_mesh(seed: int) -> None:
    mesh = mesh_of(dented_ball(np.random.default_rng(seed)))
    grid, filled = solid_voxels(mesh, 0.04)
    for axis in range(3):
        votes = ray_votes(mesh.vertices / 0.04 - np.array(grid.start), mesh.faces, grid.shape, axis=axis)
        np.testing.assert_array_equal(votes, 2 * filled.astype(np.uint8))


@given(seed=SEEDS, shift=st.tuples(*[st.integers(-40, 40)] * 3))
@SOME
def test_shifting_by_whole_voxels_shifts_the_voxels(seed: int, shift: tuple[int, int, int]) -> None:
    mesh = mesh_of(two_overlapping_balls(np.random.default_rng(seed)))
    moved = Mesh(mesh.vertices + np.array(shift) * 0.03, mesh.faces)
    expected = {(x + shift[0], y + shift[1], z + shift[2]) for x, y, z in voxels(mesh, 0.03)}
    assert voxels(moved, 0.03) == expected


@given(seed=SEEDS)
@SOME
def test_quarter_turns_turn_the_voxels(seed: int) -> None:
    mesh = mesh_of(dented_ball(np.random.default_rng(seed)))
    x, y, z = mesh.vertices.T
    turned = Mesh(np.stack([-y, x, z], 1), mesh.faces)
    tipped = Mesh(np.stack([y, z, x], 1), mesh.faces)
    assert voxels(turned, 0.04) == {(-y, x, z) for x, y, z in voxels(mesh, 0.04)}
    assert voxels(tipped, 0.04) == {(y, z, x) for x, y, z in voxels(mesh, 0.04)}


# The vote of six rays

Corner = tuple[int, int, int]  # in 1/65536 of a voxel


def above(triangle: list[Corner], axis: int, column: tuple[int, int]) -> tuple[Fraction, int] | None:
    """Height (voxels) and sign at which a column goes through a triangle.

    Whether it does is asked of the column nudged by (eps, eps^2), in whole numbers of eps^2.
    """
    eps = 2**60
    flat = [(corner[(axis + 1) % 3], corner[(axis + 2) % 3]) for corner in triangle]
    a, b, c = [(u * eps * eps, v * eps * eps) for u, v in flat]
    nudged = (column[0] * SNAP * eps * eps + eps, column[1] * SNAP * eps * eps + 1)
    sides = [cross(start, end, nudged) for start, end in ((a, b), (b, c), (c, a))]
    if min(sides) <= 0 <= max(sides):
        return None
    a, b, c = flat
    there = (column[0] * SNAP, column[1] * SNAP)
    parts = [cross(b, c, there), cross(c, a, there), cross(a, b, there)]
    height = Fraction(sum(part * corner[axis] for part, corner in zip(parts, triangle, strict=True)), sum(parts) * SNAP)
    return height, -1 if sides[0] > 0 else 1


def cross(start: tuple[int, int], end: tuple[int, int], point: tuple[int, int]) -> int:
    """Twice the area of a triangle in the plane."""
    return (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])


def votes_by_hand(mesh: Mesh, grid: VoxelGrid, axis: int) -> IntArray:
    """The votes of all rays along an axis, in whole numbers; corners lie on the sub-voxel lattice, pitch is 1."""
    corners = [tuple(round(x * SNAP) for x in corner) for corner in mesh.vertices.tolist()]
    votes = np.zeros(grid.shape, np.int64)
    order = [(axis + 1) % 3, (axis + 2) % 3, axis]
    along = np.moveaxis(votes, order, [0, 1, 2])
    start = [grid.start[k] for k in order]
    for u, v in np.ndindex(along.shape[:2]):
        met = [above([corners[c] for c in face], axis, (u + start[0], v + start[1])) for face in mesh.faces.tolist()]
        crossings = [(height - start[2], sign) for height, sign in filter(None, met)]
        along[u, v] = votes_of_column(crossings, along.shape[2])
    return votes


def votes_of_column(crossings: list[tuple[Fraction, int]], n: int) -> list[int]:
    """How many of the two rays through a column see each of its voxels inside."""
    crossings = sorted(crossings, key=lambda crossing: crossing[0])
    sums = [sum(sign for _, sign in crossings[:k]) for k in range(len(crossings) + 1)]
    sound = sums[-1] == 0 and (min(sums) >= 0 or max(sums) <= 0)
    votes = []
    for w in range(n):
        below = sum(height <= w for height, _ in crossings)
        parity = below % 2 + (len(crossings) - below) % 2
        votes.append((2 if sums[below] else 0) if sound else parity)
    return votes


def soup(rng: np.random.Generator, lattice: IntArray | int) -> Mesh:
    """Triangles between any corners: open, flipped, crossing, degenerate; corners on multiples of some sub-voxels."""
    corners = rng.integers(0, 4 * SNAP // lattice, (10, 3)) * lattice
    return Mesh(corners / SNAP, rng.integers(0, 10, (15, 3)).astype(np.int32))


@given(seed=SEEDS)
@SOME
def test_any_soup_of_triangles_is_voted_on_as_six_rays_do(seed: int) -> None:
    mesh = soup(np.random.default_rng(seed), 1)
    grid, filled = solid_voxels(mesh, 1.0)
    assert not has_no_boundary(mesh.faces)
    np.testing.assert_array_equal(filled, sum(votes_by_hand(mesh, grid, axis) for axis in range(3)) >= 4)


@given(seed=SEEDS, axis=st.integers(0, 2), share=st.sampled_from([1, 2]))
@settings(SOME, max_examples=24)
def test_rays_through_corners_and_along_edges_count_each_surface_once(seed: int, axis: int, share: int) -> None:
    lattice = np.full(3, SNAP // share)
    lattice[axis] = 1  # heights on the lattice are another matter: rounding may put them on either side
    mesh = soup(np.random.default_rng(seed), lattice)
    grid, _ = solid_voxels(mesh, 1.0)
    votes = ray_votes(mesh.vertices - np.array(grid.start), mesh.faces, grid.shape, axis=axis)
    np.testing.assert_array_equal(votes, votes_by_hand(mesh, grid, axis))


# What real captures have


@given(seed=SEEDS)
@SOME
def test_holes_of_two_in_a_hundred_faces_change_less_than_one_voxel_in_a_hundred(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sound = mesh_of(trimesh.creation.icosphere(subdivisions=4, radius=0.3).apply_transform(anywhere(rng)))
    torn = Mesh(sound.vertices, sound.faces[rng.random(len(sound.faces)) >= 0.02])
    assert not has_no_boundary(torn.faces)
    assert shares_wrong(torn, sound, 0.02) < 0.01


@given(seed=SEEDS)
@SOME
def test_flipped_faces_change_less_than_one_voxel_in_a_hundred(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sound = mesh_of(trimesh.creation.icosphere(subdivisions=4, radius=0.3).apply_transform(anywhere(rng)))
    faces = sound.faces.copy()
    flip = rng.random(len(faces)) < 0.02
    faces[flip] = faces[flip][:, ::-1]
    assert shares_wrong(Mesh(sound.vertices, faces), sound, 0.02) < 0.01


@pytest.mark.parametrize("solid", [solid for solid in SOLIDS if solid is not two_overlapping_balls])
def test_a_mesh_inside_out_has_the_same_inside(solid: Callable[[np.random.Generator], trimesh.Trimesh]) -> None:
    mesh = mesh_of(solid(np.random.default_rng(4)))
    assert voxels(Mesh(mesh.vertices, mesh.faces[:, ::-1]), 0.03) == voxels(mesh, 0.03)


def test_overlapping_solids_inside_out_have_the_same_inside() -> None:
    mesh = mesh_of(two_overlapping_balls(np.random.default_rng(4)))
    assert voxels(Mesh(mesh.vertices, mesh.faces[:, ::-1]), 0.03) == voxels(mesh, 0.03)


def test_a_floating_bit_adds_its_own_voxels_and_changes_no_other() -> None:
    rng = np.random.default_rng(2)
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.3).apply_transform(anywhere(rng))
    crumb = trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation(ball.centroid + np.array([0.05, 0.02, 0.7]))
    both = mesh_of(trimesh.util.concatenate([ball, crumb]))
    assert voxels(both, 0.03) == voxels(mesh_of(ball), 0.03) | voxels(mesh_of(crumb), 0.03)
    torn = Mesh(both.vertices, both.faces[5:])
    assert len(voxels(torn, 0.03) ^ voxels(both, 0.03)) < 0.01 * len(voxels(both, 0.03))


def test_duplicate_vertices_change_nothing() -> None:
    """A soup of triangles is all boundary, but each ray still crosses exactly one of two that share an edge."""
    mesh = mesh_of(dented_ball(np.random.default_rng(9)))
    soup = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size, dtype=np.int32).reshape(-1, 3))
    assert not has_no_boundary(soup.faces)
    assert voxels(soup, 0.03) == voxels(mesh, 0.03)


def test_degenerate_faces_change_nothing() -> None:
    mesh = mesh_of(dented_ball(np.random.default_rng(10)))
    a, b, c = mesh.faces[:3, 0]
    points, slivers = [[a, a, a], [b, b, c]], [[a, b, len(mesh.vertices)]]
    middle = (mesh.vertices[a] + mesh.vertices[b]) / 2
    thin = Mesh(np.vstack([mesh.vertices, middle]), np.vstack([mesh.faces, points, slivers]).astype(np.int32))
    assert has_no_boundary(np.vstack([mesh.faces, points]).astype(np.int32)) and not has_no_boundary(thin.faces)
    assert voxels(thin, 0.03) == voxels(mesh, 0.03)


def test_vertices_that_no_face_uses_only_widen_the_box() -> None:
    mesh = mesh_of(ball_at(np.random.default_rng(0)))
    stray = Mesh(np.vstack([mesh.vertices, [[3.0, 3, 3]]]), mesh.faces)
    assert voxels(stray, 0.05) == voxels(mesh, 0.05)


def test_a_mesh_without_faces_is_empty() -> None:
    assert voxels(Mesh(np.eye(3), np.zeros((0, 3), np.int32)), 0.1) == set()


def test_the_mesh_is_left_as_it_was() -> None:
    mesh = mesh_of(ball_at(np.random.default_rng(0)))
    mesh.vertices.flags.writeable = mesh.faces.flags.writeable = False
    assert voxels(mesh, 0.05)


# Boundaries


def test_closed_meshes_have_no_boundary_and_a_missing_or_flipped_face_makes_one() -> None:
    faces = np.asarray(trimesh.creation.icosphere(subdivisions=2).faces, np.int32)
    flipped = faces.copy()
    flipped[5] = flipped[5, ::-1]
    assert has_no_boundary(faces) and has_no_boundary(faces[:, ::-1])
    assert not has_no_boundary(faces[1:]) and not has_no_boundary(flipped)


def test_the_boundary_counts_directions_not_neighbours() -> None:
    """Two solids glued along an edge, four faces about it, are closed; a face taken twice is not."""
    faces = np.asarray(trimesh.creation.box((1, 1, 1)).faces, np.int32)
    a, b = int(faces[0, 0]), int(faces[0, 1])
    other = np.where(faces == a, a, np.where(faces == b, b, faces + 8)).astype(np.int32)
    assert has_no_boundary(np.vstack([faces, other]))
    assert not has_no_boundary(np.vstack([faces, faces[:1]]))
    assert has_no_boundary(np.vstack([faces, faces[:1], faces[:1, ::-1]]))
    assert has_no_boundary(np.zeros((0, 3), np.int32))
