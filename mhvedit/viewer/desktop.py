"""The viewer in a window: scene, map and time line side by side, steered by mouse and keys."""

import time
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import pyvista
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkImageMapper, vtkRenderer

from mhvedit.errors import NoScreen
from mhvedit.geometry.arrays import ByteArray
from mhvedit.view.captions import FONT
from mhvedit.view.studio import has_screen
from mhvedit.view.style import INK
from mhvedit.viewer.actions import KEYS, act, help_lines
from mhvedit.viewer.layout import Box, Layout, layout_of
from mhvedit.viewer.map2d import MapPicture, draw_map, empty_map, map_key, marked, marks_key
from mhvedit.viewer.scene3d import STILL_SAMPLES, Scene3D, Volumes, prepare
from mhvedit.viewer.session import Session
from mhvedit.viewer.state import ViewerState, at_frame, previewed
from mhvedit.viewer.timeline import frame_at, timeline_picture
from mhvedit.viewer.words import status

SIZE = (1500, 860)
TICK = 0.005  # s, between looks at what is to be done
FIRST = 1.0  # priority of our own mouse and keys over those of VTK's style
INSTEAD = "set DISPLAY, or use `--shot FILE.png` or, for a scene, `--web` (a browser)"


class Window(Protocol):
    """What a window on the screen answers."""

    plotter: pyvista.Plotter
    open: bool  # until somebody closes it

    def tick(self, seconds: float) -> None:
        """Go on playing, draw what is new."""

    def refresh(self) -> None:
        """Draw what differs from what is on the screen."""

    def key(self, name: str) -> None:
        """A key was pressed."""

    def press(self, x: float, y: float) -> bool:
        """The mouse was pressed, pixels from the window's upper left corner; whether it was on a panel."""

    def move(self, x: float, y: float) -> bool:
        """The mouse was moved; whether a panel takes it."""

    def release(self) -> None:
        """The mouse was let go."""


class Panel:
    """A picture in a rectangle of the window."""

    def __init__(self, plotter: pyvista.Plotter) -> None:
        self.renderer = vtkRenderer()
        self.renderer.SetBackground(1.0, 1.0, 1.0)
        self.renderer.InteractiveOff()
        self.mapper = vtkImageMapper()
        self.mapper.SetColorWindow(255)
        self.mapper.SetColorLevel(127.5)
        actor = vtkActor2D()
        actor.SetMapper(self.mapper)
        self.renderer.AddViewProp(actor)
        plotter.render_window.AddRenderer(self.renderer)
        self.put(np.full((2, 2, 3), 255, np.uint8))

    def place(self, box: Box, width: int, height: int) -> None:
        """Where in a window of some size it is."""
        self.renderer.SetViewport(*viewport(box, width, height))

    def put(self, picture: ByteArray) -> None:
        """Show a picture."""
        height, width = picture.shape[:2]
        data = vtkImageData()
        data.SetDimensions(width, height, 1)
        values = numpy_to_vtk(picture[::-1].reshape(-1, 3), deep=True)  # type: ignore[no-untyped-call]
        data.GetPointData().SetScalars(values)
        self.mapper.SetInputData(data)


