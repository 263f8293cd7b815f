"""What comes in broken or at the edge of what makes sense: said, never guessed at."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from mhvedit.avoidance.ground import at_joints, keep_standing
from mhvedit.avoidance.guards import mesh_guard
from mhvedit.avoidance.loop import LoopSettings, avoid_by_filter
from mhvedit.avoidance.methods import avoid_by_bisection
from mhvedit.avoidance.smooth import Attempt, SmoothSettings, smoothed
from mhvedit.errors import CaptureError, ShapeError
from mhvedit.pipeline.avoid import AvoidOptions, run_avoid
from mhvedit.pipeline.avoid_report import reasons
from mhvedit.skeleton.model import Motion
from mhvedit.skeleton.skin import read_skinned, write_skinned
from tests.avoidance.scenes import plain_body, problem_of, walk
from tests.avoidance.test_command import cut
from tests.collision.bodies import boxes_on_sliders
from tests.skeleton.shared_motions import shared_motion

QUIET = AvoidOptions(report=False)


def test_one_frame_of_a_file_is_freed(tmp_path: Path) -> None:
    path = cut("walk_throw_heavy", tmp_path, range(530, 531))
    found = run_avoid(path, tmp_path / "out", options=QUIET).found
    assert found.metrics.colliding_before == 1
    assert found.avoided.converged
    assert read_skinned(tmp_path / "out" / "motion.npz").motion.n_frames == 1


def test_a_joint_without_triangles_is_no_limb(tmp_path: Path) -> None:
    """The hand's skin is given to the forearm."""
    path = cut("walk_throw_heavy", tmp_path, range(530, 532))
    stored = dict(np.load(path))
    names = [str(name) for name in stored["joints"]]
    hand, forearm = names.index("LeftHand"), names.index("LeftForeArm")
    below = [j for j, name in enumerate(names) if name.startswith("LeftHand")]
    stored["weights"][:, forearm] += stored["weights"][:, below].sum(1)
    stored["weights"][:, below] = 0
    np.savez(path, **stored)
    body = mesh_guard(read_skinned(path).body).body
    assert names[hand] not in body.limbs.names
    assert run_avoid(path, tmp_path / "out", options=QUIET).found.avoided.converged


def test_what_overlaps_at_rest_collides_where_it_is_deeper() -> None:
    body = boxes_on_sliders(np.full((2, 3), 0.2), np.array([[0.0, 0.0, 0.0], [0.17, 0.0, 0.0]]), cuts=3)
    guard = mesh_guard(body)
    assert guard.body.rest_depth[0] == pytest.approx(0.03, abs=1e-6)
    q = np.zeros((2, body.skeleton.n_dofs))
    q[1, body.skeleton.dof_names.index("box1.tx")] = -0.01
    assert guard.excess(q) == pytest.approx([-guard.allowed, 0.01 - guard.allowed], abs=1e-6)


def test_a_task_out_of_reach_is_said_to_be_missed() -> None:
    """A foot is asked to stand 2 m up, in a motion that collides."""
    body, motion = plain_body(), walk(3)
    q = motion.q.copy()
    q[:, body.skeleton.dof_names.index("left_upper_arm.1")] = 0.9  # into the trunk
    problem = problem_of(body, Motion(q, motion.fps), frozen=("hips",))
    foot = at_joints(np.array([body.skeleton.names.index("left_foot")]))
    task = keep_standing(body.skeleton, problem.captured, foot)
    task = replace(task, targets=task.targets + np.array([0.0, 0.0, 2.0]), slack=np.zeros_like(task.slack))
    wrong = replace(problem, tasks=(task,))
    once = SmoothSettings(attempts=(Attempt(),))
    for found in (avoid_by_bisection(wrong), avoid_by_filter(wrong, settings=LoopSettings(rounds=1))):
        avoided = smoothed(wrong, found, settings=once)
        assert not avoided.converged
        assert avoided.missed.max() > 0.5
        assert any("what stood still moved by" in sentence for sentence in reasons(mesh_guard(body).body, avoided))


def test_equipment_on_an_unknown_limb_lists_those_known(tmp_path: Path) -> None:
    path = cut("walk_throw_heavy", tmp_path, range(530, 531))
    ball = tmp_path / "ball.obj"
    trimesh.creation.icosphere(subdivisions=1, radius=0.05).export(ball)
    with pytest.raises(ShapeError, match=r"one of Hips.*LeftHand.*, found 'Belt'"):
        run_avoid(path, tmp_path / "out", options=replace(QUIET, attached=(f"{ball}:Belt",)))
    with pytest.raises(CaptureError, match=r"gone.obj"):
        run_avoid(path, tmp_path / "out", options=replace(QUIET, attached=(f"{tmp_path / 'gone.obj'}:Hips",)))
    open_mesh = tmp_path / "open.obj"
    box = trimesh.creation.box([0.1, 0.1, 0.1])
    trimesh.Trimesh(box.vertices, box.faces[1:]).export(open_mesh)
    with pytest.raises(ShapeError, match="3 open edges"):
        run_avoid(path, tmp_path / "out", options=replace(QUIET, attached=(f"{open_mesh}:Hips",)))
    assert not (tmp_path / "out").exists()


def test_numbers_that_are_none_are_refused_with_their_place(tmp_path: Path) -> None:
    path = cut("walk_throw_heavy", tmp_path, range(530, 532))
    stored = dict(np.load(path))
    stored["rotations"][1, 3] = np.nan
    np.savez(path, **stored)
    with pytest.raises(CaptureError, match=r"finite rotations, found nan at index 1 3 0"):
        run_avoid(path, tmp_path / "out", options=QUIET)


def test_angles_beyond_the_limits_are_noted_and_come_back_as_they_were(tmp_path: Path) -> None:
    skinned = read_skinned(shared_motion("walk_throw_normal"))
    shin = skinned.body.skeleton.dof_names.index("LeftLeg.x")
    q = skinned.motion.q[:2].copy()
    q[:, shin] = -0.8
    path = tmp_path / "bent.npz"
    write_skinned(path, skinned, Motion(q, skinned.motion.fps))
    outcome = run_avoid(path, tmp_path / "out", options=QUIET)
    assert any("LeftLeg.x is beyond its limits" in note for note in outcome.report["notes"])
    edited = read_skinned(tmp_path / "out" / "motion.npz").motion.q
    assert edited[:, shin] == pytest.approx(-0.8, abs=0.05)
