from pathlib import Path

import numpy as np
import pytest

from mhvedit.errors import CaptureError
from mhvedit.scene.edit import SegmentEdit
from mhvedit.viewer.layout import layout_of
from mhvedit.viewer.shot import save_shot, shot, with_words
from mhvedit.viewer.state import ViewerState, at_frame, looked_at_row
from mhvedit.viewer.timeline import frame_at, lanes_of, timeline_picture, x_of

SIZE = (900, 560)


def test_panels_cover_the_picture_once() -> None:
    for width, height in (SIZE, (1600, 900), (500, 700)):
        panels = layout_of(width, height)
        cover = np.zeros((height, width), int)
        for box in (panels.scene, panels.map, panels.timeline):
            cover[box.top : box.top + box.height, box.left : box.left + box.width] += 1
            assert box.holds(box.left, box.top) and not box.holds(box.left + box.width, box.top)
        assert (cover == 1).all()


def test_a_shot_shows_scene_map_and_time_line(state: ViewerState) -> None:
    panels = layout_of(*SIZE)
    pictures = [shot(now, size=SIZE) for now in (state, at_frame(state, 0), looked_at_row(state, 40))]
    for box in (panels.scene, panels.map, panels.timeline):
        parts = [p[box.top : box.top + box.height, box.left : box.left + box.width] for p in pictures]
        assert all(len(np.unique(part.reshape(-1, 3), axis=0)) > 20 for part in parts)
        differs = [bool((part != parts[0]).any()) for part in parts[1:]]
        assert differs == [box is not panels.map, box is not panels.timeline]


def test_a_pixel_of_the_time_line_is_its_frame(state: ViewerState) -> None:
    for frame in range(state.material.n_frames):
        assert frame_at(x_of(frame + 0.5, 700, state.material.n_frames), 700, state.material.n_frames) == frame
    assert frame_at(-50, 700, 16) == 0 and frame_at(5000, 700, 16) == 15


def test_the_current_segment_stands_out(state: ViewerState) -> None:
    picture = timeline_picture(state, width=700, height=84, now=False)
    n, row = state.material.n_frames, 50
    colours = [tuple(picture[row, int(x_of(f + 0.1, 700, n)) + 4]) for f in (0, 8, 10)]
    assert len(set(colours)) == 3  # this segment, a transition, another segment


def test_a_picture_that_cannot_be_written_is_named_as_it_was_asked_for(tmp_path: Path) -> None:
    (tmp_path / "a.png").mkdir()
    with pytest.raises(CaptureError, match=r"/a\.png: expected a file that can be written, found Is a directory"):
        save_shot(np.zeros((4, 4, 3), np.uint8), tmp_path / "a.png")
    assert [file.name for file in tmp_path.iterdir()] == ["a.png"]


def test_words_stay_inside_the_picture() -> None:
    picture = np.full((80, 300, 3), 90, np.uint8)
    said = with_words(picture, ["a" * 500, "b"])
    assert said.shape == picture.shape and (said != picture).any()
    assert with_words(picture, []) is picture


def test_segments_that_run_at_once_have_rows_of_their_own() -> None:
    def span(start: int, stop: int) -> SegmentEdit:
        return SegmentEdit("", start, stop, "+&+", ("a", "b"), 0, 0, 0, np.zeros(3))

    assert lanes_of([span(0, 4), span(4, 9), span(12, 15)]) == [0, 0, 0]
    assert lanes_of([span(0, 9), span(2, 5), span(4, 6), span(6, 8), span(9, 11)]) == [0, 1, 2, 1, 0]
