"""The thesis's scenes as synthetic motions of the plain figure, whose limbs are capsules."""

import numpy as np
import trimesh

from mhvedit.avoidance.capsules import capsule_body
from mhvedit.avoidance.correct import Body
from mhvedit.avoidance.equipment import attach
from mhvedit.avoidance.ground import at_joints, ground_joints, keep_standing
from mhvedit.avoidance.guards import mesh_guard
from mhvedit.avoidance.methods import Problem
from mhvedit.avoidance.tasks import Task, TwoHanded, frozen_dofs, two_handed
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.forward import points_on_joints
from mhvedit.skeleton.model import Motion, Skeleton
from mhvedit.skeleton.skin import SkinnedBody
from tests.avoidance.figures import figure

FPS = 30.0
GRIP = np.array([0.0, 0.0, -0.08])  # m, in the hand
APART = 4  # limbs: as for all bodies of capsules


def turned(skeleton: Skeleton, n_frames: int, curves: dict[str, FloatArray | float]) -> Motion:
    """A motion from curves of DOFs by name; all others are 0."""
    q = np.zeros((n_frames, skeleton.n_dofs))
    for name, curve in curves.items():
        q[:, skeleton.dof_names.index(name)] = curve
    return Motion(q, FPS)


def walk(n_frames: int = 24) -> Motion:
    """One stride on the spot; the left arm swings close to the body."""
    phase = np.linspace(0, 2 * np.pi, n_frames)
    return turned(
        figure(),
        n_frames,
        {
            "left_upper_arm.0": 0.5 * np.sin(phase),
            "right_upper_arm.0": -0.5 * np.sin(phase),
            "left_upper_arm.1": -0.05,
            "left_thigh.0": -0.4 * np.sin(phase),
            "right_thigh.0": 0.4 * np.sin(phase),
        },
    )


def jump(n_frames: int = 24) -> Motion:
    """Both arms go back and come forward and up, past the hips; the feet stand."""
    phase = np.linspace(0, 1, n_frames)
    swing = 0.9 * np.cos(np.pi * phase)
    return turned(figure(), n_frames, {"left_upper_arm.0": swing, "right_upper_arm.0": swing})


def rise(n_frames: int = 24) -> Motion:
    """From prone to standing; the left hand goes through the trunk on the way."""
    share = np.linspace(0, 1, n_frames)
    return turned(
        figure(),
        n_frames,
        {
            "hips.3": np.pi / 2 * (1 - share),
            "hips.2": -0.7 * (1 - share),
            "left_upper_arm.1": 0.5 * np.sin(np.pi * share) ** 2,
            "left_upper_arm.0": -0.4 * np.sin(np.pi * share) ** 2,
        },
    )


def with_sphere(body: SkinnedBody, *, at: tuple[float, float, float], radius: float, limb: str) -> SkinnedBody:
    """A ball on a limb."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    return attach(body, ball.vertices + np.array(at), ball.faces.astype(np.int32), limb=limb)


def with_vest(body: SkinnedBody) -> SkinnedBody:
    """Boxes on both sides of the waist."""
    for side in (1.0, -1.0):
        box = trimesh.creation.box([0.08, 0.1, 0.16]).subdivide().subdivide()
        body = attach(body, box.vertices + np.array([side * 0.17, -0.2, 1.1]), box.faces.astype(np.int32), limb="hips")
    return body


def problem_of(
    body: SkinnedBody, motion: Motion, *, frozen: tuple[str, ...] = (), tasks: tuple[Task, ...] = ()
) -> Problem:
    """Feet keep standing, and what else is asked."""
    skeleton = body.skeleton
    feet = keep_standing(skeleton, motion, at_joints(ground_joints(skeleton)))
    weights = np.where(skeleton.dof_slides, 60.0, np.where(skeleton.dof_joint < 5, 5.0, 1.0))
    free = frozen_dofs(skeleton, frozen)
    return Problem(Body(skeleton, weights, free, mesh_guard(body, nearest=APART)), motion, (feet, *tasks))


def armed() -> tuple[Problem, TwoHanded]:
    """Both hands swing with a weapon before a ball on the torso; the task that keeps the left one on it."""
    body = with_sphere(plain_body(), at=(0.2, -0.2, 1.1), radius=0.05, limb="spine0")
    phase = np.linspace(0, np.pi, 20)
    arms = dict.fromkeys(("left_upper_arm.0", "right_upper_arm.0"), -0.45 + 0.35 * np.sin(phase))
    motion = turned(body.skeleton, len(phase), dict(arms))
    weapon = two_handed(body.skeleton, motion, hand="left_hand", holder="right_hand", point=GRIP)
    return problem_of(body, motion), weapon


def grip_gap(skeleton: Skeleton, weapon: TwoHanded, q: FloatArray) -> float:
    """Largest gap between the left hand and its place on the weapon, m."""
    points = np.stack([weapon.point, weapon.target])
    hands = points_on_joints(skeleton, q, np.array([weapon.hand, weapon.holder]), points)
    return float(np.linalg.norm(hands[:, 0] - hands[:, 1], axis=1).max())


def plain_body() -> SkinnedBody:
    """The figure in capsules."""
    return capsule_body(figure())


def with_plate(body: SkinnedBody) -> SkinnedBody:
    """A plate of 30 mm that stands out from the left hip, in the way of a swinging hand."""
    plate = trimesh.creation.box([0.12, 0.03, 0.3]).subdivide().subdivide().subdivide()
    return attach(body, plate.vertices + np.array([0.2, -0.21, 0.97]), plate.faces.astype(np.int32), limb="hips")
