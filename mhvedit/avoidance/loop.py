"""The loop of constraint trajectories and filter, with key frames corrected without a hand (collision-free editing, 3).

Trajectories -> filter -> collision check -> corrected key frames -> trajectories, until nothing collides. The paper
drags end effectors by hand; here the deepest frame of each run of collisions is freed by pushing limbs along the
normals of their contacts by their depths, and where the joints came to are the constraints of the key frame. What does
not get free within a number of rounds is said not to have converged.
"""

from dataclasses import dataclass, field

import numpy as np

from mhvedit.avoidance.bisection import collision_groups
from mhvedit.avoidance.kalman import Effectors, FilterSettings, resolve_effectors
from mhvedit.avoidance.methods import RESERVE, Avoided, Problem, predict_frame, settled, task_residuals
from mhvedit.avoidance.tasks import Keep
from mhvedit.avoidance.trajectory import Curve, Ends, KeyDisplacements, constraint_trajectory
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.forward import points_on_joints
from mhvedit.skeleton.model import Motion


@dataclass(frozen=True, slots=True)
class LoopSettings:
    """What the paper leaves open."""

    curve: Curve = Curve.PCHIP
    ends: Ends = Ends.ZERO
    blend: int = 8  # frames before and after a collision in which the displacement comes and goes
    moved: float = 0.001  # m: effectors that go less far for a key frame are not constrained by it
    likeness: float = 0.6  # rad or m: poses stay this near to the captured ones
    rounds: int = 6
    patience: int = 3  # rounds without getting any nearer, after which it is given up
    filter: FilterSettings = field(default_factory=FilterSettings)


@dataclass(slots=True, eq=False)
class Edit:
    """An effector that is led past a collision: grows while the loop runs."""

    joint: int
    scope: tuple[int, int]
    keys: dict[int, FloatArray] = field(default_factory=dict)  # (3,) m by frame

    @property
    def displacements(self) -> KeyDisplacements:
        """As the trajectory generator takes them."""
        frames = np.array(sorted(self.keys), np.int64)
        return KeyDisplacements(self.scope, frames, np.stack([self.keys[int(frame)] for frame in frames]))


def avoid_by_filter(problem: Problem, *, settings: LoopSettings | None = None) -> Avoided:
    """Displaced constraint trajectories, met by the unscented filter (collision-free editing, figure 1).

    Args:
        problem: what to solve.
        settings: of the loop.
    """
    chosen, guard = settings or LoopSettings(), problem.body.guard
    before = guard.excess(problem.captured.q)
    q, after, edits = problem.captured.q, before, list[Edit]()
    best, best_after, rounds, best_round, solved = q, before, 0, 0, 0
    while (after > -RESERVE).any() and rounds < chosen.rounds and rounds - best_round < chosen.patience:
        for group in collision_groups(after > -RESERVE):
            frame = group[0] + int(after[group[0] : group[1] + 1].argmax())
            correct_key_frame(problem, edits, q, frame=frame, group=group, settings=chosen)
            solved += 1
        moved = _resolve(problem, edits, chosen)
        changed = (moved != q).any(1)
        q, after, rounds = moved, after.copy(), rounds + 1
        after[changed] = guard.excess(q[changed])
        if _badness(after) < _badness(best_after):
            best, best_after, best_round = q, after, rounds
    keys = np.array(sorted({frame for edit in edits for frame in edit.keys}), np.int64)
    motion = Motion(best, problem.captured.fps)
    return Avoided(motion, before, best_after, task_residuals(problem, best), keys, solved)


def correct_key_frame(
    problem: Problem,
    edits: list[Edit],
    q: FloatArray,
    *,
    frame: int,
    group: tuple[int, int],
    settings: LoopSettings,
) -> None:
    """Free one frame and put keys on the effectors that it moves: what the paper has a person drag (A0.3).

    Args:
        problem: what is solved.
        edits: changed.
        q: (T, D) the motion as it is.
        frame: the deepest of its run.
        group: first and last frame of the run.
        settings: of the loop.
    """
    skeleton, captured = problem.body.skeleton, problem.captured.q
    posture = predict_frame(problem, frame, q, away=settings.blend).q
    joints = np.arange(skeleton.n_joints)
    poses = np.stack([captured[frame], q[frame], posture])
    was, here, wanted = points_on_joints(skeleton, poses, joints, np.zeros((len(joints), 3)))
    scope = (max(group[0] - settings.blend, 0), min(group[1] + settings.blend, len(q) - 1))
    for joint in joints.tolist():
        displacement = wanted[joint] - was[joint]
        mine = [edit for edit in edits if edit.joint == joint and edit.scope[0] <= frame <= edit.scope[1]]
        if not mine and np.linalg.norm(displacement) > settings.moved:
            mine = [Edit(joint, scope)]
            edits += mine
        for edit in mine:
            again = edit.keys.get(frame)  # where the filter did not get all the way, ask for that much more
            edit.keys[frame] = displacement if again is None else again + wanted[joint] - here[joint]
            edit.scope = (min(edit.scope[0], scope[0]), max(edit.scope[1], scope[1]))


def _badness(excess: FloatArray) -> tuple[int, float]:
    """Which of two motions is nearer to free: fewer colliding frames, then less deep ones."""
    return int((excess > -RESERVE).sum()), float(np.maximum(excess, -RESERVE).sum())


def _resolve(problem: Problem, edits: list[Edit], settings: LoopSettings) -> FloatArray:
    """(T, D) captured poses, brought to all trajectories and to what stands."""
    skeleton, captured = problem.body.skeleton, problem.captured
    joints = np.array([edit.joint for edit in edits], np.int64)
    points = np.zeros((len(joints), 3))
    targets = np.full((captured.n_frames, len(edits), 3), np.nan)
    paths = points_on_joints(skeleton, captured.q, joints, points)
    for e, edit in enumerate(edits):
        wanted = constraint_trajectory(paths[:, e], edit.displacements, curve=settings.curve, ends=settings.ends)
        targets[edit.scope[0] : edit.scope[1] + 1, e] = wanted
    edited = np.isfinite(targets[..., 0]).any(1)
    for task in problem.tasks:
        if isinstance(task, Keep) and task.required:
            held = task.stands & edited[:, None]
            targets = np.concatenate([targets, np.where(held[..., None], task.targets, np.nan)], 1)
            joints, points = np.concatenate([joints, task.joints]), np.concatenate([points, task.points])
    body = problem.body
    moved = resolve_effectors(
        skeleton,
        captured.q,
        np.where(body.free, 1 / body.weights, 0.0),
        effectors=Effectors(joints, points),
        targets=targets,
        limits=np.clip(problem.limits, *(captured.q[..., None] + side * settings.likeness for side in (-1, 1))),
        settings=settings.filter,
    ).q
    frames = np.flatnonzero(edited)
    moved[frames] = settled(problem, frames, moved[frames])
    return moved
