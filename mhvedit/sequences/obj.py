"""Wavefront OBJ: positions and polygons, read with array operations only; pictures and materials are only named."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray
from mhvedit.sequences.raw import RawMesh, checked_mesh, triangulate

_NEWLINE, _TAB, _SPACE, _SLASH = 10, 9, 32, 47
_BLANK = bytes.maketrans(b"vf\t\r\n", b"     ")


def parse_obj(data: bytes, path: Path) -> RawMesh:
    """Read `v` and `f` lines: vertices keep the order and number of the file, polygons become fans.

    Texture coordinates, normals, colours after the position, groups and materials are passed over. Negative
    indices count back from the line they stand in.

    Args:
        data: the whole file.
        path: where it came from, for messages.

    Raises:
        CaptureError: a line that is not as the format says, or a mesh that cannot be used.
    """
    text = np.frombuffer(_plain_lines(data), np.uint8)
    ends = np.flatnonzero(text == _NEWLINE)
    starts = np.r_[0, ends[:-1] + 1] if len(ends) else ends
    blank_next = np.isin(text[np.minimum(starts + 1, len(text) - 1)], (_SPACE, _TAB)) if len(ends) else starts > 0
    is_vertex = (text[starts] == ord("v")) & blank_next
    is_face = (text[starts] == ord("f")) & blank_next
    lengths = ends + 1 - starts
    vertices = _vertices(text[np.repeat(is_vertex, lengths)], lengths[is_vertex], path)
    corners, sizes = _corners(text[np.repeat(is_face, lengths)], lengths[is_face], path)
    seen = np.repeat(np.cumsum(is_vertex)[is_face], sizes)
    if (corners == 0).any():
        raise CaptureError(path, "face indices counted from 1", "index 0")
    return checked_mesh(path, vertices, triangulate(np.where(corners < 0, seen + corners, corners - 1), sizes))


def _plain_lines(data: bytes) -> bytes:
    """The same text with joined continuation lines, without comments and indentation, ending in a newline."""
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if b"\\\n" in data:
        data = data.replace(b"\\\n", b" ")
    if b"#" in data:
        data = re.sub(rb"#[^\n]*", b"", data)
    if b"\n " in data or b"\n\t" in data or data[:1] in (b" ", b"\t"):
        data = re.sub(rb"(?m)^[ \t]+", b"", data)
    return data if data.endswith(b"\n") else data + b"\n"


def _vertices(text: ByteArray, lengths: IntArray, path: Path) -> FloatArray:
    """(V, 3) positions from the `v` lines alone."""
    values, sizes = _numbers(text, lengths, np.dtype(np.float64), path)
    if len(sizes) and sizes.min() < 3:
        raise CaptureError(path, "three coordinates a vertex", f"{sizes.min()} at vertex {int(sizes.argmin()) + 1}")
    first = np.cumsum(sizes) - sizes
    return np.asarray(values[first[:, None] + np.arange(3)], np.float64)


def _corners(text: ByteArray, lengths: IntArray, path: Path) -> tuple[IntArray, IntArray]:
    """Vertex indices as written (from 1, or negative) and corners per polygon, from the `f` lines alone."""
    slash = text == _SLASH
    if slash.any():  # of `vertex/texture/normal` only what stands before the first slash
        place = np.arange(len(text), dtype=np.int32)
        last_blank = np.maximum.accumulate(np.where(text <= _SPACE, place, -1))
        last_slash = np.maximum.accumulate(np.where(slash, place, -1))
        keep = last_blank >= last_slash
        text, lengths = text[keep], _per_line(keep, lengths)
    values, sizes = _numbers(text, lengths, np.dtype(np.int64), path)
    if len(sizes) and sizes.min() < 3:
        raise CaptureError(path, "three corners a face", f"{sizes.min()} at face {int(sizes.argmin()) + 1}")
    return np.asarray(values, np.int64), sizes


def _numbers(
    text: ByteArray, lengths: IntArray, dtype: np.dtype[np.generic], path: Path
) -> tuple[NDArray[np.generic], IntArray]:
    """All numbers of some lines and how many each line has; the first character of a line is its keyword."""
    filled = text > _SPACE
    opens = filled.copy()
    opens[1:] &= ~filled[:-1]
    sizes = _per_line(opens, lengths) - 1
    plain = text.tobytes().translate(_BLANK)
    try:
        values = np.fromstring(plain.decode("ascii"), dtype, sep=" ")
    except (ValueError, DeprecationWarning):
        values = np.zeros(0, dtype)
    if len(values) != sizes.sum():
        raise CaptureError(path, "numbers after v and f", _first_bad(text, dtype))
    return values, sizes


def _per_line(marks: BoolArray, lengths: IntArray) -> IntArray:
    """How many characters of each line are marked."""
    if not len(lengths):
        return lengths
    return np.add.reduceat(marks, np.cumsum(lengths) - lengths, dtype=np.int64)


def _first_bad(text: ByteArray, dtype: np.dtype[np.generic]) -> str:
    """The first line with something that is not a number."""
    number = int if dtype.kind == "i" else float
    for line in text.tobytes().decode("ascii", "replace").splitlines():
        for word in line.split()[1:]:
            try:
                number(word)
            except ValueError:
                return repr(line.strip()[:80])
    return "text that cannot be read"


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
