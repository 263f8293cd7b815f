"""A motion in, a motion without self-collision out: the methods, with the same problem and the same result."""

from dataclasses import dataclass

import numpy as np

from mhvedit.avoidance.bisection import Bisected, BisectionSettings, bisect, check_and_correct
from mhvedit.avoidance.correct import LONG_MEMORY, MEMORY, Body, correct_posture, task_violation
from mhvedit.avoidance.posture import Constraint, Posture, limits_around, predict_posture
from mhvedit.avoidance.tasks import Task
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.model import Motion

LIKENESS = 0.6  # rad or m: a posture that differs more from the captured one is a last resort
RESERVE = 0.0015  # m: frames are worked on until they are free by this much
STEP_SHARE = 0.3  # of the largest captured step
TASK_SLACK = 3e-3  # m: tasks count as kept
KEY_EVERY = 15  # frames between the key frames that Nebel's method starts from: half a second at 30 Hz


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """What has to become free of collision, and what has to stay."""

    body: Body
    captured: Motion
    tasks: tuple[Task, ...] = ()

    @property
    def limits(self) -> FloatArray:
        """(T, D, 2) joint limits; where the captured motion itself is outside, it may stay."""
        return np.stack([limits_around(self.body.skeleton.limits, q) for q in self.captured.q])


@dataclass(frozen=True, slots=True, eq=False)
class Avoided:
    """A motion that avoids itself, as far as it could be found."""

    motion: Motion
    before: FloatArray  # (T,) m, excess of the captured motion; at most 0 where free
    after: FloatArray  # (T,) m
    missed: FloatArray  # (T,) m, by how much the tasks that are required are missed
    keys: IntArray  # frames that were solved; the other touched ones lie between them
    solved: int  # how many times a frame was solved

    @property
    def colliding(self) -> IntArray:
        """Frames that still collide."""
        return np.flatnonzero(self.after > 0)

    @property
    def converged(self) -> bool:
        """Whether all frames are free and all required tasks kept."""
        return len(self.colliding) == 0 and self.tasks_kept

    @property
    def tasks_kept(self) -> bool:
        """Whether the required tasks are kept in all frames."""
        return bool((self.missed <= TASK_SLACK).all())


def avoid_by_bisection(problem: Problem, *, settings: BisectionSettings | None = None) -> Avoided:
    """Posture prediction in few frames, interpolation in the others (Degenhardt, section 3.2).

    Args:
        problem: what to solve.
        settings: of the recursion.
    """
    found = bisect(
        problem.captured.q,
        predict=lambda frame, q, away: predict_frame(problem, frame, q, away=away),
        collides=lambda frames, q: _collide(problem, q),
        limits=problem.limits,
        settle=lambda frames, q: settled(problem, frames, q),
        settings=settings,
    )
    return _avoided(problem, found)


def avoid_like_nebel(problem: Problem) -> Avoided:
    """Nebel's key frames with sub-keys at the first collision of each interval, as a baseline.

    Args:
        problem: what to solve.
    """
    found = check_and_correct(
        problem.captured.q,
        predict=lambda frame, q, away: predict_frame(problem, frame, q, away=away),
        collides=lambda frames, q: _collide(problem, q),
        limits=problem.limits,
        keys=range(0, problem.captured.n_frames, KEY_EVERY),
    )
    return _avoided(problem, found)


