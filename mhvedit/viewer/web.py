"""The viewer in a browser: a trame server that draws here and shows there."""

import asyncio
import errno
import socket
import time
from base64 import b64encode
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from io import BytesIO
from math import radians
from typing import Any

import numpy as np
import pyvista
from aiohttp import web
from PIL import Image
from trame.app import get_server
from trame_server import Server
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkRenderingCore import vtkRenderWindowInteractor

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import ByteArray
from mhvedit.project.schema import Tolerance
from mhvedit.viewer.actions import act
from mhvedit.viewer.deciding import left_rows, with_half_angle, with_tolerance
from mhvedit.viewer.map2d import MapPicture, draw_map, empty_map, map_key, marked, marks_key
from mhvedit.viewer.page import build_page
from mhvedit.viewer.scene3d import STILL_SAMPLES, Scene3D, prepare
from mhvedit.viewer.session import Session
from mhvedit.viewer.state import (
    CameraPreset,
    Layer,
    ViewerState,
    at_frame,
    at_speed,
    in_segment,
    looked_at_row,
    looped,
    previewed,
    seen_from,
    with_layer,
)
from mhvedit.viewer.timeline import frame_at, timeline_picture, x_of
from mhvedit.viewer.words import shown_in_words, status

LOOPBACK = ("127.0.0.1", "localhost", "::1")
TRIED_PORTS = 50
VIEW_SIZE = (960, 640)  # until the browser says how large its view is
MAP_SIZE = (460, 640)
TIMELINE_SIZE = (1400, 60)
TICK = 0.01  # s, between looks at what is to be done
MOST_REGIONS = 12  # that are listed


