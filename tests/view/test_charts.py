import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mhvedit.errors import ShapeError
from mhvedit.scene.edit import EditedScene
from mhvedit.view.charts import (
    SceneCheck,
    over_time,
    placed_centres,
    spread_labels,
    trajectories,
)
from mhvedit.view.style import figure_picture


def test_trajectories_show_each_capture_and_the_scene(scene: EditedScene) -> None:
    centres = {name: np.linspace([0.0, 0.0], [0.4, 0.1], 20) for name in scene.subjects}
    figure = trajectories(scene, centres)
    assert len(figure.axes) == 3
    after = next(axes for axes in figure.axes if axes.get_title(loc="left").startswith("After"))
    drawn = np.concatenate([np.asarray(line.get_xydata()) for line in after.lines])
    for name in scene.subjects:
        path = placed_centres(scene, name, centres[name])
        assert np.abs(drawn[:, None] - path[None]).sum(-1).min(0).max() < 1e-12
    assert [text.get_text() for text in after.texts] == ["1", "2"] * 2
    assert any("1\u00a0meet" in text.get_text() for text in figure.texts)


def test_placed_centres_turn_with_the_placement(scene: EditedScene) -> None:
    np.testing.assert_allclose(placed_centres(scene, "ben", np.tile([0.1, 0.0], (20, 1)))[0], [0.5, 0.0], atol=1e-12)


def test_over_time_shades_and_names_the_key_segments(scene: EditedScene, check: SceneCheck) -> None:
    figure = over_time(scene, check, limit_mm=30.0)
    assert len(figure.axes) == 3
    names = [text.get_text() for text in figure.axes[0].texts]
    assert {"meet", "part"} <= set(names)
    bands = [patch for patch in figure.axes[0].patches if patch.get_zorder() == 0]
    assert [patch.get_extents().width > 0 for patch in bands] == [True, True]
    assert figure.axes[-1].get_xlabel() == "frame of the scene"
    assert figure_picture(figure).shape[2] == 3


def test_what_was_not_measured_leaves_gaps(scene: EditedScene) -> None:
    holes = np.where(np.arange(20) % 3 == 0, np.nan, 1.0)
    assert figure_picture(over_time(scene, SceneCheck(holes, holes, np.zeros(20, bool), {}))).std() > 0


def test_a_check_of_unequal_lengths_is_refused() -> None:
    with pytest.raises(ShapeError, match="gap_mm"):
        SceneCheck(np.zeros(3), np.zeros(2), np.zeros(3, bool), {})


@settings(max_examples=25)
@given(arrays(np.float64, st.tuples(st.integers(1, 8), st.just(2)), elements=st.floats(-1, 1)))
def test_labels_end_up_apart(spots: np.ndarray) -> None:
    places = spread_labels(spots, gap=0.1)
    apart = np.linalg.norm(places[:, None] - places[None], axis=2) + np.eye(len(places))
    assert apart.min() > 0.06
    np.testing.assert_array_equal(places, spread_labels(spots, gap=0.1))
