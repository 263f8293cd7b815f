"""Every pose of a segment's grid against every constraint: the map of what accepted or first rejected each pose.

Yaws are shared out to threads. Kernels that are done in a few microseconds, here and in what is called, keep Python's
lock: to hand it on and get it back takes longer. They have no branches, so that many poses are looked at together.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from threading import local

import numpy as np
from numba import njit

from mhvedit.constraints.clauses import Clause, Option
from mhvedit.constraints.visibility import NOT_SEEN_BY_A, NOT_SEEN_BY_B
from mhvedit.geometry.arrays import BoolArray, ByteArray
from mhvedit.geometry.runs import byte_counts
from mhvedit.search.columns import Columns, TurnedColumns, turned
from mhvedit.search.facing import Facing, facings_of
from mhvedit.search.meet import meets
from mhvedit.search.poses import PoseGrid
from mhvedit.search.pyramid import Room, TurnedPyramid, room_for, turned_pyramid
from mhvedit.search.scratch import Scratch
from mhvedit.search.sight import MutualSight, a_sees_b, b_sees_a, whole_columns
from mhvedit.volumes.history import MotionHistoryVolume

ACCEPTED, OUTSIDE = 0, 1
BASE_REASONS = ("accepted", "outside the window")
PORTIONS = 32  # in which the yaws are handed to the threads


@dataclass(frozen=True, slots=True, eq=False)
class ReasonMap:
    """What accepted or first rejected each pose of a grid."""

    grid: PoseGrid
    reason: ByteArray  # (X, Y, Yaw) index into reasons; of a search it lies in memory as `by_yaw`
    reasons: tuple[str, ...]  # 0: accepted, 1: outside the window, then the constraints in order

    @property
    def by_yaw(self) -> ByteArray:
        """(Yaw, X, Y) the reasons, in one piece."""
        return np.ascontiguousarray(self.reason.transpose(2, 0, 1))

    @property
    def accepted(self) -> BoolArray:
        """(X, Y, Yaw)."""
        return np.asarray(self.reason == ACCEPTED)

    def counts(self) -> dict[str, int]:
        """How many poses each reason took."""
        numbers = byte_counts(self.reason, len(self.reasons))
        return {name: int(n) for name, n in zip(self.reasons, numbers, strict=True)}


def map_by_yaw(grid: PoseGrid, reason: ByteArray, reasons: tuple[str, ...]) -> ReasonMap:
    """A map from its (Yaw, X, Y) reasons."""
    return ReasonMap(grid, reason.transpose(1, 2, 0), reasons)


@dataclass(frozen=True, slots=True, eq=False)
class SightTest:
    """Mutual visibility, with all that can be seen of either."""

    cones: MutualSight
    a: MotionHistoryVolume
    b: MotionHistoryVolume


@dataclass(frozen=True, slots=True, eq=False)
class _Prepared:
    """Volumes arranged for the search, shared by all clauses that name them."""

    facings: dict[int, tuple[Facing, ...]]  # by identity of the meeting
    seen_a: TurnedColumns | None  # all of A, for B to look at
    seen_b: Columns | None


def search_poses(
    grid: PoseGrid,
    clauses: Sequence[Clause],
    *,
    sight: SightTest | None = None,
    among: ByteArray | BoolArray | None = None,
    value: int = 1,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> ReasonMap:
    """Test every pose of a grid, exactly (Shi et al., section 4.3.2).

    Args:
        grid: candidate poses.
        clauses: constraints, in the order in which they are to be blamed.
        sight: mutual visibility, tested last.
        among: (X, Y, Yaw) poses to test are those that have `value` there; the others come back as outside the window.
            None for all.
        value: see there.
        workers: threads; the result does not depend on it.
        progress: told the share that is done, 0 to 1.
    """
    prepared = _prepare(clauses, sight)
    reasons = BASE_REASONS + tuple(clause.reason for clause in clauses)
    if sight is not None:
        reasons += (NOT_SEEN_BY_A, NOT_SEEN_BY_B)
    found = np.empty((grid.n_yaw, grid.size, grid.size), np.uint8)
    whole = np.full((grid.size, grid.size), value, np.uint8)
    asked = None if among is None else np.ascontiguousarray(among.transpose(2, 0, 1)).view(np.uint8)
    along_x, along_y = grid.reach()
    desks = local()

    def decide(yaws: range) -> None:
        if not hasattr(desks, "own"):
            desks.own = _Desk(prepared)
        for k in yaws:
            alive = np.empty(whole.shape, np.bool_)
            if _begin(along_x[k], along_y[k], whole if asked is None else asked[k], np.uint8(value), alive, found[k]):
                _mark_reasons(grid, clauses, sight, desks.own, k, alive, found[k])

    portion = max(1, grid.n_yaw // PORTIONS)
    portions = [range(k, min(k + portion, grid.n_yaw)) for k in range(0, grid.n_yaw, portion)]
    with ThreadPoolExecutor(workers) as pool:
        for done, _ in enumerate(pool.map(decide, portions), start=1):
            if progress is not None:
                progress(done / len(portions))
    return map_by_yaw(grid, found, reasons)


def _prepare(clauses: Sequence[Clause], sight: SightTest | None) -> _Prepared:
    meetings = [m for clause in clauses for option in clause.options for m in option.must + option.never]
    facings = facings_of(meetings)
    if sight is None:
        return _Prepared(facings, None, None)
    return _Prepared(facings, turned(whole_columns(sight.a), 0.0), whole_columns(sight.b))


class _Desk:
    """What one thread works with at one yaw after another."""

    def __init__(self, prepared: _Prepared) -> None:
        self.prepared = prepared
        self.scratch = Scratch()
        self._rooms: dict[int, Room] = {}
        self._turned: dict[int, TurnedPyramid] = {}
        self._yaw = np.nan

    def turned(self, facing: Facing, yaw: float) -> TurnedPyramid:
        """The volume B of a facing turned about z; those turned by another yaw are lost."""
        if yaw != self._yaw:
            self._yaw, self._turned = yaw, {}
        key = id(facing.b)
        if key not in self._turned:
            if key not in self._rooms:
                self._rooms[key] = room_for(facing.b)
            self._turned[key] = turned_pyramid(facing.b, yaw, self._rooms[key], solid=facing.solid)
        return self._turned[key]


def _mark_reasons(
    grid: PoseGrid,
    clauses: Sequence[Clause],
    sight: SightTest | None,
    desk: _Desk,
    k: int,
    alive: BoolArray,
    reason: ByteArray,
) -> None:
    """Find the (size, size) reasons at one yaw, of the poses that are to be tested, of which there are some."""
    for number, clause in enumerate(clauses, start=len(BASE_REASONS)):
        passed = _passing(clause.options[0], alive.copy(), desk, grid, k)
        for option in clause.options[1:]:
            passed |= _passing(option, alive & ~passed, desk, grid, k)
        if not _mark(reason, alive, passed, number):
            return
        alive = passed
    if sight is not None:
        _mark_unseen(reason, alive, sight.cones, desk, grid, k, len(BASE_REASONS) + len(clauses))


def _passing(option: Option, asked: BoolArray, desk: _Desk, grid: PoseGrid, k: int) -> BoolArray:
    """Of the poses asked for, those at which an option holds; overwrites what was asked."""
    for meeting, wanted in [(meeting, True) for meeting in option.must] + [(m, False) for m in option.never]:
        met = _meeting(desk.prepared.facings[id(meeting)], meeting.every is not None, asked, desk, grid, k)
        if not _narrow(asked, met, wanted):
            break
    return asked


def _meeting(
    facings: Sequence[Facing], all_of_them: bool, asked: BoolArray, desk: _Desk, grid: PoseGrid, k: int
) -> BoolArray:
    """At which of the poses asked for all facings meet, or any does."""
    found: BoolArray | None = None
    for facing in facings:
        open_still = asked if found is None else asked & (found if all_of_them else ~found)
        met = meets(
            facing.a,
            desk.turned(facing, grid.yaw(k)),
            base=grid.base[k],
            stride=grid.stride,
            asked=open_still,
            every=facing.every,
            scratch=desk.scratch,
        )
        if len(facings) > 1:  # the next one is laid where this one lies
            met = met.copy() if found is None or all_of_them else found | met
        found = met
    return np.full_like(asked, all_of_them) if found is None else found


def _mark_unseen(
    reason: ByteArray, alive: BoolArray, cones: MutualSight, desk: _Desk, grid: PoseGrid, k: int, number: int
) -> None:
    """Reject the poses at which one does not see the other."""
    seen_a, seen_b = desk.prepared.seen_a, desk.prepared.seen_b
    assert seen_a is not None and seen_b is not None
    yaw = grid.yaw(k)
    where = {"base": grid.base[k], "step": grid.step, "pitch": grid.step / grid.stride}
    seen = a_sees_b(cones.a, turned(seen_b, yaw), asked=alive, **where)
    back = b_sees_a(cones.b, seen_a, yaw, asked=seen, **where)
    _mark(reason, alive, seen, number)
    _mark(reason, seen, back, number + 1)


@njit(cache=True)
def _begin(
    along_x: BoolArray, along_y: BoolArray, asked: ByteArray, value: np.uint8, alive: BoolArray, reason: ByteArray
) -> bool:
    """Let the poses in the window live that are asked for, as a value says; whether there are any."""
    some = False
    for x in range(alive.shape[0]):
        for y in range(alive.shape[1]):
            lives = along_x[x] & along_y[y] & (asked[x, y] == value)
            alive[x, y], reason[x, y] = lives, np.uint8(OUTSIDE) * np.uint8(not lives)
            some |= lives
    return some


@njit(cache=True)
def _narrow(asked: BoolArray, met: BoolArray, wanted: bool) -> bool:
    """Ask on only where what was met is what is wanted; whether any pose is left."""
    some = False
    for x in range(asked.shape[0]):
        for y in range(asked.shape[1]):
            asked[x, y] &= met[x, y] == wanted
            some |= asked[x, y]
    return some


@njit(cache=True)
def _mark(reason: ByteArray, alive: BoolArray, passed: BoolArray, number: int) -> bool:
    """Blame a constraint for what was alive, and so has no reason yet, and did not pass; whether anything did."""
    some = False
    for x in range(reason.shape[0]):
        for y in range(reason.shape[1]):
            reason[x, y] |= np.uint8(number) * np.uint8(alive[x, y] & (not passed[x, y]))
            some |= passed[x, y]
    return some
