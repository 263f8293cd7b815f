from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mhvedit.errors import CaptureError
from mhvedit.sequences.tracks import read_tracks
from mhvedit.skeleton.bvh import read_bvh

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
FILES = sorted((DATA / "bvh").glob("*.bvh")) if DATA.is_dir() else []
ARM = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Zposition Xposition Yposition Yrotation Xrotation Zrotation
  JOINT Upper Arm
  {
    OFFSET 1 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 2 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.04
3 1 2 0 0 0 0 0 0
3 1 2 10 20 30 40 50 60
"""


def bvh(tmp_path: Path, text: str) -> Path:
    (tmp_path / "a.bvh").write_text(text)
    return tmp_path / "a.bvh"


def test_channel_orders(tmp_path: Path) -> None:
    motion = read_bvh(bvh(tmp_path, ARM))
    assert motion.tracks.joints == ("Hips", "Upper Arm", "Upper Arm_end")
    assert motion.parents == (-1, 0, 1) and motion.fps == 25.0 and motion.tracks.numbers.tolist() == [0, 1]
    assert motion.tracks.positions[0].tolist() == [[1, 2, 3], [2, 2, 3], [2, 4, 3]]
    hips = Rotation.from_euler("YXZ", [10, 20, 30], degrees=True)
    arm = hips * Rotation.from_euler("ZXY", [40, 50, 60], degrees=True)
    elbow = np.array([1, 2, 3]) + hips.apply([1, 0, 0])
    assert motion.tracks.positions[1] == pytest.approx(np.array([[1, 2, 3], elbow, elbow + arm.apply([0, 2, 0])]))


def test_units_and_up_axis(tmp_path: Path) -> None:
    motion = read_bvh(bvh(tmp_path, ARM), units="cm", up="y")
    assert motion.tracks.positions[0, 0] == pytest.approx([0.01, -0.03, 0.02])


def test_positions_stand_in_place_of_offsets(tmp_path: Path) -> None:
    text = ARM.replace("CHANNELS 3 Z", "CHANNELS 4 Yposition Z").replace("3 1 2 0 0 0 0", "3 1 2 0 0 0 9 0")
    motion = read_bvh(bvh(tmp_path, text.replace("10 20 30 40", "10 20 30 9 40")))
    assert motion.tracks.positions[0, 1].tolist() == [2, 11, 3]


def test_a_prop_without_joints_and_windows_newlines(tmp_path: Path) -> None:
    head = "HIERARCHY\nROOT Box\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n}\n"
    text = head + "MOTION\nFrames: 1\nFrame Time: 0.033333\n1 2 3\n"
    motion = read_bvh(bvh(tmp_path, text.replace("\n", "\r\n")))
    assert motion.tracks.positions.tolist() == [[[1, 2, 3]]] and motion.fps == 30.0


@pytest.mark.parametrize(
    ("seconds", "fps"), [("0.033333", 30.0), ("0.0333667", 29.97), ("0.008333", 120.0), ("0.0416667", 24.0)]
)
def test_rates(tmp_path: Path, seconds: str, fps: float) -> None:
    assert read_bvh(bvh(tmp_path, ARM.replace("0.04", seconds))).fps == pytest.approx(fps, abs=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("    CHANNELS 3 Zrotation Xrotation Yrotation\n", "", "line 6: expected CHANNELS for Upper Arm, found none"),
        ("    OFFSET 1 0 0\n", "", "line 6: expected OFFSET for Upper Arm, found none"),
        (
            "CHANNELS 3 Z",
            "CHANNELS 4 Z",
            "line 9: expected CHANNELS, their number, and that many of Xposition .*, found '4 Zrot",
        ),
        ("CHANNELS 3 Z", "CHANNELS 3 W", "line 9: expected CHANNELS, .*, found '3 Wrot"),
        ("OFFSET 1 0 0", "OFFSET 1 0", "line 8: expected OFFSET and three finite numbers, found '1 0'"),
        ("OFFSET 1 0 0", "OFFSET 1 nan 0", "line 8: expected OFFSET and three finite numbers, found '1 nan 0'"),
        ("  OFFSET 1", "  OFSET 1", "line 8: expected a line of a BVH hierarchy, found 'OFSET 1 0 0'"),
        ("Upper Arm", "Hips", "line 6: expected each joint name once, found Hips again"),
        ("  }\n}\nMOTION", "MOTION", "line 14: expected a closed hierarchy before MOTION, found 2 open braces"),
        (
            "MOTION",
            "",
            "a.bvh: expected a line of a BVH|line 17: expected a line of a BVH hierarchy, found 'Frames: 2'",
        ),
        ("Frames: 2", "Frames: two", "line 17: expected Frames: and a positive number, found 'Frames: two'"),
        ("Frames: 2", "Frames: 3", "line 20: expected 3 lines of motion, found 2"),
        (
            "Frame Time: 0.04",
            "Frame Time: 0",
            "line 18: expected Frame Time: and a positive number, found 'Frame Time: 0'",
        ),
        ("10 20 30 40 50 60", "10 20 30 40 50", "line 20: expected 9 channel values, found 8"),
        ("10 20 30 40", "10 nan 30 40", "line 20: expected finite numbers, found 'nan'"),
        ("10 20 30 40", "10 2O 30 40", "line 20: expected finite numbers, found '2O'"),
    ],
)
def test_bad_lines_are_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in ARM
    with pytest.raises(CaptureError, match=message):
        read_bvh(bvh(tmp_path, ARM.replace(old, new)))


@pytest.mark.parametrize("text", ["", "HIERARCHY\n", "MOTION\n"])
def test_cut_off_files(tmp_path: Path, text: str) -> None:
    with pytest.raises(CaptureError, match=r"a.bvh: .*expected"):
        read_bvh(bvh(tmp_path, text))


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match=r"gone.bvh: expected a readable BVH file, found No such file"):
        read_bvh(tmp_path / "gone.bvh")


@pytest.mark.skipif(not FILES, reason="no shared data here")
@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_shared_motions_stand_on_the_floor(path: Path) -> None:
    motion = read_bvh(path)
    points = motion.tracks.positions
    assert motion.fps == 30.0 and np.isfinite(points).all()
    if "box_throw_small_box" in path.name:
        assert motion.tracks.joints == ("Root", "Root_end")
        return
    feet = [j for j, name in enumerate(motion.tracks.joints) if "Toe" in name or "Foot" in name]
    assert np.abs(points[:, feet, 2].min(1)).max() < 0.1  # some foot is at z = 0 in every frame: z is up
    head = motion.tracks.joints.index("Head")
    assert (points[:, head, 2] > 1.0).mean() > 0.9
    child = [j for j, parent in enumerate(motion.parents) if parent >= 0]
    bones = np.linalg.norm(points[:, child] - points[:, [motion.parents[j] for j in child]], axis=-1)
    assert np.ptp(bones, axis=0).max() < 1e-12


@pytest.mark.skipif(not FILES, reason="no shared data here")
def test_joint_names_are_those_of_the_tracks() -> None:
    motion = read_bvh(DATA / "bvh" / "greeting002_S1_30fps.bvh")
    assert motion.tracks.joints == read_tracks(DATA / "scenes" / "greeting" / "a.csv").joints
