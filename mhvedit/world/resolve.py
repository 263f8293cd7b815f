"""Removes the overlap of a figure, frame by frame, so that no overlap is left or the frame says why.

Cyclic coordinate descent (the paper's way) moves one limb at a time towards one goal and does not know of the others,
damped least squares takes all overlaps at once, and posture prediction those gaps that are about to close as well and
stays as near to the tracked posture as can be. Going back towards the last free posture always works while nothing has
moved into that. In which order they are tried is a setting; docs/world.md has what each adds, measured.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from mhvedit.avoidance.posture import limits_around, place
from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.world.cones import into_cones, leaves_cone
from mhvedit.world.depth import TOLERANCE
from mhvedit.world.problems import WorldError
from mhvedit.world.surroundings import Frames, Seen, Surroundings
from mhvedit.world.ways_out import descended, predicted, squared

HALVINGS: Final = 10
FADED: Final = 1e-4  # rad or m: a correction this small is dropped
WORSE: Final = 2.0  # a stage that makes the overlap so many times deeper is given up


class Stage(StrEnum):
    """What had the last word in a frame."""

    FREE = "free"
    POSTURE = "posture prediction"
    LEAST_SQUARES = "damped least squares"
    DESCENT = "cyclic coordinate descent"
    BACK = "back towards the last free posture"
    STUCK = "stuck"


@dataclass(frozen=True, slots=True)
class ResolveSettings:
    """Which methods are tried, and how hard."""

    stages: tuple[Stage, ...] = (Stage.POSTURE, Stage.BACK, Stage.LEAST_SQUARES, Stage.DESCENT)
    iterations: int = 6  # of descent and of least squares
    attraction: float = 0.15  # share of a correction that fades in a frame (C3.7)
    jump: float = 0.5  # rad or m in a frame, from which a correction is not carried on


PAPER: Final = ResolveSettings((Stage.DESCENT, Stage.BACK))
CHEAPEST_FIRST: Final = ResolveSettings((Stage.DESCENT, Stage.LEAST_SQUARES, Stage.POSTURE, Stage.BACK))


@dataclass(frozen=True, slots=True, eq=False)
class Resolved:
    """A posture without overlap, or the reason why there is none."""

    q: FloatArray  # (D,) rad or m
    stage: Stage
    iterations: int
    deepest: float  # m, overlap that is left
    reason: str  # why it is stuck, or what was wrong with the tracked posture; mostly empty

    @property
    def free(self) -> bool:
        """Whether no overlap is left."""
        return self.stage is not Stage.STUCK


@dataclass(frozen=True, slots=True, eq=False)
class Before:
    """What the frame before left."""

    q: FloatArray  # (D,) its posture
    tracked: FloatArray  # (D,) what it was to be
    free: bool


def start_posture(tracked: FloatArray, before: Before | None, settings: ResolveSettings) -> FloatArray:
    """The tracked posture with the last frame's correction, a little faded: warm start and attraction in one (C3.7).

    Args:
        tracked: (D,) rad or m.
        before: the last frame.
        settings: how fast a correction fades, and from which jump of the tracker it is dropped.
    """
    if before is None or np.abs(tracked - before.tracked).max() > settings.jump:
        return tracked
    correction = (1.0 - settings.attraction) * (before.q - before.tracked)
    return tracked + np.where(np.abs(correction) > FADED, correction, 0.0)


def resolve(
    surroundings: Surroundings,
    tracked: FloatArray,
    frames: Frames,
    *,
    before: Before | None = None,
    rng: np.random.Generator | None = None,
    settings: ResolveSettings | None = None,
) -> Resolved:
    """Find a posture near the tracked one in which nothing overlaps.

    Args:
        surroundings: the figure and the bodies round it.
        tracked: (D,) the posture that is wanted, rad or m; where it is not finite the last one is held.
        frames: where the bodies are.
        before: the last frame, from which the search starts and to which it goes back.
        rng: order of the chains; seeded with 0 by default.
        settings: which methods, and how hard.

    Returns:
        The posture, which stage found it, and the reason where none did.

    Raises:
        ShapeError: the posture is of another skeleton.
        WorldError: the first tracked posture has numbers that are not finite.
    """
    n_dofs = surroundings.figure.skeleton.n_dofs
    if tracked.shape != (n_dofs,):
        raise ShapeError("tracked", tracked.shape, f"({n_dofs},)")
    chosen, held = settings or ResolveSettings(), ""
    if not np.isfinite(tracked).all():
        dof = surroundings.figure.skeleton.dof_names[int(np.argmin(np.isfinite(tracked)))]
        if before is None:
            raise WorldError(f"{dof} of the first tracked posture", "a finite number", "NaN or infinity")
        tracked, held = before.tracked, f"the tracker gives no number for {dof}, and its last posture is held"
    search = _Search(surroundings, frames, tracked, before, rng or np.random.default_rng(0), chosen)
    return search.run(held)


class _Search:
    """One frame: the stages in order, each from the best posture so far."""

    def __init__(
        self,
        surroundings: Surroundings,
        frames: Frames,
        tracked: FloatArray,
        before: Before | None,
        rng: np.random.Generator,
        settings: ResolveSettings,
    ) -> None:
        self.surroundings, self.frames, self.tracked, self.before = surroundings, frames, tracked, before
        self.rng, self.settings, self.figure = rng, settings, surroundings.figure
        self.limits = limits_around(self.figure.skeleton.limits, tracked)
        self.iterations = 0

    def run(self, held: str) -> Resolved:
        """See `resolve`."""
        start = self.within_limits(start_posture(self.tracked, self.before, self.settings))
        seen = self.look(start)
        if _is_free(seen):
            return self.result(seen, Stage.FREE, held)
        stages: dict[Stage, Callable[[Seen], Seen]] = {
            Stage.POSTURE: self.posture,
            Stage.LEAST_SQUARES: lambda at: self.repeated(at, lambda each: squared(each, self.figure)),
            Stage.DESCENT: lambda at: self.repeated(at, lambda each: descended(each, self.figure, self.rng)),
            Stage.BACK: lambda at: self.returned(at, start),
        }
        for stage in self.settings.stages:
            after = stages[stage](seen)
            if _is_free(after):
                return self.result(after, stage, held)
            seen = min((seen, after), key=lambda each: each.gaps.deepest)
        return self.result(seen, Stage.STUCK, self.reason(seen))

    def repeated(self, seen: Seen, better: Callable[[Seen], FloatArray]) -> Seen:
        """The first free posture that steps of one kind lead to, or the least deep."""
        best = seen
        for _ in range(self.settings.iterations):
            self.iterations += 1
            seen = self.look(self.within_limits(better(seen)))
            if _is_free(seen) or seen.gaps.deepest > WORSE * best.gaps.deepest + TOLERANCE:
                break
            best = min((best, seen), key=lambda each: each.gaps.deepest)
        return min((best, seen), key=lambda each: each.gaps.deepest)

    def posture(self, seen: Seen) -> Seen:
        """By posture prediction."""
        q, used = predicted(self.surroundings, self.frames, self.tracked, start=seen.placed.q, limits=self.limits)
        self.iterations += used
        return self.look(self.within_limits(q))

    def returned(self, seen: Seen, start: FloatArray) -> Seen:
        """The farthest free posture that bisection finds on the way from the last free one to the wanted one (C2.3)."""
        if self.before is None or not self.before.free:
            return seen
        free = self.before.q
        best = self.look(free)
        if not _is_free(best):
            return seen
        share, step = 1.0, 0.5
        for _ in range(HALVINGS):
            share -= step
            step /= 2
            seen = self.look(free + share * (start - free))
            if _is_free(seen):
                best = seen
                share += 2 * step
        return best

    def look(self, q: FloatArray) -> Seen:
        """Overlaps of a posture."""
        return self.surroundings.look(q, self.frames, reach=0.0)

    def within_limits(self, q: FloatArray) -> FloatArray:
        """The posture inside limits and reach cones."""
        skeleton, cones = self.figure.skeleton, self.figure.cones
        q = np.clip(q, self.limits[:, 0], self.limits[:, 1])
        if cones and leaves_cone(skeleton, place(skeleton, q).rotations, cones):
            return np.clip(into_cones(skeleton, q, cones), self.limits[:, 0], self.limits[:, 1])
        return q

    def result(self, seen: Seen, stage: Stage, reason: str) -> Resolved:
        """What the search hands back."""
        return Resolved(seen.placed.q, stage, self.iterations, seen.gaps.deepest, reason)

    def reason(self, seen: Seen) -> str:
        """Which overlap is left, and why there is no way back."""
        worst = int(np.argmin(seen.gaps.distance))
        a, b = (self.surroundings.name(int(piece)) for piece in seen.gaps.pairs[worst])
        back = "something has moved into the last free posture"
        if self.before is None or not self.before.free:
            back = "no free posture came before"
        return f"{a} is {1000 * seen.gaps.deepest:.1f} mm inside {b}, and {back}"


def _is_free(seen: Seen) -> bool:
    """Whether overlap is within the tolerance."""
    return seen.gaps.deepest <= TOLERANCE


def stage_counts(resolved: Sequence[Resolved]) -> dict[Stage, int]:
    """In how many frames each stage had the last word."""
    return {stage: sum(each.stage is stage for each in resolved) for stage in Stage}
