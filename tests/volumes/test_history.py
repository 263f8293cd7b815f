"""Motion history volumes against sets of voxels, frame by frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray
from mhvedit.geometry.grid import VoxelGrid, ball_offsets, grown
from mhvedit.volumes.history import (
    NEVER,
    MotionHistoryVolume,
    difference,
    dilated,
    eroded,
    frame_mask,
    from_bits,
    history,
    intersection,
    trimmed,
    union,
    word_count,
)
from tests import oracles
from tests.oracles import Voxel

PITCH = 0.02
SEEDS = st.integers(0, 2**32 - 1)
TAUS = st.sampled_from([1, 2, 5, 64, 65, 130])
SOME = settings(max_examples=25, derandomize=True)
Frames = list[tuple[VoxelGrid, BoolArray]]


def random_frames(rng: np.random.Generator, tau: int, *, density: float = 0.3) -> Frames:
    """Boxes of any place and size, some of them empty."""
    frames = []
    for _ in range(tau):
        shape, start = rng.integers(1, 6, 3), rng.integers(-4, 3, 3)
        filled = np.asarray(rng.random(shape) < (density if rng.random() < 0.8 else 0))
        frames.append((VoxelGrid((int(start[0]), int(start[1]), int(start[2])), filled.shape, PITCH), filled))
    return frames


def random_volume(rng: np.random.Generator, tau: int, *, density: float = 0.3) -> MotionHistoryVolume:
    return history(random_frames(rng, tau, density=density))


def sets_of(frames: Frames) -> list[frozenset[Voxel]]:
    return [
        frozenset((int(x), int(y), int(z)) for x, y, z in np.argwhere(filled) + grid.start) for grid, filled in frames
    ]


def as_sets(volume: MotionHistoryVolume) -> list[frozenset[Voxel]]:
    return sets_of([(volume.grid, volume.at(i)) for i in range(volume.n_frames)])


def is_tight(volume: MotionHistoryVolume) -> bool:
    """Whether the box touches what is filled on all six sides."""
    filled = volume.filled
    sides = [np.asarray(filled.any(axis=tuple(a for a in range(3) if a != axis))) for axis in range(3)]
    return all(bool(side[0] and side[-1]) for side in sides)


# Equation 2


def test_a_sweeping_voxel_is_filled_when_it_passes() -> None:
    """Eq. 2 in closed form: at x = 3 + i in frame i."""
    tau = 7
    grid = VoxelGrid((0, 0, 0), (12, 2, 2), PITCH)
    frames = []
    for i in range(tau):
        filled = np.zeros(grid.shape, np.bool_)
        filled[3 + i, 1, 0] = True
        frames.append((grid, filled))
    sweep = history(frames)
    assert sweep.grid == VoxelGrid((3, 1, 0), (tau, 1, 1), PITCH) and sweep.n_frames == tau and sweep.last == tau - 1
    assert sweep.t_start[:, 0, 0].tolist() == sweep.t_end[:, 0, 0].tolist() == list(range(tau))
    np.testing.assert_allclose(sweep.centre, np.array([3 + (tau - 1) / 2, 1, 0]) * PITCH)


def test_a_bar_that_grows_and_shrinks() -> None:
    """Voxel x is filled from frame x to frame 9 - x."""
    grid = VoxelGrid((-2, 0, 0), (5, 1, 1), PITCH)
    volume = history([(grid, np.array([x <= i <= 9 - x for x in range(5)]).reshape(5, 1, 1)) for i in range(10)])
    assert volume.t_start[:, 0, 0].tolist() == [0, 1, 2, 3, 4]
    assert volume.t_end[:, 0, 0].tolist() == [9, 8, 7, 6, 5]


@given(seed=SEEDS, tau=TAUS)
@SOME
def test_each_voxel_keeps_the_whole_set_of_its_frames(seed: int, tau: int) -> None:
    frames = random_frames(np.random.default_rng(seed), tau)
    volume, plain = history(frames), oracles.history_of(sets_of(frames))
    assert as_sets(volume) == sets_of(frames)
    assert is_tight(volume) or not plain
    for x, y, z in np.ndindex(volume.grid.shape):
        when = plain.get(tuple(np.add((x, y, z), volume.grid.start).tolist()), frozenset())
        assert volume.t_start[x, y, z] == min(when, default=NEVER)
        assert volume.t_end[x, y, z] == max(when, default=NEVER)
        assert volume.filled[x, y, z] == bool(when)
    if plain:
        np.testing.assert_allclose(volume.centre, np.mean(sorted(plain), 0) * PITCH)


def test_a_volume_that_is_never_filled_has_no_centre() -> None:
    grid = VoxelGrid((4, 5, 6), (2, 3, 2), PITCH)
    empty = history([(grid, np.zeros(grid.shape, np.bool_))] * 3)
    assert not empty.filled.any() and np.isnan(empty.centre).all() and empty.grid.shape == (1, 1, 1)
    assert (empty.t_start == NEVER).all() and (empty.t_end == NEVER).all()


def test_frames_of_the_wrong_shape_are_refused() -> None:
    with pytest.raises(ShapeError, match="frames"):
        MotionHistoryVolume(VoxelGrid((0, 0, 0), (2, 2, 2), PITCH), np.zeros((2, 2, 2, 1), np.uint64), 65)


@pytest.mark.parametrize(("n_frames", "words"), [(1, 1), (64, 1), (65, 2), (128, 2), (129, 3)])
def test_sixty_four_frames_fit_a_word(n_frames: int, words: int) -> None:
    assert word_count(n_frames) == words


@pytest.mark.parametrize("frames", [range(0), range(1), range(3, 64), range(60, 70), range(70)])
def test_a_mask_has_the_bits_of_its_frames(frames: range) -> None:
    mask = frame_mask(70, frames)
    assert [i for i in range(128) if int(mask[i // 64]) >> (i % 64) & 1] == list(frames)


# Sets, frame by frame


@given(seed=SEEDS, tau=TAUS)
@SOME
def test_union_difference_and_intersection_are_those_of_sets_in_each_frame(seed: int, tau: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = random_volume(rng, tau), random_volume(rng, tau)
    pairs = list(zip(as_sets(a), as_sets(b), strict=True))
    assert as_sets(union(a, b).whole) == [p | q for p, q in pairs]
    assert as_sets(difference(a, b)) == [p - q for p, q in pairs]
    assert as_sets(intersection(a, b)) == [p & q for p, q in pairs]
    assert as_sets(union(difference(a, b), intersection(a, b)).whole) == as_sets(a)


def on_grid(volume: MotionHistoryVolume, grid: VoxelGrid) -> MotionHistoryVolume:
    """The same volume on a box that contains its own."""
    if grid == volume.grid:
        return volume
    frames = np.zeros((*grid.shape, volume.frames.shape[-1]), np.uint64)
    frames[volume.grid.slices_in(grid)] = volume.frames
    return MotionHistoryVolume(grid, frames, volume.n_frames)


@given(seed=SEEDS, tau=TAUS)
@SOME
def test_trimming_and_widening_change_the_box_and_nothing_else(seed: int, tau: int) -> None:
    volume = random_volume(np.random.default_rng(seed), tau)
    wide = on_grid(volume, grown(volume.grid, 3))
    assert as_sets(wide) == as_sets(volume)
    tight = trimmed(wide)
    assert as_sets(tight) == as_sets(volume)
    assert is_tight(tight) or not volume.filled.any()
    assert as_sets(from_bits(wide, wide.frames)) == as_sets(volume)
    assert on_grid(volume, volume.grid) is volume


@given(seed=SEEDS, tau=st.sampled_from([1, 3, 66]), radius=st.sampled_from([0.0, 0.9, 1.0, 1.5, 2.0, 2.3]))
@SOME
def test_dilation_and_erosion_are_scipys_in_each_frame(seed: int, tau: int, radius: float) -> None:
    volume = random_volume(np.random.default_rng(seed), tau, density=0.85)
    reach = int(radius) + 1
    outer = on_grid(volume, grown(volume.grid, reach))
    ball = np.zeros((2 * reach + 1,) * 3, np.bool_)
    ball[tuple((ball_offsets(radius) + reach).T)] = True
    wide = on_grid(dilated(volume, radius), outer.grid)
    for i in range(tau):
        np.testing.assert_array_equal(wide.at(i), ndimage.binary_dilation(outer.at(i), ball))
    narrow = [ndimage.binary_erosion(outer.at(i), ball) for i in range(tau)]
    assert as_sets(eroded(volume, radius)) == sets_of([(outer.grid, filled) for filled in narrow])


@given(seed=SEEDS)
@SOME
def test_eroding_leaves_what_is_deeper_than_the_radius(seed: int) -> None:
    """Fidelity's use of it: depth is the distance to the nearest empty voxel less half a voxel."""
    frames = random_frames(np.random.default_rng(seed), 2, density=0.9)
    for radius in (1.0, 1.5, 1.8):
        expected = [
            frozenset(p for p in filled if oracles.depth_in(filled, p) > radius - 0.5 + 1e-9)
            for filled in sets_of(frames)
        ]
        assert as_sets(eroded(history(frames), radius)) == expected


def test_volumes_are_left_as_they_were() -> None:
    volume = random_volume(np.random.default_rng(1), 3)
    volume.frames.flags.writeable = False
    for change in (trimmed, lambda v: dilated(v, 1), lambda v: eroded(v, 1), lambda v: union(v, v).whole):
        change(volume)
    difference(volume, volume)
    assert volume.t_start.shape == volume.grid.shape
