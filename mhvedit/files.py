"""Files that are there whole or not at all: written beside, then renamed."""

import io
import math
import os
import re
import struct
import threading
import tokenize
import tomllib
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import IO, Any, BinaryIO, Final, Literal

import numpy as np
from numpy.typing import DTypeLike, NDArray

LEVEL: Final = 3  # of compression; with higher ones writing takes longer than it saves
WORTHWHILE: Final = 4096  # bytes; smaller arrays are neither compressed nor mapped
LOCAL_HEADER: Final = 30  # bytes before a zip member's name; the last four tell the length of name and extra field
FIELD: Final = struct.Struct("<HH")
PADDING: Final = 0xD935  # kind of an extra field that says nothing
ALIGNED: Final = 64  # bytes
HEADER: Final = 1024  # bytes that the header of an array takes at most
# The header of an array but of records; to let NumPy read it takes longer than to read what follows.
USUAL: Final = re.compile(
    rb"\x93NUMPY\x01\0..{'descr': '(?P<kind>[^']+)', 'fortran_order': (?P<by_columns>True|False), "
    rb"'shape': \((?P<shape>[^)]*)\), } *\n",
    re.DOTALL,
)
PIECE: Final = 1 << 16  # numbers of a column that are made at a time
# NumPy reads the header of an array with `ast`, which fails now and then in CPython 3.11 where two threads do so at the
# same time (python/cpython#106905): so one does at a time.
ONE_HEADER: Final = threading.Lock()
# What reading an .npz raises that is missing, damaged or something else: each part of it is told by another library.
UNREADABLE: Final = (
    OSError, ValueError, KeyError, TypeError, EOFError, RuntimeError,
    zipfile.BadZipFile, zlib.error, SyntaxError, tokenize.TokenError,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Column:
    """Rows that are made while they are written, without ever being all in memory."""

    shape: tuple[int, ...]
    fill: Callable[[int, NDArray[Any]], None]  # from that row on
    dtype: DTypeLike = np.float64


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file beside another one, which it replaces when the block ends well; otherwise it is gone without a trace.

    Args:
        path: of the file that is to be there in the end.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}.part")
    try:
        yield beside
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def load_table(package: str, name: str) -> dict[str, Any]:
    """A TOML table that comes with a package.

    Args:
        package: as it is imported.
        name: of the file in its folder `data`, without ending.
    """
    return tomllib.loads((files(package) / "data" / f"{name}.toml").read_text("utf-8"))


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any] | Column]) -> None:
    """Write an .npz, the same bytes for the same arrays. Bytes and flags are compressed, numbers hardly would be.

    Args:
        path: of the file; replaced as a whole or not at all.
        arrays: by name.
    """
    with (
        replacing(path) as beside,
        zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED, compresslevel=LEVEL) as container,
    ):
        for name, array in arrays.items():
            header = _npy_header(np.dtype(array.dtype), array.shape)
            with _member(container, f"{name}.npy", array, len(header)) as file:
                file.write(header)
                for piece in _pieces(array):
                    file.write(piece.reshape(-1).view(np.uint8).data)


def load_npz(path: Path, *names: str, starting: str = "") -> dict[str, NDArray[Any]]:
    """Arrays of any .npz, whoever wrote it.

    Args:
        path: of the file.
        names: of the arrays; all if none is named.
        starting: what the names of all of them start with, where none is named.

    Raises:
        one of UNREADABLE: the file is missing, damaged or no .npz; a KeyError too where there is no such array.
    """
    with ONE_HEADER, path.open("rb") as file:
        stored = np.load(file, allow_pickle=False)
        if not isinstance(stored, np.lib.npyio.NpzFile):
            raise ValueError("one array, and not an .npz")
        with stored:
            return {name: stored[name] for name in names or stored.files if name.startswith(starting)}


def found_instead(fault: Exception) -> str:
    """What was found in place of an .npz that could not be read, in words: of an exception among UNREADABLE."""
    return getattr(fault, "strerror", None) or "a file that is damaged, or no .npz"


