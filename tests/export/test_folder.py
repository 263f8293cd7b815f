import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal

from mhvedit.errors import CaptureError
from mhvedit.export.content import Exported, ExportScene
from mhvedit.export.folder import MeshFormat, write_folder
from mhvedit.sequences.frame_looks import frame_looks
from mhvedit.sequences.read import open_capture
from tests.export.checks import check_folder, placed
from tests.export.readers import z_up
from tests.export.scenes import SHARED, SHARED_SCENES, scene_of, shared_scene
from tests.export.small import opened

SOURCE = [3, 3, 4, 6, 8, 6, 6, 7]


def write(scene: ExportScene, path: Path, files: str = "obj", up: str = "z") -> Exported:
    return write_folder(scene, path, files=MeshFormat(files), up=up, tell=lambda stage, share: None)


@pytest.mark.skipif(not SHARED.is_dir(), reason="no shared data here")
@pytest.mark.parametrize("files", ["obj", "ply"])
@pytest.mark.parametrize("name", SHARED_SCENES)
def test_shared_scenes(name: str, files: str, tmp_path: Path) -> None:
    scene = shared_scene(name, most=4)
    write(scene, tmp_path / "out", files)
    check_folder(scene, tmp_path / "out")


@pytest.mark.parametrize("files", ["obj", "ply"])
def test_units_and_axes(captures: Path, tmp_path: Path, files: str) -> None:
    scene = scene_of({"x": opened(captures, "plain", units="cm", up="y")}, {"x": SOURCE}, units="cm", up="y")
    write(scene, tmp_path / "out", files, up="y")
    seen = open_capture(tmp_path / "out" / "x", name="x")
    for k in range(len(SOURCE)):
        assert_array_equal(z_up(seen.mesh(k).vertices).astype(np.float32), placed(scene, k, "x").astype(np.float32))
    said = json.loads((tmp_path / "out" / "export.json").read_text())
    assert said == {"name": "small", "fps": 24.0, "frames": len(SOURCE), "units": "m", "up": "y"}


def test_materials_and_pictures_come_along(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "obj")}, {"x": SOURCE})
    assert write(scene, tmp_path / "out").warnings == ()
    again = open_capture(tmp_path / "out" / "x", name="x")
    for k, number in enumerate(SOURCE):
        before, after = frame_looks(scene.pieces[0].sequence, number), frame_looks(again, k)
        assert before is not None and after is not None and before.uv is not None and after.uv is not None
        assert_array_equal(after.uv, before.uv)
        assert_array_equal(after.material, before.material)
        for old, new in zip(before.materials, after.materials, strict=True):
            assert new.colour == old.colour and new.statements == old.statements
            assert (new.picture and new.picture.data) == (old.picture and old.picture.data)
    seen = trimesh.load_mesh(tmp_path / "out" / "x" / "x_0002.obj", process=False)
    assert seen is not None
    text = (tmp_path / "out" / "x" / "x.mtl").read_text()
    assert text.count("newmtl skin") == 5 and text.count("newmtl cloth\n") == 1 and "Ks 0.1 0.1 0.1" in text


def test_vertex_colours_and_labels(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "ply")}, {"x": SOURCE})
    write(scene, tmp_path / "ply", "ply")
    write(scene, tmp_path / "obj", "obj")
    seen = trimesh.load_mesh(tmp_path / "ply" / "x" / "x_0002.ply", process=False)
    assert_array_equal(seen.visual.vertex_colors[:, :3], [(40 * i, 7, 255) for i in range(5)])
    labels = open_capture(tmp_path / "ply" / "x", name="x").mesh(2).labels
    assert labels is not None and labels.tolist() == [0, 1, 2, 3, 4]
    one = frame_looks(open_capture(tmp_path / "obj" / "x", name="x"), 2)
    two = frame_looks(scene.pieces[0].sequence, 4)
    assert one is not None and two is not None and one.colours is not None and two.colours is not None
    assert_allclose(one.colours, two.colours, atol=1e-6)


def test_textures_that_a_ply_does_not_keep_are_told(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "obj"), "y": opened(captures, "ply")}, {"x": SOURCE, "y": SOURCE})
    said = ("x: a .ply keeps no texture coordinates and pictures: use --format obj",)
    assert write(scene, tmp_path / "out", "ply").warnings == said


def test_missing_pictures_are_told(captures: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(captures / "obj", tmp_path / "obj"))
    (folder / "tex_4.png").unlink()
    (folder / "m_7.mtl").unlink()
    scene = scene_of({"x": (open_capture(folder, name="x"), folder)}, {"x": SOURCE})
    [said] = write(scene, tmp_path / "out").warnings
    assert said == f"x: 2 material or texture files are missing, first {folder / 'tex_4.png'}"


def test_an_earlier_export_is_replaced_as_a_whole(captures: Path, tmp_path: Path) -> None:
    write(scene_of({"x": opened(captures, "plain")}, {"x": SOURCE}), tmp_path / "out")
    write(scene_of({"y": opened(captures, "plain")}, {"y": SOURCE[:2]}), tmp_path / "out")
    names = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file())
    assert names == ["out/export.json", "out/y/y_0000.obj", "out/y/y_0001.obj"]


def test_a_damaged_frame_leaves_what_was_there(captures: Path, tmp_path: Path) -> None:
    write(scene_of({"x": opened(captures, "plain")}, {"x": SOURCE}), tmp_path / "out")
    folder = Path(shutil.copytree(captures / "plain", tmp_path / "plain"))
    (folder / "n_7.obj").write_text("v 0 0\n")
    with pytest.raises(CaptureError, match=r"n_7.obj: "):
        write(scene_of({"x": (open_capture(folder, name="x"), folder)}, {"x": SOURCE}), tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "plain"]
    assert len(list((tmp_path / "out" / "x").iterdir())) == len(SOURCE)
