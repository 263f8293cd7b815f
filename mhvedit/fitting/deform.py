"""Carries a change of the skeleton over to the captured surface itself (F3)."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.spatial import KDTree

from mhvedit.fitting.fit import WRONG_WAY
from mhvedit.fitting.joints import NAMES, PARENTS
from mhvedit.fitting.kernels import pose_into
from mhvedit.fitting.template import Template, carriers, outward_normals
from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.meshes import Mesh

NEIGHBOURS: Final = 6  # points of the template that a captured point takes its weights from
SOFT: Final = 0.015  # m, over which their say falls off


@dataclass(frozen=True, slots=True, eq=False)
class BoneFrames:
    """Where the bones are in one frame."""

    turns: FloatArray  # (J, 3, 3) bind frame to posed frame
    places: FloatArray  # (J, 3) m


def deformed(mesh: Mesh, template: Template, before: BoneFrames, after: BoneFrames, *, girth: FloatArray) -> Mesh:
    """A captured frame with its bones elsewhere; the same mesh where nothing changes.

    Args:
        mesh: the frame.
        template: bound.
        before: where its bones are in the capture.
        after: where they are to be.
        girth: (J,) factors by which the flesh grows away from each bone.
    """
    still = (before.turns == after.turns).all() and (before.places == after.places).all()
    if still and (girth == 1.0).all():
        return mesh
    weights = transferred_weights(mesh, template, before)
    return carried(mesh, weights, before, after, growth=growth(template, girth))


def carried(
    mesh: Mesh, weights: FloatArray, before: BoneFrames, after: BoneFrames, *, growth: FloatArray | None = None
) -> Mesh:
    """A captured frame whose points go with their bones.

    Args:
        mesh: the frame.
        weights: (V, J) of its points, as of `transferred_weights`.
        before: where its bones are in the capture.
        after: where they are to be.
        growth: (J, 3, 3) of the flesh in the bind frame; none by default.
    """
    grown = np.tile(np.eye(3), (len(NAMES), 1, 1)) if growth is None else growth
    moves = np.einsum("jab,jbc,jdc->jad", after.turns, grown, before.turns)
    shifts = after.places - np.einsum("jab,jb->ja", moves, before.places)
    blend = np.einsum("vj,jab->vab", weights, moves)
    return replace(mesh, vertices=np.einsum("vab,vb->va", blend, mesh.vertices) + weights @ shifts)


def transferred_weights(mesh: Mesh, template: Template, frames: BoneFrames) -> FloatArray:
    """(V, J) weights of captured points: those of the template near them that faces the same way."""
    points, normals = np.empty_like(template.vertices), np.empty_like(template.normals)
    bones, shares = carriers(template.weights)
    pose_into(
        *(template.vertices, template.normals, bones, shares),
        *(template.rest, frames.turns, frames.places, points, normals),
    )
    own, _ = outward_normals(mesh)
    far, near = KDTree(points).query(mesh.vertices, k=NEIGHBOURS)
    facing = np.einsum("vkc,vc->vk", normals[near], own)
    square = far**2 + (WRONG_WAY * (1.0 - facing)) ** 2
    say = np.exp((square.min(1, keepdims=True) - square) / SOFT**2)
    weights = np.zeros((len(mesh.vertices), len(NAMES)))
    for k in range(NEIGHBOURS):
        weights += say[:, k : k + 1] * template.weights[near[:, k]]
    return np.asarray(weights / weights.sum(1, keepdims=True))


def growth(template: Template, girth: FloatArray) -> FloatArray:
    """Growth by a factor square to the bone that leads on from each joint.

    Args:
        template: bound.
        girth: (J,) factors.

    Returns:
        (J, 3, 3) in the bind frame.
    """
    out = np.tile(np.eye(3), (len(NAMES), 1, 1))
    for j in range(len(NAMES)):
        children = np.flatnonzero(PARENTS == j)
        ends = template.rest[children] - template.rest[j]
        tip = template.rest[[j]] - template.rest[PARENTS[j]]
        bone = max(ends if len(children) else tip, key=lambda end: float(np.linalg.norm(end)))
        bone = bone / max(float(np.linalg.norm(bone)), 1e-9)
        out[j] = girth[j] * np.eye(3) + (1.0 - girth[j]) * np.outer(bone, bone)
    return out
