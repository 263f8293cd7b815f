"""Which pairs of limbs to test (Liu et al., A4.4-A4.6)."""

from dataclasses import dataclass

import numpy as np

from mhvedit.collision.limbs import Limbs
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import IntArray


@dataclass(frozen=True, slots=True, eq=False)
class LimbPairs:
    """Pairs of limbs, the lower index first."""

    limbs: IntArray  # (P, 2)

    def __post_init__(self) -> None:
        if self.limbs.ndim != 2 or self.limbs.shape[1] != 2:
            raise ShapeError("limbs", self.limbs.shape, "(P, 2)")
        if not (self.limbs[:, 0] < self.limbs[:, 1]).all():
            raise ShapeError("limbs", self.limbs.tolist(), "the lower index first")


def all_pairs(limbs: Limbs) -> LimbPairs:
    """Every limb with every other: (N^2 - N) / 2, 253 for 23 limbs (A4.4)."""
    return LimbPairs(np.stack(np.triu_indices(limbs.n_limbs, 1), 1))


def non_adjacent_pairs(limbs: Limbs) -> LimbPairs:
    """Those that do not share a joint, where they always touch (A4.6)."""
    pairs = all_pairs(limbs).limbs
    return LimbPairs(pairs[~limbs.adjacent[pairs[:, 0], pairs[:, 1]]])
