"""One person's limbs stop at fixed props: each run of frames in which they would not, from skeleton to meshes.

Obstacles are the props' convex pieces, flesh is the captured surface (`limbs`), postures come from `world.course`, and
captured vertices follow their bones. Then depth is measured on the meshes; where some is left, more room is asked for.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mhvedit.fitting.body import BodyInMotion
from mhvedit.fitting.capture import CaptureFit
from mhvedit.fitting.deform import BoneFrames, carried, transferred_weights
from mhvedit.fitting.joints import NAMES
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.planar import apply_pose, compose, invert
from mhvedit.geometry.quaternions import rotation_matrices
from mhvedit.pipeline.assemble import Stop
from mhvedit.pipeline.limbs import LIMBS, Flesh, Limb, fleshed, limbs_at
from mhvedit.pipeline.stops_pass import DEEP
from mhvedit.project.props import Prop
from mhvedit.scene.edit import SubjectEdit
from mhvedit.scene.shown import moved
from mhvedit.scene.surfaces import Surface, clearance, open_surface, signed_distances
from mhvedit.sequences.meshes import Mesh, MeshSequence, joined
from mhvedit.skeleton.forward import joint_frames
from mhvedit.world.bodies import Body
from mhvedit.world.course import Moment, Yielding, freed_run
from mhvedit.world.surroundings import Frames, Surroundings

CLEAR: Final = 0.0015  # m that may be left
MARGIN: Final = 0.001  # m that flesh keeps from a prop ...
MORE: Final = 0.001  # ... and m that are asked for beyond what was left
MOST: Final = 0.03  # m, of all that is asked for
ROUNDS: Final = 5
FADE: Final = 10  # frames before and after, in which limbs may make way
STILL: Final = 1e-5  # rad, that a joint may turn without its mesh being made anew
CONTACT: Final = 0.01  # m: what is as near to somebody else is in contact
INTO: Final = 0.005  # m deeper in somebody else: then the limb had better stay where it was
LIFTED: Final = 0.06  # m above the floor, from which a foot does not stand


@dataclass(frozen=True, slots=True, eq=False)
class Actor:
    """All that is known of a person who is in a prop."""

    edit: SubjectEdit
    capture: MeshSequence
    things: Mapping[str, MeshSequence]  # what is held, by part
    holders: Mapping[str, int]  # the hand that holds each, a joint
    fit: CaptureFit
    moving: BodyInMotion
    props: Mapping[str, Prop]  # that stop people
    bodies: Mapping[str, Body]  # of these props
    others: Callable[[int], list[Mesh]]  # everybody else in a frame of the scene, in the world


@dataclass(frozen=True, slots=True, eq=False)
class Stopped:
    """What became of one stretch of frames."""

    frames: tuple[int, ...]  # of the scene, K whose meshes changed
    meshes: tuple[Mesh, ...]  # K, in the capture's frame
    things: Mapping[str, FloatArray]  # (K, 3, 4) by part, how it moves
    stops: tuple[Stop, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Shot:
    """One frame of the stretch, as captured."""

    frame: int  # of the scene
    row: int  # of the fit
    q: FloatArray  # (D,)
    flesh: Flesh
    around: Frames  # where the props' bodies are, in the capture's frame


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """How deep a person is in the props in one frame."""

    depth: Mapping[str, float]  # m, by prop
    body: BoolArray  # (V,) points of the body that are too deep
    things: Mapping[str, BoolArray]  # and of what is held


@dataclass(frozen=True, slots=True, eq=False)
class _Outcome:
    """Flesh and depths after limbs gave way."""

    q: FloatArray  # (T, D)
    joints: IntArray  # (D,) that each DOF turns
    flesh: Sequence[Flesh]
    moves: Sequence[Mapping[str, FloatArray]]  # T, (3, 4) by part
    looks: Sequence[_Look]


@dataclass(frozen=True, slots=True)
class _Choice:
    """Limbs that give way, and why others do not."""

    limbs: tuple[Limb, ...]
    why: tuple[str, ...] = ()


def stopped(actor: Actor, name: str, window: range, depths: Mapping[str, FloatArray]) -> Stopped:
    """Stop somebody's limbs in one stretch of frames.

    Args:
        actor: the person.
        name: of the person.
        window: frames of the scene, with those before and after in which limbs may make way.
        depths: (N,) m by prop, how deep she is as captured.
    """
    shots = [_shot(actor, frame) for frame in window]
    surfaces = {prop: open_surface(_placed_prop(own)) for prop, own in actor.props.items()}
    deep = np.max([own[window.start : window.stop] for own in depths.values()], axis=0) > DEEP
    touching = [shots[t] for t in np.flatnonzero(deep).tolist()]
    choice = _chosen(actor, shots, [(shot, _look(actor, shot, shot.flesh, surfaces)) for shot in touching])
    found = _given_way(actor, shots, surfaces, choice.limbs) if choice.limbs else None
    if found is not None and _runs_into_others(actor, shots, found, choice.limbs):
        said = f"{_all(choice.limbs)} would run into somebody else"
        choice, found = _Choice((), (*choice.why, said)), None
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


def runs_of(which: BoolArray) -> list[range]:
    """Runs of frames.

    >>> runs_of(np.array([False, True, True, False, True]))
    [range(1, 3), range(4, 5)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], which, [False]]).astype(np.int8)))
    return [range(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def _shot(actor: Actor, frame: int) -> _Shot:
    """A frame with its flesh."""
    number = int(actor.edit.source[frame])
    row = int(np.searchsorted(actor.fit.numbers, number))
    mesh = actor.capture.mesh(number)
    weights = transferred_weights(mesh, actor.fit.template, BoneFrames(actor.fit.rotations[row], actor.fit.places[row]))
    things = {part: thing.mesh(number) for part, thing in actor.things.items()}
    capture = invert(actor.edit.placements[frame])
    poses = [(compose(capture, actor.props[name].place), body.centre) for name, body in actor.bodies.items()]
    around = Frames(
        np.array([rotation_matrices(np.array([0, 0, np.sin(p[2] / 2), np.cos(p[2] / 2)])) for p, _ in poses]),
        np.array([apply_pose(p, centre) for p, centre in poses]),
    )
    return _Shot(frame, row, actor.moving.motion.q[row], Flesh(mesh, weights, things, actor.holders), around)


def _placed_prop(prop: Prop) -> Mesh:
    return Mesh(apply_pose(prop.place, prop.mesh.vertices), prop.mesh.faces)


def _look(actor: Actor, shot: _Shot, flesh: Flesh, surfaces: Mapping[str, Surface]) -> _Look:
    """Measure depths on the meshes."""
    meshes = [flesh.body, *flesh.things.values()]
    whole = joined(meshes)
    own = open_surface(Mesh(apply_pose(actor.edit.placements[shot.frame], whole.vertices), whole.faces))
    depth, deep = {}, np.zeros(len(whole.vertices), np.bool_)
    for name, surface in surfaces.items():
        found = clearance(own, surface, reach=DEEP)
        depth[name] = found.depth
        deep[found.near_a[found.signed_a < -CLEAR]] = True
        if found.depth > CLEAR and found.corner_a >= 0:
            deep[found.corner_a] = True
    body, *things = np.split(deep, np.cumsum([len(mesh.vertices) for mesh in meshes])[:-1])
    return _Look(depth, body, dict(zip(flesh.things, things, strict=True)))


def _chosen(actor: Actor, shots: Sequence[_Shot], seen: Sequence[tuple[_Shot, _Look]]) -> _Choice:
    """Which limbs give way: arms and lifted legs that are in a prop, and are near nobody else meanwhile."""
    touched = {limb for shot, look in seen for limb in limbs_at(shot.flesh, look.body, look.things)}
    limbs, why = list[Limb](), list[str]()
    for limb in (limb for limb in LIMBS if limb in touched):
        if limb.is_leg and any(_stands(shot, limb) for shot in shots):
            why.append(f"the {limb.name} stands")
        elif any(_from_others(actor, shot, shot.flesh, limb) <= CONTACT for shot in shots):
            why.append(f"the {limb.name} is in contact with somebody else")
        else:
            limbs.append(limb)
    return _Choice(tuple(limbs), tuple(why))


def _stands(shot: _Shot, limb: Limb) -> bool:
    """Whether a foot is on the floor."""
    foot = shot.flesh.weights[:, limb.end] >= 0.5
    return bool(shot.flesh.body.vertices[foot, 2].min(initial=np.inf) < LIFTED)


def _from_others(actor: Actor, shot: _Shot, flesh: Flesh, limb: Limb) -> float:
    """How far a limb and what it holds are from everybody else, m; negative inside, inf where far."""
    points = [flesh.body.vertices[flesh.of_limb(limb)], *(flesh.things[part].vertices for part in flesh.held_by(limb))]
    placed = apply_pose(actor.edit.placements[shot.frame], np.concatenate(points))
    nearest = np.inf
    for mesh in actor.others(shot.frame):
        low, high = mesh.vertices.min(0) - CONTACT, mesh.vertices.max(0) + CONTACT
        near = placed[((placed >= low) & (placed <= high)).all(1)]
        if len(near):
            nearest = min(nearest, float(signed_distances(open_surface(mesh), near).min()))
    return nearest


def _runs_into_others(actor: Actor, shots: Sequence[_Shot], found: _Outcome, limbs: Sequence[Limb]) -> bool:
    """Whether limbs that gave way are now deeper in somebody else."""
    return any(
        _from_others(actor, shot, flesh, limb) < min(_from_others(actor, shot, shot.flesh, limb), 0.0) - INTO
        for shot, flesh, q in zip(shots, found.flesh, found.q, strict=True)
        if np.abs(q - shot.q).max() > STILL
        for limb in limbs
    )


def _given_way(
    actor: Actor, shots: Sequence[_Shot], surfaces: Mapping[str, Surface], limbs: Sequence[Limb]
) -> _Outcome:
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
        left = np.array([_left(look, flesh, limbs) for look, flesh in zip(found.looks, found.flesh, strict=True)])
        if best is None or left.max() < least:
            best, least = found, float(left.max())
        if least <= CLEAR:
            break
        room = np.minimum(room + np.where(left > CLEAR, left + MORE, 0.0), MOST)
    assert best is not None
    return best


def _left(look: _Look, flesh: Flesh, limbs: Sequence[Limb]) -> float:
    """How deep limbs are that were to give way, m."""
    still = set(limbs_at(flesh, look.body, look.things)) & set(limbs)
    return max(look.depth.values()) if still else 0.0


def _followed(
    actor: Actor,
    shots: Sequence[_Shot],
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
    looks = [_look(actor, shot, own, surfaces) for shot, own in zip(shots, flesh, strict=True)]
    return _Outcome(q, actor.moving.body.skeleton.dof_joint, flesh, moves, looks)


def _move(before: BoneFrames, after: BoneFrames, bone: int) -> FloatArray:
    """(3, 4) how what is rigid with a bone moves."""
    turn = after.turns[bone] @ before.turns[bone].T
    return np.column_stack([turn, after.places[bone] - turn @ before.places[bone]])


def _stop(
    name: str, prop: str, run: range, result: tuple[Sequence[_Shot], _Choice, _Outcome | None], depth: FloatArray
) -> Stop:
    """What became of one run of frames in one prop."""
    shots, choice, found = result
    before, last = float(depth[run.start : run.stop].max()), run.stop - 1
    if found is None:
        why = "; ".join(choice.why) or "trunk and head do not give way"
        return Stop(name, prop, run.start, last, _mm(before), _mm(before), (), 0.0, "", why)
    rows = [t for t, shot in enumerate(shots) if shot.frame in run]
    after = max(found.looks[t].depth[prop] for t in rows)
    change = np.abs(np.array([found.q[t] - shots[t].q for t in rows])).max(0)
    turned = int(change.argmax())
    why = ""
    if after > DEEP:
        worst = max(rows, key=lambda t: found.looks[t].depth[prop])
        stuck = _left(found.looks[worst], found.flesh[worst], choice.limbs) > 0
        no_way = "no posture was found that is clear of it" if stuck else "trunk and head do not give way"
        why = "; ".join((*choice.why, no_way) if stuck or not choice.why else choice.why)
    joint = NAMES[int(found.joints[turned])]
    names = tuple(limb.name for limb in choice.limbs)
    return Stop(name, prop, run.start, last, _mm(before), _mm(after), names, _degrees(change.max()), joint, why)


def _mm(depth: float) -> float:
    return round(1000 * depth, 1)


def _degrees(angle: float) -> float:
    return round(float(np.degrees(angle)), 1)


def _all(limbs: Sequence[Limb]) -> str:
    """Limbs in words."""
    return " and ".join(f"the {limb.name}" for limb in limbs)
