"""Scenes of one, two and three segments, that adjoin or not, at different rates, with frames before and after."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mhvedit import api
from mhvedit.geometry.planar import compose, invert, wrap_angle
from mhvedit.pipeline.job import Result
from mhvedit.scene.edit import EditedScene
from mhvedit.sequences.align import FramesOf
from tests.pipeline.toy import ANNA, BEN, LOWER_TABLE, RAISE_TABLE, Actor, write_actor, write_scene

FRAMES = "{anna = [9, 15], ben = [9, 15]}"
WIDE = "visibility = {half_angle = 60}"
HELD = RAISE_TABLE.replace('"raise"', '"hold"').replace('"+&+"', '"0&0a"').replace(WIDE, "")
Pair = tuple[Actor, Actor]


def solve(folder: Path, *changes: tuple[str, str], actors: Pair = (ANNA, BEN)) -> Result:
    folder.mkdir(exist_ok=True)
    for name, actor in zip(("anna", "ben"), actors, strict=True):
        write_actor(folder, name, actor, kind="npz")
        changes = (*changes, (f'path = "{name}"', f'path = "{name}.npz"'))
    return api.solve(api.load(write_scene(folder, *changes)))


def scene_of(result: Result) -> EditedScene:
    assert result.assembly is not None, result.failure
    return result.assembly.scene


def check_rigid(scene: EditedScene) -> None:
    """Everything is finite, and both stand as `relative` says through every segment."""
    for edit in scene.subjects.values():
        assert edit.source.shape == (scene.n_frames,) and edit.placements.shape == (scene.n_frames, 3)
        assert np.isfinite(edit.placements).all()
    for segment in scene.segments:
        a, b = (scene.subjects[name].placements[segment.start : segment.stop] for name in segment.between)
        error = compose(invert(a), b) - segment.relative
        assert np.abs(error[:, :2]).max() < 1e-9 and np.abs(wrap_angle(error[:, 2])).max() < 1e-9


def largest_steps(scene: EditedScene) -> tuple[float, float]:
    """What the edit adds from a frame to the next: m at the captures' origins, and rad."""
    moved = [np.diff(edit.placements, axis=0) for edit in scene.subjects.values()]
    return (
        max(float(np.linalg.norm(m[:, :2], axis=1).max()) for m in moved),
        max(float(np.abs(wrap_angle(m[:, 2])).max()) for m in moved),
    )


def test_a_pose_that_both_segments_accept_costs_nothing(tmp_path: Path) -> None:
    scene = scene_of(solve(tmp_path))
    assert (scene.cost, scene.lower_bound, scene.gap) == (0.0, 0.0, 0.0)
    np.testing.assert_array_equal(scene.segments[0].relative, scene.segments[1].relative)
    assert max(largest_steps(scene)) < 1e-9
    np.testing.assert_allclose(scene.subjects["anna"].placements, 0.0, atol=1e-9)
    check_rigid(scene)


def test_a_single_segment(tmp_path: Path) -> None:
    scene = scene_of(solve(tmp_path, (LOWER_TABLE, "")))
    assert (scene.cost, scene.n_frames, len(scene.segments)) == (0.0, 16, 1)
    assert max(largest_steps(scene)) < 1e-9
    check_rigid(scene)


def test_segments_that_adjoin_share_one_placement(tmp_path: Path) -> None:
    changed = LOWER_TABLE.replace(FRAMES, "{anna = [7, 15], ben = [7, 15]}").replace('"-&-"', '"0&0b"')
    scene = scene_of(solve(tmp_path, (LOWER_TABLE, changed)))
    assert scene.segments[0].stop == scene.segments[1].start == 7
    np.testing.assert_array_equal(scene.segments[0].relative, scene.segments[1].relative)
    check_rigid(scene)


def test_adjoining_segments_with_nothing_in_common(tmp_path: Path) -> None:
    changed = LOWER_TABLE.replace(FRAMES, "{anna = [7, 15], ben = [7, 15]}")
    result = solve(tmp_path, (LOWER_TABLE, changed), actors=(ANNA, replace(BEN, left_from=7)))
    assert all(len(segment.group) for segment in result.segments)
    assert result.assembly is None
    assert str(result.failure) == (
        '"raise" and "lower" adjoin, so they must share one placement, and have none in common'
    )


