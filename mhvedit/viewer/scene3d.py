"""The scene in three dimensions, drawn for a state; what does not change between frames is left alone."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pyvista
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import VTK_INT
from vtkmodules.vtkCommonDataModel import vtkCellArray

from mhvedit.geometry.arrays import ByteArray, FloatArray
from mhvedit.geometry.offsets import FAR, middle_in_plan, offset_of, round_offset, without_offset
from mhvedit.geometry.planar import apply_pose, compose, rotation
from mhvedit.geometry.quaternions import rotation_matrices
from mhvedit.sequences.meshes import Mesh
from mhvedit.view.renders import EYE_ANGLE, EYE_NEAR, OWN_HEAD, Colouring, View, camera_of
from mhvedit.view.stage import (
    FLOOR_SIDE,
    PALER,
    add_prop,
    colours_by_label,
    colours_by_time,
    floor_picture,
    voxel_faces,
)
from mhvedit.view.studio import UP, Camera
from mhvedit.view.style import FLOOR, OK, WARNING, lighter, subject_colours
from mhvedit.viewer.frames import DrawnFrame, FrameCache
from mhvedit.viewer.material import Actor
from mhvedit.viewer.shapes import cone, dashes, frame_along
from mhvedit.viewer.state import CameraPreset, Layer, ViewerState, placements_at
from mhvedit.volumes.history import MotionHistoryVolume

Volumes = tuple[MotionHistoryVolume, MotionHistoryVolume]  # A's and B's interest parts, canonical frames
PATH_HEIGHT = 0.012  # m above the floor
PROP = "prop "  # and its name: of actors
STILL_SAMPLES = 8  # of a still picture's edges; none while it plays, which is what software rendering can do
FURTHEST = 60.0  # m, what is further off is not seen
EMPTY_STAGE = Camera(np.array([0.0, -6.0, 2.0]), np.array([0.0, 0.0, 0.8]), UP)


@dataclass(slots=True, eq=False)
class Body:
    """One person on the stage: one mesh and one actor, whose arrays are replaced from frame to frame."""

    surface: pyvista.PolyData
    actor: pyvista.Actor
    shown: DrawnFrame | None = None


@dataclass(slots=True, eq=False)
class Scene3D:
    """What stands on a plotter's stage."""

    plotter: pyvista.Plotter
    frames: FrameCache = field(default_factory=FrameCache)
    bodies: dict[str, Body] = field(default_factory=dict)
    extras: dict[str, object] = field(default_factory=dict)  # by actor name, what it was made of
    prop_offsets: dict[str, FloatArray] = field(default_factory=dict)  # by actor name, (2,) m, as of `DrawnFrame`
    origin: FloatArray = field(default_factory=lambda: np.zeros(2))  # (2,) whole m in the world, of the stage

    def draw(self, state: ViewerState, volumes: Volumes | None = None) -> None:
        """Bring the stage up to a state; the picture is taken by whoever shows it.

        Args:
            state: to be shown.
            volumes: of the current segment's interest parts, where they are known.
        """
        self._settle(state)
        colours = subject_colours(list(state.material.tracks))
        placed = placements_at(state, state.frame)
        eyes = _own_eyes(state)
        for name, (number, pose) in placed.items():
            actor = state.material.cast.get(name)
            if actor is not None:
                frame = self.frames.frame(name, actor, number)
                self._draw_body(name, frame, pose, colours[name], shown=Layer.BODIES in state.layers)
                if name == eyes:
                    self._behead(name, frame, actor, number)
        for name in set(self.bodies) - set(state.material.cast):
            self.plotter.remove_actor(self.bodies.pop(name).actor, render=False)
        self._draw_props(state)
        self._draw_floor(state)
        self._draw_paths(state, colours)
        self._draw_cones(state, placed, colours)
        self._draw_volumes(state, placed, volumes)
        self._draw_preview_ring(state, placed)

    def look(self, state: ViewerState, *, aspect: float) -> None:
        """Turn the camera to where the state's preset sees the scene from.

        Args:
            state: to be shown.
            aspect: width of the picture over its height.
        """
        self._settle(state)
        self._turn_camera(state, aspect)

    def follow(self, state: ViewerState) -> None:
        """Move a camera that looks through somebody's eyes along with them; others stay."""
        if _own_eyes(state) is not None:
            self._turn_camera(state, 1.0)

    def _turn_camera(self, state: ViewerState, aspect: float) -> None:
        set_camera(self.plotter, camera_for(self, state, aspect=aspect).moved(-np.array([*self.origin, 0.0])))

    def _settle(self, state: ViewerState) -> None:
        """Move the stage's origin along with a scene that is far from it: graphics are float32."""
        middle = middle_of(state)
        if np.hypot(*(middle - self.origin)) <= FAR:
            return
        before, self.origin = self.origin, round_offset(middle)
        for key in list(self.extras):
            self._remove(key)
        lens, step = self.plotter.camera, np.array([*(self.origin - before), 0.0])
        lens.position = tuple(np.array(lens.position) - step)
        lens.focal_point = tuple(np.array(lens.focal_point) - step)

    def _matrix(self, pose: FloatArray, offset: FloatArray | None = None) -> FloatArray:
        """(4, 4) of a planar pose in the world, about the stage's origin, for points without an offset."""
        about = pose if offset is None else compose(pose, np.array([*offset, 0.0]))
        return matrix(about - np.array([*self.origin, 0.0]))

    def _draw_body(self, name: str, frame: DrawnFrame, pose: FloatArray, colour: str, *, shown: bool) -> None:
        body = self.bodies.get(name)
        if body is None:
            surface = pyvista.PolyData()
            fill(surface, frame)
            actor = self.plotter.add_mesh(
                surface, color=lighter(colour, PALER), smooth_shading=True, split_sharp_edges=False, ambient=0.22,
                diffuse=0.85, specular=0.12, specular_power=12, render=False, reset_camera=False,
                show_scalar_bar=False, name=f"body {name}",
            )  # fmt: skip
            body = self.bodies[name] = Body(surface, actor, frame)
        elif body.shown is not frame:
            fill(body.surface, frame)
            body.shown = frame
        body.actor.user_matrix = self._matrix(pose, frame.offset)
        body.actor.visibility = shown

    def _behead(self, name: str, frame: DrawnFrame, actor: Actor, number: int) -> None:
        """One's own body as one sees it: without what is as near to the eye as one's own head."""
        look = actor.look_at(number)
        if look is None:
            return
        near = ((frame.points - without_offset(look[0], frame.offset)) ** 2).sum(1) < OWN_HEAD**2
        kept = DrawnFrame(frame.points, frame.normals, frame.faces[~near[frame.faces].any(1)], frame.offset)
        fill(self.bodies[name].surface, kept)
        self.bodies[name].shown = None

    def _draw_props(self, state: ViewerState) -> None:
        known = state.material.props
        for key in [key for key in self.extras if key.startswith(PROP) and key.removeprefix(PROP) not in known]:
            self._remove(key)
        for name, prop in known.items():
            key, number = f"{PROP}{name}", int(prop.edit.frames[state.frame])
            if not self._is_drawn(key, (prop.sequence, number)):
                mesh = prop.sequence.mesh(number)
                self.prop_offsets[key] = offset_of(mesh.vertices)
                add_prop(self.plotter, Mesh(without_offset(mesh.vertices, self.prop_offsets[key]), mesh.faces), key)
            pose = np.eye(4)
            pose[:3, :3] = rotation_matrices(prop.edit.rotations[state.frame])
            stood = prop.edit.positions[state.frame] + pose[:3, :3] @ np.array([*self.prop_offsets[key], 0.0])
            pose[:3, 3] = without_offset(stood, self.origin)
            self.plotter.actors[key].user_matrix = pose

    def _draw_floor(self, state: ViewerState) -> None:
        places = [track.placements for track in state.material.tracks.values()]
        middle = np.round(middle_of(state), 1)
        if self._is_drawn("floor", (tuple(middle), len(places))):
            return
        put_floor(self.plotter, middle - self.origin)

    def _draw_paths(self, state: ViewerState, colours: Mapping[str, str]) -> None:
        for name, actor in state.material.cast.items():
            track = state.material.tracks[name]
            for layer, width in ((Layer.AFTER, 5), (Layer.BEFORE, 2)):
                key = f"{layer} {name}"
                if self._is_drawn(key, (layer in state.layers, state.material)) or layer not in state.layers:
                    continue
                centres = actor.centres_at(track.source)
                first = track.placements[0]
                path = placed_path(track.placements, centres) if layer is Layer.AFTER else apply_pose(first, centres)
                points = np.column_stack([path - self.origin, np.full(len(path), PATH_HEIGHT)])
                line = pyvista.lines_from_points(points) if layer is Layer.AFTER else dashes(points)
                self.plotter.add_mesh(
                    line, color=colours[name], line_width=width, lighting=False, render=False, reset_camera=False,
                    name=key, pickable=False,
                )  # fmt: skip

    def _draw_cones(
        self, state: ViewerState, placed: Mapping[str, tuple[int, FloatArray]], colours: Mapping[str, str]
    ) -> None:
        decision = state.decision
        half_angle = None if decision is None else decision.half_angle
        wanted = Layer.CONES in state.layers and half_angle is not None
        for name, actor in state.material.cast.items():
            look = actor.look_at(placed[name][0]) if wanted else None
            key = f"cone {name}"
            if look is None or half_angle is None:
                self._remove(key)
                continue
            surface = cone(half_angle)
            axis = look[1] / np.linalg.norm(look[1])
            turned = np.asarray(surface.points) @ frame_along(axis).T + look[0]
            stood = apply_pose(placed[name][1], turned)
            surface.points = without_offset(stood, self.origin).astype(np.float32)
            self.plotter.add_mesh(
                surface, color=colours[name], opacity=0.18, lighting=False, render=False, reset_camera=False, name=key,
                pickable=False,
            )  # fmt: skip
            self.extras[key] = None

    def _draw_volumes(
        self, state: ViewerState, placed: Mapping[str, tuple[int, FloatArray]], volumes: Volumes | None
    ) -> None:
        view = state.view
        if view is None or volumes is None or Layer.VOLUMES not in state.layers:
            for side in ("A", "B"):
                self._remove(f"volume {side}")
            return
        if not view.start <= state.frame < view.stop:
            placed = placements_at(state, view.moment)
        colouring = colours_by_time if state.colouring is Colouring.TIME else colours_by_label
        for side, name, volume, canonical in zip("AB", view.between, volumes, view.frames, strict=True):
            key = f"volume {side}"
            if not self._is_drawn(key, (id(volume), state.colouring)):
                add_volume(self.plotter, volume, colouring(volume), key)
            self.plotter.actors[key].user_matrix = self._matrix(compose(placed[name][1], canonical))

    def _draw_preview_ring(self, state: ViewerState, placed: Mapping[str, tuple[int, FloatArray]]) -> None:
        """A ring under B while a pose is looked at: green for a solution, red for what is none."""
        view, preview = state.view, state.preview
        if view is None or preview is None or not view.start <= state.frame < view.stop:
            self._remove("preview")
            return
        name = view.between[1]
        at = compose(placed[name][1], view.frames[1])
        root = rotation(at[2]) @ view.grid.root_b + at[:2] - self.origin
        ring = pyvista.Disc(center=(root[0], root[1], 0.006), inner=0.30, outer=0.36, normal=(0, 0, 1), c_res=48)
        self.plotter.add_mesh(
            ring, color=WARNING if preview.row is None else OK, lighting=False, render=False, reset_camera=False,
            name="preview", pickable=False,
        )  # fmt: skip
        self.extras["preview"] = None

    def _is_drawn(self, key: str, made_of: object) -> bool:
        """Whether an extra already is what it should be; if not, it is taken away and noted as the new one."""
        if key in self.extras and self.extras[key] == made_of:
            return True
        self._remove(key)
        self.extras[key] = made_of
        return False

    def _remove(self, key: str) -> None:
        if key in self.plotter.actors:
            self.plotter.remove_actor(key, render=False)
        self.extras.pop(key, None)


