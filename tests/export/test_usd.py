import itertools
import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from mhvedit.errors import CaptureError, MissingLibrary
from mhvedit.export.content import Exported, ExportScene
from mhvedit.export.target import ExportError
from mhvedit.export.usd_edit import write_usd_edit
from mhvedit.export.usd_flat import write_flat_usd
from mhvedit.geometry.planar import compose
from mhvedit.sequences.read import open_capture
from tests.export.scenes import SHARED, SHARED_SCENES, scene_of, shared_scene, world
from tests.export.small import NUMBERS, opened, shape

pytest.importorskip("pxr")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from tests.export.checks import check_usd
from tests.export.readers import moved, usd_errors, usd_shown

Write = Callable[[ExportScene, Path], Exported]
SOURCE = [3, 3, 4, 6, 8, 6, 6, 7]


def flat(scene: ExportScene, path: Path, up: str = "z") -> Exported:
    return write_flat_usd(scene, path, up=up, tell=lambda stage, share: None)


def edit(scene: ExportScene, path: Path, up: str = "z") -> Exported:
    return write_usd_edit(scene, path, assets=path.parent / "assets", up=up, tell=lambda stage, share: None)


@pytest.mark.skipif(not SHARED.is_dir(), reason="no shared data here")
@pytest.mark.parametrize("name", SHARED_SCENES)
@pytest.mark.parametrize("write", [flat, edit])
def test_shared_scenes(name: str, write: Write, tmp_path: Path) -> None:
    scene = shared_scene(name, most=8 if write is flat else 5)
    if write is edit:  # copies hold all frames of a capture: a short one will do here
        scene = short(scene, 6)
    write(scene, tmp_path / "scene.usdc")
    check_usd(scene, tmp_path / "scene.usdc")
    assert usd_errors(tmp_path / "scene.usdc") == []


def short(scene: ExportScene, most: int) -> ExportScene:
    """The captures cut to their first frames."""
    cut = [
        replace(p, sequence=replace(p.sequence, numbers=p.sequence.numbers[:most], files=p.sequence.files[:most]))
        for p in scene.pieces
    ]
    return ExportScene(scene.edit, tuple(cut))


@pytest.mark.parametrize("write", [flat, edit])
@pytest.mark.parametrize("kind", ["obj", "ply", "drc", "plain"])
def test_nothing_is_interpolated_in_between(captures: Path, tmp_path: Path, write: Write, kind: str) -> None:
    """Neighbours of equal counts have other triangles; a reader that interpolates must not mix them."""
    scene = scene_of({"x": opened(captures, kind)}, {"x": [3, 7, 7, 3, 4, 8, 6]})
    write(scene, tmp_path / "scene.usda")
    for held, between in itertools.product((False, True), (0.0, 0.5, 0.99)):
        check_usd(scene, tmp_path / "scene.usda", held=held, between=between)


@pytest.mark.parametrize("write", [flat, edit])
@pytest.mark.parametrize(("units", "up"), [("cm", "y"), ("mm", "x"), ("m", "z")])
def test_units_and_axes(captures: Path, tmp_path: Path, write: Any, units: str, up: str) -> None:  # noqa: ANN401
    """Captures come as metres and z up; a stage may be y up all the same."""
    scene = scene_of({"x": opened(captures, "plain", units=units, up=up)}, {"x": SOURCE}, units=units, up=up)
    write(scene, tmp_path / "scene.usd", up="y")
    check_usd(scene, tmp_path / "scene.usd", y_up=True)


