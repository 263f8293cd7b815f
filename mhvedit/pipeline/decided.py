"""Maps that grow and are cut with the window: a pose that was decided once is not decided again.

What becomes of a pose depends on the pose alone, and all windows lie on one lattice, so a kept map holds for every
window inside its own, and of a larger one only the rim is left to do.
"""

from collections.abc import Callable

import numpy as np

from mhvedit.geometry.arrays import BoolArray, ByteArray
from mhvedit.geometry.runs import run_lengths
from mhvedit.pipeline.store import Arrays, Key, Store
from mhvedit.search.poses import PoseGrid, pose_grid
from mhvedit.search.solve import OUTSIDE, ReasonMap

Search = Callable[[BoolArray | None], ReasonMap]  # (X, Y, Yaw) which poses to decide, None for all


def decided(store: Store, key: Key, grid: PoseGrid, search: Search, *, among: BoolArray | None = None) -> ReasonMap:
    """What becomes of all poses of a grid: from what is kept, and from a search of the rest.

    Args:
        store: where the map is kept, for the largest window so far.
        key: everything that the reason of a pose depends on.
        grid: the poses that are asked for.
        search: decides poses of that grid; those that it was not asked for come back as outside.
        among: (X, Y, Yaw) poses that are to be decided; None for all.
    """
    kept = store.kept(key)
    if kept is not None and kept["window"] >= grid.window:
        return ReasonMap(grid, _cut(kept, grid), tuple(kept["reasons"].tolist()))
    found = search(among) if kept is None else _grown(kept, grid, search, among)
    values, lengths = run_lengths(found.reason.ravel())
    window, reasons = np.array(grid.window), np.array(found.reasons)
    store.keep(key, {"values": values, "lengths": lengths.astype(np.int32), "reasons": reasons, "window": window})
    return found


def inside(grid: PoseGrid) -> BoolArray:
    """(X, Y, Yaw) which poses of a grid have B's root in the window."""
    roots = [grid.roots(k) for k in range(grid.n_yaw)]
    limit = grid.window / 2 + 1e-9
    x, y = (np.abs(np.stack([root[axis] for root in roots], 1)) <= limit for axis in (0, 1))
    return np.asarray(x[:, None] & y[None, :])


def _grown(kept: Arrays, grid: PoseGrid, search: Search, among: BoolArray | None) -> ReasonMap:
    """A kept map with the rim that a larger window adds."""
    before = _with_window(grid, float(kept["window"]))
    border = (grid.size - before.size) // 2
    core = slice(border, border + before.size), slice(border, border + before.size)
    known, rim = inside(before), inside(grid)
    rim[core] &= ~known
    found = search(rim if among is None else rim & among)
    reason = found.reason.copy()
    reason[core] = np.where(known, _kept_map(kept, before), reason[core])
    return ReasonMap(grid, reason, found.reasons)


def _cut(kept: Arrays, grid: PoseGrid) -> ByteArray:
    """The part of a kept map that lies in a grid of the same or a smaller window."""
    if kept["window"] == grid.window:
        return _kept_map(kept, grid)
    reason = _kept_map(kept, _with_window(grid, float(kept["window"])))
    border = (reason.shape[0] - grid.size) // 2
    core = reason[border : border + grid.size, border : border + grid.size]
    return np.where(inside(grid), core, np.uint8(OUTSIDE))


def _kept_map(kept: Arrays, grid: PoseGrid) -> ByteArray:
    """(X, Y, Yaw) the map that is kept of a grid."""
    reason = np.repeat(np.asarray(kept["values"], np.uint8), kept["lengths"])
    return reason.reshape(grid.size, grid.size, grid.n_yaw)


def _with_window(grid: PoseGrid, window: float) -> PoseGrid:
    """The same lattice around the same roots, with another window."""
    pitch = grid.step / grid.stride
    return pose_grid(grid.root_a, grid.root_b, pitch=pitch, stride=grid.stride, n_yaw=grid.n_yaw, window=window)
