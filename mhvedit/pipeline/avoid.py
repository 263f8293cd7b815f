"""`mhvedit avoid`: a motion is read, freed of self-collision, written in the format it came in, and reported."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Final

import numpy as np

from mhvedit.avoidance.continuous import go_round, skipped_collisions
from mhvedit.avoidance.correct import Body
from mhvedit.avoidance.effort import effort_weights
from mhvedit.avoidance.equipment import attach
from mhvedit.avoidance.ground import HANDS, at_joints, ground_joints, keep_everywhere, keep_standing, soles
from mhvedit.avoidance.guards import mesh_guard
from mhvedit.avoidance.loop import avoid_by_filter
from mhvedit.avoidance.methods import Avoided, Problem, avoid_by_bisection, avoid_like_nebel
from mhvedit.avoidance.metrics import measure
from mhvedit.avoidance.smooth import smoothed
from mhvedit.avoidance.tasks import Task, frozen_dofs
from mhvedit.collision.detect import CollisionBody, measure_depths
from mhvedit.errors import CaptureError, ShapeError
from mhvedit.files import replacing
from mhvedit.pipeline.avoid_report import Findings, as_report, posture_story, reasons, said_steps
from mhvedit.pipeline.folders import PAGE, REPORT, Owner, check_owner
from mhvedit.pipeline.motions import open_motion
from mhvedit.pipeline.posture_file import POSTURES, postures_of, write_postures
from mhvedit.pipeline.progress import Progress, silent
from mhvedit.sequences.formats import parse_mesh
from mhvedit.skeleton.limits import said_beyond_limits
from mhvedit.skeleton.model import Motion, joint_index
from mhvedit.skeleton.skin import SkinnedBody
from mhvedit.view.postures import write_posture_report


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

    found: Findings
    report: Mapping[str, Any]  # as in `report.json`


def run_avoid(
    path: Path,
    out: Path,
    *,
    options: AvoidOptions,
    progress: Progress | None = None,
    warn: Callable[[str], None] | None = None,
) -> AvoidOutcome:
    """Free a motion of self-collision and write it with `postures.npz`, `report.json` and `report.html`.

    Args:
        path: skinned `.npz`, or `.bvh`.
        out: folder.
        options: of the run.
        progress: told stage and share done.
        warn: told what speaks against units and up axis, before anything else is done; the report has it too.

    Raises:
        CaptureError: the motion or a mesh cannot be used, or `mhvedit solve` wrote the folder.
    """
    check_owner(out, Owner.AVOID)
    opened = open_motion(path, body=options.body, units=options.units, up=options.up)
    warn = warn or (lambda text: None)
    for doubt in opened.doubts:
        warn(doubt)
    body = _with_equipment(opened.body, options.attached)
    for name in options.frozen:
        joint_index(body.skeleton, name, asked="--freeze")
    problem, ready = avoidance_problem(
        body, opened.motion, frozen=options.frozen, nearest=opened.nearest, workers=options.workers
    )
    started = time.perf_counter()
    avoided = avoid_collisions(problem, options.method, continuous=options.continuous, progress=progress)
    seconds = time.perf_counter() - started
    metrics = measure(problem, avoided)
    before, after = (measure_depths(ready, q, workers=options.workers) for q in (opened.motion.q, avoided.motion.q))
    found = Findings(
        path,
        options.method.value,
        problem,
        ready,
        avoided,
        (before, after),
        metrics,
        reasons(ready, avoided),
        (*opened.doubts, *opened.notes, *said_beyond_limits(body.skeleton, opened.motion), *said_steps(metrics)),
        seconds,
    )
    report = as_report(found)
    out.mkdir(parents=True, exist_ok=True)
    opened.write(out / f"motion{opened.suffix}", avoided.motion)
    write_postures(out / POSTURES, postures_of(found))
    with replacing(out / REPORT) as beside:
        beside.write_text(json.dumps(report, indent=1), encoding="utf-8")
    if options.report:
        write_posture_report(out / PAGE, posture_story(found))
    return AvoidOutcome(found, report)


def avoid_collisions(
    problem: Problem, method: Method, *, continuous: bool = True, progress: Progress | None = None
) -> Avoided:
    """Free a motion by one of the methods, make what it changed one calm movement, and look between the frames.

    The baseline stays as it is published.

    Args:
        problem: what to solve.
        method: how.
        continuous: whether to look between the frames too.
        progress: told stage and share done.
    """
    tell = progress or silent
    tell("frame by frame", 0.0)
    avoided = METHODS[method](problem)
    tell("frame by frame", 1.0)
    if method is Method.NEBEL:
        return avoided
    tell("all frames together", 0.0)
    calm = smoothed(problem, avoided)
    tell("all frames together", 1.0)
    if not (continuous and calm.converged):
        return calm
    tell("between the frames", 0.0)
    rounded, left = go_round(problem, calm)
    tell("between the frames", 1.0)
    if (rounded.motion.q == calm.motion.q).all():
        return calm
    again = smoothed(problem, rounded)
    skipped = skipped_collisions(problem.body.skeleton, problem.body.guard, again.motion.q)
    return again if again.converged and len(skipped.frames) <= len(left.frames) else rounded


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
    tasks = ground_tasks(body, motion)
    moved = Body(skeleton, effort_weights(skeleton), frozen_dofs(skeleton, frozen), guard)
    return Problem(moved, motion, tasks), guard.body


def ground_tasks(body: SkinnedBody, motion: Motion) -> tuple[Task, ...]:
    """Feet that stand stay; if it can be had, feet stay on their paths, hands that bear weight stay, and soles do."""
    skeleton = body.skeleton
    feet, hands = ground_joints(skeleton), ground_joints(skeleton, HANDS)
    if len(feet) == 0:
        return ()
    stand = keep_standing(skeleton, motion, at_joints(feet))
    tasks: tuple[Task, ...] = (stand, keep_everywhere(skeleton, motion, at_joints(feet)))
    if len(hands):
        floor = float(stand.targets[..., 2].min())
        tasks += (keep_standing(skeleton, motion, at_joints(hands), floor=floor, required=False),)
    tasks += (keep_standing(skeleton, motion, soles(body, feet), required=False),)
    return tasks


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
