"""Where bodies touch, and with which restitution and friction."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.world.broad import near_pairs
from mhvedit.world.materials import Surfaces
from mhvedit.world.narrow import Narrow

TOUCHING: Final = 2e-4  # m, gap up to which bodies are in contact
Meeting = Callable[[int, int], Surfaces]  # of two frames


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """Points where frames touch."""

    frames: IntArray  # (N, 2) a and b
    point: FloatArray  # (N, 3) m, world
    normal: FloatArray  # (N, 3) unit, out of b into a
    gap: FloatArray  # (N,) m, negative where they overlap
    restitution: FloatArray  # (N,)
    friction: FloatArray  # (N,)


def touching(narrow: Narrow, rotations: FloatArray, positions: FloatArray, meeting: Meeting) -> Contacts:
    """All contact points of pairs that may meet.

    Args:
        narrow: the pieces.
        rotations: (F, 3, 3) world_from_frame.
        positions: (F, 3) m.
        meeting: restitution and friction between frames.
    """
    pairs = near_pairs(narrow.colliders, rotations, positions, reach=TOUCHING)
    rows, point, normal, gap = narrow.patches(pairs, rotations, positions, reach=TOUCHING)
    frames = narrow.colliders.carrier[pairs[rows]].reshape(-1, 2)
    known = {pair: meeting(*pair) for pair in set(map(tuple, frames.tolist()))}
    surfaces = [known[pair] for pair in map(tuple, frames.tolist())]
    return Contacts(
        frames,
        point,
        normal,
        gap,
        np.array([each.restitution for each in surfaces]),
        np.array([each.friction for each in surfaces]),
    )
