"""Units and up axis of what is on disk, and the way to metres and z up."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray

METRES: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001}  # metres per unit
UP_AXES: Final = ("x", "y", "z")


def check_axes(units: str, up: str) -> None:
    """Refuse units and up axes that are not known.

    Raises:
        ShapeError: not one of `METRES` or `UP_AXES`.
    """
    if units not in METRES:
        raise ShapeError("units", repr(units), "one of " + ", ".join(METRES))
    if up not in UP_AXES:
        raise ShapeError("up", repr(up), "one of " + ", ".join(UP_AXES))


def to_metres_z_up(points: NDArray[np.floating], *, units: str, up: str) -> FloatArray:
    """Turn points as they are on disk into metres and z up.

    Args:
        points: (..., 3) in `units`.
        units: m, cm or mm.
        up: y turns by (x, y, z) -> (x, -z, y), x by (x, y, z) -> (-z, y, x).

    Returns:
        (..., 3) m, a new array.
    """
    check_axes(units, up)
    metric: FloatArray = np.multiply(points, METRES[units], dtype=np.float64)
    if up == "y":
        return np.stack([metric[..., 0], -metric[..., 2], metric[..., 1]], -1)
    if up == "x":
        return np.stack([-metric[..., 2], metric[..., 1], metric[..., 0]], -1)
    return metric


def from_metres_z_up(points: FloatArray, *, units: str, up: str) -> FloatArray:
    """The inverse of `to_metres_z_up`: what to write into a file of these units and this up axis."""
    check_axes(units, up)
    turned = points
    if up == "y":
        turned = np.stack([points[..., 0], points[..., 2], -points[..., 1]], -1)
    elif up == "x":
        turned = np.stack([points[..., 2], points[..., 1], -points[..., 0]], -1)
    return np.divide(turned, METRES[units], dtype=np.float64)