def test_an_edit_layer_is_small_and_its_paths_are_relative(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({w: opened(captures, w) for w in ("obj", "ply")}, {w: SOURCE for w in ("obj", "ply")})
    (tmp_path / "one").mkdir()
    edit(scene, tmp_path / "one" / "scene.usda")
    text = (tmp_path / "one" / "scene.usda").read_text()
    assert len(text) < 5000 and "@./assets/obj.usdc@</obj>" in text and str(tmp_path) not in text
    (tmp_path / "one").rename(tmp_path / "two")
    check_usd(scene, tmp_path / "two" / "scene.usda")
    assert usd_errors(tmp_path / "two" / "scene.usda") == []


def test_copies_are_made_once_and_again_when_the_capture_changes(captures: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(captures / "plain", tmp_path / "plain"))
    scene = scene_of({"x": (open_capture(folder, name="x"), folder)}, {"x": SOURCE})
    assert edit(scene, tmp_path / "one.usda").kept == ()
    copy = tmp_path / "assets" / "x.usdc"
    before = copy.stat().st_mtime_ns
    other = scene_of({"x": (open_capture(folder, name="x"), folder)}, {"x": SOURCE[::-1]})
    assert edit(other, tmp_path / "two.usda").kept == (copy,) and copy.stat().st_mtime_ns == before
    check_usd(other, tmp_path / "two.usda")
    check_usd(scene, tmp_path / "one.usda")
    for donor in ("n_7.obj", None):
        state, content = (folder / "n_3.obj").stat(), (folder / "n_3.obj").read_text()
        new = content.replace("1", "2", 1) if donor is None else (folder / donor).read_text()
        (folder / "n_3.obj").write_text(new)
        os.utime(folder / "n_3.obj", ns=(state.st_atime_ns, state.st_mtime_ns))
        assert edit(scene, tmp_path / "one.usda").kept == ()
        check_usd(scene, tmp_path / "one.usda")


@pytest.mark.parametrize("foreign", ["text", "stage"])
def test_files_of_others_are_not_taken_for_copies(captures: Path, tmp_path: Path, foreign: str) -> None:
    scene = scene_of({"x": opened(captures, "plain")}, {"x": SOURCE})
    (tmp_path / "assets").mkdir()
    copy = tmp_path / "assets" / "x.usdc"
    if foreign == "text":
        copy.write_text("precious")
    else:
        Usd.Stage.CreateNew(str(copy)).Save()
    before = copy.read_bytes()
    with pytest.raises(ExportError, match=r"x.usdc: expected nothing there, or a copy made by .*, found another file"):
        edit(scene, tmp_path / "scene.usda")
    assert copy.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["assets"]


def usd_capture(path: Path, *, roots: int = 1) -> Path:
    """A stage in centimetres and y up that moves its meshes; 30 time codes a second."""
    stage = Usd.Stage.CreateNew(str(path))
    stage.SetTimeCodesPerSecond(30)
    for i in range(roots):
        top = UsdGeom.Xform.Define(stage, f"/actor{i}")
        shift = top.AddTranslateOp()
        mesh = UsdGeom.Mesh.Define(stage, f"/actor{i}/geo/skin")
        for number in NUMBERS:
            points, faces = shape(number)
            shift.Set((0.5 * number, 0.0, float(i)), number)
            mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy((100 * points).astype(np.float32)), number)
            mesh.GetFaceVertexCountsAttr().Set([3] * len(faces), number)
            mesh.GetFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(faces.astype(np.int32).reshape(-1)), number)
    stage.Save()
    return path


def test_usd_captures_are_referenced_as_they_are(tmp_path: Path) -> None:
    path = usd_capture(tmp_path / "actor.usdc")
    capture = open_capture(path, name="x", units="cm", up="y")
    scene = scene_of({"x": (capture, path)}, {"x": SOURCE}, units="cm", up="y")
    edit(scene, tmp_path / "scene.usda")
    assert not (tmp_path / "assets").exists()
    assert usd_errors(tmp_path / "scene.usda") == []
    stage = Usd.Stage.Open(str(tmp_path / "scene.usda"))
    for k, number in enumerate(SOURCE):
        shown = usd_shown(stage, "/World/x/body/capture/geo/skin", k)
        assert_array_equal(shown.points, (100 * shape(number)[0]).astype(np.float32), strict=True)
        assert_array_equal(shown.faces, shape(number)[1])
        assert_allclose(moved(shown), world(scene, scene.pieces[0], k), atol=1e-7)


def test_usd_captures_far_from_the_origin_stay_as_they_are(tmp_path: Path) -> None:
    path = usd_capture(tmp_path / "actor.usda")
    stage = Usd.Stage.Open(str(path))
    top = UsdGeom.Xform.Get(stage, "/actor0")
    top.AddTranslateOp(opSuffix="survey").Set(Gf.Vec3d(5e7, 0.0, -3e7))  # cm, y up
    stage.GetRootLayer().Save()
    capture = open_capture(path, name="x", units="cm", up="y")
    base = scene_of({"x": (capture, path)}, {"x": SOURCE}, units="cm", up="y")
    walked = compose(base.edit.subjects["x"].placements, np.array([-5e5, -3e5, 0.0]))
    scene = replace(base, edit=replace(base.edit, subjects={"x": replace(base.edit.subjects["x"], placements=walked)}))
    edit(scene, tmp_path / "scene.usda")
    again = Usd.Stage.Open(str(tmp_path / "scene.usda"))
    [piece] = scene.pieces
    for k in range(len(SOURCE)):
        shown = usd_shown(again, "/World/x/body/capture/geo/skin", k)
        expected = scene.placed(piece, capture.mesh(SOURCE[k]), k)
        assert np.abs(expected).max() < 10
        assert_allclose(moved(shown), expected, rtol=0, atol=1e-7)
    turn = UsdGeom.XformCache(0).GetLocalTransformation(again.GetPrimAtPath("/World/x"))[0]
    assert np.abs(np.array(turn)[3, :3]).max() < 10


