"""Decimal numbers read from bytes, correctly rounded (compiled): the same bits as Python's `float`, or no answer.

Up to 19 digits make an integer w; the number is w 10^q. Where w and 10^|q| are floats themselves one division or
product rounds once (Clinger). Otherwise w is multiplied by 5^q in 128 bits, of which the rounding can be told but for
rare cases (Lemire, "Number parsing at a gigabyte per second"). Those, more digits that matter, subnormals, powers
beyond the table, `nan` and `inf` are left to the caller, who has `float`.
"""

import math
from typing import Final

import numpy as np
from numba import njit

from mhvedit.geometry.arrays import ByteArray, Words

READ, ODD = 0, 1  # whether a number was read
LEAST_POWER, MOST_POWER = -64, 40  # of ten, in the table of powers of five
MOST_DIGITS = 19  # that always fit into 64 bits
FAR = 99999  # a power of ten beyond all
NO_POINT = -1
MANTISSA_BITS = 52
EXACT = 1 << 53  # integers up to here are floats
PLUS, MINUS, DOT, DIGIT_0 = 43, 45, 46, 48
LETTER_E = 101  # small; capitals are 32 below


def _powers_of_five() -> Words:
    """(P, 2) the first 128 bits of 5^q, high and low word, for q in the table's range; reciprocals rounded up."""
    rows = []
    for q in range(LEAST_POWER, MOST_POWER + 1):
        power = 5 ** abs(q)
        if q >= 0:
            bits = power << 128 >> power.bit_length()
        else:
            bits = (1 << (power - 1).bit_length() + 127) // power + 1
        rows.append((bits >> 64, bits & (2**64 - 1)))
    return np.array(rows, np.uint64)


FIVES: Final = _powers_of_five()
TENS: Final = np.array([float(10**k) for k in range(23)])


@njit(cache=True, nogil=True)
def _times(a: np.uint64, b: np.uint64) -> tuple[np.uint64, np.uint64]:
    """The high and the low word of the product of two 64-bit words."""
    half, low = np.uint64(32), np.uint64(0xFFFFFFFF)
    a1, a0, b1, b0 = a >> half, a & low, b >> half, b & low
    p00, p01, p10 = a0 * b0, a0 * b1, a1 * b0
    middle = (p00 >> half) + (p01 & low) + (p10 & low)
    high = a1 * b1 + (p01 >> half) + (p10 >> half) + (middle >> half)
    return high, (middle << half) | (p00 & low)


@njit(cache=True, nogil=True)
def _leading_zeros(word: np.uint64) -> int:
    """Of a 64-bit word that is not 0."""
    count = 0
    for step in (32, 16, 8, 4, 2, 1):
        if word >> np.uint64(64 - step) == 0:
            word <<= np.uint64(step)
            count += step
    return count


@njit(cache=True, nogil=True)
def _by_five(w: np.uint64, q: int) -> tuple[float, int]:
    """The float nearest to w 10^q for w > 0 and q in the table's range."""
    zeros = _leading_zeros(w)
    w = w << np.uint64(zeros)
    high, low = _times(w, FIVES[q - LEAST_POWER, 0])
    if high & np.uint64(0x1FF) == np.uint64(0x1FF):  # the bits to round by may still change
        more, _ = _times(w, FIVES[q - LEAST_POWER, 1])
        low += more
        if low < more:
            high += np.uint64(1)
        if low == np.uint64(0xFFFFFFFFFFFFFFFF):
            return 0.0, ODD
    upper = high >> np.uint64(63)
    shift = upper + np.uint64(64 - MANTISSA_BITS - 3)
    mantissa = high >> shift
    if low <= np.uint64(1) and -4 <= q <= 23 and mantissa & np.uint64(3) == 1 and mantissa << shift == high:
        mantissa &= ~np.uint64(1)  # exactly half way: to even
    mantissa = (mantissa + (mantissa & np.uint64(1))) >> np.uint64(1)
    exponent = ((217706 * q) >> 16) + 63 + np.int64(upper) - zeros - MANTISSA_BITS
    return float(math.ldexp(float(np.int64(mantissa)), exponent)), READ


@njit(cache=True, nogil=True)
def nearest_float(w: np.uint64, q: int) -> tuple[float, int]:
    """The float nearest to w 10^q, and whether it could be told.

    Args:
        w: whole number.
        q: power of ten.
    """
    if w == np.uint64(0):
        return 0.0, READ
    if w <= np.uint64(EXACT) and -23 < q < 23:
        whole = float(np.int64(w))
        return float(whole / TENS[-q] if q < 0 else whole * TENS[q]), READ
    if q < LEAST_POWER or q > MOST_POWER:
        return 0.0, ODD
    value, state = _by_five(w, q)
    return value, state


@njit(cache=True, nogil=True)
def _exponent(text: ByteArray, at: int) -> tuple[int, int, int]:
    """The power of ten that is written from `at` on, where it ends, and whether it was read."""
    negative = text[at] == MINUS
    if text[at] == MINUS or text[at] == PLUS:
        at += 1
    first, power = at, 0
    while DIGIT_0 <= text[at] <= DIGIT_0 + 9:
        power = min(10 * power + int(text[at]) - DIGIT_0, FAR)
        at += 1
    return (-power if negative else power), at, (READ if at > first else ODD)


@njit(cache=True, nogil=True)
def read_number(text: ByteArray, at: int) -> tuple[float, int, int]:
    """The decimal number that starts at a byte.

    Args:
        text: (N,), of which the last byte is none of a number.
        at: its first byte.

    Returns:
        The number, where it ends, and whether it was read.
    """
    negative = text[at] == MINUS
    if text[at] == MINUS or text[at] == PLUS:
        at += 1
    w, n_digits, point, first = np.uint64(0), 0, NO_POINT, at
    while True:
        digit = np.uint64(text[at]) - np.uint64(DIGIT_0)  # of what is no digit: more than 9
        if digit <= np.uint64(9):
            if n_digits < MOST_DIGITS:
                w = w * np.uint64(10) + digit
            n_digits += 1 if w != np.uint64(0) else 0
        elif text[at] == DOT and point == NO_POINT:
            point = at
        else:
            break
        at += 1
    stop, power, state = at, (0 if point == NO_POINT else point + 1 - at), READ
    if at - first == (0 if point == NO_POINT else 1):
        return 0.0, stop, ODD
    if text[at] | 32 == LETTER_E:
        exponent, stop, state = _exponent(text, at + 1)
        power += exponent
    dropped = max(0, n_digits - MOST_DIGITS)
    value, told = nearest_float(w, power + dropped)
    if dropped > 0 and told == READ:  # whatever the digits left out, it lies between w and w + 1
        above, told = nearest_float(w + np.uint64(1), power + dropped)
        told = told if above == value else ODD
    return (-value if negative else value), stop, max(state, told)
