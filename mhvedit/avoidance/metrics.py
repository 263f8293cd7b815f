"""How an edited motion compares with the captured one (Degenhardt gives scenes without numbers; these are ours)."""

from dataclasses import dataclass

import numpy as np

from mhvedit.avoidance.methods import Avoided, Problem, touched_frames
from mhvedit.avoidance.tasks import Keep
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.forward import points_on_joints


@dataclass(frozen=True, slots=True)
class Metrics:
    """One row of the table."""

    frames: int
    colliding_before: int
    colliding_after: int
    excess_before_mm: float  # deepest over what is allowed
    excess_after_mm: float
    effort: float  # mean over frames of sum gamma (q - captured)^2
    change_rms: float  # rad, over all turning DOFs and frames
    change_max: float  # rad
    touched: int  # frames
    step_ratio: float  # largest step of a turning DOF between frames, over the captured one
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
    turns = ~problem.body.skeleton.dof_slides
    captured, edited = problem.captured.q, avoided.motion.q
    change = np.abs(edited - captured)[:, turns]
    return Metrics(
        frames=len(captured),
        colliding_before=int((avoided.before > 0).sum()),
        colliding_after=len(avoided.colliding),
        excess_before_mm=1000 * float(avoided.before.max()),
        excess_after_mm=1000 * float(avoided.after.max()),
        effort=float(((edited - captured) ** 2 @ problem.body.weights).mean()),
        change_rms=float(np.sqrt((change**2).mean())),
        change_max=float(change.max(initial=0.0)),
        touched=int(touched_frames(problem.captured, avoided.motion).sum()),
        step_ratio=largest_step(edited[:, turns]) / max(largest_step(captured[:, turns]), 1e-9),
        jerk_ratio=jerk(edited[:, turns]) / max(jerk(captured[:, turns]), 1e-12),
        slip_mm=1000 * slip(problem, edited),
        missed_mm=1000 * float(avoided.missed.max(initial=0.0)),
        solved=avoided.solved,
    )


def largest_step(q: FloatArray) -> float:
    """Largest change of a DOF from one frame to the next, rad."""
    return float(np.abs(np.diff(q, axis=0)).max(initial=0.0))


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
            worst = max(worst, float(np.where(task.slack == 0, away, 0.0).max(initial=0.0)))
    return worst
