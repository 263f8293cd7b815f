"""Every pose of a segment's grid against every constraint: the map of what accepted or first rejected each pose."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from mhvedit.constraints.clauses import Clause, Meeting, Option
from mhvedit.constraints.visibility import NOT_SEEN_BY_A, NOT_SEEN_BY_B
from mhvedit.geometry.arrays import BoolArray, ByteArray
from mhvedit.search.meet import meets
from mhvedit.search.poses import PoseGrid
from mhvedit.search.pyramid import Columns, Pyramid, TurnedColumns, columns_of, pyramid_of, turned
from mhvedit.search.sight import MutualSight, a_sees_b, b_sees_a
from mhvedit.volumes.history import MotionHistoryVolume

ACCEPTED, OUTSIDE = 0, 1
BASE_REASONS = ("accepted", "outside the window")


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
    reason = np.full((grid.size, grid.size, grid.n_yaw), OUTSIDE, np.uint8)
    done = 0
    with ThreadPoolExecutor(workers) as pool:
        slices = pool.map(
            lambda k: _reasons_at(grid, clauses, sight, prepared, k, None if among is None else among[:, :, k]),
            range(grid.n_yaw),
        )
        for k, found in enumerate(slices):
            reason[:, :, k] = found
            done += 1
            if progress is not None:
                progress(done / grid.n_yaw)
    return ReasonMap(grid, reason, reasons)


def _prepare(clauses: Sequence[Clause], sight: SightTest | None) -> _Prepared:
    prepared = _Prepared({}, {})
    for clause in clauses:
        for option in clause.options:
            for meeting in option.must + option.never:
                if id(meeting.a) not in prepared.resting:
                    prepared.resting[id(meeting.a)] = pyramid_of(meeting.a)
                if id(meeting.b) not in prepared.columns:
                    prepared.columns[id(meeting.b)] = columns_of(meeting.b)
    if sight is not None:
        prepared.columns.setdefault(id(sight.a), columns_of(sight.a))
        prepared.columns.setdefault(id(sight.b), columns_of(sight.b))
    return prepared


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
    yaw = float(grid.yaws[k])
    for number, clause in enumerate(clauses, start=len(BASE_REASONS)):
        if not alive.any():
            return reason
        passed = np.zeros_like(alive)
        for option in clause.options:
            passed |= _passes(option, alive & ~passed, prepared, turned_b, grid, k)
        reason[alive & ~passed] = number
        alive = passed
    if sight is not None and alive.any():
        _mark_unseen(reason, alive, sight, prepared, turned_b, grid, k, yaw, len(BASE_REASONS) + len(clauses))
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
    b = _turned(meeting.b, prepared, turned_b, grid, k)
    resting = prepared.resting[id(meeting.a)]
    return meets(resting, b, base=grid.base[k], stride=grid.stride, asked=asked, every=meeting.every)


def _turned(
    volume: MotionHistoryVolume, prepared: _Prepared, turned_b: dict[int, TurnedColumns], grid: PoseGrid, k: int
) -> TurnedColumns:
    if id(volume) not in turned_b:
        turned_b[id(volume)] = turned(prepared.columns[id(volume)], float(grid.yaws[k]))
    return turned_b[id(volume)]


def _mark_unseen(
    reason: ByteArray,
    alive: BoolArray,
    sight: SightTest,
    prepared: _Prepared,
    turned_b: dict[int, TurnedColumns],
    grid: PoseGrid,
    k: int,
    yaw: float,
    number: int,
) -> None:
    """Reject the poses at which one does not see the other."""
    where = {"base": grid.base[k], "step": grid.step, "pitch": grid.step / grid.stride}
    b = _turned(sight.b, prepared, turned_b, grid, k)
    seen = a_sees_b(sight.cones.a, b, asked=alive, **where)
    back = b_sees_a(sight.cones.b, turned(prepared.columns[id(sight.a)], 0.0), yaw, asked=seen, **where)
    reason[alive & ~seen] = number
    reason[seen & ~back] = number + 1
