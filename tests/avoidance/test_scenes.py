"""The thesis's evaluation scenes (B9), small: what it shows in pictures, in numbers."""

from dataclasses import replace

import numpy as np
import pytest

from mhvedit.avoidance.continuous import go_round, skipped_collisions
from mhvedit.avoidance.correct import Guard
from mhvedit.avoidance.loop import LoopSettings, avoid_by_filter
from mhvedit.avoidance.methods import Avoided, Problem, avoid_by_bisection, avoid_like_nebel
from mhvedit.avoidance.metrics import measure
from mhvedit.avoidance.smooth import smoothed
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.model import Motion
from tests.avoidance.scenes import armed, grip_gap, jump, plain_body, problem_of, rise, walk, with_sphere, with_vest


def torso_ball() -> Problem:
    body = with_sphere(plain_body(), at=(0.18, -0.2, 1.12), radius=0.06, limb="spine0")
    return problem_of(body, walk())


def check(problem: Problem, avoided: Avoided) -> None:
    """Free, tasks kept, limits kept, no faster than before by half."""
    assert (avoided.before > 0).any(), "the scene has to collide"
    assert avoided.converged
    assert (problem.body.guard.excess(avoided.motion.q) <= 0).all()
    numbers = measure(problem, avoided)
    assert numbers.slip_mm < 5
    assert (avoided.motion.q >= problem.limits[..., 0] - 1e-9).all()
    assert (avoided.motion.q <= problem.limits[..., 1] + 1e-9).all()


def test_b9_walking_with_a_sphere_on_the_torso() -> None:
    problem = torso_ball()
    avoided = avoid_by_bisection(problem)
    check(problem, avoided)
    assert measure(problem, avoided).step_ratio <= 1.5


def test_b9_jump_with_a_sphere() -> None:
    body = with_sphere(plain_body(), at=(0.2, -0.25, 1.0), radius=0.05, limb="hips")
    problem = problem_of(body, jump())
    check(problem, avoid_by_bisection(problem))


def test_b9_jump_with_a_vest_on_both_sides() -> None:
    problem = problem_of(with_vest(plain_body()), jump())
    check(problem, avoid_by_bisection(problem))


def test_b7_2_a_two_handed_weapon_is_kept_in_hand() -> None:
    """Figures 4.4 and 4.5: without the constraint the second hand leaves the weapon, with it the gap is below 5 mm."""
    without, weapon = armed()
    held = replace(without, tasks=(*without.tasks, weapon))
    free, kept = avoid_by_bisection(without), avoid_by_bisection(held)
    check(without, free)
    check(held, kept)
    skeleton = held.body.skeleton
    assert grip_gap(skeleton, weapon, held.captured.q) < 1e-6
    assert grip_gap(skeleton, weapon, free.motion.q) > 0.01
    assert grip_gap(skeleton, weapon, kept.motion.q) < 0.005
    assert grip_gap(skeleton, weapon, smoothed(held, kept).motion.q) < 0.005


@pytest.mark.parametrize("frozen", [(), ("hips", "left_thigh", "left_shin", "right_thigh", "right_shin")])
def test_b9_prone_to_standing_with_all_joints_or_a_frozen_lower_body(frozen: tuple[str, ...]) -> None:
    problem = problem_of(plain_body(), rise(), frozen=frozen)
    avoided = avoid_by_bisection(problem)
    check(problem, avoided)
    still = ~problem.body.free
    assert (avoided.motion.q[:, still] == problem.captured.q[:, still]).all()
    assert still.any() == bool(frozen)


def test_b7_4_unknown_joints_are_listed() -> None:
    with pytest.raises(ShapeError, match="left_thigh"):
        problem_of(plain_body(), walk(), frozen=("left_tail",))


def test_a0_2_the_loop_frees_a_hand_that_brushes_a_sphere() -> None:
    problem = torso_ball()
    avoided = avoid_by_filter(problem)
    assert avoided.before.max() > 0.02
    assert avoided.after.max() < 0.001  # and with what the guard allows less than 5 mm deeper than at rest
    assert len(avoided.colliding) <= 2
    assert avoided.tasks_kept
    assert (avoided.motion.q[:3] == problem.captured.q[:3]).all()


def test_a0_3_the_loop_says_when_it_did_not_converge() -> None:
    avoided = avoid_by_filter(torso_ball(), settings=LoopSettings(rounds=0))
    assert not avoided.converged
    assert len(avoided.colliding) > 0
    assert (avoided.motion.q == walk().q).all()


def test_b5_10_nebel_loses_the_detail_that_bisection_keeps() -> None:
    problem = torso_ball()
    nebel, mine = avoid_like_nebel(problem), avoid_by_bisection(problem)
    assert len(nebel.colliding) == 0
    assert measure(problem, nebel).change_rms > 2 * measure(problem, mine).change_rms


def test_a_motion_without_collision_comes_back_as_it_was() -> None:
    problem = problem_of(plain_body(), walk())
    for method in (avoid_by_bisection, avoid_by_filter):
        avoided = method(problem)
        assert (avoided.motion.q == problem.captured.q).all()
        assert avoided.solved == 0


def test_one_frame_and_every_frame_in_collision() -> None:
    body = with_sphere(plain_body(), at=(0.18, -0.2, 1.12), radius=0.06, limb="spine0")
    worst = walk().q[[18]]
    for n in (1, 2, 5):
        problem = problem_of(body, Motion(np.repeat(worst, n, axis=0), 30.0))
        if (problem.body.guard.excess(problem.captured.q) > 0).all():
            check(problem, avoid_by_bisection(problem))


class Wall:
    """A thin plate at one value of the first DOF of an arm: nothing else collides."""

    def __init__(self, dof: int, at: float, half: float) -> None:
        self.dof, self.at, self.half = dof, at, half

    def excess(self, q: FloatArray) -> FloatArray:
        return np.asarray(self.half - np.abs(q[:, self.dof] - self.at))


def test_b10_what_is_skipped_between_frames_is_found() -> None:
    problem = problem_of(plain_body(), walk())
    skeleton = problem.body.skeleton
    dof = skeleton.dof_names.index("left_upper_arm.0")
    q = np.zeros((6, skeleton.n_dofs))
    q[:, dof] = np.linspace(-0.5, 0.5, 6)
    plate: Guard = Wall(dof, 0.0, 0.05)  # type: ignore[assignment]
    assert (plate.excess(q) <= 0).all()
    found = skipped_collisions(skeleton, plate, q)
    assert found.frames.tolist() == [2]
    assert found.shares[0] == pytest.approx(0.5, abs=0.15)


def test_b10_a_thin_plate_is_gone_round() -> None:
    """The left hand passes a plate on the thigh between two frames."""
    from tests.avoidance.scenes import with_plate

    body = with_plate(plain_body())
    n = 5
    q = np.zeros((n, body.skeleton.n_dofs))
    q[:, body.skeleton.dof_names.index("left_upper_arm.0")] = np.linspace(-0.9, 0.9, n + 1)[:n]
    problem = problem_of(body, Motion(q, 30.0))
    avoided = avoid_by_bisection(problem)
    assert avoided.converged
    skipped = skipped_collisions(body.skeleton, problem.body.guard, avoided.motion.q)
    rounded, left = go_round(problem, avoided)
    assert len(skipped.frames) > 0
    assert len(left.frames) == 0
    assert rounded.converged
