"""The shared scenes at their true poses: our figures are the judge's, and every type holds on the meshes."""

import importlib.util
import json
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from mhvedit.geometry.arrays import BoolArray
from mhvedit.geometry.planar import apply_pose
from mhvedit.scene.checks import check_scene
from mhvedit.scene.contact import TOUCH, ContactSlack, touch_string
from mhvedit.scene.edit import EditedScene, SegmentEdit, SubjectEdit
from mhvedit.scene.report import SceneReport
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.sequences.read import open_capture

SHARED = Path(__file__).resolve().parents[2].parent / "shared"
pytestmark = pytest.mark.skipif(not (SHARED / "data" / "scenes").is_dir(), reason="no shared data here")
CONTACTS = {"greeting": 10, "pushup_grab": 2, "salsa_open": 2}
VOXEL = 0.01


@pytest.fixture(scope="module")
def judge() -> ModuleType:
    spec = importlib.util.spec_from_file_location("judge", SHARED / "tools" / "judge.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Take:
    """A shared scene of which only some frames of each key segment are shown, at the true pose."""

    def __init__(self, name: str, judge: ModuleType, most: int) -> None:
        self.folder = SHARED / "data" / "scenes" / name
        self.spec: dict[str, Any] = tomllib.loads((self.folder / "scene.toml").read_text())
        true = json.loads((self.folder / "truth.json").read_text())["relative"]
        self.relative = np.array([true["x"], true["y"], true["yaw"]])
        self.captures = {n: open_capture(self.folder / n, name=n) for n in "ab"}
        self.judge, self.tracks = judge, dict[Any, Any]()
        self.scaled = {n: judge.Capture(self.folder, self.spec["subjects"][n]) for n in "ab"}
        sources: dict[str, list[int]] = {"a": [], "b": []}
        segments = []
        for asked in self.spec["segments"]:
            start = len(sources["a"])
            shown = min(most, *(1 + np.diff(asked["frames"][n])[0] for n in "ab"))
            for n in "ab":
                sources[n] += (
                    np.rint(np.linspace(asked["frames"][n][0], asked["frames"][n][1], shown)).astype(int).tolist()
                )
            span = (asked["name"], start, start + shown, asked["interaction"], ("a", "b"))
            segments.append(SegmentEdit(*span, 0.0, 0.0, 0.0, self.relative))
        n_frames = len(sources["a"])
        placed = {"a": np.zeros((n_frames, 3)), "b": np.tile(self.relative, (n_frames, 1))}
        subjects = {n: SubjectEdit(np.array(sources[n]), placed[n]) for n in "ab"}
        self.scene = EditedScene(name, 25.0, n_frames, subjects, tuple(segments), 0.0, 0.0, 0.0)

    def belongs(self, subject: str, part: str, number: int, mesh: Mesh) -> BoolArray:
        options = self.folder, self.spec["subjects"][subject], part, self.scaled[subject], number, mesh.vertices
        return np.asarray(self.judge.part_mask(*options, self.tracks))

    def check(self, workers: int = 1) -> SceneReport:
        asked = self.spec["segments"]
        return check_scene(
            self.scene,
            self.captures,
            part_vertices=self.belongs,
            parts_of_segment={s["name"]: tuple(s.get("parts", {}).get(n, "body") for n in "ab") for s in asked},
            slack={
                s["name"]: ContactSlack(
                    frames=s["tolerance"]["frames"],
                    near=max(TOUCH, s["tolerance"]["voxels"] * VOXEL),
                    overlap=s["tolerance"]["apart"],
                )
                for s in asked
            },
            workers=workers,
        )

    def meshes(self, k: int) -> tuple[Mesh, Mesh]:
        a, b = (self.captures[n].mesh(int(self.scene.subjects[n].source[k])) for n in "ab")
        return a, Mesh(apply_pose(self.relative, b.vertices), b.faces)


def judged(judge: ModuleType, a: Mesh, b: Mesh, mask_a: BoolArray, mask_b: BoolArray) -> float:
    there = judge.gap(a.vertices, a.faces, b.vertices[mask_b])
    return float(min(there, judge.gap(b.vertices, b.faces, a.vertices[mask_a])))


@pytest.mark.parametrize(("name", "most"), [("greeting", 3), ("pushup_grab", 4), ("salsa_open", 4)])
def test_depths_and_touch_are_the_judge_s(name: str, most: int, judge: ModuleType) -> None:
    take = Take(name, judge, most)
    report = take.check()
    for segment in report.segments:
        bodies, parts = [], []
        for k in range(segment.start, segment.stop):
            a, b = take.meshes(k)
            whole = [np.ones(len(m.vertices), np.bool_) for m in (a, b)]
            numbers = [int(take.scene.subjects[n].source[k]) for n in "ab"]
            masks = [
                take.belongs(n, part, number, take.captures[n].mesh(number))
                for n, part, number in zip("ab", segment.parts, numbers, strict=True)
            ]
            bodies.append(judged(judge, a, b, *whole))
            parts.append(judged(judge, a, b, *masks))
        near = np.array(bodies) < 0.1
        longer = np.array(bodies)[near] - segment.body_gap[near]  # the judge knows no distances between edges
        assert (longer > -1e-4).all() and (longer < 3e-3).all()
        assert segment.deepest == pytest.approx(max(0.0, -min(bodies)), abs=1e-4)
        assert touch_string(segment.body_gap) == touch_string(np.array(bodies))
        assert touch_string(segment.reach_gap) == touch_string(np.array(parts))


@pytest.mark.parametrize("name", ["greeting", "pushup_grab", "salsa_open", "box_follow"])
def test_true_poses_do_what_their_types_ask(name: str, judge: ModuleType) -> None:
    report = Take(name, judge, 7).check()
    assert len(report.segments) == CONTACTS.get(name, 1)
    for segment in report.segments:
        assert segment.verdict.agrees, f"{segment.name}: {segment.verdict.sentence}"


def test_threads_do_not_change_the_result(judge: ModuleType) -> None:
    take = Take("pushup_grab", judge, 2)
    assert take.check().pairs[0].gap.tolist() == take.check(workers=2).pairs[0].gap.tolist()


def test_real_captures_with_holes() -> None:
    folder = SHARED / "data" / "captures"
    captures: dict[str, MeshSequence] = {n: open_capture(folder / n, name=n) for n in ("dancer", "basketball_player")}
    middles = {n: c.mesh(c.numbers[0]).vertices.mean(0) for n, c in captures.items()}
    subjects = {
        n: SubjectEdit(np.array([captures[n].numbers[0]]), np.array([[shift - middles[n][0], -middles[n][1], 0.0]]))
        for n, shift in (("dancer", 0.0), ("basketball_player", 0.3))
    }
    scene = EditedScene("real", 30.0, 1, subjects, (), 0.0, 0.0, 0.0)
    report = check_scene(scene, captures, part_vertices=lambda *_: np.zeros(0, np.bool_), parts_of_segment={})
    assert 0.01 < report.deepest < 0.3
