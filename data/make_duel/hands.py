"""Hands: a fist round the sword's grip and an open hand."""

from __future__ import annotations

import numpy as np

from .field import ball, cone
from .figure import Figure, Posed
from .vectors import Floats, turn, unit, vec


def sword_hand_shapes(figure: Figure, posed: Posed) -> list[Floats]:
    """Right fist; in its frame x points away from the wrist, z along the blade."""
    s = 0.5 + 0.5 * figure.height / 1.75
    fist, grip, wrist = posed.frames["fist"], posed.joints["right_hand"], posed.joints["right_wrist"]

    def spot(x: float, y: float, z: float) -> Floats:
        """A point of the fist, m."""
        return np.asarray(grip + fist @ vec(x, y, z) * s)

    shapes = [
        cone(wrist, spot(-0.024, 0.006, 0.0), (0.025 * s, 0.026 * s), blend=0.02),
        ball(spot(-0.014, 0.012, 0.0), fist, (0.032 * s, 0.021 * s, 0.043 * s), blend=0.02),
        cone(spot(-0.034, -0.010, 0.022), spot(-0.004, -0.024, 0.046), (0.013 * s, 0.011 * s), blend=0.012),
        cone(spot(-0.004, -0.024, 0.046), spot(0.016, -0.019, 0.042), (0.0105 * s, 0.0095 * s), blend=0.008),
    ]
    for index in range(4):
        z = 0.030 - 0.020 * index
        r = (0.0115 - 0.0007 * index) * s
        knuckle, middle, tip = spot(0.012, 0.022, z), spot(0.026, -0.006, z), spot(0.004, -0.024, z - 0.002)
        shapes += [cone(knuckle, middle, (r * 1.08, r), blend=0.006), cone(middle, tip, (r, r * 0.9), blend=0.006)]
    return shapes


def free_hand_shapes(figure: Figure, posed: Posed) -> list[Floats]:
    """Left hand, fingers a little curled, its back turned up and out."""
    s = 0.5 + 0.5 * figure.height / 1.75
    wrist, elbow = posed.joints["left_wrist"], posed.joints["left_elbow"]
    along = unit(wrist - elbow)
    back = turn(posed.stance.chest[0]) @ vec(-0.45, 0.75, 0.55)
    back = unit(back - along * (back @ along))
    hand = np.column_stack([along, np.cross(back, along), back])

    def spot(x: float, y: float, z: float) -> Floats:
        """A point of the hand, m."""
        return np.asarray(wrist + hand @ vec(x, y, z) * s)

    shapes = [
        cone(wrist, spot(0.03, 0.0, 0.0), (0.024 * s, 0.026 * s), blend=0.015),
        ball(spot(0.052, 0.0, -0.002), hand, (0.050 * s, 0.042 * s, 0.019 * s), blend=0.015),
        cone(spot(0.022, -0.026, -0.010), spot(0.062, -0.050, -0.026), (0.015 * s, 0.011 * s), blend=0.012),
        cone(spot(0.062, -0.050, -0.026), spot(0.086, -0.052, -0.036), (0.0105 * s, 0.009 * s), blend=0.006),
    ]
    for index, length in enumerate((0.040, 0.046, 0.042, 0.033)):
        y = 0.0315 * (index / 1.5 - 1.0) * -1.0
        r = 0.0105 * s
        root, curl = spot(0.088, -y, 0.0), 0.010 + 0.004 * index
        middle = spot(0.088 + length, -y * 1.04, -curl)
        shapes += [
            cone(root, middle, (r * 1.05, r), blend=0.010),
            cone(middle, spot(0.088 + 1.55 * length, -y * 1.04, -curl - 0.026), (r, r * 0.88), blend=0.010),
        ]
    return shapes
