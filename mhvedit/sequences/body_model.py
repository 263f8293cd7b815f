"""A plain adult made of round cones, to be laid into a surface: who stands where, and which way the joints bend.

Body frame: x to the front, y to the left, z up, floor at 0, standing 1.75 m tall with the arms hanging. The figures
are textbook proportions, not fitted to any capture.
"""

from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray

PELVIS, LUMBAR, CHEST, NECK = 0, 1, 2, 3
LEFT_SHOULDER, LEFT_ELBOW, RIGHT_SHOULDER, RIGHT_ELBOW = 4, 5, 6, 7
LEFT_HIP, LEFT_KNEE, LEFT_ANKLE, RIGHT_HIP, RIGHT_KNEE, RIGHT_ANKLE = 8, 9, 10, 11, 12, 13
N_JOINTS = 14


@dataclass(frozen=True, slots=True, eq=False)
class BodyModel:
    """Joints and round cones of the plain adult; lengths in m at scale 1."""

    parents: IntArray  # (J,) parent joint, -1 for the pelvis
    offsets: FloatArray  # (J, 3) m, joint in its parent's frame
    cone_joint: IntArray  # (C,) the joint that carries the cone
    cone_ends: FloatArray  # (C, 2, 3) m, ends of the axis in the joint's frame
    cone_radii: FloatArray  # (C, 2) m
    centres: FloatArray  # (J, 3, 3) rotation in the parent from which the limits count
    ranges: FloatArray  # (J, 3, 3) of the rotation vector: lower and upper limit, rad; weight of the pull to the middle
    chains: IntArray  # (J, depth) each joint and those that it hangs on, padded with -1


_JOINTS = (  # parent, position
    (-1, (0.0, 0.0, 0.95)),
    (PELVIS, (-0.01, 0.0, 1.03)),
    (LUMBAR, (-0.01, 0.0, 1.20)),
    (CHEST, (-0.02, 0.0, 1.47)),
    (CHEST, (-0.02, 0.175, 1.405)),
    (LEFT_SHOULDER, (-0.02, 0.195, 1.115)),
    (CHEST, (-0.02, -0.175, 1.405)),
    (RIGHT_SHOULDER, (-0.02, -0.195, 1.115)),
    (PELVIS, (0.0, 0.09, 0.92)),
    (LEFT_HIP, (0.0, 0.09, 0.50)),
    (LEFT_KNEE, (-0.02, 0.09, 0.085)),
    (PELVIS, (0.0, -0.09, 0.92)),
    (RIGHT_HIP, (0.0, -0.09, 0.50)),
    (RIGHT_KNEE, (-0.02, -0.09, 0.085)),
)
_TRUNK = (  # joint, end, end, radius, radius
    (PELVIS, (-0.025, 0.075, 0.93), (-0.025, -0.075, 0.93), 0.108, 0.108),
    (LUMBAR, (0.0, 0.055, 1.07), (0.0, -0.055, 1.07), 0.098, 0.098),
    (LUMBAR, (0.0, 0.060, 1.18), (0.0, -0.060, 1.18), 0.100, 0.100),
    (CHEST, (0.0, 0.080, 1.29), (0.0, -0.080, 1.29), 0.105, 0.105),
    (CHEST, (-0.02, 0.13, 1.39), (-0.02, -0.13, 1.39), 0.070, 0.070),
    (CHEST, (-0.02, 0.0, 1.42), (0.0, 0.0, 1.50), 0.070, 0.058),
    (NECK, (-0.01, 0.0, 1.48), (0.01, 0.0, 1.58), 0.058, 0.058),
    (NECK, (-0.022, 0.0, 1.67), (0.022, 0.0, 1.675), 0.077, 0.075),
    (NECK, (0.045, 0.0, 1.64), (0.04, 0.0, 1.58), 0.052, 0.042),
)
_LEFT_LIMBS = (
    (LEFT_SHOULDER, (-0.02, 0.165, 1.39), (-0.02, 0.195, 1.115), 0.056, 0.043),
    (LEFT_ELBOW, (-0.02, 0.195, 1.115), (0.0, 0.20, 0.865), 0.043, 0.030),
    (LEFT_ELBOW, (0.0, 0.20, 0.865), (0.02, 0.20, 0.71), 0.038, 0.022),
    (LEFT_HIP, (0.0, 0.09, 0.88), (0.0, 0.09, 0.50), 0.088, 0.058),
    (LEFT_KNEE, (-0.005, 0.09, 0.50), (-0.025, 0.09, 0.33), 0.056, 0.056),
    (LEFT_KNEE, (-0.025, 0.09, 0.33), (-0.02, 0.09, 0.09), 0.056, 0.040),
    (LEFT_ANKLE, (-0.045, 0.09, 0.045), (0.06, 0.095, 0.04), 0.042, 0.040),
    (LEFT_ANKLE, (0.06, 0.095, 0.04), (0.165, 0.11, 0.025), 0.040, 0.026),
)
SKULL = np.array([0.02, 0.0, 0.18])  # m, centre of the head (between the ears), in the frame of the neck
EYES = np.array([0.088, 0.0, 0.0])  # m, midpoint of the eyes from there
_HEAD = (  # end, end, radius, radius from the centre of the head: skull, face, nose, neck
    ((-0.022, 0.0, 0.020), (0.022, 0.0, 0.025), 0.077, 0.075),
    ((0.045, 0.0, -0.010), (0.040, 0.0, -0.070), 0.052, 0.042),
    ((0.095, 0.0, -0.020), (0.110, 0.0, -0.045), 0.012, 0.014),
    ((-0.020, 0.0, -0.060), (-0.035, 0.0, -0.180), 0.057, 0.060),
)
_TO_RIGHT = {LEFT_SHOULDER: RIGHT_SHOULDER, LEFT_ELBOW: RIGHT_ELBOW, LEFT_HIP: RIGHT_HIP}
_TO_RIGHT |= {LEFT_KNEE: RIGHT_KNEE, LEFT_ANKLE: RIGHT_ANKLE}
_LIMITS = {  # joint: middle, lower, upper (rotation vectors, degrees, left side), weight of the pull
    LUMBAR: ((0, 0, 0), (-20, -15, -20), (20, 35, 20), 0.6),
    CHEST: ((0, 0, 0), (-20, -15, -20), (20, 30, 20), 0.6),
    NECK: ((0, 0, 0), (-35, -50, -65), (35, 50, 65), 0.25),
    LEFT_SHOULDER: ((25, -30, 0), (-90, -130, -80), (130, 90, 80), 0.05),
    LEFT_ELBOW: ((0, 0, 0), (-8, -140, -8), (8, 0, 8), 0.05),
    LEFT_HIP: ((0, -30, 0), (-35, -95, -35), (45, 55, 35), 0.08),
    LEFT_KNEE: ((0, 0, 0), (-6, 0, -8), (6, 140, 8), 0.05),
    LEFT_ANKLE: ((0, 0, 0), (-20, -25, -25), (20, 50, 25), 0.15),
}


