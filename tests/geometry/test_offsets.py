import numpy as np
import pytest
from numpy.testing import assert_array_equal

from mhvedit.geometry.offsets import FAR, middle_in_plan, round_offset, without_offset


@pytest.mark.parametrize("place", [(0.0, 0.0), (-0.4, 0.3), (0.6 * FAR, -0.8 * FAR)])
def test_nothing_is_taken_off_near_the_origin(place: tuple[float, float]) -> None:
    assert_array_equal(round_offset(np.array(place)), [0, 0])


def test_far_from_it_what_is_left_is_less_than_a_metre_and_exact() -> None:
    place = np.array([-500000.3, 0.2])
    offset = round_offset(place)
    assert offset.tolist() == [-500000, 0] and not np.signbit(offset[1])
    points = np.array([[*place, 1.5]])
    left = without_offset(points, offset)
    assert_array_equal(left, [[place[0] + 500000, 0.2, 1.5]])
    assert points[0, 0] == place[0]


def test_the_middle_is_that_of_the_box() -> None:
    assert middle_in_plan(np.array([(0, 0, 5), (1, 8, 0), (4, 2, 9)], np.float64)).tolist() == [2, 4]
