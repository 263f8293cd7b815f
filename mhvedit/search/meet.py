"""Where do two volumes meet? Exact, for every shift of B in a window, with work that grows with the boundary of the
answer.

Two volumes meet at a shift if some voxel of A and some voxel of shifted B coincide and have a bit in common (or, where
bits are asked for by name, if all of these occur somewhere). The window is halved again and again into square blocks
of shifts; for a block only those cells of B are looked at again, finer, that can still meet A's window for some shift
of the block. A block is settled as a whole if nothing is left that can meet, or if something meets whatever the shift;
the four shifts of the last blocks are decided together, column by column. Neighbours are most often settled by the
same cell: a cell that has settled a block moves to the front of its list, and the column that settled the last shift is
tried first on whole blocks of others.

The kernels are compiled into one, which works with flat, uncounted arrays: neighbouring looks share so little work
that calls and counts of references would cost more than the looks.
"""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, Int32Array, IntArray, Words
from mhvedit.geometry.uncounted import uncounted
from mhvedit.search.blocks import mark_blocks, most_blocks
from mhvedit.search.columns import EMPTY, WORD
from mhvedit.search.pyramid import SLABS, TOP, Pyramid, TurnedPyramid
from mhvedit.search.scratch import Scratch

SETTLED = -1  # a block that meets whatever the shift
WITNESSED = 3  # the coarsest level at which the last witness is tried on all shifts of a block


def meets(
    a: Pyramid,
    b: TurnedPyramid,
    *,
    base: IntArray,
    stride: int,
    asked: BoolArray,
    every: int | None = None,
    scratch: Scratch | None = None,
) -> BoolArray:
    """At which shifts A and turned B meet.

    Args:
        a: the volume at rest.
        b: the volume that is shifted, already turned; in the same layout.
        base: (2,) shift of cell (0, 0), in strides.
        stride: voxels between shifts.
        asked: (X, Y) which shifts to decide; the others come back False.
        every: bits of the frames that must all occur in common; None: any.
        scratch: to lay the result into; what was laid there before is lost.

    Returns:
        (X, Y).
    """
    scratch = scratch or Scratch()
    out = scratch.array("met", asked.shape, np.bool_)
    blocks = scratch.array("blocks", (most_blocks(*asked.shape, stride),), np.bool_)
    lists = scratch.array("lists", (TOP + 2, len(b.some.row_of), 2), np.int32)
    search_shifts(a, b, base * stride, stride, asked, None if every is None else np.uint64(every), blocks, lists, out)
    return out


