"""Where do two volumes meet? Exact, for every shift of B in a window, with work that grows with the boundary of the
answer.

Two volumes meet at a shift if some voxel of A and some voxel of shifted B coincide and have a bit in common (or, where
bits are asked for by name, if all of these occur somewhere). The window is halved again and again into square blocks
of shifts; for a block only those cells of B are looked at again, finer and over a shorter range of slabs, whose pooled
columns can still meet A's pooled columns for some shift of the block. A block is settled as a whole if nothing is left
that can meet, or if something meets whatever the shift; single shifts are decided column by column. Neighbours are
most often settled by the same cell: a cell that has settled a block moves to the front of its list, and the column
that settled the last shift is tried first on whole blocks of others.

The kernels take flat, uncounted arrays and are compiled into one: neighbouring looks share so little work that calls
and counts of references would cost more than the looks.
"""

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import BoolArray, Int32Array, IntArray, Words
from mhvedit.geometry.uncounted import uncounted
from mhvedit.search.pyramid import LEVELS, MOMENT_SLAB, TOP, Columns, Pyramid, TurnedColumns, level_of
from mhvedit.search.scratch import Scratch

SETTLED = -1  # a block that meets whatever the shift
WITNESSED = 3  # the coarsest level at which the last witness is tried on all shifts of a block


def meets(
    a: Pyramid,
    b: TurnedColumns,
    *,
    base: IntArray,
    stride: int,
    asked: BoolArray,
    every: Words | None = None,
    scratch: Scratch | None = None,
) -> BoolArray:
    """At which shifts A and turned B meet.

    Args:
        a: the volume at rest.
        b: the volume that is shifted, already turned; of as many moments as A.
        base: (2,) shift of cell (0, 0), in strides.
        stride: voxels between shifts.
        asked: (X, Y) which shifts to decide; the others come back False.
        every: (W,) bits that must all occur in common, at least one; None: any bit.
        scratch: to lay the result into; what was laid there before is lost.

    Returns:
        (X, Y).
    """
    scratch = scratch or Scratch()
    out = scratch.array("met", asked.shape, np.bool_)
    out[:] = False
    roots = _roots(level_of(b.some, TOP), *_facing_words(a.columns, b.columns))
    if len(roots) and a.columns.words.size:
        any_bit = every is None or a.columns.slab == MOMENT_SLAB
        need = np.zeros(a.columns.n_words, np.uint64) if every is None else every
        most = max(2, min(len(roots) << 2 * (TOP - 1), int(b.some.shape[1].prod())))
        lists = scratch.array("lists", (TOP + 1, most, 4), np.int32)
        _search(
            a.own.row_of, a.own.words.ravel(), a.some.row_of, a.some.words.ravel(), a.sure.row_of, a.sure.words.ravel(),
            a.some.first, a.some.shape, a.some.words.shape[1],
            b.some.row_of, b.some.words.ravel(), b.sure.row_of, b.sure.words.ravel(),
            b.some.first, b.some.shape, b.some.words.shape[1],
            b.starts - a.starts, b.starts[0] - a.columns.start,
            a.columns.column_of, a.columns.words, a.columns.voxels, b.column_of, b.columns.words, b.columns.voxels,
            _words_down(a.columns, b.columns), roots, lists, base * stride, stride,
            asked, *_asked_blocks(asked, base * stride, stride, scratch),
            any_bit, need, np.empty_like([need, need]), out,
        )  # fmt: skip
    return out


def _words_down(a: Columns, b: Columns) -> int:
    """From the number of a word of B to that of the word of A at its height."""
    return (b.first - a.first) * a.n_words


def _facing_words(a: Columns, b: Columns) -> tuple[int, int]:
    """First and past-the-last word of B that lies at the height of one of A's."""
    down = _words_down(a, b)
    return max(0, -down), min(b.words.shape[1], a.words.shape[1] - down)


