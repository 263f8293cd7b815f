"""What keys and buttons do, by name: one table for the window and for the browser."""

from collections.abc import Callable, Mapping
from functools import partial
from math import degrees, pi, radians
from typing import Final

from mhvedit.view.renders import Colouring
from mhvedit.viewer import deciding, state
from mhvedit.viewer.session import Session
from mhvedit.viewer.state import CameraPreset, Change, Layer, ViewerState

ANGLE_STEP = 5.0  # degrees


def _angle(by: float) -> Change:
    def change(now: ViewerState) -> ViewerState:
        if now.decision is None or now.decision.half_angle is None:
            return now
        wanted = min(max(degrees(now.decision.half_angle) + by, ANGLE_STEP), 180.0)
        return deciding.with_half_angle(now, min(radians(wanted), pi))

    return change


def _toggle(layer: Layer) -> Change:
    return lambda now: state.with_layer(now, layer, layer not in now.layers)


def _recoloured(now: ViewerState) -> ViewerState:
    other = Colouring.LABEL if now.colouring is Colouring.TIME else Colouring.TIME
    return state.coloured_by(now, other)


CHANGES: Final[Mapping[str, Change]] = {
    "play": state.toggled_play,
    "back": partial(state.stepped, frames=-1),
    "ahead": partial(state.stepped, frames=1),
    "first": lambda now: state.at_frame(now, 0),
    "last": lambda now: state.at_frame(now, now.material.n_frames - 1),
    "slower": partial(state.sped, places=-1),
    "faster": partial(state.sped, places=1),
    "loop": lambda now: state.looped(now, not now.loop),
    "next segment": partial(state.next_segment, step=1),
    "last segment": partial(state.next_segment, step=-1),
    "turn left": partial(state.turned, steps=1),
    "turn right": partial(state.turned, steps=-1),
    "no preview": lambda now: state.previewed(now, None),
    "pin": deciding.pinned,
    "unpin": deciding.unpinned,
    "exclude region": deciding.region_excluded,
    "exclude near": deciding.near_excluded,
    "bring back": deciding.nothing_excluded,
    "narrower": _angle(-ANGLE_STEP),
    "wider": _angle(ANGLE_STEP),
    **{preset.value: partial(state.seen_from, camera=preset) for preset in CameraPreset},
    **{layer.value: _toggle(layer) for layer in Layer},
    "recolour": _recoloured,
}
COMMANDS: Final[Mapping[str, Callable[[Session], None]]] = {
    "undo": Session.undo,
    "redo": Session.redo,
    "solve": Session.solve,
    "save": Session.save,
}
KEYS: Final[Mapping[str, tuple[str, str]]] = {  # key -> action, in words
    "space": ("play", "play, pause"),
    "Left": ("back", "one frame back"),
    "Right": ("ahead", "one frame ahead"),
    "Home": ("first", "first frame"),
    "End": ("last", "last frame"),
    "bracketleft": ("slower", "play slower"),
    "bracketright": ("faster", "play faster"),
    "l": ("loop", "loop or not"),
    "n": ("next segment", "next segment"),
    "b": ("last segment", "segment before"),
    "comma": ("turn left", "next facing that fits, anticlockwise"),
    "period": ("turn right", "next facing that fits, clockwise"),
    "Escape": ("no preview", "back from a preview to the chosen pose"),
    "p": ("pin", "pin what is shown"),
    "P": ("unpin", "take the pin away"),
    "x": ("exclude region", "exclude the region that is shown"),
    "X": ("exclude near", "exclude what is near the pose that is shown"),
    "r": ("bring back", "bring back what is excluded"),
    "minus": ("narrower", "narrower cones of sight"),
    "equal": ("wider", "wider cones of sight"),
    "1": (CameraPreset.SIDE.value, "from the side"),
    "2": (CameraPreset.FRONT.value, "from the front"),
    "3": (CameraPreset.TOP.value, "from above"),
    "4": (CameraPreset.EYES_A.value, "through A's eyes"),
    "5": (CameraPreset.EYES_B.value, "through B's eyes"),
    "m": (Layer.BODIES.value, "bodies"),
    "v": (Layer.VOLUMES.value, "volumes of the interest parts"),
    "t": ("recolour", "volumes by end time or by label"),
    "c": (Layer.CONES.value, "cones of sight"),
    "a": (Layer.AFTER.value, "paths in the scene"),
    "o": (Layer.BEFORE.value, "paths as captured"),
    "s": ("solve", "solve again"),
    "z": ("undo", "undo"),
    "y": ("redo", "redo"),
    "w": ("save", "save into the scene file"),
}
SHOWN: Final[Mapping[str, str]] = {  # keys whose name is not what stands on them
    "bracketleft": "[", "bracketright": "]", "comma": ",", "period": ".", "minus": "-", "equal": "=", "P": "shift p",
    "X": "shift x", "Left": "←", "Right": "→",
}  # fmt: skip


def act(session: Session, action: str) -> None:
    """Do what a key or a button stands for.

    Args:
        session: of the viewer.
        action: a name of `CHANGES` or `COMMANDS`.
    """
    if action in CHANGES:
        session.do(CHANGES[action])
    else:
        COMMANDS[action](session)


def help_lines() -> list[tuple[str, str]]:
    """Each key, as it stands on the keyboard, and what it does."""
    return [(SHOWN.get(key, key), words) for key, (_, words) in KEYS.items()]
