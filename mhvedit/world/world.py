"""A world: rigid bodies, a figure, and the state that passes from frame to frame."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.world.advance import NOTHING, Carried
from mhvedit.world.bodies import Body, BodyClass, Pose
from mhvedit.world.broad import Colliders, colliders_of
from mhvedit.world.coupling import Coupling
from mhvedit.world.figure import Figure
from mhvedit.world.materials import Materials, Surfaces
from mhvedit.world.motion import Moving
from mhvedit.world.problems import WorldError
from mhvedit.world.resolve import Before

GRAVITY: Final = (0.0, 0.0, -9.81)  # m/s2


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """What there is; bodies are kept in the order of their names, so that it does not matter how they are given."""

    bodies: tuple[Body, ...]
    materials: Materials
    figure: Figure | None = None
    coupling: Coupling = field(default_factory=Coupling)
    gravity: tuple[float, float, float] = GRAVITY  # m/s2

    def __post_init__(self) -> None:
        names = [body.name for body in self.bodies]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise WorldError("bodies", "names that are there once", f"{twice[0]} twice")
        object.__setattr__(self, "bodies", tuple(sorted(self.bodies, key=lambda body: body.name)))

    @property
    def n_frames(self) -> int:
        """F: bodies, then joints of the figure."""
        return len(self.bodies) + (self.figure.skeleton.n_joints if self.figure else 0)

    def of_kind(self, kind: BodyClass) -> BoolArray:
        """(F,) frames of one class; joints of the figure are driven."""
        kinds = [body.kind for body in self.bodies]
        kinds += [BodyClass.DRIVEN] * (self.n_frames - len(kinds))
        return np.array([each is kind for each in kinds], np.bool_)

    def meeting(self, a: int, b: int) -> Surfaces:
        """Restitution and friction between two frames."""
        return self.materials.between(self._material(a), self._material(b))

    def _material(self, frame: int) -> str:
        """Of a body, or of the figure."""
        if frame < len(self.bodies):
            return self.bodies[frame].material
        assert self.figure is not None
        return self.figure.material


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """What the tracker says in one frame."""

    poses: Mapping[str, Pose] = field(default_factory=dict)  # of driven bodies, by name; others stay where they were
    posture: FloatArray | None = None  # (D,) of the figure, rad or m


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Where everything is after a frame, and what the next one begins with."""

    moving: Moving  # bodies, then joints
    tracked: tuple[Pose, ...]  # of each body: where its tracker was; for others where it started
    free: BoolArray  # (B,) driven bodies that overlap nothing
    before: Before | None  # of the figure
    carried: Carried  # by contacts


def start(world: World, poses: Mapping[str, Pose], *, velocities: Mapping[str, FloatArray] | None = None) -> State:
    """The first state.

    Args:
        world: what there is.
        poses: of all bodies, by name, of the frames in which they were given (not of their centres of mass).
        velocities: m/s (3,) of simulated bodies, by name; others start at rest.

    Raises:
        WorldError: a body without a pose, or one that is not there.
    """
    names = [body.name for body in world.bodies]
    for name in {*poses, *(velocities or {})} - set(names):
        raise WorldError("pose", f"one of the bodies {', '.join(names)}", name)
    for name in set(names) - set(poses):
        raise WorldError(f"pose of {name}", "a pose of every body", "none")
    at = tuple(centred(body, poses[body.name]) for body in world.bodies)
    n, n_bodies = world.n_frames, len(at)
    rotations, positions, velocity = np.repeat(np.eye(3)[None], n, axis=0), np.zeros((n, 3)), np.zeros((n, 3))
    inverse_mass, inverse_inertia = np.zeros(n), np.zeros((n, 3, 3))
    for i, (body, pose) in enumerate(zip(world.bodies, at, strict=True)):
        rotations[i], positions[i] = pose.rotation, pose.position
        if body.kind is not BodyClass.FIXED:
            inverse_mass[i] = 1.0 / body.mass
        if body.kind is BodyClass.SIMULATED:
            inverse_inertia[i] = np.linalg.inv(body.inertia)
            velocity[i] = (velocities or {}).get(body.name, np.zeros(3))
    moving = Moving(rotations, positions, velocity, np.zeros((n, 3)), np.zeros((n, 3)), inverse_mass, inverse_inertia)
    return State(moving, at, np.zeros(n_bodies, np.bool_), None, NOTHING)


def centred(body: Body, pose: Pose) -> Pose:
    """The pose of a body's own frame, from that of the frame in which it was given."""
    return Pose(pose.rotation, pose.position + pose.rotation @ body.centre)


def pose_of(world: World, state: State, name: str) -> Pose:
    """Where a body is, as the pose of the frame in which it was given."""
    i = [body.name for body in world.bodies].index(name)
    return uncentred(world.bodies[i], state.moving, i)


def uncentred(body: Body, moving: Moving, frame: int) -> Pose:
    """The pose of the frame in which a body was given, from that of its own."""
    rotation = moving.rotations[frame]
    return Pose(rotation, moving.positions[frame] - rotation @ body.centre)


def all_colliders(world: World, may_meet: BoolArray) -> Colliders:
    """All pieces of a world.

    Args:
        world: of which.
        may_meet: (F, F) which frames.
    """
    pieces = [piece for body in world.bodies for piece in body.pieces]
    carrier = np.repeat(np.arange(len(world.bodies)), [len(body.pieces) for body in world.bodies])
    if world.figure is not None:
        pieces += world.figure.pieces
        carrier = np.concatenate([carrier, len(world.bodies) + world.figure.joint])
    meet = may_meet[carrier[:, None], carrier[None]] & (carrier[:, None] != carrier[None])
    return colliders_of(tuple(pieces), carrier, meet)
