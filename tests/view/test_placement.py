import time

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

from mhvedit.geometry.planar import rotation
from mhvedit.search.groups import SolutionGroup, solution_group
from mhvedit.search.poses import PoseGrid
from mhvedit.search.solve import ACCEPTED, ReasonMap
from mhvedit.view.placement import map_colours, placement_map, summarise
from mhvedit.view.plan import PlanFrame, around, plan_outlines
from mhvedit.view.style import figure_picture, reason_colours, rgb
from tests.view.shapes import PITCH, standing


def test_summary_is_what_each_place_is_over_all_yaws(found: ReasonMap) -> None:
    seen = summarise(found)
    for i, j in [(0, 0), (10, 20), (24, 24), (30, 12)]:
        column = found.reason[i, j]
        assert seen.fits[i, j] == (column == ACCEPTED).sum()
        assert seen.furthest[i, j] == column.max()
    assert dict(seen.counts) == found.counts()


def test_a_large_map_is_summarised_quickly() -> None:
    grid = PoseGrid(0.01, 1, 180, 4.0, np.zeros(2), np.zeros(2), np.zeros((180, 2), np.int64), 401)
    large = ReasonMap(grid, np.full((401, 401, 180), 2, np.uint8), ("accepted", "outside the window", "no contact"))
    start = time.process_time()
    seen = summarise(large)
    assert time.process_time() - start < 1.5  # 0.2 s on a quiet machine
    assert seen.counts["no contact"] == 401 * 401 * 180


def test_solutions_are_dark_and_rejections_light(found: ReasonMap) -> None:
    seen = summarise(found)
    picture = map_colours(seen) / 255
    assert (seen.fits > 0).any()
    assert picture[seen.fits > 0].mean(-1).max() < 0.5
    assert picture[seen.fits == 0].mean(-1).min() > 0.6


def test_every_reason_has_a_colour_and_no_two_of_a_map_are_alike(found: ReasonMap) -> None:
    colours = reason_colours([*found.reasons, "something new", "something else"])
    assert len({tuple(rgb(colour)) for colour in colours}) == len(colours)


def test_both_facings_are_arrows_that_point_where_they_should(found: ReasonMap, group: SolutionGroup) -> None:
    chosen, facing_a, facing_b = len(group) // 3, 0.4, np.pi
    figure = placement_map(found, group, chosen, facing_a=facing_a, facing_b=facing_b, names=("anna", "ben"))
    of_a, of_b = _arrows(figure, 0)
    np.testing.assert_allclose(of_a[0], [0, 0], atol=1e-9)
    np.testing.assert_allclose(_angle(of_a), np.pi / 2)
    pose = group.poses[chosen]
    turn = np.pi / 2 - facing_a
    np.testing.assert_allclose(of_b[0], rotation(turn) @ pose[:2], atol=1e-9)
    assert np.cos(_angle(of_b) - (pose[2] + facing_b + turn)) == pytest.approx(1.0)


def test_the_chosen_pose_lies_on_a_solution_of_the_drawn_map(found: ReasonMap, group: SolutionGroup) -> None:
    figure = placement_map(found, group, 5, facing_a=1.0, facing_b=0.0, names=("anna", "ben"))
    at = PlanFrame(found.grid.root_a, 1.0).back(_arrows(figure, 0)[1][0])
    cell = np.rint(at / found.grid.step).astype(int) + found.grid.size // 2
    assert summarise(found).fits[tuple(cell)] > 0


def test_an_empty_group_draws_and_says_so(nothing: ReasonMap) -> None:
    empty = solution_group(nothing, facing_a=0.0, facing_b=0.0, lever=0.5)
    figure = placement_map(nothing, empty, None, facing_a=0.0, facing_b=0.0, names=("anna", "ben"))
    assert figure_picture(figure).std() > 0
    assert "no pose fits" in [text.get_text() for text in figure.axes[1].texts]
    assert len(_arrows(figure, 0)) == 1


def test_axes_have_units_and_the_legend_counts(found: ReasonMap, group: SolutionGroup) -> None:
    figure = placement_map(found, group, None, facing_a=0.0, facing_b=0.0, names=("anna", "ben"))
    assert ", m" in figure.axes[0].get_xlabel() and ", m" in figure.axes[0].get_ylabel()
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert f"solutions: {len(group):,}" in legend


def test_plan_frame_goes_there_and_back() -> None:
    frame = PlanFrame(np.array([0.3, -0.2]), 0.7)
    points = np.array([[1.0, 2.0], [-0.5, 0.1]])
    np.testing.assert_allclose(frame.back(frame.points(points)), points)
    ahead = frame.root_a + np.array([np.cos(0.7), np.sin(0.7)])
    np.testing.assert_allclose(frame.points(ahead), [0, 1], atol=1e-12)


def test_outlines_are_the_body_seen_from_above() -> None:
    (outline,) = plan_outlines(standing(), 0, np.array([1.0, 0.0, np.pi / 2]))
    np.testing.assert_allclose(np.ptp(outline, axis=0), [8 * PITCH, 6 * PITCH], atol=1e-9)
    assert around(outline, least=0.1)[0][0] == pytest.approx(1.0, abs=PITCH)


def _arrows(figure: Figure, panel: int) -> list[tuple[np.ndarray, np.ndarray]]:
    arrows = [p for p in figure.axes[panel].patches if isinstance(p, FancyArrowPatch) and p.get_gid() == "facing"]
    ends = [np.asarray(arrow._posA_posB, np.float64) for arrow in arrows]  # type: ignore[attr-defined]
    return [(pair[0], pair[1]) for pair in ends]


def _angle(arrow: tuple[np.ndarray, np.ndarray]) -> float:
    way = arrow[1] - arrow[0]
    return float(np.arctan2(way[1], way[0]))
