"""Which captures say what they look like, and how to ask one."""

from pathlib import Path
from typing import Final

import DracoPy
import numpy as np

from mhvedit.sequences.glb_looks import glb_looks
from mhvedit.sequences.looks import Float32Array, Looks, LooksReader, linear_from_srgb, read_looks
from mhvedit.sequences.meshes import MeshSequence
from mhvedit.sequences.obj_looks import obj_looks
from mhvedit.sequences.ply import ply_colours


def _ply_looks(data: bytes, path: Path) -> Looks | None:
    """Vertex colours of a PLY file."""
    colours, n_faces = ply_colours(data, path)
    if colours is None:
        return None
    return Looks((), np.full(n_faces, -1, np.int32), None, linear_from_srgb(colours))


def _draco_looks(data: bytes, path: Path) -> Looks | None:
    """Vertex colours and texture coordinates of a Draco mesh; it names no picture."""
    mesh = DracoPy.decode(data)
    faces = np.asarray(getattr(mesh, "faces", np.zeros(0)), np.int64).reshape(-1, 3)
    uv, colours = getattr(mesh, "tex_coord", None), getattr(mesh, "colors", None)
    corners: Float32Array | None = None
    if uv is not None and len(uv):
        corners = np.asarray(uv, np.float32).reshape(-1, 2)[faces]
    light = None
    if colours is not None and len(colours) and colours.dtype == np.uint8 and colours.shape[-1] >= 3:
        light = linear_from_srgb(colours[:, :3] / 255)
    if corners is None and light is None:
        return None
    return Looks((), np.full(len(faces), -1, np.int32), corners, light)


READERS: Final[dict[str, LooksReader]] = {
    ".obj": obj_looks,
    ".glb": glb_looks,
    ".ply": _ply_looks,
    ".drc": _draco_looks,
}


def frame_looks(sequence: MeshSequence, number: int) -> Looks | None:
    """What one frame of a capture looks like; None where its file does not say.

    Args:
        sequence: of `open_capture`; those of one file (.npz, USD) say nothing here.
        number: frame number.

    Raises:
        CaptureError: the file cannot be read.
    """
    if not sequence.per_frame:
        return None
    return read_looks(sequence.files[sequence.numbers.index(sequence.origin(number))], READERS)
