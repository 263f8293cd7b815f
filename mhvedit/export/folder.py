"""Folders of numbered OBJ or PLY files: every frame of the scene, placed in the world."""

from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mhvedit.export.content import Exported, ExportScene, LooksOf, Piece, Tell
from mhvedit.export.far import is_far
from mhvedit.export.pictures import PictureFolder
from mhvedit.export.target import mark_folder, put_folder, staged
from mhvedit.geometry.arrays import Int32Array
from mhvedit.sequences.axes import from_metres_z_up
from mhvedit.sequences.looks import Float32Array, Looks, Material, srgb_from_linear

DIGITS: Final = 4  # at least, of frame numbers in file names
LOST: Final = "a .ply keeps no texture coordinates and pictures: use --format obj"


class MeshFormat(StrEnum):
    """What the files of a folder are."""

    OBJ = "obj"
    PLY = "ply"


def write_folder(scene: ExportScene, path: Path, *, files: MeshFormat, up: str, tell: Tell) -> Exported:
    """Write `PATH/anna/anna_0000.obj` and so on: a folder for each piece, a file for each frame of the scene.

    Metres; vertices are rounded to float32, unless the scene is far from the origin: then they stay float64. A frame
    that repeats is written again, so that no number is missing.

    Args:
        scene: what to write.
        path: of the folder; it is empty, not there, or of an earlier export, which is replaced.
        files: their format.
        up: z or y, the axis that points up in the files.
        tell: told how far it is.

    Raises:
        CaptureError: a frame cannot be read.
    """
    warnings = list[str]()
    kind = np.float64 if is_far(scene) else np.float32
    with staged(path) as beside:
        made = beside / "made"
        for done, piece in enumerate(scene.pieces):
            looks = LooksOf(piece)
            lost = _write_piece(scene, piece, looks, made / piece.name, files, up=up, kind=kind, tell=tell)
            warnings += [*looks.warnings, *([f"{piece.name}: {LOST}"] if lost else [])]
            tell("meshes", (done + 1) / len(scene.pieces))
        facts = {"name": scene.edit.name, "fps": scene.edit.fps, "frames": scene.edit.n_frames, "units": "m", "up": up}
        mark_folder(made, facts)
        put_folder(made, path)
    return Exported(path, warnings=tuple(warnings))


def _write_piece(
    scene: ExportScene,
    piece: Piece,
    looks: LooksOf,
    folder: Path,
    files: MeshFormat,
    *,
    up: str,
    kind: type[np.floating],
    tell: Tell,
) -> bool:
    """All frames of one piece; whether any has a texture that the format cannot keep."""
    folder.mkdir(parents=True)
    library, lost = MaterialLibrary(folder, f"{piece.name}.mtl"), False
    digits = max(DIGITS, len(str(scene.edit.n_frames - 1)))
    for k, number in enumerate(scene.source(piece).tolist()):
        mesh = piece.sequence.mesh(number)
        seen = looks.at(number, mesh)
        world = from_metres_z_up(scene.placed(piece, mesh, k), units="m", up=up).astype(kind)
        file = folder / f"{piece.name}_{k:0{digits}d}.{files}"
        if files is MeshFormat.OBJ:
            file.write_bytes(obj_bytes(world, mesh.faces, seen, library))
        else:
            file.write_bytes(ply_bytes(world, mesh.faces, mesh.labels, seen))
            lost = lost or (seen is not None and _is_textured(seen))
        tell(f"meshes of {piece.name}", (k + 1) / scene.edit.n_frames)
    library.close()
    return lost


def _is_textured(looks: Looks) -> bool:
    return looks.uv is not None or any(material.picture is not None or material.maps for material in looks.materials)


