from dataclasses import replace

import numpy as np
import pytest

from mhvedit.avoidance.methods import Avoided, Problem, avoid_by_bisection
from mhvedit.avoidance.metrics import jerk, measure
from mhvedit.avoidance.smooth import Attempt, SmoothSettings, smoothed, speed_limits
from mhvedit.skeleton.model import Motion
from tests.avoidance.scenes import plain_body, problem_of, walk, with_sphere


@pytest.fixture(scope="module")
def found() -> tuple[Problem, Avoided]:
    """A walk past a ball on the torso, freed frame by frame."""
    problem = problem_of(with_sphere(plain_body(), at=(0.18, -0.2, 1.12), radius=0.06, limb="spine0"), walk(48))
    return problem, avoid_by_bisection(problem)


def test_what_shakes_becomes_calm_and_stays_free(found: tuple[Problem, Avoided]) -> None:
    problem, avoided = found
    arm = problem.body.skeleton.dof_names.index("left_upper_arm.1")
    shaken = avoided.motion.q.copy()
    shaken[avoided.keys, arm] -= 0.1  # away from the body, in few frames
    worse = replace(avoided, motion=Motion(shaken, avoided.motion.fps))
    calm = smoothed(problem, worse)
    assert calm.converged
    assert jerk(calm.motion.q - problem.captured.q) < 0.5 * jerk(shaken - problem.captured.q)
    assert measure(problem, calm).effort < measure(problem, worse).effort


def test_frames_far_from_a_collision_stay_as_they_were(found: tuple[Problem, Avoided]) -> None:
    problem, avoided = found
    settings = SmoothSettings(fade=2)
    touched = np.flatnonzero((avoided.motion.q != problem.captured.q).any(1))
    calm = smoothed(problem, avoided, settings=settings)
    far = [f for f in range(48) if np.abs(touched - f).min() > settings.fade]
    assert len(far) > 0
    assert (calm.motion.q[far] == problem.captured.q[far]).all()


def test_a_run_that_would_collide_is_kept_as_it_was(found: tuple[Problem, Avoided]) -> None:
    problem, avoided = found
    limp = SmoothSettings(hard=1e-6, wish=1e-6, attempts=(Attempt(),))
    assert (smoothed(problem, avoided, settings=limp).motion.q == avoided.motion.q).all()


def test_what_is_free_is_left_alone() -> None:
    problem = problem_of(plain_body(), walk())
    free = avoid_by_bisection(problem)
    assert (smoothed(problem, free).motion.q == problem.captured.q).all()


def test_no_joint_is_asked_to_be_much_faster_than_it_was(found: tuple[Problem, Avoided]) -> None:
    problem, avoided = found
    settings = SmoothSettings()
    most = speed_limits(problem, settings)
    shin = problem.body.skeleton.dof_names.index("left_shin.0")
    thigh = problem.body.skeleton.dof_names.index("left_thigh.0")
    steps = np.abs(np.diff(problem.captured.q[:, thigh])).max()
    assert most[shin] == pytest.approx(settings.turn / problem.captured.fps)
    assert most[thigh] == pytest.approx(max(settings.faster * steps, most[shin]))
    calm = smoothed(problem, avoided, settings=settings)
    assert (np.abs(np.diff(calm.motion.q, axis=0)) <= 1.1 * most).all()
