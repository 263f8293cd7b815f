"""A scene of an avatar as MuJoCo has it: the same capsules and boxes, joints held to the motion by actuators."""

import time
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.avatar_scenes import WorldScene
from mhvedit.world.figure import Figure
from mhvedit.world.world import World

STEP: Final = 0.002  # s, MuJoCo's default
STIFF: Final = 100.0  # N m/rad
ROOT_STIFF: Final = 3_000.0  # N/m and N m/rad


@dataclass(frozen=True, slots=True, eq=False)
class MujocoRun:
    """All frames of a scene."""

    times: FloatArray  # (T,) ms a frame, of as many steps as it takes
    deepest_mm: float


def mujoco_frames(scene: WorldScene) -> MujocoRun:
    """Step MuJoCo through the tracked motion."""
    assert scene.world.figure is not None
    model = mujoco.MjModel.from_xml_string(model_xml(scene.world))
    data = mujoco.MjData(model)
    tracked = np.array([frame.posture for frame in scene.tracked])
    for name, value in zip(scene.world.figure.skeleton.dof_names, tracked[0], strict=True):
        data.joint(name).qpos[:] = value
    steps, times, deepest = round(1 / scene.fps / STEP), [], 0.0
    for q in tracked:
        data.ctrl[:] = q
        began = time.perf_counter()
        mujoco.mj_step(model, data, steps)
        times.append(1000 * (time.perf_counter() - began))
        deepest = max(deepest, -float(data.contact.dist.min(initial=0.0)))
    return MujocoRun(np.array(times), 1000 * deepest)


def model_xml(world: World) -> str:
    """The world as MJCF; gravity is off, as the tracker holds the figure."""
    assert world.figure is not None
    figure = world.figure
    fixed = "".join(_boxes(world))
    names = figure.skeleton.dof_names
    root = {names[d] for d in np.flatnonzero(figure.skeleton.dof_joint == 0)}
    actuators = "".join(
        f'<position joint="{name}" kp="{ROOT_STIFF if name in root else STIFF}" dampratio="1"/>' for name in names
    )
    return (
        f'<mujoco><option timestep="{STEP}" gravity="0 0 0" integrator="implicitfast"/><compiler angle="radian"/>'
        f"<worldbody>{fixed}{_joint_xml(figure)}</worldbody><contact>{_excluded(figure)}</contact>"
        f"<actuator>{actuators}</actuator></mujoco>"
    )


def _boxes(world: World) -> list[str]:
    """Fixed bodies, all of which are boxes here."""
    found = []
    for body in world.bodies:
        for piece in body.pieces:
            low, high = piece.points.min(0) + body.centre, piece.points.max(0) + body.centre
            found.append(f'<geom type="box" pos="{_text((low + high) / 2)}" size="{_text((high - low) / 2)}"/>')
    return found


def _joint_xml(figure: Figure) -> str:
    """Nested bodies; built from the leaves, as parents come before children."""
    skeleton = figure.skeleton
    inside = [""] * skeleton.n_joints
    for joint in range(skeleton.n_joints - 1, -1, -1):
        dofs = "".join(
            f'<joint name="{skeleton.dof_names[d]}" type="{"slide" if skeleton.dof_slides[d] else "hinge"}" '
            f'axis="{_text(skeleton.dof_axis[d])}" armature="0.01"/>'
            for d in np.flatnonzero(skeleton.dof_joint == joint)
        )
        geoms = "".join(
            f'<geom type="capsule" fromto="{_text(piece.points.ravel())}" size="{piece.radius}"/>'
            for piece, owner in zip(figure.pieces, figure.joint, strict=True)
            if owner == joint and len(piece.points) == 2
        )
        mass = '<inertial pos="0 0 0" mass="0.01" diaginertia="1e-5 1e-5 1e-5"/>' if not geoms else ""
        place = _text(skeleton.offsets[joint])
        text = f'<body name="{skeleton.names[joint]}" pos="{place}">{dofs}{mass}{geoms}{inside[joint]}</body>'
        if joint == 0:
            return text
        inside[skeleton.parents[joint]] += text
    return ""


def _excluded(figure: Figure) -> str:
    """Pairs of limbs some pieces of which are not tested against each other; MuJoCo leaves out whole bodies only."""
    names, n = figure.skeleton.names, figure.skeleton.n_joints
    barred = np.zeros((n, n), np.bool_)
    np.logical_or.at(barred, (figure.joint[:, None], figure.joint[None]), ~figure.self_pairs)
    return "".join(
        f'<exclude body1="{names[a]}" body2="{names[b]}"/>' for a in range(n) for b in range(a + 1, n) if barred[a, b]
    )


def _text(values: FloatArray) -> str:
    """Numbers as MJCF writes them."""
    return " ".join(f"{value:.9g}" for value in values)