def rotation_from_vector(vector: FloatArray) -> FloatArray:
    """The 3 x 3 rotation of a rotation vector in rad (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle if angle > 0 else vector
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew)


def plain_adult() -> BodyModel:
    """The model with which every capture is compared."""
    parents = np.array([parent for parent, _ in _JOINTS])
    places = np.array([place for _, place in _JOINTS])
    offsets = places - np.where(parents[:, None] >= 0, places[parents], 0.0)
    mirror = np.array([1.0, -1.0, 1.0])
    limbs = [(_TO_RIGHT[j], np.multiply(a, mirror), np.multiply(b, mirror), ra, rb) for j, a, b, ra, rb in _LEFT_LIMBS]
    cones = [*_TRUNK, *_LEFT_LIMBS, *limbs]
    joint = np.array([cone[0] for cone in cones])
    ends = np.array([[cone[1], cone[2]] for cone in cones], np.float64) - places[joint][:, None]
    radii = np.array([[cone[3], cone[4]] for cone in cones])
    centres, ranges = _joint_ranges()
    return BodyModel(parents, offsets, joint, ends, radii, centres, ranges, _chains(parents))


def plain_head() -> BodyModel:
    """The head alone, with a nose: one joint, in the middle between the ears."""
    ends = np.array([[cone[0], cone[1]] for cone in _HEAD])
    radii = np.array([[cone[2], cone[3]] for cone in _HEAD])
    parents, joint = np.array([-1]), np.zeros(len(_HEAD), np.int64)
    still = np.zeros((1, 3, 3))
    return BodyModel(parents, still[0, :1], joint, ends, radii, np.eye(3)[None], still, _chains(parents))


def _chains(parents: IntArray) -> IntArray:
    """(J, depth) the joint and those that it hangs on, padded with -1."""
    chains = np.full((len(parents), 8), -1)
    for joint in range(len(parents)):
        at, n = joint, 0
        while at >= 0:
            chains[joint, n] = at
            at, n = int(parents[at]), n + 1
    return chains


def _joint_ranges() -> tuple[FloatArray, FloatArray]:
    """Middle rotations, limits and pulls of all joints; the right side is the left side's mirror image."""
    centres = np.tile(np.eye(3), (N_JOINTS, 1, 1))
    lower, upper, pull = (np.zeros((N_JOINTS, 3)) for _ in range(3))
    flip = np.array([-1.0, 1.0, -1.0])  # a rotation vector seen in the mirror y -> -y
    for left, (middle, low, high, weight) in _LIMITS.items():
        centres[left] = rotation_from_vector(np.radians(middle))
        lower[left], upper[left], pull[left] = np.radians(low), np.radians(high), weight
        if left in _TO_RIGHT:
            right = _TO_RIGHT[left]
            centres[right] = rotation_from_vector(np.radians(middle) * flip)
            bounds = np.sort([lower[left] * flip, upper[left] * flip], axis=0)
            lower[right], upper[right], pull[right] = bounds[0], bounds[1], weight
    return centres, np.stack([lower, upper, pull], axis=1)
