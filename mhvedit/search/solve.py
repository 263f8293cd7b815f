"""Every pose of a segment's grid against every constraint: the map of what accepted or first rejected each pose."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from mhvedit.constraints.clauses import Clause, Meeting, Option
from mhvedit.constraints.dictionary import ever
from mhvedit.constraints.visibility import NOT_SEEN_BY_A, NOT_SEEN_BY_B
from mhvedit.geometry.arrays import BoolArray, ByteArray
from mhvedit.search.meet import meets
from mhvedit.search.poses import PoseGrid
from mhvedit.search.pyramid import Columns, Pyramid, TurnedColumns, columns_of, pyramid_of, turned
from mhvedit.search.sight import MutualSight, a_sees_b, b_sees_a
from mhvedit.volumes.history import MotionHistoryVolume

ACCEPTED, OUTSIDE = 0, 1
BASE_REASONS = ("accepted", "outside the window")
BUNCH = 12  # yaws that a thread takes at a time


@dataclass(frozen=True, slots=True, eq=False)
class ReasonMap:
    """What accepted or first rejected each pose of a grid."""

    grid: PoseGrid
    reason: ByteArray  # (X, Y, Yaw) index into reasons
    reasons: tuple[str, ...]  # 0: accepted, 1: outside the window, then the constraints in order

    @property
    def accepted(self) -> BoolArray:
        """(X, Y, Yaw)."""
        return np.asarray(self.reason == ACCEPTED)

    def counts(self) -> dict[str, int]:
        """How many poses each reason took."""
        numbers = np.bincount(self.reason.ravel(), minlength=len(self.reasons))
        return {name: int(n) for name, n in zip(self.reasons, numbers, strict=True)}


@dataclass(frozen=True, slots=True, eq=False)
class SightTest:
    """Mutual visibility, with all that can be seen of either."""

    cones: MutualSight
    a: MotionHistoryVolume
    b: MotionHistoryVolume


@dataclass(frozen=True, slots=True, eq=False)
class _Prepared:
    """Volumes arranged for the search, shared by all clauses that name them."""

    resting: dict[int, Pyramid]
    columns: dict[int, Columns]
    seen_a: TurnedColumns | None  # all of A, for B to look at
    seen_b: Columns | None


def search_poses(
    grid: PoseGrid,
    clauses: Sequence[Clause],
    *,
    sight: SightTest | None = None,
    among: BoolArray | None = None,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> ReasonMap:
    """Test every pose of a grid, exactly (Shi et al., section 4.3.2).

    Args:
        grid: candidate poses.
        clauses: constraints, in the order in which they are to be blamed.
        sight: mutual visibility, tested last.
        among: (X, Y, Yaw) poses to test; the others come back as outside the window. None for all.
        workers: threads; the result does not depend on it.
        progress: told the share that is done, 0 to 1.
    """
    prepared = _prepare(clauses, sight)
    reasons = BASE_REASONS + tuple(clause.reason for clause in clauses)
    if sight is not None:
        reasons += (NOT_SEEN_BY_A, NOT_SEEN_BY_B)
    reason = np.empty((grid.size, grid.size, grid.n_yaw), np.uint8)
    bunches = [range(k, min(k + BUNCH, grid.n_yaw)) for k in range(0, grid.n_yaw, BUNCH)]

    def decide(bunch: range) -> None:
        found = [
            _reasons_at(grid, clauses, sight, prepared, k, None if among is None else among[:, :, k]) for k in bunch
        ]
        reason[:, :, bunch.start : bunch.stop] = np.stack(found, axis=-1)

    with ThreadPoolExecutor(workers) as pool:
        for done, _ in enumerate(pool.map(decide, bunches), start=1):
            if progress is not None:
                progress(done / len(bunches))
    return ReasonMap(grid, reason, reasons)


def _prepare(clauses: Sequence[Clause], sight: SightTest | None) -> _Prepared:
    resting: dict[int, Pyramid] = {}
    columns: dict[int, Columns] = {}
    for clause in clauses:
        for option in clause.options:
            for meeting in option.must + option.never:
                if id(meeting.a) not in resting:
                    resting[id(meeting.a)] = pyramid_of(meeting.a)
                if id(meeting.b) not in columns:
                    columns[id(meeting.b)] = columns_of(meeting.b)
    if sight is None:
        return _Prepared(resting, columns, None, None)
    return _Prepared(resting, columns, turned(columns_of(ever(sight.a)), 0.0), columns_of(ever(sight.b)))


def _reasons_at(
    grid: PoseGrid,
    clauses: Sequence[Clause],
    sight: SightTest | None,
    prepared: _Prepared,
    k: int,
    among: BoolArray | None,
) -> ByteArray:
    """(size, size) reasons at one yaw."""
    alive = grid.inside(k) if among is None else grid.inside(k) & among
    reason = np.where(alive, ACCEPTED, OUTSIDE).astype(np.uint8)
    turned_b: dict[int, TurnedColumns] = {}
    for number, clause in enumerate(clauses, start=len(BASE_REASONS)):
        if not alive.any():
            return reason
        passed = np.zeros_like(alive)
        for option in clause.options:
            passed |= _passes(option, alive & ~passed, prepared, turned_b, grid, k)
        reason[alive & ~passed] = number
        alive = passed
    if sight is not None and alive.any():
        _mark_unseen(reason, alive, sight.cones, prepared, grid, k, len(BASE_REASONS) + len(clauses))
    return reason


def _passes(
    option: Option,
    asked: BoolArray,
    prepared: _Prepared,
    turned_b: dict[int, TurnedColumns],
    grid: PoseGrid,
    k: int,
) -> BoolArray:
    """Of the poses asked for, those at which an option holds."""
    passed = asked
    for meeting in option.must:
        passed = passed & _where_met(meeting, passed, prepared, turned_b, grid, k)
    for meeting in option.never:
        passed = passed & ~_where_met(meeting, passed, prepared, turned_b, grid, k)
    return passed


def _where_met(
    meeting: Meeting,
    asked: BoolArray,
    prepared: _Prepared,
    turned_b: dict[int, TurnedColumns],
    grid: PoseGrid,
    k: int,
) -> BoolArray:
    if not asked.any():
        return asked
    b = id(meeting.b)
    if b not in turned_b:
        turned_b[b] = turned(prepared.columns[b], float(grid.yaws[k]))
    resting = prepared.resting[id(meeting.a)]
    return meets(resting, turned_b[b], base=grid.base[k], stride=grid.stride, asked=asked, every=meeting.every)


def _mark_unseen(
    reason: ByteArray, alive: BoolArray, cones: MutualSight, prepared: _Prepared, grid: PoseGrid, k: int, number: int
) -> None:
    """Reject the poses at which one does not see the other."""
    assert prepared.seen_a is not None and prepared.seen_b is not None
    yaw = float(grid.yaws[k])
    where = {"base": grid.base[k], "step": grid.step, "pitch": grid.step / grid.stride}
    seen = a_sees_b(cones.a, turned(prepared.seen_b, yaw), asked=alive, **where)
    back = b_sees_a(cones.b, prepared.seen_a, yaw, asked=seen, **where)
    reason[alive & ~seen] = number
    reason[seen & ~back] = number + 1
