"""The one state that everything is drawn from, and the only ways to change it."""

from collections.abc import Callable
from dataclasses import Field, dataclass, replace
from enum import StrEnum
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import compose, wrap_angle
from mhvedit.search.solve import ACCEPTED
from mhvedit.view.renders import Colouring
from mhvedit.viewer.decisions import Decision, Decisions
from mhvedit.viewer.material import Material, SegmentView
from mhvedit.viewer.preview import Cell, Preview, cell_of_row, preview_of

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)


class Clip(Protocol):
    """What has frames."""

    @property
    def n_frames(self) -> int:
        """How many."""

    @property
    def fps(self) -> float:
        """Hz."""


class Playing(Protocol):
    """A frozen state in which a clip plays."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def material(self) -> Clip:
        """What plays."""

    @property
    def position(self) -> float:
        """Frames from the start, with a fraction while it plays."""

    @property
    def frame(self) -> int:
        """The frame that is shown."""

    @property
    def playing(self) -> bool:
        """Whether time passes."""

    @property
    def speed(self) -> float:
        """1 is as fast as it was captured."""

    @property
    def loop(self) -> bool:
        """Whether it starts again at the end."""


P = TypeVar("P", bound=Playing)


class CameraPreset(StrEnum):
    """Where the scene is seen from."""

    SIDE = "side"
    FRONT = "front"
    TOP = "top"
    EYES_A = "eyes of A"
    EYES_B = "eyes of B"


class Layer(StrEnum):
    """What can be shown or not."""

    BODIES = "bodies"
    VOLUMES = "volumes"
    CONES = "cones of sight"
    AFTER = "paths after"
    BEFORE = "paths before"


@dataclass(frozen=True, slots=True, eq=False)
class ViewerState:
    """A frozen snapshot of all that a viewer shows."""

    material: Material
    decisions: Decisions
    solved: Decisions  # those that the material comes from
    saved: Decisions  # those in the scene file
    mirrored: frozenset[str]  # segments that the scene file tells from B's side
    segment: str  # the current one; empty where there is none
    position: float = 0.0  # frames of the scene, with a fraction while it plays
    playing: bool = False
    speed: float = 1.0
    loop: bool = True
    preview: Preview | None = None
    camera: CameraPreset = CameraPreset.SIDE
    layers: frozenset[Layer] = frozenset({Layer.BODIES, Layer.AFTER})
    colouring: Colouring = Colouring.TIME

    @property
    def frame(self) -> int:
        """The frame of the scene that is shown."""
        return int(self.position)

    @property
    def view(self) -> SegmentView | None:
        """What was found for the current segment."""
        return self.material.segment(self.segment)

    @property
    def decision(self) -> Decision | None:
        """On the current segment."""
        return self.decisions.get(self.segment)

    @property
    def needs_search(self) -> bool:
        """Whether something was decided that asks for a search."""
        return any(self.decisions[name].searched != self.solved[name].searched for name in self.decisions)

    @property
    def is_current(self) -> bool:
        """Whether the material comes from these decisions."""
        return self.decisions == self.solved

    @property
    def is_saved(self) -> bool:
        """Whether the scene file says what was decided."""
        return self.decisions == self.saved


Change = Callable[[ViewerState], ViewerState]


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """Where the editor is, was, and can go again."""

    now: ViewerState
    past: tuple[ViewerState, ...] = ()
    future: tuple[ViewerState, ...] = ()


def started(material: Material, decisions: Decisions, mirrored: frozenset[str] = frozenset()) -> History:
    """The first state: the first segment, at the beginning of the scene."""
    first = material.spans[0].name if material.spans else ""
    return History(ViewerState(material, decisions, decisions, decisions, mirrored, first))


def changed(history: History, change: Change) -> History:
    """After a change; only what was decided can be undone, not where somebody looked."""
    now = change(history.now)
    if now.decisions == history.now.decisions:
        return replace(history, now=now)
    return History(now, (*history.past, history.now))


def undone(history: History) -> History:
    """Before the last decision; what is looked at and the material stay."""
    if not history.past:
        return history
    *past, last = history.past
    return History(_back_to(last, history.now), tuple(past), (history.now, *history.future))


def redone(history: History) -> History:
    """After the decision that was undone last."""
    if not history.future:
        return history
    first, *future = history.future
    return History(_back_to(first, history.now), (*history.past, history.now), tuple(future))


def _back_to(snapshot: ViewerState, now: ViewerState) -> ViewerState:
    back = replace(now, decisions=snapshot.decisions, segment=snapshot.segment)
    return back if back.segment == now.segment else replace(back, preview=None)


def at_frame(state: P, frame: int) -> P:
    """At a frame of the scene, within its ends."""
    return replace(state, position=float(min(max(frame, 0), state.material.n_frames - 1)))


def at_known_frame(state: P, frame: int) -> P:
    """At a frame that somebody asked for.

    Raises:
        CaptureError: there is no such frame.
    """
    last = state.material.n_frames - 1
    if not 0 <= frame <= last:
        raise CaptureError("--frame", f"a frame from 0 to {last}", str(frame))
    return at_frame(state, frame)


def advanced(state: P, seconds: float) -> P:
    """Some time later, if it plays: again from the start at the end, or stopped there."""
    if not state.playing:
        return state
    position = state.position + seconds * state.material.fps * state.speed
    if position < state.material.n_frames:
        return replace(state, position=position)
    if state.loop:
        return replace(state, position=position % state.material.n_frames)
    return replace(state, position=float(state.material.n_frames - 1), playing=False)


def toggled_play(state: P) -> P:
    """Playing or not; from the start where it had come to the end."""
    at_end = not state.playing and state.frame == state.material.n_frames - 1
    return replace(state, playing=not state.playing, position=0.0 if at_end else state.position)


def at_speed(state: P, speed: float) -> P:
    """Playing at the nearest of the known speeds."""
    return replace(state, speed=min(SPEEDS, key=lambda known: abs(known - speed)))


def stepped(state: P, frames: int) -> P:
    """So many frames further, and standing there."""
    return replace(at_frame(state, state.frame + frames), playing=False)


def sped(state: P, places: int) -> P:
    """Playing at a speed so many places further in the list of those that there are."""
    return at_speed(state, SPEEDS[min(max(SPEEDS.index(state.speed) + places, 0), len(SPEEDS) - 1)])


def looped(state: P, loop: bool) -> P:
    """Starting again at the end, or not."""
    return replace(state, loop=loop)


def in_segment(state: ViewerState, name: str) -> ViewerState:
    """In another segment, at its telling moment."""
    span = next(span for span in state.material.spans if span.name == name)
    view = state.material.segment(name)
    moved = at_frame(state, span.start if view is None else view.moment)
    return moved if name == state.segment else replace(moved, segment=name, preview=None)


def next_segment(state: ViewerState, step: int) -> ViewerState:
    """The segment so many places further, round and round."""
    names = [span.name for span in state.material.spans]
    if not names:
        return state
    return in_segment(state, names[(names.index(state.segment) + step) % len(names)])


def seen_from(state: ViewerState, camera: CameraPreset) -> ViewerState:
    """Through another camera."""
    return replace(state, camera=camera)


def with_layer(state: ViewerState, layer: Layer, shown: bool) -> ViewerState:
    """With something shown or not."""
    return replace(state, layers=state.layers | {layer} if shown else state.layers - {layer})


def coloured_by(state: ViewerState, colouring: Colouring) -> ViewerState:
    """With volumes coloured by time or by label."""
    return replace(state, colouring=colouring)


def with_material(state: ViewerState, material: Material, solved: Decisions) -> ViewerState:
    """With what a solve found for some decisions; the editor stays where they are."""
    names = [span.name for span in material.spans]
    segment = state.segment if state.segment in names else (names[0] if names else "")
    new = replace(state, material=material, solved=solved, segment=segment)
    new = replace(new, position=min(state.position, float(material.n_frames - 1)))
    kept = state.preview if segment == state.segment else None
    return replace(new, preview=None if kept is None or new.view is None else preview_of(new.view, kept.cell))


def previewed(state: ViewerState, cell: Cell | None) -> ViewerState:
    """Looking at a pose of the current segment, in the segment; None: no longer."""
    view = state.view
    if cell is None or view is None:
        return replace(state, preview=None)
    shown = replace(state, preview=preview_of(view, cell), playing=False)
    inside = view.start <= state.frame < view.stop
    return shown if inside else at_frame(shown, view.moment)


def looked_at_row(state: ViewerState, row: int) -> ViewerState:
    """Looking at a solution of the current segment."""
    return state if state.view is None else previewed(state, cell_of_row(state.view, row))


def turned(state: ViewerState, steps: int) -> ViewerState:
    """Looking at the next solution of another facing at the same place, or simply the next yaw where there is none."""
    if state.view is None or state.preview is None:
        return state
    i, j, k = state.preview.cell
    n_yaw = state.view.grid.n_yaw
    column = state.view.found.reason[i, j]
    way = 1 if steps > 0 else -1
    for _ in range(abs(steps)):
        ahead = [(k + way * step) % n_yaw for step in range(1, n_yaw + 1)]
        k = next((other for other in ahead if column[other] == ACCEPTED), ahead[0])
    return previewed(state, (i, j, k))


def shown_row(state: ViewerState) -> int | None:
    """The solution that is looked at: the preview, or else the chosen one."""
    if state.view is None:
        return None
    return state.view.chosen if state.preview is None else state.preview.row


def placements_at(state: ViewerState, frame: int) -> dict[str, tuple[int, FloatArray]]:
    """Who shows which captured frame where, in a frame of the scene; a preview moves B beside A in its segment.

    Returns:
        By subject: the frame number, and (3,) world_from_capture.
    """
    tracks = state.material.tracks
    placed = {name: (int(track.source[frame]), track.placements[frame]) for name, track in tracks.items()}
    view = state.view
    if state.preview is not None and view is not None and view.start <= frame < view.stop:
        a, b = view.between
        beside = compose(placed[a][1], view.captured(np.array(state.preview.pose)))
        placed[b] = (placed[b][0], np.array([beside[0], beside[1], float(wrap_angle(beside[2]))]))
    return placed