class DesktopViewer:
    """One session in a window."""

    def __init__(self, session: Session, plotter: pyvista.Plotter) -> None:
        self.session = session
        self.plotter = plotter
        self.scene = Scene3D(plotter)
        self.map: MapPicture | None = None
        self.hover = ""
        self.help = False
        self.open = True
        self._drawn: ViewerState | None = None
        self._words: tuple[str, ...] = ()
        self._size = (0, 0)
        self._dragging = False
        prepare(plotter)
        self.map_panel, self.timeline_panel = Panel(plotter), Panel(plotter)
        listen(self)

    @property
    def layout(self) -> Layout:
        """Where the panels are now."""
        return layout_of(*self._size)

    def tick(self, seconds: float) -> None:
        """Go on playing, take over what the background found, draw what is new."""
        self.session.poll()
        self.session.pass_time(seconds)
        self.refresh()

    def key(self, name: str) -> None:
        """A key was pressed."""
        if name == "h":
            self.help = not self.help
        elif name == "q":
            self.open = False
        elif name in KEYS:
            act(self.session, KEYS[name][0])
        self.refresh()

    def press(self, x: float, y: float) -> bool:
        """The mouse was pressed, pixels from the window's upper left corner; whether it was on a panel."""
        panels = self.layout
        if panels.map.holds(x, y) and self.map is not None:
            preview = self.session.state.preview
            cell = self.map.cell(
                x - panels.map.left, y - panels.map.top, yaw=None if preview is None else preview.cell[2]
            )
            if cell is not None:
                self.session.do(lambda now: previewed(now, cell))
        elif panels.timeline.holds(x, y):
            self._dragging = True
            self._go_to(x)
        self.refresh()
        return not panels.scene.holds(x, y)

    def move(self, x: float, y: float) -> bool:
        """The mouse was moved; whether it is on a panel, or drags the time line."""
        panels = self.layout
        if self._dragging:
            self._go_to(x)
        inside = self.map is not None and panels.map.holds(x, y)
        self.hover = self.map.words(x - panels.map.left, y - panels.map.top) if inside and self.map else ""
        self.refresh()
        return self._dragging

    def release(self) -> None:
        """The mouse was let go."""
        self._dragging = False

    def refresh(self) -> None:
        """Draw what differs from what is on the screen."""
        state, window = self.session.state, self.plotter.render_window
        size = tuple(window.GetSize())
        if size != self._size:
            self._resize(size)
        changed = state is not self._drawn
        volumes = self.session.volumes()
        if changed or volumes is not None:
            self._draw(state, volumes)
        words = self._lines(state)
        if words != self._words:
            self._write(words)
            changed = True
        if changed:
            window.Render()

    def _draw(self, state: ViewerState, volumes: Volumes | None) -> None:
        before, panels = self._drawn, self.layout
        self.plotter.render_window.SetMultiSamples(0 if state.playing else STILL_SAMPLES)
        self.scene.draw(state, volumes)
        if before is None or before.camera is not state.camera or before.material is not state.material:
            self.scene.look(state, aspect=panels.scene.width / panels.scene.height)
        else:
            self.scene.follow(state)
        box = panels.map
        if before is None or map_key(before) != map_key(state):
            self.map = draw_map(state, width=box.width, height=box.height)
        if before is None or marks_key(before) != marks_key(state):
            empty = self.map is None
            self.map_panel.put(empty_map(box.width, box.height) if empty else marked(self.map, state))  # type: ignore[arg-type]
        self.timeline_panel.put(timeline_picture(state, width=panels.timeline.width, height=panels.timeline.height))
        self._drawn = state

    def _resize(self, size: tuple[int, int]) -> None:
        """The panels in a window of another size; everything is drawn anew."""
        self._size = size
        panels = self.layout
        self.plotter.renderer.SetViewport(*viewport(panels.scene, *size))
        self.map_panel.place(panels.map, *size)
        self.timeline_panel.place(panels.timeline, *size)
        self._drawn = None

    def _lines(self, state: ViewerState) -> tuple[str, ...]:
        if self.help:
            return tuple(f"{key:>8}  {words}" for key, words in (*help_lines(), ("h", "this help"), ("q", "close")))
        busy = self.session.progress
        working = () if busy is None else (f"{busy[0]}, {100 * busy[1]:.0f} %",)
        said = (self.session.message,) if self.session.message else ()
        hover = (self.hover,) if self.hover else ()
        return (*status(state), *working, *said, *hover, "h: keys")

    def _write(self, words: tuple[str, ...]) -> None:
        self._words = words
        write_words(self.plotter, words, even=self.help)

    def _go_to(self, x: float) -> None:
        box = self.layout.timeline
        frame = frame_at(x - box.left, box.width, self.session.state.material.n_frames)
        self.session.do(lambda now: at_frame(now, frame))


def open_window(session: Session, *, size: tuple[int, int] = SIZE) -> None:
    """Show a session in a window until it is closed.

    Raises:
        NoScreen: there is no screen.
    """
    try:
        run_window(lambda plotter: DesktopViewer(session, plotter), size)
    finally:
        session.close()


def run_window(make: Callable[[pyvista.Plotter], Window], size: tuple[int, int]) -> None:
    """Show a window until somebody closes it.

    Args:
        make: fills it.
        size: width and height, pixels.

    Raises:
        NoScreen: there is no screen.
    """
    if not has_screen():
        raise NoScreen("the viewer's window", INSTEAD)
    plotter = pyvista.Plotter(off_screen=False, window_size=size, lighting="none", title="mhvedit")
    try:
        window = make(plotter)
        window.refresh()
        plotter.show(interactive_update=True, auto_close=False)
        last = time.perf_counter()
        while window.open:
            now = time.perf_counter()
            window.tick(now - last)
            last = now
            plotter.iren.process_events()
            time.sleep(TICK)
    finally:
        plotter.close()


def listen(window: Window) -> None:
    """Our mouse and keys come before VTK's own; keys never reach it: it would draw wires and stereo."""
    iren = window.plotter.iren.interactor
    iren.SetInteractorStyle(vtkInteractorStyleTrackballCamera())

    def observe(event: str, handler: Callable[[], bool | None]) -> None:
        tags: list[int] = []

        def called(*_: object) -> None:
            if handler():
                iren.GetCommand(tags[0]).SetAbortFlag(1)

        tags.append(iren.AddObserver(event, called, FIRST))

    def at() -> tuple[float, float]:
        x, y = iren.GetEventPosition()
        return x, window.plotter.render_window.GetSize()[1] - 1 - y

    def key() -> bool:
        window.key(iren.GetKeySym())
        return True

    def close() -> bool:
        window.open = False
        return False

    observe("LeftButtonPressEvent", lambda: window.press(*at()))
    observe("MouseMoveEvent", lambda: window.move(*at()))
    observe("LeftButtonReleaseEvent", lambda: window.release())
    observe("KeyPressEvent", key)
    observe("CharEvent", lambda: True)
    observe("ExitEvent", close)


def write_words(plotter: pyvista.Plotter, words: Sequence[str], *, even: bool) -> None:
    """Lines of text in the scene's upper left corner; `even`: all letters of one width."""
    text = plotter.add_text(
        "\n".join(words), position="upper_left", font_size=9, color=INK, name="words", render=False,
        font_file=str(FONT.with_stem("DejaVuSansMono") if even else FONT),
    )  # fmt: skip
    text.prop.background_color, text.prop.background_opacity = "white", 0.85


def viewport(box: Box, width: int, height: int) -> tuple[float, float, float, float]:
    """Left, bottom, right, top of a rectangle, as shares of the window."""
    bottom = height - box.top - box.height
    return (
        box.left / width, bottom / height, (box.left + box.width) / width, (bottom + box.height) / height,
    )  # fmt: skip
