"""Joint limits: what a motion does beyond them is reported, never silently clipped."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.skeleton.model import Motion, Skeleton

SLACK: Final = 1e-4  # rad or m: rounding of files


@dataclass(frozen=True, slots=True, eq=False)
class BeyondLimits:
    """Where a motion leaves the limits: one row for each DOF that does."""

    dof: IntArray  # (K,)
    frame: IntArray  # (K,) the worst
    excess: FloatArray  # (K,) rad or m, there
    n_frames: IntArray  # (K,) in how many


def beyond_limits(skeleton: Skeleton, motion: Motion) -> BeyondLimits:
    """Which DOFs leave their limits, when and by how much.

    Raises:
        ShapeError: the motion is of another skeleton.
    """
    if motion.q.shape[1] != skeleton.n_dofs:
        raise ShapeError("q", motion.q.shape, f"(T, {skeleton.n_dofs})")
    beyond = np.maximum(motion.q - skeleton.limits[:, 1], skeleton.limits[:, 0] - motion.q)
    dof = np.flatnonzero((beyond > SLACK).any(0))
    frame = beyond[:, dof].argmax(0)
    return BeyondLimits(dof, frame, beyond[frame, dof], (beyond[:, dof] > SLACK).sum(0))


def said_beyond_limits(skeleton: Skeleton, motion: Motion) -> tuple[str, ...]:
    """One sentence for each DOF that leaves its limits, the worst first."""
    found = beyond_limits(skeleton, motion)
    lines = []
    for k in np.argsort(-found.excess, kind="stable"):
        dof = int(found.dof[k])
        scale, unit = (1000.0, "mm") if skeleton.dof_slides[dof] else (180.0 / np.pi, "degrees")
        low, high = skeleton.limits[dof] * scale
        lines.append(
            f"{skeleton.dof_names[dof]} is beyond its limits of {low:.0f} to {high:.0f} {unit} in {found.n_frames[k]} "
            f"frames, by {found.excess[k] * scale:.1f} {unit} in frame {found.frame[k]}"
        )
    return tuple(lines)
