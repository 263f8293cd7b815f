"""The scene's time line: key segments and what precedes, separates and follows them, brought to one length for both."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import IntArray
from mhvedit.sequences.segments import Retiming, SegmentPair, paired


@dataclass(frozen=True, slots=True)
class KeyRange:
    """A key segment as the editor gives it."""

    a: range  # frame numbers of A
    b: range  # frame numbers of B
    retime: Retiming


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """A stretch of the scene; transitional where it belongs to no key segment."""

    pair: SegmentPair
    start: int  # first frame in the scene
    segment: int | None  # index of the key segment
    left_out: tuple[int, int]  # frames of A and B that are lost because the other has none here

    @property
    def stop(self) -> int:
        """Past the last frame in the scene."""
        return self.start + self.pair.n_frames


def key_pair(key: KeyRange, *, rates: tuple[float, float] = (1.0, 1.0)) -> SegmentPair:
    """The frames of a key segment, both at one length (Shi et al., eqs 12 and 13)."""
    return paired(np.array(key.a), np.array(key.b), how=key.retime, rates=rates)


def time_line(
    keys: Sequence[KeyRange], numbers_a: IntArray, numbers_b: IntArray, *, rates: tuple[float, float] = (1.0, 1.0)
) -> tuple[Stretch, ...]:
    """Lay out the scene; empty stretches are left out.

    Args:
        keys: in order, not overlapping.
        numbers_a: (T,) frames that A's capture has.
        numbers_b: (T,) frames that B's capture has.
        rates: for each the scene's frames per frame of the capture.
    """
    stretches: list[Stretch] = []
    done_a, done_b = int(numbers_a[0]), int(numbers_b[0])
    for index, key in enumerate(keys):
        between = _between(numbers_a, done_a, key.a.start), _between(numbers_b, done_b, key.b.start)
        stretches.append(_transition(between, stretches, rates))
        stretches.append(Stretch(key_pair(key, rates=rates), _end(stretches), index, (0, 0)))
        done_a, done_b = key.a.stop, key.b.stop
    rest = _between(numbers_a, done_a, int(numbers_a[-1]) + 1), _between(numbers_b, done_b, int(numbers_b[-1]) + 1)
    stretches.append(_transition(rest, stretches, rates))
    return tuple(s for s in stretches if s.pair.n_frames > 0 or any(s.left_out))


def _between(numbers: IntArray, start: int, stop: int) -> IntArray:
    return numbers[(numbers >= start) & (numbers < stop)]


def _transition(between: tuple[IntArray, IntArray], stretches: list[Stretch], rates: tuple[float, float]) -> Stretch:
    pair = paired(*between, how=Retiming.ENDPOINTS, rates=rates)
    lost = (len(between[0]), len(between[1])) if pair.n_frames == 0 else (0, 0)
    return Stretch(pair, _end(stretches), None, lost)


def _end(stretches: list[Stretch]) -> int:
    return stretches[-1].stop if stretches else 0
