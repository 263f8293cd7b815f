"""What can stand on the stage: people, voxels, and a floor that shows where they touch it."""

import numpy as np
import pyvista
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter

from mhvedit.geometry.arrays import ByteArray, FloatArray, Int32Array
from mhvedit.geometry.planar import apply_pose, rotation
from mhvedit.sequences.meshes import Mesh
from mhvedit.view.style import FLOOR, LABELS, PROPS, lighter, rgb, time_colours
from mhvedit.volumes.history import MotionHistoryVolume
from mhvedit.volumes.surface import surface_labels

FLOOR_SIDE = 9.0  # m
FLOOR_PIXELS = 800
GRID_STEP = 0.5  # m
FADE = (2.2, 4.2)  # m from the middle, where the grid begins and ends to fade
SHADOW_HEIGHT = 0.45  # m, over which a shadow fades to a third
SHADOW_PIXELS = 300
SHADOW_BLURS = (0.8, 3.3)  # pixels
PALER = 0.22  # how much white is mixed into a body's colour
GRID_DARKNESS, SHADOW_DARKNESS = 0.13, 0.45

# the four corners of each face of a voxel, in half edges, seen from outside
FACE_AXES = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])


def add_person(plotter: pyvista.Plotter, mesh: Mesh, colour: str) -> None:
    """A captured body, smoothly shaded."""
    if not len(mesh.faces):
        return
    surface = pyvista.PolyData.from_regular_faces(mesh.vertices.astype(np.float32), mesh.faces)
    surface.point_data.active_normals = vertex_normals(mesh.vertices, mesh.faces)
    plotter.add_mesh(
        surface, color=lighter(colour, PALER), smooth_shading=True, split_sharp_edges=False,
        ambient=0.22, diffuse=0.85, specular=0.12, specular_power=12, render=False, reset_camera=False,
        show_scalar_bar=False,
    )  # fmt: skip


def add_prop(plotter: pyvista.Plotter, mesh: Mesh, name: str | None = None) -> None:
    """A thing of the set, its edges as they are; its actor gets a name where one is given."""
    surface = pyvista.PolyData.from_regular_faces(mesh.vertices.astype(np.float32), mesh.faces)
    plotter.add_mesh(
        surface, color=PROPS, ambient=0.25, diffuse=0.8, render=False, reset_camera=False, show_scalar_bar=False,
        name=name, pickable=False,
    )  # fmt: skip


def add_ghost(plotter: pyvista.Plotter, mesh: Mesh, colour: str) -> None:
    """A body that one can look through: only its far side is drawn, so that what is in it stays clear."""
    if not len(mesh.faces):
        return
    surface = pyvista.PolyData.from_regular_faces(mesh.vertices.astype(np.float32), mesh.faces)
    surface.point_data.active_normals = vertex_normals(mesh.vertices, mesh.faces)
    plotter.add_mesh(
        surface, color=colour, opacity=0.16, smooth_shading=True, split_sharp_edges=False, ambient=0.5, diffuse=0.6,
        culling="back", render=False, reset_camera=False, show_scalar_bar=False,
    )  # fmt: skip


