"""When bodies on their way meet: conservative advancement (Mirtich 1996), so that none passes through another."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.world.broad import boxes, overlapping
from mhvedit.world.contacts import TOUCHING
from mhvedit.world.motion import Moving, flown
from mhvedit.world.narrow import Narrow

STOP: Final = TOUCHING / 2  # m, gap at which bodies count as having met
STEPS: Final = 200


def time_of_impact(
    narrow: Narrow,
    moving: Moving,
    velocity: FloatArray,
    spin: FloatArray,
    time: float,
    *,
    leaving_out: Sequence[tuple[int, int]] = (),
) -> float:
    """The first time within a span at which two frames come within STOP of each other; the span where none do.

    Bodies move at constant rates. In a time t the gap along its own direction closes by at most t times the speed of
    approach and the spins times the bodies' radii, so that it is safe to go on to where that could close it.

    Args:
        narrow: the pieces.
        moving: where bodies are.
        velocity: (F, 3) m/s.
        spin: (F, 3) rad/s.
        time: s, the span.
        leaving_out: pairs of frames, the lower first, that touch already.
    """
    pairs = _on_the_way(narrow, moving, velocity, spin, time)
    carrier = narrow.colliders.carrier
    known = set(leaving_out)
    frames = [(int(min(f)), int(max(f))) for f in carrier[pairs]]
    keep = [k for k, pair in enumerate(frames) if pair not in known]
    earliest = time
    for k in keep:
        earliest = _meeting(narrow, moving, pairs[k : k + 1], (velocity, spin), earliest)
    return earliest


def _on_the_way(narrow: Narrow, moving: Moving, velocity: FloatArray, spin: FloatArray, time: float) -> IntArray:
    """(K, 2) pairs of pieces whose boxes, swept along their ways, come near each other."""
    found = boxes(narrow.colliders, moving.rotations, moving.positions)
    carrier = narrow.colliders.carrier
    swing = (np.linalg.norm(spin, axis=1) * time).clip(max=2.0)[carrier] * narrow.colliders.extent[carrier]
    way = time * velocity[carrier]
    found[:, 0] += np.minimum(way, 0.0) - swing[:, None]
    found[:, 1] += np.maximum(way, 0.0) + swing[:, None]
    return np.asarray(overlapping(found, narrow.colliders.may_meet, STOP))


def _meeting(
    narrow: Narrow, moving: Moving, pair: IntArray, rates: tuple[FloatArray, FloatArray], time: float
) -> float:
    """When one pair of pieces meets, or the span where it does not."""
    velocity, spin = rates
    reach = narrow.colliders.extent
    a, b = narrow.colliders.carrier[pair[0]]
    swing = float(np.linalg.norm(spin[a]) * reach[a] + np.linalg.norm(spin[b]) * reach[b])
    gone = 0.0
    for _ in range(STEPS):
        gaps = narrow.gaps(pair, *flown(moving, velocity, spin, gone))
        gap = float(gaps.distance[0]) - STOP
        closing = float(gaps.normal[0] @ (velocity[b] - velocity[a])) + swing
        if closing <= 0:
            return time
        if gap <= 0.1 * STOP:
            return min(gone, time)
        gone += gap / closing
        if gone >= time:
            return time
    return gone
