from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.geometry.grid import VoxelGrid, ball_offsets, cropped, grid_around, grown, united

PITCH = 0.25


def box(start: tuple[int, int, int], shape: tuple[int, int, int]) -> VoxelGrid:
    return VoxelGrid(start, shape, PITCH)


def test_voxel_centres_lie_at_whole_multiples_of_the_pitch() -> None:
    grid = box((-2, 0, 5), (3, 1, 2))
    assert [grid.axis(axis).tolist() for axis in range(3)] == [[-0.5, -0.25, 0.0], [0.0], [1.25, 1.5]]
    assert grid.stop == (1, 1, 7)


@given(low=st.tuples(*[st.floats(-3, 3)] * 3), size=st.tuples(*[st.floats(0, 2)] * 3))
def test_the_box_around_two_corners_covers_them_and_is_the_smallest(
    low: tuple[float, float, float], size: tuple[float, float, float]
) -> None:
    high = np.add(low, size)
    grid = grid_around(np.array(low), high, PITCH)
    for axis in range(3):
        centres = grid.axis(axis)
        assert centres[0] - PITCH / 2 <= low[axis] + 1e-12 and low[axis] <= centres[0] + PITCH / 2
        assert centres[-1] - PITCH / 2 <= high[axis] + 1e-12 and high[axis] <= centres[-1] + PITCH / 2


def test_the_union_of_boxes_contains_each_where_it_says() -> None:
    boxes = [box((-2, 0, 1), (3, 1, 2)), box((1, -4, 0), (1, 2, 7)), box((0, 0, 0), (1, 1, 1))]
    outer = united(boxes)
    assert (outer.start, outer.stop) == ((-2, -4, 0), (2, 1, 7))
    for grid in boxes:
        for axis, where in enumerate(grid.slices_in(outer)):
            np.testing.assert_array_equal(outer.axis(axis)[where], grid.axis(axis))


def test_a_margin_grows_a_box_on_every_side() -> None:
    assert grown(box((0, 1, 2), (3, 4, 5)), 2) == box((-2, -1, 0), (7, 8, 9))


def test_cropping_finds_the_first_and_last_filled_voxel_of_each_axis() -> None:
    filled = np.zeros((6, 5, 4), np.bool_)
    filled[[1, 4], [3, 2], [0, 2]] = True
    assert cropped(filled, box((-10, 0, 10), (6, 5, 4))) == box((-9, 2, 10), (4, 2, 3))


def test_an_empty_box_crops_to_one_voxel() -> None:
    assert cropped(np.zeros((3, 3, 3), np.bool_), box((7, 8, 9), (3, 3, 3))) == box((7, 8, 9), (1, 1, 1))


@pytest.mark.parametrize("radius", [0.0, 0.99, 1.0, 1.4, 1.5, np.sqrt(2), np.sqrt(3), 2.0, 3.7])
def test_a_ball_holds_every_offset_within_its_radius_nearest_first(radius: float) -> None:
    found = [tuple(offset) for offset in ball_offsets(radius).tolist()]
    expected = [o for o in product(range(-4, 5), repeat=3) if np.linalg.norm(o) <= radius + 1e-9]
    assert sorted(found) == sorted(expected) and len(set(found)) == len(found)
    lengths = [float(np.linalg.norm(offset)) for offset in found]
    assert lengths == sorted(lengths) and found[0] == (0, 0, 0)