def test_usd_captures_of_several_roots_are_copied(tmp_path: Path) -> None:
    path = usd_capture(tmp_path / "actor.usdc", roots=2)
    capture = open_capture(path, name="x", units="cm", up="y")
    scene = scene_of({"x": (capture, path)}, {"x": SOURCE}, units="cm", up="y")
    edit(scene, tmp_path / "scene.usda")
    assert (tmp_path / "assets" / "x.usdc").is_file()
    check_usd(scene, tmp_path / "scene.usda")


@pytest.mark.parametrize("write", [flat, edit])
def test_materials_and_textures(captures: Path, tmp_path: Path, write: Write) -> None:
    scene = scene_of({"x": opened(captures, "obj")}, {"x": SOURCE})
    assert write(scene, tmp_path / "scene.usda").warnings == ()
    assert usd_errors(tmp_path / "scene.usda") == []
    stage = Usd.Stage.Open(str(tmp_path / "scene.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/x/body/mesh"))
    subsets = {s.GetPrim().GetName(): s for s in UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()}
    for k, number in enumerate(SOURCE):
        assert {name: list(s.GetIndicesAttr().Get(k)) for name, s in subsets.items()} == {
            "skin": [0, 1],
            "cloth": [2, 3],
        }
        uv = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get(k))
        assert_array_equal(uv, [(i / 8, i / 16) for i in range(6)] + [(0, 0)] * 6)
        bound = UsdShade.MaterialBindingAPI(subsets["skin"]).ComputeBoundMaterial()[0]
        file = stage.GetPrimAtPath(f"{bound.GetPath()}/picture").GetAttribute("inputs:file").Get(k)
        assert Path(file.resolvedPath).read_bytes() == (captures / "obj" / f"tex_{number}.png").read_bytes()
    cloth = UsdShade.MaterialBindingAPI(subsets["cloth"]).ComputeBoundMaterial()[0]
    surface = UsdShade.Shader(stage.GetPrimAtPath(f"{cloth.GetPath()}/surface"))
    assert surface.GetInput("opacity").Get() == 0.5
    assert_allclose(surface.GetInput("diffuseColor").Get(), (0.2, 0.4, 0.6), atol=1e-7)


def test_vertex_colours_and_labels(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "ply")}, {"x": SOURCE})
    flat(scene, tmp_path / "scene.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "scene.usdc"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/x/body/mesh"))
    colours = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("displayColor").Get(2))
    assert len(colours) == 5 and colours[0, 0] == 0 and (colours[:, 2] == 1).all()
    assert list(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("part").Get(2)) == [0, 1, 2, 3, 4]


def test_a_package_holds_everything(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "obj")}, {"x": SOURCE})
    flat(scene, tmp_path / "scene.usdz")
    assert [p.name for p in tmp_path.iterdir()] == ["scene.usdz"]
    check_usd(scene, tmp_path / "scene.usdz")
    assert usd_errors(tmp_path / "scene.usdz") == []
    stage = Usd.Stage.Open(str(tmp_path / "scene.usdz"))
    file = stage.GetPrimAtPath("/World/x/body/looks/skin/picture").GetAttribute("inputs:file").Get(0)
    assert file.resolvedPath.startswith(str(tmp_path / "scene.usdz["))


def test_names_that_usd_does_not_allow(captures: Path, tmp_path: Path) -> None:
    names = ("2-x", "2.x")
    scene = scene_of({w: opened(captures, "plain") for w in names}, {w: SOURCE for w in names})
    edit(scene, tmp_path / "scene.usda")
    stage = Usd.Stage.Open(str(tmp_path / "scene.usda"))
    assert [p.GetName() for p in stage.GetDefaultPrim().GetChildren()] == ["_2_x", "_2_x_2"]
    assert_array_equal(usd_shown(stage, "/World/_2_x_2/body/mesh", 4).points, shape(8)[0].astype(np.float32))


