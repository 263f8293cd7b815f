"""The body before and after, side by side, its limbs coloured by how deep they are in each other."""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
import pyvista
from vtkmodules.vtkRenderingCore import vtkBillboardTextActor3D

from mhvedit.geometry.arrays import ByteArray, FloatArray
from mhvedit.pipeline.posture_file import Take, posed
from mhvedit.view.captions import FONT
from mhvedit.view.postures import telling_look
from mhvedit.view.stage import vertex_normals
from mhvedit.view.studio import UP, Camera, camera_axes, framing
from mhvedit.view.style import INK, rgb
from mhvedit.viewer.frames import DrawnFrame
from mhvedit.viewer.motion import MotionMaterial, MotionState, Side
from mhvedit.viewer.motion_strip import depth_colours, top_of
from mhvedit.viewer.scene3d import fill, prepare, put_floor, set_camera

BETWEEN: Final = 0.45  # m, of flesh and air between the joints of the two bodies
ROOM: Final = 1.12  # of the picture round the joints
ABOVE: Final = 0.06  # m, from the body to the words over it
HEAD: Final = 0.3  # m, from the highest joint to above these words
MOST_FRAMES: Final = 200  # that a camera is placed for
LABELS: Final = {Take.CAPTURED: "before", Take.EDITED: "after"}


@dataclass(frozen=True, slots=True, eq=False)
class Stand:
    """How a motion is stood on the stage from one side."""

    look: FloatArray  # (3,) from the eye to the bodies
    up: FloatArray  # (3,) what is up in the picture
    apart: FloatArray  # (3,) m, from the body before to the one after: to the right in the picture
    cloud: FloatArray  # (N, 3) m, the joints of both in many frames, about where the body is


@dataclass(slots=True, eq=False)
class MotionStage:
    """What stands on a plotter's stage."""

    plotter: pyvista.Plotter
    material: MotionMaterial
    surfaces: dict[Take, pyvista.PolyData] = field(init=False)
    labels: dict[Take, vtkBillboardTextActor3D] = field(init=False)
    stands: dict[Side, Stand] = field(init=False)
    shown: dict[Take, DrawnFrame] = field(default_factory=dict)  # whose arrays the graphics hold
    floor: FloatArray | None = None  # (2,) m, its middle
    place: FloatArray | None = None  # (3,) m, what the camera goes along with

    def __post_init__(self) -> None:
        prepare(self.plotter)
        self.stands = {side: stand_of(self.material, side) for side in Side}
        self.surfaces = {take: pyvista.PolyData() for take in Take}
        self.labels = {take: _label(words) for take, words in LABELS.items()}
        for label in self.labels.values():
            self.plotter.renderer.AddViewProp(label)

    def draw(self, state: MotionState) -> None:
        """Bring the stage up to a state; the picture is taken by whoever shows it."""
        postures, apart = self.material.postures, self.stands[state.side].apart
        limit, top = float(postures.limit), top_of(self.material)
        for take in Take:
            vertices = posed(postures, take, state.frame) + take * apart
            normals = vertex_normals(vertices, postures.faces).astype(np.float32)
            frame = self.shown[take] = DrawnFrame(vertices.astype(np.float32), normals, postures.faces)
            surface = self.surfaces[take]
            fill(surface, frame)
            colours = depth_colours(postures.depth[take, state.frame].astype(np.float64), limit=limit, top=top)
            surface.cell_data["colour"] = colours[postures.limb]
            if f"body {take}" not in self.plotter.actors:
                self.plotter.add_mesh(
                    surface, scalars="colour", rgb=True, smooth_shading=True, split_sharp_edges=False, ambient=0.22,
                    diffuse=0.85, specular=0.12, specular_power=12, render=False, reset_camera=False,
                    show_scalar_bar=False, name=f"body {take}",
                )  # fmt: skip
            x, y, _ = (place_of(self.material, state.frame) + take * apart).tolist()
            self.labels[take].SetPosition(x, y, float(vertices[:, 2].max()) + ABOVE)
        self._draw_floor(state)

    def look(self, state: MotionState, *, aspect: float) -> None:
        """Turn the camera to the state's side, without perspective: what is the same in both bodies looks the same.

        Args:
            state: to be shown.
            aspect: width of the picture over its height.
        """
        stand, self.place = self.stands[state.side], place_of(self.material, state.frame)
        points = stand.cloud + self.place
        camera = framing(points, stand.look, aspect=aspect, up=stand.up)
        set_camera(self.plotter, camera)
        across, high, _ = np.abs((points - camera.target) @ camera_axes(stand.look, stand.up)).max(0).tolist()
        self.plotter.camera.parallel_projection = True
        self.plotter.camera.parallel_scale = ROOM * max(high, across / aspect)

    def follow(self, state: MotionState) -> None:
        """Move the camera along with the body; it stays turned as somebody turned it."""
        place, before = place_of(self.material, state.frame), self.place
        if before is not None:
            lens, step = self.plotter.camera, place - before
            moved = Camera(np.array(lens.position) + step, np.array(lens.focal_point) + step, np.array(lens.up))
            set_camera(self.plotter, moved)
        self.place = place

    def _draw_floor(self, state: MotionState) -> None:
        """A floor about the bodies; anew when they have gone a metre."""
        middle = np.round((place_of(self.material, state.frame) + self.stands[state.side].apart / 2)[:2])
        if self.floor is None or (middle != self.floor).any():
            put_floor(self.plotter, middle)
            self.floor = middle


