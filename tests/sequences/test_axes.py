import numpy as np
import pytest

from mhvedit.errors import ShapeError
from mhvedit.sequences.axes import METRES, UP_AXES, from_metres_z_up, to_metres_z_up

POINT = np.array([[1.0, 2.0, 3.0]])


@pytest.mark.parametrize(("up", "expected"), [("z", (1.0, 2.0, 3.0)), ("y", (1.0, -3.0, 2.0)), ("x", (-3.0, 2.0, 1.0))])
def test_up_axes_turn_as_the_contract_says(up: str, expected: tuple[float, ...]) -> None:
    assert to_metres_z_up(POINT, units="m", up=up).tolist() == [list(expected)]


@pytest.mark.parametrize("up", UP_AXES)
def test_turning_keeps_hands_apart(up: str) -> None:
    axes = to_metres_z_up(np.eye(3), units="m", up=up)
    assert np.linalg.det(axes) == pytest.approx(1.0)


@pytest.mark.parametrize("up", UP_AXES)
@pytest.mark.parametrize("units", METRES)
def test_there_and_back(units: str, up: str) -> None:
    there = from_metres_z_up(POINT, units=units, up=up)
    assert to_metres_z_up(there, units=units, up=up) == pytest.approx(POINT)


def test_float32_is_scaled_in_float64() -> None:
    point = np.array([[0.1, 0.2, 0.3]], np.float32)
    assert (to_metres_z_up(point, units="cm", up="z") == point.astype(np.float64) * 0.01).all()


def test_read_only_input_is_left_alone() -> None:
    point = POINT.copy()
    point.setflags(write=False)
    to_metres_z_up(point, units="m", up="z")[:] = 0
    assert (point == POINT).all()


def test_unknown_units_and_axes() -> None:
    with pytest.raises(ShapeError, match="units: expected one of m, cm, mm, found 'inch'"):
        to_metres_z_up(POINT, units="inch", up="z")
    with pytest.raises(ShapeError, match="up: expected one of x, y, z, found 'w'"):
        to_metres_z_up(POINT, units="m", up="w")