def _asked_blocks(
    asked: BoolArray, base: IntArray, stride: int, scratch: Scratch
) -> tuple[BoolArray, IntArray, IntArray]:
    """Which blocks of shifts contain one that is asked for: all levels in a row, where each begins, and their sizes."""
    last = base + (np.array(asked.shape) - 1) * stride
    sizes = np.where(LEVELS > 0, (last >> LEVELS) - (base >> LEVELS) + 1, 0)
    ends = np.cumsum(sizes[:, 0] * sizes[:, 1])
    first = np.append(0, ends[:-1])
    blocks = scratch.array("blocks", (int(ends[-1]),), np.bool_)
    blocks[:] = False
    _mark_blocks(asked, base, stride, blocks, first, sizes)
    return blocks, first, sizes


@njit(cache=True, nogil=True)
def _mark_blocks(
    asked: BoolArray, base: IntArray, stride: int, blocks: BoolArray, first: IntArray, sizes: IntArray
) -> None:
    for i in range(asked.shape[0]):
        row = first[1] + (((base[0] + i * stride) >> 1) - (base[0] >> 1)) * sizes[1, 1] - (base[1] >> 1)
        for j in range(asked.shape[1]):
            if asked[i, j]:
                blocks[row + ((base[1] + j * stride) >> 1)] = True
    for level in range(2, TOP + 1):
        low_x, low_y = base[0] >> level - 1, base[1] >> level - 1
        for x in range(sizes[level - 1, 0]):
            row = first[level] + (((low_x + x) >> 1) - (low_x >> 1)) * sizes[level, 1] - (low_y >> 1)
            for y in range(sizes[level - 1, 1]):
                if blocks[first[level - 1] + x * sizes[level - 1, 1] + y]:
                    blocks[row + ((low_y + y) >> 1)] = True


@njit(cache=True, nogil=True)
def _roots(level: Words, low: int, high: int) -> Int32Array:
    """Cells of a level that hold anything in a range of words: x, y and the range."""
    cells = np.empty((level.shape[0] * level.shape[1], 4), np.int32)
    n = 0
    for x in range(level.shape[0]):
        for y in range(level.shape[1]):
            if level[x, y, low:high].any():
                cells[n, 0], cells[n, 1], cells[n, 2], cells[n, 3] = x, y, low, high
                n += 1
    return cells[:n]


