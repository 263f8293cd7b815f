"""Small vectors and rotations; angles in radians, z up."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]

UP: Floats = np.array([0.0, 0.0, 1.0])


def vec(*values: float) -> Floats:
    """A float vector."""
    return np.array(values, dtype=np.float64)


def unit(vector: Floats) -> Floats:
    """The vector at length one; a zero vector stays zero."""
    length = float(np.sqrt(vector @ vector))
    return vector / length if length > 1e-12 else vector


def turn(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> Floats:
    """Rotation (3, 3): roll about x, then pitch about y (positive leans forward), then yaw about z."""
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    return np.asarray(about_z @ about_y @ about_x)


def frame_along(axis: Floats, side: Floats) -> Floats:
    """Rotation (3, 3) whose third column is `axis` and whose first is `side` made square to it."""
    z = unit(axis)
    x = unit(side - z * (side @ z))
    if not x.any():
        x = unit(np.cross(z, np.roll(z, 1)))
    return np.column_stack([x, np.cross(z, x), z])


def smoothstep(u: float) -> float:
    """0 to 1 over 0..1 with zero speed and acceleration at both ends."""
    u = min(max(u, 0.0), 1.0)
    return u * u * u * (u * (6.0 * u - 15.0) + 10.0)


def bend(root: Floats, target: Floats, lengths: tuple[float, float], hint: Floats) -> tuple[Floats, Floats]:
    """Two-bone inverse kinematics.

    Args:
        root: (3,) m, shoulder or hip.
        target: (3,) m, where the wrist or ankle should be.
        lengths: m, of the upper and the lower bone.
        hint: (3,) direction to which elbow or knee should point.

    Returns:
        Position of the middle joint, and of the end: the target, or as near to it as the limb reaches.
    """
    upper, lower = lengths
    reach = target - root
    distance = float(np.clip(np.sqrt(reach @ reach), abs(upper - lower) + 1e-3, upper + lower - 1e-3))
    axis = unit(reach)
    side = unit(hint - axis * (hint @ axis))
    along = (distance**2 + upper**2 - lower**2) / (2.0 * distance)
    out = np.sqrt(max(upper**2 - along**2, 0.0))
    return root + axis * along + side * out, root + axis * distance
