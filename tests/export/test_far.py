"""Scenes far from the origin, read back with other people's libraries: as exact as near it."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Sdf, Usd

from mhvedit.export.content import ExportScene, Piece
from mhvedit.export.far import centred, is_far, scene_offset
from mhvedit.export.folder import MeshFormat, write_folder
from mhvedit.export.gltf import write_glb
from mhvedit.export.usd_edit import write_usd_edit
from mhvedit.export.usd_flat import write_flat_usd
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.offsets import without_offset
from mhvedit.geometry.planar import compose
from mhvedit.scene.edit import PropEdit
from mhvedit.sequences.meshes import BODY, Mesh, MeshSequence
from tests.export.checks import BITS_LOST
from tests.export.readers import Glb, moved, usd_shown, z_up
from tests.export.scenes import frame_mesh, scene_of
from tests.export.small import opened

AWAY = np.array([500000.4, -300000.3])  # m
SOURCE = [3, 3, 4, 6, 8, 6, 6, 7]
EXACT = 1e-6  # m: float32 of a small mesh
TURN = np.array([0.0, 0.0, 0.6, 0.8])


def told(stage: str, share: float) -> None:
    """Nobody listens."""


def carried(sequence: MeshSequence) -> MeshSequence:
    """The capture as if measured in survey coordinates."""

    def load(number: int) -> Mesh:
        mesh = sequence.load(number)
        return replace(mesh, vertices=without_offset(mesh.vertices, -AWAY))

    return replace(sequence, load=load)


def far_scene(captures: Path) -> ExportScene:
    """A person who holds something and walks a curve, and a prop; all far away, captures and world."""
    sequence, path = opened(captures, "ply")
    base = scene_of({"x": (carried(sequence), path)}, {"x": SOURCE})
    walked = compose(base.edit.subjects["x"].placements + np.array([*AWAY, 0.0]), np.array([*-AWAY, 0.0]))
    subject = replace(base.edit.subjects["x"], placements=walked)
    here = np.tile([*AWAY, 0.5], (len(SOURCE), 1))
    mesh = carried(sequence).mesh(3).vertices[0] * [1.0, 1.0, 0.0]
    turned = trimesh.transformations.quaternion_matrix([TURN[3], *TURN[:3]])[:3, :3] @ mesh
    prop = PropEdit("t.obj", "fixed", np.full(len(SOURCE), 3), here - turned, np.tile(TURN, (len(SOURCE), 1)))
    held = Piece("x", "stick", "x_stick", carried(sequence), path, "m", "z")
    table = Piece("table", BODY, "table", carried(sequence), path, "m", "z")
    edit = replace(base.edit, subjects={"x": subject}, props={"table": prop})
    return ExportScene(edit, (*base.pieces, held, table))


@pytest.fixture
def scene(captures: Path) -> ExportScene:
    return far_scene(captures)


def expected(scene: ExportScene, piece: Piece, frame: int) -> FloatArray:
    """(V, 3) m, where the edit puts the captured vertices."""
    return scene.placed(piece, frame_mesh(scene, piece, frame), frame)


@pytest.mark.parametrize("up", ["z", "y"])
def test_in_usd(scene: ExportScene, tmp_path: Path, up: str) -> None:
    write_flat_usd(scene, tmp_path / "flat.usdc", up=up, tell=told)
    write_usd_edit(scene, tmp_path / "edit.usda", assets=tmp_path / "assets", up=up, tell=told)
    for name in ("flat.usdc", "edit.usda"):
        stage = Usd.Stage.Open(str(tmp_path / name))
        for piece, k in itertools.product(scene.pieces, range(scene.edit.n_frames)):
            shown = usd_shown(stage, f"/World/{piece.subject}/{piece.part}/mesh", k)
            there = z_up(moved(shown)) if up == "y" else moved(shown)
            assert_allclose(there, expected(scene, piece, k), rtol=0, atol=EXACT)


def test_between_frames_people_do_not_swing_about_the_origin(scene: ExportScene, tmp_path: Path) -> None:
    write_flat_usd(scene, tmp_path / "flat.usdc", up="z", tell=told)
    stage = Usd.Stage.Open(str(tmp_path / "flat.usdc"))
    [person] = [piece for piece in scene.pieces if piece.name == "x"]
    for k in range(scene.edit.n_frames - 1):
        between = moved(usd_shown(stage, "/World/x/body/mesh", k + 0.5))[:3]
        ends = [expected(scene, person, frame)[:3] for frame in (k, k + 1)]
        assert np.abs(between - np.mean(ends, 0)).max() < 0.05


def test_a_copy_says_what_it_is_without_and_is_used_again(scene: ExportScene, tmp_path: Path) -> None:
    first = write_usd_edit(scene, tmp_path / "edit.usda", assets=tmp_path / "assets", up="z", tell=told)
    data = Sdf.Layer.FindOrOpen(str(tmp_path / "assets" / "x.usdc")).customLayerData
    assert tuple(data["mhvedit:offset"]) == (500001, -300000)
    again = write_usd_edit(scene, tmp_path / "edit.usda", assets=tmp_path / "assets", up="z", tell=told)
    assert first.kept == () and len(again.kept) == 3


@pytest.mark.parametrize("files", MeshFormat)
@pytest.mark.parametrize("up", ["z", "y"])
def test_folders_keep_float64(scene: ExportScene, tmp_path: Path, files: MeshFormat, up: str) -> None:
    made = write_folder(scene, tmp_path / "out", files=files, up=up, tell=told)
    assert made.warnings == () and made.offset == (0, 0, 0)
    for piece, k in itertools.product(scene.pieces, range(scene.edit.n_frames)):
        seen = trimesh.load_mesh(
            tmp_path / "out" / piece.name / f"{piece.name}_{k:04d}.{files}", process=False, maintain_order=True
        )
        there = np.asarray(seen.vertices)
        assert_array_equal(z_up(there) if up == "y" else there, expected(scene, piece, k))
        assert_array_equal(seen.faces, frame_mesh(scene, piece, k).faces)
        assert seen.visual.vertex_colors[1, :3].tolist() == [40, 7, 255]


@pytest.mark.parametrize("draco", [False, True])
def test_a_glb_is_shifted_and_says_so(scene: ExportScene, tmp_path: Path, draco: bool) -> None:
    made = write_glb(scene, tmp_path / "s.glb", draco=draco, tell=told)
    offset = np.array(made.offset)
    assert_array_equal(offset, [*scene_offset(scene), 0.0])
    assert np.abs(offset[:2] - AWAY).max() < 5 and (offset == np.round(offset)).all()
    assert made.warnings == (
        f"s.glb: the scene lies 583 km from the origin, too far for the float32 of glTF: it is shifted, "
        f"add ({offset[0]:.0f}, {offset[1]:.0f}, 0) m, z up, to be back",
    )
    played = Glb(tmp_path / "s.glb")
    assert played.gltf.scenes[0].extras == {"offset": offset.tolist()}
    for piece, k in itertools.product(scene.pieces, range(scene.edit.n_frames)):
        group = f"{piece.name}.body" if piece.part == BODY else piece.name
        [(_, shown)] = played.shown(group, k / scene.edit.fps)
        faces, wanted = frame_mesh(scene, piece, k).faces, expected(scene, piece, k) - offset
        assert len(shown.faces) == len(faces)
        there = np.sort(z_up(moved(shown))[shown.faces].mean(1), axis=0)
        allowed = 2 * BITS_LOST * np.ptp(wanted, axis=0).max() if draco else EXACT
        assert_allclose(there, np.sort(wanted[faces].mean(1), axis=0), rtol=0, atol=allowed)


def test_near_the_origin_nothing_is_told_otherwise(captures: Path) -> None:
    scene = scene_of({"x": opened(captures, "ply")}, {"x": SOURCE})
    assert centred(scene) is scene and not is_far(scene) and not scene_offset(scene).any()


def test_a_near_capture_that_stands_far_away_keeps_its_points(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "ply")}, {"x": SOURCE})
    there = scene.edit.subjects["x"].placements + np.array([*AWAY, 0.0])
    subject = replace(scene.edit.subjects["x"], placements=there)
    scene = replace(scene, edit=replace(scene.edit, subjects={"x": subject}))
    assert centred(scene) is scene and is_far(scene)
    made = write_glb(scene, tmp_path / "s.glb", draco=False, tell=told)
    [(_, shown)] = Glb(tmp_path / "s.glb").shown("x.body", 5 / scene.edit.fps)
    [piece] = scene.pieces
    assert_array_equal(shown.points, frame_mesh(scene, piece, 5).vertices.astype(np.float32))
    assert_allclose(z_up(moved(shown)), expected(scene, piece, 5) - made.offset, rtol=0, atol=EXACT)
