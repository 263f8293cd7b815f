import os
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mhvedit.errors import CaptureError, MissingLibrary
from mhvedit.sequences.contents import Contents
from mhvedit.sequences.raw import RawMesh
from mhvedit.sequences.read import open_capture
from mhvedit.sequences.usd import UsdSource

pxr = pytest.importorskip("pxr")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils, Vt  # noqa: E402

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1]], np.float32)
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], np.float32)
Edit = Callable[[Any, Any], None]


def put(mesh: Any, points: np.ndarray[Any, Any], polygons: list[list[int]], time: float | None) -> None:  # noqa: ANN401
    at = Usd.TimeCode.Default() if time is None else time
    mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points), at)
    mesh.GetFaceVertexCountsAttr().Set([len(p) for p in polygons], at)
    mesh.GetFaceVertexIndicesAttr().Set([c for p in polygons for c in p], at)


def stage(path: Path, edit: Edit | None = None) -> Path:
    """A triangle at frame 3 and a square from frame 5 on."""
    made = Usd.Stage.CreateNew(str(path))
    mesh = UsdGeom.Mesh.Define(made, "/body/skin")
    put(mesh, TRIANGLE, [[0, 1, 2]], 3)
    put(mesh, SQUARE, [[0, 1, 2, 3]], 5)
    if edit:
        edit(made, mesh)
    made.Save()
    return path


def raw(source: UsdSource, number: int) -> RawMesh:
    return source.parsed(number, source.opened(number)[1])


@pytest.mark.parametrize("suffix", [".usd", ".usda", ".usdc", ".usdz"])
def test_topology_that_changes(tmp_path: Path, suffix: str) -> None:
    path = stage(tmp_path / f"a{'.usdc' if suffix == '.usdz' else suffix}")
    if suffix == ".usdz":
        assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(path)), str(tmp_path / "a.usdz"))
        path = tmp_path / "a.usdz"
    capture = open_capture(path, name="a", cache=tmp_path / "cache")
    assert capture.numbers == (3, 5) and capture.files == (path,)
    for _ in range(2):
        assert capture.mesh(3).vertices.tolist() == TRIANGLE.tolist()
        assert capture.mesh(5).faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_nothing_is_interpolated(tmp_path: Path) -> None:
    def move(made: Any, mesh: Any) -> None:  # noqa: ANN401
        put(UsdGeom.Mesh.Define(made, "/other"), TRIANGLE, [[0, 1, 2]], 4)
        put(mesh, TRIANGLE + np.float32(1), [[0, 1, 2]], 5)

    source = UsdSource(stage(tmp_path / "a.usda", move))
    assert source.numbers == (3, 4, 5)
    assert raw(source, 4).vertices[:3].tolist() == TRIANGLE.tolist()


def test_transforms_visibility_and_handedness(tmp_path: Path) -> None:
    def dress(made: Any, mesh: Any) -> None:  # noqa: ANN401
        body = UsdGeom.Xform.Define(made, "/body")
        body.AddTranslateOp().Set(Gf.Vec3d(10, 0, 0), 3)
        body.AddTranslateOp(opSuffix="more").Set(Gf.Vec3d(0, 20, 0))
        body.AddScaleOp().Set(Gf.Vec3f(-2, 2, 2))
        sword = UsdGeom.Mesh.Define(made, "/sword")
        put(sword, TRIANGLE, [[0, 1, 2]], None)
        sword.GetOrientationAttr().Set(UsdGeom.Tokens.leftHanded)
        sword.GetVisibilityAttr().Set(UsdGeom.Tokens.inherited, 3)
        sword.GetVisibilityAttr().Set(UsdGeom.Tokens.invisible, 5)

    source = UsdSource(stage(tmp_path / "a.usda", dress))
    mesh = raw(source, 3)
    assert mesh.vertices.tolist() == [[10, 20, 0], [8, 20, 0], [10, 20, 2], *TRIANGLE.tolist()]
    assert mesh.faces.tolist() == [[2, 1, 0], [5, 4, 3]]
    assert len(raw(source, 5).vertices) == 4


