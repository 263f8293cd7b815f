"""Overlap of a world by python-fcl, which shares no code with coal's build of GJK and EPA that the package asks."""

from dataclasses import dataclass
from typing import Any

import fcl
import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.world.pieces import Piece
from mhvedit.world.world import State, World


@dataclass(frozen=True, slots=True, eq=False)
class Judge:
    """Pieces of a world as fcl has them, and which pairs count."""

    objects: list[Any]
    local: list[tuple[FloatArray, FloatArray]]
    carrier: IntArray
    pairs: IntArray  # (K, 2)
    radii: FloatArray  # (P,) m, of a ball round each piece


def judge_of(world: World) -> Judge:
    """Everything against everything but fixed bodies, parts of one body, and limbs that may overlap."""
    pieces: list[Piece] = [piece for body in world.bodies for piece in body.pieces]
    carrier = [i for i, body in enumerate(world.bodies) for _ in body.pieces]
    fixed = [body.kind == "fixed" for body in world.bodies for _ in body.pieces]
    n = len(pieces)
    own = np.zeros((0, 0), np.bool_)
    if world.figure is not None:
        pieces += world.figure.pieces
        carrier += [len(world.bodies) + int(joint) for joint in world.figure.joint]
        fixed += [False] * len(world.figure.pieces)
        own = world.figure.self_pairs
    pairs = []
    for a in range(len(pieces)):
        for b in range(a + 1, len(pieces)):
            both_own = a >= n and b >= n
            counts = bool(own[a - n, b - n]) if both_own else carrier[a] != carrier[b] and not (fixed[a] and fixed[b])
            if counts:
                pairs.append((a, b))
    shapes = [_shape(piece) for piece in pieces]
    radii = [np.linalg.norm(piece.points - piece.points.mean(0), axis=1).max() + piece.radius for piece in pieces]
    return Judge(
        [fcl.CollisionObject(shape, fcl.Transform()) for shape, _ in shapes],
        [frame for _, frame in shapes],
        np.array(carrier),
        np.array(pairs),
        np.array(radii),
    )


def deepest(judge: Judge, state: State) -> float:
    """m, depth of the deepest overlap of a state."""
    middles = np.empty((len(judge.objects), 3))
    for i, thing in enumerate(judge.objects):
        rotation, position = state.moving.rotations[judge.carrier[i]], state.moving.positions[judge.carrier[i]]
        turn, middle = judge.local[i]
        middles[i] = rotation @ middle + position
        thing.setTransform(fcl.Transform(rotation @ turn, middles[i]))
    a, b = judge.pairs.T
    close = np.linalg.norm(middles[a] - middles[b], axis=1) < judge.radii[a] + judge.radii[b]
    return max((depth(judge.objects[i], judge.objects[j]) for i, j in judge.pairs[close]), default=0.0)


def depth(a: fcl.CollisionObject, b: fcl.CollisionObject) -> float:
    """m, how deep two of fcl's objects overlap."""
    request, result = fcl.CollisionRequest(num_max_contacts=1, enable_contact=True), fcl.CollisionResult()
    if not fcl.collide(a, b, request, result):
        return 0.0
    return max(float(contact.penetration_depth) for contact in result.contacts)


def _shape(piece: Piece) -> tuple[Any, tuple[FloatArray, FloatArray]]:
    """A piece as fcl has it, and its frame."""
    middle = piece.points.mean(0)
    if len(piece.points) == 1:
        return fcl.Sphere(piece.radius), (np.eye(3), middle)
    if len(piece.points) == 2:
        along = piece.points[1] - piece.points[0]
        length = float(np.linalg.norm(along))
        return fcl.Capsule(piece.radius, length), (_z_to(along / length), middle)
    faces = np.concatenate([np.full((len(piece.faces), 1), 3), piece.faces], axis=1).ravel()
    return fcl.Convex(piece.points - middle, len(piece.faces), faces), (np.eye(3), middle)


def _z_to(axis: FloatArray) -> FloatArray:
    """(3, 3) a rotation whose last column is a unit vector."""
    q, _ = np.linalg.qr(np.stack([axis, *np.eye(3)], 1))
    q = q[:, [1, 2, 0]] * np.sign(q[:, 0] @ axis)
    return np.asarray(q if np.linalg.det(q) > 0 else q * [-1.0, 1.0, 1.0])


def touching_pairs(boxes: FloatArray, may_meet: BoolArray, reach: float) -> set[tuple[int, int]]:
    """Pairs of boxes within reach of each other, every pair asked."""
    return {
        (a, b)
        for a in range(len(boxes))
        for b in range(a + 1, len(boxes))
        if may_meet[a, b] and (boxes[a, 0] <= boxes[b, 1] + reach).all() and (boxes[b, 0] <= boxes[a, 1] + reach).all()
    }