class MaterialLibrary:
    """The .mtl file of a folder, and the pictures that it names."""

    def __init__(self, folder: Path, name: str) -> None:
        self.name = name
        self._folder, self._pictures = folder, PictureFolder(folder)
        self._names, self._text = dict[tuple[object, ...], str](), list[str]()

    def named(self, material: Material) -> str:
        """The name under which a material is in the library; materials of one name may differ between frames."""
        files = [self._pictures.put(picture) for _, picture in material.maps]
        own = None if material.picture is None else self._pictures.put(material.picture)
        content = (material.name, material.colour, own, material.statements, *files)
        if content not in self._names:
            taken, name, count = set(self._names.values()), material.name or "material", 2
            while name in taken:
                name, count = f"{material.name}_{count}", count + 1
            self._names[content] = name
            red, green, blue, opacity = material.colour
            lines = [f"newmtl {name}", f"Kd {red:g} {green:g} {blue:g}", f"d {opacity:g}", *material.statements]
            lines += [] if own is None else [f"map_Kd {own}"]
            lines += [f"{before} {file}" for (before, _), file in zip(material.maps, files, strict=True)]
            self._text.append("\n".join(lines) + "\n")
        return self._names[content]

    def close(self) -> None:
        """Write the file, if there is anything to write."""
        if self._text:
            (self._folder / self.name).write_text("\n".join(self._text))


def obj_bytes(points: NDArray[np.floating], faces: Int32Array, looks: Looks | None, library: MaterialLibrary) -> bytes:
    """An OBJ file; each number is the shortest that reads back as the same.

    Args:
        points: (V, 3) float32 or float64.
        faces: (F, 3).
        looks: of the frame, if known.
        library: takes its materials.
    """
    rows = points.astype("U").tolist() if looks is None or looks.colours is None else _coloured(points, looks.colours)
    lines = [f"v {' '.join(row)}" for row in rows]
    corners = (faces + 1).astype("U")
    if looks is not None and looks.uv is not None:
        table, place = np.unique(looks.uv.reshape(-1, 2), axis=0, return_inverse=True)
        lines += [f"vt {u} {v}" for u, v in table.astype("U").tolist()]
        corners = np.strings.add(np.strings.add(corners, "/"), (place.reshape(-1, 3) + 1).astype("U"))
    written = [f"f {a} {b} {c}" for a, b, c in corners.tolist()]
    if looks is None or not looks.materials:
        return ("\n".join([*lines, *written]) + "\n").encode()
    lines.insert(0, f"mtllib {library.name}")
    for start, stop in _stretches(looks.material):
        index = int(looks.material[start])
        lines += [f"usemtl {library.named(looks.materials[index])}"] if index >= 0 else []
        lines += written[start:stop]
    return ("\n".join(lines) + "\n").encode()


def _coloured(points: NDArray[np.floating], colours: Float32Array) -> list[list[str]]:
    """Positions with colours behind them."""
    columns = [points.astype("U"), srgb_from_linear(colours).astype("U")]
    rows: list[list[str]] = np.concatenate(columns, 1).tolist()
    return rows


def _stretches(material: Int32Array) -> list[tuple[int, int]]:
    """Runs of faces of one material."""
    ends = [0, *(np.flatnonzero(np.diff(material)) + 1).tolist(), len(material)]
    return list(pairwise(ends))


def ply_bytes(points: NDArray[np.floating], faces: Int32Array, labels: Int32Array | None, looks: Looks | None) -> bytes:
    """A binary PLY file, with labels and vertex colours where there are any.

    Args:
        points: (V, 3) float32 or float64.
        faces: (F, 3).
        labels: (V,) or None.
        looks: of the frame, if known.
    """
    fields: list[tuple[str, str]] = [(axis, f"<f{points.itemsize}") for axis in "xyz"]
    colours = None if looks is None else looks.colours
    fields += [(name, "u1") for name in ("red", "green", "blue")] if colours is not None else []
    fields += [("part", "<i4")] if labels is not None else []
    vertices = np.zeros(len(points), fields)
    for i, axis in enumerate("xyz"):
        vertices[axis] = points[:, i]
    if colours is not None:
        values = np.rint(srgb_from_linear(colours) * 255).astype(np.uint8)
        for i, name in enumerate(("red", "green", "blue")):
            vertices[name] = values[:, i]
    if labels is not None:
        vertices["part"] = labels
    triangles = np.zeros(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    triangles["count"], triangles["corners"] = 3, faces
    kinds = {"<f4": "float", "<f8": "double", "u1": "uchar", "<i4": "int"}
    properties = "".join(f"property {kinds[kind]} {name}\n" for name, kind in fields)
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{properties}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return head.encode() + vertices.tobytes() + triangles.tobytes()
