"""One step of the recursion along a chain: for every target the source that is cheapest to come from, exactly.

A step costs half the square of the way. Where a source or a target is not known exactly, two bounds say what the step
costs at least, and the greater counts. Either may lie anywhere in a box. Or it may slide along a line for half the
square of the share of its slack that it takes, and lie anywhere in a smaller box besides.

Sources stand along a curve on which neighbours are alike in place and in value, and in a tree of boxes: a bunch
of them in a box, a bunch of boxes in a larger one, each bunch looked at side by side. A target leaves out every box out
of which nothing can be cheaper than what it has, and starts with what was best for the target before it.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import ComplexArray, FloatArray, IntArray

BUNCH = 16  # sources in a box, or boxes in a larger one
MOST_OPEN = 128  # bunches that are still to be looked at; no more than 15 for every size, and two
TINY = 1e-300  # m
CURVE_BITS = 16  # of each of the three numbers that tell where on the curve something stands


class Places(NamedTuple):
    """Where steps start or end; a tuple, since kernels take it."""

    middle: ComplexArray  # (N,) m, of the box
    half: ComplexArray  # (N,) m, half of the box's sides
    rest: ComplexArray  # (N,) m, where it lies if it does not slide
    slack: ComplexArray  # (N,) m, how far and which way it slides for a cost of 1/2 m^2
    blur: ComplexArray  # (N,) m, half of the sides of the box besides


def exactly(points: ComplexArray) -> Places:
    """Places that are known."""
    nothing = np.zeros(points.shape[0], np.complex128)
    return Places(points, nothing, points, nothing, nothing)


@njit(cache=True, nogil=True)
def cheapest_step(value: FloatArray, source: Places, target: Places, budget: FloatArray) -> tuple[FloatArray, IntArray]:
    """The least over i of value_i and what the step from source i to target j costs at least, for every j.

    Args:
        value: (N,) m^2, what each source costs so far.
        source: N places.
        target: M places.
        budget: (M,) m^2; what is above comes out as infinite. Targets with a negative one are left out.

    Returns:
        (M,) m^2; and (M,) the source, -1 where there is none within the budget.
    """
    count = target.middle.shape[0]
    least, nearest = np.full(count, np.inf), np.full(count, -1, np.int64)
    order = _along_curve(value, source, budget.max() if count else -1.0)
    if order.shape[0] == 0:
        return least, nearest
    points = _points(value, source, order)
    boxes, below = _tree(points)
    wanted, found = np.empty(10), order.shape[0] // 2
    stack, bounds, costs = np.empty(MOST_OPEN, np.int64), np.empty(MOST_OPEN), np.empty(BUNCH)
    for j in range(count):
        if budget[j] >= 0:
            wanted[0], wanted[1] = target.middle[j].real, target.middle[j].imag
            wanted[2], wanted[3] = target.rest[j].real, target.rest[j].imag
            wanted[4], wanted[5] = target.slack[j].real, target.slack[j].imag
            wanted[6], wanted[7] = target.half[j].real, target.half[j].imag
            wanted[8], wanted[9] = target.blur[j].real, target.blur[j].imag
            best, at = _cheapest(points, boxes, below, wanted, found // BUNCH, budget[j], stack, bounds, costs)
            if at >= 0:
                least[j], nearest[j], found = best, order[at], at
    return least, nearest


@njit(cache=True, nogil=True)
def _cheapest(
    points: FloatArray,
    boxes: FloatArray,
    below: IntArray,
    wanted: FloatArray,
    first: int,
    budget: float,
    stack: IntArray,
    bounds: FloatArray,
    costs: FloatArray,
) -> tuple[float, int]:
    """The least cost of getting to one place, and from which point; -1 where it is above the budget.

    Of bunches, which are counted from those of points on, the given first one is looked at, then from the last on
    whatever may hold something cheaper, the most promising one of each bunch first.
    """
    n_points = points.shape[0]
    best, found = np.nextafter(budget, np.inf), -1
    stack[0], bounds[0] = n_points + boxes.shape[0] - 1, -np.inf
    stack[1], bounds[1], height = first, -np.inf, 2
    while height > 0:
        height -= 1
        n = stack[height]
        if bounds[height] >= best:
            continue
        if n < n_points:
            _ways(points, n, wanted, costs)
            for i in range(BUNCH):
                if costs[i] < best:
                    best, found = costs[i], n * BUNCH + i
            continue
        _ways_to_boxes(boxes, n - n_points, wanted, costs)
        bottom = height
        for i in range(BUNCH):
            if costs[i] < best:
                stack[height], bounds[height] = below[n - n_points] + i, costs[i]
                height += 1
        for k in range(bottom, height - 1):
            if bounds[k] < bounds[height - 1]:
                stack[k], stack[height - 1] = stack[height - 1], stack[k]
                bounds[k], bounds[height - 1] = bounds[height - 1], bounds[k]
    return best, found


@njit(cache=True, nogil=True)
def _along_curve(value: FloatArray, places: Places, budget: float) -> IntArray:
    """The places whose value is within the budget, in the order in which a curve comes to them.

    It fills the plane and the values; of a value what counts is the way that costs as much.
    """
    order = np.flatnonzero((value <= budget) & np.isfinite(value))
    if order.shape[0] == 0:
        return order
    rest, up = places.rest[order], np.sqrt(2 * (value[order] - value[order].min()))
    low_x, low_y = rest.real.min(), rest.imag.min()
    width = max(rest.real.max() - low_x, rest.imag.max() - low_y, up.max(), TINY)
    scale, codes = (2**CURVE_BITS - 1) / width, np.zeros(order.shape[0], np.int64)
    for n in range(order.shape[0]):
        x, y = np.int64((rest[n].real - low_x) * scale), np.int64((rest[n].imag - low_y) * scale)
        z = np.int64(up[n] * scale)
        for bit in range(CURVE_BITS - 1, -1, -1):
            codes[n] = codes[n] << 3 | (z >> bit & 1) << 2 | (x >> bit & 1) << 1 | (y >> bit & 1)
    return order[np.argsort(codes)]


@njit(cache=True, nogil=True)
def _points(value: FloatArray, places: Places, order: IntArray) -> FloatArray:
    """(P, 11, BUNCH): value, middle, half, rest, blur, slack of bunches of places; the last may stand for none."""
    out = np.zeros((-(-order.shape[0] // BUNCH), 11, BUNCH))
    out[:, 0] = np.inf
    for at in range(order.shape[0]):
        n, k, i = at // BUNCH, at % BUNCH, order[at]
        out[n, 0, k] = value[i]
        out[n, 1, k], out[n, 2, k] = places.middle[i].real, places.middle[i].imag
        out[n, 3, k], out[n, 4, k] = places.half[i].real, places.half[i].imag
        out[n, 5, k], out[n, 6, k] = places.rest[i].real, places.rest[i].imag
        out[n, 7, k], out[n, 8, k] = places.blur[i].real, places.blur[i].imag
        out[n, 9, k], out[n, 10, k] = places.slack[i].real, places.slack[i].imag
    return out


@njit(cache=True, nogil=True)
def _tree(points: FloatArray) -> tuple[FloatArray, IntArray]:
    """(B, 10, BUNCH) bunches of boxes, the last one being the root; and (B,) which bunch the first of each one holds.

    A box is (10,): its least value; low x and y of the boxes, of those at rest, and high ones with the sign changed;
    widest square of the slack.
    """
    starts = [0, points.shape[0]]  # of the points, and of boxes of each size
    while len(starts) == 2 or starts[-1] - starts[-2] > 1:
        starts.append(starts[-1] + -(-(starts[-1] - starts[-2]) // BUNCH))
    boxes = np.zeros((starts[-1] - starts[1], 10, BUNCH))
    boxes[:, :9] = np.inf
    below = np.empty(boxes.shape[0], np.int64)
    for size in range(len(starts) - 2):
        for n in range(starts[size], starts[size + 1]):
            inside = n - starts[size]
            larger = starts[size + 1] - starts[1] + inside // BUNCH
            below[larger] = n - inside % BUNCH
            box = boxes[larger, :, inside % BUNCH]
            if size == 0:
                _enclose(box, points[n])
            else:
                for k in range(10):
                    own = boxes[n - starts[1], k]
                    box[k] = own.min() if k < 9 else own.max()
    return boxes, below


@njit(cache=True, nogil=True)
def _enclose(box: FloatArray, points: FloatArray) -> None:
    """Widen a box for a bunch of points."""
    for i in range(BUNCH):
        if points[0, i] < np.inf:
            box[0] = min(box[0], points[0, i])
            for axis in range(2):
                box[1 + axis] = min(box[1 + axis], points[1 + axis, i] - points[3 + axis, i])
                box[3 + axis] = min(box[3 + axis], points[5 + axis, i] - points[7 + axis, i])
                box[5 + axis] = min(box[5 + axis], -points[1 + axis, i] - points[3 + axis, i])
                box[7 + axis] = min(box[7 + axis], -points[5 + axis, i] - points[7 + axis, i])
            box[9] = max(box[9], points[9, i] ** 2 + points[10, i] ** 2)


@njit(cache=True, nogil=True, error_model="numpy")
def _ways(points: FloatArray, n: int, wanted: FloatArray, out: FloatArray) -> None:
    """What getting to a place by way of each point of a bunch costs at least.

    Sliding by shares p and q costs 1/2 (p^2 + q^2); at the best ones the step costs 1/2 d' (I + s s' + t t')^-1 d with
    the slacks s and t. Over a box that is least on one of the two edges that face the origin.
    """
    mx, my, rx, ry = wanted[0], wanted[1], wanted[2], wanted[3]
    tx, ty, hx, hy, bx, by = wanted[4], wanted[5], wanted[6], wanted[7], wanted[8], wanted[9]
    for i in range(out.shape[0]):  # not BUNCH, for which no vector instructions are made
        x = max(abs(mx - points[n, 1, i]) - points[n, 3, i] - hx, 0.0)
        y = max(abs(my - points[n, 2, i]) - points[n, 4, i] - hy, 0.0)
        boxes = x * x + y * y
        x, y, wide, tall = rx - points[n, 5, i], ry - points[n, 6, i], points[n, 7, i] + bx, points[n, 8, i] + by
        low_x, high_x, low_y, high_y = x - wide, x + wide, y - tall, y + tall
        edge_x, edge_y = max(low_x, 0.0) + min(high_x, 0.0), max(low_y, 0.0) + min(high_y, 0.0)
        sx, sy = points[n, 9, i], points[n, 10, i]
        xx, yy, xy = 1 + sx * sx + tx * tx, 1 + sy * sy + ty * ty, sx * sy + tx * ty
        x, y = min(max(xy / yy * edge_y, low_x), high_x), min(max(xy / xx * edge_x, low_y), high_y)
        # as sums of squares, since xx yy - xy xy would cancel where the slack is large
        across_s, across_t = sx * y - sy * edge_x, tx * y - ty * edge_x
        upright = edge_x * edge_x + y * y + across_s * across_s + across_t * across_t
        across_s, across_t = sx * edge_y - sy * x, tx * edge_y - ty * x
        level = x * x + edge_y * edge_y + across_s * across_s + across_t * across_t
        across = sx * ty - sy * tx
        slides = min(upright, level) / (xx + yy - 1 + across * across)
        out[i] = points[n, 0, i] + 0.5 * max(boxes, slides)


@njit(cache=True, nogil=True, error_model="numpy")
def _ways_to_boxes(boxes: FloatArray, n: int, wanted: FloatArray, out: FloatArray) -> None:
    """What coming from anywhere in each box of a bunch costs at least, with what it costs to be there."""
    low_x, low_y, high_x, high_y = (
        wanted[0] - wanted[6], wanted[1] - wanted[7], wanted[0] + wanted[6], wanted[1] + wanted[7],
    )  # fmt: skip
    rest_low_x, rest_low_y, rest_high_x, rest_high_y = (
        wanted[2] - wanted[8], wanted[3] - wanted[9], wanted[2] + wanted[8], wanted[3] + wanted[9],
    )  # fmt: skip
    slack = 1 + wanted[4] * wanted[4] + wanted[5] * wanted[5]
    for i in range(out.shape[0]):  # likewise
        x = max(boxes[n, 1, i] - high_x, low_x + boxes[n, 5, i], 0.0)
        y = max(boxes[n, 2, i] - high_y, low_y + boxes[n, 6, i], 0.0)
        whole = x * x + y * y
        x = max(boxes[n, 3, i] - rest_high_x, rest_low_x + boxes[n, 7, i], 0.0)
        y = max(boxes[n, 4, i] - rest_high_y, rest_low_y + boxes[n, 8, i], 0.0)
        slides = (x * x + y * y) / (slack + boxes[n, 9, i])
        out[i] = boxes[n, 0, i] + 0.5 * max(whole, slides)
