"""One offscreen plotter and the cameras in front of it: the only module that knows pyvista's windows."""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import pyvista
from vtkmodules.vtkCommonCore import vtkLogger

from mhvedit.errors import MissingLibrary
from mhvedit.geometry.arrays import ByteArray, FloatArray
from mhvedit.view.style import FLOOR

INSTALL = "on Debian or Ubuntu `apt-get install libegl1 libgl1` lets pictures be drawn without a screen"
VIEW_ANGLE = 26.0  # degrees, from top to bottom of a picture
MARGIN = 1.08
NEAREST = 0.3  # m, from a camera to its target
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Where a picture is taken from."""

    eye: FloatArray  # (3,) m
    target: FloatArray  # (3,) m
    up: FloatArray  # (3,) unit
    view_angle: float = VIEW_ANGLE  # degrees, from top to bottom
    near: float = 0.05  # m, what is nearer is not seen

    def moved(self, step: FloatArray) -> "Camera":
        """The same camera elsewhere; (3,) m."""
        return Camera(self.eye + step, self.target + step, self.up, self.view_angle, self.near)


@contextmanager
def studio(width: int, height: int) -> Iterator[pyvista.Plotter]:
    """An offscreen plotter for any number of pictures of one size; closed at the end.

    Args:
        width: pixels.
        height: pixels.

    Raises:
        MissingLibrary: nothing can be drawn on this machine.
    """
    check_can_draw()
    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # or it warns that there is no X server
    try:
        plotter = pyvista.Plotter(off_screen=True, window_size=(width, height), lighting="none")
        try:
            yield plotter
        finally:
            plotter.close()
    finally:
        vtkLogger.SetStderrVerbosity(before)


def check_can_draw() -> None:
    """Make sure that VTK will find something to draw with: without it, it takes the whole process down.

    Raises:
        MissingLibrary: there is neither EGL with a device nor a screen.
    """
    if sys.platform.startswith("linux") and not (_has_egl_device() or has_screen()):
        raise MissingLibrary("drawing in 3D", INSTALL)


def _has_egl_device() -> bool:
    """Whether EGL is there and knows something to draw with, be it software."""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
        egl.eglGetProcAddress.restype = ctypes.c_void_p
        address = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    except (OSError, AttributeError):
        return False
    if not address:
        return False
    query = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.c_int))(address)
    count = ctypes.c_int(0)
    return bool(query(0, None, ctypes.byref(count))) and count.value > 0


def has_screen() -> bool:
    """Whether an X server answers and OpenGL is there."""
    if not os.environ.get("DISPLAY"):
        return False
    try:
        ctypes.CDLL("libGL.so.1")
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return False
    x11.XOpenDisplay.restype = ctypes.c_void_p
    screen = x11.XOpenDisplay(None)
    if screen:
        x11.XCloseDisplay(ctypes.c_void_p(screen))
    return bool(screen)


def take_picture(plotter: pyvista.Plotter, camera: Camera) -> ByteArray:
    """(H, W, 3) what a plotter shows from a camera."""
    lens = plotter.camera
    lens.position, lens.focal_point, lens.up = tuple(camera.eye), tuple(camera.target), tuple(camera.up)
    lens.view_angle = camera.view_angle
    lens.clipping_range = (camera.near, 60.0)
    _set_lights(plotter, camera)
    plotter.render()
    return np.asarray(plotter.screenshot(return_img=True), np.uint8)[..., :3].copy()


def empty_stage(plotter: pyvista.Plotter) -> None:
    """Take everything off a plotter's stage."""
    plotter.clear_actors()
    plotter.set_background(FLOOR)


def framing(
    points: FloatArray, direction: FloatArray, *, aspect: float, up: FloatArray = UP, margin: float = MARGIN
) -> Camera:
    """The nearest camera that looks along a direction and sees all points.

    Args:
        points: (N, 3) m, at least one.
        direction: (3,) from the eye to the scene.
        aspect: width of the picture over its height.
        up: (3,) what is up in the picture.
        margin: 1 lets the points touch the picture's edge.
    """
    axes = camera_axes(direction, up)
    local = points @ axes
    target = axes @ ((local.min(0) + local.max(0)) / 2)
    away = distance_needed(points, target, axes, aspect=aspect, margin=margin)
    return Camera(target - away * axes[:, 2], target, axes[:, 1])


def camera_axes(direction: FloatArray, up: FloatArray) -> FloatArray:
    """(3, 3) columns: right, up and forward of a camera, unit."""
    forward = direction / np.linalg.norm(direction)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward], 1)


def distance_needed(
    points: FloatArray, target: FloatArray, axes: FloatArray, *, aspect: float, margin: float = MARGIN
) -> float:
    """How far from its target a camera must stand to see all points, m.

    Args:
        points: (N, 3) m.
        target: (3,) m.
        axes: (3, 3) of `camera_axes`.
        aspect: width of the picture over its height.
        margin: 1 lets the points touch the picture's edge.
    """
    local = (points - target) @ axes
    slope = np.tan(np.radians(VIEW_ANGLE) / 2) / margin
    spread = np.maximum(np.abs(local[:, 0]) / aspect, np.abs(local[:, 1])) / slope
    return max(float((spread - local[:, 2]).max()), NEAREST)


def _set_lights(plotter: pyvista.Plotter, camera: Camera) -> None:
    """A soft key light from above the camera's left, a fill from its right, and some light from the sky."""
    plotter.remove_all_lights()
    forward = camera.target - camera.eye
    distance = float(np.linalg.norm(forward))
    right = np.cross(forward / distance, camera.up)
    key = camera.eye - 0.6 * distance * right + 0.8 * distance * camera.up
    fill = camera.eye + 0.9 * distance * right + 0.2 * distance * camera.up
    sky = camera.target + 5.0 * UP
    for place, strength in ((key, 0.7), (fill, 0.3), (sky, 0.25)):
        light = pyvista.Light(position=tuple(place), focal_point=tuple(camera.target), intensity=strength)
        plotter.add_light(light)