def vertex_normals(vertices: FloatArray, faces: Int32Array) -> FloatArray:
    """(V, 3) float32, unit, weighted by area."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.stack(
        [np.bincount(faces.ravel(), np.repeat(across[:, axis], 3), len(vertices)) for axis in range(3)], 1
    )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(length > 0, length, 1.0), np.float32)


def add_voxels(plotter: pyvista.Plotter, volume: MotionHistoryVolume, colours: ByteArray, pose: FloatArray) -> None:
    """The outer faces of the voxels of a volume, each in the colour of its voxel.

    Args:
        plotter: to draw on.
        volume: in its canonical frame.
        colours: (X, Y, Z, 3).
        pose: (3,) where it is put, x, y m and yaw rad.
    """
    points, normals, shades = voxel_faces(volume, colours)
    if not len(points):
        return
    quads = np.arange(4 * len(points), dtype=np.int64).reshape(-1, 4)
    surface = pyvista.PolyData.from_regular_faces(apply_pose(pose, points.reshape(-1, 3)).astype(np.float32), quads)
    turned = normals.copy()
    turned[:, :2] = normals[:, :2] @ rotation(pose[2]).T
    surface.point_data.active_normals = np.repeat(turned, 4, axis=0).astype(np.float32)
    surface.cell_data["colour"] = shades
    plotter.add_mesh(
        surface, scalars="colour", rgb=True, smooth_shading=True, split_sharp_edges=False, ambient=0.35, diffuse=0.75,
        render=False, reset_camera=False, show_scalar_bar=False,
    )  # fmt: skip


def voxel_faces(volume: MotionHistoryVolume, colours: ByteArray) -> tuple[FloatArray, FloatArray, ByteArray]:
    """All faces between a filled voxel and an empty one.

    Normals are those of the solid blurred over a voxel, so that shading shows its shape and not its steps.

    Args:
        volume: of which all that is ever filled is shown.
        colours: (X, Y, Z, 3) of the voxels.

    Returns:
        (Q, 4, 3) corners m, (Q, 3) unit normals, (Q, 3) colours.
    """
    filled = np.pad(volume.filled, 1)
    blurred = gaussian_filter(filled.astype(np.float32), 1.2)
    slopes = np.stack([np.gradient(blurred, axis=axis) for axis in range(3)], -1)
    points, normals, shades = [], [], []
    for axis, one, two in FACE_AXES:
        for side in (-1, 1):
            where = np.argwhere(filled & ~np.roll(filled, -side, axis))
            corner = np.zeros((4, 3))
            corner[:, axis], corner[:, one], corner[:, two] = side, CORNERS[:, 0] * side, CORNERS[:, 1]
            places = where - 1 + np.array(volume.grid.start)
            points.append((places[:, None] + corner / 2) * volume.grid.pitch)
            outwards = -slopes[tuple(where.T)]
            outwards[:, axis] += 0.05 * side
            normals.append(outwards / np.linalg.norm(outwards, axis=1, keepdims=True))
            shades.append(colours[tuple((where - 1).T)])
    return np.concatenate(points), np.concatenate(normals), np.concatenate(shades)


def colours_by_time(volume: MotionHistoryVolume) -> ByteArray:
    """(X, Y, Z, 3) by the last frame in which each voxel is filled."""
    return time_colours(volume.t_end / max(1, volume.last))


def colours_by_label(volume: MotionHistoryVolume) -> ByteArray:
    """(X, Y, Z, 3) by surface label: start, end, lateral."""
    labels = surface_labels(volume)
    table = np.full((256, 3), 201, np.uint8)
    for label, colour in LABELS.items():
        table[label] = np.rint(255 * rgb(colour))
    return np.asarray(table[labels])


def add_floor(plotter: pyvista.Plotter, middle: FloatArray, bodies: list[FloatArray]) -> None:
    """A floor at z = 0 with a grid of half metres that fades away, and soft shadows under the bodies.

    Args:
        plotter: to draw on.
        middle: (2,) m, where the floor is seen best.
        bodies: points of each, (N, 3) m.
    """
    plane = pyvista.Plane(
        center=(middle[0], middle[1], -0.002), direction=(0, 0, 1), i_size=FLOOR_SIDE, j_size=FLOOR_SIDE
    )
    texture = pyvista.Texture(floor_picture(middle, bodies))
    texture.InterpolateOn()
    texture.MipmapOn()
    plotter.add_mesh(plane, texture=texture, lighting=False, render=False, reset_camera=False)


def floor_picture(middle: FloatArray, bodies: list[FloatArray]) -> ByteArray:
    """(P, P, 3) the floor from above, y up the picture, x to the right."""
    axis = ((np.arange(FLOOR_PIXELS) + 0.5) / FLOOR_PIXELS * FLOOR_SIDE - FLOOR_SIDE / 2).astype(np.float32)
    half_line = FLOOR_SIDE / FLOOR_PIXELS * 0.9
    on_line = [np.abs((axis + float(m) + GRID_STEP / 2) % GRID_STEP - GRID_STEP / 2) < half_line for m in middle]
    away = np.sqrt(axis[None, :] ** 2 + axis[:, None] ** 2)
    dark = np.clip((FADE[1] - away) / (FADE[1] - FADE[0]), 0.0, 1.0) * GRID_DARKNESS
    dark *= on_line[0][None, :] | on_line[1][:, None]
    shadow = Image.fromarray(_shadows(middle, bodies)).resize((FLOOR_PIXELS, FLOOR_PIXELS), Image.Resampling.BILINEAR)
    dark += SHADOW_DARKNESS * np.asarray(shadow)
    table = np.rint(np.arange(255, -1, -1)[:, None] * rgb(FLOOR)).astype(np.uint8)
    return np.asarray(table[np.minimum(255 * dark, 255).astype(np.uint8)[::-1]])


def _shadows(middle: FloatArray, bodies: list[FloatArray]) -> NDArray[np.float32]:
    """(P, P) 0 .. 1: strong where something is near the floor; coarse, since it is soft."""
    cover = np.zeros((SHADOW_PIXELS, SHADOW_PIXELS), np.float32)
    for points in bodies:
        cells = np.floor((points[:, :2] - middle + FLOOR_SIDE / 2) / FLOOR_SIDE * SHADOW_PIXELS).astype(np.int64)
        inside = np.all((cells >= 0) & (cells < SHADOW_PIXELS), axis=1)
        near = np.exp(-np.maximum(points[:, 2], 0.0) / SHADOW_HEIGHT).astype(np.float32)
        np.maximum.at(cover, (cells[inside, 1], cells[inside, 0]), near[inside])
    blurred = gaussian_filter(cover, SHADOW_BLURS[0]) + gaussian_filter(cover, SHADOW_BLURS[1])
    return np.asarray(np.minimum(blurred, np.float32(1.0)), np.float32)
