"""`mhvedit avoid`: a motion is read, freed of self-collision, written in the format it came in, and reported."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Final

import numpy as np

from mhvedit.avoidance.continuous import go_round
from mhvedit.avoidance.correct import Body
from mhvedit.avoidance.effort import effort_weights
from mhvedit.avoidance.equipment import attach
from mhvedit.avoidance.ground import HANDS, ground_joints, keep_everywhere, keep_standing
from mhvedit.avoidance.guards import mesh_guard
from mhvedit.avoidance.loop import avoid_by_filter
from mhvedit.avoidance.methods import Avoided, Problem, avoid_by_bisection, avoid_like_nebel, touched_frames
from mhvedit.avoidance.metrics import Metrics, measure
from mhvedit.avoidance.tasks import Task, frozen_dofs
from mhvedit.collision.detect import CollisionBody, Depths, measure_depths
from mhvedit.errors import CaptureError, ShapeError
from mhvedit.files import replacing
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.pipeline.job import Progress
from mhvedit.pipeline.motions import open_motion
from mhvedit.sequences.formats import parse_mesh
from mhvedit.skeleton.model import Motion, Skeleton
from mhvedit.skeleton.skin import SkinnedBody, posed_vertices
from mhvedit.view.postures import PostureStory, write_posture_report

FORMAT: Final = 1
TOLERANCE_MM: Final = 5.0  # deeper than at rest


class Method(StrEnum):
    """How collisions are removed."""

    FILTER = "filter"
    BISECTION = "bisection"
    NEBEL = "nebel"


METHODS: Final[Mapping[Method, Callable[[Problem], Avoided]]] = {
    Method.FILTER: avoid_by_filter,
    Method.BISECTION: avoid_by_bisection,
    Method.NEBEL: avoid_like_nebel,
}


@dataclass(frozen=True, slots=True)
class AvoidOptions:
    """What a user can ask for."""

    method: Method = Method.BISECTION
    body: Path | None = None  # skinned .npz that a motion without a body is put on
    units: str = "m"  # of a .bvh
    up: str = "z"  # of a .bvh
    continuous: bool = True  # look between the frames too
    attached: tuple[str, ...] = ()  # MESH:LIMB
    frozen: tuple[str, ...] = ()  # joints that must not move
    report: bool = True
    workers: int = 2


@dataclass(frozen=True, slots=True, eq=False)
class AvoidOutcome:
    """What came of it."""

    avoided: Avoided
    metrics: Metrics
    report: Mapping[str, Any]
    why: tuple[str, ...]  # sentences; empty if it converged


def run_avoid(path: Path, out: Path, *, options: AvoidOptions, progress: Progress | None = None) -> AvoidOutcome:
    """Free a motion of self-collision and write it with `report.json` and `report.html`.

    Args:
        path: skinned `.npz`, or `.bvh`.
        out: folder.
        options: of the run.
        progress: told stage and share done.

    Raises:
        CaptureError: the motion or a mesh cannot be used.
    """
    opened = open_motion(path, body=options.body, units=options.units, up=options.up)
    body = _with_equipment(opened.body, options.attached)
    problem, ready = avoidance_problem(
        body, opened.motion, frozen=options.frozen, nearest=opened.nearest, workers=options.workers
    )
    started = time.perf_counter()
    avoided = METHODS[options.method](problem)
    if options.continuous and avoided.converged:
        avoided, _ = go_round(problem, avoided)
    seconds = time.perf_counter() - started
    metrics, why = measure(problem, avoided), reasons(ready, avoided)
    depths = [measure_depths(ready, motion.q, workers=options.workers) for motion in (opened.motion, avoided.motion)]
    report = as_report(path, options, problem, ready, avoided, depths, metrics, why, seconds)
    out.mkdir(parents=True, exist_ok=True)
    opened.write(out / f"motion{opened.suffix}", avoided.motion)
    with replacing(out / "report.json") as beside:
        beside.write_text(json.dumps(report, indent=1), encoding="utf-8")
    if options.report:
        write_posture_report(out / "report.html", posture_story(path, ready, problem, avoided, depths, report))
    return AvoidOutcome(avoided, metrics, report, why)


def method_of(name: str) -> Method:
    """The method of a name.

    Raises:
        ShapeError: there is none; the message lists those that there are.
    """
    if name not in list(Method):
        raise ShapeError("--method", repr(name), "one of " + ", ".join(Method))
    return Method(name)


def avoidance_problem(
    body: SkinnedBody, motion: Motion, *, frozen: Sequence[str] = (), nearest: int = 2, workers: int | None = None
) -> tuple[Problem, CollisionBody]:
    """The usual problem of a skinned motion: its own limbs must not meet, its feet keep standing.

    Args:
        body: skinned, with its equipment.
        motion: captured.
        frozen: joints that must not move.
        nearest: limbs that are at least this many joints apart must not meet.
        workers: threads of the detection.
    """
    skeleton, guard = body.skeleton, mesh_guard(body, nearest=nearest, workers=workers)
    tasks = ground_tasks(skeleton, motion)
    moved = Body(skeleton, effort_weights(skeleton), frozen_dofs(skeleton, frozen), guard)
    return Problem(moved, motion, tasks), guard.body


def ground_tasks(skeleton: Skeleton, motion: Motion) -> tuple[Task, ...]:
    """Feet that stand stay; if it can be had, feet stay wherever they go, and hands that bear weight stay too."""
    feet, hands = ground_joints(skeleton), ground_joints(skeleton, HANDS)
    if len(feet) == 0:
        return ()
    stand = keep_standing(skeleton, motion, feet)
    tasks: tuple[Task, ...] = (stand, keep_everywhere(skeleton, motion, feet))
    if len(hands):
        floor = float(stand.targets[..., 2].min())
        tasks += (keep_standing(skeleton, motion, hands, floor=floor, required=False),)
    return tasks


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


def as_report(
    path: Path,
    options: AvoidOptions,
    problem: Problem,
    body: CollisionBody,
    avoided: Avoided,
    depths: Sequence[Depths],
    metrics: Metrics,
    why: Sequence[str],
    seconds: float,
) -> dict[str, Any]:
    """The content of `report.json`."""
    captured, skeleton = problem.captured, problem.body.skeleton
    turns = ~skeleton.dof_slides
    change = np.abs(avoided.motion.q - captured.q)[:, turns].max(1, initial=0.0)
    touching = np.flatnonzero((depths[0].depth > 0).any(0) | (depths[1].depth > 0).any(0))
    return {
        "version": FORMAT,
        "motion": path.name,
        "method": options.method.value,
        "frames": captured.n_frames,
        "fps": captured.fps,
        "tolerance_mm": TOLERANCE_MM,
        "converged": avoided.converged,
        "why": list(why),
        "touched": np.flatnonzero(touched_frames(captured, avoided.motion)).tolist(),
        "colliding_before": np.flatnonzero(avoided.before > 0).tolist(),
        "colliding_after": avoided.colliding.tolist(),
        "joint_change": _rounded(change, 5),
        "residual_mm": _rounded(1000 * avoided.missed, 3),
        "outside_limits": _outside_limits(problem),
        "pairs": [
            {
                "limbs": [body.limbs.names[limb] for limb in body.pairs.limbs[pair]],
                "rest_mm": round(1000 * float(body.rest_depth[pair]), 2),
                "before_mm": _rounded(1000 * depths[0].depth[:, pair], 2),
                "after_mm": _rounded(1000 * depths[1].depth[:, pair], 2),
            }
            for pair in touching
        ],
        "metrics": asdict(metrics),
        "seconds": round(seconds, 2),
    }


def posture_story(
    path: Path,
    body: CollisionBody,
    problem: Problem,
    avoided: Avoided,
    depths: Sequence[Depths],
    report: Mapping[str, Any],
) -> PostureStory:
    """What the page shows: the worst frames before and after, with the limbs that collide."""
    chosen = telling_frames(avoided.before, avoided.after)
    motions = (problem.captured.q, avoided.motion.q)
    return PostureStory(
        name=path.stem,
        method=str(report["method"]),
        fps=problem.captured.fps,
        frames=tuple(chosen),
        faces=body.body.faces,
        before=tuple(posed_vertices(body.body, motions[0][chosen])),
        after=tuple(posed_vertices(body.body, motions[1][chosen])),
        coloured_before=tuple(_colliding_faces(body, depths[0].depth[frame]) for frame in chosen),
        coloured_after=tuple(_colliding_faces(body, depths[1].depth[frame]) for frame in chosen),
        depth_before=1000 * (depths[0].depth - body.rest_depth).max(1).clip(0.0),
        depth_after=1000 * (depths[1].depth - body.rest_depth).max(1).clip(0.0),
        touched=touched_frames(problem.captured, avoided.motion),
        limit_mm=TOLERANCE_MM,
        converged=avoided.converged,
        why=tuple(report["why"]),
        numbers=dict(report["metrics"]) | {"seconds": report["seconds"]},
    )


def telling_frames(before: FloatArray, after: FloatArray, *, n: int = 5) -> list[int]:
    """Frames worth a picture: the worst of what is left, then the worst of what was, apart from each other."""
    order = [*np.argsort(-after)[: int((after > 0).sum())], *np.argsort(-before, kind="stable")]
    apart, chosen = max(1, len(before) // (3 * n)), list[int]()
    for frame in order:
        if len(chosen) < n and all(abs(int(frame) - other) >= apart for other in chosen):
            chosen.append(int(frame))
    return sorted(chosen)


def _colliding_faces(body: CollisionBody, depth: FloatArray) -> BoolArray:
    """(F,) which triangles belong to limbs that are deeper in another than allowed."""
    over = depth - body.rest_depth > TOLERANCE_MM / 1000
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


def _with_equipment(body: SkinnedBody, attached: Sequence[str]) -> SkinnedBody:
    """The body with all that hangs on it."""
    for text in attached:
        file, colon, limb = text.rpartition(":")
        if not colon or not file or not limb:
            raise ShapeError("--attach", repr(text), "MESH:LIMB")
        path = Path(file)
        try:
            mesh = parse_mesh(path.read_bytes(), path)
        except OSError as fault:
            raise CaptureError(path, "a readable mesh", str(fault.strerror)) from fault
        body = attach(body, mesh.vertices.astype(np.float64), mesh.faces.astype(np.int32), limb=limb)
    return body


def _rounded(values: FloatArray, digits: int) -> list[float]:
    return [float(value) for value in np.round(values, digits)]
