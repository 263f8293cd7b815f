"""`meets` against voxel-by-voxel brute force, on volumes large enough for every level of the pyramid."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.constraints.clauses import Meeting
from mhvedit.geometry.arrays import BoolArray, IntArray, Words
from mhvedit.geometry.grid import VoxelGrid
from mhvedit.search.columns import EMPTY, WORD, Columns, Layout, columns_of, fitted_layout, lanes_of, turned
from mhvedit.search.facing import facings_of
from mhvedit.search.meet import meets
from mhvedit.search.pyramid import SLABS, TOP, level_of, pyramid_of, turned_pyramid
from mhvedit.volumes.history import MotionHistoryVolume, frame_mask
from tests import oracles
from tests.oracles import Voxel

Bits = dict[Voxel, int]
TAU = 70  # two words


def boxes_and_crumbs(rng: np.random.Generator, reach: int, *, words: int = 2) -> MotionHistoryVolume:
    """A lattice box with random bits: some solid blocks of many frames, some lone voxels; its corner anywhere."""
    shape = rng.integers(1, reach, 3)
    frames = np.zeros((*shape, words), np.uint64)
    for _ in range(int(rng.integers(0, 4))):
        low = rng.integers(0, shape)
        high = low + rng.integers(1, reach, 3)
        frames[low[0] : high[0], low[1] : high[1], low[2] : high[2]] |= random_words(rng, words)
    for _ in range(int(rng.integers(0, 6))):
        frames[tuple(rng.integers(0, shape))] |= random_words(rng, words)
    start = rng.integers(-25, 26, 3)
    grid = VoxelGrid((int(start[0]), int(start[1]), int(start[2]) // 8), frames.shape[:3], 0.01)
    return MotionHistoryVolume(grid, frames, 64 * words - 58)


def random_words(rng: np.random.Generator, words: int) -> Words:
    """A few frames of six; at times all of them."""
    bits = rng.integers(0, 64, words).astype(np.uint64)
    return np.full(words, 63, np.uint64) if rng.random() < 0.3 else bits


def bits_of(volume: MotionHistoryVolume) -> Bits:
    """Voxel -> its frames as one integer."""
    start = volume.grid.start
    found = {}
    for x, y, z in np.argwhere(volume.filled):
        words = volume.frames[x, y, z]
        value = sum(int(word) << (64 * w) for w, word in enumerate(words))
        found[int(x) + start[0], int(y) + start[1], int(z) + start[2]] = value
    return found


def meets_slowly(a: Bits, b: Bits, shift: tuple[int, int], every: int | None) -> bool:
    common = 0
    for (x, y, z), bits in b.items():
        common |= bits & a.get((x + shift[0], y + shift[1], z), 0)
    return common != 0 if every is None else common & every == every


def meets_fast(
    a: MotionHistoryVolume,
    b: MotionHistoryVolume,
    yaw: float,
    base: IntArray,
    stride: int,
    asked: BoolArray,
    every: Words | None = None,
    thick: bool = True,
) -> BoolArray:
    """Whatever the number of frames; without `thick`, nothing is settled because B fills windows."""
    meeting = Meeting(a, b, every)
    parts = []
    for facing in facings_of([meeting])[id(meeting)]:
        b_turned = turned_pyramid(facing.b, yaw, solid=facing.solid and thick)
        parts.append(meets(facing.a, b_turned, base=base, stride=stride, asked=asked, every=facing.every))
    return np.asarray(np.logical_or.reduce(parts) if every is None else np.logical_and.reduce([asked, *parts]))


def check(
    a: MotionHistoryVolume,
    b: MotionHistoryVolume,
    yaw: float,
    base: IntArray,
    stride: int,
    asked: BoolArray,
    every: Words | None,
) -> BoolArray:
    """Compare, and return, the answer."""
    found = meets_fast(a, b, yaw, base, stride, asked, every)
    np.testing.assert_array_equal(meets_fast(a, b, yaw, base, stride, asked, every, thick=False), found)
    slow_a, slow_b = bits_of(a), oracles.turned(bits_of(b), yaw)
    need = None if every is None else sum(int(word) << (64 * w) for w, word in enumerate(every))
    expected = np.zeros_like(asked)
    for i, j in np.argwhere(asked):
        expected[i, j] = meets_slowly(slow_a, slow_b, ((base[0] + i) * stride, (base[1] + j) * stride), need)
    np.testing.assert_array_equal(found, expected)
    return found


@given(seed=st.integers(0, 2**32 - 1), stride=st.integers(1, 3), words=st.integers(1, 2), ask_all=st.booleans())
@settings(max_examples=40, derandomize=True)
def test_any_and_every_agree_with_brute_force(seed: int, stride: int, words: int, ask_all: bool) -> None:
    rng = np.random.default_rng(seed)
    a, b = boxes_and_crumbs(rng, 24, words=words), boxes_and_crumbs(rng, 12, words=words)
    size = rng.integers(1, 24, 2)
    base = (np.array(a.grid.start[:2]) - b.grid.start[:2] + rng.integers(-25, 10, 2)) // stride
    asked = np.ones(size, np.bool_) if ask_all else rng.random(size) < 0.4
    for every in (None, random_words(rng, words) | np.uint64(1)):
        check(a, b, float(rng.choice([0, 1, np.pi / 2, 4])), base, stride, asked, every)


@pytest.mark.parametrize(
    ("start", "shape"), [((-41, -23, 0), (85, 70, 3)), ((-48, -32, 0), (96, 64, 16)), ((-33, -31, 1), (65, 62, 1))]
)
def test_large_blocks_of_shifts_are_settled_as_a_whole_and_rightly(start: Voxel, shape: Voxel) -> None:
    """A slab of several top-level blocks, off and on their borders: inside all shifts meet, and the border is exact."""
    slab = MotionHistoryVolume(VoxelGrid(start, shape, 0.01), np.full((*shape, 1), 1, np.uint64), 1)
    dot = MotionHistoryVolume(VoxelGrid((7, -3, 1), (1, 1, 1), 0.01), np.full((1, 1, 1, 1), 1, np.uint64), 1)
    asked = np.ones((130, 110), np.bool_)
    found = meets_fast(slab, dot, 0.0, np.array([-65, -40]), 1, asked)
    x, y = np.arange(130) - 65 + 7, np.arange(110) - 40 - 3
    inside_x = (x >= start[0]) & (x < start[0] + shape[0])
    inside_y = (y >= start[1]) & (y < start[1] + shape[1])
    np.testing.assert_array_equal(found, inside_x[:, None] & inside_y[None])


def test_every_needs_all_bits_but_not_all_in_one_voxel() -> None:
    """Each frame of 70 is met in another voxel of a row."""
    row = np.zeros((TAU, 1, 1, 2), np.uint64)
    for i in range(TAU):
        row[i, 0, 0, i // 64] = np.uint64(1) << np.uint64(i % 64)
    a = MotionHistoryVolume(VoxelGrid((-30, 5, 2), (TAU, 1, 1), 0.01), row, TAU)
    asked, base = np.ones((41, 5), np.bool_), np.array([-20, -2])
    every = frame_mask(TAU, range(TAU))
    assert np.argwhere(check(a, a, 0.0, base, 1, asked, every)).tolist() == [[20, 2]]
    assert np.argwhere(check(a, a, 0.0, base, 1, asked, None)).tolist() == [[20, 2]]
    full = MotionHistoryVolume(a.grid, np.tile(every, (TAU, 1, 1, 1)), TAU)
    assert check(a, full, 0.0, base, 1, asked, every).sum() == 1
    some = check(a, full, 0.0, base, 1, asked, frame_mask(TAU, range(20, 50)))
    assert some.sum() == 41


def test_shifts_that_are_not_asked_for_come_back_false() -> None:
    rng = np.random.default_rng(0)
    volume = boxes_and_crumbs(rng, 20)
    found = meets_fast(volume, volume, 0.0, np.array([-3, -3]), 1, np.zeros((7, 7), np.bool_))
    assert not found.any()


@pytest.mark.parametrize("yaw", [0.0, np.pi / 2, np.pi, 3 * np.pi / 2])
def test_quarter_turns_move_voxels_onto_voxels(yaw: float) -> None:
    volume = boxes_and_crumbs(np.random.default_rng(7), 20, words=1)
    low = volume.grid.start[2]
    layout = fitted_layout(low, low + volume.grid.shape[2], n_frames=volume.n_frames, n_slabs=3)
    columns = turned(columns_of(volume, layout), yaw)
    c, s = round(np.cos(yaw)), round(np.sin(yaw))
    found = {}
    for i, j in np.argwhere(columns.column_of != EMPTY):
        for z, value in heights_of(columns.columns, int(columns.column_of[i, j])).items():
            found[int(columns.start[0] + i), int(columns.start[1] + j), z] = value
    assert found == {(c * x - s * y, s * x + c * y, z): bits for (x, y, z), bits in bits_of(volume).items()}


def heights_of(columns: Columns, column: int) -> dict[int, int]:
    """Lattice index along z -> frames as one integer."""
    layout, found = columns.layout, {}
    width = WORD // layout.lanes
    for z in range(layout.low, layout.high):
        stretch, voxel = divmod(z - layout.low, layout.tall)
        slab, lane = divmod(stretch, layout.lanes)
        bits = int(columns.voxels[column, slab * layout.tall + voxel]) >> (lane * width) & ((1 << width) - 1)
        if bits:
            found[z] = bits
    return found


def test_a_volume_of_one_moment_agrees_with_brute_force() -> None:
    """Bits are voxels there: columns of several words, off the border of words, and any bit for every."""
    rng = np.random.default_rng(5)
    for _ in range(30):
        pair = []
        for reach in (24, 12):
            many = boxes_and_crumbs(rng, reach, words=1)
            tall = np.repeat(many.frames, int(rng.integers(1, 12)), axis=2)
            grid = VoxelGrid(many.grid.start, tall.shape[:3], 0.01)
            pair.append(MotionHistoryVolume(grid, (tall != 0).astype(np.uint64), 1))
        a, b = pair
        base = np.array(a.grid.start[:2]) - b.grid.start[:2] - 8
        for every in (None, np.ones(1, np.uint64)):
            check(a, b, float(rng.choice([0, 2])), base, 1, rng.random((20, 20)) < 0.8, every)


@pytest.mark.parametrize("n_frames", [1, 6, 25, 60])
def test_frames_stand_in_lanes_side_by_side(n_frames: int) -> None:
    lanes = lanes_of(n_frames)
    assert lanes * n_frames <= WORD < 2 * lanes * n_frames or n_frames == 1
    layout = fitted_layout(-7, 200, n_frames=n_frames, n_slabs=SLABS)
    assert layout.high >= 200
    assert layout.tall == 1 or fitted_layout(-7, layout.high, n_frames=n_frames, n_slabs=SLABS) == layout


@pytest.mark.parametrize("n_frames", [1, 6])
def test_each_level_pools_what_some_and_what_every_shift_of_a_block_can_meet(n_frames: int) -> None:
    volume = boxes_and_crumbs(np.random.default_rng(11), 30, words=1)
    volume = MotionHistoryVolume(volume.grid, volume.frames & np.uint64(1 if n_frames == 1 else 63), n_frames)
    low = volume.grid.start[2]
    layout = Layout(low - 2, SLABS, lanes_of(n_frames), 2)
    columns, bits = columns_of(volume, layout), bits_of(volume)
    pyramid, still = pyramid_of(columns), turned_pyramid(columns, 0.0)
    for level in range(1, TOP + 1):
        size = 1 << level
        pools = (
            (pyramid.own, pyramid.starts, 0, size, any),
            (pyramid.some, pyramid.starts, 0, 2 * size - 1, any),
            (pyramid.sure, pyramid.starts, 0, 2 * size - 1, all),
            (still.some, still.starts, 0, size, any),
            (still.sure, still.starts, 1 - size, 2 * size - 1, all),
        )
        for found, starts, ahead, reach, pooled in pools:
            words = level_of(found, level)
            for x, y in np.ndindex(words.shape[:2]):
                first = (np.array([x, y]) + starts[level]) * size + ahead
                window = [(int(first[0]) + i, int(first[1]) + j) for i, j in np.ndindex(reach, reach)]
                expected = expected_row(bits, window, layout, n_frames, pooled)
                assert [int(word) for word in words[x, y]] == expected


def expected_row(
    bits: Bits, window: list[tuple[int, int]], layout: Layout, n_frames: int, pooled: Callable[[Iterable[bool]], bool]
) -> list[int]:
    """What a row holds, voxel by voxel."""
    row = []
    for slab in range(layout.n_slabs):
        word = 0
        for lane, frame in np.ndindex(layout.lanes, n_frames):
            heights = [layout.low + (slab * layout.lanes + lane) * layout.tall + v for v in range(layout.tall)]
            if pooled(bits.get((x, y, z), 0) >> frame & 1 == 1 for x, y in window for z in heights):
                word |= 1 << (lane * (WORD // layout.lanes) + frame)
        row.append(word)
    return row
