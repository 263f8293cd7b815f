from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.geometry.planar import compose, invert, wrap_angle
from mhvedit.search.solve import ACCEPTED
from mhvedit.viewer import deciding
from mhvedit.viewer.actions import CHANGES, COMMANDS, KEYS, SHOWN
from mhvedit.viewer.preview import best_cell, cell_of_row, preview_of
from mhvedit.viewer.state import (
    CameraPreset,
    History,
    Layer,
    ViewerState,
    advanced,
    at_frame,
    at_speed,
    changed,
    in_segment,
    looked_at_row,
    looped,
    next_segment,
    placements_at,
    previewed,
    redone,
    seen_from,
    shown_row,
    toggled_play,
    turned,
    undone,
    with_layer,
    with_material,
)


def test_what_was_decided_is_undone_and_done_again(state: ViewerState) -> None:
    history = History(state)
    history = changed(history, lambda now: looked_at_row(now, 40))
    history = changed(history, deciding.pinned)
    history = changed(history, deciding.region_excluded)
    both = history.now.decisions
    history = changed(history, lambda now: seen_from(at_frame(now, 2), CameraPreset.TOP))
    once = undone(history)
    assert once.now.decisions["raise"].pin is not None and once.now.decisions["raise"].exclude == ()
    assert (once.now.frame, once.now.camera) == (2, CameraPreset.TOP)
    assert undone(once).now.decisions == state.decisions
    assert undone(undone(once)) == undone(once) or undone(undone(once)).now.decisions == state.decisions
    assert redone(redone(undone(once))).now.decisions == both
    assert redone(history) is history


def test_a_new_decision_ends_what_could_be_done_again(state: ViewerState) -> None:
    history = undone(changed(History(state), deciding.pinned))
    assert history.future
    assert not changed(history, deciding.region_excluded).future


def test_looking_is_nothing_to_undo(state: ViewerState) -> None:
    history = History(state)
    for change in (toggled_play, lambda now: looked_at_row(now, 3), lambda now: with_layer(now, Layer.CONES, True)):
        history = changed(history, change)
    assert not history.past


def test_undo_goes_back_to_the_segment_of_the_decision(state: ViewerState) -> None:
    history = changed(History(state), deciding.pinned)
    history = changed(history, lambda now: looked_at_row(in_segment(now, "lower"), 0))
    back = undone(history).now
    assert back.segment == "raise" and back.preview is None


@given(seconds=st.lists(st.floats(0, 3), max_size=20), speed=st.sampled_from([0.1, 1.0, 4.0]))
def test_playing_passes_as_much_time_as_there_was(state: ViewerState, seconds: list[float], speed: float) -> None:
    now = replace(at_speed(at_frame(state, 0), speed), playing=True)
    for step in seconds:
        now = advanced(now, step)
    wanted = (sum(seconds) * now.material.fps * speed) % now.material.n_frames
    apart = abs(now.position - wanted)
    assert min(apart, now.material.n_frames - apart) < 1e-6


def test_without_a_loop_it_stops_on_the_last_frame_and_starts_again(state: ViewerState) -> None:
    now = advanced(looped(replace(state, playing=True), False), 100.0)
    assert not now.playing and now.frame == now.material.n_frames - 1
    assert toggled_play(now).frame == 0
    assert advanced(now, 1.0) is now


def test_frames_stay_within_the_scene(state: ViewerState) -> None:
    assert at_frame(state, -5).frame == 0
    assert at_frame(state, 10**6).frame == state.material.n_frames - 1


def test_segments_go_round(state: ViewerState) -> None:
    assert next_segment(state, 1).segment == "lower" == next_segment(state, -1).segment
    assert next_segment(next_segment(state, 1), 1).segment == "raise"


def test_the_telling_moment_is_where_the_hands_meet(state: ViewerState) -> None:
    raised, lowered = state.material.segments
    assert in_segment(state, "raise").frame == raised.stop - 1
    assert in_segment(state, "lower").frame == lowered.start


def test_every_solution_has_its_own_cell(state: ViewerState) -> None:
    view = state.view
    assert view is not None
    for row in range(0, view.n_solutions, 7):
        seen = preview_of(view, cell_of_row(view, row))
        assert seen is not None and seen.row == row and seen.reason == "accepted"
        np.testing.assert_allclose(seen.pose, view.group.poses[row])


def test_a_rejected_pose_is_looked_at_with_its_reason(state: ViewerState) -> None:
    view = state.view
    assert view is not None
    code = view.found.reasons.index("bodies meet")
    i, j, k = np.argwhere(view.found.reason == code)[0].tolist()
    now = previewed(state, (i, j, k))
    assert now.preview is not None and now.preview.row is None and now.preview.reason == "bodies meet"
    assert shown_row(now) is None
    assert deciding.pinned(now) is now and deciding.region_excluded(now) is now