class WebViewer:
    """One session, served."""

    def __init__(self, session: Session, plotter: pyvista.Plotter, *, name: str = "mhvedit") -> None:
        self.session = session
        self.plotter = plotter
        self.scene = Scene3D(plotter)
        prepare(plotter)
        _attach_interactor(plotter)
        self.server: Server = get_server(name, client_type="vue3")
        self.map: MapPicture | None = None
        self._drawn: ViewerState | None = None  # the state that is on the screen
        self._size = tuple(plotter.window_size)
        self._progress: tuple[str, float] | None = None
        self._task: asyncio.Task[None] | None = None
        self._drawn_volumes: object = None
        self._written: dict[str, Any] = {}  # what the browser was told last
        self._told: dict[str, Any] = {}
        self.push: Callable[[], None] = build_page(self)
        self.refresh()
        self.server.controller.on_server_bind.add(_add_launcher)
        self.server.controller.on_server_ready.add(self._begin)

    # what the browser asks for

    def act(self, action: str) -> None:
        """A button or a key."""
        act(self.session, action)
        self.refresh()

    def click_map(self, x: float, y: float) -> None:
        """A click on the map, pixels of its picture."""
        if self.map is not None:
            preview = self.session.state.preview
            cell = self.map.cell(x, y, yaw=None if preview is None else preview.cell[2])
            if cell is not None:
                self.session.do(lambda now: previewed(now, cell))
                self.refresh()

    def hover_map(self, x: float, y: float) -> None:
        """The mouse over the map, pixels of its picture."""
        words = "" if self.map is None else self.map.words(x, y)
        self._tell(hover=words)
        self._flush()

    def click_timeline(self, x: float) -> None:
        """A click on the time line, pixels of its picture."""
        frame = frame_at(x, TIMELINE_SIZE[0], self.session.state.material.n_frames)
        self.go_to(frame)

    def go_to(self, frame: int) -> None:
        """Show a frame of the scene."""
        self.session.do(lambda now: replace(at_frame(now, int(frame)), playing=False))
        self.refresh()

    def choose_segment(self, name: str) -> None:
        """Make another segment the current one."""
        self.session.do(lambda now: in_segment(now, name))
        self.refresh()

    def choose_region(self, region: int) -> None:
        """Look at the solution with most room of a region."""
        view = self.session.state.view
        if view is not None:
            inside = view.group.region == region
            row = int(np.argmax(np.where(inside, view.group.clearance, -np.inf)))
            self.session.do(lambda now: looked_at_row(now, row))
            self.refresh()

    def choose_camera(self, name: str) -> None:
        """See the scene from elsewhere."""
        self.session.do(lambda now: seen_from(now, CameraPreset(name)))
        self.scene.look(self.session.state, aspect=self.aspect)
        self._drawn = None
        self.refresh()

    def show_layer(self, name: str, shown: bool) -> None:
        """Show or hide something."""
        self.session.do(lambda now: with_layer(now, Layer(name), shown))
        self.refresh()

    def set_speed(self, speed: float) -> None:
        """Play at another speed."""
        self.session.do(lambda now: at_speed(now, float(speed)))
        self.refresh()

    def set_loop(self, loop: bool) -> None:
        """Play again from the start, or not."""
        self.session.do(lambda now: looped(now, loop))
        self.refresh()

    def set_half_angle(self, degrees: float | str | None) -> None:
        """Other cones of sight in the current segment; empty for none."""
        value = _number(degrees)
        if value is None or 0 < value <= 180:
            self.session.do(lambda now: with_half_angle(now, None if value is None else radians(value)))
        self.refresh()

    def set_tolerance(self, name: str, value: float | str) -> None:
        """Another tolerance in the current segment, in the scene file's own units."""
        number = _number(value)
        decision = self.session.state.decision
        if decision is not None and number is not None and number >= 0:
            whole: float = round(number) if name == "frames" else number
            values = {key: getattr(decision.tolerance, key) for key in ("frames", "voxels", "depth", "apart")}
            tolerance = Tolerance(**{**values, name: whole})
            self.session.do(lambda now: with_tolerance(now, tolerance))
        self.refresh()

    # what the browser is shown

    @property
    def aspect(self) -> float:
        """Width of the 3D view over its height."""
        width, height = self.plotter.render_window.GetSize()
        return float(width / height)

    def refresh(self) -> None:
        """Bring everything that is shown up to the session's state."""
        state = self.session.state
        volumes = self.session.volumes()
        if state is not self._drawn or volumes is not self._drawn_volumes:
            self._draw(state, volumes)
        self._tell(**self._words(state))
        self._flush()

    def _draw(self, state: ViewerState, volumes: object) -> None:
        before = self._drawn
        self.plotter.render_window.SetMultiSamples(0 if state.playing else STILL_SAMPLES)
        self.scene.draw(state, volumes)  # type: ignore[arg-type]
        if before is None or before.camera is not state.camera or before.material is not state.material:
            self.scene.look(state, aspect=self.aspect)
        else:
            self.scene.follow(state)
        if self.map is None or before is None or map_key(before) != map_key(state):
            self.map = draw_map(state, width=MAP_SIZE[0], height=MAP_SIZE[1])
        if before is None or marks_key(before) != marks_key(state):
            self._tell(map=_as_url(empty_map(*MAP_SIZE) if self.map is None else marked(self.map, state)))
        if before is None or before.segment != state.segment or before.material is not state.material:
            picture = timeline_picture(state, width=TIMELINE_SIZE[0], height=TIMELINE_SIZE[1], now=False)
            self._tell(timeline=_as_url(picture))
        self._drawn, self._drawn_volumes = state, volumes
        self.push()

    def _words(self, state: ViewerState) -> dict[str, Any]:
        decision, view = state.decision, state.view
        tolerance = Tolerance() if decision is None else decision.tolerance
        session = self.session
        half_angle = (
            None if decision is None or decision.half_angle is None else round(np.degrees(decision.half_angle), 3)
        )
        return {
            "scene_name": state.material.name,
            "n_frames": state.material.n_frames,
            "frame": state.frame,
            "now": 100 * x_of(state.frame + 0.5, TIMELINE_SIZE[0], state.material.n_frames) / TIMELINE_SIZE[0],
            "playing": state.playing,
            "speed": state.speed,
            "loop": state.loop,
            "segment": state.segment,
            "segments": [{"name": span.name, "type": span.interaction} for span in state.material.spans],
            "camera": state.camera.value,
            "layers": {layer.value: layer in state.layers for layer in Layer},
            "status": list(status(state)),
            "shown": shown_in_words(state),
            "regions": [] if view is None else _regions(state),
            "half_angle": half_angle,
            "tolerance": {k: getattr(tolerance, k) for k in ("frames", "voxels", "depth", "apart")},
            "pinned": decision is not None and decision.pin is not None,
            "previewing": state.preview is not None,
            "can_decide": session.job is not None and view is not None,
            "can_undo": bool(session.history.past),
            "can_redo": bool(session.history.future),
            "unsolved": not state.is_current,
            "unsaved": not state.is_saved,
            "busy": session.is_busy,
            "progress": "" if session.progress is None else session.progress[0],
            "share": 0 if session.progress is None else round(100 * session.progress[1]),
            "message": session.message,
        }

    def _tell(self, **values: object) -> None:
        """Note what the browser is to know; only what is new is sent."""
        self._told |= {key: value for key, value in values.items() if self._written.get(key, self) != value}

    def _flush(self) -> None:
        if self._told:
            self._written |= self._told
            self.server.state.update(self._told)
            self._told = {}
            self.server.state.flush()

    def _begin(self, **_: object) -> None:
        loop = asyncio.get_event_loop()
        loop.set_exception_handler(_unless_gone)
        self._task = loop.create_task(self._run())

    async def _run(self) -> None:
        """Play, and take over what the background finds, as long as the server lives."""
        last = time.perf_counter()
        while True:
            now = time.perf_counter()
            self._tick(now - last)
            last = now
            await asyncio.sleep(TICK)

    def _tick(self, seconds: float) -> None:
        session = self.session
        size = tuple(self.plotter.render_window.GetSize())
        if size != self._size:
            self._size = size
            self.scene.look(session.state, aspect=size[0] / size[1])
            self.push()
        found = session.poll()
        frame = session.state.frame
        session.pass_time(seconds)
        if found or session.state.frame != frame or (session.is_busy and session.progress != self._progress):
            self._progress = session.progress
            self.refresh()


