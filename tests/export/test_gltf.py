import io
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from mhvedit.errors import CaptureError
from mhvedit.export import gltf
from mhvedit.export.content import Exported, ExportScene
from mhvedit.export.gltf import estimated_size, key_times, write_glb
from mhvedit.export.target import ExportError
from mhvedit.sequences.read import open_capture
from tests.export.checks import check_glb
from tests.export.readers import Glb, gltf_errors, node_validator
from tests.export.scenes import SHARED, SHARED_SCENES, scene_of, shared_scene, world
from tests.export.small import NUMBERS, opened

SOURCE = [3, 3, 4, 6, 8, 6, 6, 7]


def write(scene: ExportScene, path: Path, *, draco: bool = False) -> Exported:
    return write_glb(scene, path, draco=draco, tell=lambda stage, share: None)


@pytest.mark.skipif(not SHARED.is_dir(), reason="no shared data here")
@pytest.mark.parametrize("name", SHARED_SCENES)
def test_shared_scenes(name: str, tmp_path: Path) -> None:
    scene = shared_scene(name, most=8)
    write(scene, tmp_path / "scene.glb")
    check_glb(scene, tmp_path / "scene.glb")
    if node_validator():
        assert gltf_errors(tmp_path / "scene.glb") == []


@pytest.mark.skipif(not SHARED.is_dir(), reason="no shared data here")
def test_draco_of_a_shared_scene(tmp_path: Path) -> None:
    scene = shared_scene("salsa_open", most=4)
    write(scene, tmp_path / "plain.glb")
    write(scene, tmp_path / "small.glb", draco=True)
    check_glb(scene, tmp_path / "small.glb", draco=True)
    sizes = [(tmp_path / f"{name}.glb").stat().st_size for name in ("small", "plain")]
    assert sizes[0] < sizes[1] * gltf.DRACO_SHARE


@pytest.mark.parametrize("draco", [False, True])
@pytest.mark.parametrize("kind", ["obj", "ply", "drc", "plain"])
def test_the_validator_finds_nothing(captures: Path, tmp_path: Path, kind: str, draco: bool) -> None:
    if not node_validator():
        pytest.skip("needs node, and `npm install -g gltf-validator`")
    write(scene_of({"x": opened(captures, kind)}, {"x": SOURCE}), tmp_path / "scene.glb", draco=draco)
    assert gltf_errors(tmp_path / "scene.glb") == []


def test_each_captured_frame_is_stored_once(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "plain")}, {"x": SOURCE})
    write(scene, tmp_path / "scene.glb")
    check_glb(scene, tmp_path / "scene.glb")
    assert len(Glb(tmp_path / "scene.glb").gltf.meshes) == len(set(SOURCE))


def test_one_frame_alone(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "plain")}, {"x": [6]})
    write(scene, tmp_path / "scene.glb")
    check_glb(scene, tmp_path / "scene.glb")


def test_programs_without_animation_see_the_first_frame(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "plain")}, {"x": SOURCE})
    write(scene, tmp_path / "scene.glb")
    graph = trimesh.load_scene(tmp_path / "scene.glb", process=False)
    nodes = [
        (matrix, mesh) for matrix, mesh in map(graph.graph.get, graph.graph.nodes_geometry) if matrix[:3, :3].any()
    ]
    [(matrix, mesh)] = nodes
    seen = trimesh.transform_points(graph.geometry[mesh].vertices, matrix)
    there = world(scene, scene.pieces[0], 0)
    y_up = np.stack([there[:, 0], there[:, 2], -there[:, 1]], 1)
    assert_allclose(seen, y_up, atol=1e-6)


def test_the_last_frame_lasts_as_long_as_the_others(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "plain")}, {"x": SOURCE})
    write(scene, tmp_path / "scene.glb")
    played = Glb(tmp_path / "scene.glb")
    ends = [times[-1] for path, times, _ in played.channels[played.by_name["x"]]]
    assert ends == pytest.approx([len(SOURCE) / 24.0] * 2)


def test_key_times_are_never_late() -> None:
    frames = np.arange(2000)
    for fps in (24.0, 25.0, 30000 / 1001, 60.0):
        times = key_times(frames, fps)
        assert (times.astype(np.float64) <= frames / fps).all() and (np.diff(times) > 0).all()
        assert_allclose(times, frames / fps, rtol=2e-7)


