"""The global penetration depth of two bodies of convex pieces, and how to leave an overlap by translation alone."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.bodies import Pose
from mhvedit.world.narrow import Narrow
from mhvedit.world.turning import between

CANCELLED: Final = 0.1  # of the sum of squared depths: a shorter sum means that normals oppose each other
TOLERANCE: Final = 5e-4  # m, overlap that counts as none
LEEWAY: Final = 2e-4  # m, how far beyond touching a body is moved
ITERATIONS: Final = 24
HALVINGS: Final = 12

Look = Callable[[Pose], tuple[FloatArray, FloatArray]]  # (K,) m depths and (K, 3) normals out of the obstacles


@dataclass(frozen=True, slots=True, eq=False)
class PushedOut:
    """Where a body ended up."""

    pose: Pose
    iterations: int
    deepest: float  # m, overlap that is left
    returned: bool  # by going back towards the last free pose

    @property
    def free(self) -> bool:
        """Whether no overlap is left."""
        return self.deepest <= TOLERANCE


def global_depth(depths: FloatArray, normals: FloatArray) -> FloatArray:
    """PD_g = sum pd_i^2 n_i / |sum pd_i| (Schmidl and Lin, eq. 1).

    In a corner of two equally deep, orthogonal walls this is half of what each wall needs, so that overlap halves with
    every application: whoever uses it has to repeat it.

    Args:
        depths: (K,) m, of the overlapping convex pairs.
        normals: (K, 3) unit, out of B into A.

    Returns:
        (3,) m by which A moves out of B if B stays; 0 where nothing overlaps.
    """
    total = depths.sum()
    return np.asarray((depths**2) @ normals / total) if total > 0 else np.zeros(3)


def normals_cancel(depths: FloatArray, normals: FloatArray) -> bool:
    """Whether normals oppose each other, so that eq. 1 says little (Schmidl and Lin, fig. 4b)."""
    squares = depths**2
    return bool(np.linalg.norm(squares @ normals) < CANCELLED * squares.sum())


def push_out(pose: Pose, look: Look, *, free: Pose | None = None) -> PushedOut:
    """Move a rigid body out of what it overlaps, by translations of eq. 1 (Schmidl and Lin, algorithm 1).

    Args:
        pose: where it wants to be.
        look: depths and normals of its overlaps at a pose.
        free: its last pose without overlap, to which it goes back as far as it has to where eq. 1 leads nowhere.

    Returns:
        The pose; `free` is False where not even the last free pose is free.
    """
    at, used = pose, 0
    depths, normals = look(at)
    while depths.max(initial=0.0) > TOLERANCE and used < ITERATIONS and not normals_cancel(depths, normals):
        used += 1
        at = Pose(at.rotation, at.position + global_depth(depths + LEEWAY, normals))
        depths, normals = look(at)
    deepest = float(depths.max(initial=0.0))
    if deepest <= TOLERANCE or free is None:
        return PushedOut(at, used, deepest, False)
    if look(free)[0].max(initial=0.0) > TOLERANCE:
        return PushedOut(at, used, deepest, False)
    return PushedOut(return_to_free(pose, look, free=free), used, 0.0, True)


def return_to_free(pose: Pose, look: Look, *, free: Pose) -> Pose:
    """The pose farthest on the way from a free one that bisection finds free (C2.3)."""
    share, step, best = 1.0, 0.5, free
    for _ in range(HALVINGS):
        share -= step
        between_them = Pose(
            between(free.rotation, pose.rotation, share), free.position + share * (pose.position - free.position)
        )
        step /= 2
        if look(between_them)[0].max(initial=0.0) <= TOLERANCE:
            best = between_them
            share += 2 * step
    return best


def overlaps(
    narrow: Narrow, i: int, placed: tuple[FloatArray, FloatArray], pose: Pose
) -> tuple[FloatArray, FloatArray]:
    """Depths (K,) m of what a body overlaps at a pose, and normals (K, 3) out of the others.

    Args:
        narrow: the pieces, and which may meet.
        i: frame of the body.
        placed: rotations (F, 3, 3) and positions (F, 3) m of all frames.
        pose: of the body.
    """
    rotations, positions = placed[0].copy(), placed[1].copy()
    rotations[i], positions[i] = pose.rotation, pose.position
    gaps = narrow.near(rotations, positions, reach=0.0)
    frames = narrow.colliders.carrier[gaps.pairs].reshape(-1, 2)
    mine = (frames == i).any(1)
    sign = np.where(frames[mine, 0] == i, 1.0, -1.0)
    return -gaps.distance[mine], gaps.normal[mine] * sign[:, None]
