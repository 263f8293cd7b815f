"""How good is a contact? What the motion says about solutions that the paper's cost cannot tell apart.

Two measures, both of the parts' centres of gravity: in a real hold the parts move as one, so their relative motion over
the hold is small; and two people who touch mostly stand on either side of what they touch, so that the contact lies
between them. The first is telling and strong where the hold is long enough; the second is a mild prior.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import rotation

SHORTEST_HOLD = 12  # frames; shorter holds tell nothing (two slaps of 6 frames did not)
TELLING_RANGE = 0.02  # m; the relative motion must vary this much over yaw
HOLD_WEIGHT = 100.0  # m of clearance that one metre of relative motion is worth
OPPOSITION_WEIGHT = 0.1  # m of clearance that standing on the same side (2) instead of opposite (0) costs, halved


@dataclass(frozen=True, slots=True, eq=False)
class ContactMotion:
    """Where the interest parts of one segment are while they touch, each in its subject's canonical frame."""

    part_a: FloatArray  # (K, 3) m
    part_b: FloatArray  # (K, 3) m
    root_a: FloatArray  # (2,) m
    root_b: FloatArray  # (2,) m
    held: bool  # the type asks for contact throughout


def contact_penalty(contact: ContactMotion, poses: FloatArray) -> FloatArray:
    """What speaks against each solution, in metres of clearance.

    Args:
        contact: of the segment.
        poses: (S, 3) of B in A, canonical frames.

    Returns:
        (S,).
    """
    penalty = OPPOSITION_WEIGHT * opposition(contact, poses)
    if contact.held and len(contact.part_a) >= SHORTEST_HOLD:
        turns = np.linspace(0, 2 * np.pi, 180, endpoint=False)
        anywhere = relative_motion(contact, turns)
        if anywhere.max() - anywhere.min() >= TELLING_RANGE:
            yaws, inverse = np.unique(poses[:, 2], return_inverse=True)
            penalty = penalty + HOLD_WEIGHT * relative_motion(contact, yaws)[inverse]
    return np.asarray(penalty)


def relative_motion(contact: ContactMotion, yaws: FloatArray) -> FloatArray:
    """RMS motion of one part against the other, which depends on the yaw alone.

    Args:
        contact: of the segment.
        yaws: (N,) rad of B in A.

    Returns:
        (N,) m.
    """
    xy = np.einsum("nij,kj->nki", rotation(yaws), contact.part_b[:, :2]) - contact.part_a[:, :2]
    z = contact.part_b[:, 2] - contact.part_a[:, 2]
    return np.asarray(np.sqrt(xy.var(1).sum(-1) + z.var()))


def opposition(contact: ContactMotion, poses: FloatArray) -> FloatArray:
    """1 + cos of the angle at the contact between the two roots.

    It is 0 where the contact lies between them, 2 where both are on one side of it.

    Args:
        contact: of the segment; its middle frame is taken.
        poses: (S, 3).

    Returns:
        (S,).
    """
    middle = len(contact.part_a) // 2
    parts = contact.part_a[middle], contact.part_b[middle]
    return np.asarray(_opposition(poses, *parts, contact.root_a, contact.root_b))


@njit(cache=True, nogil=True)
def _opposition(
    poses: FloatArray, part_a: FloatArray, part_b: FloatArray, root_a: FloatArray, root_b: FloatArray
) -> FloatArray:
    out = np.empty(poses.shape[0])
    for s in range(poses.shape[0]):
        x, y, c, n = poses[s, 0], poses[s, 1], np.cos(poses[s, 2]), np.sin(poses[s, 2])
        touch_x = 0.5 * (c * part_b[0] - n * part_b[1] + x + part_a[0])
        touch_y = 0.5 * (n * part_b[0] + c * part_b[1] + y + part_a[1])
        a_x, a_y = root_a[0] - touch_x, root_a[1] - touch_y
        b_x, b_y = c * root_b[0] - n * root_b[1] + x - touch_x, n * root_b[0] + c * root_b[1] + y - touch_y
        lengths = np.sqrt((a_x * a_x + a_y * a_y) * (b_x * b_x + b_y * b_y))
        out[s] = 1 + (a_x * b_x + a_y * b_y) / max(lengths, 1e-9)
    return out
