"""The search by correlation: an FFT for every yaw, frame and height, as a good engineer would write it in an afternoon.

How many voxels two volumes share in a frame is, over all shifts at once, a correlation in the plane, summed over
heights; they meet where it is more than a half. Heights are summed in the frequency domain, so that each frame and yaw
takes one inverse transform. A's spectra are computed once for all yaws, a few heights at a time, so memory stays
bounded. Left out are slices that are empty in A or B, yaws at which no pose is in question any more, and frames where
even all of them together do not meet; a transform is no larger than keeps the shifts in question free of what wraps
around.
"""

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from mhvedit.constraints.clauses import Clause, Meeting, Option
from mhvedit.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray, Words
from mhvedit.search.poses import PoseGrid
from mhvedit.search.solve import ACCEPTED, BASE_REASONS, OUTSIDE
from mhvedit.volumes.history import MotionHistoryVolume

CHUNK = 16  # heights that are transformed at a time
Slices = NDArray[np.float32]  # (heights, x, y)
Spectrum = NDArray[np.complex64]


@dataclass(frozen=True, slots=True, eq=False)
class Turn:
    """Where the columns of a turned volume come from."""

    start: IntArray  # (2,) lattice index of its first column
    source: IntArray  # (X, Y) number of the untouched column; one past the last where there is none


