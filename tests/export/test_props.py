"""Props in every kind of export, read back with other people's libraries."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mhvedit.export.content import ExportScene, Piece
from mhvedit.export.folder import MeshFormat, write_folder
from mhvedit.export.gltf import write_glb
from mhvedit.export.usd_edit import write_usd_edit
from mhvedit.export.usd_flat import write_flat_usd
from mhvedit.scene.edit import EditedScene, PropEdit, edit_as_dict
from mhvedit.sequences.meshes import BODY
from mhvedit.view.film import film, fixed_cameras, scene_boxes
from tests.export.checks import check_folder, check_glb, check_usd
from tests.export.scenes import scene_of
from tests.export.small import opened

N = 7
SOURCE = [3, 3, 4, 6, 8, 6, 6]


def told(stage: str, share: float) -> None:
    """Nobody listens."""


@pytest.fixture
def scene(captures: Path) -> ExportScene:
    """One subject, a table that stands, and a ball that tumbles and then lies still."""
    base = scene_of({"x": opened(captures, "plain")}, {"x": SOURCE})
    sequence, path = opened(captures, "plain")
    still = np.tile([[0.0, 0.0, 0.6, 0.8]], (N, 1))
    t = np.minimum(np.arange(N), N - 3)[:, None]
    tumbling = Rotation.from_rotvec(t * np.array([0.9, -0.4, 0.3])).as_quat()
    number = np.full(N, sequence.numbers[0])
    props = {
        "table": PropEdit("t.obj", "fixed", number, np.tile([0.5, -1.0, 0.0], (N, 1)), still),
        "ball": PropEdit("b.obj", "simulated", number, np.hstack([t * 0.3, -t * 0.1, 1.0 - 0.2 * t]), tumbling),
    }
    pieces = (*base.pieces, *(Piece(name, BODY, name, sequence, path, "m", "z") for name in props))
    return ExportScene(replace(base.edit, props=props), pieces)


def test_in_a_glb(scene: ExportScene, tmp_path: Path) -> None:
    write_glb(scene, tmp_path / "s.glb", draco=False, tell=told)
    check_glb(scene, tmp_path / "s.glb")


@pytest.mark.parametrize("up", ["z", "y"])
def test_in_usd(scene: ExportScene, tmp_path: Path, up: str) -> None:
    write_flat_usd(scene, tmp_path / "flat.usdc", up=up, tell=told)
    write_usd_edit(scene, tmp_path / "edit.usda", assets=tmp_path / "assets", up=up, tell=told)
    for name in ("flat.usdc", "edit.usda"):
        check_usd(scene, tmp_path / name, y_up=up == "y")


@pytest.mark.parametrize("files", MeshFormat)
def test_in_folders(scene: ExportScene, tmp_path: Path, files: MeshFormat) -> None:
    write_folder(scene, tmp_path / "s", files=files, up="z", tell=told)
    check_folder(scene, tmp_path / "s")


def test_a_movie_shows_them(scene: ExportScene) -> None:
    captures = {piece.subject: piece.sequence for piece in scene.pieces}
    people: EditedScene = replace(scene.edit, props={})
    cameras = fixed_cameras(scene_boxes(people, captures), aspect=1.0)
    with_, without = (
        next(iter(film(edit, captures, frames=[0], cameras=cameras, size=(160, 160)))) for edit in (scene.edit, people)
    )
    assert (with_ != without).any()


def test_a_scene_without_props_says_nothing_of_them(scene: ExportScene) -> None:
    assert "props" not in edit_as_dict(replace(scene.edit, props={}))