def test_textures_and_materials(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "obj")}, {"x": SOURCE})
    assert write(scene, tmp_path / "scene.glb").warnings == ()
    played = Glb(tmp_path / "scene.glb")
    for number in NUMBERS:
        mesh = played.gltf.meshes[played.gltf.nodes[played.by_name[f"x_{number:04d}"]].mesh]
        skin, cloth = mesh.primitives
        surface = played.gltf.materials[skin.material].pbrMetallicRoughness
        image = played.gltf.images[played.gltf.textures[surface.baseColorTexture.index].source]
        view = played.gltf.bufferViews[image.bufferView]
        data = played.blob[view.byteOffset : view.byteOffset + view.byteLength]
        assert data == (captures / "obj" / f"tex_{number}.png").read_bytes()
        assert Image.open(io.BytesIO(data)).getpixel((0, 0)) == (10 * number,) * 3
        corners = played.values(skin.indices)[:, 0]
        uv = played.values(skin.attributes.TEXCOORD_0)[corners]
        assert_allclose(uv, [(i / 8, 1 - i / 16) for i in range(6)], atol=1e-7)
        points = played.values(skin.attributes.POSITION)[corners].reshape(-1, 3, 3)
        raw = scene.pieces[0].sequence.mesh(number)
        assert_array_equal(points, raw.vertices.astype(np.float32)[raw.faces[:2]])
        assert played.gltf.materials[cloth.material].pbrMetallicRoughness.baseColorFactor == [0.2, 0.4, 0.6, 0.5]
        assert played.gltf.materials[cloth.material].alphaMode == "BLEND"


def test_vertex_colours(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "ply")}, {"x": SOURCE})
    write(scene, tmp_path / "scene.glb")
    played = Glb(tmp_path / "scene.glb")
    colours = played.values(played.gltf.meshes[0].primitives[0].attributes.COLOR_0)
    assert colours[0, 0] == 0 and (colours[:, 2] == 1).all() and colours[1, 0] == pytest.approx(0.0212, abs=1e-4)


def test_what_is_too_large_is_refused_before_anything_is_written(
    captures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = scene_of({"x": opened(captures, "plain")}, {"x": SOURCE})
    monkeypatch.setattr("mhvedit.export.glb_file.LARGEST", 1024 + estimated_size(scene) - 1)
    monkeypatch.setattr(gltf, "staged", None)
    with pytest.raises(
        ExportError, match=r"scene.glb: expected at most 4 GiB in a .glb .*--draco.*, found about 0.0 GiB"
    ):
        write(scene, tmp_path / "scene.glb")
    assert list(tmp_path.iterdir()) == []


def test_what_turns_out_too_large_leaves_nothing(
    captures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = scene_of({"x": opened(captures, "obj")}, {"x": SOURCE})
    monkeypatch.setattr("mhvedit.export.glb_file.LARGEST", 1024 + estimated_size(scene) + 1)
    with pytest.raises(ExportError):
        write(scene, tmp_path / "scene.glb")
    assert list(tmp_path.iterdir()) == []


def test_the_estimate_is_near(captures: Path, tmp_path: Path) -> None:
    if not SHARED.is_dir():
        pytest.skip("no shared data here")
    scene = shared_scene("pushup_grab", most=30)
    write(scene, tmp_path / "scene.glb")
    assert estimated_size(scene) == pytest.approx((tmp_path / "scene.glb").stat().st_size, rel=0.03)


def test_a_damaged_frame_leaves_what_was_there(captures: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(captures / "plain", tmp_path / "plain"))
    (folder / "n_7.obj").write_text("v 0 0\n")
    (tmp_path / "scene.glb").write_text("an earlier one")
    with pytest.raises(CaptureError, match=r"n_7.obj: "):
        write(scene_of({"x": (open_capture(folder, name="x"), folder)}, {"x": SOURCE}), tmp_path / "scene.glb")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["plain", "scene.glb"]
    assert (tmp_path / "scene.glb").read_text() == "an earlier one"


def test_files_are_deterministic(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "obj")}, {"x": SOURCE})
    for draco in (False, True):
        for name in ("one.glb", "two.glb"):
            write(scene, tmp_path / name, draco=draco)
        assert (tmp_path / "one.glb").read_bytes() == (tmp_path / "two.glb").read_bytes()