def test_part_primvar_becomes_labels(tmp_path: Path) -> None:
    def label(_: Any, mesh: Any) -> None:  # noqa: ANN401
        part = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("part", Sdf.ValueTypeNames.IntArray, UsdGeom.Tokens.vertex)
        part.Set([1, 2, 3], 3)
        part.Set([4, 5, 6, 7], 5)

    source = UsdSource(stage(tmp_path / "a.usda", label))
    labels = raw(source, 5).labels
    assert labels is not None and labels.tolist() == [4, 5, 6, 7]


def test_a_still_is_one_frame(tmp_path: Path) -> None:
    made = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    put(UsdGeom.Mesh.Define(made, "/m"), TRIANGLE, [[0, 1, 2]], None)
    made.Save()
    source = UsdSource(tmp_path / "a.usda")
    assert source.numbers == (0,) and raw(source, 0).faces.tolist() == [[0, 1, 2]]


def test_what_the_stage_says_is_told_but_not_applied(tmp_path: Path) -> None:
    def say(made: Any, _: Any) -> None:  # noqa: ANN401
        UsdGeom.SetStageMetersPerUnit(made, 0.01)
        UsdGeom.SetStageUpAxis(made, UsdGeom.Tokens.y)
        made.SetTimeCodesPerSecond(25)

    path = stage(tmp_path / "a.usda", say)
    source = UsdSource(path)
    assert (source.axes.metres_per_unit, source.axes.up, source.fps) == (0.01, "y", 25.0)
    capture = open_capture(path, name="a")
    assert capture.fps == 25.0 and capture.mesh(3).vertices.tolist() == TRIANGLE.tolist()
    assert open_capture(path, name="a", fps=30, units="cm").mesh(3).vertices.max() == 0.01


def test_a_change_of_the_stage_is_noticed(tmp_path: Path) -> None:
    path = stage(tmp_path / "a.usda")
    before = UsdSource(path).opened(3)[0]
    state = path.stat()
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns + 1))
    assert UsdSource(path).opened(3)[0] != before != UsdSource(path).opened(5)[0]


def test_a_stage_written_anew_is_read_anew_even_while_the_old_one_is_open(tmp_path: Path) -> None:
    path = stage(tmp_path / "a.usdc")
    before = UsdSource(path)
    os.replace(stage(tmp_path / "b.usdc", lambda _, mesh: put(mesh, TRIANGLE * 7, [[0, 1, 2]], 3)), path)
    after = UsdSource(path)
    assert raw(after, 3).vertices.max() == 7
    with pytest.raises(CaptureError, match=r"a.usdc: expected a file that stays as it is while it is open"):
        before.opened(3)


def referring(path: Path, to: str) -> Path:
    made = Usd.Stage.CreateNew(str(path))
    made.OverridePrim("/body").GetReferences().AddReference(to, "/body")
    made.Save()
    return path


def test_a_change_of_a_layer_that_is_referred_to_is_noticed(tmp_path: Path) -> None:
    geometry, path = stage(tmp_path / "geo.usdc"), referring(tmp_path / "a.usda", "./geo.usdc")
    known = Contents(tmp_path / "contents.json")
    before = open_capture(path, name="a", cache=tmp_path / "cache", known=known)
    assert before.files == (path, geometry.resolve()) and before.mesh(3).vertices.max() == 1
    held = known.of(before.files)
    os.replace(stage(tmp_path / "b.usdc", lambda _, mesh: put(mesh, TRIANGLE * 7, [[0, 1, 2]], 3)), geometry)
    after = open_capture(path, name="a", cache=tmp_path / "cache", known=known)
    assert after.mesh(3).vertices.max() == 7 and known.of(after.files) != held
    with pytest.raises(CaptureError, match=r"a.usda: expected a file that stays as it is while it is open"):
        before.mesh(5)