@dataclass(slots=True, eq=False)
class FftSearch:
    """A search of some yaws of a grid, and what it took."""

    grid: PoseGrid
    yaws: IntArray  # (K,) indices
    workers: int = 2
    resting_seconds: float = 0.0  # for what is computed once for all yaws
    worst: float = 0.0  # furthest that a count was from a whole number
    turns: dict[int, list[Turn]] = field(default_factory=dict)  # of each volume, by id

    def reasons(self, clauses: Sequence[Clause]) -> ByteArray:
        """(X, Y, K) what accepted or first rejected each pose, numbered as in `ReasonMap`.

        Args:
            clauses: constraints, in the order in which they are to be blamed.
        """
        x, y = self.grid.reach()
        alive = np.asarray(x[self.yaws, :, None] & y[self.yaws, None])
        reason = np.where(alive, ACCEPTED, OUTSIDE).astype(np.uint8)
        for number, clause in enumerate(clauses, start=len(BASE_REASONS)):
            passed = np.zeros_like(alive)
            for option in clause.options:
                passed |= self._passes(option, alive & ~passed)
            reason[alive & ~passed] = number
            alive = passed
        return np.moveaxis(reason, 0, -1)

    def _passes(self, option: Option, asked: BoolArray) -> BoolArray:
        for meeting in option.must:
            asked = asked & self._where_met(meeting, asked)
        for meeting in option.never:
            asked = asked & ~self._where_met(meeting, asked)
        return asked

    def _where_met(self, meeting: Meeting, asked: BoolArray) -> BoolArray:
        """(K, X, Y) of the poses asked for, those at which the two volumes meet."""
        if id(meeting.b) not in self.turns:
            self.turns[id(meeting.b)] = [turn_of(meeting.b.whole, float(self.grid.yaws[k])) for k in self.yaws]
        turns = self.turns[id(meeting.b)]
        if meeting.every is None and meeting.a.n_frames > 1:  # what never meets over all time needs no frames
            asked = self._met_in_frames(without_time(meeting), asked, turns)
        return self._met_in_frames(meeting, asked, turns)

    def _met_in_frames(self, meeting: Meeting, asked: BoolArray, turns: list[Turn]) -> BoolArray:
        met = np.zeros_like(asked) if meeting.every is None else asked.copy()
        for frame in range(meeting.a.n_frames) if meeting.every is None else frames_in(meeting.every):
            open_poses = asked & ~met if meeting.every is None else met
            rows = [row for row in range(len(self.yaws)) if open_poses[row].any()]
            if not rows:
                break
            shares = self._shares_voxels(meeting, frame, {row: (turns[row], open_poses[row]) for row in rows})
            for row, found in shares.items():
                met[row] = met[row] | found if meeting.every is None else found
        return met

    def _shares_voxels(
        self, meeting: Meeting, frame: int, asked: dict[int, tuple[Turn, BoolArray]]
    ) -> dict[int, BoolArray]:
        """(X, Y) for each row of yaws: the poses in question at which the volumes share a voxel in one frame."""
        a, b, heights = slices_in_common(meeting, frame)
        shifts = {
            row: self._array_shifts(row, turn.start - meeting.a.grid.start[:2]) for row, (turn, _) in asked.items()
        }
        size = transform_size(a.shape[1:], [(shifts[row], *asked[row]) for row in asked])
        sums = {row: np.zeros((size[0], size[1] // 2 + 1), np.complex64) for row in asked}
        columns = np.zeros((heights, b.shape[1] * b.shape[2] + 1), np.float32)
        columns[:, :-1] = b.reshape(heights, b.shape[1] * b.shape[2])
        with ThreadPoolExecutor(self.workers) as pool:
            for first in range(0, heights, CHUNK):
                began = time.perf_counter()
                resting = spectra_of(a[first : first + CHUNK], size, workers=self.workers)
                self.resting_seconds += time.perf_counter() - began
                chunk = columns[first : first + CHUNK]

                def add(row: int, resting: Spectrum = resting, chunk: Slices = chunk) -> None:
                    moving = spectra_of(chunk[:, asked[row][0].source], size)
                    np.multiply(np.conjugate(moving, out=moving), resting, out=moving)
                    sums[row] += moving.sum(0)

                list(pool.map(add, asked))
            counted = pool.map(lambda row: self._counts(sums[row], size, a.shape[1:], shifts[row], asked[row]), asked)
            return {row: counts > 0.5 for row, counts in zip(asked, counted, strict=True)}

    def _array_shifts(self, row: int, offset: IntArray) -> tuple[IntArray, IntArray]:
        """(size,) along x and y: from an index into turned B to one into A, for every cell."""
        base = self.grid.base[self.yaws[row]]
        along = (base[:, None] + np.arange(self.grid.size)) * self.grid.stride + offset[:, None]
        return along[0], along[1]

    def _counts(
        self,
        total: Spectrum,
        size: tuple[int, int],
        resting: tuple[int, ...],
        shifts: tuple[IntArray, IntArray],
        asked: tuple[Turn, BoolArray],
    ) -> FloatArray:
        """(X, Y) voxels shared at each pose in question; 0 at the others."""
        turn, wanted = asked
        counts = fft.irfft2(total, size)
        reachable = [(s > -n) & (s < m) for s, n, m in zip(shifts, turn.source.shape, resting, strict=True)]
        wanted = wanted & reachable[0][:, None] & reachable[1][None, :]
        i, j = np.nonzero(wanted)
        found = np.zeros(wanted.shape, np.float32)
        found[i, j] = counts[shifts[0][i] % size[0], shifts[1][j] % size[1]]
        self.worst = max(self.worst, float(np.abs(found - np.rint(found)).max(initial=0.0)))
        return found


def turn_of(volume: MotionHistoryVolume, yaw: float) -> Turn:
    """Turn a volume about z: a column of the lattice is that of the untouched volume that its centre falls into."""
    c, s = np.cos(yaw), np.sin(yaw)
    filled: BoolArray = np.asarray(volume.filled.any(2))
    start, shape = np.array(volume.grid.start[:2]), filled.shape
    corners = (start + np.array([(x, y) for x in (0, shape[0]) for y in (0, shape[1])])) @ np.array([[c, s], [-s, c]])
    low, high = np.floor(corners.min(0)).astype(np.int64) - 2, np.ceil(corners.max(0)).astype(np.int64) + 2
    x, y = np.meshgrid(*(np.arange(low[k], high[k], dtype=np.float64) for k in (0, 1)), indexing="ij")
    u = np.floor(c * x + s * y + 0.5).astype(np.int64) - start[0]
    v = np.floor(c * y - s * x + 0.5).astype(np.int64) - start[1]
    there = (u >= 0) & (u < shape[0]) & (v >= 0) & (v < shape[1])
    there[there] = filled[u[there], v[there]]
    source = np.where(there, u * shape[1] + v, filled.size)
    along = [np.flatnonzero(there.any(1 - axis)) for axis in (0, 1)]
    if not len(along[0]):
        return Turn(low, source[:1, :1])
    first, last = np.array([own[0] for own in along]), np.array([own[-1] for own in along])
    return Turn(low + first, source[first[0] : last[0] + 1, first[1] : last[1] + 1])


def without_time(meeting: Meeting) -> Meeting:
    """The same two volumes, filled where they ever are."""
    wholes = meeting.a.whole, meeting.b.whole
    a, b = (MotionHistoryVolume(v.grid, v.filled[..., None].astype(np.uint64), 1) for v in wholes)
    return Meeting(a, b)


def frames_in(words: Words) -> list[int]:
    """Which bits are set."""
    return np.flatnonzero(np.unpackbits(words.astype("<u8").view(np.uint8), bitorder="little")).tolist()


def slices_in_common(meeting: Meeting, frame: int) -> tuple[Slices, Slices, int]:
    """(Z, X, Y) of A and of B at those heights at which neither is empty in a frame, and how many."""
    a, b = meeting.a.whole, meeting.b.whole
    low, high = max(a.grid.start[2], b.grid.start[2]), min(a.grid.stop[2], b.grid.stop[2])
    sides = [v.at(frame)[:, :, max(0, low - v.grid.start[2]) : max(0, high - v.grid.start[2])] for v in (a, b)]
    common = sides[0].any((0, 1)) & sides[1].any((0, 1))
    resting, moving = (np.moveaxis(side[:, :, common], -1, 0).astype(np.float32) for side in sides)
    return resting, moving, int(common.sum())


def transform_size(
    resting: tuple[int, ...], moving: Sequence[tuple[tuple[IntArray, IntArray], Turn, BoolArray]]
) -> tuple[int, int]:
    """The least good size at which nothing wraps around onto a shift in question."""
    least = [1, 1]
    for shifts, turn, asked in moving:
        for axis, wanted in enumerate((asked.any(1), asked.any(0))):
            m, n = resting[axis], turn.source.shape[axis]
            own = shifts[axis][wanted]
            own = own[(own > -n) & (own < m)]
            if len(own):
                least[axis] = max(least[axis], m, n, own.max() + n, m - own.min())
    return fft.next_fast_len(int(least[0]), real=False), fft.next_fast_len(int(least[1]), real=True)


def spectra_of(slices: Slices, size: tuple[int, int], *, workers: int = 1) -> Spectrum:
    """(S, X, Y / 2 + 1) of slices padded with nothing to a size."""
    if slices.shape[1] > size[0] or slices.shape[2] > size[1]:  # no shift in question reaches A
        return np.zeros((len(slices), size[0], size[1] // 2 + 1), np.complex64)
    return np.asarray(fft.rfft2(slices, size, workers=workers), np.complex64)