def test_a_damaged_frame_leaves_nothing_behind(captures: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(captures / "plain", tmp_path / "plain"))
    (folder / "n_7.obj").write_text("v 0 0\n")
    scene = scene_of({"x": (open_capture(folder, name="x"), folder)}, {"x": SOURCE})
    for write in (flat, edit):
        with pytest.raises(CaptureError, match=r"n_7.obj: "):
            write(scene, tmp_path / "scene.usdc")
        assert [p.name for p in tmp_path.iterdir()] == ["plain"]


def test_without_the_library(captures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    scene = scene_of({"x": opened(captures, "plain")}, {"x": SOURCE})
    with pytest.raises(MissingLibrary, match=r"writing USD needs .* pip install 'mhvedit\[usd\]'"):
        flat(scene, tmp_path / "scene.usdc")


def test_layers_are_deterministic(captures: Path, tmp_path: Path) -> None:
    scene = scene_of({"x": opened(captures, "obj")}, {"x": SOURCE})
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        edit(scene, tmp_path / name / "scene.usda")
    assert (tmp_path / "one/scene.usda").read_bytes() == (tmp_path / "two/scene.usda").read_bytes()
    layers = [Sdf.Layer.FindOrOpen(str(tmp_path / n / "assets/x.usdc")).ExportToString() for n in ("one", "two")]
    assert layers[0] == layers[1]


def test_materials_that_change_with_the_frames(tmp_path: Path) -> None:
    """One name, another colour in the second frame; a new material in the third."""
    folder = tmp_path / "plain"
    folder.mkdir()
    for number, (colour, name) in {1: (0.1, "m"), 2: (0.9, "m"), 3: (0.5, "n")}.items():
        (folder / f"{number}.mtl").write_text(f"newmtl {name}\nKd {colour} 0 0\n")
        text = f"mtllib {number}.mtl\nv 0 0 0\nv 1 0 0\nv 0 0 {number}\nusemtl {name}\nf 1 2 3\n"
        (folder / f"{number}.obj").write_text(text)
    scene = scene_of({"x": (open_capture(folder, name="x"), folder)}, {"x": [1, 2, 3]})
    flat(scene, tmp_path / "scene.usda")
    assert usd_errors(tmp_path / "scene.usda") == []
    stage = Usd.Stage.Open(str(tmp_path / "scene.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/x/body/mesh"))
    for k, expected in enumerate([0.1, 0.9, 0.5]):
        [subset] = [s for s in UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets() if s.GetIndicesAttr().Get(k)]
        bound = UsdShade.MaterialBindingAPI(subset).ComputeBoundMaterial()[0]
        surface = UsdShade.Shader(stage.GetPrimAtPath(f"{bound.GetPath()}/surface"))
        assert surface.GetInput("diffuseColor").Get()[0] == pytest.approx(expected)


def test_a_changed_picture_makes_a_new_copy(captures: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(captures / "obj", tmp_path / "obj"))
    scene = scene_of({"x": (open_capture(folder, name="x"), folder)}, {"x": SOURCE})
    edit(scene, tmp_path / "scene.usda")
    shutil.copyfile(folder / "tex_4.png", folder / "tex_3.png")
    os.utime(folder / "tex_3.png", ns=(1, 1))
    assert edit(scene, tmp_path / "scene.usda").kept == ()
    stage = Usd.Stage.Open(str(tmp_path / "scene.usda"))
    file = stage.GetPrimAtPath("/World/x/body/looks/skin/picture").GetAttribute("inputs:file").Get(0)
    assert Path(file.resolvedPath).read_bytes() == (folder / "tex_4.png").read_bytes()


def test_looks_of_usd_captures_that_stay_behind_are_told(tmp_path: Path) -> None:
    path = usd_capture(tmp_path / "actor.usdc")
    scene = scene_of({"x": (open_capture(path, name="x"), path)}, {"x": SOURCE})
    assert edit(scene, tmp_path / "one.usda").warnings == ()
    [said] = flat(scene, tmp_path / "two.usda").warnings
    assert said == "x: materials of a USD capture only stay in an edit layer that references it"