@njit(cache=True, nogil=True)  # one loop with its own stack: compiled recursion does not survive the cache
def search_shifts(  # noqa: C901
    a: Pyramid,
    b: TurnedPyramid,
    base: IntArray,
    stride: int,
    asked: BoolArray,
    need: np.uint64 | None,
    blocks: BoolArray,
    lists: Int32Array,
    out: BoolArray,
) -> None:
    """Descend through the blocks of shifts, depth first; `lists` takes what is left of B on the way down.

    With and without `need` this is compiled by itself, without the kernels of the other.
    """
    a_own_row, a_own = uncounted(a.own.row_of), uncounted(a.own.rows.ravel())
    a_some_row, a_some = uncounted(a.some.row_of), uncounted(a.some.rows.ravel())
    a_sure_row, a_sure = uncounted(a.sure.row_of), uncounted(a.sure.rows.ravel())
    a_first, a_shape = uncounted(a.some.first), uncounted(a.some.shape)
    b_some_row, b_some = uncounted(b.some.row_of), uncounted(b.some.rows.ravel())
    b_sure_row, b_sure = uncounted(b.sure.row_of), uncounted(b.sure.rows.ravel())
    b_first, b_shape = uncounted(b.some.first), uncounted(b.some.shape)
    at_a, a_words, a_voxels = uncounted(a.column_of), uncounted(a.words.ravel()), uncounted(a.voxels.ravel())
    at_b, b_words, b_voxels = uncounted(b.column_of), uncounted(b.words.ravel()), uncounted(b.voxels.ravel())
    tall, lanes = a.tall, a.lanes
    out[:] = False
    base_x, base_y = base
    blocks_first, blocks_size = mark_blocks(asked, base_x, base_y, stride, blocks)
    lists, asked, out = uncounted(lists), uncounted(asked), uncounted(out)
    offsets = b.starts - a.starts
    if need is not None:
        wanted = _repeated(need, lanes)
    counts = np.zeros(TOP + 2, np.int64)
    child = np.zeros(TOP + 2, np.int64)
    block = np.zeros((TOP + 2, 2), np.int64)
    witness = np.zeros(2, np.int64)
    counts[TOP + 1] = _list_cells(b_some_row, b_first[TOP], b_shape[TOP, 0], b_shape[TOP, 1], lists[TOP + 1])
    first_x, first_y = base_x >> TOP, base_y >> TOP
    for top_x in range(
        max(first_x, -offsets[TOP, 0] - b_shape[TOP, 0]),
        min(first_x + blocks_size[TOP, 0], a_shape[TOP, 0] - offsets[TOP, 0]),
    ):
        for top_y in range(
            max(first_y, -offsets[TOP, 1] - b_shape[TOP, 1]),
            min(first_y + blocks_size[TOP, 1], a_shape[TOP, 1] - offsets[TOP, 1]),
        ):
            level = TOP + 1
            block[level, 0], block[level, 1] = top_x >> 1, top_y >> 1
            child[level] = (top_x & 1) + 2 * (top_y & 1)
            while level <= TOP + 1:
                if child[level] == 4:
                    level += 1
                    continue
                x = 2 * block[level, 0] + (child[level] & 1)
                y = 2 * block[level, 1] + (child[level] >> 1)
                child[level] = 4 if level == TOP + 1 else child[level] + 1
                finer = level - 1
                u, v = x - (base_x >> finer), y - (base_y >> finer)
                if u < 0 or v < 0 or u >= blocks_size[finer, 0] or v >= blocks_size[finer, 1]:
                    continue
                if not blocks[blocks_first[finer] + u * blocks_size[finer, 1] + v]:
                    continue
                if need is None:
                    if finer <= WITNESSED and _all_witnessed(
                        x, y, finer, offsets[0, 0], offsets[0, 1], at_a, a_words, a_voxels, at_b, b_words, b_voxels,
                        tall, base_x, base_y, stride, asked, witness, out,
                    ):  # fmt: skip
                        continue
                cells, n_cells, split = lists[level], counts[level], 1 if finer == TOP else 2
                dx, dy = offsets[finer, 0] + x, offsets[finer, 1] + y
                if need is None:
                    if finer == 1:
                        _decide(
                            a_some_row, a_some, a_first[1], a_shape[1, 0], a_shape[1, 1],
                            b_some_row, b_some, b_shape[1, 1],
                            cells, n_cells, x, y, dx, dy, at_a, a_words, a_voxels, at_b, b_words, b_voxels, tall,
                            base_x, base_y, stride, asked, witness, out,
                        )  # fmt: skip
                        continue
                    counts[finer] = _sift(
                        a_own_row, a_own, a_some_row, a_some, a_sure_row, a_sure,
                        a_first[finer], a_shape[finer, 0], a_shape[finer, 1],
                        b_some_row, b_some, b_sure_row, b_sure, b_first[finer], b_shape[finer, 1],
                        cells, n_cells, split, dx, dy, lists[finer],
                    )  # fmt: skip
                else:
                    counts[finer] = _sift_every(
                        a_own_row, a_own, a_some_row, a_some, a_sure_row, a_sure,
                        a_first[finer], a_shape[finer, 0], a_shape[finer, 1],
                        b_some_row, b_some, b_sure_row, b_sure, b_first[finer], b_shape[finer, 1],
                        cells, n_cells, split, dx, dy, lists[finer], need, wanted, lanes,
                    )  # fmt: skip
                if counts[finer] == SETTLED:
                    _settle(asked, base_x, base_y, stride, finer, x, y, out)
                elif counts[finer] > 0 and finer == 1:
                    if need is not None:
                        _decide_every(
                            lists[1], counts[1], x, y, dx, dy, at_a, a_words, a_voxels, at_b, b_words, b_voxels, tall,
                            base_x, base_y, stride, asked, need, wanted, lanes, out,
                        )  # fmt: skip
                elif counts[finer] > 0:
                    block[finer, 0], block[finer, 1] = x, y
                    child[finer] = 0
                    level = finer