def place_of(material: MotionMaterial, frame: int) -> FloatArray:
    """(3,) m, the floor below the middle of the captured body's joints."""
    joints = material.postures.positions[Take.CAPTURED, frame].astype(np.float64)
    return np.array([*((joints.min(0) + joints.max(0)) / 2)[:2], 0.0])


def stand_of(material: MotionMaterial, side: Side) -> Stand:
    """How both bodies are stood so that a camera on a side sees them beside each other, in all frames."""
    look = near_look(material)
    up = UP
    if side is Side.FAR:
        look = look * np.array([-1.0, -1.0, 1.0])
    elif side is Side.TOP:
        look, up = np.array([0.0, 0.0, -1.0]), look * np.array([1.0, 1.0, 0.0])
    postures = material.postures
    chosen = np.unique(np.linspace(0, material.n_frames - 1, MOST_FRAMES).astype(int))
    places = np.stack([place_of(material, int(frame)) for frame in chosen])
    about = postures.positions[:, chosen].astype(np.float64) - places[:, None]
    right = camera_axes(look, up)[:, 0]
    across = about.reshape(-1, 3) @ right
    apart = (across.max() - across.min() + BETWEEN) * right
    over = np.array([0.0, 0.0, about[..., 2].max() + HEAD])
    clouds = [np.vstack([about[take].reshape(-1, 3), over]) + take * apart for take in Take]
    return Stand(look, up, apart, np.concatenate(clouds))


def near_look(material: MotionMaterial) -> FloatArray:
    """(3,) from the eye to the body: to where limbs are deepest in each other in the captured motion."""
    postures = material.postures
    frame = int(postures.deepest[Take.CAPTURED].argmax())
    colliding = postures.depth[Take.CAPTURED, frame] > float(postures.limit)
    return telling_look(posed(postures, Take.CAPTURED, frame), postures.faces[colliding[postures.limb]])


def stage_picture(stage: MotionStage, state: MotionState) -> ByteArray:
    """(H, W, 3) a state through its own camera; the stage's plotter is offscreen."""
    width, height = stage.plotter.window_size
    stage.draw(state)
    stage.look(state, aspect=width / height)
    stage.plotter.render()
    return np.asarray(stage.plotter.screenshot(return_img=True), np.uint8)[..., :3].copy()


def _label(words: str) -> vtkBillboardTextActor3D:
    """Words that stand over a body and face the camera."""
    label = vtkBillboardTextActor3D()
    label.SetInput(words)
    text = label.GetTextProperty()
    text.SetFontFamily(4)  # of the file
    text.SetFontFile(str(FONT))
    text.SetFontSize(20)
    text.SetColor(*rgb(INK))
    text.SetJustificationToCentered()
    return label
