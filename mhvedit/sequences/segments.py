"""Segments, and bringing both people of a pair to one length (Shi et al., eqs 12 and 13)."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from mhvedit.geometry.arrays import IntArray


class Retiming(StrEnum):
    """How the longer of two ranges gives up frames."""

    ENDPOINTS = "endpoints"  # first and last frame are kept
    FLOOR = "floor"  # the paper's; never reaches the longer one's last frame


@dataclass(frozen=True, slots=True, eq=False)
class SegmentPair:
    """A stretch of the edited scene in which two subjects are shown frame by frame."""

    a: IntArray  # (tau,) frame numbers of A
    b: IntArray  # (tau,) frame numbers of B

    @property
    def n_frames(self) -> int:
        """Length tau of the stretch."""
        return len(self.a)


def retimed(length: int, count: int, how: Retiming) -> IntArray:
    """Which frames of a range to show so that it lasts as long as a shorter one (Shi et al., eqs 12 and 13).

    Args:
        length: frames of the range.
        count: frames wanted.
        how: the rule.

    Returns:
        (count,) indices into the range.

    >>> retimed(7, 4, Retiming.ENDPOINTS).tolist(), retimed(7, 4, Retiming.FLOOR).tolist()
    ([0, 2, 4, 6], [0, 1, 3, 5])
    """
    steps = np.arange(count)
    if count == 0 or how is Retiming.FLOOR:
        return steps * length // max(count, 1)
    if count == 1:
        return np.zeros(1, np.int64)
    return np.asarray((2 * steps * (length - 1) + count - 1) // (2 * (count - 1)), np.int64)


def shared_length(length_a: int, length_b: int, *, rates: tuple[float, float]) -> int:
    """How many frames a pair of ranges takes in the scene: those of the one that is over sooner.

    Args:
        length_a: frames of A.
        length_b: frames of B.
        rates: for each the scene's frames per frame of the capture (1 where both run at the same fps).
    """
    lasting = [round_half_up(n * rate) for n, rate in zip((length_a, length_b), rates, strict=True)]
    shortest = min(lasting)
    return max(shortest, 1) if min(length_a, length_b) > 0 else 0


def paired(a: IntArray, b: IntArray, *, how: Retiming, rates: tuple[float, float] = (1.0, 1.0)) -> SegmentPair:
    """Bring two ranges of frames to one length.

    Args:
        a: frame numbers of A, in order.
        b: frame numbers of B.
        how: the rule.
        rates: as in `shared_length`.
    """
    count = shared_length(len(a), len(b), rates=rates)
    return SegmentPair(a[retimed(len(a), count, how)], b[retimed(len(b), count, how)])


def round_half_up(value: float) -> int:
    """Nearest whole number, halves upwards.

    >>> round_half_up(2.5), round_half_up(3.49)
    (3, 3)
    """
    return int(np.floor(value + 0.5))
