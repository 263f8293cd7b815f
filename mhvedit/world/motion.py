"""Rigid bodies in flight: parabolas, and rotation that keeps angular momentum."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.turning import straightened, turn


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """Where rigid bodies are and how they move; what drives itself has inverse mass and inertia 0."""

    rotations: FloatArray  # (F, 3, 3) world_from_body
    positions: FloatArray  # (F, 3) m, centres of mass
    velocity: FloatArray  # (F, 3) m/s
    momentum: FloatArray  # (F, 3) kg m2/s, angular, about the centre of mass
    spin: FloatArray  # (F, 3) rad/s, of frames whose inverse inertia is 0
    inverse_mass: FloatArray  # (F,) 1/kg
    inverse_inertia: FloatArray  # (F, 3, 3) 1/(kg m2), in the body's frame

    def __post_init__(self) -> None:
        n = len(self.inverse_mass)
        for name, array, shape in (
            ("rotations", self.rotations, (n, 3, 3)),
            ("positions", self.positions, (n, 3)),
            ("velocity", self.velocity, (n, 3)),
            ("momentum", self.momentum, (n, 3)),
            ("spin", self.spin, (n, 3)),
            ("inverse_inertia", self.inverse_inertia, (n, 3, 3)),
        ):
            if array.shape != shape:
                raise ShapeError(name, array.shape, shape)


def spins(moving: Moving) -> FloatArray:
    """(F, 3) rad/s, how fast everything turns."""
    return np.asarray(moving.spin + np.einsum("fij,fj->fi", world_inverse_inertia(moving), moving.momentum))


def world_inverse_inertia(moving: Moving) -> FloatArray:
    """(F, 3, 3) inverse inertia along the world's axes."""
    return np.asarray(moving.rotations @ moving.inverse_inertia @ np.swapaxes(moving.rotations, 1, 2))


def kinetic_energy(moving: Moving) -> float:
    """J, of all bodies that have a mass."""
    free = moving.inverse_mass > 0
    linear = ((moving.velocity[free] ** 2).sum(1) / moving.inverse_mass[free]).sum()
    turning = np.einsum("fi,fij,fj->", moving.momentum, world_inverse_inertia(moving), moving.momentum)
    return float(linear + turning) / 2


def potential_energy(moving: Moving, gravity: FloatArray) -> float:
    """J, of all bodies that have a mass."""
    free = moving.inverse_mass > 0
    return float(-((moving.positions[free] @ gravity) / moving.inverse_mass[free]).sum())


def rates(moving: Moving, momentum: FloatArray, time: float) -> FloatArray:
    """(F, 3) rad/s, the constant spins that turn every body over a time as its own tumbling does.

    Args:
        moving: where the bodies are.
        momentum: (F, 3) kg m2/s, kept over the time.
        time: s.
    """
    return np.asarray(_rates(moving.rotations, moving.inverse_inertia, momentum, moving.spin, time))


def flown(moving: Moving, velocity: FloatArray, spin: FloatArray, time: float) -> tuple[FloatArray, FloatArray]:
    """Rotations and positions after a time of constant rates: the path along which impacts are looked for."""
    return np.asarray(_turned(moving.rotations, spin, time)), moving.positions + time * velocity


@njit(cache=True, nogil=True)
def _turned(rotations: FloatArray, spin: FloatArray, time: float) -> FloatArray:
    """Every rotation turned at a constant rate."""
    found = rotations.copy()
    for f in range(len(rotations)):
        if spin[f, 0] != 0 or spin[f, 1] != 0 or spin[f, 2] != 0:
            found[f] = straightened(turn(time * spin[f]) @ rotations[f])
    return found


@njit(cache=True, nogil=True)
def _rates(
    rotations: FloatArray, inverse_inertia: FloatArray, momentum: FloatArray, spin: FloatArray, time: float
) -> FloatArray:
    """See `rates`: the Lie group method of order 4 of Runge, Kutta, Munthe-Kaas."""
    found = spin.copy()
    for f in range(len(rotations)):
        moves = momentum[f, 0] != 0 or momentum[f, 1] != 0 or momentum[f, 2] != 0
        if not moves or time <= 0:
            continue
        r, inverse, l = rotations[f], inverse_inertia[f], momentum[f]  # noqa: E741
        k1 = time * _spin(r, inverse, l)
        k2 = _pulled_back(k1 / 2, time * _spin(turn(k1 / 2) @ r, inverse, l))
        k3 = _pulled_back(k2 / 2, time * _spin(turn(k2 / 2) @ r, inverse, l))
        k4 = _pulled_back(k3, time * _spin(turn(k3) @ r, inverse, l))
        step = (k1 + 2 * k2 + 2 * k3 + k4) / 6
        found[f] += step / time
    return found


@njit(cache=True, nogil=True)
def _spin(rotation: FloatArray, inverse: FloatArray, momentum: FloatArray) -> FloatArray:
    """(3,) rad/s of a body with an angular momentum."""
    return rotation @ (inverse @ (rotation.T @ momentum))


@njit(cache=True, nogil=True)
def _pulled_back(at: FloatArray, rate: FloatArray) -> FloatArray:
    """(3,) rate of a rotation vector whose rotation turns at a rate, up to third order."""
    first = np.cross(at, rate)
    return rate - first / 2 + np.cross(at, first) / 12
