"""How an edited motion compares with the captured one (Degenhardt gives scenes without numbers; these are ours)."""

from dataclasses import dataclass

import numpy as np

from mhvedit.avoidance.methods import Avoided, Problem, touched_frames
from mhvedit.avoidance.tasks import Keep
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.forward import joint_frames, points_on_joints
from mhvedit.skeleton.model import Skeleton

LEAST_STEP = 0.01  # rad: a motion that is slower counts as if it were as fast


@dataclass(frozen=True, slots=True)
class Metrics:
    """One row of the table."""

    frames: int
    colliding_before: int
    colliding_after: int
    deepest_before_mm: float  # beyond what it is at rest
    deepest_after_mm: float
    effort: float  # mean over frames of sum gamma (q - captured)^2
    change_rms: float  # rad, over all turning DOFs and frames
    change_max: float  # rad
    touched: int  # frames
    step_ratio: float  # largest turn of a joint between frames, in the world or its parent, over the captured one
    jerk_ratio: float  # root mean square third difference, over the captured one
    slip_mm: float  # largest movement of what stood still
    missed_mm: float  # of required tasks
    solved: int  # how many times frames were solved


def measure(problem: Problem, avoided: Avoided) -> Metrics:
    """Compare.

    Args:
        problem: with the captured motion.
        avoided: what came of it.
    """
    skeleton = problem.body.skeleton
    turns = ~skeleton.dof_slides
    captured, edited = problem.captured.q, avoided.motion.q
    change = np.abs(edited - captured)[:, turns]
    steps = [largest_turns(skeleton, q) for q in (captured, edited)]
    return Metrics(
        frames=len(captured),
        colliding_before=int((avoided.before > 0).sum()),
        colliding_after=len(avoided.colliding),
        deepest_before_mm=1000 * (float(avoided.before.max()) + problem.body.guard.allowed),
        deepest_after_mm=1000 * (float(avoided.after.max()) + problem.body.guard.allowed),
        effort=float(((edited - captured) ** 2 @ problem.body.weights).mean()),
        change_rms=float(np.sqrt((change**2).mean())),
        change_max=float(change.max(initial=0.0)),
        touched=int(touched_frames(problem.captured, avoided.motion).sum()),
        step_ratio=float((steps[1] / np.maximum(steps[0], LEAST_STEP)).max()),
        jerk_ratio=jerk(edited[:, turns]) / max(jerk(captured[:, turns]), 1e-12),
        slip_mm=1000 * slip(problem, edited),
        missed_mm=1000 * float(avoided.missed.max(initial=0.0)),
        solved=avoided.solved,
    )


def largest_turns(skeleton: Skeleton, q: FloatArray) -> FloatArray:
    """(2,) rad, the most that any joint turns from one frame to the next: in the world, and in its parent's frame."""
    world = joint_frames(skeleton, q)[0]
    local = np.concatenate([world[:, :1], np.swapaxes(world[:, skeleton.parents[1:]], 2, 3) @ world[:, 1:]], 1)
    return np.array([_turns(each).max(initial=0.0) for each in (world, local)])


def _turns(rotations: FloatArray) -> FloatArray:
    """(T - 1, J) rad, from each frame (T, J, 3, 3) to the next."""
    trace = (rotations[:-1] * rotations[1:]).sum((2, 3))
    return np.asarray(np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0)))


def jerk(q: FloatArray) -> float:
    """Root mean square third difference, rad a frame^3."""
    return float(np.sqrt((np.diff(q, 3, axis=0) ** 2).mean())) if len(q) > 3 else 0.0


def slip(problem: Problem, q: FloatArray) -> float:
    """Largest distance between where a point stood still and where it is now, m."""
    worst = 0.0
    for task in problem.tasks:
        if isinstance(task, Keep) and task.required:
            away = np.linalg.norm(
                points_on_joints(problem.body.skeleton, q, task.joints, task.points) - task.targets, axis=2
            )
            worst = max(worst, float(np.where(task.stands, away, 0.0).max(initial=0.0)))
    return worst
