"""Limbs of a captured person that can give way: their flesh as convex pieces, cut from the captured surface itself.

A fitted skeleton has no fingers, and its bones have no thickness. What has to stay outside a prop is the mesh, so in
every frame the triangles that a bone carries are cut across that bone into slices, and the hull of each slice goes with
the bone. The same is done to what a hand holds.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.fitting.joints import NAMES, joint
from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray
from mhvedit.sequences.meshes import Mesh
from mhvedit.skeleton.model import Skeleton
from mhvedit.skeleton.roles import joint_roles
from mhvedit.skeleton.tables import ROLES
from mhvedit.world.figure import Figure
from mhvedit.world.pieces import Piece, hull
from mhvedit.world.problems import WorldError

SLICE: Final = 0.06  # m, how thick slices are
CARRIED: Final = 0.3  # weight from which a point belongs to a bone, or to a limb
IN_HAND: Final = 0.15  # m from the wrist: what comes nearer is held


@dataclass(frozen=True, slots=True)
class Limb:
    """A chain of bones from the trunk outwards."""

    name: str
    bones: tuple[int, ...]  # joints that may turn, from the trunk outwards; all but a collar bone have flesh
    is_leg: bool

    @property
    def end(self) -> int:
        """The joint of the hand or foot."""
        return self.bones[-1]


def _limb(side: str, *bones: str) -> Limb:
    joints = tuple(joint(f"{side}_{bone}") for bone in bones)
    return Limb(f"{side} {'leg' if bones[-1] == 'foot' else 'arm'}", joints, bones[-1] == "foot")


LIMBS: Final = tuple(
    _limb(side, *bones)
    for bones in (("clavicle", "upper_arm", "forearm", "hand"), ("thigh", "shin", "foot"))
    for side in ("left", "right")
)


@dataclass(frozen=True, slots=True, eq=False)
class Flesh:
    """A person in one frame, in the capture's frame."""

    body: Mesh
    weights: FloatArray  # (V, J) of the body's points
    things: Mapping[str, Mesh]  # what is held, by part
    holders: Mapping[str, int]  # the hand that holds each, a joint

    def of_limb(self, limb: Limb) -> BoolArray:
        """(V,) points of the body that move with a limb."""
        return np.asarray(self.weights[:, limb.bones].sum(1) >= CARRIED)

    def held_by(self, limb: Limb) -> list[str]:
        """Parts that a limb holds."""
        return [part for part, hand in self.holders.items() if hand == limb.end]


def holder_of(thing: Sequence[Mesh], places: FloatArray) -> int | None:
    """The hand that holds a thing through some frames, a joint; None where it is near none.

    Args:
        thing: T frames.
        places: (T, J, 3) m, where the joints are in them.
    """
    far = {
        limb.end: max(
            float(np.linalg.norm(mesh.vertices - at[limb.end], axis=1).min())
            for mesh, at in zip(thing, places, strict=True)
        )
        for limb in LIMBS
        if not limb.is_leg
    }
    nearest = min(far, key=lambda hand: far[hand])
    return nearest if far[nearest] <= IN_HAND else None


def fleshed(skeleton: Skeleton, flesh: Flesh, limbs: Sequence[Limb], placed: tuple[FloatArray, FloatArray]) -> Figure:
    """A figure that is as thick as the captured surface where it may give way, and nowhere else.

    Args:
        skeleton: of `fitting.body`.
        flesh: of the frame.
        limbs: that may give way.
        placed: world_from_joint turns (J, 3, 3) and places (J, 3) m of the joints in this frame.
    """
    pieces, carriers = list[Piece](), list[int]()
    for limb in limbs:
        for bone, points in _slices(flesh, limb, placed[1]):
            try:
                pieces.append(hull((points - placed[1][bone]) @ placed[0][bone]))
                carriers.append(bone)
            except WorldError:  # a sliver without volume: its points are in the slice beside it as well
                continue
    roles = joint_roles(skeleton.names)
    effort = np.array([ROLES[roles[j]].effort if roles[j] in ROLES else 1.0 for j in skeleton.dof_joint])
    nothing = np.zeros((len(pieces), len(pieces)), np.bool_)
    chain = np.full(skeleton.n_joints, -1)
    return Figure(skeleton, tuple(pieces), np.array(carriers, np.int64), chain, nothing, effort, (), "human")


def limbs_at(flesh: Flesh, deep: BoolArray, held: Mapping[str, BoolArray]) -> list[Limb]:
    """The limbs to which points belong that are in a prop.

    Args:
        flesh: of the frame.
        deep: (V,) of the body.
        held: (V,) of each thing that is held.
    """
    return [
        limb
        for limb in LIMBS
        if (deep & flesh.of_limb(limb)).any() or any(held[part].any() for part in flesh.held_by(limb))
    ]


def _slices(flesh: Flesh, limb: Limb, places: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Bones of a limb, and the corners of the triangles in each slice of what they carry."""
    mesh, children = flesh.body, dict(zip(limb.bones, limb.bones[1:], strict=False))
    for bone in limb.bones:
        if NAMES[bone].endswith("clavicle"):
            continue
        own = mesh.faces[(flesh.weights[:, bone] >= CARRIED)[mesh.faces].any(1)]
        if len(own):
            way = places[children[bone]] - places[bone] if bone in children else _longest(mesh.vertices[own])
            yield from ((bone, points) for points in _sliced(mesh.vertices, own, way))
    for part in flesh.held_by(limb):
        thing = flesh.things[part]
        yield from (
            (limb.end, points) for points in _sliced(thing.vertices, thing.faces, _longest(thing.vertices[thing.faces]))
        )


def _longest(corners: FloatArray) -> FloatArray:
    """(3,) the way in which triangles (F, 3, 3) reach furthest."""
    points = corners.reshape(-1, 3)
    away = points - points.mean(0)
    return np.asarray(np.linalg.eigh(away.T @ away)[1][:, -1])


def _sliced(vertices: FloatArray, faces: Int32Array, way: FloatArray) -> Iterator[FloatArray]:
    """Corners of triangles, slice by slice along a way; triangles are not cut."""
    middles = vertices[faces].mean(1) @ (way / max(float(np.linalg.norm(way)), 1e-9))
    slices: IntArray = np.floor((middles - middles.min()) / SLICE).astype(np.int64)
    for each in np.unique(slices):
        yield vertices[np.unique(faces[slices == each])]
