from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pytest import approx

from mhvedit.errors import CaptureError, ShapeError
from mhvedit.skeleton.bvh import read_bvh
from mhvedit.skeleton.bvh_motion import bvh_of, read_bvh_motion, write_bvh_motion
from mhvedit.skeleton.bvh_text import write_bvh_text
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.limits import beyond_limits, said_beyond_limits
from mhvedit.skeleton.model import Motion
from mhvedit.skeleton.roles import joint_roles
from tests.collision.bodies import boxes_on_sliders
from tests.skeleton.test_bvh import ARM, FILES, bvh
from tests.skeleton.trees import random_skeleton

LEG = ARM.replace("Upper Arm", "LeftLeg").replace("CHANNELS 3 Zrotation Xrotation Yrotation", "CHANNELS 1 Xrotation")
LEG = LEG.replace("0 0 0 0 0 0\n", "0 0 0 0\n").replace("30 40 50 60", "30 40")


@pytest.mark.parametrize(("units", "up"), [("m", "z"), ("cm", "y"), ("mm", "x")])
def test_joints_are_where_the_reader_of_positions_has_them(tmp_path: Path, units: str, up: str) -> None:
    for text in (ARM, LEG):
        take = read_bvh_motion(bvh(tmp_path, text), units=units, up=up)
        positions = joint_frames(take.skeleton, take.motion.q)[1]
        assert positions == approx(read_bvh(tmp_path / "a.bvh", units=units, up=up).tracks.positions)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_shared_files_come_back_letter_by_letter(tmp_path: Path, path: Path) -> None:
    take = read_bvh_motion(path)
    assert joint_frames(take.skeleton, take.motion.q)[1] == approx(read_bvh(path).tracks.positions, abs=1e-12)
    write_bvh_motion(tmp_path / "b.bvh", take, take.motion)
    assert (tmp_path / "b.bvh").read_text().split() == path.read_text().split()


@pytest.mark.parametrize(("units", "up"), [("m", "z"), ("cm", "y"), ("mm", "x")])
@pytest.mark.parametrize("text", [ARM, LEG])
def test_only_edited_frames_change_and_read_back_as_edited(tmp_path: Path, text: str, units: str, up: str) -> None:
    take = read_bvh_motion(bvh(tmp_path, text), units=units, up=up)
    q = take.motion.q.copy()
    q[1, -1] += 0.2
    write_bvh_motion(tmp_path / "b.bvh", take, Motion(q, take.motion.fps))
    before, after = ((tmp_path / name).read_text().splitlines() for name in ("a.bvh", "b.bvh"))
    assert before[:-1] == after[:-1]
    again = read_bvh_motion(tmp_path / "b.bvh", units=units, up=up)
    frames, expected = joint_frames(again.skeleton, again.motion.q), joint_frames(take.skeleton, q)
    assert frames[0] == approx(expected[0], abs=1e-7)
    assert frames[1] == approx(expected[1], abs=1e-6)


def test_angles_in_the_file_stay_near_those_that_were_there(tmp_path: Path) -> None:
    text = ARM.replace("3 1 2 10 20 30 40 50 60", "3 1 2 370 20 30 40 150 60")
    take = read_bvh_motion(bvh(tmp_path, text))
    q = take.motion.q + 0.001
    write_bvh_motion(tmp_path / "b.bvh", take, Motion(q, take.motion.fps))
    moved = read_bvh_motion(tmp_path / "b.bvh").text.values - take.text.values
    assert np.abs(moved[1, 3:]).max() < 1.0


def test_another_number_of_frames_and_another_rate(tmp_path: Path) -> None:
    take = read_bvh_motion(bvh(tmp_path, ARM))
    write_bvh_motion(tmp_path / "b.bvh", take, Motion(take.motion.q[[0, 0, 1, 1, 1]], 50.0))
    again = read_bvh_motion(tmp_path / "b.bvh")
    assert again.motion.n_frames == 5
    assert again.motion.fps == 50.0


