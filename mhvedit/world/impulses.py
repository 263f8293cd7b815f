"""Impulses where bodies touch: restitution, friction that only brakes, and support that holds without jitter.

Every single impulse takes kinetic energy away or leaves it as it is: a normal one because Newton's restitution is at
most 1, a frictional one because it stops at the latest where sliding stops. So no sequence of them adds any, whatever
the geometry (C4.4: with all of eq. 10 at once an oblique impact could).
"""

from typing import Final

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.world.contacts import Contacts
from mhvedit.world.motion import Moving, spins, world_inverse_inertia

IMPACT: Final = 0.03  # m/s: what comes nearer more slowly is held, not thrown back
MOST_IMPACTS: Final = 60  # impulses a contact; then whatever still comes nearer is stopped without restitution
SWEEPS: Final = 100  # over all contacts; support that is not found then is solved for
STILL: Final = 1e-12  # m/s: support is found when no contact changes by more
_EPS: Final = 1e-9  # m/s


def struck(moving: Moving, contacts: Contacts) -> tuple[FloatArray, FloatArray]:
    """Impulses at impacts, one after the other, the fastest approach first (Schmidl and Lin, eqs 7 to 10; C4.5).

    Args:
        moving: the bodies.
        contacts: where they touch.

    Returns:
        (F, 3) m/s velocities and (F, 3) kg m2/s angular momenta after the impacts; no contact comes nearer faster than
        IMPACT.
    """
    if not len(contacts.gap):
        return moving.velocity, moving.momentum
    rows, velocity, spin = _rows(moving, contacts), moving.velocity.copy(), spins(moving)
    pressed = np.zeros((len(contacts.gap), 3))
    _strike(rows, contacts.restitution, contacts.friction, velocity, spin, pressed)
    return velocity, moving.momentum + _turned_by(rows, pressed, len(velocity))


