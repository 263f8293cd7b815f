"""The interaction dictionary: when the parts of two people may touch (Shi et al., eqs 3 to 11).

Each type has its own small function from two motion history volumes to clauses; `TEMPORAL` is the table of them. A
type whose roles are swapped (`0&+` for `+&0`) is the same function with A and B swapped.

With tolerances (k frames, r voxels): some pair of voxels within r of each other satisfies the type's condition in
time, and every voxel that is really shared does, both with k frames of slack. All zero is the paper.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numba import njit

from mhvedit.constraints.clauses import Clause, Meeting, Option
from mhvedit.geometry.arrays import BoolArray, Int32Array, Words
from mhvedit.volumes.history import (
    NEVER,
    MotionHistoryVolume,
    difference,
    dilated,
    frame_mask,
    from_bits,
    trimmed,
    word_count,
)

NO_CONTACT = "no contact"
MISSES_ITS_MOMENT = "no contact at the right moment"
TOUCHES_AT_A_WRONG_MOMENT = "contact at a wrong moment"


class InteractionType(StrEnum):
    """`+` a motion's end, `-` its start, `0` anything: A's side first."""

    END_END = "+&+"
    START_START = "-&-"
    END_START = "+&-"
    START_END = "-&+"
    END_LATERAL = "+&0"
    LATERAL_END = "0&+"
    START_LATERAL = "-&0"
    LATERAL_START = "0&-"
    THROUGHOUT = "0&0a"
    SOMETIMES = "0&0b"
    PASSING = "0&0c"
    NONE = "none"

    @property
    def mirrored(self) -> "InteractionType":
        """The same interaction told with B first."""
        return MIRROR.get(self, self)

    @property
    def touches(self) -> bool:
        """Whether the interest parts are in contact at the same moment, so that they are excused from keeping apart."""
        return self not in (InteractionType.PASSING, InteractionType.NONE)


MIRROR = {
    InteractionType.END_START: InteractionType.START_END,
    InteractionType.START_END: InteractionType.END_START,
    InteractionType.END_LATERAL: InteractionType.LATERAL_END,
    InteractionType.LATERAL_END: InteractionType.END_LATERAL,
    InteractionType.START_LATERAL: InteractionType.LATERAL_START,
    InteractionType.LATERAL_START: InteractionType.START_LATERAL,
}


@dataclass(frozen=True, slots=True)
class Slack:
    """How far a contact may miss."""

    frames: int = 0
    voxels: float = 0.0


Moment = Callable[[MotionHistoryVolume, int], MotionHistoryVolume]


def temporal_clauses(
    interaction: InteractionType, a: MotionHistoryVolume, b: MotionHistoryVolume, *, slack: Slack
) -> tuple[Clause, ...]:
    """What an interaction type asks of the interest parts (Shi et al., eqs 3 to 11).

    Args:
        interaction: a type of the dictionary.
        a: interest part of the first subject.
        b: interest part of the second, of as many frames.
        slack: tolerances.
    """
    return TEMPORAL[interaction](a, b, slack)


def ending(volume: MotionHistoryVolume, slack_frames: int) -> MotionHistoryVolume:
    """Voxels whose last frame is the segment's last, as a volume of one moment."""
    return _moment(volume, volume.t_end >= max(0, volume.last - slack_frames))


def starting(volume: MotionHistoryVolume, slack_frames: int) -> MotionHistoryVolume:
    """Voxels whose first frame is the segment's first, as a volume of one moment."""
    return _moment(volume, (volume.t_start != NEVER) & (volume.t_start <= slack_frames))


def ever(volume: MotionHistoryVolume, slack_frames: int = 0) -> MotionHistoryVolume:
    """Voxels that are filled in some frame, as a volume of one moment."""
    return _moment(volume, volume.filled)


def _moment(volume: MotionHistoryVolume, chosen: BoolArray) -> MotionHistoryVolume:
    return trimmed(MotionHistoryVolume(volume.grid, chosen.astype(np.uint64)[..., None], 1))


def _touching(ever_a: MotionHistoryVolume, ever_b: MotionHistoryVolume, slack: Slack) -> Clause:
    """There are contact voxels (Shi et al., eq. 3)."""
    return Clause(NO_CONTACT, (Option(must=(Meeting(dilated(ever_a, slack.voxels), ever_b),)),))


def _at_moments(
    a: MotionHistoryVolume, b: MotionHistoryVolume, slack: Slack, when_a: Moment, when_b: Moment
) -> tuple[Clause, ...]:
    """All contact voxels are of the asked moment of A and of B (eqs 4 and 8 to 11)."""
    right_a, right_b = when_a(a, slack.frames), when_b(b, slack.frames)
    ever_a, ever_b = ever(a), ever(b)
    wrong_a, wrong_b = difference(ever_a, right_a), difference(ever_b, right_b)
    near = Meeting(dilated(right_a, slack.voxels), right_b)
    shared = tuple(m for m in (Meeting(wrong_a, ever_b), Meeting(ever_a, wrong_b)) if m.possible)
    return (
        _touching(ever_a, ever_b, slack),
        Clause(MISSES_ITS_MOMENT, (Option(must=(near,)),)),
        Clause(TOUCHES_AT_A_WRONG_MOMENT, (Option(never=shared),)),
    )


