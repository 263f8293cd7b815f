"""One person's limbs stop at fixed props: each run of frames in which they would not, from skeleton to meshes.

Obstacles are the props' convex pieces, flesh is the captured surface (`stops_flesh`), postures come from
`world.course`, and captured vertices follow their bones. Then depth is measured on the meshes; where some is left, more
room is asked for.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mhvedit.fitting.deform import BoneFrames, carried
from mhvedit.fitting.joints import NAMES
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.flags import runs_of
from mhvedit.geometry.planar import apply_pose
from mhvedit.pipeline.assemble import Stop
from mhvedit.pipeline.stops_actor import (
    CLEAR,
    Actor,
    Choice,
    Look,
    Shot,
    chosen,
    from_others,
    left_of,
    look_at,
    shot_of,
)
from mhvedit.pipeline.stops_flesh import Flesh, Limb, fleshed
from mhvedit.pipeline.stops_pass import DEEP
from mhvedit.project.props import Prop
from mhvedit.scene.shown import moved
from mhvedit.scene.surfaces import Surface, open_surface
from mhvedit.sequences.meshes import Mesh
from mhvedit.skeleton.forward import joint_frames
from mhvedit.world.course import Moment, Yielding, freed_run
from mhvedit.world.surroundings import Surroundings

MARGIN: Final = 0.001  # m that flesh keeps from a prop ...
MORE: Final = 0.001  # ... and m that are asked for beyond what was left
MOST: Final = 0.03  # m, of all that is asked for
ROUNDS: Final = 5
FADE: Final = 10  # frames before and after, in which limbs may make way
STILL: Final = 1e-5  # rad, that a joint may turn without its mesh being made anew
WORTHWHILE: Final = 0.5  # share of the depth, of which no more may be left: else limbs stay as captured
NO_LIMB: Final = "trunk, head and what nobody holds do not give way"
INTO: Final = 0.005  # m deeper in somebody else: then the limb had better stay where it was


@dataclass(frozen=True, slots=True, eq=False)
class Stopped:
    """What became of one stretch of frames."""

    frames: tuple[int, ...]  # of the scene, K whose meshes changed
    meshes: tuple[Mesh, ...]  # K, in the capture's frame
    things: Mapping[str, FloatArray]  # (K, 3, 4) by part, how it moves
    stops: tuple[Stop, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Outcome:
    """Flesh and depths after limbs gave way."""

    q: FloatArray  # (T, D)
    turned: FloatArray  # (T, J) rad, by how much each joint turns, against the one above it
    flesh: Sequence[Flesh]
    moves: Sequence[Mapping[str, FloatArray]]  # T, (3, 4) by part
    looks: Sequence[Look]


def stopped(actor: Actor, name: str, window: range, depths: Mapping[str, FloatArray]) -> Stopped:
    """Stop somebody's limbs in one stretch of frames.

    Args:
        actor: the person.
        name: of the person.
        window: frames of the scene, with those before and after in which limbs may make way.
        depths: (N,) m by prop, how deep she is as captured.
    """
    shots = [shot_of(actor, frame) for frame in window]
    surfaces = {prop: open_surface(_placed_prop(own)) for prop, own in actor.props.items()}
    deep = np.max([own[window.start : window.stop] for own in depths.values()], axis=0) > DEEP
    touching = [shots[t] for t in np.flatnonzero(deep).tolist()]
    seen = [(shot, look_at(actor, shot, shot.flesh, surfaces)) for shot in touching]
    choice = chosen(actor, shots, seen)
    found = _given_way(actor, shots, surfaces, choice.limbs) if choice.limbs else None
    fault = None if found is None else _fault(actor, shots, seen, found, limbs=choice.limbs)
    if fault is not None:
        choice, found = Choice((), (*choice.why, fault)), None
    stops = [
        _stop(name, prop, run, (shots, choice, found), own)
        for prop, own in depths.items()
        for run in runs_of(own > DEEP)
        if run.start in window
    ]
    if found is None:
        return Stopped((), (), {}, tuple(stops))
    kept = [t for t, shot in enumerate(shots) if np.abs(found.q[t] - shot.q).max() > STILL]
    return Stopped(
        tuple(shots[t].frame for t in kept),
        tuple(found.flesh[t].body for t in kept),
        {part: np.array([found.moves[t][part] for t in kept]).reshape(-1, 3, 4) for part in actor.holders},
        tuple(stops),
    )


def windows_of(depths: Mapping[str, FloatArray], n_frames: int) -> list[range]:
    """Stretches of frames that have to be looked at together: who is deep, and the frames around.

    Args:
        depths: (N,) m by prop.
        n_frames: of the scene.
    """
    near = np.zeros(n_frames, np.bool_)
    for frame in np.flatnonzero(np.max(list(depths.values()), axis=0) > DEEP).tolist():
        near[max(0, frame - FADE) : frame + FADE + 1] = True
    return runs_of(near)


def _placed_prop(prop: Prop) -> Mesh:
    return Mesh(apply_pose(prop.place, prop.mesh.vertices), prop.mesh.faces)


def _fault(
    actor: Actor, shots: Sequence[Shot], seen: Sequence[tuple[Shot, Look]], found: _Outcome, *, limbs: Sequence[Limb]
) -> str | None:
    """Why limbs had better stay as captured; None where they had not."""
    before = max(left_of(look, shot.flesh, limbs) for shot, look in seen)
    after = max(left_of(look, flesh, limbs) for look, flesh in zip(found.looks, found.flesh, strict=True))
    if after > WORTHWHILE * before:
        return f"no posture was found in which {_all(limbs)} would be clear of it"
    if _runs_into_others(actor, shots, found, limbs):
        return f"{_all(limbs)} would run into somebody else"
    return None


def _runs_into_others(actor: Actor, shots: Sequence[Shot], found: _Outcome, limbs: Sequence[Limb]) -> bool:
    """Whether limbs that gave way are now deeper in somebody else."""
    return any(
        from_others(actor, shot, flesh, limb) < min(from_others(actor, shot, shot.flesh, limb), 0.0) - INTO
        for shot, flesh, q in zip(shots, found.flesh, found.q, strict=True)
        if np.abs(q - shot.q).max() > STILL
        for limb in limbs
    )


def _given_way(actor: Actor, shots: Sequence[Shot], surfaces: Mapping[str, Surface], limbs: Sequence[Limb]) -> _Outcome:
    """Limbs free of the props, by as much more room as the meshes turn out to need."""
    skeleton = actor.moving.body.skeleton
    turns, places = joint_frames(skeleton, np.array([shot.q for shot in shots]))
    around = [
        Surroundings(fleshed(skeleton, shot.flesh, limbs, (turns[t], places[t])), tuple(actor.bodies.values()))
        for t, shot in enumerate(shots)
    ]
    free = np.isin(skeleton.dof_joint, [bone for limb in limbs for bone in limb.bones])
    how = Yielding(free, shots[0].frame > 0, shots[-1].frame < len(actor.edit.source) - 1)
    room, best, least = np.full(len(shots), MARGIN), None, np.inf
    for _ in range(ROUNDS):
        run = [Moment(shot.q, own, shot.around, m) for shot, own, m in zip(shots, around, room.tolist(), strict=True)]
        found = _followed(actor, shots, surfaces, freed_run(run, how), (turns, places))
        left = np.array([left_of(look, flesh, limbs) for look, flesh in zip(found.looks, found.flesh, strict=True)])
        if best is None or left.max() < least:
            best, least = found, float(left.max())
        if least <= CLEAR:
            break
        room = np.minimum(room + np.where(left > CLEAR, left + MORE, 0.0), MOST)
    assert best is not None
    return best


def _followed(
    actor: Actor,
    shots: Sequence[Shot],
    surfaces: Mapping[str, Surface],
    q: FloatArray,
    captured: tuple[FloatArray, FloatArray],
) -> _Outcome:
    """Meshes and things in other postures, and how deep they are."""
    turns, places = joint_frames(actor.moving.body.skeleton, q)
    flesh, moves = [], []
    for t, shot in enumerate(shots):
        before = BoneFrames(captured[0][t], captured[1][t])
        after = BoneFrames(turns[t], places[t])
        own = {part: _move(before, after, hand) for part, hand in actor.holders.items()}
        things = {
            part: replace(mesh, vertices=moved(own[part], mesh.vertices)) if part in own else mesh
            for part, mesh in shot.flesh.things.items()
        }
        body = carried(shot.flesh.body, shot.flesh.weights, before, after)
        flesh.append(replace(shot.flesh, body=body, things=things))
        moves.append(own)
    looks = [look_at(actor, shot, own, surfaces) for shot, own in zip(shots, flesh, strict=True)]
    return _Outcome(q, _turned(actor.moving.body.skeleton.parents, captured[0], turns), flesh, moves, looks)


def _turned(parents: IntArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """(T, J) rad, the angle between two turns (T, J, 3, 3) of each joint, told against the joint above it."""
    above = np.maximum(parents, 0)  # the root is told against itself
    own = [np.einsum("tjba,tjbc->tjac", turns[:, above], turns) for turns in (before, after)]
    return np.asarray(np.arccos(np.clip((np.einsum("tjab,tjab->tj", *own) - 1) / 2, -1.0, 1.0)))


def _move(before: BoneFrames, after: BoneFrames, bone: int) -> FloatArray:
    """(3, 4) how what is rigid with a bone moves."""
    turn = after.turns[bone] @ before.turns[bone].T
    return np.column_stack([turn, after.places[bone] - turn @ before.places[bone]])


def _stop(
    name: str, prop: str, run: range, result: tuple[Sequence[Shot], Choice, _Outcome | None], depth: FloatArray
) -> Stop:
    """What became of one run of frames in one prop."""
    shots, choice, found = result
    before, last = float(depth[run.start : run.stop].max()), run.stop - 1
    if found is None:
        why = "; ".join(choice.why) or NO_LIMB
        return Stop(name, prop, run.start, last, _mm(before), _mm(before), (), 0.0, "", why)
    rows = [t for t, shot in enumerate(shots) if shot.frame in run]
    after = max(found.looks[t].depth[prop] for t in rows)
    change = found.turned[rows].max(0)
    why = ""
    if after > DEEP:
        worst = max(rows, key=lambda t: found.looks[t].depth[prop])
        stuck = left_of(found.looks[worst], found.flesh[worst], choice.limbs) > 0
        no_way = "no posture was found that is clear of it" if stuck else NO_LIMB
        why = "; ".join((*choice.why, no_way) if stuck or not choice.why else choice.why)
    joint = NAMES[int(change.argmax())]
    names = tuple(limb.name for limb in choice.limbs)
    return Stop(name, prop, run.start, last, _mm(before), _mm(after), names, _degrees(change.max()), joint, why)


def _mm(depth: float) -> float:
    return round(1000 * depth, 1)


def _degrees(angle: float) -> float:
    return round(float(np.degrees(angle)), 1)


def _all(limbs: Sequence[Limb]) -> str:
    """Limbs in words."""
    return " and ".join(f"the {limb.name}" for limb in limbs)
