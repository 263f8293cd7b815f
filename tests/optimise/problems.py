"""Small chain problems, and what a chain costs, written from `editing.md` section 8 without any elimination."""

from collections.abc import Sequence

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.optimise.stages import KeySegment, Stage, stages_of

STEP = 0.1  # m
N_YAW = 24


def poses_of(keys: IntArray, *, step: float = STEP, n_yaw: int = N_YAW) -> FloatArray:
    return np.column_stack([keys[:, :2] * step, keys[:, 2] * 2 * np.pi / n_yaw])


def segment_of(
    name: str,
    keys: Sequence[tuple[int, int, int]] | IntArray,
    *,
    merit: Sequence[float] | FloatArray | None = None,
    root_a: tuple[float, float] = (0, 0),
    root_b: tuple[float, float] = (0, 0),
) -> KeySegment:
    lattice = np.array(keys, np.int64).reshape(-1, 3)
    merits = np.zeros(len(lattice)) if merit is None else np.array(merit, np.float64)
    return KeySegment(
        name, lattice, poses_of(lattice), merits, np.array(root_a, np.float64), np.array(root_b, np.float64)
    )


def some_keys(
    rng: np.random.Generator, count: int, *, reach: int = 4, yaws: int = 3, about: Sequence[int] = (0, 0, 0)
) -> IntArray:
    low, high = np.array([-reach, -reach, -yaws]), np.array([reach, reach, yaws])
    keys = rng.integers(low, high + 1, (count, 3)) + np.array(about)
    keys[:, 2] %= N_YAW
    return np.unique(keys, axis=0)


def some_segments(rng: np.random.Generator, count: int, size: int) -> list[KeySegment]:
    """Segments whose solutions lie about the same pose, with roots that wander."""
    walks = np.cumsum(rng.normal(0, 0.4, (2, count, 2)), axis=1)
    about = (*rng.integers(-5, 6, 2), int(rng.integers(N_YAW)))
    return [
        segment_of(
            str(i),
            some_keys(rng, size, about=about),
            root_a=(walks[0, i, 0], walks[0, i, 1]),
            root_b=(walks[1, i, 0], walks[1, i, 1]),
        )
        for i in range(count)
    ]


def problem(seed: int, *, count: int, size: int, adjoins: Sequence[bool] | None = None) -> tuple[Stage, ...]:
    """Stages without a common pose."""
    rng = np.random.default_rng(seed)
    while True:
        stages = stages_of(some_segments(rng, count, size), adjoins or [False] * (count - 1))
        keys = [{tuple(key) for key in stage.keys.tolist()} for stage in stages]
        if not set.intersection(*keys):
            return stages


def turned(yaw: float, point: FloatArray) -> FloatArray:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1]])


def plain_cost(stages: Sequence[Stage], a: FloatArray, b: FloatArray, *, gauge: float, facing_weight: float) -> float:
    """Eq. 16 for absolute placements (G, 3) of both, B's own motion being told in a frame turned by the gauge.

    Facings are unit vectors; one that is 0 in its own frame will do, since any turns by the same angle.
    """
    forward = np.array([1.0, 0.0])
    kept: list[tuple[FloatArray, FloatArray]] = []  # C and F, of A then B, one a segment
    made: list[tuple[FloatArray, FloatArray]] = []  # c and f
    for stage, at_a, at_b in zip(stages, a, b, strict=True):
        for root_a, root_b in zip(stage.roots_a, stage.roots_b, strict=True):
            kept += [(root_a, forward), (turned(gauge, root_b), turned(gauge, forward))]
            made += [
                (turned(p[2], root) + p[:2], turned(p[2], forward)) for p, root in ((at_a, root_a), (at_b, root_b))
            ]
    total = 0.0
    for i in range(len(kept)):
        total += facing_weight * float(((kept[i][1] - made[i][1]) ** 2).sum())
        if i + 2 < len(kept):  # the next of the same person
            total += float(((kept[i + 2][0] - kept[i][0] - made[i + 2][0] + made[i][0]) ** 2).sum())
    return total