def supported(
    moving: Moving, contacts: Contacts, pull: FloatArray, *, start: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Velocities after a pull that contacts hold against: impulses that push only, with Coulomb friction.

    Args:
        moving: the bodies.
        contacts: where they touch.
        pull: (F, 3) m/s that gravity adds to the velocities in the time ahead.
        start: (N, 3) N s, impulses to begin with, along the normal and two tangents; those of the step before make
            bodies that rest stay where they are to the last digit.

    Returns:
        (F, 3) m/s and (F, 3) kg m2/s at the end of that time, when no contact comes nearer, and (N, 3) the impulses.
    """
    n = len(contacts.gap)
    velocity = moving.velocity + pull
    if not n:
        return velocity, moving.momentum, np.zeros((0, 3))
    rows, spin = _rows(moving, contacts), spins(moving)
    pressed = np.zeros((n, 3)) if start is None else start.copy()
    if not _support(rows, contacts.friction, velocity, spin, pressed):
        _settle(rows, contacts.friction, velocity, spin, pressed)
    return velocity, moving.momentum + _turned_by(rows, pressed, len(velocity)), pressed


Rows = tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""Frames (N, 2) and, along normal and two tangents of each contact, directions (N, 3, 3), lever arms about each side
(N, 3, 2, 3), what a unit impulse adds to each side's spin (N, 3, 2, 3), and inverse masses (N, 2)."""


def _rows(moving: Moving, contacts: Contacts) -> Rows:
    """What impulses at the contacts do."""
    n = len(contacts.gap)
    rows = (
        contacts.frames,
        np.empty((n, 3, 3)),
        np.empty((n, 3, 2, 3)),
        np.empty((n, 3, 2, 3)),
        moving.inverse_mass[contacts.frames],
    )
    _fill(rows, contacts.point, contacts.normal, moving.positions, world_inverse_inertia(moving))
    return rows


def _settle(rows: Rows, friction: FloatArray, velocity: FloatArray, spin: FloatArray, pressed: FloatArray) -> None:
    """Stop all contacts that press at once, by linear algebra, if friction and pushing alone can do that.

    Sweeps pass what is on top of a pile down one body at a time, too slowly for it to stand still. Writes to
    velocities, spins and impulses, or leaves all as it is.
    """
    frames, ways, levers, turns, inverse_mass = rows
    sticks = np.hypot(pressed[:, 1], pressed[:, 2]) < friction * pressed[:, 0]
    active = np.stack([pressed[:, 0] > 0, sticks, sticks], 1)
    contact, way = np.nonzero(active)
    if not len(contact):  # nothing presses any more
        return
    jacobian = np.zeros((len(contact), len(velocity), 6))
    moved = np.zeros_like(jacobian)  # by unit impulses
    row = np.arange(len(contact))
    for side, sign in ((0, 1.0), (1, -1.0)):
        frame = frames[contact, side]
        jacobian[row, frame, :3] += sign * ways[contact, way]
        jacobian[row, frame, 3:] += sign * levers[contact, way, side]
        moved[row, frame, :3] += sign * inverse_mass[contact, side, None] * ways[contact, way]
        moved[row, frame, 3:] += sign * turns[contact, way, side]
    flat, rate = jacobian.reshape(len(contact), -1), np.concatenate([velocity, spin], 1)
    more = np.linalg.lstsq(flat @ moved.reshape(len(contact), -1).T, -flat @ rate.ravel(), rcond=1e-10)[0]
    after = pressed.copy()
    after[contact, way] += more
    if (after[:, 0] < 0).any() or (np.hypot(after[:, 1], after[:, 2]) > friction * after[:, 0] + 1e-12).any():
        return
    rate = rate + np.einsum("r,rfk->fk", more, moved)
    if all(_speed(rows, c, 0, rate[:, :3], rate[:, 3:]) > -_EPS for c in range(len(friction))):
        velocity[:], spin[:], pressed[:] = rate[:, :3], rate[:, 3:], after


def _turned_by(rows: Rows, pressed: FloatArray, n_frames: int) -> FloatArray:
    """(F, 3) kg m2/s that impulses (N, 3) add to the angular momenta of bodies that have a mass."""
    frames, _, levers, _, inverse_mass = rows
    given = np.einsum("nk,nksi->nsi", pressed, levers) * (inverse_mass > 0)[..., None]
    total = np.zeros((n_frames, 3))
    np.add.at(total, frames[:, 0], given[:, 0])
    np.add.at(total, frames[:, 1], -given[:, 1])
    return total


@njit(cache=True, nogil=True)
def _fill(rows: Rows, point: FloatArray, normal: FloatArray, positions: FloatArray, inertia: FloatArray) -> None:
    """Write directions, lever arms and what they turn."""
    frames, ways, levers, turns, _ = rows
    for c in range(len(point)):
        ways[c, 0] = normal[c]
        across = np.zeros(3)
        across[np.argmin(np.abs(normal[c]))] = 1.0
        across = np.cross(normal[c], across)
        ways[c, 1] = across / np.sqrt((across**2).sum())
        ways[c, 2] = np.cross(normal[c], ways[c, 1])
        for s in range(2):
            arm = point[c] - positions[frames[c, s]]
            for k in range(3):
                levers[c, k, s] = np.cross(arm, ways[c, k])
                turns[c, k, s] = inertia[frames[c, s]] @ levers[c, k, s]


@njit(cache=True, nogil=True)
def _strike(
    rows: Rows,
    restitution: FloatArray,
    friction: FloatArray,
    velocity: FloatArray,
    spin: FloatArray,
    pressed: FloatArray,
) -> None:
    """See `struck`; writes to velocities, spins and impulses."""
    n = len(restitution)
    for count in range(2 * MOST_IMPACTS * n):
        bounces = count < MOST_IMPACTS * n
        worst, fastest = -1, -IMPACT if bounces else -_EPS
        for c in range(n):
            approach = _speed(rows, c, 0, velocity, spin)
            if approach < fastest:
                worst, fastest = c, approach
        if worst < 0:
            return
        e = restitution[worst] if bounces else 0.0
        j = -(1.0 + e) * fastest / _resistance(rows, worst, 1.0, 0.0, 0.0)
        _push(rows, worst, 0, j, velocity, spin, pressed)
        _brake(rows, worst, friction[worst] * j, velocity, spin, pressed)


@njit(cache=True, nogil=True)
def _brake(rows: Rows, c: int, most: float, velocity: FloatArray, spin: FloatArray, pressed: FloatArray) -> None:
    """Friction of at most so much, and no more than stops the sliding (C4.4)."""
    one, two = _speed(rows, c, 1, velocity, spin), _speed(rows, c, 2, velocity, spin)
    speed = np.sqrt(one * one + two * two)
    if speed > _EPS:
        size = min(most, speed / _resistance(rows, c, 0.0, one / speed, two / speed))
        _push(rows, c, 1, -size * one / speed, velocity, spin, pressed)
        _push(rows, c, 2, -size * two / speed, velocity, spin, pressed)


@njit(cache=True, nogil=True)
def _support(rows: Rows, friction: FloatArray, velocity: FloatArray, spin: FloatArray, pressed: FloatArray) -> bool:
    """See `supported`: projected Gauss-Seidel; writes to velocities, spins and impulses. Whether it has found it."""
    n = len(friction)
    for c in range(n):
        for k in range(3):
            start = pressed[c, k]
            pressed[c, k] = 0.0
            _push(rows, c, k, start, velocity, spin, pressed)
    for _ in range(SWEEPS):
        change = 0.0
        for c in range(n):
            approach, resists = _speed(rows, c, 0, velocity, spin), _resistance(rows, c, 1.0, 0.0, 0.0)
            j = max(-approach / resists, -pressed[c, 0])
            _push(rows, c, 0, j, velocity, spin, pressed)
            one, two = _held(rows, c, friction[c] * pressed[c, 0], velocity, spin, pressed)
            one, two = one - pressed[c, 1], two - pressed[c, 2]
            _push(rows, c, 1, one, velocity, spin, pressed)
            _push(rows, c, 2, two, velocity, spin, pressed)
            change = max(change, (abs(j) + abs(one) + abs(two)) * resists)
        if change < STILL:
            return True
    return False


@njit(cache=True, nogil=True)
def _held(
    rows: Rows, c: int, most: float, velocity: FloatArray, spin: FloatArray, pressed: FloatArray
) -> tuple[float, float]:
    """Tangential impulses that stop the sliding, or as much of them as friction allows."""
    one, two = _speed(rows, c, 1, velocity, spin), _speed(rows, c, 2, velocity, spin)
    speed = np.sqrt(one * one + two * two)
    size = speed / _resistance(rows, c, 0.0, one / speed, two / speed) if speed > 0 else 0.0
    wanted = (
        pressed[c, 1] - (size * one / speed if speed > 0 else 0.0),
        pressed[c, 2] - (size * two / speed if speed > 0 else 0.0),
    )
    length = np.sqrt(wanted[0] ** 2 + wanted[1] ** 2)
    if length <= most:
        return wanted
    return wanted[0] * most / length, wanted[1] * most / length


@njit(cache=True, nogil=True)
def _speed(rows: Rows, c: int, k: int, velocity: FloatArray, spin: FloatArray) -> float:
    """m/s, velocity of a's point relative to b's along one direction of a contact (eq. 7)."""
    frames, ways, levers, _, _ = rows
    a, b = frames[c, 0], frames[c, 1]
    total = 0.0
    for i in range(3):
        total += ways[c, k, i] * (velocity[a, i] - velocity[b, i])
        total += levers[c, k, 0, i] * spin[a, i] - levers[c, k, 1, i] * spin[b, i]
    return total


@njit(cache=True, nogil=True)
def _resistance(rows: Rows, c: int, along: float, one: float, two: float) -> float:
    """1/kg, by how much a unit impulse along a mix of directions changes the speed along it (eq. 9)."""
    _, _, levers, turns, inverse_mass = rows
    total = inverse_mass[c, 0] + inverse_mass[c, 1] + 1e-300
    for s in range(2):
        for i in range(3):
            lever = along * levers[c, 0, s, i] + one * levers[c, 1, s, i] + two * levers[c, 2, s, i]
            total += lever * (along * turns[c, 0, s, i] + one * turns[c, 1, s, i] + two * turns[c, 2, s, i])
    return float(total)


@njit(cache=True, nogil=True)
def _push(
    rows: Rows, c: int, k: int, impulse: float, velocity: FloatArray, spin: FloatArray, pressed: FloatArray
) -> None:
    """Apply an impulse along one direction of a contact to a, and its opposite to b."""
    frames, ways, _, turns, inverse_mass = rows
    a, b = frames[c, 0], frames[c, 1]
    for i in range(3):
        velocity[a, i] += impulse * inverse_mass[c, 0] * ways[c, k, i]
        velocity[b, i] -= impulse * inverse_mass[c, 1] * ways[c, k, i]
        spin[a, i] += impulse * turns[c, k, 0, i]
        spin[b, i] -= impulse * turns[c, k, 1, i]
    pressed[c, k] += impulse
