"""Between frames: thin obstacles must not be passed through from one to the next (Degenhardt, future work)."""

from dataclasses import dataclass, replace

import numpy as np

from mhvedit.avoidance.correct import Guard, correct_posture
from mhvedit.avoidance.methods import Avoided, Problem, predict_frame, settled, task_constraints, task_residuals
from mhvedit.avoidance.posture import limits_around
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.model import Motion, Skeleton

REACH = 0.02  # m: no joint goes further between two looks
MOST = 16  # looks between two frames
SLACK = 0.006  # m: between frames limbs may graze each other by this much more than in them
SPREAD = 4  # frames on either side that take part in going round
ROUNDS = 6


@dataclass(frozen=True, slots=True, eq=False)
class Skipped:
    """Where a motion collides between two frames that are free."""

    frames: IntArray  # (K,) the frame before
    shares: FloatArray  # (K,) of the way to the next, where it is deepest
    excess: FloatArray  # (K,) m, over what is allowed


def skipped_collisions(skeleton: Skeleton, guard: Guard, q: FloatArray) -> Skipped:
    """Look between the frames, the closer the faster the joints go.

    Args:
        skeleton: the tree.
        guard: of the body.
        q: (T, D) rad or m.
    """
    frames, shares = _looks(skeleton, q)
    if len(frames) == 0:
        return Skipped(frames, shares, shares)
    between = q[frames] + shares[:, None] * (q[frames + 1] - q[frames])
    excess = guard.excess(between) - SLACK
    worst = [
        rows[excess[rows].argmax()] for rows in np.split(np.arange(len(frames)), np.flatnonzero(np.diff(frames)) + 1)
    ]
    bad = np.array([row for row in worst if excess[row] > 0], np.int64)
    return Skipped(frames[bad], shares[bad], excess[bad])


def go_round(problem: Problem, avoided: Avoided) -> tuple[Avoided, Skipped]:
    """Correct what is skipped between frames, and the frames about it.

    Args:
        problem: what is solved.
        avoided: free in its frames.

    Returns:
        The motion, and what is still skipped.
    """
    q, guard, skeleton = avoided.motion.q.copy(), problem.body.guard, problem.body.skeleton
    found, solved, keys = skipped_collisions(skeleton, guard, q), avoided.solved, set(avoided.keys.tolist())
    for _ in range(ROUNDS):
        if len(found.frames) == 0:
            break
        for frame, share in zip(found.frames.tolist(), found.shares.tolist(), strict=True):
            touched, solved = _window(frame, len(q)), solved + 1
            before = q[touched].copy()
            q[touched] = _pass_by(problem, q, frame, share)
            bad = touched[guard.excess(q[touched]) > 0]
            for one in bad.tolist():
                q[one] = predict_frame(problem, one, q, away=SPREAD).q
            if (guard.excess(q[touched]) > 0).any():
                q[touched] = before  # frames come first
            else:
                keys |= set(bad.tolist())
        found = skipped_collisions(skeleton, guard, q)
    changed = replace(
        avoided,
        motion=Motion(q, avoided.motion.fps),
        after=guard.excess(q),
        missed=task_residuals(problem, q),
        keys=np.array(sorted(keys), np.int64),
        solved=solved,
    )
    return changed, found


def _window(frame: int, n_frames: int) -> IntArray:
    """Frames that take part in going round what is after a frame."""
    return np.arange(max(frame - SPREAD + 1, 0), min(frame + SPREAD, n_frames - 1) + 1)


def _pass_by(problem: Problem, q: FloatArray, frame: int, share: float) -> FloatArray:
    """Correct the posture between two frames, and lead the frames about it past there: their postures."""
    body, captured = problem.body, problem.captured.q
    limits = limits_around(body.skeleton.limits, captured[frame])
    between = q[frame] + share * (q[frame + 1] - q[frame])
    asked = task_constraints(problem, frame, q)
    change = correct_posture(body, between, constraints=asked, limits=limits).q - between
    near = _window(frame, len(q))
    away = np.maximum(np.abs(near - (frame + share)) - 0.5, 0.0) / SPREAD
    hat = np.clip(1 - away, 0.0, 1.0) ** 2 * (1 + 2 * np.clip(away, 0.0, 1.0))
    bounds = problem.limits[near]
    return settled(problem, near, np.clip(q[near] + hat[:, None] * change, bounds[..., 0], bounds[..., 1]))


def _looks(skeleton: Skeleton, q: FloatArray) -> tuple[IntArray, FloatArray]:
    """Frame and share of the way of every look between frames."""
    places = joint_frames(skeleton, q)[1]
    travel = np.linalg.norm(np.diff(places, axis=0), axis=2).max(1, initial=0.0)
    counts = np.clip(np.ceil(travel / REACH).astype(np.int64) - 1, 0, MOST)
    frames = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(len(frames)) - np.repeat(np.cumsum(counts) - counts, counts)
    return frames, (within + 1) / (counts[frames] + 1)