@njit(cache=True, nogil=True)  # one loop with its own stack: compiled recursion does not survive the cache
def _search(  # noqa: C901
    a_own_row: Int32Array,
    a_own: Words,
    a_some_row: Int32Array,
    a_some: Words,
    a_sure_row: Int32Array,
    a_sure: Words,
    a_first: IntArray,
    a_shape: IntArray,
    a_n: int,
    b_some_row: Int32Array,
    b_some: Words,
    b_sure_row: Int32Array,
    b_sure: Words,
    b_first: IntArray,
    b_shape: IntArray,
    b_n: int,
    offsets: IntArray,
    columns_off: IntArray,
    at_a: Int32Array,
    a_words: Words,
    a_voxels: Words,
    at_b: Int32Array,
    b_words: Words,
    b_voxels: Words,
    down: int,
    roots: Int32Array,
    lists: Int32Array,
    base: IntArray,
    stride: int,
    asked: BoolArray,
    blocks: BoolArray,
    blocks_first: IntArray,
    blocks_size: IntArray,
    any_bit: bool,
    need: Words,
    scratch: Words,
    out: BoolArray,
) -> None:
    """Descend through the blocks of shifts, depth first; `lists` holds what is left of B on the way down."""
    a_own_row, a_some_row, a_sure_row = uncounted(a_own_row), uncounted(a_some_row), uncounted(a_sure_row)
    a_own, a_some, a_sure = uncounted(a_own), uncounted(a_some), uncounted(a_sure)
    b_some_row, b_sure_row = uncounted(b_some_row), uncounted(b_sure_row)
    b_some, b_sure = uncounted(b_some), uncounted(b_sure)
    at_a, a_words, a_voxels = uncounted(at_a), uncounted(a_words), uncounted(a_voxels)
    at_b, b_words, b_voxels = uncounted(at_b), uncounted(b_words), uncounted(b_voxels)
    roots, lists, asked, need, out = (
        uncounted(roots),
        uncounted(lists),
        uncounted(asked),
        uncounted(need),
        uncounted(out),
    )
    seen, sure = uncounted(scratch[0]), uncounted(scratch[1])
    counts = np.zeros(TOP + 2, np.int64)
    child = np.zeros(TOP + 2, np.int64)
    block = np.zeros((TOP + 2, 2), np.int64)
    witness, column = lists[0, 0], lists[0, 1]
    witness[:] = 0
    base_x, base_y = base
    off_x, off_y = columns_off
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
                if finer == 0:
                    _decide(
                        x, y, lists[1], counts[1], off_x, off_y, at_a, a_words, a_voxels, at_b, b_words, b_voxels,
                        down, base_x, base_y, stride, asked, any_bit, need, seen, witness, column, out,
                    )  # fmt: skip
                    continue
                u, v = x - (base_x >> finer), y - (base_y >> finer)
                if u < 0 or v < 0 or u >= blocks_size[finer, 0] or v >= blocks_size[finer, 1]:
                    continue
                if not blocks[blocks_first[finer] + u * blocks_size[finer, 1] + v]:
                    continue
                if finer <= WITNESSED and any_bit and _all_witnessed(
                    x, y, finer, off_x, off_y, at_a, a_words, a_voxels, at_b, b_words, b_voxels,
                    down, base_x, base_y, stride, asked, need, witness, out,
                ):  # fmt: skip
                    continue
                at_top = finer == TOP
                cells, n_cells = (roots, roots.shape[0]) if at_top else (lists[level], counts[level])
                split, dx, dy = 1 if at_top else 2, offsets[finer, 0] + x, offsets[finer, 1] + y
                if any_bit:
                    counts[finer] = _sift(
                        a_own_row, a_own, a_some_row, a_some, a_sure_row, a_sure,
                        a_first[finer], a_shape[finer, 0], a_shape[finer, 1], a_n,
                        b_some_row, b_some, b_sure_row, b_sure, b_first[finer], b_shape[finer, 1], b_n,
                        cells, n_cells, split, dx, dy, down, lists[finer], need.shape[0],
                    )  # fmt: skip
                else:
                    counts[finer] = _sift_every(
                        a_own_row, a_own, a_some_row, a_some, a_sure_row, a_sure,
                        a_first[finer], a_shape[finer, 0], a_shape[finer, 1], a_n,
                        b_some_row, b_some, b_sure_row, b_sure, b_first[finer], b_shape[finer, 1], b_n,
                        cells, n_cells, split, dx, dy, down, lists[finer], need, seen, sure,
                    )  # fmt: skip
                if counts[finer] == SETTLED:
                    _settle(asked, base_x, base_y, stride, finer, x, y, out)
                elif counts[finer] > 0:
                    block[finer, 0], block[finer, 1] = x, y
                    child[finer] = 0
                    level = finer


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
    a_n: int,
    b_some_row: Int32Array,
    b_some: Words,
    b_sure_row: Int32Array,
    b_sure: Words,
    b_first: int,
    b_y: int,
    b_n: int,
    cells: Int32Array,
    n_cells: int,
    split: int,
    dx: int,
    dy: int,
    down: int,
    kept: Int32Array,
    n_words: int,
) -> int:
    """Keep the cells (split: 1) or the children of cells (split: 2) that can meet A.

    Returns:
        How many; 0 if the block cannot meet, SETTLED if it does whatever the shift.
    """
    n = 0
    for c in range(n_cells):
        low, high = np.uint64(cells[c, 2]), np.uint64(cells[c, 3])
        for part in range(split * split):
            x, y = split * cells[c, 0] + (part & 1), split * cells[c, 1] + (part >> 1)
            i, j = x + dx, y + dy
            if i < 0 or j < 0 or i >= a_x or j >= a_y:
                continue
            cell_a, cell_b = a_first + i * a_y + j, b_first + x * b_y + y
            if a_some_row[cell_a] < 0 or b_some_row[cell_b] < 0:
                continue
            some_a, some_b = _row(a_some_row[cell_a], a_n, down), _row(b_some_row[cell_b], b_n, 0)
            if _shared(a_some, some_a, b_some, some_b, low, high) == 0:
                continue
            sure = np.uint64(0)
            if a_sure_row[cell_a] >= 0:
                sure |= _shared(a_sure, _row(a_sure_row[cell_a], a_n, down), b_some, some_b, low, high)
            if b_sure_row[cell_b] >= 0 and a_own_row[cell_a] >= 0:
                own_a, sure_b = _row(a_own_row[cell_a], a_n, down), _row(b_sure_row[cell_b], b_n, 0)
                sure |= _shared(a_own, own_a, b_sure, sure_b, low, high)
            if sure != 0:
                _to_front(cells, c)
                return SETTLED
            kept[n, 0], kept[n, 1] = x, y
            kept[n, 2], kept[n, 3] = _span(a_some, some_a, b_some, some_b, low, high, n_words)
            n += 1
    return n