def prepare(plotter: pyvista.Plotter) -> None:
    """Background and lights of the house, with lights that go along with the camera."""
    plotter.set_background(FLOOR)
    plotter.remove_all_lights()
    for place, strength in (((-0.6, 0.8, 1.0), 0.7), ((0.9, 0.2, 1.0), 0.3)):
        light = pyvista.Light(position=place, intensity=strength, light_type="camera light")
        plotter.add_light(light)
    plotter.add_light(pyvista.Light(position=(0, 0, 8), focal_point=(0, 0, 0), intensity=0.25))


def put_floor(plotter: pyvista.Plotter, middle: FloatArray) -> None:
    """A floor in place of the one that is there; (2,) m, where it is seen best."""
    plane = pyvista.Plane(center=(*middle, -0.002), direction=(0, 0, 1), i_size=FLOOR_SIDE, j_size=FLOOR_SIDE)
    texture = pyvista.Texture(floor_picture(middle, []))
    texture.InterpolateOn()
    plotter.add_mesh(
        plane, texture=texture, lighting=False, render=False, reset_camera=False, name="floor", pickable=False
    )


def fill(surface: pyvista.PolyData, frame: DrawnFrame) -> None:
    """Put a frame's arrays into a mesh that is already drawn; faces are taken as they are, without copies."""
    faces = vtkCellArray()
    faces.SetData(3, numpy_to_vtk(frame.faces.ravel(), deep=False, array_type=VTK_INT))  # type: ignore[no-untyped-call]
    surface.points = frame.points
    surface.SetPolys(faces)
    surface.point_data.active_normals = frame.normals