@njit(cache=True, nogil=True, inline="always")
def _list_cells(row_of: Int32Array, first: int, n_x: int, n_y: int, cells: Int32Array) -> int:
    """List the cells of a level that hold anything; how many there are."""
    n = 0
    for x in range(n_x):
        for y in range(n_y):
            if row_of[first + x * n_y + y] != EMPTY:
                cells[n, 0], cells[n, 1] = x, y
                n += 1
    return n


@njit(cache=True, nogil=True, inline="always")
def _cells_of_block(n: int, base: int, stride: int, level: int, x: int) -> tuple[int, int]:
    """First and past-the-last cell of the window along one axis whose shift lies in a block."""
    first = -((base - (x << level)) // stride)
    stop = -((base - ((x + 1) << level)) // stride)
    return max(0, first), min(n, stop)


@njit(cache=True, nogil=True)
def _settle(
    asked: BoolArray, base_x: int, base_y: int, stride: int, level: int, x: int, y: int, out: BoolArray
) -> None:
    """All shifts of a block meet: say so of those that are asked for."""
    i0, i1 = _cells_of_block(asked.shape[0], base_x, stride, level, x)
    j0, j1 = _cells_of_block(asked.shape[1], base_y, stride, level, y)
    for i in range(i0, i1):
        for j in range(j0, j1):
            out[i, j] = asked[i, j]


@njit(cache=True, nogil=True, inline="always")
def _sift(
    a_own_row: Int32Array,
    a_own: Words,
    a_some_row: Int32Array,
    a_some: Words,
    a_sure_row: Int32Array,
    a_sure: Words,
    a_first: int,
    a_x: int,
    a_y: int,
    b_some_row: Int32Array,
    b_some: Words,
    b_sure_row: Int32Array,
    b_sure: Words,
    b_first: int,
    b_y: int,
    cells: Int32Array,
    n_cells: int,
    split: int,
    dx: int,
    dy: int,
    kept: Int32Array,
) -> int:
    """Keep the cells (split: 1) or the children of cells (split: 2) that can meet A.

    Returns:
        How many; 0 if the block cannot meet, SETTLED if it does whatever the shift.
    """
    n = 0
    for c in range(n_cells):
        for part in range(split * split):
            x, y = split * cells[c, 0] + (part & 1), split * cells[c, 1] + (part >> 1)
            i, j = x + dx, y + dy
            if i < 0 or j < 0 or i >= a_x or j >= a_y:
                continue
            cell_a, cell_b = np.uint64(a_first + i * a_y + j), np.uint64(b_first + x * b_y + y)
            row_a, row_b = a_some_row[cell_a], b_some_row[cell_b]
            if row_a == EMPTY or row_b == EMPTY or _common(a_some, row_a, b_some, row_b) == 0:
                continue
            sure_a, sure_b = a_sure_row[cell_a], b_sure_row[cell_b]
            if (sure_a != EMPTY and _common(a_sure, sure_a, b_some, row_b) != 0) or (
                sure_b != EMPTY and _common(a_own, a_own_row[cell_a], b_sure, sure_b) != 0
            ):
                _to_front(cells, c)
                return SETTLED
            kept[n, 0], kept[n, 1] = x, y
            n += 1
    return n


@njit(cache=True, nogil=True, inline="always")
def _sift_every(
    a_own_row: Int32Array,
    a_own: Words,
    a_some_row: Int32Array,
    a_some: Words,
    a_sure_row: Int32Array,
    a_sure: Words,
    a_first: int,
    a_x: int,
    a_y: int,
    b_some_row: Int32Array,
    b_some: Words,
    b_sure_row: Int32Array,
    b_sure: Words,
    b_first: int,
    b_y: int,
    cells: Int32Array,
    n_cells: int,
    split: int,
    dx: int,
    dy: int,
    kept: Int32Array,
    need: np.uint64,
    wanted: np.uint64,
    lanes: int,
) -> int:
    """`_sift` where all bits of `need` must occur; `wanted` has them in every lane."""
    n, seen, sure = 0, np.uint64(0), np.uint64(0)
    for c in range(n_cells):
        for part in range(split * split):
            x, y = split * cells[c, 0] + (part & 1), split * cells[c, 1] + (part >> 1)
            i, j = x + dx, y + dy
            if i < 0 or j < 0 or i >= a_x or j >= a_y:
                continue
            cell_a, cell_b = np.uint64(a_first + i * a_y + j), np.uint64(b_first + x * b_y + y)
            row_b = b_some_row[cell_b]
            common = _common(a_some, a_some_row[cell_a], b_some, row_b) & wanted
            if common == 0:
                continue
            seen |= common
            sure |= _common(a_sure, a_sure_row[cell_a], b_some, row_b)
            sure |= _common(a_own, a_own_row[cell_a], b_sure, b_sure_row[cell_b])
            kept[n, 0], kept[n, 1] = x, y
            n += 1
    if _in_some_lane(sure, lanes) & need == need:
        return SETTLED
    return n if _in_some_lane(seen, lanes) & need == need else 0


@njit(cache=True, nogil=True, inline="always")
def _common(a: Words, row_a: int, b: Words, row_b: int) -> np.uint64:
    """Bits that two rows have in common, in whichever slab."""
    at_a, at_b = _at(row_a), _at(row_b)
    common = np.uint64(0)
    for w in range(np.uint64(SLABS)):
        common |= a[at_a + w] & b[at_b + w]
    return common


@njit(cache=True, nogil=True, inline="always")
def _repeated(bits: np.uint64, lanes: int) -> np.uint64:
    """The same bits in every lane."""
    out = np.uint64(0)
    for lane in range(lanes):
        out |= bits << np.uint64(lane * (WORD // lanes))
    return out


@njit(cache=True, nogil=True, inline="always")
def _in_some_lane(bits: np.uint64, lanes: int) -> np.uint64:
    """Bits that occur in some lane, as those of the first; what lies beyond them has no meaning."""
    out = np.uint64(0)
    for lane in range(lanes):
        out |= bits >> np.uint64(lane * (WORD // lanes))
    return out


@njit(cache=True, nogil=True, inline="always")
def _to_front(cells: Int32Array, c: int) -> None:
    for k in range(2):
        cells[c, k], cells[0, k] = cells[0, k], cells[c, k]


@njit(cache=True, nogil=True, inline="always")
def _all_witnessed(
    x: int,
    y: int,
    level: int,
    off_x: int,
    off_y: int,
    at_a: Int32Array,
    a_words: Words,
    a_voxels: Words,
    at_b: Int32Array,
    b_words: Words,
    b_voxels: Words,
    tall: int,
    base_x: int,
    base_y: int,
    stride: int,
    asked: BoolArray,
    witness: IntArray,
    out: BoolArray,
) -> bool:
    """Try the column that settled the last shift on those of a block, until it fails."""
    column = at_b[witness[0], witness[1]]
    i0, i1 = _cells_of_block(asked.shape[0], base_x, stride, level, x)
    j0, j1 = _cells_of_block(asked.shape[1], base_y, stride, level, y)
    for i in range(i0, i1):
        for j in range(j0, j1):
            if asked[i, j] and not out[i, j]:
                u = witness[0] + off_x + base_x + i * stride
                v = witness[1] + off_y + base_y + j * stride
                if u < 0 or v < 0 or u >= at_a.shape[0] or v >= at_a.shape[1]:
                    return False
                if not _share_voxel(a_words, a_voxels, at_a[u, v], b_words, b_voxels, column, tall):
                    return False
                out[i, j] = True
    return True


@njit(cache=True, nogil=True, inline="always")
def _decide(  # noqa: C901
    a_row: Int32Array,
    a: Words,
    a_first: int,
    a_x: int,
    a_y: int,
    b_row: Int32Array,
    b: Words,
    b_y: int,
    cells: Int32Array,
    n_cells: int,
    block_x: int,
    block_y: int,
    dx: int,
    dy: int,
    at_a: Int32Array,
    a_words: Words,
    a_voxels: Words,
    at_b: Int32Array,
    b_words: Words,
    b_voxels: Words,
    tall: int,
    base_x: int,
    base_y: int,
    stride: int,
    asked: BoolArray,
    witness: IntArray,
    out: BoolArray,
) -> None:
    """Decide the four shifts of a block of level 1, from the cells that are left of its parent."""
    i0, i1 = _cells_of_block(asked.shape[0], base_x, stride, 1, block_x)
    j0, j1 = _cells_of_block(asked.shape[1], base_y, stride, 1, block_y)
    left = 0
    for u in range(i0, i1):
        for v in range(j0, j1):
            left += asked[u, v] and not out[u, v]
    for c in range(n_cells):
        for part in range(4):
            x, y = 2 * cells[c, 0] + (part & 1), 2 * cells[c, 1] + (part >> 1)
            i, j = x + dx, y + dy
            if i < 0 or j < 0 or i >= a_x or j >= a_y:
                continue
            row_a, row_b = a_row[np.uint64(a_first + i * a_y + j)], b_row[np.uint64(x * b_y + y)]
            if row_a == EMPTY or row_b == EMPTY or _common(a, row_a, b, row_b) == 0:
                continue
            near = _near_of_four(at_a, a_words, np.uint64(2 * i), np.uint64(2 * j), at_b, b_words, 2 * x, 2 * y)
            for u in range(i0, i1):
                for v in range(j0, j1):
                    sx, sy = base_x + u * stride - 2 * block_x, base_y + v * stride - 2 * block_y
                    if near[2 * sx + sy] == 0 or not asked[u, v] or out[u, v]:
                        continue
                    for p in range(2):
                        for q in range(2):
                            if not out[u, v] and _share_voxel(
                                a_words, a_voxels, at_a[np.uint64(2 * i + sx + p), np.uint64(2 * j + sy + q)],
                                b_words, b_voxels, at_b[np.uint64(2 * x + p), np.uint64(2 * y + q)], tall,
                            ):  # fmt: skip
                                out[u, v] = True
                                witness[0], witness[1] = 2 * x + p, 2 * y + q
                                left -= 1
            if left == 0:
                _to_front(cells, c)
                return


@njit(cache=True, nogil=True, inline="always")
def _near_of_four(
    at_a: Int32Array, a: Words, u: np.uint64, v: np.uint64, at_b: Int32Array, b: Words, x: int, y: int
) -> tuple[np.uint64, np.uint64, np.uint64, np.uint64]:
    """Bits that two by two columns of B, from (x, y) on, have in common with A's, from (u, v) on, shifted by (0, 0),
    (0, 1), (1, 0) and (1, 1).
    """
    one, two = np.uint64(1), np.uint64(2)
    a00, a01, a02 = _at(at_a[u, v]), _at(at_a[u, v + one]), _at(at_a[u, v + two])
    a10, a11, a12 = _at(at_a[u + one, v]), _at(at_a[u + one, v + one]), _at(at_a[u + one, v + two])
    a20, a21, a22 = _at(at_a[u + two, v]), _at(at_a[u + two, v + one]), _at(at_a[u + two, v + two])
    i, j = np.uint64(x), np.uint64(y)
    b00, b01 = _at(at_b[i, j]), _at(at_b[i, j + one])
    b10, b11 = _at(at_b[i + one, j]), _at(at_b[i + one, j + one])
    n00, n01, n10, n11 = np.uint64(0), np.uint64(0), np.uint64(0), np.uint64(0)
    for w in range(np.uint64(SLABS)):
        w00, w01, w10, w11 = b[b00 + w], b[b01 + w], b[b10 + w], b[b11 + w]
        middle = a[a11 + w]
        n00 |= (a[a00 + w] & w00) | (a[a01 + w] & w01) | (a[a10 + w] & w10) | (middle & w11)
        n01 |= (a[a01 + w] & w00) | (a[a02 + w] & w01) | (middle & w10) | (a[a12 + w] & w11)
        n10 |= (a[a10 + w] & w00) | (middle & w01) | (a[a20 + w] & w10) | (a[a21 + w] & w11)
        n11 |= (middle & w00) | (a[a12 + w] & w01) | (a[a21 + w] & w10) | (a[a22 + w] & w11)
    return n00, n01, n10, n11


@njit(cache=True, nogil=True, inline="always")
def _at(row: int) -> np.uint64:
    """Where a row begins; unsigned, or every look would ask whether the index is negative."""
    return np.uint64(row) * np.uint64(SLABS)


@njit(cache=True, nogil=True, inline="always")
def _decide_every(
    cells: Int32Array,
    n_cells: int,
    block_x: int,
    block_y: int,
    dx: int,
    dy: int,
    at_a: Int32Array,
    a_words: Words,
    a_voxels: Words,
    at_b: Int32Array,
    b_words: Words,
    b_voxels: Words,
    tall: int,
    base_x: int,
    base_y: int,
    stride: int,
    asked: BoolArray,
    need: np.uint64,
    wanted: np.uint64,
    lanes: int,
    out: BoolArray,
) -> None:
    """Decide the shifts of a block of level 1 where all bits of `need` must occur; `wanted` has them in every lane."""
    i0, i1 = _cells_of_block(asked.shape[0], base_x, stride, 1, block_x)
    j0, j1 = _cells_of_block(asked.shape[1], base_y, stride, 1, block_y)
    for u in range(i0, i1):
        for v in range(j0, j1):
            if not asked[u, v]:
                continue
            seen = np.uint64(0)
            for c in range(n_cells):
                sx = 2 * (cells[c, 0] + dx) + (base_x + u * stride - 2 * block_x)
                sy = 2 * (cells[c, 1] + dy) + (base_y + v * stride - 2 * block_y)
                for p in range(2):
                    for q in range(2):
                        seen |= wanted & _common_of_voxels(
                            a_words, a_voxels, at_a[sx + p, sy + q],
                            b_words, b_voxels, at_b[2 * cells[c, 0] + p, 2 * cells[c, 1] + q], tall,
                        )  # fmt: skip
            out[u, v] = _in_some_lane(seen, lanes) & need == need


@njit(cache=True, nogil=True, inline="always")
def _share_voxel(
    a_words: Words, a_voxels: Words, row_a: int, b_words: Words, b_voxels: Words, row_b: int, tall: int
) -> bool:
    """Whether two columns share a voxel in some frame."""
    if row_a == EMPTY or row_b == EMPTY or _common(a_words, row_a, b_words, row_b) == 0:
        return False
    if tall == 1:
        return True
    return bool(_common_of_voxels(a_words, a_voxels, row_a, b_words, b_voxels, row_b, tall) != 0)


@njit(cache=True, nogil=True, inline="always")
def _common_of_voxels(
    a_words: Words, a_voxels: Words, row_a: int, b_words: Words, b_voxels: Words, row_b: int, tall: int
) -> np.uint64:
    """The bits that two columns have in common in some voxel, in whichever slab."""
    at_a, at_b = _at(row_a), _at(row_b)
    size, common = np.uint64(tall), np.uint64(0)
    for w in range(np.uint64(SLABS)):
        if a_words[at_a + w] & b_words[at_b + w] != 0:
            for k in range(size):
                common |= a_voxels[(at_a + w) * size + k] & b_voxels[(at_b + w) * size + k]
    return common
