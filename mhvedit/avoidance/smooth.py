"""All touched frames at once: the change from the captured motion made small and calm, under every constraint.

Methods that solve one frame after the other can find another way out in every frame, and interpolation between them
then shakes. Here the posture prediction of Degenhardt's eq. 2.5 is asked of a whole run of frames, with the second
differences of the change in the cost, so that the way out is one movement (spacetime constraints, Witkin and Kass
1988, on the change as in Gleicher 1997). Contacts, tasks, limits and speeds are stiff springs that only push, and each
round looks at the surfaces again. Where a few frames do not get free, the springs about them become stiffer.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mhvedit.avoidance.bisection import collision_groups
from mhvedit.avoidance.correct import Found, Guard
from mhvedit.avoidance.methods import TASK_SLACK, Avoided, Problem, task_residuals, touched_frames
from mhvedit.avoidance.posture import Constraint, Rows, place
from mhvedit.avoidance.springs import Course, Springs, Steps, least_cost_move
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.skeleton.model import Motion

SHALLOW = 0.003  # m over what is allowed
HALVINGS = 4  # of a move that comes in deep


@dataclass(frozen=True, slots=True)
class Attempt:
    """The first is at a whole run, the others at what is left of it."""

    stiffness: float = 1.0  # of what has to be met, over `SmoothSettings.hard`
    ease: float = 0.0015  # m: how much of what contacts aim for is only wished for


@dataclass(frozen=True, slots=True)
class SmoothSettings:
    """What is asked of the change, and how hard."""

    scale: float = 4.0  # frames: see Course
    fade: int = 10  # frames before and after what is touched in which the change may come and go
    hard: float = 1e5  # 1/m^2 or 1/rad^2, of what has to be met
    wish: float = 2000.0  # 1/m^2, of tasks that may be given up, and of the last of what contacts aim for
    speed: float = 1e3  # 1/rad^2 or 1/m^2, of steps that are too long
    faster: float = 1.3  # how much faster than captured a joint may become
    turn: float = 1.0  # rad/s that every joint may turn
    slide: float = 0.5  # m/s that every joint may slide
    attempts: tuple[Attempt, ...] = (Attempt(), Attempt(10.0, 0.0025), Attempt(100.0, 0.0025), Attempt(1000.0, 0.0025))
    rounds: int = 16  # of looking at the surfaces in each attempt
    updates: int = 4  # of which springs push, between two looks
    memory: int = 8  # looks whose contacts still count
    trust: float = 0.25  # rad or m: largest change of a DOF in a round
    still: float = 0.02  # rad or m: a round that changes less, and leaves nothing in collision, is the last


def smoothed(problem: Problem, avoided: Avoided, *, settings: SmoothSettings | None = None) -> Avoided:
    """Make what a method changed, or left in collision, one calm movement for each run of such frames.

    A run is kept as it was where the result would collide, or miss tasks, in more frames.

    Args:
        problem: what is solved.
        avoided: what a method found.
        settings: of the pass.
    """
    chosen, q = settings or SmoothSettings(), avoided.motion.q.copy()
    concerned = touched_frames(problem.captured, avoided.motion) | (avoided.after > 0)
    for run in _runs(concerned, chosen.fade):
        old, before = q[run].copy(), _failures(problem, q, run)
        q[run] = _calm(problem, q, run, chosen, chosen.attempts[0])
        for attempt in chosen.attempts[1:]:
            for part in _runs(_failures(problem, q, run) > 0, chosen.fade):
                left, least = q[part].copy(), _failures(problem, q, part).sum()
                q[part] = _calm(problem, q, part, chosen, attempt)
                if _failures(problem, q, part).sum() >= least:
                    q[part] = left
        if (_failures(problem, q, run) > 0).sum() > (before > 0).sum():
            q[run] = old
    return replace(
        avoided,
        motion=Motion(q, avoided.motion.fps),
        after=problem.body.guard.excess(q),
        missed=task_residuals(problem, q),
    )


def speed_limits(problem: Problem, settings: SmoothSettings) -> FloatArray:
    """(D,) rad or m a frame: how far each DOF may go, by how far its joint was captured to go."""
    skeleton, fps = problem.body.skeleton, problem.captured.fps
    steps = np.abs(np.diff(problem.captured.q, axis=0)).max(0, initial=0.0)
    key = 2 * skeleton.dof_joint + skeleton.dof_slides
    largest = np.array([steps[key == own].max() for own in key])
    least = np.where(skeleton.dof_slides, settings.slide, settings.turn) / fps
    return np.maximum(settings.faster * largest, least)


def _failures(problem: Problem, q: FloatArray, frames: IntArray) -> FloatArray:
    """(T,) m, by how much a frame collides or misses a task; 0 outside of the frames."""
    out = np.zeros(len(q))
    excess, missed = problem.body.guard.excess(q[frames]), task_residuals(problem, q, frames) - TASK_SLACK
    out[frames] = np.maximum(excess, 0.0) + np.maximum(missed, 0.0)
    return out


def _runs(frames: BoolArray, fade: int) -> list[IntArray]:
    """Runs of frames (T,) that are set, or have one near them that is."""
    near = np.convolve(frames, np.ones(2 * fade + 1))[fade : fade + len(frames)] > 0.5
    return [np.arange(first, last + 1) for first, last in collision_groups(near)]


def _calm(problem: Problem, q: FloatArray, frames: IntArray, settings: SmoothSettings, attempt: Attempt) -> FloatArray:
    """(N, D) postures of a run of frames; q (T, D) is what they are now, and what stands beside them."""
    curves, body = q.copy(), problem.body
    free, limits = np.flatnonzero(body.free), problem.limits[frames]
    most = speed_limits(problem, settings)[free]
    seen: list[list[Constraint]] = [[] for _ in frames]
    looks = body.guard.look_all(curves[frames])
    for _ in range(settings.rounds):
        for known, found in zip(seen, looks, strict=True):
            if found.contacts is not None:
                known.append(found.contacts)
            del known[: -settings.memory]
        springs = _springs(problem, curves, frames, seen, limits[:, free], settings, attempt)
        steps = Steps(_steps_about(curves[:, free], frames), most, settings.speed)
        move = np.zeros((len(frames), q.shape[1]))
        move[:, free] = least_cost_move(
            _course(problem, curves, frames, settings), springs, steps, updates=settings.updates
        )
        move *= np.minimum(1.0, settings.trust / np.maximum(np.abs(move).max(1, keepdims=True), 1e-12))
        here = curves[frames]
        curves[frames], looks = _advance(body.guard, here, move, looks, limits)
        if np.abs(curves[frames] - here).max() < settings.still and all(found.excess <= 0 for found in looks):
            break
    return curves[frames]


def _advance(
    guard: Guard, q: FloatArray, move: FloatArray, looks: Sequence[Found], limits: FloatArray
) -> tuple[FloatArray, list[Found]]:
    """Postures (N, D) moved, and what is seen there.

    Which way out is the shortest is certain for shallow contacts alone, so what would come in deep stops on its way.
    """
    share, was = np.ones((len(q), 1)), np.array([found.excess for found in looks])
    there = np.clip(q + move, limits[..., 0], limits[..., 1])
    seen = guard.look_all(there)
    for _ in range(HALVINGS):
        deep = np.flatnonzero([found.excess for found in seen] > np.maximum(was, SHALLOW))
        if len(deep) == 0:
            break
        share[deep] /= 2
        there[deep] = np.clip(q[deep] + share[deep] * move[deep], limits[deep, :, 0], limits[deep, :, 1])
        for i, found in zip(deep.tolist(), guard.look_all(there[deep]), strict=True):
            seen[i] = found
    return there, seen


def _springs(
    problem: Problem,
    q: FloatArray,
    frames: IntArray,
    contacts: Sequence[Sequence[Constraint]],
    limits: FloatArray,
    settings: SmoothSettings,
    attempt: Attempt,
) -> Springs:
    """Everything that has to be met, or should be, linearised at the postures as they are."""
    free, hard = np.flatnonzero(problem.body.free), settings.hard * attempt.stiffness
    index, rows, strength = list[IntArray](), list[Rows](), list[FloatArray]()
    for i, frame in enumerate(frames.tolist()):
        placed = place(problem.body.skeleton, q[frame])
        asked = list[tuple[Rows, float]]()
        for contact in contacts[i]:
            aim = contact.rows(placed)
            asked += [(aim, settings.wish), (Rows(aim.jacobian, aim.low - attempt.ease, aim.high), hard)]
        for task in problem.tasks:
            strong = hard if task.required else settings.wish
            asked += [(constraint.rows(placed), strong) for constraint in task.constraints(frame, q)]
        asked.append((_limit_rows(limits[i], q[frame, free], len(q[frame]), free), hard))
        rows += [each for each, _ in asked]
        strength += [np.full(len(each.low), strong) for each, strong in asked]
        index += [np.full(len(each.low), i) for each, _ in asked]
    return Springs(
        np.concatenate(index),
        np.concatenate([each.jacobian[:, free] for each in rows]),
        np.concatenate([each.low for each in rows]),
        np.concatenate([each.high for each in rows]),
        np.concatenate(strength),
    )


def _limit_rows(limits: FloatArray, q: FloatArray, n_dofs: int, free: IntArray) -> Rows:
    """Limits (F, 2) of the DOFs that are free and not without a limit, where they stand at q (F,)."""
    bounded = np.flatnonzero(np.isfinite(limits).any(1))
    low, high = (limits[bounded] - q[bounded, None]).T
    return Rows(np.eye(n_dofs)[free[bounded]], low, high)


def _course(problem: Problem, q: FloatArray, frames: IntArray, settings: SmoothSettings) -> Course:
    """The change as it is, in the frames of a run and two on either side."""
    free = np.flatnonzero(problem.body.free)
    wide = np.arange(frames[0] - 2, frames[-1] + 3)
    inside = np.clip(wide, 0, len(q) - 1)
    change = (q - problem.captured.q)[np.ix_(inside, free)]
    return Course(change, wide == inside, np.maximum(problem.body.weights[free], 1e-6), settings.scale)


def _steps_about(q: FloatArray, frames: IntArray) -> FloatArray:
    """(N + 1, F) steps into, within and out of a run of frames; NaN where the motion ends."""
    beside = np.full((1, q.shape[1]), np.nan)
    before = q[frames[0] - 1][None] if frames[0] > 0 else beside
    after = q[frames[-1] + 1][None] if frames[-1] + 1 < len(q) else beside
    return np.diff(np.concatenate([before, q[frames], after]), axis=0)
