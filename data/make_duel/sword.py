"""The sword: one closed tube, lofted from pommel to point."""

from __future__ import annotations

import numpy as np

from .vectors import Floats, Ints

SIDES = 12
BLADE = 0.86  # m, from the middle of the grip to the point
# along the blade, half breadth (edge to edge), half thickness, m
PROFILE = (
    (-0.090, 0.008, 0.008),
    (-0.083, 0.017, 0.017),
    (-0.071, 0.020, 0.020),
    (-0.059, 0.016, 0.016),
    (-0.054, 0.010, 0.009),
    (-0.030, 0.013, 0.010),
    (0.000, 0.014, 0.011),
    (0.030, 0.013, 0.010),
    (0.048, 0.012, 0.010),
    (0.051, 0.050, 0.030),
    (0.056, 0.082, 0.034),
    (0.062, 0.083, 0.033),
    (0.067, 0.050, 0.026),
    (0.070, 0.017, 0.009),
    (0.110, 0.0165, 0.0088),
    (0.210, 0.0160, 0.0084),
    (0.310, 0.0155, 0.0080),
    (0.410, 0.0150, 0.0077),
    (0.510, 0.0144, 0.0074),
    (0.610, 0.0138, 0.0070),
    (0.700, 0.0130, 0.0067),
    (0.770, 0.0118, 0.0064),
    (0.820, 0.0090, 0.0060),
    (0.848, 0.0050, 0.0045),
)
TIPS = (-0.092, BLADE)


def sword_rest() -> tuple[Floats, Ints]:
    """Vertices (V, 3) m with x towards the edge and z towards the point, and outward faces (F, 3)."""
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    rings = [np.column_stack([b * np.cos(angles), t * np.sin(angles), np.full(SIDES, z)]) for z, b, t in PROFILE]
    ends = np.array([[0.0, 0.0, TIPS[0]], [0.0, 0.0, TIPS[1]]])
    return np.vstack([*rings, ends]), _tube_faces(len(PROFILE))


def _tube_faces(rings: int) -> Ints:
    """Quads split in two between neighbouring rings, and a fan at either end."""
    here = np.arange(SIDES)
    there = (here + 1) % SIDES
    faces = []
    for ring in range(rings - 1):
        a, b = ring * SIDES + here, ring * SIDES + there
        faces += [np.column_stack([a, b, b + SIDES]), np.column_stack([a, b + SIDES, a + SIDES])]
    first, last = rings * SIDES, rings * SIDES + 1
    top = (rings - 1) * SIDES
    faces.append(np.column_stack([there, here, np.full(SIDES, first)]))
    faces.append(np.column_stack([top + here, top + there, np.full(SIDES, last)]))
    return np.vstack(faces).astype(np.int32)


def half_depth(blade_frame: Floats, normal: Floats, along: float) -> float:
    """How far (m) the blade reaches from its middle line towards `normal`, at a distance along it."""
    z, breadth, thickness = np.array(PROFILE).T
    b, t = float(np.interp(along, z, breadth)), float(np.interp(along, z, thickness))
    return float(np.hypot(b * (blade_frame[:, 0] @ normal), t * (blade_frame[:, 1] @ normal)))