def predict_frame(problem: Problem, frame: int, q: FloatArray, *, away: int) -> Posture:
    """A posture without collision for one frame (Degenhardt, figure 3.14).

    First near the curves, so that the interpolation does not become faster than people move; then anywhere, from the
    curves and from the captured posture; then with the required tasks alone.

    Args:
        problem: what to solve.
        frame: which.
        q: (T, D) curves as they are.
        away: frames to the nearest key.
    """
    captured = problem.captured.q[frame]
    limits = limits_around(problem.body.skeleton.limits, captured)
    room = (away * step_allowance(problem))[:, None] * np.array([-1.0, 1.0])
    like = np.clip(captured[:, None] + LIKENESS * np.array([-1.0, 1.0]), limits[:, :1], limits[:, 1:])
    near = np.clip(np.clip(q[frame], like[:, 0], like[:, 1])[:, None] + room, like[:, :1], like[:, 1:])
    tiers = [task_constraints(problem, frame, q, given_up=n) for n in range(wishes(problem) + 1)]
    all_tasks, required = tiers[0], tiers[-1]
    best: Posture | None = None
    for start, bounds, constraints, memory in (
        *((q[frame], near, tier, MEMORY) for tier in tiers),
        (q[frame], near, all_tasks, LONG_MEMORY),
        (q[frame], near, required, LONG_MEMORY),
        (captured, like, all_tasks, MEMORY),
        (captured, like, required, MEMORY),
        (q[frame], like, required, LONG_MEMORY),
        (captured, limits, required, MEMORY),
        (q[frame], limits, required, LONG_MEMORY),
    ):
        posture = correct_posture(
            problem.body, captured, start=start, constraints=constraints, limits=bounds, memory=memory
        )
        if posture.converged:
            return posture
        if best is None or posture.violation < best.violation:
            best = posture
    assert best is not None
    return best


def step_allowance(problem: Problem) -> FloatArray:
    """(D,) rad or m a frame that corrections may add to each DOF: a share of the largest step of any such DOF."""
    slides = problem.body.skeleton.dof_slides
    steps = np.abs(np.diff(problem.captured.q, axis=0)).max(0, initial=0.0)
    turn, slide = (float(steps[mask].max(initial=0.0)) for mask in (~slides, slides))
    return np.where(slides, max(STEP_SHARE * slide, 0.002), max(STEP_SHARE * turn, 0.02))


def settled(problem: Problem, frames: IntArray, q: FloatArray) -> FloatArray:
    """Interpolated postures, brought back to what the required tasks ask with the least change.

    Args:
        problem: what to solve.
        frames: (K,).
        q: (K, D) their postures.
    """
    out = q.copy()
    curves = problem.captured.q.copy()
    curves[frames] = q
    for i, frame in enumerate(frames):
        constraints = task_constraints(problem, int(frame), curves)
        if constraints and (q[i] != problem.captured.q[frame]).any():
            body, captured = problem.body, problem.captured.q[frame]
            limits = limits_around(body.skeleton.limits, captured)
            out[i] = predict_posture(
                body.skeleton, q[i], constraints, weights=body.weights, free=body.free, limits=limits
            ).q
    return out


def wishes(problem: Problem) -> int:
    """How many tasks may be given up."""
    return sum(not task.required for task in problem.tasks)


def task_constraints(problem: Problem, frame: int, q: FloatArray, *, given_up: int | None = None) -> list[Constraint]:
    """What the tasks ask in one frame.

    Args:
        problem: what to solve.
        frame: which.
        q: (T, D) curves as they are.
        given_up: how many of the tasks that may be given up are, in their order; all of them by default.
    """
    left = wishes(problem) if given_up is None else given_up
    asked = list[Constraint]()
    for task in problem.tasks:
        if not task.required and left > 0:
            left -= 1
            continue
        asked += task.constraints(frame, q)
    return asked


def task_residuals(problem: Problem, q: FloatArray, frames: IntArray | None = None) -> FloatArray:
    """(K,) m, by how much the required tasks are missed in some frames; in all by default."""
    chosen = np.arange(len(q)) if frames is None else frames
    missed = [task_violation(problem.body, q[frame], task_constraints(problem, frame, q)) for frame in chosen.tolist()]
    return np.array(missed)


def touched_frames(captured: Motion, motion: Motion) -> BoolArray:
    """(T,) which frames differ."""
    return np.asarray((captured.q != motion.q).any(1))


def _collide(problem: Problem, q: FloatArray) -> BoolArray:
    return np.asarray(problem.body.guard.excess(q) > -RESERVE)


def _avoided(problem: Problem, found: Bisected) -> Avoided:
    guard = problem.body.guard
    return Avoided(
        Motion(found.q, problem.captured.fps),
        guard.excess(problem.captured.q),
        guard.excess(found.q),
        task_residuals(problem, found.q),
        found.predicted,
        found.predictions,
    )
