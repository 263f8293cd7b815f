"""Recursive bisection: posture prediction in few frames, interpolation in the others (Degenhardt, 3.2; Nebel 1999).

A motion is a set of curves, one a DOF, with a key in every frame. Of each run of colliding frames the middle one is
predicted anew, the keys around it are deleted and the curves evaluated in their place; what still collides is
treated in the same way on both sides of it. The curves can hold the DOFs themselves, as in the thesis, or how far they
are from the captured ones, which keeps the detail of the captured motion between the keys.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

from mhvedit.avoidance.posture import Posture
from mhvedit.geometry.arrays import BoolArray, FloatArray, IntArray
from mhvedit.geometry.flags import runs_of

Predict = Callable[[int, FloatArray, int], Posture]  # frame, (T, D) curves, frames to the next key: a free posture
Collides = Callable[[IntArray, FloatArray], BoolArray]  # (K,) frames and their (K, D) postures to (K,)
Settle = Callable[[IntArray, FloatArray], FloatArray]  # (K,) frames and their (K, D) postures to others that keep tasks
LONG = 1000  # frames: further than any key


class Interpolation(StrEnum):
    """How curves run between keys."""

    LINEAR = "linear"
    QUADRATIC = "quadratic"  # a parabola through the ends and the middle
    CARDINAL = "cardinal"  # middles of middles
    SMOOTH = "smooth"  # monotone cubics, without a kink at the keys


@dataclass(frozen=True, slots=True)
class BisectionSettings:
    """The thesis's parameters, and what it leaves open."""

    interpolation: Interpolation = Interpolation.SMOOTH
    of_changes: bool = True  # curves hold the change of the captured motion, and not the motion
    smooth: float = 50.0  # percent of a group that the interpolation goes beyond it on each side
    blend: int = 6  # frames that it goes beyond it at least
    least_buffer: int = 0  # frames; groups of fewer than 2 n + 1 frames are left to the last pass
    rounds: int = 6  # over the whole motion, because buffers may bring new collisions
    evaluation: tuple[int, ...] = ()  # frames that have to keep the character of the motion


@dataclass(frozen=True, slots=True, eq=False)
class Bisected:
    """Curves after bisection."""

    q: FloatArray  # (T, D) rad or m
    predicted: IntArray  # frames that were predicted, ascending
    predictions: int  # how many predictions that took
    colliding: IntArray  # frames that still collide


def collision_groups(colliding: BoolArray, *, start: int = 0) -> list[tuple[int, int]]:
    """Runs of colliding frames, first and last; the one that is open at the end is closed there.

    >>> collision_groups(np.array([True, True, False, True]), start=10)
    [(10, 11), (13, 13)]
    """
    return [(start + run[0], start + run[-1]) for run in runs_of(colliding)]


def bisect(
    captured: FloatArray,
    *,
    predict: Predict,
    collides: Collides,
    limits: FloatArray,
    settle: Settle | None = None,
    settings: BisectionSettings | None = None,
) -> Bisected:
    """Remove the collisions of a motion by recursive bisection (Degenhardt, figures 3.2, 3.8 and 3.14).

    Args:
        captured: (T, D) rad or m.
        predict: a posture without collision for a frame, given the curves as they are.
        collides: which postures collide.
        limits: (T, D, 2) what interpolation is clamped to.
        settle: what interpolated postures go through, to keep what predicted ones keep.
        settings: of the recursion.
    """
    curves = _Curves(captured, limits, settings or BisectionSettings(), settle)
    run = _Run(curves, predict, collides)
    _fix_evaluation_points(run)
    for _ in range(curves.settings.rounds):
        groups = run.groups(0, curves.last)
        large = [group for group in groups if group[1] - group[0] + 1 >= 2 * curves.settings.least_buffer + 1]
        if not large:
            break
        for first, last in large:
            _bisect_range(run, first, last)
    for first, last in run.groups(0, curves.last):
        for frame in range(first, last + 1):
            run.fix(frame, *curves.between(frame))
    return run.result()


def check_and_correct(
    captured: FloatArray, *, predict: Predict, collides: Collides, limits: FloatArray, keys: Sequence[int]
) -> Bisected:
    """Nebel's CheckAndCorrect, as a baseline (Degenhardt, figure 1.4).

    The motion is what interpolates its key frames. Of each interval the *first* collision is corrected and becomes a
    sub-key; the same is then done on both sides of it.

    Args:
        captured: (T, D) rad or m.
        predict: as for `bisect`.
        collides: as for `bisect`.
        limits: (T, D, 2) rad or m.
        keys: key frames; the first and the last are always among them.
    """
    curves = _Curves(captured, limits, BisectionSettings(Interpolation.LINEAR, of_changes=False))
    run = _Run(curves, predict, collides)
    frames = sorted({0, curves.last, *keys})
    for frame in np.array(frames)[run.colliding(np.array(frames))]:
        run.fix(int(frame))
    for first, last in pairwise(frames):
        curves.delete(first + 1, last - 1)
    waiting = list(pairwise(frames))
    while waiting:
        first, last = waiting.pop()
        groups = run.groups(first + 1, last - 1)
        if groups:
            run.fix(groups[0][0], first + 1, last - 1)
            curves.evaluate(first, last)
            waiting += [(first, groups[0][0]), (groups[0][0], last)]
    return run.result()


