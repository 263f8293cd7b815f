"""Small random people: blobs that wander, leave and re-enter voxels, with parts cut out of them and things held."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.grid import VoxelGrid
from mhvedit.sequences.meshes import BODY
from mhvedit.volumes.history import MotionHistoryVolume, history
from mhvedit.volumes.subject import PartVolume, SubjectVolumes
from tests.oracles import Person, Voxel

PITCH = 0.02  # m
HAND, SWORD = "hand", "sword"
PARTS = (HAND, SWORD, BODY)
Sets = list[frozenset[Voxel]]


@dataclass(frozen=True)
class Made:
    """One subject twice: as the oracle and as the search takes it."""

    person: Person
    volumes: SubjectVolumes
    root: FloatArray  # (2,) m


def random_subject(rng: np.random.Generator, tau: int) -> Made:
    """A body that moves for tau frames, a hand cut from it and a sword of its own."""
    path = _path(rng, tau)
    size = int(rng.integers(30, 90)) if tau < 10 else 40
    blob = _blob(rng, size) | _shifted(_blob(rng, 5), rng.integers(-4, 5, 3))  # the second piece may be loose
    reach = max(p[0] for p in blob) - int(rng.integers(1, 4))
    hand = frozenset(p for p in blob if p[0] >= reach) | _some(rng, blob, 0.05)
    sword = _shifted(frozenset((i, 0, 0) for i in range(int(rng.integers(2, 6)))), rng.integers(-3, 4, 3))
    moving = rng.random() < 0.8
    at = [path[i] if moving else path[0] for i in range(tau)]
    bodies = [_shifted(blob, p) for p in at]
    hands = [_shifted(hand, p) & body for p, body in zip(at, bodies, strict=True)]
    if tau > 2 and rng.random() < 0.3:
        hands[int(rng.integers(tau))] = frozenset()  # a part may be lost in some frame
    swords = [_shifted(sword, p + rng.integers(-1, 2, 3) * (tau < 10)) for p in at]
    return made({BODY: bodies, SWORD: swords}, {BODY: (BODY, bodies), HAND: (BODY, hands), SWORD: (SWORD, swords)})


def made(solids: dict[str, Sets], parts: dict[str, tuple[str, Sets]]) -> Made:
    """A subject from sets of voxels."""
    volumes = SubjectVolumes(
        {name: volume_of(frames) for name, frames in solids.items()},
        {name: PartVolume(volume_of(frames), solid) for name, (solid, frames) in parts.items()},
    )
    centre = volumes.body.centre[:2]
    return Made(Person(solids, parts), volumes, np.where(np.isnan(centre), 0.0, centre))


def volume_of(frames: Sequence[frozenset[Voxel]]) -> MotionHistoryVolume:
    """The motion history volume of sets of voxels; the boxes of the frames differ and are larger than need be."""
    boxes = []
    for i, filled in enumerate(frames):
        where = np.array(sorted(filled) or [(0, 0, 0)])
        low = where.min(0) - i % 3
        shape = where.max(0) + 1 + i % 2 - low
        inside = np.zeros(shape, np.bool_)
        if filled:
            inside[tuple((where - low).T)] = True
        grid = VoxelGrid((int(low[0]), int(low[1]), int(low[2])), inside.shape, PITCH)
        boxes.append((grid, inside))
    return history(boxes)


def _path(rng: np.random.Generator, tau: int) -> list[IntArray]:
    """Where a blob is in each frame: a walk, folded so that it comes back to where it was."""
    n = tau if tau < 10 else 5
    walk = np.cumsum(rng.integers(-1, 2, (n, 3)) * rng.choice([1, 2], (n, 1)), 0) + rng.integers(-5, 6, 3)
    order = (
        np.arange(tau)
        if tau < 10
        else np.sort(rng.integers(0, n, tau))
        if rng.random() < 0.5
        else _there_and_back(tau, n)
    )
    return [walk[i] for i in order]


def _there_and_back(tau: int, n: int) -> IntArray:
    return np.abs((np.arange(tau) // 4) % (2 * n - 2) - (n - 1))


def _blob(rng: np.random.Generator, size: int) -> frozenset[Voxel]:
    """A connected set of voxels, grown at random."""
    steps = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    found: list[Voxel] = [(0, 0, 0)]
    taken = {(0, 0, 0)}
    while len(found) < size:
        p, step = found[int(rng.integers(len(found)))], steps[int(rng.integers(6))]
        q = (p[0] + step[0], p[1] + step[1], p[2] + step[2])
        if q not in taken and abs(q[2]) <= 2:
            taken.add(q)
            found.append(q)
    return frozenset(found)


def _some(rng: np.random.Generator, voxels: frozenset[Voxel], share: float) -> frozenset[Voxel]:
    return frozenset(p for p in sorted(voxels) if rng.random() < share)


def _shifted(voxels: frozenset[Voxel], by: IntArray) -> frozenset[Voxel]:
    x, y, z = (int(v) for v in by)
    return frozenset((p[0] + x, p[1] + y, p[2] + z) for p in voxels)
