"""Small captures: tetrahedra and cubes in turn, so that counts change and sometimes do not."""

from pathlib import Path

import DracoPy
import numpy as np
from PIL import Image

from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.meshes import MeshSequence
from mhvedit.sequences.read import open_capture

NUMBERS = (3, 4, 6, 7, 8)
TRIANGLES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])


def shape(number: int) -> tuple[FloatArray, IntArray]:
    """A tetrahedron; with a loose fifth vertex in even frames, and its faces in another order in every frame."""
    points = np.array([(0, 0, 0), (0.4, 0, 0), (0, 0.3, 0), (0, 0, 1.7)]) + 0.01 * number / 3
    if number % 2 == 0:
        points = np.concatenate([points, [(0.1, 0.1, 0.1)]])
    return points, np.roll(TRIANGLES, number, 0)


def write_captures(folder: Path) -> None:
    """`obj` with two materials, a picture for each frame, and quads; `ply` with colours; `drc`; `plain` OBJ."""
    for kind in ("obj", "ply", "drc", "plain"):
        (folder / kind).mkdir()
    for number in NUMBERS:
        points, faces = shape(number)
        _write_textured(folder / "obj", number, points, faces)
        _write_coloured(folder / "ply" / f"p_{number}.ply", points, faces)
        packed = DracoPy.encode(points.astype(np.float32), faces.astype(np.uint32), preserve_order=True)
        (folder / "drc" / f"d_{number}.drc").write_bytes(packed)
        _write_plain(folder / "plain" / f"n_{number}.obj", points, faces)


def _write_textured(folder: Path, number: int, points: FloatArray, faces: IntArray) -> None:
    """Each face has texture coordinates of its own; the last two faces, those of the second material, have none."""
    shade = np.full((2, 2, 3), 10 * number, np.uint8)
    Image.fromarray(shade).save(folder / f"tex_{number}.png")
    (folder / f"m_{number}.mtl").write_text(
        f"newmtl skin\nKd 0.5 0.5 0.5\nKs 0.1 0.1 0.1\nmap_Kd tex_{number}.png\nnewmtl cloth\nKd 0.2 0.4 0.6\nd 0.5\n"
    )
    lines = [f"mtllib m_{number}.mtl", *(f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in points)]
    lines += [f"vt {i / 8} {i / 16}" for i in range(6)]
    for i, face in enumerate(faces.tolist()):
        lines += ["usemtl skin"] if i == 0 else ["usemtl cloth"] if i == 2 else []
        corners = [f"{c + 1}/{3 * i + j + 1}" if i < 2 else f"{c + 1}" for j, c in enumerate(face)]
        lines.append("f " + " ".join(corners))
    (folder / f"o_{number}.obj").write_text("\n".join(lines) + "\n")


def _write_coloured(file: Path, points: FloatArray, faces: IntArray) -> None:
    rows = [f"{x:.17g} {y:.17g} {z:.17g} {40 * i} 7 255 {i}" for i, (x, y, z) in enumerate(points)]
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"property uchar {name}" for name in ("red", "green", "blue")] + ["property int part"]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines = [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
    file.write_text("\n".join([*head, *rows, *lines]) + "\n")


def _write_plain(file: Path, points: FloatArray, faces: IntArray) -> None:
    lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in points] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    file.write_text("\n".join(lines) + "\n")


def opened(folder: Path, kind: str, *, units: str = "m", up: str = "z") -> tuple[MeshSequence, Path]:
    """A capture of `write_captures`."""
    return open_capture(folder / kind, name=kind, fps=30, units=units, up=up), folder / kind
