"""Hands stop at fixed props: a captured person reaches into a table, through the whole job."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from mhvedit.geometry.arrays import FloatArray
from mhvedit.pipeline.export import ExportSettings, export_output
from mhvedit.pipeline.run import Outcome, check_output, run_scene
from mhvedit.scene.edit import EditedScene, placed_mesh, read_edit, touched_path
from mhvedit.scene.report import Thresholds
from mhvedit.scene.shown import OWN
from mhvedit.sequences.meshes import MeshSequence
from mhvedit.sequences.read import open_capture
from mhvedit.sequences.tracks import read_tracks
from mhvedit.viewer.material import assembled
from tests.pipeline.toy import Actor, write_actor

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "scenes" / "greeting"
FIRST, LAST = 23, 52
TABLE = ((-0.6, -0.42, 0.4), (0.2, 0.3, 0.98))  # m; the right hand comes down through its top, and goes up again
MM = 1e-3
SCENE = """\
version = 1
name = "reach"

[subjects.a]
path = "{shared}/a"
frames = [{first}, {last}]
fps = 25
[subjects.a.parts]
hand = {{track = "{shared}/a.csv", joint = "RightHand", radius = 0.1}}
[subjects.b]
path = "b"
fps = 25
facing = "b.csv"

[[segments]]
name = "stand"
between = ["a", "b"]
frames = {{a = [{first}, {second}], b = [{first}, {second}]}}
interaction = "none"
visibility = false

[search]
voxel = 0.05
step = 0.2
yaw_step = 90

[stage]
pin = "a"
[[stage.marks]]
subject = "b"
frame = {first}
at = [1.5, -1.5]
within = 0.5

