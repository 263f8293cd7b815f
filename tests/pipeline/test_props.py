"""Props through the edited scene: an arm sweeps a ball off a table, and a recorded box is carried through."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mhvedit.errors import CaptureError, SceneError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.pipeline.job import Result, load, solve
from mhvedit.pipeline.run import run_scene
from mhvedit.scene.edit import EditedScene, edit_as_dict, placed_mesh, placed_prop, read_edit
from mhvedit.skeleton.bvh import read_joint_motion
from mhvedit.volumes.voxelise import solid_voxels
from tests.pipeline.props_scene import BALL_KEYS, N_FRAMES, RADIUS, TABLE, TABLE_KEYS, TOP, write_ball, write_sweep
from tests.pipeline.toy import CORNERS, FACES, obj_text

BVH = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "bvh" / "box_throw_small_box_part1_30fps.bvh"
MM = 1e-3
CUBE = obj_text((0.1 * CORNERS - 0.05, FACES))
BOX_KEYS = '[props.box]\npath = "box.obj"\nclass = "driven"\nmotion = "box.bvh"\n'


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """An arm has swept a ball off a table."""
    return solve(load(write_sweep(tmp_path_factory.mktemp("sweep"))))


def edit_of(result: Result) -> EditedScene:
    assert result.assembly is not None, result.failure
    return result.assembly.scene


def centres(scene: EditedScene) -> FloatArray:
    """(N, 3) m, the middle of the ball, which is modelled where it lies on the table."""
    ball = scene.props["ball"]
    return np.asarray(Rotation.from_quat(ball.rotations).apply([0.0, 0.0, TOP + RADIUS]) + ball.positions)


def write_motion(path: Path, rows: Sequence[tuple[float, ...]]) -> None:
    """A BVH file of one joint, 30 frames a second."""
    head = (
        "HIERARCHY\nROOT Box\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Xrotation Yrotation Zrotation\n"
    )
    head += f"End Site\n{{\nOFFSET 0 0 0\n}}\n}}\nMOTION\nFrames: {len(rows)}\nFrame Time: 0.0333333\n"
    path.write_text(head + "".join(" ".join(map(repr, row)) + "\n" for row in rows))


def test_the_ball_lies_still_until_it_is_touched(swept: Result) -> None:
    there = centres(edit_of(swept))
    tips = [0.22 + 0.34 * np.clip((k - 5) / 15, 0, 1) for k in range(N_FRAMES)]
    reach = 0.45 - np.sqrt(RADIUS**2 - (1.2 - 1.18) ** 2)  # where the lower edge of the arm's tip meets the ball
    first = next(k for k, tip in enumerate(tips) if tip > reach)
    assert np.abs(there[:first] - [0.45, -0.15, TOP + RADIUS]).max() < 0.5 * MM
    assert there[first + 2, 0] > 0.45 + 5 * MM


def test_it_falls_rolls_and_rests(swept: Result) -> None:
    there = centres(edit_of(swept))
    floor = np.abs(there[:, 2] - RADIUS) < MM
    assert there[-1, 0] > TABLE[1][0] + RADIUS and floor[-30:].all()
    in_flight = (there[:, 0] > TABLE[1][0] + 0.06) & (there[:, 2] > RADIUS + 0.05)
    falls = [k for k in range(2, N_FRAMES) if in_flight[k - 2 : k + 1].all() and there[k, 2] < there[k - 1, 2]]
    fall = there[falls[2:6]]
    np.testing.assert_allclose(np.diff(fall[:, 2], 2) * 30**2, -9.81, rtol=0.02)
    speed = np.linalg.norm(np.diff(there, axis=0), axis=1) * 30
    rolling = speed[floor[1:]]
    assert rolling[:10].max() > 0.2 and speed[-5:].max() < MM


def test_it_rolls_without_sliding(swept: Result) -> None:
    edit = edit_of(swept)
    there, turns = centres(edit), Rotation.from_quat(edit.props["ball"].rotations)
    floor = np.flatnonzero(np.abs(there[:, 2] - RADIUS) < MM)
    k = next(k for k in floor if np.isin(np.arange(k - 10, k + 1), floor).all())
    turned = (turns[k] * turns[k - 1].inv()).magnitude()
    assert turned * RADIUS == pytest.approx(np.linalg.norm(there[k] - there[k - 1]), rel=0.03)


def test_nothing_is_in_anything(swept: Result) -> None:
    edit = edit_of(swept)
    for k, middle in enumerate(centres(edit)):
        low, high = np.array(TABLE)
        assert middle[2] > RADIUS - MM
        assert np.linalg.norm(np.clip(middle, low, high) - middle) > RADIUS - MM
        mesh = placed_mesh(edit, {"anna": swept.people["anna"].sequence}, "anna", k)
        if np.linalg.norm(middle - [0.4, -0.15, 1.2]) < 0.5:
            grid, filled = solid_voxels(mesh, 0.01)
            points = (np.argwhere(filled) + np.array(grid.start)) * 0.01
            assert np.linalg.norm(points - middle, axis=1).min() > RADIUS - 5 * MM, k
    assert swept.assembly is not None and not swept.assembly.notes


def test_the_same_again_and_from_the_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    job = load(write_sweep(tmp_path / "a", n_frames=20), cache=tmp_path / "cache")
    first = edit_as_dict(edit_of(solve(job)))
    assert edit_as_dict(edit_of(solve(load(write_sweep(tmp_path / "a2", n_frames=20))))) == first
    monkeypatch.setattr("mhvedit.pipeline.props_world.Among.step", None)
    assert edit_as_dict(edit_of(solve(load(job.scene.file, cache=tmp_path / "cache")))) == first


def test_the_output_holds_it(tmp_path: Path) -> None:
    scene = write_sweep(tmp_path, TABLE_KEYS + "place = [0.4, 0.0, 0.0]\n", n_frames=4)
    run_scene(scene, tmp_path / "out", report=False)
    told = json.loads((tmp_path / "out" / "edit.json").read_text())["props"]
    assert set(told) == {"table"} and told["table"]["source"] == "table.obj" and told["table"]["class"] == "fixed"
    assert told["table"]["position"] == [[0.4, 0.0, 0.0]] * 4 and told["table"]["rotation"] == [[0, 0, 0, 1]] * 4
    read = read_edit(tmp_path / "out" / "edit.json")
    assert edit_as_dict(read)["props"] == told
    assert json.loads((tmp_path / "out" / "report.json").read_text())["entered"] == []


def test_who_reaches_into_a_table_is_told(tmp_path: Path) -> None:
    high = TABLE_KEYS.replace("table.obj", "high.obj")
    scene = write_sweep(tmp_path, high, n_frames=24)
    low, top = np.array([0.45, -0.4, 1.0]), np.array([0.7, 0.1, 1.2])  # 20 mm above the lower side of the arm
    (tmp_path / "high.obj").write_text(obj_text((low + CORNERS * (top - low), FACES)))
    run_scene(scene, tmp_path / "out", report=False)
    told = json.loads((tmp_path / "out" / "report.json").read_text())
    [said] = told["warnings"]
    assert said.startswith("anna is not stopped at props, as no skeleton fits: it does not look like one person")
    assert "stops" not in told and "touched" not in (tmp_path / "out" / "edit.json").read_text()
    [run] = told["entered"]
    assert (run["subject"], run["prop"], run["last"]) == ("anna", "table", 23)
    assert run["depth_mm"] == pytest.approx(20, abs=1)
    assert run["sentence"] == f"anna enters table by {run['depth_mm']:.0f} mm in frames {run['first']} to 23"


def test_a_driven_box_follows_its_motion(tmp_path: Path) -> None:
    rows = [(0.1 * k, 0.5, 1.0, 0.0, 0.0, 9.0 * k) for k in range(10)]
    write_motion(tmp_path / "box.bvh", rows)
    (tmp_path / "box.obj").write_text(CUBE)
    result = solve(load(write_sweep(tmp_path, BOX_KEYS + "place = [1, 2, 90]\n", n_frames=16)))
    box = edit_of(result).props["box"]
    k = np.minimum(np.arange(16), 9)
    np.testing.assert_allclose(box.positions, np.stack([0 * k + 0.5, 2 + 0.1 * k, 0 * k + 1], 1), atol=1e-3)
    np.testing.assert_allclose(
        Rotation.from_quat(box.rotations).as_euler("ZYX", degrees=True)[:, 0], 90 + 9 * k, atol=0.1
    )
    assert result.assembly is not None
    [said] = result.assembly.notes
    assert said == "props.box: its motion is over after 10 of 16 frames; from then on it keeps still"


@pytest.mark.skipif(not BVH.is_file(), reason="no shared data here")
def test_the_recorded_box(tmp_path: Path) -> None:
    motion = read_joint_motion(BVH)
    (tmp_path / "box.bvh").write_bytes(BVH.read_bytes())
    (tmp_path / "box.obj").write_text(obj_text((0.3 * CORNERS - 0.15, FACES)))
    scene = write_sweep(tmp_path, BOX_KEYS, n_frames=20)
    track = edit_of(solve(load(scene))).props["box"]
    np.testing.assert_allclose(track.positions, motion.positions[:20], atol=1e-4)
    turns = Rotation.from_quat(track.rotations).as_matrix()
    np.testing.assert_allclose(turns, motion.rotations[:20], atol=1e-4)


def test_a_fast_box_does_not_pass_through_a_ball(tmp_path: Path) -> None:
    rows = [(1.0 + 0.6 * (k - 4) if k > 4 else 1.0, 2.0, 0.1, 0.0, 0.0, 0.0) for k in range(12)]  # 18 m/s
    write_motion(tmp_path / "box.bvh", rows)
    (tmp_path / "box.obj").write_text(CUBE)
    keys = BOX_KEYS + BALL_KEYS.replace("[0.45, -0.15, 0]", "[1.5, 2.0, 0]")
    scene = write_sweep(tmp_path, keys, n_frames=10)
    write_ball(tmp_path / "ball.obj", height=RADIUS)
    edit = edit_of(solve(load(scene)))
    box, ball = edit.props["box"], edit.props["ball"]
    middle = Rotation.from_quat(ball.rotations).apply([0, 0, RADIUS]) + ball.positions
    assert (middle[:, 0] - box.positions[:, 0] > 0.05 + RADIUS - 2 * MM).all()
    assert middle[-1, 0] > 2.5


def test_what_begins_inside_somebody_is_moved_out_and_it_is_said(tmp_path: Path) -> None:
    keys = BALL_KEYS.replace("[0.45, -0.15, 0]", "[0.2, -0.01, 0]")  # 30 mm in the chest
    result = solve(load(write_sweep(tmp_path, keys, n_frames=3)))
    assert result.assembly is not None
    [said] = result.assembly.notes
    assert said.startswith("props.ball: begins 30 mm inside anna; moved out of it, by 3")
    assert (
        placed_prop(edit_of(result), {"ball": result.job.props["ball"].sequence}, "ball", 0).vertices[:, 0].min()
        > 0.125
    )


CUP = '[props.cup]\npath = "cup.obj"\nclass = "simulated"\n'
BAD = {
    "open": (CUP, "props.cup.path: expected a closed mesh, as props are simulated, found 3 open edges"),
    "flat": (CUP.replace("cup.obj", "flat.obj"), "props.cup.path: expected a mesh that encloses a volume"),
    "off": (
        BALL_KEYS.replace("0.45, -0.15", "7, 8"),
        "props.ball.place: expected a place on the floor, found [7.00, 8.00]",
    ),
    "still": (
        CUP.replace("simulated", "driven"),
        'props.cup: expected a motion, or captured frames, of what is "driven", found a single mesh',
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_what_cannot_be_simulated(tmp_path: Path, what: str) -> None:
    keys, sentence = BAD[what]
    scene = write_sweep(tmp_path, keys, n_frames=3)
    (tmp_path / "cup.obj").write_text(obj_text((CORNERS, FACES[:-1])))
    (tmp_path / "flat.obj").write_text(obj_text((CORNERS * [1, 1, 0], FACES)))
    text = scene.read_text().replace("[stage]\n", "[stage]\nfloor = [[-4, -4], [4, -4], [4, 4], [-4, 4]]\n")
    scene.write_text(text)
    with pytest.raises(SceneError) as error:
        load(scene)
    assert str(error.value).startswith(f"{scene}: {sentence}")


def test_an_unknown_joint(tmp_path: Path) -> None:
    write_motion(tmp_path / "box.bvh", [(0.0,) * 6] * 3)
    (tmp_path / "box.obj").write_text(CUBE)
    keys = BOX_KEYS.replace('"box.bvh"', '{path = "box.bvh", joint = "Lid"}')
    with pytest.raises(CaptureError, match=r"expected a joint 'Lid', found Box"):
        load(write_sweep(tmp_path, keys, n_frames=3))
