"""Small worlds for tests."""

from collections.abc import Mapping, Sequence

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.bodies import Body, BodyClass, Pose, body_of_pieces
from mhvedit.world.materials import Materials, Surfaces, load_materials
from mhvedit.world.pieces import Piece, box, sphere
from mhvedit.world.simulate import FrameReport, Simulation
from mhvedit.world.world import State, Tracked, World, start

MATERIALS = load_materials()
FPS = 60.0
GAP = 1e-4  # m, at which bodies rest


def surfaces(restitution: float, friction: float) -> Materials:
    """One material, wood."""
    return Materials({"wood": 700.0}, {frozenset({"wood"}): Surfaces(restitution, friction)})


def fixed(name: str, pieces: Sequence[Piece]) -> Body:
    return body_of_pieces(name, pieces, MATERIALS, kind=BodyClass.FIXED, material="wood")


def simulated(name: str, pieces: Sequence[Piece], mass: float = 1.0) -> Body:
    return body_of_pieces(name, pieces, MATERIALS, kind=BodyClass.SIMULATED, material="wood", mass=mass)


def driven(name: str, pieces: Sequence[Piece], mass: float = 0.4) -> Body:
    return body_of_pieces(name, pieces, MATERIALS, kind=BodyClass.DRIVEN, material="wood", mass=mass)


def cube(half: float) -> Piece:
    return box(np.full(3, -half), np.full(3, half))


def floor() -> Body:
    """Its upper side is z = 0."""
    return fixed("floor", [box(np.array([-50.0, -50.0, -1.0]), np.array([50.0, 50.0, 0.0]))])


def ball(name: str = "ball", radius: float = 0.1, mass: float = 1.0) -> Body:
    return simulated(name, [sphere(radius)], mass)


def at(x: float, y: float, z: float) -> Pose:
    return Pose(np.eye(3), np.array([x, y, z], np.float64))


def played(
    world: World,
    poses: Mapping[str, Pose],
    seconds: float,
    *,
    velocities: Mapping[str, FloatArray] | None = None,
    tracked: Sequence[Tracked] | None = None,
    fps: float = FPS,
) -> tuple[list[State], list[FrameReport]]:
    """A world left alone, or with a tracker, for a time."""
    simulation, state = Simulation(world), start(world, poses, velocities=velocities)
    states, reports = [state], []
    for k in range(round(seconds * fps)):
        state, report = simulation.step(state, tracked[k] if tracked else Tracked(), 1 / fps)
        states.append(state)
        reports.append(report)
    return states, reports
