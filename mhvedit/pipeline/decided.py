"""Maps that grow with what is asked: a pose that was decided once is not decided again.

What becomes of a pose depends on the pose alone, and all windows lie on one lattice, so a kept map says something of
every window that it overlaps, whatever it was asked for at first: of a larger window the rim is left to do, and where
an earlier constraint accepts more than it did, what it accepts now.
"""

from collections.abc import Callable

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import ByteArray, Int32Array
from mhvedit.geometry.runs import run_lengths
from mhvedit.pipeline.store import Arrays, Key, Store
from mhvedit.search.poses import PoseGrid, pose_grid
from mhvedit.search.solve import ACCEPTED, BASE_REASONS, OUTSIDE, ReasonMap, map_by_yaw

Search = Callable[[ByteArray | None, int], ReasonMap]  # decides poses that have a value in (X, Y, Yaw), None for all
OPEN = 255  # what is not known of a pose


def decided(store: Store, key: Key, grid: PoseGrid, search: Search) -> ReasonMap:
    """What becomes of all poses of a grid: from what is kept, and from a search of the rest.

    Args:
        store: where the map is kept, with all poses that were asked for so far.
        key: everything that the reason of a pose depends on.
        grid: the poses that are asked for.
        search: decides poses of that grid; those that it was not asked for come back as outside.
    """
    kept = store.kept(key)
    if kept is None:
        found = search(None, ACCEPTED)
        _keep(store, key, found)
        return found
    if kept["window"] == grid.window:
        return map_by_yaw(grid, _kept_map(kept, grid), tuple(kept["reasons"].tolist()))
    x, y = grid.reach()
    every = np.where(x[:, :, None] & y[:, None, :], np.uint8(ACCEPTED), np.uint8(OUTSIDE))
    return decided_further(store, key, map_by_yaw(grid, every, BASE_REASONS), search)


def decided_further(store: Store, key: Key, found: ReasonMap, search: Search) -> ReasonMap:
    """What becomes of the poses that a map accepts, if more is asked of them; `decided` otherwise.

    Args:
        store: see there.
        key: see there.
        found: is overwritten.
        search: see there.

    Returns:
        The map with the further reasons behind its own.
    """
    kept, grid, reason = store.kept(key), found.grid, found.by_yaw
    found = map_by_yaw(grid, reason, found.reasons)
    if kept is None:
        more = search(found.reason, ACCEPTED)
        _keep(store, key, more)
        return _with_reasons(found, more)
    whole, reasons = _with_window(grid, max(grid.window, float(kept["window"]))), tuple(kept["reasons"].tolist())
    known = _laid(kept, whole) if kept["window"] < grid.window else None
    values, lengths = (kept["values"], kept["lengths"]) if known is None else _runs(known)
    instead_of = np.arange(len(reasons), dtype=np.uint8) + np.uint8(len(found.reasons) - len(BASE_REASONS))
    instead_of[[ACCEPTED, OUTSIDE]] = ACCEPTED, OPEN
    if not _tell(reason, values, lengths, whole.size, instead_of):
        return map_by_yaw(grid, reason, found.reasons + reasons[len(BASE_REASONS) :])
    more = search(found.reason, OPEN)
    assert more.reasons == reasons, f"{key[0]}: one key, but other reasons"
    known = _laid(kept, whole) if known is None else known
    _fill(known, reason, more.by_yaw)
    _keep(store, key, map_by_yaw(whole, known, reasons))
    return _with_reasons(found, more)


def _with_reasons(found: ReasonMap, more: ReasonMap) -> ReasonMap:
    """A map whose accepted or open poses were tested for more; it takes the place of the first one."""
    reason = found.by_yaw
    _blame(reason.reshape(-1), more.by_yaw.reshape(-1), len(BASE_REASONS), len(found.reasons))
    return map_by_yaw(found.grid, reason, found.reasons + more.reasons[len(BASE_REASONS) :])


