"""A binary glTF file as it grows: values go to disk at once, only what points at them stays in memory."""

import json
import shutil
import struct
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from mhvedit.export.target import ExportError

Json = dict[str, Any]
LARGEST: Final = (1 << 32) - 1  # bytes that the header of a .glb can count
ROOM: Final = 1 << 10  # bytes of headers and padding
VERTICES, INDICES = 34962, 34963  # targets of buffer views
_COMPONENTS: Final = {np.dtype(np.uint8): 5121, np.dtype(np.uint16): 5123, np.dtype(np.uint32): 5125}
_TYPES: Final = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class GlbFile:
    """Buffer views and accessors of one .glb; `head` takes nodes, meshes, materials and the rest.

    To be used as a context, or else the file of values stays open when something goes wrong.
    """

    def __init__(self, binary: Path, name: str) -> None:
        self.head: Json = {"accessors": [], "bufferViews": [], "nodes": [], "meshes": [], "materials": []}
        self._path, self._name, self._size = binary, name, 0
        self._out: BinaryIO = binary.open("wb")

    def __enter__(self) -> "GlbFile":
        return self

    def __exit__(self, *fault: object) -> None:
        self._out.close()

    def add(self, kind: str, content: Json) -> int:
        """Append to a list of the head; returns the index."""
        entries = self.head.setdefault(kind, [])
        entries.append(content)
        return len(entries) - 1

    def add_bytes(self, data: bytes, target: int | None = None) -> int:
        """A buffer view of its own.

        Raises:
            ExportError: the file would become larger than a .glb can be.
        """
        view: Json = {"buffer": 0, "byteOffset": self._size, "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        padded = data + bytes(-len(data) % 4)
        self._size += len(padded)
        check_size(self._name, self._size)
        self._out.write(padded)
        return self.add("bufferViews", view)

    def add_values(self, values: NDArray[Any], *, target: int | None = None, limits: bool = False) -> int:
        """An accessor of (N,) or (N, 2..4) float32 or unsigned values, with their limits where glTF asks for them."""
        view = self.add_bytes(np.ascontiguousarray(values).tobytes(), target)
        return self.add("accessors", described(values, limits=limits) | {"bufferView": view})

    def finish(self, path: Path) -> None:
        """Put header, JSON and values together.

        Raises:
            ExportError: the file would become larger than a .glb can be.
        """
        self._out.close()
        head: Json = {key: value for key, value in self.head.items() if value}
        if self._size:
            head["buffers"] = [{"byteLength": self._size}]
        text = json.dumps(head, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + self._size
        check_size(self._name, total)
        with path.open("wb") as out:
            out.write(struct.pack("<4sII", b"glTF", 2, total))
            out.write(struct.pack("<I4s", len(text), b"JSON") + text)
            out.write(struct.pack("<I4s", self._size, b"BIN\0"))
            with self._path.open("rb") as binary:
                shutil.copyfileobj(binary, out, 1 << 20)
        self._path.unlink()


def described(values: NDArray[Any], *, limits: bool) -> Json:
    """What an accessor says about values."""
    width = values.shape[1] if values.ndim == 2 else 1
    accessor: Json = {
        "componentType": _COMPONENTS.get(values.dtype, 5126), "count": len(values), "type": _TYPES[width],
    }  # fmt: skip
    if limits:
        rows = values.reshape(len(values), width)
        accessor |= {"min": rows.min(0).tolist(), "max": rows.max(0).tolist()}
    return accessor


def check_size(name: str, size: float) -> None:
    """Refuse what a .glb cannot hold.

    Raises:
        ExportError: naming the size.
    """
    if size + ROOM > LARGEST:
        hint = "export USD or a folder, or try --draco"
        raise ExportError(name, f"at most 4 GiB in a .glb ({hint})", f"about {size / 2**30:.1f} GiB")
