"""Maps that grow with what is asked: a pose that was decided once is not decided again.

What becomes of a pose depends on the pose alone, and all windows lie on one lattice, so a kept map says something of
every window that it overlaps, whatever it was asked for at first: of a larger window the rim is left to do, and where
an earlier constraint accepts more than it did, what it accepts now.
"""

from collections.abc import Callable

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, ByteArray
from mhvedit.geometry.runs import run_lengths
from mhvedit.pipeline.store import Arrays, Key, Store
from mhvedit.search.poses import PoseGrid, pose_grid
from mhvedit.search.solve import OUTSIDE, ReasonMap

Search = Callable[[BoolArray | None], ReasonMap]  # (X, Y, Yaw) which poses to decide, None for all


def decided(store: Store, key: Key, grid: PoseGrid, search: Search, *, among: BoolArray | None = None) -> ReasonMap:
    """What becomes of all poses of a grid: from what is kept, and from a search of the rest.

    Args:
        store: where the map is kept, with all poses that were asked for so far.
        key: everything that the reason of a pose depends on.
        grid: the poses that are asked for.
        search: decides poses of that grid; those that it was not asked for come back as outside.
        among: (X, Y, Yaw) poses that are to be decided; None for all. The others come back as outside.
    """
    kept = store.kept(key)
    if kept is None:
        found = search(among)
        _keep(store, key, found)
        return found
    reasons = tuple(kept["reasons"].tolist())
    if among is None and kept["window"] == grid.window:
        return ReasonMap(grid, _kept_map(kept, grid), reasons)
    whole = _with_window(grid, max(grid.window, float(kept["window"])))
    known = _laid(kept, whole)
    left = inside(grid) if among is None else among.copy()
    told = np.empty(left.shape, np.uint8)
    if _look_up(known, left, told):
        _fill(told, known, left, search(left).reason)
        _keep(store, key, ReasonMap(whole, known, reasons))
    return ReasonMap(grid, told, reasons)


def inside(grid: PoseGrid) -> BoolArray:
    """(X, Y, Yaw) which poses of a grid have B's root in the window."""
    x, y = grid.reach()
    return np.asarray(np.logical_and(x.T[:, None], y.T[None, :], order="C"))


def _keep(store: Store, key: Key, found: ReasonMap) -> None:
    """Keep a map in place of a smaller one."""
    values, lengths = run_lengths(found.reason.ravel())
    window, reasons = np.array(found.grid.window), np.array(found.reasons)
    store.keep(key, {"values": values, "lengths": lengths.astype(np.int32), "reasons": reasons, "window": window})


def _laid(kept: Arrays, grid: PoseGrid) -> ByteArray:
    """A kept map on a grid whose window is not smaller."""
    before = _kept_map(kept, _with_window(grid, float(kept["window"])))
    if grid.size == len(before):
        return before
    known = np.full((grid.size, grid.size, grid.n_yaw), OUTSIDE, np.uint8)
    border = (grid.size - len(before)) // 2
    known[border : border + len(before), border : border + len(before)] = before
    return known


@njit(cache=True, nogil=True)
def _look_up(known: ByteArray, asked: BoolArray, told: ByteArray) -> bool:
    """Tell what is known of the poses that are asked for, and ask on for the others; whether there are any.

    Bytes one row after the other, likewise below: so it is done many at a time.
    """
    n_x, n_y, n_yaw = asked.shape
    border, some, outside = (known.shape[0] - n_x) // 2, np.uint8(0), np.uint8(OUTSIDE)
    reasons, wanted, out = known.reshape(-1), asked.view(np.uint8).reshape(-1), told.reshape(-1)
    count = np.uint64(n_y * n_yaw)
    for x in range(n_x):
        at, to = np.uint64(((border + x) * known.shape[1] + border) * n_yaw), np.uint64(x) * count
        for n in range(count):
            reason, asks = reasons[at + n], wanted[to + n]
            out[to + n] = reason if asks != 0 else outside
            wanted[to + n] = asks if reason == outside else np.uint8(0)
            some |= wanted[to + n]
    return bool(some)


@njit(cache=True, nogil=True)
def _fill(told: ByteArray, known: ByteArray, left: BoolArray, found: ByteArray) -> None:
    """Say what was found of the poses that were not known."""
    n_x, n_y, n_yaw = left.shape
    border = (known.shape[0] - n_x) // 2
    reasons, asked, out, more = known.reshape(-1), left.view(np.uint8).reshape(-1), told.reshape(-1), found.reshape(-1)
    count = np.uint64(n_y * n_yaw)
    for x in range(n_x):
        at, to = np.uint64(((border + x) * known.shape[1] + border) * n_yaw), np.uint64(x) * count
        for n in range(count):
            new = asked[to + n] != 0
            reasons[at + n] = more[to + n] if new else reasons[at + n]
            out[to + n] = more[to + n] if new else out[to + n]


def _kept_map(kept: Arrays, grid: PoseGrid) -> ByteArray:
    """(X, Y, Yaw) the map that is kept of a grid."""
    reason = np.repeat(np.asarray(kept["values"], np.uint8), kept["lengths"])
    return reason.reshape(grid.size, grid.size, grid.n_yaw)


def _with_window(grid: PoseGrid, window: float) -> PoseGrid:
    """The same lattice around the same roots, with another window."""
    pitch = grid.step / grid.stride
    return pose_grid(grid.root_a, grid.root_b, pitch=pitch, stride=grid.stride, n_yaw=grid.n_yaw, window=window)