def serve(session: Session, plotter: pyvista.Plotter, *, host: str, port: int, tell: Callable[[str], None]) -> None:
    """Serve a session until somebody stops it.

    Args:
        session: to be shown.
        plotter: offscreen, of `studio`.
        host: address to listen on.
        port: to begin with; the next free one is taken.
        tell: told where it is, and who can reach it.

    Raises:
        CaptureError: no port is free, or the address is not of this machine.
    """
    free = free_port(host, port)
    if free != port:
        tell(f"port {port} is in use; taking {free}")
    if host not in LOOPBACK:
        tell(f"listening on {host}: everybody who can reach this machine can look, and change the scene file")
    viewer = WebViewer(session, plotter)
    tell(f"open http://{'localhost' if host in LOOPBACK else host}:{free}/ in a browser; Ctrl-C ends it")
    viewer.server.start(
        port=free, host=host, open_browser=False, show_connection_info=False, disable_logging=True, timeout=0
    )


def free_port(host: str, port: int) -> int:
    """The first port from this one on that nobody listens on.

    Raises:
        CaptureError: there is none, or the address is not of this machine.
    """
    for candidate in range(port, min(port + TRIED_PORTS, 65536)):
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with closing(socket.socket(family, socket.SOCK_STREAM)) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, candidate))
            except OSError as fault:
                if fault.errno in (errno.EADDRINUSE, errno.EACCES):
                    continue
                raise CaptureError("--host", "an address of this machine", f"{host}: {fault.strerror}") from fault
            return candidate
    raise CaptureError("--port", f"a free port from {port} on", f"none in {TRIED_PORTS}")


def _add_launcher(bound: Any) -> None:  # noqa: ANN401 - of wslink
    """Answer the page's question for where to connect, which would be an error in its console otherwise."""

    async def launch(request: web.Request) -> web.Response:
        scheme = "wss" if request.secure else "ws"
        return web.json_response({"sessionURL": f"{scheme}://{request.host}/ws"})

    bound.app.router.add_post("/paraview/", launch)


def _unless_gone(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """What goes wrong is told, but not that a browser was closed while it was being sent something."""
    if not isinstance(context.get("exception"), ConnectionError):
        loop.default_exception_handler(context)


def _attach_interactor(plotter: pyvista.Plotter) -> None:
    """What moves the camera when the browser sends the mouse."""
    interactor = vtkRenderWindowInteractor()
    interactor.SetRenderWindow(plotter.render_window)
    interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
    interactor.EnableRenderOff()


def _regions(state: ViewerState) -> list[dict[str, object]]:
    """The largest regions of solutions of the current segment."""
    view = state.view
    if view is None or not view.n_solutions:
        return []
    left = left_rows(state, view)
    listed = []
    for region in range(min(MOST_REGIONS, int(view.group.region.max()) + 1)):
        inside = view.group.region == region
        listed.append(
            {
                "region": region,
                "count": f"{int(inside.sum()):,}",
                "room": f"{100 * float(view.group.clearance[inside].max()):.0f} cm",
                "distance": f"{float(view.group.distance[inside].min()):.2f} to "
                f"{float(view.group.distance[inside].max()):.2f} m",
                "excluded": not bool(left[inside].any()),
            }
        )
    return listed


def _as_url(picture: ByteArray) -> str:
    """A picture as a page can hold it."""
    out = BytesIO()
    Image.fromarray(picture).save(out, "PNG", compress_level=1)
    return "data:image/png;base64," + b64encode(out.getvalue()).decode()


def _number(value: float | str | None) -> float | None:
    try:
        return None if value is None or value == "" else float(value)
    except ValueError:
        return None