def add_volume(plotter: pyvista.Plotter, volume: MotionHistoryVolume, colours: object, key: str) -> None:
    """The outer faces of a volume's voxels, in its canonical frame."""
    points, normals, shades = voxel_faces(volume, np.asarray(colours))
    quads = np.arange(4 * len(points), dtype=np.int64).reshape(-1, 4)
    surface = pyvista.PolyData.from_regular_faces(points.reshape(-1, 3).astype(np.float32), quads)
    surface.point_data.active_normals = np.repeat(normals, 4, axis=0).astype(np.float32)
    surface.cell_data["colour"] = shades
    plotter.add_mesh(
        surface, scalars="colour", rgb=True, smooth_shading=True, split_sharp_edges=False, ambient=0.35, diffuse=0.75,
        render=False, reset_camera=False, show_scalar_bar=False, name=key, pickable=False,
    )  # fmt: skip


def camera_for(scene: Scene3D, state: ViewerState, *, aspect: float) -> Camera:
    """The camera of a state's preset, in the world.

    Args:
        scene: in which the meshes are.
        state: to be shown.
        aspect: width of the picture over its height.
    """
    placed = placements_at(state, state.frame)
    own = _own_eyes(state)
    if own is not None:
        number, pose = placed[own]
        look = state.material.cast[own].look_at(number)
        if look is not None:
            eye, direction = apply_pose(pose, look[0]), apply_pose(np.array([0.0, 0.0, pose[2]]), look[1])
            up = UP if abs(direction[2]) < 0.99 else np.array([1.0, 0.0, 0.0])
            return Camera(eye, eye + direction, up, EYE_ANGLE, EYE_NEAR)
    views = {CameraPreset.TOP: View.TOP, CameraPreset.FRONT: View.FRONT}
    meshes = {}
    for name, (number, pose) in placed.items():
        if name in state.material.cast:
            frame = scene.frames.frame(name, state.material.cast[name], number)
            points = without_offset(frame.points.astype(np.float64), -frame.offset)
            meshes[name] = Mesh(apply_pose(pose, points), frame.faces)
    if not meshes:
        return EMPTY_STAGE
    return camera_of(views.get(state.camera, View.SIDE), meshes, aspect=aspect)


