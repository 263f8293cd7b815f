"""Units and up axis of a capture of a person, guessed from its size and from where it touches the floor."""

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.sequences.axes import METRES

TALL = 1.7  # m, what a captured person's longest side is likely to be near
PEOPLE = 0.5, 2.5  # m, how long people are at least and at most
ON_FLOOR = 0.12  # m, how far from 0 the lowest point of someone on the floor may be: soles and hands sink in


def guess_units(low: FloatArray, high: FloatArray) -> str:
    """The unit in which the longest side of the capture comes nearest to a person's height, by ratio.

    Args:
        low: (T, 3) smallest coordinates of each frame, as on disk.
        high: (T, 3) largest.
    """
    size = max(float(np.median((high - low).max(1))), 1e-12)
    return min(METRES, key=lambda unit: abs(np.log(size * METRES[unit] / TALL)))


def guess_up(low: FloatArray, high: FloatArray, *, read_as: str = "z") -> str:
    """The axis along which the person stands; `read_as` unless most frames speak against it.

    Someone who lies or crawls is not doubted: there the lowest point is at the floor. A standing person turned on
    the side is flat, and goes below the floor by half a body's depth, while along the true axis it is tall and its
    lowest point stays at 0 - or at least it is flat, long, and nowhere near the floor.

    Args:
        low: (T, 3) m, smallest coordinates of each frame along the axes on disk.
        high: (T, 3) m, largest.
        read_as: x, y or z, the axis taken as up so far.
    """
    up = "xyz".index(read_as)
    others = [axis for axis in (1, 2, 0) if axis != up]
    likely = [axis for axis in others if np.mean(_stands_along(low, high, axis, up)) > 0.5]
    if not likely:
        return read_as
    return "xyz"[min(likely, key=lambda axis: float(np.median(np.abs(low[:, axis]))))]


def _stands_along(low: FloatArray, high: FloatArray, axis: int, up: int) -> BoolArray:
    """(T,) frames that look like someone who stands along `axis` and was turned on the side to `up`."""
    height, length = high[:, up] - low[:, up], high[:, axis] - low[:, axis]
    off, off_axis = np.abs(low[:, up]), np.abs(low[:, axis])
    feet_at_zero = (length > 1.2) & (length > 1.5 * height) & (off_axis < ON_FLOOR) & (off > 0.08 + off_axis)
    adrift = (length > 1.4) & (height < 0.6) & (off > ON_FLOOR)
    return np.asarray(feet_at_zero | adrift)


def said_of_units(height: float, size: float, *, likely: str, how: str) -> str:
    """The doubt about units, as a question.

    Args:
        height: m, extent along what is taken as up.
        size: m, longest extent.
        likely: what the size speaks for.
        how: to say so, in a scene file or on the command line.
    """
    tall = f"{height:.3g} m tall" if height > 0.8 * size else f"{size:.3g} m long"
    return f"{tall}: are its units {likely}? ({how})"


def said_of_up(height: float, *, likely: str, how: str) -> str:
    """The doubt about the up axis, as a question.

    Args:
        height: m, extent along what is taken as up.
        likely: the axis that the posture speaks for.
        how: to say so, in a scene file or on the command line.
    """
    return f"lies on its side, {height:.2f} m high: is its up axis {likely}? ({how})"