def test_a_preview_moves_b_beside_a_in_its_segment_only(state: ViewerState) -> None:
    view = state.view
    assert view is not None
    now = looked_at_row(state, 40)
    for frame in range(state.material.n_frames):
        before, after = placements_at(state, frame), placements_at(now, frame)
        np.testing.assert_array_equal(before["anna"][1], after["anna"][1])
        if view.start <= frame < view.stop:
            relative = compose(invert(after["anna"][1]), after["ben"][1])
            apart = relative - view.captured(view.group.poses[40])
            np.testing.assert_allclose([*apart[:2], float(wrap_angle(apart[2]))], 0, atol=1e-9)
        else:
            np.testing.assert_array_equal(before["ben"][1], after["ben"][1])


def test_a_preview_outside_its_segment_goes_there(state: ViewerState) -> None:
    view = state.view
    assert view is not None
    assert looked_at_row(at_frame(state, view.stop + 1), 5).frame == view.moment
    assert looked_at_row(at_frame(state, view.start + 1), 5).frame == view.start + 1


def test_turning_goes_from_one_facing_that_fits_to_the_next(state: ViewerState) -> None:
    view = state.view
    assert view is not None
    fits = (view.found.reason == ACCEPTED).sum(2)
    i, j = np.unravel_index(int(fits.argmax()), fits.shape)
    yaws = np.flatnonzero(view.found.reason[i, j] == ACCEPTED)
    assert len(yaws) > 1
    now = previewed(state, (int(i), int(j), int(yaws[0])))
    seen = []
    for _ in yaws:
        now = turned(now, 1)
        assert now.preview is not None
        seen.append(now.preview.cell[2])
    np.testing.assert_array_equal(seen, np.roll(yaws, -1))
    assert turned(now, -1).preview.cell[2] == yaws[-1]  # type: ignore[union-attr]


def test_pointing_at_a_place_means_its_roomiest_solution(state: ViewerState) -> None:
    view = state.view
    assert view is not None
    cells = np.array([cell_of_row(view, row) for row in range(view.n_solutions)])
    for place in np.unique(cells[:, :2], axis=0)[::9]:
        here = np.flatnonzero((cells[:, :2] == place).all(1))
        cell = best_cell(view, (int(place[0]), int(place[1])))
        seen = preview_of(view, cell) if cell else None
        assert seen is not None and seen.row in here
        assert view.group.clearance[seen.row] == view.group.clearance[here].max()


def test_pointing_at_a_place_without_solutions_means_the_nearest_miss(state: ViewerState) -> None:
    view = state.view
    assert view is not None
    furthest = view.found.reason.max(2)
    empty = ~(view.found.reason == ACCEPTED).any(2)
    for i, j in np.argwhere(empty)[::50].tolist():
        cell = best_cell(view, (i, j))
        assert cell is not None and view.found.reason[cell] == furthest[i, j]
    assert best_cell(view, (-1, 0)) is None and best_cell(view, (0, view.grid.size)) is None


def test_new_material_leaves_the_editor_where_they_are(state: ViewerState) -> None:
    now = looked_at_row(at_frame(state, 3), 40)
    after = with_material(now, state.material, state.decisions)
    assert (after.segment, after.frame) == ("raise", 3) and after.preview == now.preview
    shorter = replace(state.material, n_frames=2, segments=(), spans=())
    after = with_material(now, shorter, state.decisions)
    assert (after.segment, after.frame, after.preview) == ("", 1, None)


def test_pins_and_exclusions_mean_what_was_shown(state: ViewerState) -> None:
    view = state.view
    assert view is not None
    now = deciding.pinned(looked_at_row(state, 40))
    assert deciding.pinned_row(now, view) == 40 and not now.is_current and not now.is_saved and not now.needs_search
    assert deciding.pinned_row(deciding.unpinned(now), view) is None
    near = deciding.left_rows(deciding.near_excluded(looked_at_row(state, 40)), view)
    assert not near[40] and near.any()
    region = deciding.left_rows(deciding.region_excluded(looked_at_row(state, 40)), view)
    np.testing.assert_array_equal(region, view.group.region != view.group.region[40])


def test_cones_and_tolerances_ask_for_a_search(state: ViewerState) -> None:
    wider = CHANGES["wider"](state)
    assert wider.needs_search and wider.decision is not None and state.decision is not None
    assert wider.decision.half_angle == pytest.approx((state.decision.half_angle or 0) + np.radians(5))
    assert CHANGES["narrower"](wider).decision.half_angle == pytest.approx(state.decision.half_angle)  # type: ignore[union-attr]
    lower = in_segment(state, "lower")
    assert CHANGES["wider"](lower) is lower


def test_every_key_does_something() -> None:
    for key, (action, words) in KEYS.items():
        assert action in CHANGES or action in COMMANDS, key
        assert words
    assert set(SHOWN) <= set(KEYS)
    assert len({action for action, _ in KEYS.values()}) == len(KEYS)
