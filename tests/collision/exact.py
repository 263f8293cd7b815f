"""Exact answers in rational numbers: slow, short and independent of the code under test."""

from fractions import Fraction
from itertools import combinations

import numpy as np

from mhvedit.geometry.arrays import FloatArray

Point = tuple[Fraction, ...]


def triangles_meet(a: FloatArray, b: FloatArray) -> bool:
    """Whether two convex sets of corners meet: the origin lies in the hull of all differences of their corners.

    By Caratheodory's theorem it then lies in a simplex of at most four of them.
    """
    differences = list(
        {tuple(Fraction(float(x)) - Fraction(float(y)) for x, y in zip(p, q, strict=True)) for p in a for q in b}
    )
    return any(_origin_in_simplex(corners) for n in range(1, 5) for corners in combinations(differences, n))


def _origin_in_simplex(corners: tuple[Point, ...]) -> bool:
    """Whether weights of at least 0 and sum 1 bring affinely independent corners to the origin."""
    rows = [[corner[i] for corner in corners] + [Fraction(0)] for i in range(3)]
    weights = _solved([*rows, [Fraction(1)] * (len(corners) + 1)])
    return weights is not None and min(weights) >= 0


def _solved(rows: list[list[Fraction]]) -> list[Fraction] | None:
    """The only solution of a linear system, None if there is none or more."""
    n = len(rows[0]) - 1
    for column in range(n):
        pivot = next((r for r in range(column, len(rows)) if rows[r][column] != 0), None)
        if pivot is None:
            return None
        rows[column], rows[pivot] = rows[pivot], rows[column]
        lead = rows[column][column]
        rows[column] = [x / lead for x in rows[column]]
        for r in range(len(rows)):
            if r != column and rows[r][column] != 0:
                factor = rows[r][column]
                rows[r] = [x - factor * y for x, y in zip(rows[r], rows[column], strict=True)]
    if any(row[n] != 0 for row in rows[n:]):
        return None
    return [rows[i][n] for i in range(n)]


def random_degenerate_pairs(rng: np.random.Generator, count: int) -> FloatArray:
    """(count, 6, 3) pairs of triangles on a grid of 3 x 3 x 3 points: mostly touching, coplanar or degenerate."""
    corners = rng.integers(0, 3, (count, 6, 3)).astype(np.float64)
    corners[::3, :, 2] = 0.0  # coplanar
    corners[1::9, 1] = corners[1::9, 0]  # a segment
    corners[2::9, 5] = 2 * corners[2::9, 4] - corners[2::9, 3]  # a flat one
    return corners
