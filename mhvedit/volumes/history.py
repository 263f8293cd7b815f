"""The augmented motion history volume: in which frames of a key segment each voxel was filled (Shi et al., eq. 2).

The paper keeps the first and the last frame of each voxel. Here the whole set of frames is kept, one bit a frame, so
that a motion may re-enter a voxel, and a test over all frames at once is a bitwise AND; the interval is a view of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, ByteArray, FloatArray, Int32Array, IntArray, Words
from mhvedit.geometry.grid import VoxelGrid, ball_offsets, cropped, overlap, united
from mhvedit.geometry.uncounted import uncounted

NEVER = -1  # t_start and t_end of a voxel that is never filled


@dataclass(frozen=True, slots=True, eq=False)
class MotionHistoryVolume:
    """In which frames of one key segment each voxel was filled (Shi et al., eq. 2, with the whole set of frames)."""

    grid: VoxelGrid
    frames: Words  # (X, Y, Z, W) uint64, bit i of word w: frame 64 w + i
    n_frames: int  # tau

    def __post_init__(self) -> None:
        expected = (*self.grid.shape, word_count(self.n_frames))
        if self.frames.shape != expected:
            raise ShapeError("frames", self.frames.shape, expected)

    @property
    def pieces(self) -> "tuple[MotionHistoryVolume, ...]":
        """Itself, as of a `UnitedVolume`."""
        return (self,)

    @property
    def whole(self) -> "MotionHistoryVolume":
        """Itself, likewise."""
        return self

    @property
    def last(self) -> int:
        """T_end: the last frame of the segment."""
        return self.n_frames - 1

    @property
    def filled(self) -> BoolArray:
        """(X, Y, Z) voxels that are filled in some frame."""
        found = self.frames[..., 0] != 0
        for word in range(1, self.frames.shape[-1]):
            found |= self.frames[..., word] != 0
        return np.asarray(found)

    @property
    def t_start(self) -> Int32Array:
        """(X, Y, Z) first frame in which each voxel is filled; NEVER where there is none."""
        return np.asarray(_first_bits(_rows(self.frames))).reshape(self.grid.shape)

    @property
    def t_end(self) -> Int32Array:
        """(X, Y, Z) last frame in which each voxel is filled; NEVER where there is none."""
        return np.asarray(_last_bits(_rows(self.frames))).reshape(self.grid.shape)

    @property
    def centre(self) -> FloatArray:
        """(3,) centre of gravity of all voxels that are ever filled, m (Shi et al., section 3.1: C)."""
        sums, count = _sums(self.frames)
        if count == 0:
            return np.full(3, np.nan)
        return np.asarray((sums / count + np.array(self.grid.start)) * self.grid.pitch)

    def at(self, frame: int) -> BoolArray:
        """(X, Y, Z) voxels that are filled in one frame."""
        return np.asarray(self.frames[..., frame // 64] >> np.uint64(frame % 64) & np.uint64(1), bool)


@dataclass(frozen=True, eq=False)  # no slots: the whole is made when it is first asked for
class UnitedVolume:
    """Volumes of the same frames as one, filled where any of them is; the box around them may be many times theirs."""

    pieces: tuple[MotionHistoryVolume, ...]  # at least one

    @property
    def n_frames(self) -> int:
        """Tau."""
        return self.pieces[0].n_frames

    @cached_property
    def grid(self) -> VoxelGrid:
        """The smallest box that contains those of all."""
        return united([piece.grid for piece in self.pieces])

    @cached_property
    def whole(self) -> MotionHistoryVolume:
        """The volume on the box around all."""
        frames = np.zeros((*self.grid.shape, word_count(self.n_frames)), np.uint64)
        for piece in self.pieces:
            frames[piece.grid.slices_in(self.grid)] |= piece.frames
        return MotionHistoryVolume(self.grid, frames, self.n_frames)


Volume = MotionHistoryVolume | UnitedVolume


def word_count(n_frames: int) -> int:
    """How many 64-bit words hold one bit a frame."""
    return max(1, -(-n_frames // 64))


def frame_mask(n_frames: int, frames: range) -> Words:
    """(W,) words in which the bits of the given frames are set.

    >>> [hex(int(word)) for word in frame_mask(70, range(2, 66))]
    ['0xfffffffffffffffc', '0x3']
    """
    bits = np.zeros(word_count(n_frames) * 64, np.uint8)
    bits[list(frames)] = 1
    return np.packbits(bits, bitorder="little").view("<u8").astype(np.uint64)


def history(volumes: Sequence[tuple[VoxelGrid, BoolArray]]) -> MotionHistoryVolume:
    """Stack the filled voxels of successive frames (Shi et al., eq. 2).

    Args:
        volumes: per frame its box and (X, Y, Z) which voxels are filled; frames may be empty.

    Returns:
        The volume, on the smallest box around everything that is ever filled.
    """
    boxes = [cropped(filled, grid) for grid, filled in volumes]
    some = [bool(filled[box.slices_in(grid)].any()) for box, (grid, filled) in zip(boxes, volumes, strict=True)]
    occupied = [box for box, there in zip(boxes, some, strict=True) if there]
    grid = united(occupied or boxes[:1])
    frames = np.zeros((*grid.shape, word_count(len(volumes))), np.uint64)
    for i, (box, (outer, filled)) in enumerate(zip(boxes, volumes, strict=True)):
        if some[i]:
            inside = filled[box.slices_in(outer)].view(np.uint8)
            _set_bit(frames[box.slices_in(grid)], inside, i // 64, np.uint64(1) << np.uint64(i % 64))
    return MotionHistoryVolume(grid, frames, len(volumes))


def trimmed(volume: MotionHistoryVolume) -> MotionHistoryVolume:
    """The same volume on the smallest box around what is ever filled."""
    grid = cropped(volume.frames, volume.grid)
    if grid == volume.grid:
        return volume
    frames = np.ascontiguousarray(volume.frames[grid.slices_in(volume.grid)])
    return MotionHistoryVolume(grid, frames, volume.n_frames)


def is_empty(volume: Volume) -> bool:
    """Whether nothing is ever filled."""
    return not any(_any(piece.frames.reshape(-1)) for piece in volume.pieces)


def union(*volumes: Volume) -> Volume:
    """Filled where any is.

    Args:
        volumes: of the same frames, at least one.
    """
    pieces = tuple(piece for volume in volumes for piece in volume.pieces)
    return pieces[0] if len(pieces) == 1 else UnitedVolume(pieces)


def difference(a: MotionHistoryVolume, b: MotionHistoryVolume) -> MotionHistoryVolume:
    """Filled where a is and b is not, frame by frame."""
    common, frames = overlap(a.grid, b.grid), a.frames.copy()
    if common is not None:
        frames[common.slices_in(a.grid)] &= ~b.frames[common.slices_in(b.grid)]
    return MotionHistoryVolume(a.grid, frames, a.n_frames)


def intersection(a: MotionHistoryVolume, b: MotionHistoryVolume) -> MotionHistoryVolume:
    """Filled where both are, frame by frame."""
    common = overlap(a.grid, b.grid)
    if common is None:
        common = VoxelGrid(a.grid.start, (1, 1, 1), a.grid.pitch)
        return MotionHistoryVolume(common, np.zeros((1, 1, 1, word_count(a.n_frames)), np.uint64), a.n_frames)
    frames = a.frames[common.slices_in(a.grid)] & b.frames[common.slices_in(b.grid)]
    return MotionHistoryVolume(common, frames, a.n_frames)


def dilated(volume: MotionHistoryVolume, radius: float) -> MotionHistoryVolume:
    """Filled in a frame where some voxel within a distance is (centre to centre).

    Args:
        volume: to dilate.
        radius: in voxels; below 1 nothing changes.
    """
    offsets = ball_offsets(radius)
    if len(offsets) == 1:
        return volume
    reach = int(radius)
    start, shape = volume.grid.start, volume.grid.shape
    grid = VoxelGrid(
        (start[0] - reach, start[1] - reach, start[2] - reach),
        (shape[0] + 2 * reach, shape[1] + 2 * reach, shape[2] + 2 * reach),
        volume.grid.pitch,
    )
    frames = np.zeros((*grid.shape, volume.frames.shape[-1]), np.uint64)
    _spread(volume.frames, offsets + reach, frames)
    return MotionHistoryVolume(grid, frames, volume.n_frames)


def eroded(volume: MotionHistoryVolume, radius: float) -> MotionHistoryVolume:
    """Filled in a frame where every voxel within a distance is (centre to centre).

    Args:
        volume: to erode.
        radius: in voxels; below 1 nothing changes.
    """
    offsets = ball_offsets(radius)
    if len(offsets) == 1:
        return volume
    return trimmed(MotionHistoryVolume(volume.grid, _shrink(volume.frames, offsets), volume.n_frames))


def frame_centres(volume: MotionHistoryVolume) -> FloatArray:
    """(tau, 3) centre of gravity of what is filled in each frame, m; NaN where nothing is."""
    sums, counts = _frame_sums(volume.frames, volume.n_frames)
    means = sums / np.where(counts > 0, counts, np.nan)[:, None]
    return np.asarray((means + np.array(volume.grid.start)) * volume.grid.pitch)


def from_bits(volume: MotionHistoryVolume, frames: Words) -> MotionHistoryVolume:
    """Other bits on the box of a volume, trimmed."""
    return trimmed(MotionHistoryVolume(volume.grid, frames, volume.n_frames))


@njit(cache=True, nogil=True)
def _any(words: Words) -> bool:
    """Whether any is not 0."""
    for word in words:
        if word != 0:
            return True
    return False


@njit(cache=True, nogil=True)
def _set_bit(frames: Words, filled: ByteArray, word: int, bit: np.uint64) -> None:
    for x in range(filled.shape[0]):
        for y in range(filled.shape[1]):
            some = np.uint8(0)  # most columns are empty
            for z in range(filled.shape[2]):
                some |= filled[x, y, z]
            if some != 0:
                for z in range(filled.shape[2]):
                    if filled[x, y, z] != 0:
                        frames[x, y, z, word] |= bit


def _rows(frames: Words) -> Words:
    """(N, W) the words of all voxels."""
    return np.ascontiguousarray(frames).reshape(-1, frames.shape[-1])


@njit(cache=True, nogil=True)
def _first_bits(frames: Words) -> Int32Array:
    out = np.full(frames.shape[0], -1, np.int32)
    for n in range(frames.shape[0]):
        for w in range(frames.shape[1]):
            word = frames[n, w]
            if word != 0:
                bit = 0
                while not (word >> np.uint64(bit)) & np.uint64(1):
                    bit += 1
                out[n] = 64 * w + bit
                break
    return out


@njit(cache=True, nogil=True)
def _last_bits(frames: Words) -> Int32Array:
    out = np.full(frames.shape[0], -1, np.int32)
    for n in range(frames.shape[0]):
        for w in range(frames.shape[1] - 1, -1, -1):
            word = frames[n, w]
            if word != 0:
                bit = -1
                while word != 0:
                    word >>= np.uint64(1)
                    bit += 1
                out[n] = 64 * w + bit
                break
    return out


@njit(cache=True, nogil=True)
def _spread(frames: Words, offsets: IntArray, out: Words) -> None:
    n_words = frames.shape[3]
    for x, y, z in np.ndindex(frames.shape[:3]):
        for w in range(n_words):
            word = frames[x, y, z, w]
            if word != 0:
                for o in range(offsets.shape[0]):
                    out[x + offsets[o, 0], y + offsets[o, 1], z + offsets[o, 2], w] |= word


@njit(cache=True, nogil=True)
def _shrink(frames: Words, offsets: IntArray) -> Words:
    """AND over all offsets, a column at a time; beyond the box nothing is filled."""
    n_x, n_y, n_z, n_words = frames.shape
    out = np.zeros(frames.shape, np.uint64)
    whole, shrunk = uncounted(frames.reshape(-1)), uncounted(out.reshape(-1))
    length = n_z * n_words
    for x in range(n_x):
        for y in range(n_y):
            at = np.uint64((x * n_y + y) * length)
            left = np.uint64(0)
            for w in range(np.uint64(length)):
                shrunk[at + w] = whole[at + w]
                left |= whole[at + w]
            for o in range(offsets.shape[0]):
                if left == 0:
                    break
                i, j, rise = x + offsets[o, 0], y + offsets[o, 1], offsets[o, 2] * n_words
                low, high = max(0, -rise), min(length, length - rise)
                if i < 0 or j < 0 or i >= n_x or j >= n_y:
                    low = high = length
                other = np.uint64((i * n_y + j) * length + rise)
                for w in range(np.uint64(low)):
                    shrunk[at + w] = 0
                left = np.uint64(0)
                for w in range(np.uint64(low), np.uint64(high)):
                    shrunk[at + w] &= whole[other + w]
                    left |= shrunk[at + w]
                for w in range(np.uint64(high), np.uint64(length)):
                    shrunk[at + w] = 0
    return out


@njit(cache=True, nogil=True)
def _sums(frames: Words) -> tuple[FloatArray, int]:
    """(3,) sum of the lattice places of what is ever filled, exact, and how many there are."""
    sums, count = np.zeros(3), 0
    n_x, n_y, n_z, n_words = frames.shape
    for x in range(n_x):
        for y in range(n_y):
            own, height = 0, 0
            for z in range(n_z):
                some = np.uint64(0)
                for w in range(n_words):
                    some |= frames[x, y, z, w]
                own += some != 0
                height += z * (some != 0)
            count += own
            sums[0] += x * own
            sums[1] += y * own
            sums[2] += height
    return sums, count


@njit(cache=True, nogil=True)
def _frame_sums(frames: Words, n_frames: int) -> tuple[FloatArray, IntArray]:
    """(tau, 3) sums of the lattice places of what is filled in each frame, exact, and (tau,) how many there are."""
    sums, counts = np.zeros((n_frames, 3)), np.zeros(n_frames, np.int64)
    n_x, n_y, n_z, n_words = frames.shape
    for x in range(n_x):
        for y in range(n_y):
            for z in range(n_z):
                for w in range(n_words):
                    word, frame = frames[x, y, z, w], 64 * w
                    while word != 0:
                        if word & np.uint64(1):
                            counts[frame] += 1
                            sums[frame, 0] += x
                            sums[frame, 1] += y
                            sums[frame, 2] += z
                        word >>= np.uint64(1)
                        frame += 1
    return sums, counts