def scene_picture(scene: Scene3D, state: ViewerState, volumes: Volumes | None = None) -> ByteArray:
    """(H, W, 3) a state through its own camera.

    Args:
        scene: on an offscreen plotter.
        state: to be shown.
        volumes: of the current segment's interest parts, where they are known.
    """
    width, height = scene.plotter.window_size
    scene.draw(state, volumes)
    scene.look(state, aspect=width / height)
    scene.plotter.render()
    return np.asarray(scene.plotter.screenshot(return_img=True), np.uint8)[..., :3].copy()


def set_camera(plotter: pyvista.Plotter, camera: Camera) -> None:
    """Look through a camera."""
    lens = plotter.camera
    lens.position, lens.focal_point, lens.up = tuple(camera.eye), tuple(camera.target), tuple(camera.up)
    lens.view_angle = camera.view_angle
    lens.clipping_range = (camera.near, FURTHEST)


def matrix(pose: FloatArray) -> FloatArray:
    """(4, 4) of a planar pose."""
    made = np.eye(4)
    made[:2, :2], made[:2, 3] = rotation(pose[2]), pose[:2]
    return made


def placed_path(placements: FloatArray, centres: FloatArray) -> FloatArray:
    """(N, 2) m in the world, of centres in the capture's frame."""
    turned = (rotation(placements[:, 2]) @ centres[:, :, None])[..., 0]
    return np.asarray(turned + placements[:, :2])


def middle_of(state: ViewerState) -> FloatArray:
    """(2,) m, the middle of everybody's paths."""
    paths = [
        placed_path(state.material.tracks[name].placements, actor.centres_at(state.material.tracks[name].source))
        for name, actor in state.material.cast.items()
    ]
    if not paths:
        return np.zeros(2)
    return middle_in_plan(np.concatenate(paths))


def _own_eyes(state: ViewerState) -> str | None:
    """Through whose eyes the scene is seen; None for other cameras, and where it is not known."""
    if state.camera not in (CameraPreset.EYES_A, CameraPreset.EYES_B):
        return None
    names = state.view.between if state.view is not None else tuple(state.material.tracks)
    name = names[0 if state.camera is CameraPreset.EYES_A else -1]
    actor = state.material.cast.get(name)
    if actor is None or actor.look_at(placements_at(state, state.frame)[name][0]) is None:
        return None
    return name
