"""Stages: stretches of the scene in which a pair moves rigidly, each one key segment or several that adjoin.

Adjoining key segments with nothing between them share one motion, so their solution groups are intersected; poses live
on one lattice, so the intersection is exact.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from mhvedit.errors import MhveditError
from mhvedit.geometry.arrays import FloatArray, IntArray

YAW_BITS = 12
REACH = 1 << 24
THREADS = 2


class NoSolution(MhveditError, ValueError):
    """A stage that nothing satisfies; names the segments."""

    def __init__(self, segments: Sequence[str]) -> None:
        names = " and ".join(f'"{name}"' for name in segments)
        alone = "has no solution"
        joined = "adjoin, so they must share one placement, and have none in common"
        super().__init__(f"{names} {alone if len(segments) == 1 else joined}")
        self.segments = tuple(segments)


@dataclass(frozen=True, slots=True, eq=False)
class KeySegment:
    """What the chain needs to know of one key segment; everything in the subjects' canonical frames."""

    name: str
    keys: IntArray  # (S, 3) of its solutions on the pose lattice
    poses: FloatArray  # (S, 3) x, y m and yaw rad of B in A
    merit: FloatArray  # (S,) m: clearance less what speaks against each solution; decides between equal costs
    root_a: FloatArray  # (2,) m, C of A
    root_b: FloatArray  # (2,) m, C of B


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """The solutions that a run of adjoining key segments has in common."""

    names: tuple[str, ...]
    keys: IntArray  # (S, 3) on the pose lattice, ascending
    poses: FloatArray  # (S, 3) x, y m and yaw rad of B in A
    merit: FloatArray  # (S,) m, the least over the segments
    roots_a: FloatArray  # (n, 2) m, one a segment
    roots_b: FloatArray  # (n, 2) m

    def __len__(self) -> int:
        return len(self.keys)


def stages_of(segments: Sequence[KeySegment], adjoins: Sequence[bool]) -> tuple[Stage, ...]:
    """Join the key segments that adjoin.

    Args:
        segments: in order.
        adjoins: (I - 1,) whether nothing lies between a segment and the next.

    Raises:
        NoSolution: a stage is empty.
    """
    runs: list[list[KeySegment]] = []
    for segment, joined in zip(segments, (False, *adjoins), strict=True):
        if joined:
            runs[-1].append(segment)
        else:
            runs.append([segment])
    with ThreadPoolExecutor(THREADS) as pool:
        return tuple(pool.map(_stage, runs))


def some_of(stage: Stage, rows: IntArray) -> Stage:
    """A stage with some of its solutions.

    Args:
        stage: any.
        rows: (N,) ascending.
    """
    if len(rows) == len(stage):
        return stage
    return replace(stage, keys=stage.keys[rows], poses=stage.poses[rows], merit=stage.merit[rows])


def pose_codes(keys: IntArray) -> IntArray:
    """(S,) one integer per lattice pose, ordered as x, y, yaw."""
    return np.asarray(((keys[:, 0] + REACH) * (2 * REACH) + keys[:, 1] + REACH) * (1 << YAW_BITS) + keys[:, 2])


def common_codes(codes: Sequence[IntArray]) -> IntArray:
    """Codes, each set without repetition, that all sets hold, ascending; the smallest sets are compared first."""
    common, *others = sorted(codes, key=len)
    for other in others:
        common = np.intersect1d(common, other, assume_unique=True)
    return common


def _stage(run: Sequence[KeySegment]) -> Stage:
    codes = [pose_codes(segment.keys) for segment in run]
    orders = [np.argsort(own, kind="stable") for own in codes]
    ascending = [own[order] for own, order in zip(codes, orders, strict=True)]
    common = common_codes(ascending)
    if len(common) == 0:
        raise NoSolution([segment.name for segment in run])
    rows = [order[np.searchsorted(own, common)] for own, order in zip(ascending, orders, strict=True)]
    merit = np.min([segment.merit[row] for segment, row in zip(run, rows, strict=True)], axis=0)
    return Stage(
        names=tuple(segment.name for segment in run),
        keys=run[0].keys[rows[0]],
        poses=run[0].poses[rows[0]],
        merit=merit,
        roots_a=np.array([segment.root_a for segment in run]),
        roots_b=np.array([segment.root_b for segment in run]),
    )
