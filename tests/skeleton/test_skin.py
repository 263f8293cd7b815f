from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest import approx
from scipy.spatial.transform import Rotation

from mhvedit.errors import CaptureError
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.model import Motion
from mhvedit.skeleton.skin import posed_vertices, read_skinned, write_skinned
from tests.skeleton.shared_motions import shared_motion


@pytest.mark.parametrize("name", ["walk_throw_normal", "jump_crawl_heavy"])
def test_degrees_of_freedom_give_back_the_frames_of_the_file(name: str) -> None:
    skinned = read_skinned(shared_motion(name))
    stored, skeleton = skinned.stored, skinned.body.skeleton
    assert skeleton.n_dofs == 3 + 23 * 3  # 23 limbs (A2.9) and the root's place
    rotations, positions = joint_frames(skeleton, skinned.motion.q)
    truth = Rotation.from_quat(stored["rotations"].reshape(-1, 4).astype(float)).as_matrix()
    assert np.abs(rotations.reshape(-1, 3, 3) - truth).max() < 1e-6
    assert np.abs(positions - stored["positions"]).max() < 1e-6


@pytest.mark.parametrize("name", ["walk_throw_normal", "jump_crawl_heavy", "range_of_motion_f_normal"])
def test_degrees_of_freedom_run_on_from_frame_to_frame(name: str) -> None:
    q = read_skinned(shared_motion(name)).motion.q
    assert np.abs(np.diff(q, axis=0)).max() < 1.0


def test_posed_vertices_follow_the_formula() -> None:
    skinned = read_skinned(shared_motion("walk_throw_heavy"))
    stored, frame = {k: v.astype(float) for k, v in skinned.stored.items() if k != "joints"}, 300
    turns = Rotation.from_quat(stored["rotations"][frame]).as_matrix()
    expected = np.zeros_like(stored["vertices"])
    for j in range(len(turns)):
        moved = (stored["vertices"] - stored["rest"][j]) @ turns[j].T + stored["positions"][frame, j]
        expected += stored["weights"][:, j, None] * moved
    assert posed_vertices(skinned.body, skinned.motion.q[frame]) == approx(expected, abs=1e-6)


def test_what_is_written_unchanged_is_the_file_bit_by_bit(tmp_path: Path) -> None:
    path = shared_motion("prone_hold_heavy")
    skinned = read_skinned(path)
    write_skinned(tmp_path / "same.npz", skinned, skinned.motion)
    with np.load(path) as before, np.load(tmp_path / "same.npz") as after:
        assert before.files == after.files
        for key in before.files:
            assert before[key].dtype == after[key].dtype
            assert np.array_equal(before[key], after[key])


def test_only_edited_frames_change(tmp_path: Path) -> None:
    skinned = read_skinned(shared_motion("prone_hold_heavy"))
    q = skinned.motion.q.copy()
    q[7, 20] += 0.1
    write_skinned(tmp_path / "edited.npz", skinned, Motion(q, skinned.motion.fps))
    edited = read_skinned(tmp_path / "edited.npz")
    changed = (edited.stored["rotations"] != skinned.stored["rotations"]).any((1, 2))
    assert np.flatnonzero(changed).tolist() == [7]
    frames = joint_frames(edited.body.skeleton, edited.motion.q[7])
    assert np.abs(frames[0] - joint_frames(skinned.body.skeleton, q[7])[0]).max() < 1e-6


def _small(changes: dict[str, Any] | None = None) -> dict[str, Any]:
    """Two joints, one triangle and two frames."""
    arrays: dict[str, Any] = {
        "vertices": np.eye(3),
        "faces": np.array([[0, 1, 2]]),
        "weights": np.array([[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]]),
        "joints": np.array(["Hips", "Spine"]),
        "parents": np.array([-1, 0]),
        "rest": np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        "rotations": np.tile([0.0, 0.0, 0.0, 1.0], (2, 2, 1)),
        "positions": np.tile([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], (2, 1, 1)),
        "fps": np.float32(30),
    }
    return {k: v for k, v in {**arrays, **(changes or {})}.items() if v is not None}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rest": None}, "expected arrays vertices, .*, fps, found no rest"),
        ({"weights": np.ones((3, 3)) / 3, "joints": np.array(["a", "b"])}, r"joints of shape \(3\), found \(2,\)"),
        ({"weights": np.ones((3, 2))}, "add up to 1, found 2 at vertex 0"),
        ({"faces": np.array([[0, 1, 3]])}, "face indices from 0 to 2, found 0 to 3"),
        ({"faces": np.zeros((0, 3), int)}, "faces that are not empty"),
        ({"vertices": np.full((3, 3), np.nan)}, "finite vertices, found nan at index 0 0"),
        ({"rotations": np.ones((2, 2, 4))}, "unit quaternions, found length 2 in frame 0"),
        ({"parents": np.array([0, -1])}, "parents before their children"),
        ({"joints": np.array(["Hips", "Hips"])}, "each name once"),
        ({"positions": np.zeros((2, 2, 3))}, "within 1 mm, found Spine 1000.0 mm off in frame 0"),
        ({"fps": np.float32(0)}, "a positive fps, found 0.0"),
    ],
)
def test_bad_files_are_refused_in_one_sentence(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    np.savez(tmp_path / "bad.npz", **_small(changes))
    with pytest.raises(CaptureError, match=message):
        read_skinned(tmp_path / "bad.npz")


def test_a_file_that_is_no_archive_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bad.npz").write_text("hello")
    with pytest.raises(CaptureError, match="a skinned motion"):
        read_skinned(tmp_path / "bad.npz")


def test_one_frame_is_a_motion(tmp_path: Path) -> None:
    small = _small()
    np.savez(
        tmp_path / "one.npz", **{**small, "rotations": small["rotations"][:1], "positions": small["positions"][:1]}
    )
    assert read_skinned(tmp_path / "one.npz").motion.n_frames == 1
