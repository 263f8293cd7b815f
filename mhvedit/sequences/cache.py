"""Converted copies of frames on disk, so that a second run does not parse text again."""

import hashlib
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.files import UNREADABLE, read_arrays, replacing, write_arrays
from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.raw import RawMesh

VERSION: Final = 1  # of the file format and of what the parsers make of a file; part of every key
PLACE: Final = ".place"  # ending of a file that says where a frame is
PLACE_BYTES: Final = 64
DIGEST: Final = 16  # bytes of the sum at the end of such a file
_log = logging.getLogger(__name__)


def cached_mesh(folder: Path, key: str, build: Callable[[], RawMesh]) -> RawMesh:
    """The mesh of a key: from its file in the folder or, where there is none or it is damaged, built and stored.

    The file holds vertices in the type in which they were read, so what comes back is the same to the last bit.
    Two processes may do this at once: files are written beside and renamed. A folder that cannot be written to
    (full, read-only) only costs time and is logged.

    Args:
        folder: made when needed.
        key: name of the file; whatever changes the mesh must change the key.
        build: reads the mesh from the capture; its errors pass through.
    """
    file = folder / f"{key}.npz"
    try:
        return _read(file)
    except FileNotFoundError:
        pass
    except UNREADABLE as error:
        _log.warning("%s: damaged cache file is rebuilt (%s: %s)", file, type(error).__name__, error)
    mesh = build()
    try:
        _write(file, mesh)
    except OSError as error:
        _log.warning("%s: cache file cannot be written, going on without it (%s)", file, error)
    return mesh


def cached_place(folder: Path, key: str, build: Callable[[], FloatArray]) -> FloatArray:
    """Where a frame is (`areas.place_of`): from its file in the folder, or measured and stored, as `cached_mesh` does.

    Args:
        folder: made when needed.
        key: name of the file; whatever changes the place must change the key.
        build: measures it; its errors pass through.

    Returns:
        (8,) m.
    """
    file = folder / f"{key}{PLACE}"
    try:
        data = file.read_bytes()
    except OSError:
        data = b""
    numbers, digest = data[:-DIGEST], data[-DIGEST:]
    if len(numbers) == PLACE_BYTES and digest == _digest(numbers):
        return np.frombuffer(numbers, "<f8").astype(np.float64)
    place = build()
    numbers = place.astype("<f8").tobytes()
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with replacing(file) as beside:
            beside.write_bytes(numbers + _digest(numbers))
    except OSError as error:
        _log.warning("%s: cache file cannot be written, going on without it (%s)", file, error)
    return place


def _digest(data: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=DIGEST).digest()


def _read(file: Path) -> RawMesh:
    """The stored mesh; the sum of every array is checked."""
    stored = read_arrays(file)
    labels = stored["labels"]  # always there, so that a damaged name cannot pass for a mesh without labels
    return RawMesh(stored["vertices"], stored["faces"], labels if len(labels) else None)


def _write(file: Path, mesh: RawMesh) -> None:
    """Store a mesh: all of it or nothing."""
    file.parent.mkdir(parents=True, exist_ok=True)
    labels = np.zeros(0, np.int32) if mesh.labels is None else mesh.labels
    write_arrays(file, {"vertices": mesh.vertices, "faces": mesh.faces, "labels": labels})
