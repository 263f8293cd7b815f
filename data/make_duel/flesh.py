"""Trunk, limbs, feet and clothes of a posed person, as shapes to blend."""

from __future__ import annotations

import numpy as np

from .face import head_shapes
from .field import ball, cone
from .figure import Figure, Posed
from .hands import free_hand_shapes, sword_hand_shapes
from .vectors import UP, Floats, unit, vec


def body_shapes(figure: Figure, posed: Posed) -> Floats:
    """The whole body as a table of shapes (S, 20) for `field`."""
    shapes = _trunk(figure, posed)
    for side in ("right", "left"):
        shapes += _leg(figure, posed, side) + _foot(figure, posed, side) + _arm(figure, posed, side)
    shapes += _jacket(figure, posed) + head_shapes(figure, posed)
    shapes += sword_hand_shapes(figure, posed) + free_hand_shapes(figure, posed)
    return np.array(shapes)


def _trunk(figure: Figure, posed: Posed) -> list[Floats]:
    """Pelvis, belly, rib cage, back and shoulders."""
    h, g = figure.height, figure.girth
    pelvis, waist, chest = posed.frames["pelvis"], posed.frames["waist"], posed.frames["chest"]
    w, d = h * (0.62 * figure.shoulder + 0.028 * g), h * g
    breath = 1.0 + 0.012 * posed.stance.breath
    hip = h * (figure.hip + 0.042 * g)
    shapes = [
        ball(posed.at("pelvis", "Hips", -0.002 * h, 0, 0.012 * h), pelvis, (0.066 * d, hip, 0.072 * h)),
        ball(posed.at("waist", "Spine", 0.0, 0, -0.005 * h), waist, (0.057 * d, 0.066 * d, 0.085 * h), blend=0.05),
        ball(
            posed.at("chest", "Spine", 0.004 * h, 0, 0.095 * h), chest, (0.067 * d * breath, w, 0.105 * h), blend=0.05
        ),
        ball(posed.at("chest", "Spine", -0.008 * h, 0, 0.150 * h), chest, (0.052 * d, w * 1.05, 0.050 * h), blend=0.04),
    ]
    for side, sign in (("right", -1.0), ("left", 1.0)):
        shapes += [
            ball(
                posed.at("pelvis", "Hips", -0.036 * h, sign * 0.036 * h, -0.022 * h),
                pelvis,
                (0.040 * d, 0.042 * d, 0.046 * d),
                blend=0.05,
            ),
            cone(
                posed.at("chest", "Neck", 0, sign * 0.012 * h, 0.012 * h),
                posed.joints[f"{side}_shoulder"],
                (0.026 * d, 0.028 * d),
                blend=0.04,
            ),
            ball(
                posed.at("chest", "Spine", 0.040 * h, sign * 0.042 * h, 0.115 * h),
                chest,
                (0.032 * d, 0.041 * d, 0.036 * d),
                blend=0.03,
            )
            if figure.bust
            else ball(
                posed.at("chest", "Spine", 0.042 * h, sign * 0.044 * h, 0.130 * h),
                chest,
                (0.024 * d, 0.044 * d, 0.032 * d),
                blend=0.03,
            ),
        ]
    return shapes


def _jacket(figure: Figure, posed: Posed) -> list[Floats]:
    """Belt, collar and the skirts of the fencing jacket over the thighs."""
    h, d = figure.height, figure.height * figure.girth
    hip = h * (figure.hip + 0.046 * figure.girth)
    chest, pelvis = posed.frames["chest"], posed.frames["pelvis"]
    shapes = [
        ball(
            posed.at("waist", "Spine", 0.002 * h, 0, -0.032 * h),
            posed.frames["waist"],
            (0.063 * d, 0.0735 * d, 0.020 * h),
            blend=0.012,
        ),
        ball(posed.at("chest", "Neck", 0.006 * h, 0, 0.006 * h), chest, (0.042 * d, 0.040 * d, 0.020 * h), blend=0.012),
        ball(posed.at("pelvis", "Hips", -0.004 * h, 0, -0.012 * h), pelvis, (0.074 * d, hip, 0.050 * h), blend=0.02),
    ]
    for side, sign in (("right", -1.0), ("left", 1.0)):
        root, knee = posed.joints[f"{side}_hip"], posed.joints[f"{side}_knee"]
        down = 0.80 * unit(knee - root) + 0.20 * -UP
        root = root + pelvis @ vec(-0.004 * h, sign * 0.005 * h, 0.02 * h)
        shapes.append(cone(root, root + down * 0.085 * h, (0.048 * d, 0.0535 * d), blend=0.008))
    return shapes