class _Curves:
    """One curve a DOF with its keys."""

    def __init__(
        self, captured: FloatArray, limits: FloatArray, settings: BisectionSettings, settle: Settle | None = None
    ) -> None:
        self.captured, self.limits, self.settings, self.settle = captured, limits, settings, settle
        self.q = captured.copy()
        self.is_key = np.ones(len(captured), np.bool_)

    @property
    def last(self) -> int:
        """The last frame."""
        return len(self.q) - 1

    def set_key(self, frame: int, posture: FloatArray) -> None:
        """Put a key."""
        self.q[frame], self.is_key[frame] = posture, True

    def delete(self, first: int, last: int) -> None:
        """Take the keys of a range away, but never the first or last of the motion, and evaluate the curves there."""
        self.is_key[max(first, 1) : min(last, self.last - 1) + 1] = False
        self.evaluate(first, last)

    def evaluate(self, first: int, last: int) -> None:
        """Evaluate the curves between keys, over a range and the keys about it."""
        keys = np.flatnonzero(self.is_key)
        low = max(int(np.searchsorted(keys, first, "right")) - 3, 0)
        keys = keys[low : int(np.searchsorted(keys, last)) + 3]
        frames = np.arange(keys[0], keys[-1] + 1)
        frames = frames[~self.is_key[frames]]
        if len(frames) == 0:
            return
        base = self.captured if self.settings.of_changes else np.zeros_like(self.captured)
        values = _INTERPOLATE[self.settings.interpolation](keys, (self.q - base)[keys], frames)
        q = np.clip(values + base[frames], self.limits[frames, :, 0], self.limits[frames, :, 1])
        self.q[frames] = q if self.settle is None else self.settle(frames, q)

    def between(self, frame: int) -> tuple[int, int]:
        """The frames about a frame that hold no key."""
        keys = np.flatnonzero(self.is_key)
        before, after = keys[keys < frame], keys[keys > frame]
        return int(before[-1]) + 1 if len(before) else 0, int(after[0]) - 1 if len(after) else self.last

    def room(self, first: int, last: int, fixed: set[int]) -> tuple[int, int]:
        """A group with its buffer, clamped to the motion and to the nearest frames that are fixed."""
        buffer = max(round((last - first) * self.settings.smooth / 100), self.settings.blend)
        low = max([frame + 1 for frame in fixed if frame < first], default=0)
        high = min([frame - 1 for frame in fixed if frame > last], default=self.last)
        return max(first - buffer, low), min(last + buffer, high)


class _Run:
    """The recursion's memory: curves, what is fixed, how often was predicted, and what is known to collide."""

    def __init__(self, curves: _Curves, predict: Predict, collides: Collides) -> None:
        self.curves, self.predict, self.collides = curves, predict, collides
        self.fixed, self.hopeless = set[int](), set[int]()
        self.predictions = 0
        self._looked_at = np.full_like(curves.q, np.nan)
        self._collides = np.zeros(len(curves.q), np.bool_)

    def fix(self, frame: int, low: int | None = None, high: int | None = None) -> None:
        """Predict the posture of a frame and make it a key; low to high will be interpolated next."""
        away = min(
            frame - (frame if low is None else low) + 1 if frame > 0 else LONG,
            (frame if high is None else high) - frame + 1 if frame < self.curves.last else LONG,
        )
        posture = self.predict(frame, self.curves.q, away)
        self.curves.set_key(frame, posture.q)
        self.fixed.add(frame)
        self.predictions += 1
        if not posture.converged:
            self.hopeless.add(frame)

    def colliding(self, frames: IntArray) -> BoolArray:
        """(K,) which frames collide; only those that changed since are looked at again."""
        now = self.curves.q[frames]
        changed = (now != self._looked_at[frames]).any(1)
        if changed.any():
            self._collides[frames[changed]] = self.collides(frames[changed], now[changed])
            self._looked_at[frames[changed]] = now[changed]
        return np.asarray(self._collides[frames])

    def groups(self, first: int, last: int) -> list[tuple[int, int]]:
        """Collision groups of a range, without the frames that prediction cannot help."""
        if last < first:
            return []
        frames = np.arange(first, last + 1)
        return collision_groups(self.colliding(frames) & ~np.isin(frames, list(self.hopeless)), start=first)

    def result(self) -> Bisected:
        """What came of it."""
        left = np.flatnonzero(self.colliding(np.arange(self.curves.last + 1)))
        return Bisected(self.curves.q, np.array(sorted(self.fixed), np.int64), self.predictions, left)


