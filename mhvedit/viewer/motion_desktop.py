"""A motion before and after in a window: two bodies, depth over time below them, steered by mouse and keys."""

import pyvista

from mhvedit.viewer.actions import SHOWN
from mhvedit.viewer.desktop import SIZE, Panel, listen, run_window, viewport, write_words
from mhvedit.viewer.layout import Box
from mhvedit.viewer.motion import CHANGES, MotionState, status
from mhvedit.viewer.motion3d import MotionStage
from mhvedit.viewer.motion_strip import HEIGHT, strip_picture
from mhvedit.viewer.scene3d import STILL_SAMPLES
from mhvedit.viewer.state import advanced, at_frame
from mhvedit.viewer.timeline import frame_at


class MotionWindow:
    """One motion in a window."""

    def __init__(self, state: MotionState, plotter: pyvista.Plotter) -> None:
        self.state = state
        self.plotter = plotter
        self.stage = MotionStage(plotter, state.material)
        self.strip = Panel(plotter)
        self.help = False
        self.open = True
        self._drawn: MotionState | None = None
        self._words: tuple[str, ...] = ()
        self._size = (0, 0)
        self._dragging = False
        listen(self)

    @property
    def boxes(self) -> tuple[Box, Box]:
        """Where the bodies and the strip are."""
        width, height = self._size
        return Box(0, 0, width, height - HEIGHT), Box(0, height - HEIGHT, width, HEIGHT)

    def tick(self, seconds: float) -> None:
        """Go on playing, draw what is new."""
        self.state = advanced(self.state, seconds)
        self.refresh()

    def key(self, name: str) -> None:
        """A key was pressed."""
        if name == "h":
            self.help = not self.help
        elif name == "q":
            self.open = False
        elif name in CHANGES:
            self.state = CHANGES[name][0](self.state)
        self.refresh()

    def press(self, x: float, y: float) -> bool:
        """The mouse was pressed, pixels from the window's upper left corner; whether it was on the strip."""
        self._dragging = self.boxes[1].holds(x, y)
        return self.move(x, y)

    def move(self, x: float, y: float) -> bool:
        """The mouse was moved; whether it drags the strip."""
        del y
        if self._dragging:
            self.state = at_frame(self.state, frame_at(x, self._size[0], self.state.material.n_frames))
            self.refresh()
        return self._dragging

    def release(self) -> None:
        """The mouse was let go."""
        self._dragging = False

    def refresh(self) -> None:
        """Draw what differs from what is on the screen."""
        window = self.plotter.render_window
        size = tuple(window.GetSize())
        if size != self._size:
            self._resize(size)
        words, changed = self._lines(), self.state is not self._drawn
        if changed:
            self._draw()
        if words != self._words:
            self._words = words
            write_words(self.plotter, words, even=self.help)
            changed = True
        if changed:
            window.Render()

    def _draw(self) -> None:
        before, state, (bodies, strip) = self._drawn, self.state, self.boxes
        if before is None or before.frame != state.frame or before.side is not state.side:
            self.stage.draw(state)
        if before is None or before.side is not state.side:
            self.stage.look(state, aspect=bodies.width / bodies.height)
        else:
            self.stage.follow(state)
        self.plotter.render_window.SetMultiSamples(0 if state.playing else STILL_SAMPLES)
        self.strip.put(strip_picture(state, width=strip.width, height=strip.height))
        self._drawn = state

    def _resize(self, size: tuple[int, int]) -> None:
        """The panels in a window of another size; everything is drawn anew."""
        self._size = size
        bodies, strip = self.boxes
        self.plotter.renderer.SetViewport(*viewport(bodies, *size))
        self.strip.place(strip, *size)
        self._drawn = None

    def _lines(self) -> tuple[str, ...]:
        if self.help:
            keys = [(SHOWN.get(key, key), words) for key, (_, words) in CHANGES.items()]
            return tuple(f"{key:>8}  {words}" for key, words in (*keys, ("h", "this help"), ("q", "close")))
        return (*status(self.state), "h: keys")


def open_motion_window(state: MotionState, *, size: tuple[int, int] = SIZE) -> None:
    """Show a motion in a window until it is closed.

    Raises:
        NoScreen: there is no screen.
    """
    run_window(lambda plotter: MotionWindow(state, plotter), size)