def _keep(store: Store, key: Key, found: ReasonMap) -> None:
    """Keep a map in place of a smaller one."""
    values, lengths = _runs(found.by_yaw)
    window, reasons = np.array(found.grid.window), np.array(found.reasons)
    store.keep(key, {"values": values, "lengths": lengths, "reasons": reasons, "window": window})


def _runs(reason: ByteArray) -> tuple[ByteArray, Int32Array]:
    """Values and lengths of the runs of a (Yaw, X, Y) map."""
    values, lengths = run_lengths(reason.reshape(-1))
    return values, lengths.astype(np.int32)


def _laid(kept: Arrays, grid: PoseGrid) -> ByteArray:
    """(Yaw, X, Y) a kept map on a grid whose window is not smaller."""
    before = _kept_map(kept, _with_window(grid, float(kept["window"])))
    if grid.size == before.shape[1]:
        return before
    known = np.full((grid.n_yaw, grid.size, grid.size), OUTSIDE, np.uint8)
    inner = slice((grid.size - before.shape[1]) // 2, (grid.size + before.shape[1]) // 2)
    known[:, inner, inner] = before
    return known


# Bytes one row after the other: so the kernels look at many poses at a time.


@njit(cache=True, nogil=True)
def _tell(reason: ByteArray, values: ByteArray, lengths: Int32Array, size: int, instead_of: ByteArray) -> bool:
    """Say what is known of accepted poses, in runs of a map of `size` that is not smaller; whether any is open."""
    _, n_x, n_y = reason.shape
    border, out = (size - n_x) // 2, reason.reshape(-1)
    stop, some = 0, False
    for run in range(values.shape[0]):
        start, stop, told = stop, stop + lengths[run], instead_of[values[run]]
        if told == ACCEPTED:
            continue
        for row in range(start // size, (stop - 1) // size + 1):
            k, x = divmod(row, size)
            if x < border or x >= border + n_x:
                continue
            first = row * size + border
            moved = (k * n_x + x - border) * n_y - first
            low, high = max(start, first) + moved, min(stop, first + n_y) + moved
            for n in range(np.uint64(low), np.uint64(max(low, high))):
                some |= told == OPEN and out[n] == ACCEPTED
                out[n] = told if out[n] == ACCEPTED else out[n]
    return some


@njit(cache=True, nogil=True)
def _fill(known: ByteArray, reason: ByteArray, found: ByteArray) -> None:
    """Say what was found of the poses that were not known."""
    n_yaw, n_x, n_y = reason.shape
    border = (known.shape[1] - n_x) // 2
    reasons, asked, more = known.reshape(-1), reason.reshape(-1), found.reshape(-1)
    for k in range(n_yaw):
        for x in range(n_x):
            at = np.uint64((k * known.shape[1] + border + x) * known.shape[2] + border)
            to = np.uint64((k * n_x + x) * n_y)
            for n in range(np.uint64(n_y)):
                reasons[at + n] = more[to + n] if asked[to + n] == OPEN else reasons[at + n]


@njit(cache=True, nogil=True)
def _blame(reason: ByteArray, more: ByteArray, first: int, instead: int) -> None:
    """Say why poses were rejected further on: by reason `first` and later ones, which come to stand as `instead`; open
    poses that were not, are accepted.
    """
    least, up = np.uint8(first), np.uint8(instead - first)
    for n in range(np.uint64(reason.shape[0])):
        before = np.uint8(ACCEPTED) if reason[n] == OPEN else reason[n]
        reason[n] = more[n] + up if more[n] >= least else before


def _kept_map(kept: Arrays, grid: PoseGrid) -> ByteArray:
    """(Yaw, X, Y) the map that is kept of a grid."""
    reason = np.repeat(np.asarray(kept["values"], np.uint8), kept["lengths"])
    return reason.reshape(grid.n_yaw, grid.size, grid.size)


def _with_window(grid: PoseGrid, window: float) -> PoseGrid:
    """The same lattice around the same roots, with another window."""
    pitch = grid.step / grid.stride
    return pose_grid(grid.root_a, grid.root_b, pitch=pitch, stride=grid.stride, n_yaw=grid.n_yaw, window=window)
