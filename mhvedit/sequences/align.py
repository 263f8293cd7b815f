"""The scene's time line: key segments of any number of people, and what precedes, separates and follows them.

Everybody goes through the own key segments in the own order, and a key segment begins for both of its people at once.
What lies between is retimed so that this comes out. Where both come from the same frame of the scene the longer one
gives up frames (Shi et al., section 3.2). Where one was busy for longer, that one keeps its pace and the other fits in:
this is the start at which the two stretches together are changed least, as a sum of logarithms. Nobody is hurried or
slowed before the first or after the last key segment for the sake of those who are busy: who has too few frames there
stands still.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce

import numpy as np

from mhvedit.geometry.arrays import IntArray
from mhvedit.sequences.segments import Retiming, SegmentPair, paired, retimed, round_half_up


@dataclass(frozen=True, slots=True)
class KeyRange:
    """A key segment as the editor gives it."""

    between: tuple[str, str]  # A, B
    a: range  # frame numbers of A
    b: range  # frame numbers of B
    retime: Retiming


@dataclass(frozen=True, slots=True)
class FramesOf:
    """Some frames of a subject's."""

    subject: str
    frame: int  # of the scene, where they are or would have been
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class TimeLine:
    """Who shows which captured frame when."""

    n_frames: int
    spans: tuple[range, ...]  # (I,) frames of the scene that each key segment takes
    sources: Mapping[str, IntArray]  # (N,) frame numbers, by subject
    left_out: tuple[FramesOf, ...]  # captured frames that are lost because there is no time for them
    held: tuple[FramesOf, ...]  # frames of the scene in which somebody stands still for want of captured ones


@dataclass(slots=True)
class _Progress:
    """How far a subject has got."""

    rate: float  # the scene's frames per frame of the capture
    numbers: IntArray  # (T,) frames that the capture has
    shown: int  # first frame number that is not used up
    begun: bool = False  # whether a key segment has been
    pieces: list[IntArray] = field(default_factory=list)

    @property
    def end(self) -> int:
        """Frames of the scene that are filled."""
        return sum(map(len, self.pieces))

    def until(self, stop: int) -> IntArray:
        """Frames from here to before a frame number."""
        return self.numbers[(self.numbers >= self.shown) & (self.numbers < stop)]

    def lasting(self, frames: IntArray) -> int:
        """How many frames of the scene some frames of the capture take."""
        return max(round_half_up(len(frames) * self.rate), 1) if len(frames) else 0


def key_pair(key: KeyRange, *, rates: tuple[float, float] = (1.0, 1.0)) -> SegmentPair:
    """The frames of a key segment, both at one length (Shi et al., eqs 12 and 13)."""
    return paired(np.array(key.a), np.array(key.b), how=key.retime, rates=rates)


def time_line(keys: Sequence[KeyRange], numbers: Mapping[str, IntArray], *, rates: Mapping[str, float]) -> TimeLine:
    """Lay out the scene.

    Args:
        keys: in an order that is that of each subject's own, not overlapping.
        numbers: (T,) frames that each capture has, by subject.
        rates: the scene's frames per frame of each capture, by subject.
    """
    people = {name: _Progress(rates[name], own, int(own[0])) for name, own in numbers.items()}
    spans, left_out, held = list[range](), list[FramesOf](), list[FramesOf]()
    for key in keys:
        a, b = (people[name] for name in key.between)
        pair = key_pair(key, rates=(a.rate, b.rate))
        gaps = a.until(key.a.start), b.until(key.b.start)
        start = _start(a, gaps[0], b, gaps[1])
        for name, gap, frames, stop in zip(key.between, gaps, (pair.a, pair.b), (key.a.stop, key.b.stop), strict=True):
            own = people[name]
            _fill(name, own, gap, start - own.end, int(frames[0]), left_out, held)
            own.pieces.append(frames)
            own.shown, own.begun = stop, True
        spans.append(range(start, start + pair.n_frames))
    n_frames = _scene_end(keys, people)
    for name, own in people.items():
        rest = own.until(int(own.numbers[-1]) + 1)
        _end(name, own, rest, n_frames - own.end, left_out, held)
    sources = {name: np.concatenate(own.pieces) for name, own in people.items()}
    return TimeLine(n_frames, tuple(spans), sources, tuple(left_out), tuple(held))


def _start(a: _Progress, gap_a: IntArray, b: _Progress, gap_b: IntArray) -> int:
    """When a key segment of two begins."""
    if a.end == b.end and a.begun == b.begun:
        return a.end + (min(a.lasting(gap_a), b.lasting(gap_b)) if min(len(gap_a), len(gap_b)) else 0)
    late, gap = (a, gap_a) if (a.begun, a.end) > (b.begun, b.end) else (b, gap_b)
    return late.end + late.lasting(gap)


def _fill(
    name: str,
    own: _Progress,
    gap: IntArray,
    count: int,
    following: int,
    left_out: list[FramesOf],
    held: list[FramesOf],
) -> None:
    """What a subject shows for so many frames before a key segment that begins with the frame number `following`."""
    if count == 0:
        if len(gap):
            left_out.append(FramesOf(name, own.end, len(gap)))
        return
    moving = count if own.begun else min(count, own.lasting(gap))
    if len(gap) == 0:
        moving = 0
    if moving < count:
        still = int(own.pieces[-1][-1]) if own.begun else int(gap[0]) if len(gap) else following
        held.append(FramesOf(name, own.end, count - moving))
        own.pieces.append(np.full(count - moving, still))
    own.pieces.append(gap[retimed(len(gap), moving, Retiming.ENDPOINTS)])


def _end(name: str, own: _Progress, rest: IntArray, count: int, left_out: list[FramesOf], held: list[FramesOf]) -> None:
    """What a subject shows for so many frames after its last key segment; one that has none runs at its own pace."""
    moving = min(count, own.lasting(rest))
    lost = len(rest) if moving == 0 else 0
    if not own.begun and moving < own.lasting(rest):
        lost = len(rest) - max(1, round_half_up(moving / own.rate))
        rest = rest[: len(rest) - lost]
    if lost:
        left_out.append(FramesOf(name, own.end + moving, lost))
    own.pieces.append(rest[retimed(len(rest), moving, Retiming.ENDPOINTS)] if moving else rest[:0])
    if moving < count:
        still = np.concatenate(own.pieces)[-1]
        held.append(FramesOf(name, own.end, count - moving))
        own.pieces.append(np.full(count - moving, still))


def _scene_end(keys: Sequence[KeyRange], people: Mapping[str, _Progress]) -> int:
    """When it is over: for each group of people that have to do with each other, with those whose segment is last."""
    groups: list[set[str]] = reduce(_joined, (set(key.between) for key in keys), [])
    ends = []
    for group in groups:
        busy = max(people[name].end for name in group)
        last = [people[name] for name in group if people[name].end == busy]
        rests = [own.lasting(own.until(int(own.numbers[-1]) + 1)) for own in last]
        ends.append(busy + min(rests))
    return max(ends)


def _joined(groups: list[set[str]], pair: set[str]) -> list[set[str]]:
    """Groups of people when a pair more belongs together."""
    touched = [group for group in groups if group & pair]
    return [group for group in groups if not group & pair] + [pair.union(*touched)]