[props.table]
path = "table.obj"
"""

pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason="no shared data here")


@dataclass(frozen=True, slots=True)
class Reached:
    folder: Path
    outcome: Outcome
    edit: EditedScene
    capture: MeshSequence

    @property
    def out(self) -> Path:
        return self.folder / "out"

    def pair(self, frame: int) -> tuple[FloatArray, FloatArray]:
        """Vertices in the world as captured, and as shown."""
        plain = replace(self.edit, subjects={"a": replace(self.edit.subjects["a"], touched=None)})
        captures = {"a": self.capture}
        return tuple(placed_mesh(scene, captures, "a", frame).vertices for scene in (plain, self.edit))  # type: ignore


@pytest.fixture(scope="module")
def reached(tmp_path_factory: pytest.TempPathFactory) -> Reached:
    folder = tmp_path_factory.mktemp("stops")
    trimesh.creation.box(bounds=TABLE).export(folder / "table.obj")
    write_actor(folder, "b", Actor(long=0.22, numbers=range(FIRST, LAST + 1)))
    text = SCENE.format(shared=SHARED, first=FIRST, second=FIRST + 1, last=LAST)
    (folder / "scene.toml").write_text(text)
    outcome = run_scene(folder / "scene.toml", folder / "out", report=False)
    return Reached(
        folder, outcome, read_edit(folder / "out" / "edit.json"), open_capture(SHARED / "a", name="a", fps=25)
    )


def depth_of(vertices: FloatArray) -> float:
    """m in the table, told by another library; negative outside, but only near it."""
    table = trimesh.creation.box(bounds=TABLE)
    near = vertices[((vertices > np.array(TABLE[0]) - 0.02) & (vertices < np.array(TABLE[1]) + 0.02)).all(1)]
    return float(trimesh.proximity.signed_distance(table, near).max()) if len(near) else -1.0


def test_no_vertex_is_left_in_the_table(reached: Reached) -> None:
    pairs = [reached.pair(frame) for frame in range(reached.edit.n_frames)]
    captured, shown = (np.array([depth_of(pair[which]) for pair in pairs]) for which in (0, 1))
    assert captured.max() > 100 * MM
    assert shown.max() < 2 * MM
    deep = captured > 30 * MM
    assert (shown[deep] > -12 * MM).all(), "and the hand lies on it"


def test_the_rest_of_her_and_all_other_frames_are_as_captured(reached: Reached) -> None:
    touched = reached.edit.subjects["a"].touched
    assert touched is not None
    captured_deep = [k for k in range(reached.edit.n_frames) if depth_of(reached.pair(k)[0]) > 5 * MM]
    assert set(captured_deep) <= set(touched.frames) < set(range(reached.edit.n_frames))
    for k in range(reached.edit.n_frames):
        captured, shown = reached.pair(k)
        if k not in touched.frames:
            np.testing.assert_array_equal(shown, captured)
        low = captured[:, 2] < 0.6
        np.testing.assert_allclose(shown[low], captured[low], atol=1e-9)


def test_nothing_pops(reached: Reached) -> None:
    tracks = read_tracks(SHARED / "a.csv")
    hands = tracks.positions[:, tracks.joints.index("RightHand")]
    path, moved = [], []
    for k in range(reached.edit.n_frames):
        captured, shown = reached.pair(k)
        hand = hands[np.flatnonzero(tracks.numbers == reached.edit.subjects["a"].source[k])[0]]
        near = (
            np.linalg.norm(reached.capture.mesh(int(reached.edit.subjects["a"].source[k])).vertices - hand, axis=1)
            < 0.1
        )
        moved.append((shown - captured)[near].mean(0))
        path.append(captured[near].mean(0))
    steps = np.linalg.norm(np.diff(np.array(path), axis=0), axis=1)
    after = np.linalg.norm(np.diff(np.array(path) + moved, axis=0), axis=1)
    assert np.linalg.norm(moved, axis=1).max() > 50 * MM
    assert after.max() < 1.2 * steps.max()


def test_the_check_and_the_report_agree(reached: Reached) -> None:
    told = json.loads((reached.out / "report.json").read_text())
    assert told["entered"] == []
    [stop] = told["stops"]
    assert (stop["subject"], stop["prop"], stop["limbs"], stop["why"]) == ("a", "table", ["right arm"], "")
    assert stop["before_mm"] > 100 > 3 > stop["after_mm"]
    assert stop["sentence"].startswith(f"a: right arm stopped at table in frames {stop['first']} to {stop['last']}, ")
    report, _ = check_output(reached.out, thresholds=Thresholds())
    [pair] = [pair for pair in report.pairs if pair.between == ("a", "table")]
    assert pair.gap.min() > -2 * MM


def test_a_second_run_redoes_nothing(reached: Reached, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("stops_person.stopped_meshes", "fitted.fit_capture", "depths.depths_of"):
        monkeypatch.setattr(f"mhvedit.pipeline.{name}", None)
    before = {file: file.stat().st_mtime_ns for file in reached.out.glob("*/*.npz")}
    again = run_scene(reached.folder / "scene.toml", reached.out, report=False)
    assert not again.redone
    assert {file: file.stat().st_mtime_ns for file in reached.out.glob("*/*.npz")} == before
    assert again.report["stops"] == json.loads((reached.out / "report.json").read_text())["stops"]


def test_exports_show_the_stopped_hand(reached: Reached) -> None:
    touched = reached.edit.subjects["a"].touched
    assert touched is not None
    middle = touched.frames[len(touched.frames) // 2]
    export_output(reached.out, reached.folder / "objs", ExportSettings(), force=True)
    mesh = trimesh.load(reached.folder / "objs" / "a" / f"a_{middle:04d}.obj", process=False)
    captured, shown = reached.pair(middle)
    np.testing.assert_allclose(mesh.vertices, shown, atol=1e-5)
    assert np.abs(shown - captured).max() > 20 * MM
    export_output(reached.out, reached.folder / "flat.usda", ExportSettings(), force=True)
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(reached.folder / "flat.usda"))
    [prim] = [p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh) and "/a/" in str(p.GetPath())]
    points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(float(middle)))
    world = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(float(middle)))
    np.testing.assert_allclose(points @ world[:3, :3] + world[3, :3], shown, atol=1e-4)


def test_the_viewer_shows_it(reached: Reached) -> None:
    job, result = reached.outcome.result.job, reached.outcome.result
    material = assembled(job, result.people, (), reached.edit, ())
    touched = reached.edit.subjects["a"].touched
    assert touched is not None
    frame = touched.frames[0]
    number = int(material.tracks["a"].source[frame])
    assert number == OWN + frame
    actor = material.cast["a"]
    np.testing.assert_array_equal(actor.sequence.mesh(number).vertices, touched.meshes.mesh(frame).vertices)
    captured = np.array([reached.edit.subjects["a"].source[frame]])
    np.testing.assert_array_equal(actor.centres_at(np.array([number])), actor.centres_at(captured))
    assert actor.look_at(number) is not None


def test_turned_off_it_takes_its_files_away(reached: Reached) -> None:
    """The last of this file: it changes what the others look at."""
    assert (reached.out / touched_path("a")).exists()
    with (reached.folder / "scene.toml").open("a") as file:
        file.write("stops = false\n")
    outcome = run_scene(reached.folder / "scene.toml", reached.out, check=False)
    assert not (reached.out / touched_path("a")).exists()
    assert "touched" not in (reached.out / "edit.json").read_text() and "stops" not in outcome.report
