from pathlib import Path

import numpy as np
import pytest
import trimesh

from mhvedit.world.convex import check_solid, convex_pieces
from mhvedit.world.pieces import mass_properties, surface
from mhvedit.world.problems import WorldError
from tests.world.things import cube


def corner() -> trimesh.Trimesh:
    """Two walls at right angles, one closed mesh."""
    outline = np.array([[0, 0], [1, 0], [1, 0.2], [0.2, 0.2], [0.2, 1], [0, 1]])
    polygon = [*outline, *outline]
    vertices = np.array([[x, y, 0.0 if i < 6 else 1.0] for i, (x, y) in enumerate(polygon)])
    sides = [f for i in range(6) for f in ((i, (i + 1) % 6, 6 + i), ((i + 1) % 6, 6 + (i + 1) % 6, 6 + i))]
    cap = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [*sides, *[(a, c, b) for a, b, c in cap], *[(6 + a, 6 + b, 6 + c) for a, b, c in cap]]
    return trimesh.Trimesh(vertices, np.array(faces), process=False)


def test_a_convex_mesh_stays_one_piece() -> None:
    solid = cube(0.3)
    (piece,) = convex_pieces("cube", solid.points, solid.faces)
    assert mass_properties(piece).volume == pytest.approx(0.216)


def test_a_corner_becomes_pieces_that_fill_it_and_are_kept(tmp_path: Path) -> None:
    mesh = corner()
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32)
    pieces = convex_pieces("corner", vertices, faces, cache=tmp_path)
    assert len(pieces) >= 2
    assert sum(mass_properties(piece).volume for piece in pieces) == pytest.approx(mesh.volume, rel=0.02)
    (file,) = tmp_path.glob("convex-*.npz")
    again = convex_pieces("corner", vertices, faces, cache=tmp_path)
    assert all((a.points == b.points).all() for a, b in zip(pieces, again, strict=True))
    file.write_bytes(b"not an archive")
    rebuilt = convex_pieces("corner", vertices, faces, cache=tmp_path)
    assert all((a.points == b.points).all() for a, b in zip(pieces, rebuilt, strict=True))


def test_meshes_that_enclose_nothing() -> None:
    solid = cube(0.3)
    with pytest.raises(WorldError, match="cup: expected a closed mesh, found 3 open edges"):
        check_solid("cup", solid.points, solid.faces[1:])
    with pytest.raises(WorldError, match="faces looking outwards"):
        check_solid("inside out", solid.points, solid.faces[:, ::-1])
    with pytest.raises(WorldError, match="encloses a volume"):
        check_solid("flat", solid.points * [1.0, 1.0, 0.0], solid.faces)
    with pytest.raises(WorldError, match="finite vertices"):
        check_solid("nan", np.full_like(solid.points, np.nan), solid.faces)
    with pytest.raises(WorldError, match="triangles"):
        check_solid("points", solid.points, np.zeros((0, 3), np.int32))


def test_the_surface_of_a_piece_is_closed() -> None:
    vertices, faces = surface(cube(0.2))
    check_solid("cube", vertices, faces)