@njit(cache=True, nogil=True, inline="always")
def _sift_every(  # noqa: C901
    a_own_row: Int32Array,
    a_own: Words,
    a_some_row: Int32Array,
    a_some: Words,
    a_sure_row: Int32Array,
    a_sure: Words,
    a_first: int,
    a_x: int,
    a_y: int,
    a_n: int,
    b_some_row: Int32Array,
    b_some: Words,
    b_sure_row: Int32Array,
    b_sure: Words,
    b_first: int,
    b_y: int,
    b_n: int,
    cells: Int32Array,
    n_cells: int,
    split: int,
    dx: int,
    dy: int,
    down: int,
    kept: Int32Array,
    need: Words,
    seen: Words,
    sure: Words,
) -> int:
    """`_sift` where all bits of `need` must occur."""
    n_words = need.shape[0]
    seen[:] = 0
    sure[:] = 0
    n = 0
    for c in range(n_cells):
        for part in range(split * split):
            x, y = split * cells[c, 0] + (part & 1), split * cells[c, 1] + (part >> 1)
            i, j = x + dx, y + dy
            if i < 0 or j < 0 or i >= a_x or j >= a_y:
                continue
            cell_a, cell_b = a_first + i * a_y + j, b_first + x * b_y + y
            if a_some_row[cell_a] < 0 or b_some_row[cell_b] < 0:
                continue
            some_a, some_b = _row(a_some_row[cell_a], a_n, down), _row(b_some_row[cell_b], b_n, 0)
            own_a, sure_a = _row(a_own_row[cell_a], a_n, down), _row(a_sure_row[cell_a], a_n, down)
            sure_b = _row(b_sure_row[cell_b], b_n, 0)
            low, high = -1, -1
            for slab in range(cells[c, 2], cells[c, 3], n_words):
                for f in range(n_words):
                    w = np.uint64(slab + f)
                    common = a_some[some_a + w] & b_some[some_b + w] & need[f]
                    if common == 0:
                        continue
                    seen[f] |= common
                    if a_sure_row[cell_a] >= 0:
                        sure[f] |= a_sure[sure_a + w] & common
                    if b_sure_row[cell_b] >= 0 and a_own_row[cell_a] >= 0:
                        sure[f] |= a_own[own_a + w] & b_sure[sure_b + w]
                    low, high = slab if low < 0 else low, slab
            if low >= 0:
                kept[n, 0], kept[n, 1], kept[n, 2], kept[n, 3] = x, y, low, high + n_words
                n += 1
    if _has_all(sure, need):
        return SETTLED
    return n if _has_all(seen, need) else 0


@njit(cache=True, nogil=True, inline="always")
def _shared(a: Words, at_a: np.uint64, b: Words, at_b: np.uint64, low: np.uint64, high: np.uint64) -> np.uint64:
    """Bits that two rows have in common over a range of words."""
    common = np.uint64(0)
    for w in range(low, high):
        common |= a[at_a + w] & b[at_b + w]
    return common


@njit(cache=True, nogil=True, inline="always")
def _span(
    a: Words, at_a: np.uint64, b: Words, at_b: np.uint64, low: np.uint64, high: np.uint64, n_words: int
) -> tuple[int, int]:
    """The range of whole slabs outside which two rows, which do meet, have nothing in common."""
    one = np.uint64(1)
    while a[at_a + low] & b[at_b + low] == 0:
        low += one
    while a[at_a + high - one] & b[at_b + high - one] == 0:
        high -= one
    start, stop = int(low), int(high)
    if n_words > 1:  # divisions take as long as all the rest
        start, stop = start - start % n_words, stop + -stop % n_words
    return start, stop


@njit(cache=True, nogil=True, inline="always")
def _row(row: int, n_words: int, offset: int) -> np.uint64:
    """Where a row begins; unsigned, or every look would ask whether the index is negative."""
    return np.uint64(row * n_words + offset)