def _throughout(a: MotionHistoryVolume, b: MotionHistoryVolume, slack: Slack) -> tuple[Clause, ...]:
    """In contact in every frame (eq. 5); with slack the first and last k are excused, but never all."""
    k = min(slack.frames, (a.n_frames - 1) // 2)
    every = frame_mask(a.n_frames, range(k, a.n_frames - k))
    held = Meeting(dilated(a, slack.voxels), b, every)
    return _touching(ever(a), ever(b), slack), Clause("contact is lost in some frame", (Option(must=(held,)),))


def _sometimes(a: MotionHistoryVolume, b: MotionHistoryVolume, slack: Slack) -> tuple[Clause, ...]:
    """In contact in some frame (eq. 6)."""
    together = Meeting(dilated(a, slack.voxels), b)
    return _touching(ever(a), ever(b), slack), Clause(
        "never in contact at the same moment", (Option(must=(together,)),)
    )


def _passing(a: MotionHistoryVolume, b: MotionHistoryVolume, slack: Slack) -> tuple[Clause, ...]:
    """One passes where the other has been, in one order for all contact voxels (eq. 7)."""
    after = _one_after_other(a, b, slack, a_is_later=True)
    before = _one_after_other(a, b, slack, a_is_later=False)
    return _touching(ever(a), ever(b), slack), Clause("neither passes strictly after the other", (after, before))


def _one_after_other(a: MotionHistoryVolume, b: MotionHistoryVolume, slack: Slack, *, a_is_later: bool) -> Option:
    """The later one's t_start + k > the earlier one's t_end, told by bits: t_end against all moments in question."""
    later, earlier = (a, b) if a_is_later else (b, a)
    leaves = from_bits(earlier, _one_hot(earlier.t_end, earlier.n_frames))
    free_until = np.where(later.t_start == NEVER, NEVER, later.t_start + slack.frames)
    good = from_bits(later, _below(free_until, later.n_frames))
    bad = from_bits(later, _from(free_until, later.n_frames))
    if a_is_later:
        return Option(must=(Meeting(dilated(good, slack.voxels), leaves),), never=(Meeting(bad, leaves),))
    return Option(must=(Meeting(dilated(leaves, slack.voxels), good),), never=(Meeting(leaves, bad),))


def _one_hot(times: Int32Array, n_frames: int) -> Words:
    """(X, Y, Z, W) the bit of each voxel's time; none where it is NEVER."""
    return np.asarray(_bits_between(times, times + 1, word_count(n_frames)))


def _below(times: Int32Array, n_frames: int) -> Words:
    """(X, Y, Z, W) all bits before each voxel's time."""
    return np.asarray(_bits_between(np.zeros_like(times), np.minimum(times, n_frames), word_count(n_frames)))


def _from(times: Int32Array, n_frames: int) -> Words:
    """(X, Y, Z, W) all bits from each voxel's time on."""
    first = np.where(times == NEVER, n_frames, times)
    return np.asarray(_bits_between(first, np.full_like(first, n_frames), word_count(n_frames)))


@njit(cache=True, nogil=True)
def _bits_between(first: Int32Array, past: Int32Array, n_words: int) -> Words:
    """(X, Y, Z, W) for each voxel the bits from the first up to the one past the last, if there are any."""
    words = np.zeros((*first.shape, n_words), np.uint64)
    for x, y, z in np.ndindex(first.shape):
        for w in range(n_words):
            low, high = max(int(first[x, y, z]) - 64 * w, 0), min(int(past[x, y, z]) - 64 * w, 64)
            if low < high:
                words[x, y, z, w] = (~np.uint64(0) >> np.uint64(64 - (high - low))) << np.uint64(low)
    return words


Temporal = Callable[[MotionHistoryVolume, MotionHistoryVolume, Slack], tuple[Clause, ...]]


def _rule(when_a: Moment, when_b: Moment) -> Temporal:
    return lambda a, b, slack: _at_moments(a, b, slack, when_a, when_b)


TEMPORAL: dict[InteractionType, Temporal] = {
    InteractionType.END_END: _rule(ending, ending),
    InteractionType.START_START: _rule(starting, starting),
    InteractionType.END_START: _rule(ending, starting),
    InteractionType.START_END: _rule(starting, ending),
    InteractionType.END_LATERAL: _rule(ending, ever),
    InteractionType.LATERAL_END: _rule(ever, ending),
    InteractionType.START_LATERAL: _rule(starting, ever),
    InteractionType.LATERAL_START: _rule(ever, starting),
    InteractionType.THROUGHOUT: _throughout,
    InteractionType.SOMETIMES: _sometimes,
    InteractionType.PASSING: _passing,
    InteractionType.NONE: lambda a, b, slack: (),
}