def test_three_segments_with_different_poses(tmp_path: Path) -> None:
    """Ben takes the other arm in the end, so the pair must move in between: smoothly."""
    ben = replace(BEN, left_from=12)
    last = LOWER_TABLE.replace(FRAMES, "{anna = [14, 15], ben = [14, 15]}").replace('"-&-"', '"0&0b"')
    hold = HELD.replace("{anna = [0, 6], ben = [0, 6]}", "{anna = [7, 8], ben = [7, 8]}")
    slow = replace(ANNA, long=0.6), replace(ben, long=0.6)
    result = solve(tmp_path, (LOWER_TABLE, hold + last), actors=slow)
    scene = scene_of(result)
    check_rigid(scene)
    np.testing.assert_array_equal(scene.segments[0].relative, scene.segments[1].relative)
    assert np.abs(scene.segments[2].relative - scene.segments[1].relative).max() > 0.04
    assert scene.cost > 0 and scene.lower_bound <= scene.cost + 1e-12 and scene.gap < 1
    a, b = (scene.subjects[name].placements for name in ("anna", "ben"))
    poses = compose(invert(a), b)
    between = slice(scene.segments[1].stop - 1, scene.segments[2].start + 1)
    whole = np.linalg.norm(poses[between][-1, :2] - poses[between][0, :2])
    steps = np.linalg.norm(np.diff(poses[between, :2], axis=0), axis=1)
    assert steps.max() < 0.5 * whole + 1e-9, "no jump: five steps share the way"


def test_segments_of_one_frame(tmp_path: Path) -> None:
    one = RAISE_TABLE.replace("{anna = [0, 6], ben = [0, 6]}", "{anna = [6, 6], ben = [6, 6]}")
    other = LOWER_TABLE.replace(FRAMES, "{anna = [9, 9], ben = [9, 9]}")
    scene = scene_of(solve(tmp_path, (RAISE_TABLE, one), (LOWER_TABLE, other)))
    assert [(s.start, s.stop) for s in scene.segments] == [(6, 7), (9, 10)]
    check_rigid(scene)


def test_segments_of_one_frame_with_different_poses(tmp_path: Path) -> None:
    one = RAISE_TABLE.replace("{anna = [0, 6], ben = [0, 6]}", "{anna = [6, 6], ben = [6, 6]}")
    other = LOWER_TABLE.replace(FRAMES, "{anna = [9, 9], ben = [9, 9]}")
    scene = scene_of(
        solve(tmp_path, (RAISE_TABLE, one), (LOWER_TABLE, other), actors=(ANNA, replace(BEN, left_from=8)))
    )
    assert scene.cost > 0
    check_rigid(scene)


def test_frames_before_and_after_move_with_the_segment_next_to_them(tmp_path: Path) -> None:
    early = RAISE_TABLE.replace("{anna = [0, 6], ben = [0, 6]}", "{anna = [3, 6], ben = [3, 6]}")
    late = LOWER_TABLE.replace(FRAMES, "{anna = [9, 12], ben = [9, 12]}")
    scene = scene_of(
        solve(tmp_path, (RAISE_TABLE, early), (LOWER_TABLE, late), actors=(ANNA, replace(BEN, left_from=8)))
    )
    assert scene.n_frames == 16 and [(s.start, s.stop) for s in scene.segments] == [(3, 7), (9, 13)]
    for edit in scene.subjects.values():
        np.testing.assert_allclose(edit.placements[:3], np.tile(edit.placements[3], (3, 1)), atol=1e-9)
        np.testing.assert_allclose(edit.placements[13:], np.tile(edit.placements[12], (3, 1)), atol=1e-9)
    check_rigid(scene)


def test_frames_that_one_of_them_lacks_are_left_out(tmp_path: Path) -> None:
    late = RAISE_TABLE.replace("ben = [0, 6]", "ben = [1, 6]").replace("anna = [0, 6]", "anna = [0, 5]")
    result = solve(tmp_path, (RAISE_TABLE, late), (LOWER_TABLE, ""))
    scene = scene_of(result)
    check_rigid(scene)
    assert result.assembly is not None
    assert result.assembly.line.left_out[0] == FramesOf("ben", 0, 1)


@pytest.mark.parametrize("rate", [15, 60])
def test_subjects_of_different_rates(tmp_path: Path, rate: int) -> None:
    result = solve(tmp_path, ('path = "ben"\nfps = 30', f'path = "ben"\nfps = {rate}'))
    scene = scene_of(result)
    assert scene.fps == 30
    check_rigid(scene)
    assert scene.segments[0].stop - scene.segments[0].start == (7 if rate == 15 else 4)
    own = scene.subjects["ben"].source[: scene.segments[0].stop]
    assert own[0] == 0 and own[-1] == 6


def test_a_gap_in_the_numbers_between_segments(tmp_path: Path) -> None:
    """Frame 7 was never captured, and nobody asks for it."""
    folder = tmp_path / "job"
    folder.mkdir()
    write_actor(folder, "anna", ANNA)
    write_actor(folder, "ben", BEN)
    (folder / "ben" / "ben_0007.obj").unlink()
    scene = scene_of(api.solve(api.load(write_scene(folder))))
    assert 7 not in scene.subjects["ben"].source
    check_rigid(scene)