@njit(cache=True, nogil=True, inline="always")
def _to_front(cells: Int32Array, c: int) -> None:
    for k in range(4):
        cells[c, k], cells[0, k] = cells[0, k], cells[c, k]


@njit(cache=True, nogil=True, inline="always")
def _has_all(seen: Words, need: Words) -> bool:
    for w in range(need.shape[0]):
        if need[w] & ~seen[w] != 0:
            return False
    return True


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
    down: int,
    base_x: int,
    base_y: int,
    stride: int,
    asked: BoolArray,
    need: Words,
    witness: Int32Array,
    out: BoolArray,
) -> bool:
    """Try the column that settled the last shift on those of a block, until it fails."""
    i0, i1 = _cells_of_block(asked.shape[0], base_x, stride, level, x)
    j0, j1 = _cells_of_block(asked.shape[1], base_y, stride, level, y)
    for i in range(i0, i1):
        for j in range(j0, j1):
            if asked[i, j] and not out[i, j]:
                dx, dy = off_x + base_x + i * stride, off_y + base_y + j * stride
                if not _column_settles(
                    witness, dx, dy, at_a, a_words, a_voxels, at_b, b_words, b_voxels, down, True, need, need
                ):
                    return False
                out[i, j] = True
    return True


@njit(cache=True, nogil=True, inline="always")
def _decide(
    x: int,
    y: int,
    cells: Int32Array,
    n_cells: int,
    off_x: int,
    off_y: int,
    at_a: Int32Array,
    a_words: Words,
    a_voxels: Words,
    at_b: Int32Array,
    b_words: Words,
    b_voxels: Words,
    down: int,
    base_x: int,
    base_y: int,
    stride: int,
    asked: BoolArray,
    any_bit: bool,
    need: Words,
    seen: Words,
    witness: Int32Array,
    column: Int32Array,
    out: BoolArray,
) -> None:
    """Decide a single shift, if it is asked for and still open, column by column."""
    i, j = (x - base_x) // stride, (y - base_y) // stride
    if i * stride != x - base_x or j * stride != y - base_y:
        return
    if i < 0 or j < 0 or i >= asked.shape[0] or j >= asked.shape[1] or not asked[i, j] or out[i, j]:
        return
    seen[:] = 0
    for c in range(n_cells):
        column[2], column[3] = cells[c, 2], cells[c, 3]
        for part in range(4):
            column[0], column[1] = 2 * cells[c, 0] + (part & 1), 2 * cells[c, 1] + (part >> 1)
            if _column_settles(
                column, off_x + x, off_y + y, at_a, a_words, a_voxels, at_b, b_words, b_voxels,
                down, any_bit, need, seen,
            ):  # fmt: skip
                out[i, j] = True
                witness[:] = column
                _to_front(cells, c)
                return


@njit(cache=True, nogil=True, inline="always")
def _column_settles(
    column: Int32Array,
    dx: int,
    dy: int,
    at_a: Int32Array,
    a_words: Words,
    a_voxels: Words,
    at_b: Int32Array,
    b_words: Words,
    b_voxels: Words,
    down: int,
    any_bit: bool,
    need: Words,
    seen: Words,
) -> bool:
    """Whether a column of B, over a range of its words, settles a shift: it meets A, in the last bit still needed."""
    i, j = column[0] + dx, column[1] + dy
    b = at_b[column[0], column[1]]
    if b < 0 or i < 0 or j < 0 or i >= at_a.shape[0] or j >= at_a.shape[1] or at_a[i, j] < 0:
        return False
    a = at_a[i, j]
    rise = a_voxels.shape[1] // a_words.shape[1]  # voxels' words to one word of a slab
    n_words = need.shape[0]
    for slab in range(column[2], column[3], n_words):
        near = np.uint64(0)
        for w in range(slab, slab + n_words):
            near |= a_words[a, w + down] & b_words[b, w]
        if near == 0:
            continue
        for at in range(slab * rise, (slab + n_words) * rise):
            common = a_voxels[a, at + down * rise] & b_voxels[b, at]
            if common != 0:
                if any_bit:
                    return True
                seen[at % n_words] |= common
    return not any_bit and _has_all(seen, need)
