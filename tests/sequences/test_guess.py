import numpy as np
import pytest

from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.guess import guess_units, guess_up


def box(low: tuple[float, ...], high: tuple[float, ...], n: int = 5) -> tuple[FloatArray, FloatArray]:
    return np.tile(np.array(low), (n, 1)), np.tile(np.array(high), (n, 1))


STANDS = box((1.0, -0.2, -0.01), (1.5, 0.1, 1.75))
CRAWLS = box((-0.8, 0.0, -0.05), (0.8, 0.6, 0.5))
LIES_WITH_FEET_AT_ZERO = box((0.0, 0.4, -0.06), (1.75, 0.9, 0.28))
FLOATS = box((-0.9, -0.25, 0.5), (0.9, 0.25, 0.9))


@pytest.mark.parametrize(("scale", "units"), [(1, "m"), (100, "cm"), (1000, "mm")])
@pytest.mark.parametrize("person", [STANDS, CRAWLS, LIES_WITH_FEET_AT_ZERO])
def test_units(person: tuple[FloatArray, FloatArray], scale: float, units: str) -> None:
    assert guess_units(person[0] * scale, person[1] * scale) == units


def test_a_sword_is_in_metres() -> None:
    assert guess_units(*box((0, 0, 0), (0.1, 0.05, 0.9))) == "m"


@pytest.mark.parametrize("person", [STANDS, CRAWLS, LIES_WITH_FEET_AT_ZERO])
def test_who_stands_crawls_or_lies_is_not_doubted(person: tuple[FloatArray, FloatArray]) -> None:
    assert guess_up(*person) == "z"


def test_standing_people_turned_on_the_side() -> None:
    low, high = STANDS
    assert guess_up(*_turned(low, high, [0, 2, 1], 2)) == "y"
    assert guess_up(*_turned(low, high, [2, 1, 0], 2)) == "x"
    assert guess_up(low, high, read_as="y") == "z"


def _turned(low: FloatArray, high: FloatArray, order: list[int], flip: int) -> tuple[FloatArray, FloatArray]:
    """Bounds with the axes in another order, one of them turned round."""
    low, high = low[:, order].copy(), high[:, order].copy()
    low[:, flip], high[:, flip] = -high[:, flip], -low[:, flip]
    return low, high


def test_a_flat_person_far_from_the_floor_is_doubted() -> None:
    assert guess_up(*FLOATS) == "x"


def test_most_frames_decide() -> None:
    low, high = (np.vstack([a[:3], b[:2]]) for a, b in zip(STANDS, FLOATS, strict=True))
    assert guess_up(low, high) == "z"
