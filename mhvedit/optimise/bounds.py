"""What chains through cells can cost at least: the kernels of branching.

The vector between the roots of a stage, d = e^(i turn) r, lies in a box for each cell. A step between two stages costs
half the square of the way w = d' - d - e^(i gauge) kept_b + kept_a. The part of a cell's width that a view does not let
move is accounted for once, in the loss.

For any force f the step costs f.w - 1/2 f.f + 1/2 |w - f|^2. The first part is linear, so it is told stage by stage: a
stage's d ends one step and starts the next, and where it is in its box matters as the two forces differ, once, and not
for each step anew. With the steps of a good chain as forces little of the third part is left, and little is lost.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import ComplexArray, FloatArray, Int32Array, IntArray
from mhvedit.optimise.steps import Places, cheapest_step

STIFFNESS = 1e-12  # m^2, no less counts


class Links(NamedTuple):
    """What the cost of a chain is made of besides its poses; a tuple, since kernels take it."""

    weight_a: FloatArray  # (G,) m^2
    weight_b: FloatArray  # (G,) m^2
    kept_a: ComplexArray  # (G - 1,) m, from A's last root of a stage to its first of the next
    kept_b: ComplexArray  # (G - 1,) m, of B


@njit(cache=True, nogil=True)
def loss_of(links: Links, reach: FloatArray, flat_turn: float, flat_gauge: float, budget: float) -> float:
    """How much less than in the middle of its cells a chain can cost at its best turns and gauge, which are in them.

    The slope is 0 there, so it is half of the second derivative along the way, at most.

    Args:
        links: between stages.
        reach: (G,) m, no vector between roots is longer.
        flat_turn: rad, half the width of the cells.
        flat_gauge: rad, half the width of the branches.
        budget: m^2; chains that cost more at their best do not count.
    """
    total = 0.0
    for g in range(reach.shape[0]):
        total += links.weight_a[g] * flat_turn**2 + links.weight_b[g] * (flat_turn + flat_gauge) ** 2
        if g > 0:
            both, kept = reach[g - 1] + reach[g], abs(links.kept_b[g - 1])
            move = both * flat_turn + kept * flat_gauge
            total += move**2 + (np.sqrt(2 * budget) + move) * (both * flat_turn**2 + kept * flat_gauge**2)
    return 0.5 * total


@njit(cache=True, nogil=True)
def play_of(links: Links, forces: ComplexArray, half: complex, gauge: float, wide_gauge: float) -> float:
    """How much less than a chain a bound with the chain's own steps as forces says, but for its turns.

    Args:
        links: between stages.
        forces: (G - 1,) m.
        half: m, half of the sides of the blocks.
        gauge: of the chain, rad.
        wide_gauge: as in `bound_branches`.
    """
    play = float(_gauge_play(links, forces, gauge, wide_gauge))
    for g in range(forces.shape[0] + 1):
        before, after = forces[g - 1] if g > 0 else 0j, forces[g] if g < forces.shape[0] else 0j
        play += _play(before, after, half, False)
    return play


@njit(cache=True, nogil=True)
def bound_branches(
    branches: IntArray,
    cells: tuple[FloatArray, IntArray, Int32Array, Int32Array],
    blocks: tuple[ComplexArray, ComplexArray, ComplexArray, FloatArray, FloatArray],
    links: Links,
    widths: tuple[float, float, float, float, float],
    forces: ComplexArray,
    budget: float,
    out: tuple[FloatArray, FloatArray, IntArray],
) -> None:
    """Bound some branches.

    Args:
        branches: (K,) which.
        cells: gauges, bounds, block and slot of all.
        blocks: first, last, half, yaw and half yaw.
        links: between stages.
        widths: half turn, half gauge, most turn, and how much of the first two is left free to move, rad.
        forces: (G - 1,) m, one a step; any do.
        budget: m^2; what costs more need not be told apart.
        out: (N,) least cost through each cell, (B,) of each branch, (B, G) blocks of its cheapest chain.
    """
    gauges, bounds, block, slot = cells
    half_turn, half_gauge, _, wide_turn, wide_gauge = widths
    through, least, chains = out
    for b in branches:
        start, stop = bounds[b, 0], bounds[b, -1]
        at = bounds[b] - start
        leave, arrive, unary, reach = _places(
            at, block[start:stop], slot[start:stop], gauges[b], blocks, links, widths, forces
        )
        loss = loss_of(links, reach, half_turn - wide_turn, half_gauge - wide_gauge, budget)
        loss += 0.5 * (np.abs(forces) ** 2).sum() + _gauge_play(links, forces, gauges[b], wide_gauge)
        loss -= _lowered(at, unary)
        forward, came_from = _forward(at, leave, arrive, unary, budget + loss)
        behind = _behind(at, leave, arrive, unary, forward, budget + loss)
        for n in range(stop - start):  # one by one, here and below: arrays put into arrays take seconds to compile
            through[start + n] = forward[n] + behind[n] - loss
        final = at[-2]
        n = final + np.argmin(forward[final:])
        least[b] = max(forward[n] - loss, 0.0)
        if forward[n] <= budget + loss:
            for g in range(at.shape[0] - 2, -1, -1):
                chains[b, g] = block[start + n]
                n = came_from[n]


@njit(cache=True, nogil=True)
def _places(
    at: IntArray,
    block: Int32Array,
    slot: Int32Array,
    gauge: float,
    blocks: tuple[ComplexArray, ComplexArray, ComplexArray, FloatArray, FloatArray],
    links: Links,
    widths: tuple[float, float, float, float, float],
    forces: ComplexArray,
) -> tuple[Places, Places, FloatArray, FloatArray]:
    """Of every cell where steps leave from and arrive at, and the least it costs to be there; of every stage the reach.

    Arrivals are told so that a step, less its force, is the difference of an arrival and a departure. What a turn away
    from the cheapest one costs is shared by the steps on either side of a stage: that is what their places slide for.
    """
    first, last, sides, yaw, half_yaw = blocks
    half_turn, _, most_turn, wide_turn, wide_gauge = widths
    count, n_stages = block.shape[0], at.shape[0] - 1
    leave, arrive = _unknown(count), _unknown(count)
    unary, reach = np.empty(count), np.zeros(n_stages)
    for g in range(n_stages):
        before, after = forces[g - 1] if g > 0 else 0j, forces[g] if g < n_stages - 1 else 0j
        move, slide = 0j, 0j
        if g > 0:
            turned = np.exp(1j * gauge) * links.kept_b[g - 1]
            move, slide = links.kept_a[g - 1] - turned, _swept(turned, wide_gauge)
        told = _along(before, move)
        share = 0.5 if 0 < g < n_stages - 1 else 1.0
        last_k = -1
        for n in range(at[g], at[g + 1]):
            k = block[n]
            if last_k < 0 or slot[n] != slot[n - 1] or yaw[k] != yaw[last_k] or half_yaw[k] != half_yaw[last_k]:
                turn = -most_turn + (2 * slot[n] + 1) * half_turn
                mismatch = _wrapped(yaw[k] - gauge)
                least, best, stiffness = _facing(
                    links.weight_a[g], links.weight_b[g], turn, wide_turn, mismatch, half_yaw[k] + wide_gauge
                )
                give = 1 / np.sqrt(max(share * stiffness, STIFFNESS)) if wide_turn > 0 else 0.0
                spin = np.exp(1j * turn)
            last_k = k
            arriving, leaving = spin * first[k], spin * last[k]
            half = _turned_box(sides[k], spin, wide_turn)
            cost, off = _under_forces(before, after, arriving, leaving, stiffness, best - turn, wide_turn)
            unary[n] = least + cost + told - _play(before, after, half, half_yaw[k] > 0 and first[k] != last[k])
            _place(leave, n, leaving, 0j, half, wide_turn, off, give)
            _place(arrive, n, arriving, move - before, half + slide, wide_turn, off, give)
            reach[g] = max(reach[g], max(abs(first[k]), abs(last[k])) + abs(sides[k]))
    return leave, arrive, unary, reach


@njit(cache=True, nogil=True)
def _under_forces(
    before: complex, after: complex, arriving: complex, leaving: complex, stiffness: float, best: float, wide: float
) -> tuple[float, float]:
    """What the forces on a stage cost at least, with what the turn to where that is adds; and that turn.

    Turns are told from the middle of the cell's. Facing costs at least 1/2 stiffness (turn - best)^2 more than at its
    best; the forces cost before.e^(i turn) arriving - after.e^(i turn) leaving, which is straight but for a bend. The
    sum has the same stiffness around the turn that is found.
    """
    pulled = np.conj(before) * arriving - np.conj(after) * leaving
    slope = -pulled.imag
    turn = best
    if stiffness > 0:
        turn = min(max(best - slope / stiffness, -wide), wide)
    elif slope != 0:
        turn = -wide if slope > 0 else wide
    bend = 0.5 * abs(pulled) * wide**2
    return pulled.real + slope * turn + 0.5 * stiffness * (turn - best) ** 2 - bend, turn


@njit(cache=True, nogil=True)
def _play(before: complex, after: complex, half: complex, apart: bool) -> float:
    """What forces gain at most by where a stage is in its box; `apart`: the ends of its steps do not move as one."""
    both = before - after
    play = abs(both.real) * half.real + abs(both.imag) * half.imag
    return play + 2 * abs(half) * min(abs(before), abs(after)) if apart else play


@njit(cache=True, nogil=True)
def _gauge_play(links: Links, forces: ComplexArray, gauge: float, wide_gauge: float) -> float:
    """What forces gain at most by the gauge, which turns all ways that B keeps."""
    along, bend = 0.0, 0.0
    for g in range(forces.shape[0]):
        along += _along(forces[g], 1j * np.exp(1j * gauge) * links.kept_b[g])
        bend += abs(forces[g]) * abs(links.kept_b[g])
    return float(abs(along) * wide_gauge + 0.5 * bend * wide_gauge**2)


@njit(cache=True, nogil=True)
def _along(force: complex, way: complex) -> float:
    """The scalar product."""
    return force.real * way.real + force.imag * way.imag


@njit(cache=True, nogil=True)
def _lowered(at: IntArray, unary: FloatArray) -> float:
    """Take the least of every stage off, so that no part of a chain costs less than nothing; returns what that is."""
    total = 0.0
    for g in range(at.shape[0] - 1):
        own = unary[at[g] : at[g + 1]]
        least = own.min()
        own -= least
        total += least
    return total


@njit(cache=True, nogil=True)
def _unknown(count: int) -> Places:
    """Places to be filled in."""
    return Places(
        np.empty(count, np.complex128),
        np.empty(count, np.complex128),
        np.empty(count, np.complex128),
        np.empty(count, np.complex128),
        np.empty(count, np.complex128),
    )


@njit(cache=True, nogil=True)
def _place(
    places: Places, n: int, arm: complex, move: complex, blur: complex, half_turn: float, best: float, give: float
) -> None:
    """The end of an arm that turns by at most half_turn; it slides straight from where `best` leads, but for a bend."""
    places.middle[n] = arm + move
    places.half[n] = blur + _swept(arm, half_turn)
    places.rest[n] = arm * complex(1.0, best) + move
    places.slack[n] = arm * complex(0.0, give)
    places.blur[n] = blur + _bent(arm, half_turn)


@njit(cache=True, nogil=True)
def _swept(arm: complex, half_turn: float) -> complex:
    """Half of the sides of a box that the end of an arm stays in if it turns by at most half_turn."""
    return complex(abs(arm.imag), abs(arm.real)) * half_turn + complex(abs(arm.real), abs(arm.imag)) * half_turn**2 / 2


@njit(cache=True, nogil=True)
def _bent(arm: complex, half_turn: float) -> complex:
    """How far it is at most from where it would be if it went straight on."""
    across = complex(abs(arm.imag), abs(arm.real)) * half_turn / 3
    return (complex(abs(arm.real), abs(arm.imag)) + across) * half_turn**2 / 2


@njit(cache=True, nogil=True)
def _turned_box(half: complex, spin: complex, wide_turn: float) -> complex:
    """Half of the sides of a box around a box that is turned, and by at most wide_turn more."""
    c, s = abs(spin.real), abs(spin.imag)
    x, y = half.real * c + half.imag * s, half.real * s + half.imag * c
    return complex(x + wide_turn * y, y + wide_turn * x)


@njit(cache=True, nogil=True)
def _facing(
    weight_a: float, weight_b: float, turn: float, half_turn: float, mismatch: float, half_mismatch: float
) -> tuple[float, float, float]:
    """The least that facing costs over intervals of the turn and of the mismatch, the turn at which it does, and k.

    At any other turn of the interval it is at least 1/2 k times the square of the way more, since it is convex where
    nobody is off by more than a quarter turn. The least is 0 where both intervals hold 0, else it is on one of the four
    edges.
    """
    least, best = np.inf, turn
    if abs(turn) <= half_turn and abs(mismatch) <= half_mismatch:
        least, best = 0.0, 0.0
    for side in (-1, 1):
        edge = mismatch + side * half_mismatch
        here = -np.arctan2(weight_b * np.sin(edge), weight_a + weight_b * np.cos(edge))
        here = turn + min(max(_wrapped(here - turn), -half_turn), half_turn)
        cost = weight_a * _one_less_cos(here) + weight_b * _one_less_cos(here + edge)
        if cost < least:
            least, best = cost, here
        edge = turn + side * half_turn
        off = max(abs(_wrapped(edge + mismatch)) - half_mismatch, 0.0)
        cost = weight_a * _one_less_cos(edge) + weight_b * _one_less_cos(off)
        if cost < least:
            least, best = cost, edge
    off_a, off_b = abs(turn) + half_turn, abs(_wrapped(turn + mismatch)) + half_turn
    if max(off_a, off_b) >= 0.5 * np.pi:
        return least, best, 0.0
    stiffness = weight_a * np.cos(off_a)
    if half_mismatch == 0:
        stiffness += weight_b * np.cos(off_b)
    return least, best, stiffness


@njit(cache=True, nogil=True)
def _wrapped(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


@njit(cache=True, nogil=True)
def _one_less_cos(angle: float) -> float:
    """Exact for small angles too."""
    return float(2 * np.sin(0.5 * angle) ** 2)


@njit(cache=True, nogil=True)
def _part(places: Places, start: int, stop: int) -> Places:
    """The places of one stage; views."""
    return Places(
        places.middle[start:stop],
        places.half[start:stop],
        places.rest[start:stop],
        places.slack[start:stop],
        places.blur[start:stop],
    )


@njit(cache=True, nogil=True)
def _forward(
    at: IntArray, leave: Places, arrive: Places, unary: FloatArray, limit: float
) -> tuple[FloatArray, IntArray]:
    """The least cost of chains up to each cell, and the cell of the stage before that it comes from.

    It is infinite above the limit.
    """
    value = unary.copy()
    came_from = np.zeros(unary.shape[0], np.int64)
    for g in range(1, at.shape[0] - 1):
        source, target = _part(leave, at[g - 1], at[g]), _part(arrive, at[g], at[g + 1])
        left = limit - unary[at[g] : at[g + 1]]
        least, nearest = cheapest_step(value[at[g - 1] : at[g]], source, target, left)
        for n in range(at[g], at[g + 1]):
            value[n] += least[n - at[g]]
            came_from[n] = at[g - 1] + nearest[n - at[g]]
    return value, came_from


@njit(cache=True, nogil=True)
def _behind(
    at: IntArray, leave: Places, arrive: Places, unary: FloatArray, forward: FloatArray, limit: float
) -> FloatArray:
    """The least cost of what follows each cell; infinite where the whole is above the limit."""
    behind = np.zeros(forward.shape[0])
    for n in range(forward.shape[0]):
        if forward[n] > limit:
            behind[n] = np.inf
    for g in range(at.shape[0] - 2, 0, -1):
        source, target = _part(arrive, at[g], at[g + 1]), _part(leave, at[g - 1], at[g])
        value = behind[at[g] : at[g + 1]] + unary[at[g] : at[g + 1]]
        left = limit - forward[at[g - 1] : at[g]]
        least, _ = cheapest_step(value, source, target, left)
        for n in range(at[g - 1], at[g]):
            behind[n] = least[n - at[g - 1]]
    return behind


@njit(cache=True, nogil=True)
def split_cells(
    block: Int32Array, slot: Int32Array, child_starts: IntArray, sides: int, total: int
) -> tuple[Int32Array, Int32Array]:
    """Block and slot of every cell's parts: each smaller block, with each part of the turn.

    Args:
        block: (N,).
        slot: (N,).
        child_starts: (B + 1,) where the smaller blocks of each block start.
        sides: parts of the turn.
        total: how many parts there are.
    """
    fine, side_of = np.empty(total, np.int32), np.empty(total, np.int32)
    at = 0
    for n in range(block.shape[0]):
        for child in range(child_starts[block[n]], child_starts[block[n] + 1]):
            for side in range(sides):
                fine[at], side_of[at] = child, sides * slot[n] + side
                at += 1
    return fine, side_of
