"""A fitted capture as a skinned body in motion, as the skeleton packages know it, and back.

At rest the body faces -y with its limbs straight, arms out sideways and legs down, so that the tables' joint limits
hold and nothing touches: what touches later is a collision.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from mhvedit.fitting.capture import CaptureFit
from mhvedit.fitting.deform import growth
from mhvedit.fitting.joints import NAMES, PARENTS, joint
from mhvedit.fitting.template import Template
from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.skeleton.dofs import body_skeleton, dofs_from_frames
from mhvedit.skeleton.model import Motion, Skeleton
from mhvedit.skeleton.skin import SkinnedBody

STRETCHED: Final = 3.0  # times its length where it was bound, ...
LONG: Final = 0.06  # m: such an edge at rest crosses surfaces that were merged there
_TABLES_FROM_BODY: Final = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # front to -y, left to x
_STRAIGHT: Final = {  # which way the bone from a joint to its next one points at rest
    "left_upper_arm": ("left_forearm", (1.0, 0.0, 0.0)),
    "left_forearm": ("left_hand", (1.0, 0.0, 0.0)),
    "right_upper_arm": ("right_forearm", (-1.0, 0.0, 0.0)),
    "right_forearm": ("right_hand", (-1.0, 0.0, 0.0)),
    "left_thigh": ("left_shin", (0.0, 0.0, -1.0)),
    "left_shin": ("left_foot", (0.0, 0.0, -1.0)),
    "right_thigh": ("right_shin", (0.0, 0.0, -1.0)),
    "right_shin": ("right_foot", (0.0, 0.0, -1.0)),
}


@dataclass(frozen=True, slots=True, eq=False)
class BodyInMotion:
    """The template as a skinned body, and how it moves through the capture."""

    body: SkinnedBody
    motion: Motion
    rest_from_bind: FloatArray  # (J, 3, 3) turns


def body_in_motion(fit: CaptureFit, *, fps: float) -> BodyInMotion:
    """The body and the motion of a fitted capture.

    Args:
        fit: of all frames.
        fps: Hz, of the capture.
    """
    template = fit.template
    turns = _rest_from_bind(template)
    offsets = np.empty_like(template.rest)
    offsets[0] = template.rest[0]
    for j in range(1, len(NAMES)):
        offsets[j] = turns[PARENTS[j]] @ (template.rest[j] - template.rest[PARENTS[j]])
    skeleton = body_skeleton(NAMES, PARENTS, offsets, turning=dict.fromkeys(NAMES), sliding=NAMES[:1])
    vertices = _unposed(template, turns, skeleton)
    kept = _without_webs(template, vertices)
    posed = fit.rotations @ np.swapaxes(turns, 1, 2)
    q = dofs_from_frames(skeleton, posed, fit.places)
    return BodyInMotion(SkinnedBody(skeleton, vertices, kept, template.weights), Motion(q, fps), turns)


def _rest_from_bind(template: Template) -> FloatArray:
    """(J, 3, 3) how each bone turns from the bind frame to rest: arms raised, limbs straight."""
    raised = {side: Rotation.from_rotvec([0.0, sign * np.pi / 2, 0.0]) for side, sign in (("left", -1), ("right", 1))}
    turns = _TABLES_FROM_BODY @ np.swapaxes(template.axes, 1, 2)
    for j, name in enumerate(NAMES):
        side, _, bone = name.partition("_")
        if bone in ("upper_arm", "forearm", "hand"):
            turns[j] = raised[side].as_matrix() @ turns[j]
    for name, (after, wanted) in _STRAIGHT.items():
        j = joint(name)
        turns[j] = _onto(turns[j] @ (template.rest[joint(after)] - template.rest[j]), np.array(wanted)) @ turns[j]
    for side in ("left", "right"):
        turns[joint(f"{side}_hand")] = turns[joint(f"{side}_forearm")]
    return np.asarray(turns)


def _onto(a: FloatArray, b: FloatArray) -> FloatArray:
    """The smallest turn that takes the direction of a to the unit vector b."""
    a = a / np.linalg.norm(a)
    axis = np.cross(a, b)
    angle = np.arctan2(np.linalg.norm(axis), a @ b)
    return np.asarray(Rotation.from_rotvec(angle * axis / max(float(np.linalg.norm(axis)), 1e-12)).as_matrix())


def _unposed(template: Template, turns: FloatArray, skeleton: Skeleton) -> FloatArray:
    """(V, 3) m, where the skin is at rest: posed in the bind frame it is there to the last digit."""
    back = np.swapaxes(turns, 1, 2)  # bind_from_rest
    shift = template.rest - np.einsum("jab,jb->ja", back, skeleton.rest_positions)
    blend = np.einsum("vj,jab->vab", template.weights, back)
    return np.asarray(np.linalg.solve(blend, (template.vertices - template.weights @ shift)[..., None])[..., 0])


def _without_webs(template: Template, vertices: FloatArray) -> Int32Array:
    """The faces that do not span limbs which were merged in the bind frame."""
    ends = template.faces[:, [[0, 1], [1, 2], [2, 0]]]
    before, after = (np.linalg.norm(v[ends[..., 0]] - v[ends[..., 1]], axis=-1) for v in (template.vertices, vertices))
    web = ((after > LONG) & (after > STRETCHED * before)).any(1)
    return np.asarray(template.faces[~web], np.int32)


def grown(moving: BodyInMotion, template: Template, girth: FloatArray) -> BodyInMotion:
    """The body with more or less flesh on its bones.

    Args:
        moving: a fitted body.
        template: that it was made of.
        girth: (J,) factors.
    """
    turns, rest = moving.rest_from_bind, moving.body.skeleton.rest_positions
    at_rest = np.einsum("jab,jbc,jdc->jad", turns, growth(template, girth), turns)
    blend = np.einsum("vj,jab->vab", moving.body.weights, at_rest)
    shift = rest - np.einsum("jab,jb->ja", at_rest, rest)
    vertices = np.einsum("vab,vb->va", blend, moving.body.vertices) + moving.body.weights @ shift
    return replace(moving, body=replace(moving.body, vertices=vertices))