def _leg(figure: Figure, posed: Posed, side: str) -> list[Floats]:
    """Thigh, knee, calf and the cuff of the boot."""
    d = figure.height * figure.girth
    hip, knee, ankle = (posed.joints[f"{side}_{name}"] for name in ("hip", "knee", "ankle"))
    bow = unit(knee - 0.5 * (hip + ankle)) if _far(knee, 0.5 * (hip + ankle)) else posed.frames[f"{side}_foot"][:, 0]
    shank = unit(ankle - knee)
    turned = np.column_stack([bow - shank * (bow @ shank), np.cross(shank, bow), shank])
    turned[:, 0], turned[:, 1] = unit(turned[:, 0]), unit(turned[:, 1])
    middle = hip + 0.42 * (knee - hip)
    calf = knee + 0.30 * (ankle - knee) - turned[:, 0] * 0.012 * d
    cuff = knee + 0.36 * (ankle - knee)
    return [
        cone(hip, knee, (0.050 * d, 0.031 * d), blend=0.03),
        cone(middle + bow * 0.012 * d, knee - 0.15 * (knee - hip), (0.042 * d, 0.031 * d), blend=0.03),
        cone(knee, ankle, (0.030 * d, 0.021 * d), blend=0.02),
        ball(knee + bow * 0.008 * d, turned, (0.027 * d, 0.026 * d, 0.033 * d), blend=0.02),
        ball(calf, turned, (0.030 * d, 0.031 * d, 0.070 * d), blend=0.03),
        cone(cuff, ankle, (0.0375 * d, 0.0265 * d), blend=0.006),
        cone(cuff, cuff + shank * 0.012 * d, (0.0405 * d, 0.0400 * d), blend=0.006),
    ]


def _far(p: Floats, q: Floats) -> bool:
    """Whether two points are more than a centimetre apart."""
    return float((p - q) @ (p - q)) > 1e-4


def _foot(figure: Figure, posed: Posed, side: str) -> list[Floats]:
    """A boot, its sole flattened by the floor."""
    size = figure.height / 1.75 * (0.94 + 0.06 * figure.girth)
    foot, ankle = posed.frames[f"{side}_foot"], posed.joints[f"{side}_ankle"]

    def spot(x: float, z: float) -> Floats:
        """A point of the foot."""
        return np.asarray(ankle + foot @ vec(x, 0, z) * size)

    flat = (0.94, 1.0)
    return [
        cone(ankle, spot(-0.030, -0.044), (0.036 * size, 0.037 * size), blend=0.015),
        cone(spot(0.0, -0.012), spot(0.105, -0.048), (0.038 * size, 0.032 * size), blend=0.02),
        cone(spot(-0.035, -0.050), spot(0.095, -0.052), (0.031 * size, 0.036 * size), blend=0.012, side=foot[:, 2]),
        cone(
            spot(0.095, -0.052),
            spot(0.165, -0.056),
            (0.038 * size, 0.026 * size),
            blend=0.012,
            scale=flat,
            side=foot[:, 2],
        ),
    ]


def _arm(figure: Figure, posed: Posed, side: str) -> list[Floats]:
    """Deltoid, upper arm, forearm and the gauntlet's cuff."""
    d = figure.height * figure.girth
    shoulder, elbow, wrist = (posed.joints[f"{side}_{name}"] for name in ("shoulder", "elbow", "wrist"))
    fore = wrist - elbow
    cuff = 0.025 * d if side == "right" else 0.021 * d
    return [
        cone(shoulder, shoulder + 0.25 * (elbow - shoulder), (0.034 * d, 0.031 * d), blend=0.04),
        cone(shoulder + 0.2 * (elbow - shoulder), elbow, (0.030 * d, 0.0235 * d), blend=0.025),
        cone(elbow, wrist, (0.0240 * d, 0.0165 * d), blend=0.015),
        cone(elbow + 0.12 * fore, elbow + 0.45 * fore, (0.0245 * d, 0.0225 * d), blend=0.03),
        cone(elbow + 0.60 * fore, elbow + 0.95 * fore, (cuff, 0.0185 * d), blend=0.006),
    ]