def test_value_clips_belong_to_the_stage(tmp_path: Path) -> None:
    for number in (1, 2):
        clip = Usd.Stage.CreateNew(str(tmp_path / f"clip.{number:03d}.usdc"))
        put(UsdGeom.Mesh.Define(clip, "/body/skin"), TRIANGLE * number, [[0, 1, 2]], number)
        clip.Save()
    made = Usd.Stage.CreateInMemory()
    clips = Usd.ClipsAPI(UsdGeom.Mesh.Define(made, "/skin").GetPrim())
    clips.SetClipPrimPath("/body/skin")
    clips.SetClipTemplateAssetPath("./clip.###.usdc")
    clips.SetClipTemplateStartTime(1)
    clips.SetClipTemplateEndTime(2)
    clips.SetClipTemplateStride(1)
    made.GetRootLayer().Export(str(tmp_path / "a.usda"))
    capture = open_capture(tmp_path / "a.usda", name="a", cache=tmp_path / "cache")
    assert [file.name for file in capture.files] == ["a.usda", "clip.001.usdc", "clip.002.usdc"]
    assert not capture.per_frame  # whatever their number
    for _ in range(2):
        assert [capture.mesh(n).vertices.max() for n in (1, 2)] == [1, 2]


def test_stages_go_to_other_processes(tmp_path: Path) -> None:
    source = pickle.loads(pickle.dumps(UsdSource(stage(tmp_path / "a.usdc"))))
    assert len(raw(source, 5).faces) == 2


def empty(made: Any, _: Any) -> None:  # noqa: ANN401
    made.RemovePrim("/body")


def half(_: Any, mesh: Any) -> None:  # noqa: ANN401
    put(mesh, TRIANGLE, [[0, 1, 2]], 3.5)


def wrong(_: Any, mesh: Any) -> None:  # noqa: ANN401
    put(mesh, TRIANGLE, [[0, 1, 3]], 3)


def short(_: Any, mesh: Any) -> None:  # noqa: ANN401
    mesh.GetFaceVertexCountsAttr().Set([4], 3)


def nothing(_: Any, mesh: Any) -> None:  # noqa: ANN401
    put(mesh, TRIANGLE[:0], [], 3)


def infinite(_: Any, mesh: Any) -> None:  # noqa: ANN401
    put(mesh, TRIANGLE * np.float32(np.inf), [[0, 1, 2]], 3)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (empty, "a.usda: expected at least one mesh in the stage, found none"),
        (half, "a.usda: expected whole time codes, as they are frame numbers, found 3.5"),
        (wrong, "a.usda: frame 3: expected face indices from 0 to 2, found 0 to 3"),
        (short, "a.usda: frame 3: expected 4 corners in faces of 3 or more, found 3 corners"),
        (nothing, "a.usda: frame 3: expected a visible mesh, found none"),
        (infinite, "a.usda: frame 3: expected finite vertices"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_bad_stages_are_named(tmp_path: Path, edit: Edit, message: str) -> None:
    path = stage(tmp_path / "a.usda", edit)
    with pytest.raises(CaptureError, match=message):
        raw(UsdSource(path), 3)


def test_a_stage_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text("never a stage")
    with pytest.raises(CaptureError, match=r"a.usda: expected a readable USD stage, found "):
        UsdSource(tmp_path / "a.usda")


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
@pytest.mark.parametrize("seed", range(20))
def test_a_stage_of_which_bytes_are_lost_is_read_or_named(seed: int, suffix: str, tmp_path: Path) -> None:
    path, rng = stage(tmp_path / f"a{suffix}"), np.random.default_rng(seed)
    data = np.frombuffer(path.read_bytes(), np.uint8).copy()
    data[rng.integers(0, len(data), 5)] ^= rng.integers(1, 256, 5, np.uint8)
    (tmp_path / f"b{suffix}").write_bytes(data.tobytes())
    try:
        capture = open_capture(tmp_path / f"b{suffix}", name="b")
        for number in capture.numbers:
            capture.mesh(number)
    except CaptureError as told:
        assert f"b{suffix}" in str(told) and "pxrInternal" not in str(told)


def test_without_the_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(MissingLibrary, match=r"reading USD needs .* pip install 'mhvedit\[usd\]'"):
        UsdSource(tmp_path / "a.usda")
