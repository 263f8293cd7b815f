"""What `mhvedit avoid` has to say: the reasons, `report.json`, and what its page shows."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from mhvedit.avoidance.methods import Avoided, Problem, touched_frames
from mhvedit.avoidance.metrics import Metrics
from mhvedit.collision.detect import TOLERANCE, CollisionBody, Depths, measure_depths
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.skeleton.skin import posed_vertices
from mhvedit.view.postures import PostureStory

FORMAT: Final = 1
LARGEST_STEP: Final = 1.5  # over the captured; what is more is said
PICTURED: Final = 5  # frames on the page


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """All that is known about a motion that was edited."""

    path: Path  # of the motion
    method: str
    problem: Problem
    body: CollisionBody
    avoided: Avoided
    depths: tuple[Depths, Depths]  # before and after
    metrics: Metrics
    why: tuple[str, ...]  # sentences on why it did not converge
    notes: tuple[str, ...]  # sentences on what else is worth knowing
    seconds: float


def reasons(body: CollisionBody, avoided: Avoided) -> tuple[str, ...]:
    """Why the answer is no, in sentences; nothing if it is yes."""
    sentences = []
    if len(avoided.colliding):
        worst = int(avoided.after.argmax())
        over = measure_depths(body, avoided.motion.q[worst : worst + 1]).depth[0] - body.rest_depth
        a, b = body.pairs.limbs[int(over.argmax())]
        sentences.append(
            f"{len(avoided.colliding)} of {avoided.motion.n_frames} frames still collide; worst is frame {worst}: "
            f"{body.limbs.names[a]} and {body.limbs.names[b]} are {1000 * over.max():.1f} mm deeper than at rest"
        )
    if not avoided.tasks_kept:
        frame = int(avoided.missed.argmax())
        sentences.append(f"what stood still moved by {1000 * avoided.missed[frame]:.1f} mm in frame {frame}")
    return tuple(sentences)


def said_steps(metrics: Metrics) -> tuple[str, ...]:
    """A sentence if the motion became much faster somewhere."""
    if metrics.step_ratio <= LARGEST_STEP:
        return ()
    return (f"a joint turns {metrics.step_ratio:.1f} times as far from one frame to the next as any did before",)


def as_report(found: Findings) -> dict[str, Any]:
    """The content of `report.json`."""
    captured, avoided, body = found.problem.captured, found.avoided, found.body
    before, after = (depths.depth for depths in found.depths)
    turns = ~found.problem.body.skeleton.dof_slides
    change = np.abs(avoided.motion.q - captured.q)[:, turns].max(1, initial=0.0)
    return {
        "version": FORMAT,
        "motion": found.path.name,
        "method": found.method,
        "frames": captured.n_frames,
        "fps": captured.fps,
        "tolerance_mm": 1000 * TOLERANCE,
        "converged": avoided.converged,
        "why": list(found.why),
        "notes": list(found.notes),
        "touched": np.flatnonzero(touched_frames(captured, avoided.motion)).tolist(),
        "colliding_before": np.flatnonzero(avoided.before > 0).tolist(),
        "colliding_after": avoided.colliding.tolist(),
        "joint_change": _rounded(change, 5),
        "residual_mm": _rounded(1000 * avoided.missed, 3),
        "outside_limits": _outside_limits(found.problem),
        "pairs": [
            {
                "limbs": [body.limbs.names[limb] for limb in body.pairs.limbs[pair]],
                "rest_mm": round(1000 * float(body.rest_depth[pair]), 2),
                "before_mm": _rounded(1000 * before[:, pair], 2),
                "after_mm": _rounded(1000 * after[:, pair], 2),
            }
            for pair in np.flatnonzero((before > 0).any(0) | (after > 0).any(0))
        ],
        "metrics": asdict(found.metrics),
        "seconds": round(found.seconds, 2),
    }


def posture_story(found: Findings) -> PostureStory:
    """What the page shows: the worst frames before and after, with the limbs that collide."""
    body, captured, avoided = found.body, found.problem.captured, found.avoided
    before, after = (depths.depth for depths in found.depths)
    chosen = worst_frames(avoided.before, avoided.after)
    return PostureStory(
        name=found.path.stem,
        method=found.method,
        fps=captured.fps,
        frames=tuple(chosen),
        faces=body.body.faces,
        before=tuple(posed_vertices(body.body, captured.q[chosen])),
        after=tuple(posed_vertices(body.body, avoided.motion.q[chosen])),
        coloured_before=tuple(_colliding_faces(body, before[frame]) for frame in chosen),
        coloured_after=tuple(_colliding_faces(body, after[frame]) for frame in chosen),
        depth_before=1000 * (before - body.rest_depth).max(1).clip(0.0),
        depth_after=1000 * (after - body.rest_depth).max(1).clip(0.0),
        touched=touched_frames(captured, avoided.motion),
        limit_mm=1000 * TOLERANCE,
        converged=avoided.converged,
        why=(*found.why, *found.notes),
        numbers=asdict(found.metrics) | {"seconds": round(found.seconds, 2)},
    )


def worst_frames(before: FloatArray, after: FloatArray) -> list[int]:
    """Frames worth a picture: the worst of what is left, then the worst of what was, apart from each other."""
    order = [*np.argsort(-after)[: int((after > 0).sum())], *np.argsort(-before, kind="stable")]
    apart, chosen = max(1, len(before) // (3 * PICTURED)), list[int]()
    for frame in order:
        if len(chosen) < PICTURED and all(abs(int(frame) - other) >= apart for other in chosen):
            chosen.append(int(frame))
    return sorted(chosen)


def _colliding_faces(body: CollisionBody, depth: FloatArray) -> BoolArray:
    """(F,) which triangles belong to limbs that are deeper in another than allowed."""
    over = depth - body.rest_depth > TOLERANCE
    limbs = np.unique(body.pairs.limbs[over])
    arrays, out = body.limbs.arrays, np.zeros(len(body.body.faces), np.bool_)
    for limb in limbs:
        out[body.limbs.face_ids[arrays.face_start[limb] : arrays.face_start[limb + 1]]] = True
    return out


def _outside_limits(problem: Problem) -> list[dict[str, Any]]:
    """DOFs whose captured values pass their limits: reported, never clipped in silence."""
    skeleton, q = problem.body.skeleton, problem.captured.q
    beyond = np.maximum(skeleton.limits[:, 0] - q, q - skeleton.limits[:, 1])
    return [
        {
            "dof": skeleton.dof_names[dof],
            "frames": int((beyond[:, dof] > 0).sum()),
            "worst": round(float(beyond[:, dof].max()), 5),
        }
        for dof in np.flatnonzero((beyond > 0).any(0))
    ]


def _rounded(values: FloatArray, digits: int) -> list[float]:
    return [float(value) for value in np.round(values, digits)]
