"""Lines and cones that are drawn beside people."""

import numpy as np
import pyvista

from mhvedit.geometry.arrays import FloatArray
from mhvedit.view.studio import UP

CONE_LENGTH = 1.2  # m
CONE_SIDES = 36


def dashes(points: FloatArray) -> pyvista.PolyData:
    """Every second stretch of a line."""
    starts = np.arange(0, len(points) - 1, 2)
    lines = np.column_stack([np.full(len(starts), 2), starts, starts + 1])
    return pyvista.PolyData(points, lines=lines.ravel())


def cone(half_angle: float) -> pyvista.PolyData:
    """A cone of sight with its tip at the origin, along x; no cap."""
    around = np.linspace(0, 2 * np.pi, CONE_SIDES, endpoint=False)
    along, out = np.cos(half_angle), np.sin(half_angle)
    rim = CONE_LENGTH * np.column_stack([np.full(CONE_SIDES, along), out * np.cos(around), out * np.sin(around)])
    points = np.concatenate([np.zeros((1, 3)), rim]).astype(np.float32)
    here = np.arange(CONE_SIDES)
    faces = np.column_stack([np.zeros(CONE_SIDES, np.int64), here + 1, (here + 1) % CONE_SIDES + 1])
    return pyvista.PolyData.from_regular_faces(points, faces)


def frame_along(axis: FloatArray) -> FloatArray:
    """(3, 3) a rotation whose first column is the axis."""
    side = np.cross(UP if abs(axis[2]) < 0.99 else np.array([0.0, 1.0, 0.0]), axis)
    side /= np.linalg.norm(side)
    return np.stack([axis, side, np.cross(axis, side)], 1)