def _bisect_range(run: _Run, first: int, last: int) -> None:
    """Bisect a group, then what still collides on both sides of its middle."""
    waiting = [(first, last)]
    while waiting:
        start, end = waiting.pop()
        middle = start + (end - start) // 2
        low, high = run.curves.room(start, end, run.fixed - {middle})
        run.fix(middle, low, high)
        run.curves.delete(low, middle - 1)
        run.curves.delete(middle + 1, high)
        least = 2 * run.curves.settings.least_buffer + 1
        for side in ((start, middle - 1), (middle + 1, end)):
            waiting += [group for group in run.groups(*side) if group[1] - group[0] + 1 >= least]


def _fix_evaluation_points(run: _Run) -> None:
    """Fix the first, the last and the evaluation frames where they collide (Degenhardt, 3.2.2)."""
    wanted = np.array(sorted({0, run.curves.last, *run.curves.settings.evaluation}))
    for frame in wanted[run.colliding(wanted)]:
        first, last = next(group for group in run.groups(0, run.curves.last) if group[0] <= frame <= group[1])
        run.fix(int(frame), *run.curves.room(first, last, run.fixed))
    for frame in sorted(run.fixed):
        for first, last in run.groups(max(frame - 1, 0), min(frame + 1, run.curves.last)):
            if first != last or first != frame:
                _refill(run, frame)
                break


def _refill(run: _Run, frame: int) -> None:
    """Delete the colliding keys next to a fixed frame, and evaluate the curves there."""
    everything = run.groups(0, run.curves.last)
    for first, last in everything:
        if first - 1 <= frame <= last + 1:
            low = max([other + 1 for other in run.fixed if other < min(first, frame)], default=first)
            high = min([other - 1 for other in run.fixed if other > max(last, frame)], default=last)
            run.curves.delete(max(first, low), min(last, frame - 1))
            run.curves.delete(max(first, frame + 1), min(last, high))


def _linear(keys: IntArray, values: FloatArray, frames: IntArray) -> FloatArray:
    return np.stack([np.interp(frames, keys, column) for column in values.T], 1)


def _quadratic(keys: IntArray, values: FloatArray, frames: IntArray) -> FloatArray:
    """A parabola through each three keys with frames to fill between them (the thesis's appendix), else straight."""
    out = _linear(keys, values, frames)
    i = 0
    while i + 2 < len(keys):
        x1, x2, x3 = (float(key) for key in keys[i : i + 3])
        if x2 - x1 <= 1 or x3 - x2 <= 1:
            i += 1
            continue
        y1, y2, y3 = values[i : i + 3]
        over = (x1 - x3) * (x2**2 - x1**2) + (x2 - x1) * (x3**2 - x1**2)
        a = ((y2 - y1) * (x1 - x3) + (y3 - y1) * (x2 - x1)) / over
        b = ((y2 - y1) - a * (x2**2 - x1**2)) / (x2 - x1)
        inside = (frames > x1) & (frames < x3)
        x = frames[inside, None].astype(np.float64)
        out[inside] = y1 - a * x1**2 - b * x1 + (a * x + b) * x
        i += 2
    return out


def _cardinal(keys: IntArray, values: FloatArray, frames: IntArray) -> FloatArray:
    """Middles first: each is half way between the keys or middles about it."""
    known = dict(zip(keys.tolist(), values, strict=True))
    spans = list(pairwise(keys.tolist()))
    while spans:
        first, last = spans.pop()
        if last - first > 1:
            middle = (first + last) // 2
            share = (middle - first) / (last - first)
            known[middle] = (1 - share) * known[first] + share * known[last]
            spans += [(first, middle), (middle, last)]
    return np.stack([known[frame] for frame in frames.tolist()])


def _smooth(keys: IntArray, values: FloatArray, frames: IntArray) -> FloatArray:
    if len(keys) < 2:
        return _linear(keys, values, frames)
    return np.asarray(PchipInterpolator(keys, values)(frames))


_INTERPOLATE: dict[Interpolation, Callable[[IntArray, FloatArray, IntArray], FloatArray]] = {
    Interpolation.LINEAR: _linear,
    Interpolation.QUADRATIC: _quadratic,
    Interpolation.CARDINAL: _cardinal,
    Interpolation.SMOOTH: _smooth,
}