def map_arrays(path: Path, names: Collection[str]) -> dict[str, NDArray[Any]]:
    """Some arrays of a file that `write_arrays` wrote; those that are not compressed are read where they are looked at.

    Args:
        path: of the file.
        names: of the arrays.

    Raises:
        one of UNREADABLE: the file is missing or damaged; a KeyError too where there is no such array.
    """
    arrays: dict[str, NDArray[Any]] = {}
    with ONE_HEADER, path.open("rb") as file, zipfile.ZipFile(file) as container:
        for name in names:
            member = container.getinfo(f"{name}.npy")
            if member.compress_type != zipfile.ZIP_STORED or member.file_size < WORTHWHILE:
                with container.open(member) as content:
                    arrays[name] = np.lib.format.read_array(content, allow_pickle=False)
            else:
                arrays[name] = _mapped(file, member.header_offset)
    return arrays


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """All arrays of a file that `write_arrays` wrote, their sums checked; views of one buffer where they lie aligned.

    Args:
        path: of the file.

    Raises:
        one of UNREADABLE: the file is missing or damaged.
    """
    with path.open("rb", buffering=0) as file:
        data = np.empty(os.fstat(file.fileno()).st_size, np.uint8)
        if file.readinto(data.data) != len(data):
            raise EOFError(f"{path}: it changed while it was read")
        with zipfile.ZipFile(file) as container:
            members = container.infolist()
            return {member.filename.removesuffix(".npy"): _read(container, member, data) for member in members}


def _read(container: zipfile.ZipFile, member: zipfile.ZipInfo, data: NDArray[np.uint8]) -> NDArray[Any]:
    """One array of a file that is in memory."""
    if member.compress_type != zipfile.ZIP_STORED:
        with ONE_HEADER, container.open(member) as content:
            return np.asarray(np.lib.format.read_array(content, allow_pickle=False))
    name = member.header_offset + LOCAL_HEADER
    start = name + _lengths(data[name - FIELD.size : name].tobytes())
    stored = data[start : start + member.file_size]
    if zlib.crc32(stored.data) != member.CRC:
        raise zipfile.BadZipFile(f"bad CRC-32 for {member.filename}")
    header = USUAL.match(stored[:HEADER].tobytes())
    if header is None:
        with ONE_HEADER:
            return np.asarray(np.lib.format.read_array(io.BytesIO(stored.tobytes()), allow_pickle=False))
    shape = [int(n) for n in header["shape"].split(b",") if n.strip()]
    array = stored[header.end() :].view(np.dtype(header["kind"].decode()))
    array = array.reshape(shape, order="F" if header["by_columns"] == b"True" else "C")
    return np.asarray(array if array.flags.aligned else array.copy())


def _lengths(read: bytes) -> int:
    """How long name and extra field of a zip member are together, as the end of its local header says."""
    if len(read) != FIELD.size:
        raise zipfile.BadZipFile("a member begins past the end of the file")
    return sum(FIELD.unpack(read))


def _member(container: zipfile.ZipFile, name: str, array: NDArray[Any] | Column, header: int) -> IO[bytes]:
    """Begin to write an array with a header of so many bytes: compressed, or where it can be mapped later."""
    count, itemsize = math.prod(array.shape), np.dtype(array.dtype).itemsize
    if itemsize == 1 and count >= WORTHWHILE:
        return container.open(name, "w", force_zip64=count >= zipfile.ZIP64_LIMIT)
    member = zipfile.ZipInfo(name)
    member.extra = _padding(container.start_dir + LOCAL_HEADER + len(name.encode()))
    member.file_size = header + count * itemsize  # decides whether the sizes take 64 bits
    return container.open(member, "w")


def _pieces(array: NDArray[Any] | Column) -> Iterator[NDArray[Any]]:
    """An array in pieces that lie in memory as they are written; of a column, one where the last one was."""
    if not isinstance(array, Column) and array.flags.c_contiguous:
        yield array
        return
    count, n = array.shape[0], max(1, PIECE // max(1, math.prod(array.shape[1:])))
    piece = np.empty((min(count, n), *array.shape[1:]), array.dtype)
    for first in range(0, count, n):
        rows = piece[: count - first]
        if isinstance(array, Column):
            array.fill(first, rows)
        else:
            rows[:] = array[first : first + n]
        yield rows


def _npy_header(kind: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    """What comes before the numbers, which follow row by row."""
    header = io.BytesIO()
    content = {"descr": np.lib.format.dtype_to_descr(kind), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(header, content)
    return header.getvalue()


def _padding(start: int) -> bytes:
    """An extra field for a zip member after which its array starts at a multiple of `ALIGNED`."""
    size = FIELD.size + (-start - FIELD.size) % ALIGNED
    return FIELD.pack(PADDING, size - FIELD.size).ljust(size, b"\0")


def _mapped(file: BinaryIO, header: int) -> NDArray[Any]:
    """The array of a member whose local header is at a place of a file."""
    file.seek(header + LOCAL_HEADER - FIELD.size)
    file.seek(_lengths(file.read(FIELD.size)), os.SEEK_CUR)  # past its name and extra field
    np.lib.format.read_magic(file)
    shape, by_columns, kind = np.lib.format.read_array_header_1_0(file)
    order: Literal["F", "C"] = "F" if by_columns else "C"
    return np.asarray(np.memmap(file, kind, "r", file.tell(), shape, order))
