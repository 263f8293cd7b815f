"""Wavefront OBJ: positions and polygons; pictures and materials are only named."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.obj_scan import BAD_CORNER, FEW_COORDINATES, FEW_CORNERS, SOUND, UNUSED, Scan, scan_obj
from mhvedit.sequences.raw import RawMesh, checked_mesh

ROOM = 64  # odd numbers that a file may hold before it is read twice
SHOWN = 80  # characters of a bad line in a message


def parse_obj(data: bytes, path: Path) -> RawMesh:
    """Read `v` and `f` lines: vertices keep the order and number of the file, polygons become fans.

    Numbers are those of Python's `float`, to the last bit. Texture coordinates, normals, colours after the position,
    groups and materials are passed over. Negative indices count back from the line they stand in.

    Args:
        data: the whole file.
        path: where it came from, for messages.

    Raises:
        CaptureError: a line that is not as the format says, or a mesh that cannot be used.
    """
    text = np.frombuffer(data + b"\n\n", np.uint8)
    # for the shortest lines, "v 0 0 0" and "f 1 1 1"; what is not written to takes no memory
    vertices, triangles = np.empty((len(text) // 7, 3)), np.empty((len(text) // 2, 3), np.int64)
    odd = np.empty((ROOM, 4), np.int64)
    scan = scan_obj(text, vertices, triangles, odd)
    if scan.n_odd > ROOM:
        odd = np.empty((scan.n_odd, 4), np.int64)
        scan = scan_obj(text, vertices, triangles, odd)
    _read_odd(data, odd[: scan.n_odd], vertices.reshape(-1), path)
    _check_lines(data, scan, path)
    return checked_mesh(path, vertices[: scan.n_vertices].copy(), triangles[: scan.n_triangles])


def _read_odd(data: bytes, odd: IntArray, values: FloatArray, path: Path) -> None:
    """Read the numbers that the scan left out: very long or very small ones, nan, inf, and what is no number."""
    for place, start, stop, line in odd.tolist():
        word = data[start:stop]
        try:
            value = float(word.replace(b"_", b"?"))  # Python's digits may be grouped, those of a file may not
        except ValueError:
            raise CaptureError(path, "numbers after v and f", _shown(data, line)) from None
        if place != UNUSED:
            values[place] = value


def _check_lines(data: bytes, scan: Scan, path: Path) -> None:
    """Say what the scan stopped at, if it did.

    Raises:
        CaptureError: the line, what it should hold and what it does.
    """
    if scan.fault == SOUND:
        return
    if scan.fault == FEW_COORDINATES:
        raise CaptureError(path, "three coordinates a vertex", f"{scan.n_words} at vertex {scan.n_vertices}")
    if scan.fault == FEW_CORNERS:
        raise CaptureError(path, "three corners a face", f"{scan.n_words} at face {scan.n_faces}")
    if scan.fault == BAD_CORNER:
        raise CaptureError(path, "numbers after v and f", _shown(data, scan.line))
    raise CaptureError(path, "face indices counted from 1", f"index 0 at face {scan.n_faces}")


def _shown(data: bytes, line: int) -> str:
    """A line as a person reads it, without what is joined to it."""
    return repr(re.split(rb"[\r\n#]", data[line : line + SHOWN], maxsplit=1)[0].decode("ascii", "replace").strip())


@dataclass(frozen=True, slots=True)
class ObjMaterials:
    """What an OBJ file says about its looks, for an exporter; nothing of it is loaded."""

    libraries: tuple[Path, ...]  # .mtl files that exist
    pictures: tuple[Path, ...]  # files that they name as maps and that exist
    missing: tuple[Path, ...]  # named, but not there


def obj_materials(path: Path) -> ObjMaterials:
    """Follow `mtllib` of an OBJ file, and `map_*` of those, to the files that an export has to take along."""
    libraries, pictures, missing = list[Path](), list[Path](), list[Path]()
    for library in _named_files(path, b"mtllib"):
        (libraries if library.is_file() else missing).append(library)
    for library in libraries:
        for picture in _named_files(library, b"map_"):
            (pictures if picture.is_file() else missing).append(picture)
    return ObjMaterials(*(tuple(dict.fromkeys(files)) for files in (libraries, pictures, missing)))


def _named_files(path: Path, keyword: bytes) -> list[Path]:
    """Files that the lines starting with a keyword name: all of the rest, or else its last word (options before it)."""
    found = []
    for line in path.read_bytes().splitlines() if keyword == b"map_" else _head_lines(path):
        words = line.strip().split(None, 1)
        if len(words) == 2 and words[0].startswith(keyword):
            whole = path.parent / words[1].decode("utf-8", "replace").strip().replace("\\", "/")
            last = path.parent / words[1].split()[-1].decode("utf-8", "replace").replace("\\", "/")
            found.append(whole if whole.is_file() else last)
    return found


def _head_lines(path: Path) -> list[bytes]:
    """The `mtllib` lines of an OBJ file, without splitting all of it."""
    data, found, at = path.read_bytes(), [], 0
    while (at := data.find(b"mtllib", at)) >= 0:
        end = data.find(b"\n", at)
        line = data[at : end if end >= 0 else len(data)]
        if at == 0 or data[at - 1 : at] in (b"\n", b"\r"):
            found.append(line)
        at += len(line)
    return found
