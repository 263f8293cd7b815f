"""Whole metres that are taken off points far from the origin before they become float32, which is fine near it only."""

from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray

FAR: Final = 100.0  # m from the origin in plan, beyond which float32 misses by more than 4 µm


def middle_in_plan(points: FloatArray) -> FloatArray:
    """(2,) m, the middle of what (N, 2 or 3) points take up in plan."""
    plan = points[:, :2]
    return np.asarray((plan.min(0) + plan.max(0)) / 2)


def round_offset(place: FloatArray) -> FloatArray:
    """(2,) whole metres to take off points about a place; nothing near the origin.

    >>> round_offset(np.array([40.3, -60.0])).tolist(), round_offset(np.array([500000.6, 0.2])).tolist()
    ([0.0, 0.0], [500001.0, 0.0])

    Args:
        place: (2,) m.
    """
    return np.asarray(np.round(place) + 0.0) if np.hypot(*place) > FAR else np.zeros(2)


def offset_of(points: FloatArray) -> FloatArray:
    """(2,) whole metres to take off (N, 2 or 3) points, m; nothing near the origin."""
    return round_offset(middle_in_plan(points))


def without_offset(points: FloatArray, offset: FloatArray) -> FloatArray:
    """Points with an offset taken off in plan.

    Args:
        points: (..., 2) or (..., 3) m.
        offset: (2,) m.

    Returns:
        Points of the same shape, a new array.
    """
    moved = np.array(points, np.float64)
    moved[..., :2] -= offset
    return moved
