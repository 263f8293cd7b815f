"""Balls: meshes that are meant to be spheres, and the resistance that ends their rolling."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.world.advance import Carried
from mhvedit.world.motion import Moving
from mhvedit.world.pieces import Piece, mesh_mass, sphere

ROUND: Final = 0.02  # of the radius, that vertices may be off the sphere
FULL: Final = 0.85  # of the sphere, that the mesh has to fill
RESISTANCE: Final = 0.03  # of the weight: coefficient of rolling resistance; 0.01 steel on wood, 0.05 a soft ball
Radius = Callable[[int], float]  # of a frame, m; 0 for what is no ball


def as_ball(vertices: FloatArray, faces: Int32Array) -> Piece | None:
    """The sphere that a mesh stands for; None where it is no ball.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3), closed.
    """
    solid = mesh_mass(vertices, faces)
    away = np.linalg.norm(vertices - solid.centre, axis=1)
    radius = float(away.max())
    if away.min() < (1 - ROUND) * radius or solid.volume < FULL * 4 / 3 * np.pi * radius**3:
        return None
    return sphere(radius, solid.centre)


def braked(moving: Moving, carried: Carried, time: float, radius: Radius) -> Moving:
    """Balls after a time of rolling resistance: a torque of RESISTANCE times what presses times the radius.

    It only brakes, and at most until the ball turns no more; friction brings its speed down likewise.

    Args:
        moving: all bodies.
        carried: what their contacts carry.
        time: s.
        radius: of the frames that are balls.
    """
    momentum = moving.momentum.copy()
    for i in np.flatnonzero(moving.inverse_inertia.any((1, 2))).tolist():
        pressed = carried.force[(carried.frames == i).any(1), 0].sum()
        turning = float(np.linalg.norm(momentum[i]))
        if turning > 0:
            momentum[i] *= max(0.0, 1.0 - RESISTANCE * pressed * radius(i) * time / turning)
    return replace(moving, momentum=momentum)
