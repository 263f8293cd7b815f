"""Decimal numbers: every answer has the bits of Python's `float`, and ordinary numbers do get an answer."""

import struct
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.sequences.decimals import ODD, READ, read_number

SOME = settings(max_examples=400, derandomize=True)
METRES = st.floats(-1e4, 1e4).filter(lambda x: x == 0 or abs(x) > 1e-12)


def read(text: str) -> tuple[float, int, int]:
    value, stop, state = read_number(np.frombuffer(text.encode() + b" ", np.uint8), 0)
    return value, stop, state


def bits(value: float) -> bytes:
    return struct.pack("d", value)


def assert_read(text: str) -> None:
    value, stop, state = read(text)
    assert (state, stop) == (READ, len(text)), text
    assert bits(value) == bits(float(text)), text


@given(METRES)
@SOME
def test_shortest_digits_are_read_back(value: float) -> None:
    assert_read(repr(value))


@given(METRES, st.integers(0, 22))
@SOME
def test_any_number_of_places_is_read(value: float, places: int) -> None:
    assert_read(f"{value:.{places}e}")
    assert_read(f"{value:+.{places}f}")


@given(st.integers(0, 2**64 - 1), st.integers(-64, 40))
@SOME
def test_whole_numbers_with_a_power_are_right_or_left_out(w: int, q: int) -> None:
    value, _, state = read(f"{w}E{q}")
    assert state == ODD or bits(value) == bits(float(f"{w}e{q}"))


@given(st.integers(2**52, 2**53 - 1), st.integers(-30, 9), st.sampled_from([-1, 0, 1]))
@SOME
def test_numbers_half_way_between_two_floats_go_to_the_even_one(mantissa: int, power: int, beside: int) -> None:
    half = Decimal(2 * mantissa + 1).scaleb(0) * (Decimal(2) ** power)
    digits = format(half, "f")
    if beside and "." in digits:
        digits += "0" * 5 + "1" if beside > 0 else ""
    value, _, state = read(digits)
    assert state == ODD or bits(value) == bits(float(digits))


@pytest.mark.parametrize(
    "text",
    ["0", "-0", "0.0", "-0.000", "1.", ".5", "-.5e1", "1e5", "1E+05", "1e-5", "007.50", "0" * 30 + "1", "1" + "0" * 30,
     "0." + "0" * 25 + "123", "9007199254740993", "123456789012345678901234567890", "0.1e22", "1e23", "8.5e-3"],
)  # fmt: skip
def test_every_way_to_write_a_number(text: str) -> None:
    assert_read(text)


@pytest.mark.parametrize("text", ["", "-", "+", ".", "e5", "1e", "1e+", "nan", "inf", "-inf", "1e400", "1e-400", "--1"])
def test_the_rest_is_left_out(text: str) -> None:
    assert read(text)[2] == ODD


@pytest.mark.parametrize(("text", "stop"), [("1/2", 1), ("1.5.2", 3), ("2x", 1), ("3-4", 1)])
def test_a_number_ends_where_it_ends(text: str, stop: int) -> None:
    assert read(text)[1:] == (stop, READ)
