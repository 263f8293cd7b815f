"""Paths that give way: the smallest change of motion that moves people apart where they have to be.

Each frame of each person between key segments may be shifted by u. The path was the minimum of its energy, so a shift
costs u' H u more, with the same H as in `transitions`; key segments stay. What is asked is that the way from one person
to another, along a direction, is lengthened by so much at least in some frames. That is a small quadratic program; it
is solved as a row of least-squares problems with one banded matrix, in which what is asked and not yet met pulls.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.band import band_solution
from mhvedit.optimise.transitions import motion_bands

STIFF: Final = 1e4  # of what is asked, against an acceleration
MOST_ROUNDS: Final = 30
MET: Final = 1e-4  # m, by which what is asked may be missed
RIDGE: Final = 1e-9  # so that somebody without a key segment, whom nothing holds, has one best shift too


@dataclass(frozen=True, slots=True, eq=False)
class Push:
    """In one frame somebody has to be moved away from another, or from a thing that does not move."""

    frame: int
    one: int  # index of the person who is moved along the direction
    other: int | None  # index of the one who is moved against it; None for a thing
    direction: FloatArray  # (2,) unit
    least: float  # m, by how much both together


def bent(
    weights: FloatArray, free: BoolArray, pushes: Sequence[Push], *, delta: float
) -> tuple[FloatArray, FloatArray]:
    """The smallest shifts that do what is asked.

    Args:
        weights: (P, N) how much a change of speed counts, by person and frame.
        free: (P, N) frames that may be shifted.
        pushes: what is asked.
        delta: share of the acceleration.

    Returns:
        (P, N, 2) m; and (P,) what they cost, m^2.
    """
    people, n = free.shape
    bands = np.array([motion_bands(own[1:-1], delta) for own in weights])
    acting = np.ones(len(pushes), np.bool_)
    shifts = np.zeros((people, n, 2))
    for _ in range(MOST_ROUNDS):
        shifts = _solved(bands, free, [p for p, on in zip(pushes, acting, strict=True) if on])
        made = np.array([_made(shifts, push) for push in pushes])
        least = np.array([push.least for push in pushes])
        pulling = made < np.where(acting, least, least - MET)  # one that holds back what would go further does not
        if (pulling == acting).all():
            break
        acting = pulling
    return shifts, np.array([_energy(own, shift) for own, shift in zip(bands, shifts, strict=True)])


def _made(shifts: FloatArray, push: Push) -> float:
    """By how much shifts lengthen the way that a push is about."""
    way = shifts[push.one, push.frame].copy()
    if push.other is not None:
        way -= shifts[push.other, push.frame]
    return float(way @ push.direction)


def _solved(bands: FloatArray, free: BoolArray, pushes: Sequence[Push]) -> FloatArray:
    """The least squares of shifts and of what pushes miss; unknowns frame by frame, person by person, x then y."""
    people, n = free.shape
    per_frame = 2 * people
    matrix = np.zeros((2 * per_frame + 1, per_frame * n))
    target = np.zeros(per_frame * n)
    for person in range(people):
        for axis in (0, 1):
            for offset in range(3):
                matrix[offset * per_frame, 2 * person + axis :: per_frame] += bands[person, offset]
    matrix[0] += RIDGE
    for push in pushes:
        entries = [(push.one, 1.0)] + ([] if push.other is None else [(push.other, -1.0)])
        places = [
            (per_frame * push.frame + 2 * person + axis, sign * push.direction[axis])
            for person, sign in entries
            for axis in (0, 1)
        ]
        for i, a in places:
            target[i] += STIFF * a * push.least
            for j, b in places:
                if j >= i:
                    matrix[j - i, i] += STIFF * a * b
    held = ~np.repeat(free.T.reshape(-1), 2)
    for offset in range(1, len(matrix)):
        off = held.copy()
        off[:-offset] |= held[offset:]
        matrix[offset, off] = 0.0
    matrix[0, held], target[held] = 1.0, 0.0
    return band_solution(matrix, target[:, None]).reshape(n, people, 2).transpose(1, 0, 2)


def _energy(bands: FloatArray, shift: FloatArray) -> float:
    """The form u' H u."""
    total = float((bands[0] * (shift**2).sum(1)).sum())
    for offset in (1, 2):
        total += 2 * float((bands[offset, :-offset] * (shift[:-offset] * shift[offset:]).sum(1)).sum())
    return total