def test_one_frame_is_a_motion(tmp_path: Path) -> None:
    take = read_bvh_motion(bvh(tmp_path, ARM.replace("Frames: 2", "Frames: 1").rsplit("\n", 2)[0] + "\n"))
    assert take.motion.n_frames == 1


def test_a_new_file_for_any_skeleton(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    tree = random_skeleton(rng, 7)
    motion = Motion(rng.normal(size=(4, tree.n_dofs)), 25.0)
    take = bvh_of(tree, motion, units="cm", up="y")
    write_bvh_text(tmp_path / "new.bvh", take.text)
    tracks = read_bvh(tmp_path / "new.bvh", units="cm", up="y").tracks
    expected = joint_frames(tree, motion.q)[1]
    for joint, name in enumerate(tree.names):
        assert tracks.positions[:, tracks.joints.index(name)] == approx(expected[:, joint], abs=1e-6)


def test_bones_without_length_are_noted(tmp_path: Path) -> None:
    take = read_bvh_motion(bvh(tmp_path, ARM.replace("OFFSET 1 0 0", "OFFSET 0 0 0")))
    assert take.notes == ("line 6: the bone to Upper Arm has no length",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            ARM.replace("MOTION", "ROOT Box\n{\nOFFSET 0 0 0\nCHANNELS 0\n}\nMOTION"),
            "line 16: expected one ROOT, found another",
        ),
        (ARM.replace("40 50 60", "40 50 nan"), "line 20: expected finite numbers, found 'nan'"),
        (ARM.replace("40 50 60", "40 50"), "line 20: expected 9 channel values, found 8"),
        (
            ARM.replace("  CHANNELS 3 Zrotation Xrotation Yrotation\n", ""),
            "expected CHANNELS for Upper Arm, found none",
        ),
    ],
)
def test_bad_files_are_refused_with_the_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        read_bvh_motion(bvh(tmp_path, text))


def test_a_skeleton_that_slides_below_its_root_has_no_bvh(tmp_path: Path) -> None:
    tree = boxes_on_sliders(np.ones((1, 3)), np.zeros((1, 3))).skeleton
    with pytest.raises(ShapeError, match="no slides but the root's, found box0 slides"):
        bvh_of(tree, Motion(np.zeros((1, 6)), 30.0))


def test_angles_beyond_the_limits_are_said_and_not_clipped(tmp_path: Path) -> None:
    human = ARM.replace("Hips", "Pelvis").replace("Upper Arm", "Neck").replace("40 50 60", "0 0 80")
    take = read_bvh_motion(bvh(tmp_path, human))
    beyond = beyond_limits(take.skeleton, take.motion)
    assert [take.skeleton.dof_names[d] for d in beyond.dof] == ["Neck.y"]
    assert beyond.excess == approx(np.radians([30.0]))
    (said,) = said_beyond_limits(take.skeleton, take.motion)
    assert said == "Neck.y is beyond its limits of -50 to 50 degrees in 1 frames, by 30.0 degrees in frame 1"
    wider = replace(take.skeleton, limits=np.full((take.skeleton.n_dofs, 2), [-np.inf, np.inf]))
    assert len(beyond_limits(wider, take.motion).dof) == 0


@pytest.mark.parametrize(
    "pairs",
    [
        "mixamorig:Hips=pelvis mixamorig:LeftShoulder=left_clavicle mixamorig:LeftArm=left_upper_arm",
        "Hips=pelvis Chest=spine LeftCollar=left_clavicle LeftShoulder=left_upper_arm LeftElbow=left_forearm",
        "pelvis=pelvis l_hip=left_thigh r_knee=right_shin",
        "hip=pelvis abdomen=spine lShldr=left_upper_arm rForeArm=right_forearm lThigh=left_thigh rFoot=right_foot",
        "Pelvis=pelvis L5=spine L3=spine T8=spine RightUpperArm=right_upper_arm LeftToe=left_toe",
        "upperarm.L=left_upper_arm foot.R=right_foot Prop1=",
    ],
)
def test_joints_are_known_by_the_names_of_many_programs(pairs: str) -> None:
    names, roles = zip(*(pair.split("=") for pair in pairs.split()), strict=True)
    assert joint_roles(names) == roles
