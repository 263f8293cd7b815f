"""One step of the recursion along a chain: for every target the source that is cheapest to come from, exactly.

A step costs half the square of the way. Where a source or a target is not known exactly, two bounds say what the step
costs at least, and the greater counts. Either may lie anywhere in a disc. Or it may slide along a line for half the
square of the share of its slack that it takes, and lie anywhere in a smaller disc besides.

Sources stand in a tree of boxes, each with a stretch of them, so it is good if neighbours follow each other. A target
leaves out every box out of which nothing can be cheaper than what it has, and starts with what was best for the target
before it.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import ComplexArray, FloatArray, IntArray

LEAF = 8  # sources in the smallest boxes, at most


class Places(NamedTuple):
    """Where steps start or end; a tuple, since kernels take it."""

    middle: ComplexArray  # (N,) m, of the disc
    radius: FloatArray  # (N,) m, of the disc; targets with a negative one are left out
    rest: ComplexArray  # (N,) m, where it lies if it does not slide
    slack: ComplexArray  # (N,) m, how far and which way it slides for a cost of 1/2 m^2
    blur: FloatArray  # (N,) m, radius of the disc besides


def exactly(points: ComplexArray) -> Places:
    """Places that are known."""
    nothing = np.zeros(points.shape[0])
    return Places(points, nothing, points, np.zeros(points.shape[0], np.complex128), nothing)


@njit(cache=True, nogil=True)
def cheapest_step(value: FloatArray, source: Places, target: Places, budget: float) -> tuple[FloatArray, IntArray]:
    """The least over i of value_i and what the step from source i to target j costs at least, for every j.

    Args:
        value: (N,) m^2, what each source costs so far.
        source: N places.
        target: M places.
        budget: m^2; what is above comes out as infinite.

    Returns:
        (M,) m^2; and (M,) the source, -1 where there is none within the budget.
    """
    count = target.radius.shape[0]
    least, nearest = np.full(count, np.inf), np.full(count, -1, np.int64)
    order = np.flatnonzero(value <= budget)
    if order.shape[0] == 0:
        return least, nearest
    points = _columns(source, order)
    values = value[order]
    boxes, first_leaf = _tree(points, values)
    wanted = _columns(target, np.arange(count))
    stack = np.empty(128, np.int64)
    guess = order.shape[0] // 2
    for j in range(count):
        if target.radius[j] >= 0:
            best, found = _cheapest(points, values, boxes, first_leaf, wanted[j], guess, budget, stack)
            if found >= 0:
                least[j], nearest[j], guess = best, order[found], found
    return least, nearest


@njit(cache=True, nogil=True)
def _cheapest(
    points: FloatArray,
    values: FloatArray,
    boxes: FloatArray,
    first_leaf: int,
    wanted: FloatArray,
    guess: int,
    budget: float,
    stack: IntArray,
) -> tuple[float, int]:
    """The least cost of getting to one place, and from which point; -1 where it is above the budget."""
    best, found = values[guess] + _way(points[guess], wanted), guess
    if best > budget:
        best, found = budget, -1
    stack[0], height = 1, 1
    while height > 0:
        height -= 1
        node = stack[height]
        if _way_to_box(boxes[node], wanted) >= best:
            continue
        if node < first_leaf:
            near, far = 2 * node, 2 * node + 1
            if _way_to_box(boxes[far], wanted) < _way_to_box(boxes[near], wanted):
                near, far = far, near
            stack[height], stack[height + 1] = far, near
            height += 2
            continue
        for at in range((node - first_leaf) * LEAF, min((node - first_leaf + 1) * LEAF, points.shape[0])):
            cost = values[at] + _way(points[at], wanted) if values[at] < best else np.inf
            if cost < best:
                best, found = cost, at
    return best, found


@njit(cache=True, nogil=True)
def _columns(places: Places, order: IntArray) -> FloatArray:
    """(N, 8): middle, rest, slack, radius, blur."""
    out = np.empty((order.shape[0], 8))
    for n in range(order.shape[0]):
        i = order[n]
        out[n, 0], out[n, 1] = places.middle[i].real, places.middle[i].imag
        out[n, 2], out[n, 3] = places.rest[i].real, places.rest[i].imag
        out[n, 4], out[n, 5] = places.slack[i].real, places.slack[i].imag
        out[n, 6], out[n, 7] = places.radius[i], places.blur[i]
    return out


@njit(cache=True, nogil=True)
def _tree(points: FloatArray, values: FloatArray) -> tuple[FloatArray, int]:
    """Boxes, root at 1, and which box is the first leaf.

    A box is (11,): low and high x and y of the middles, of the rests, widest radius, blur, and square of the slack; its
    least value is in front.
    """
    leaves = (points.shape[0] + LEAF - 1) // LEAF
    first_leaf = 1
    while first_leaf < leaves:
        first_leaf *= 2
    boxes = np.empty((2 * first_leaf, 12))
    boxes[:, :9] = np.inf
    boxes[:, 9:] = 0.0
    for at in range(points.shape[0]):
        box, point = boxes[first_leaf + at // LEAF], points[at]
        box[0] = min(box[0], values[at])
        for axis in range(4):
            box[1 + axis] = min(box[1 + axis], point[axis])
            box[5 + axis] = min(box[5 + axis], -point[axis])
        box[9], box[10] = max(box[9], point[6]), max(box[10], point[7])
        box[11] = max(box[11], point[4] ** 2 + point[5] ** 2)
    for node in range(first_leaf - 1, 0, -1):
        for k in range(12):
            left, right = boxes[2 * node, k], boxes[2 * node + 1, k]
            boxes[node, k] = min(left, right) if k < 9 else max(left, right)
    return boxes, first_leaf


@njit(cache=True, nogil=True)
def _way(a: FloatArray, b: FloatArray) -> float:
    """What the step between two places costs at least.

    Sliding by shares p and q costs 1/2 (p^2 + q^2); at the best ones the step costs 1/2 d' (I + s s' + t t')^-1 d with
    the slacks s and t.
    """
    x, y = b[0] - a[0], b[1] - a[1]
    discs = max(np.sqrt(x * x + y * y) - a[6] - b[6], 0.0)
    x, y = b[2] - a[2], b[3] - a[3]
    across_a, across_b = a[4] * y - a[5] * x, b[4] * y - b[5] * x
    across = a[4] * b[5] - a[5] * b[4]
    square = x * x + y * y + across_a * across_a + across_b * across_b
    slack = 1 + a[4] * a[4] + a[5] * a[5] + b[4] * b[4] + b[5] * b[5] + across * across
    slides = max(np.sqrt(square / slack) - a[7] - b[7], 0.0)
    return float(0.5 * max(discs, slides) ** 2)


@njit(cache=True, nogil=True)
def _way_to_box(box: FloatArray, b: FloatArray) -> float:
    """What coming from anywhere in a box costs at least, with what it costs to be there."""
    x = max(box[1] - b[0], b[0] + box[5], 0.0)
    y = max(box[2] - b[1], b[1] + box[6], 0.0)
    discs = max(np.sqrt(x * x + y * y) - box[9] - b[6], 0.0)
    x = max(box[3] - b[2], b[2] + box[7], 0.0)
    y = max(box[4] - b[3], b[3] + box[8], 0.0)
    most = 1 + box[11] + b[4] * b[4] + b[5] * b[5]
    slides = max(np.sqrt((x * x + y * y) / most) - box[10] - b[7], 0.0)
    return float(box[0] + 0.5 * max(discs, slides) ** 2)
