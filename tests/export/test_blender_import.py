"""The part of the Blender script that needs no Blender, and the rest against a Blender that only takes notes."""

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from mhvedit.sequences.axes import METRES, UP_AXES, to_metres_z_up
from mhvedit.sequences.formats import PARSERS
from tests.export.scenes import scene_of, write_edit
from tests.export.small import NUMBERS, opened

SCRIPT = Path(__file__).resolve().parents[2] / "examples" / "blender_import.py"
SOURCE = [3, 3, 4, 6, 8, 6, 6, 7]


@pytest.fixture
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("blender_import", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_one_captured_frame_is_seen_in_each_frame(script: ModuleType) -> None:
    keys = script.seen_keys(SOURCE)
    for frame, number in enumerate(SOURCE):
        seen = {n: [shown for at, shown in found if at <= frame][-1] for n, found in keys.items()}
        assert seen == {n: n == number for n in set(SOURCE)}
    assert script.seen_keys([5, 5]) == {5: [(0, True)]}


@pytest.mark.parametrize("units", METRES)
@pytest.mark.parametrize("up", UP_AXES)
def test_units_and_axes_are_those_of_the_product(script: ModuleType, units: str, up: str) -> None:
    points = np.random.default_rng(0).normal(size=(5, 3))
    expected = to_metres_z_up(points, units=units, up=up)
    matrix = np.array(script.to_metres_z_up(units, up, kind=".obj"))
    assert_allclose(points @ matrix[:3, :3].T, expected, atol=1e-15)
    in_blender = np.stack([points[:, 0], -points[:, 2], points[:, 1]], 1)  # what its glTF importer makes of a file
    matrix = np.array(script.to_metres_z_up(units, up, kind=".glb"))
    assert_allclose(in_blender @ matrix[:3, :3].T, expected, atol=1e-15)
    assert matrix[3].tolist() == [0, 0, 0, 1] and not matrix[:3, 3].any()


def test_files_by_number(script: ModuleType, captures: Path) -> None:
    for kind in ("obj", "ply", "plain"):
        files = script.captured_files(captures / kind)
        sequence = opened(captures, kind)[0]
        assert files == dict(zip(sequence.numbers, sequence.files, strict=True))
    assert set(script.IMPORTS) == set(PARSERS) - {".drc"}


class Thing(SimpleNamespace):
    """An object of Blender that remembers its keys."""

    __hash__ = object.__hash__  # type: ignore[assignment]

    def __init__(self, name: str) -> None:
        super().__init__(name=name, parent=None, matrix_basis=np.eye(4), keys={})

    def keyframe_insert(self, name: str, *, frame: int) -> None:
        self.keys[name, frame] = getattr(self, name)


class Blender(SimpleNamespace):
    """As much of Blender as the script touches."""

    def __init__(self) -> None:
        objects = _Objects()
        linked = SimpleNamespace(objects=SimpleNamespace(link=lambda thing: None))
        self.scene = SimpleNamespace(render=SimpleNamespace(), collection=linked)
        preferences = SimpleNamespace(edit=SimpleNamespace())

        def read(filepath: str, **axes: str) -> None:
            assert axes == {"forward_axis": "Y", "up_axis": "Z"}
            objects.new(filepath, None)

        super().__init__(
            data=SimpleNamespace(objects=objects),
            context=SimpleNamespace(scene=self.scene, preferences=preferences),
            ops=SimpleNamespace(wm=SimpleNamespace(obj_import=read, ply_import=read), import_scene=None),
        )
        self.scene = self.context.scene


class _Objects:
    def __init__(self) -> None:
        self.all: list[Thing] = []

    def __iter__(self) -> Iterator[Thing]:
        return iter(self.all)

    def new(self, name: str, data: None) -> Thing:
        self.all.append(Thing(name))
        return self.all[-1]


def test_what_is_asked_of_blender(
    script: ModuleType, captures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = scene_of({"x": opened(captures, "ply"), "y": opened(captures, "plain")}, {"x": SOURCE, "y": SOURCE[::-1]})
    toml = f'[subjects.x]\npath = "{captures}/ply"\nunits = "cm"\nup = "y"\n[subjects.x.parts]\n'
    toml += f'hand = {{label = 3}}\nstick = {{path = "{captures}/plain"}}\n[subjects.y]\npath = "{captures}/plain"\n'
    (tmp_path / "scene.toml").write_text(toml)
    blender: Any = Blender()
    monkeypatch.setitem(sys.modules, "bpy", blender)
    monkeypatch.setitem(sys.modules, "mathutils", SimpleNamespace(Matrix=np.array))
    monkeypatch.setattr(script, "OUT", write_edit(tmp_path / "out", scene.edit, tmp_path / "scene.toml"))
    script.main()
    stands = {thing.name: thing for thing in blender.data.objects if thing.parent is None}
    assert list(stands) == ["x", "y"]
    for name, edit in scene.edit.subjects.items():
        for k, (x, y, yaw) in enumerate(edit.placements.tolist()):
            assert stands[name].keys["location", k] == (x, y, 0.0)
            assert stands[name].keys["rotation_euler", k] == (0.0, 0.0, yaw)
    hung = [thing for thing in blender.data.objects if thing.parent is not None]
    assert len(hung) == 3 * len(NUMBERS)
    by_place = {(t.parent.name, Path(t.name).parent.name): t for t in hung}
    assert set(by_place) == {("x", "ply"), ("x", "plain"), ("y", "plain")}
    assert by_place["x", "ply"].matrix_basis[2, 1] == 0.01 and by_place["y", "plain"].matrix_basis[2, 2] == 1.0
    first = next(t for t in hung if t.name.endswith("p_3.ply"))
    hidden = {frame: value for (key, frame), value in first.keys.items() if key == "hide_render"}
    assert hidden == {0: False, 2: True}
    assert (blender.scene.frame_start, blender.scene.frame_end) == (0, len(SOURCE) - 1)
    assert blender.scene.render.fps / blender.scene.render.fps_base == pytest.approx(24.0)
