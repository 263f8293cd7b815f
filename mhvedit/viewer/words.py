"""What a viewer says in words about its state."""

from mhvedit.view.words import side_in_words
from mhvedit.viewer.deciding import left_rows, pinned_row
from mhvedit.viewer.state import ViewerState, shown_row


def status(state: ViewerState) -> tuple[str, ...]:
    """Lines about what is shown: notes first, then the current segment, then what is not done yet."""
    lines = list(state.material.notes)
    view, decision = state.view, state.decision
    if view is not None:
        lines.append(f"{view.name}: {view.interaction}, {solutions_in_words(state)}")
        if not view.n_solutions:
            lines.append(f"nothing fits: {view.why}" if view.why else "nothing fits")
        shown = shown_in_words(state)
        if shown:
            lines.append(shown)
    if decision is not None and decision.pin is not None and view is not None:
        lost = len(view.group) and pinned_row(state, view) is None
        lines.append("pinned; the pin is no solution any more" if lost else "pinned")
    if not state.is_current:
        lines.append("decided, not solved yet")
    if not state.is_saved:
        lines.append("not saved yet")
    return tuple(lines)


def solutions_in_words(state: ViewerState) -> str:
    """How many solutions the current segment has, and what the editor leaves of them."""
    view = state.view
    if view is None:
        return "not searched"
    if not view.n_solutions:
        return "no solution"
    regions = int(view.group.region.max()) + 1
    left = int(left_rows(state, view).sum())
    out = "" if left == len(view.group) else f", {len(view.group) - left:,} excluded"
    return f"{len(view.group):,} solutions in {regions} {'region' if regions == 1 else 'regions'}{out}"


def shown_in_words(state: ViewerState) -> str:
    """The pose that is shown: how far B stands, on which side, and whether it fits."""
    view, row = state.view, shown_row(state)
    if view is None:
        return ""
    if state.preview is not None and row is None:
        return f"preview, no solution: {state.preview.reason}"
    if row is None:
        return ""
    a, b = view.between
    group = view.group
    what = "chosen" if state.preview is None else "preview"
    return (
        f"{what}: {b} {group.distance[row]:.2f} m from {a}, {side_in_words(float(group.theta_a[row]))} of {a}; "
        f"room {100 * group.clearance[row]:.0f} cm"
    )
