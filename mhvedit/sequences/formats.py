"""One mesh file, whatever its format: the table of readers, and the two formats that need only a few lines."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

import DracoPy
import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.sequences.glb import parse_glb
from mhvedit.sequences.obj import parse_obj
from mhvedit.sequences.ply import parse_ply
from mhvedit.sequences.raw import RawMesh, checked_mesh, same_places

_STL_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_NUMBER = rb"[-+]?(?:\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?|nan|inf)"
_STL_VERTEX = re.compile(rb"vertex\s+(" + _NUMBER + rb")\s+(" + _NUMBER + rb")\s+(" + _NUMBER + rb")", re.IGNORECASE)


def parse_stl(data: bytes, path: Path) -> RawMesh:
    """Read binary or text STL.

    STL has no connectivity: corners at exactly the same place become one vertex, in the order of first use.

    Args:
        data: the whole file.
        path: where it came from, for messages.

    Raises:
        CaptureError: the file is cut off, or its mesh cannot be used.
    """
    rows = int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0
    if len(data) >= 84 and len(data) == 84 + rows * _STL_ROW.itemsize:
        corners = np.frombuffer(data, _STL_ROW, rows, 84)["corners"].reshape(-1, 3)
    elif data.lstrip()[:5].lower() == b"solid":
        corners = np.array(_STL_VERTEX.findall(data)).astype(np.float64).reshape(-1, 3)
        ended = data[data.rstrip().rfind(b"\n") + 1 :].lstrip().lower().startswith(b"endsolid")
        if len(corners) != 3 * data.lower().count(b"endfacet") or not ended:
            raise CaptureError(path, "three vertices a facet, up to endsolid", f"{len(corners)} vertices, or no end")
    else:
        raise CaptureError(path, f"{84 + rows * _STL_ROW.itemsize} bytes for {rows} faces", f"{len(data)} bytes")
    corners = np.ascontiguousarray(corners)
    if not np.isfinite(corners).all():
        return checked_mesh(path, corners, np.zeros((0, 3), np.int64))
    first, place = same_places(corners)
    return checked_mesh(path, corners[first], place.reshape(-1, 3))


def parse_draco(data: bytes, path: Path) -> RawMesh:
    """Read a Draco mesh; vertices come in the order of the compressed file.

    Args:
        data: the whole file.
        path: where it came from, for messages.

    Raises:
        CaptureError: the mesh cannot be used.
    """
    mesh = DracoPy.decode(data)
    faces = np.asarray(getattr(mesh, "faces", np.zeros(0)), np.int64).reshape(-1, 3)
    return checked_mesh(path, np.asarray(mesh.points).reshape(-1, 3), faces)


PARSERS: Final[dict[str, Callable[[bytes, Path], RawMesh]]] = {
    ".obj": parse_obj,
    ".ply": parse_ply,
    ".stl": parse_stl,
    ".glb": parse_glb,
    ".drc": parse_draco,
}


def parse_mesh(data: bytes, path: Path) -> RawMesh:
    """Read one mesh file by its extension.

    Args:
        data: the whole file.
        path: its name says the format; also for messages.

    Raises:
        CaptureError: whatever is wrong with the file, in one sentence.
    """
    suffix = path.suffix.lower()
    if not data:
        raise CaptureError(path, f"a {suffix} mesh", "an empty file")
    try:
        return PARSERS[suffix](data, path)
    except CaptureError:
        raise
    except Exception as error:  # a parser may fail in any way on a damaged file
        found = " ".join(f"{type(error).__name__}: {error}".split())
        raise CaptureError(path, f"a readable {suffix} mesh", found) from error
