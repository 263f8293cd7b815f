"""A person who reaches into props, frame by frame: flesh, how deep it is in what, and which limbs may give way."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.fitting.body import BodyInMotion
from mhvedit.fitting.capture import CaptureFit
from mhvedit.fitting.deform import BoneFrames, transferred_weights
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.planar import apply_pose, compose, invert
from mhvedit.geometry.quaternions import rotation_matrices
from mhvedit.pipeline.stops_flesh import LIMBS, Flesh, Limb, limbs_at
from mhvedit.pipeline.stops_pass import DEEP
from mhvedit.project.props import Prop
from mhvedit.scene.edit import SubjectEdit
from mhvedit.scene.surfaces import Surface, clearance, open_surface, signed_distances
from mhvedit.sequences.meshes import Mesh, MeshSequence, joined
from mhvedit.world.bodies import Body
from mhvedit.world.surroundings import Frames

CLEAR: Final = 0.0015  # m that may be left
CONTACT: Final = 0.01  # m: what is as near to somebody else is in contact
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
class Shot:
    """One frame of the stretch, as captured."""

    frame: int  # of the scene
    row: int  # of the fit
    q: FloatArray  # (D,)
    flesh: Flesh
    around: Frames  # where the props' bodies are, in the capture's frame


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """How deep a person is in the props in one frame."""

    depth: Mapping[str, float]  # m, by prop
    body: BoolArray  # (V,) points of the body that are too deep
    things: Mapping[str, BoolArray]  # and of what is held


@dataclass(frozen=True, slots=True)
class Choice:
    """Limbs that give way, and why others do not."""

    limbs: tuple[Limb, ...]
    why: tuple[str, ...] = ()


def shot_of(actor: Actor, frame: int) -> Shot:
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
    return Shot(frame, row, actor.moving.motion.q[row], Flesh(mesh, weights, things, actor.holders), around)


def look_at(actor: Actor, shot: Shot, flesh: Flesh, surfaces: Mapping[str, Surface]) -> Look:
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
    return Look(depth, body, dict(zip(flesh.things, things, strict=True)))


def chosen(actor: Actor, shots: Sequence[Shot], seen: Sequence[tuple[Shot, Look]]) -> Choice:
    """Which limbs give way: arms and lifted legs that are in a prop, and are near nobody else meanwhile."""
    touched = {limb for shot, look in seen for limb in limbs_at(shot.flesh, look.body, look.things)}
    limbs, why = list[Limb](), list[str]()
    for limb in (limb for limb in LIMBS if limb in touched):
        if limb.is_leg and any(_stands(shot, limb) for shot in shots):
            why.append(f"the {limb.name} stands")
        elif any(from_others(actor, shot, shot.flesh, limb) <= CONTACT for shot in shots):
            why.append(f"the {limb.name} is in contact with somebody else")
        else:
            limbs.append(limb)
    return Choice(tuple(limbs), tuple(why))


def _stands(shot: Shot, limb: Limb) -> bool:
    """Whether a foot is on the floor."""
    foot = shot.flesh.weights[:, limb.end] >= 0.5
    return bool(shot.flesh.body.vertices[foot, 2].min(initial=np.inf) < LIFTED)


def from_others(actor: Actor, shot: Shot, flesh: Flesh, limb: Limb) -> float:
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


def left_of(look: Look, flesh: Flesh, limbs: Sequence[Limb]) -> float:
    """How deep limbs are that were to give way, m."""
    still = set(limbs_at(flesh, look.body, look.things)) & set(limbs)
    return max(look.depth.values()) if still else 0.0
