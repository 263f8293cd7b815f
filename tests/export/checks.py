"""Whether an export shows, in every frame, the captured vertices where the edit puts them."""

import itertools
from pathlib import Path

import numpy as np
import trimesh
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Usd, UsdGeom

from mhvedit.export.content import ExportScene
from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.geometry.planar import apply_pose
from mhvedit.scene.edit import placed_prop
from tests.export.readers import Glb, Shown, moved, usd_shown, z_up
from tests.export.scenes import frame_mesh, world

BITS_LOST = 2.0**-13  # of the longest side of a mesh, by which 14 bits may miss


def check_usd(scene: ExportScene, path: Path, *, held: bool = False, between: float = 0.0, y_up: bool = False) -> None:
    """Vertices bit for bit; placements to rounding; `between` frames nothing may change but the placement."""
    stage = Usd.Stage.Open(str(path))
    if held:
        stage.SetInterpolationType(Usd.InterpolationTypeHeld)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, scene.edit.n_frames - 1)
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == scene.edit.fps
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1 and UsdGeom.GetStageUpAxis(stage) == ("Y" if y_up else "Z")
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert [p.GetName() for p in stage.GetDefaultPrim().GetChildren()] == list(scene.movers)
    for piece, k in itertools.product(scene.pieces, range(scene.edit.n_frames)):
        shown = usd_shown(stage, f"/World/{piece.subject}/{piece.part}/mesh", k + between)
        mesh = frame_mesh(scene, piece, k)
        assert_array_equal(shown.points, mesh.vertices.astype(np.float32), strict=True)
        assert_array_equal(shown.faces, mesh.faces)
        if not between:
            there = z_up(moved(shown)) if y_up else moved(shown)
            assert_allclose(there, world(scene, piece, k), atol=1e-12)


def check_glb(scene: ExportScene, path: Path, *, draco: bool = False) -> None:
    """Exactly one mesh of each piece is seen at any time, bit for bit where it is not compressed."""
    played = Glb(path)
    for piece, k in itertools.product(scene.pieces, range(scene.edit.n_frames)):
        mesh = frame_mesh(scene, piece, k)
        for moment in (k, k + 0.5):
            [(name, shown)] = played.shown(f"{piece.name}.body", moment / scene.edit.fps)
            assert name == f"{piece.name}_{scene.source(piece)[k]:04d}"
            if draco:
                _check_draco(shown, world(scene, piece, k), mesh.faces)
            else:
                assert_array_equal(shown.points, mesh.vertices.astype(np.float32), strict=True)
                assert_array_equal(shown.faces, mesh.faces)
                assert_allclose(z_up(moved(shown)), world(scene, piece, k), atol=1e-6)


def _check_draco(shown: Shown, expected: FloatArray, faces: Int32Array) -> None:
    """The centres of all faces, which come in another order, each coordinate by itself."""
    step = np.ptp(expected, axis=0).max() * BITS_LOST
    there = z_up(moved(shown))
    assert len(shown.faces) == len(faces)
    centres = np.sort(there[shown.faces].mean(1), axis=0)
    assert_allclose(centres, np.sort(expected[faces].mean(1), axis=0), atol=2 * step)


def check_folder(scene: ExportScene, path: Path) -> None:
    """Placed vertices as float32, to the last bit."""
    for piece in scene.pieces:
        written = sorted(file for file in (path / piece.name).iterdir() if file.suffix in (".obj", ".ply"))
        names = [f"{piece.name}_{k:04d}{written[0].suffix}" for k in range(scene.edit.n_frames)]
        assert [file.name for file in written] == names
        for k, file in enumerate(written):
            seen = trimesh.load_mesh(file, process=False, maintain_order=True)
            assert_array_equal(np.asarray(seen.vertices, np.float32), placed(scene, k, piece.name).astype(np.float32))
            assert_array_equal(seen.faces, frame_mesh(scene, piece, k).faces)


def placed(scene: ExportScene, k: int, name: str) -> FloatArray:
    """(V, 3) float32 of where the edit puts the captured vertices, as float64."""
    [piece] = [piece for piece in scene.pieces if piece.name == name]
    if piece.subject in scene.edit.props:
        return np.asarray(
            placed_prop(scene.edit, {name: piece.sequence}, name, k).vertices.astype(np.float32), np.float64
        )
    points = apply_pose(scene.edit.subjects[piece.subject].placements[k], frame_mesh(scene, piece, k).vertices)
    return np.asarray(points.astype(np.float32), np.float64)
