"""What an editor can decide: pin, exclude, widen a cone, loosen a tolerance."""

from dataclasses import replace
from math import pi, radians

import numpy as np

from mhvedit.geometry.arrays import BoolArray
from mhvedit.pipeline.picks import canonical_spot, is_excluded, nearest_row
from mhvedit.project.schema import Exclusion, Tolerance
from mhvedit.viewer.decisions import Decision
from mhvedit.viewer.material import SegmentView
from mhvedit.viewer.state import ViewerState, shown_row

NEIGHBOURHOOD = 0.15  # m, radius that is excluded around a pose
TURN = radians(30.0)  # and how far turned


def left_rows(state: ViewerState, view: SegmentView) -> BoolArray:
    """(S,) solutions that no exclusion leaves out."""
    left = np.ones(len(view.group), np.bool_)
    for exclusion in state.decisions[view.name].exclude if view.name in state.decisions else ():
        left &= ~is_excluded(exclusion, view.group, view.grid, frames=view.frames)
    return left


def pinned_row(state: ViewerState, view: SegmentView) -> int | None:
    """The pinned solution of a segment."""
    decision = state.decisions.get(view.name)
    if decision is None or decision.pin is None:
        return None
    return nearest_row(canonical_spot(decision.pin, view.frames), view.group, view.grid)


def decided_as(state: ViewerState, decision: Decision) -> ViewerState:
    """With another decision on the current segment."""
    return replace(state, decisions={**state.decisions, state.segment: decision})


def pinned(state: ViewerState) -> ViewerState:
    """With the solution that is looked at pinned; nothing where that is none."""
    row, view, decision = shown_row(state), state.view, state.decision
    if row is None or view is None or decision is None:
        return state
    return decided_as(state, replace(decision, pin=view.spot(view.group.poses[row])))


def unpinned(state: ViewerState) -> ViewerState:
    """With no solution of the current segment pinned."""
    return state if state.decision is None else decided_as(state, replace(state.decision, pin=None))


def region_excluded(state: ViewerState) -> ViewerState:
    """Without the connected region of the solution that is looked at."""
    return _excluded(state, None, pi)


def near_excluded(state: ViewerState) -> ViewerState:
    """Without the solutions that are near the one that is looked at."""
    return _excluded(state, NEIGHBOURHOOD, TURN)


def _excluded(state: ViewerState, radius: float | None, turn: float) -> ViewerState:
    row, view, decision = shown_row(state), state.view, state.decision
    if row is None or view is None or decision is None:
        return state
    of_a = radius is not None and view.name in state.mirrored
    exclusion = Exclusion(view.spot(view.group.poses[row]), radius, turn, of_a)
    return decided_as(state, replace(decision, exclude=(*decision.exclude, exclusion)))


def nothing_excluded(state: ViewerState) -> ViewerState:
    """With all solutions of the current segment back."""
    return state if state.decision is None else decided_as(state, replace(state.decision, exclude=()))


def with_half_angle(state: ViewerState, half_angle: float | None) -> ViewerState:
    """With other cones of sight in the current segment, rad; None asks for none."""
    return state if state.decision is None else decided_as(state, replace(state.decision, half_angle=half_angle))


def with_tolerance(state: ViewerState, tolerance: Tolerance) -> ViewerState:
    """With other tolerances in the current segment."""
    return state if state.decision is None else decided_as(state, replace(state.decision, tolerance=tolerance))


def saved(state: ViewerState) -> ViewerState:
    """With the scene file saying what was decided."""
    return replace(state, saved=state.decisions)
