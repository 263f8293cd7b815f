"""Simulated bodies among people: everybody else moves as recorded, and pushes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.advance import NOTHING, Carried, advanced
from mhvedit.world.balls import braked
from mhvedit.world.bodies import Body, BodyClass, Pose
from mhvedit.world.broad import colliders_of
from mhvedit.world.depth import TOLERANCE, overlaps, push_out
from mhvedit.world.flesh import Flesh
from mhvedit.world.materials import Surfaces
from mhvedit.world.motion import Moving
from mhvedit.world.narrow import Narrow
from mhvedit.world.turning import turn_vector
from mhvedit.world.world import World, centred, start, uncentred

ROOM: Final = 0.1  # m, that what is struck in a frame may be thrown in the same frame before it meets somebody else


@dataclass(frozen=True, slots=True, eq=False)
class Crowd:
    """What moves as recorded, over one frame: solids by whom they belong to."""

    names: tuple[str, ...]
    flesh: tuple[Flesh, ...]
    materials: tuple[str, ...]


Gather = Callable[[FloatArray], Crowd]  # what comes into boxes (N, 2, 3) m; called once a frame


@dataclass(frozen=True, slots=True)
class Overlap:
    """A simulated body was inside something at the end of a frame."""

    body: str
    other: str  # the deepest
    depth: float  # m
    moved: float  # m, by which it was pushed out
    left: float  # m, depth after that; TOLERANCE and less count as none


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """A frame."""

    poses: dict[str, Pose]  # of all bodies
    overlaps: tuple[Overlap, ...]


class Among:
    """Steps the simulated bodies of a world through the frames of a scene; driven ones go exactly where they are told.

    Holds coal's shapes, so one for each thread.
    """

    def __init__(self, world: World, poses: Mapping[str, Pose]) -> None:
        self.world = world
        self._free = np.flatnonzero(world.of_kind(BodyClass.SIMULATED)).tolist()
        moving, own = start(world, poses).moving, np.zeros(len(world.bodies))
        own[self._free] = moving.inverse_mass[self._free]
        self._moving = replace(moving, inverse_mass=own)
        self._carried: Carried = NOTHING

    def begin(self, gather: Gather) -> Step:
        """The first frame: simulated bodies are moved out of whatever they overlap.

        Args:
            gather: who stands where.
        """
        return self._settled(_Company(self.world, gather(self._boxes(0.0))))

    def step(self, told: Mapping[str, Pose], gather: Gather, time: float) -> Step:
        """One frame.

        Args:
            told: where driven bodies go.
            gather: what else moves.
            time: s, of the frame.
        """
        company, n = _Company(self.world, gather(self._boxes(time))), len(self.world.bodies)
        moving = company.joined(self._driven(told, time), time)
        gravity = np.array(self.world.gravity)
        done = advanced(company.narrow, moving, company.meeting, gravity, time, carried=self._carried)
        bodies = (done.carried.frames < n).all(1)  # people are cut anew in each frame
        self._carried = Carried(done.carried.frames[bodies], done.carried.force[bodies])
        self._moving = braked(_only(done.moving, n), done.carried, time, self._radius)
        return self._settled(company)

    def _radius(self, i: int) -> float:
        """Of a body that is a ball; 0 for others."""
        pieces = self.world.bodies[i].pieces
        return pieces[0].radius if len(pieces) == 1 and len(pieces[0].points) == 1 else 0.0

    def _driven(self, told: Mapping[str, Pose], time: float) -> Moving:
        """Rates that take driven bodies where they are told to go."""
        velocity, spin = self._moving.velocity.copy(), np.zeros_like(self._moving.spin)
        for i, body in enumerate(self.world.bodies):
            if body.name in told:
                goal = centred(body, told[body.name])
                velocity[i] = (goal.position - self._moving.positions[i]) / time
                spin[i] = turn_vector(np.ascontiguousarray(goal.rotation @ self._moving.rotations[i].T)) / time
        return replace(self._moving, velocity=velocity, spin=spin)

    def _boxes(self, time: float) -> FloatArray:
        """(N, 2, 3) m, in which simulated bodies can be within a time."""
        found, fall = [], float(np.linalg.norm(self.world.gravity)) * time**2 / 2
        for i in self._free:
            at, way = self._moving.positions[i], self._moving.velocity[i] * time
            reach = _extent(self.world.bodies[i]) + fall + (ROOM if time else 0.0)
            found.append([np.minimum(at, at + way) - reach, np.maximum(at, at + way) + reach])
        return np.array(found).reshape(-1, 2, 3)

    def _settled(self, company: "_Company") -> Step:
        """Simulated bodies leave what they overlap (Schmidl and Lin, C1.3)."""
        moving = company.joined(self._moving, 0.0)
        rotations, positions, found = moving.rotations, moving.positions.copy(), list[Overlap]()
        for i in self._free:
            at = Pose(rotations[i], positions[i].copy())
            look = partial(overlaps, company.narrow, i, (rotations, positions))
            if look(at)[0].max(initial=0.0) > TOLERANCE:
                other, depth = company.deepest(i, rotations, positions)
                out = push_out(at, look)
                positions[i] = out.pose.position
                moved = float(np.linalg.norm(positions[i] - at.position))
                found.append(Overlap(self.world.bodies[i].name, other, depth, moved, out.deepest))
        self._moving = replace(self._moving, positions=positions[: len(self.world.bodies)])
        poses = {body.name: uncentred(body, self._moving, i) for i, body in enumerate(self.world.bodies)}
        return Step(poses, tuple(found))


class _Company:
    """All pieces of a world and of a crowd; the crowd's solids are frames behind the world's bodies."""

    def __init__(self, world: World, crowd: Crowd) -> None:
        self._world = world
        counts = [len(own.pieces) for own in crowd.flesh]
        self._owner = np.repeat(np.arange(len(counts)), counts)
        self._crowd, self._n = crowd, len(world.bodies)
        pieces = [piece for body in world.bodies for piece in body.pieces]
        carrier = np.repeat(np.arange(self._n), [len(body.pieces) for body in world.bodies])
        pieces += [piece for own in crowd.flesh for piece in own.pieces]
        carrier = np.concatenate([carrier, self._n + np.arange(len(self._owner))])
        free = np.concatenate([world.of_kind(BodyClass.SIMULATED), np.zeros(len(self._owner), np.bool_)])[carrier]
        meet = (free[:, None] | free[None]) & (carrier[:, None] != carrier[None])
        self.narrow = Narrow(colliders_of(tuple(pieces), carrier, meet))

    def joined(self, moving: Moving, time: float) -> Moving:
        """The world's bodies, and the crowd as it was a time ago and moves until now."""
        k, flesh = len(self._owner), self._crowd.flesh
        middles = np.concatenate([np.zeros((0, 3)), *(own.middles for own in flesh)])
        shifts = np.concatenate([np.zeros((0, 3)), *(own.shifts for own in flesh)])
        velocity = shifts / time if time else np.zeros_like(shifts)
        return Moving(
            rotations=np.concatenate([moving.rotations, np.repeat(np.eye(3)[None], k, axis=0)]),
            positions=np.concatenate([moving.positions, middles - velocity * time]),
            velocity=np.concatenate([moving.velocity, velocity]),
            momentum=np.concatenate([moving.momentum, np.zeros((k, 3))]),
            spin=np.concatenate([moving.spin, np.zeros((k, 3))]),
            inverse_mass=np.concatenate([moving.inverse_mass, np.zeros(k)]),
            inverse_inertia=np.concatenate([moving.inverse_inertia, np.zeros((k, 3, 3))]),
        )

    def meeting(self, a: int, b: int) -> Surfaces:
        """Restitution and friction between two frames."""
        return self._world.materials.between(self._material(a), self._material(b))

    def deepest(self, i: int, rotations: FloatArray, positions: FloatArray) -> tuple[str, float]:
        """What a body is deepest in, and how deep, m."""
        gaps = self.narrow.near(rotations, positions, reach=0.0)
        frames = self.narrow.colliders.carrier[gaps.pairs].reshape(-1, 2)
        own = np.flatnonzero((frames == i).any(1))
        k = own[np.argmin(gaps.distance[own])]
        other = int(frames[k].sum() - i)
        name = self._world.bodies[other].name if other < self._n else self._crowd.names[self._owner[other - self._n]]
        return name, -float(gaps.distance[k])

    def _material(self, frame: int) -> str:
        if frame < self._n:
            return self._world.bodies[frame].material
        return self._crowd.materials[int(self._owner[frame - self._n])]


def _only(moving: Moving, n: int) -> Moving:
    """The first frames."""
    return Moving(
        moving.rotations[:n],
        moving.positions[:n],
        moving.velocity[:n],
        moving.momentum[:n],
        moving.spin[:n],
        moving.inverse_mass[:n],
        moving.inverse_inertia[:n],
    )


def _extent(body: Body) -> float:
    """m, from its centre to its farthest point."""
    return max(float(np.linalg.norm(piece.points, axis=1).max()) + piece.radius for piece in body.pieces)
