"""PLY, text and binary, with any elements; the integer vertex property `part` becomes labels."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mhvedit.errors import CaptureError
from mhvedit.sequences.raw import RawMesh, checked_mesh, triangulate

_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"},
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True, slots=True)
class _Property:
    name: str
    kind: str  # numpy type code
    count: str | None  # numpy type code of the length, for lists


@dataclass(frozen=True, slots=True)
class _Element:
    name: str
    rows: int
    properties: tuple[_Property, ...]


Columns = dict[str, NDArray[np.generic]]
Lists = dict[str, tuple[NDArray[np.generic], NDArray[np.int64]]]  # values of all rows, length of each row


def parse_ply(data: bytes, path: Path) -> RawMesh:
    """Read vertices, polygons (as fans) and, where the vertices have an integer property `part`, labels.

    Args:
        data: the whole file.
        path: where it came from, for messages.

    Raises:
        CaptureError: a header or body that is not as the format says, or a mesh that cannot be used.
    """
    order, elements, body = _header(data, path)
    columns, lists = _text_body(body, elements, path) if not order else _binary_body(body, elements, order, path)
    missing = [axis for axis in "xyz" if f"vertex.{axis}" not in columns]
    if missing:
        raise CaptureError(path, "vertex properties x, y, z", f"none called {missing[0]}")
    vertices = np.stack([columns[f"vertex.{axis}"] for axis in "xyz"], 1)
    empty = np.zeros(0, np.int64)
    corners, sizes = next((lists[f"face.{name}"] for name in _CORNERS if f"face.{name}" in lists), (empty, empty))
    if len(sizes) and sizes.min() < 3:
        raise CaptureError(path, "three corners a face", f"{sizes.min()} at face {int(sizes.argmin())}")
    part = columns.get("vertex.part")
    labels = part.astype(np.int64) if part is not None and part.dtype.kind in "iu" else None
    return checked_mesh(path, vertices, triangulate(corners.astype(np.int64), sizes), labels)


def _header(data: bytes, path: Path) -> tuple[str, list[_Element], bytes]:
    """Byte order ("" for text), elements, and what follows the header."""
    at = data.find(b"end_header")
    stop = data.find(b"\n", at)
    if not data.startswith(b"ply") or at < 0 or stop < 0:
        raise CaptureError(path, "a PLY header from ply to end_header", repr(data[:20]))
    order, elements = "?", list[_Element]()
    for line in data[:at].decode("ascii", "replace").splitlines()[1:]:
        match line.split():
            case ["format", kind, _] if kind in _ORDERS:
                order = _ORDERS[kind]
            case ["element", name, rows]:
                elements.append(_Element(name, int(rows), ()))
            case ["property", "list", count, kind, name] if elements:
                elements[-1] = _with(elements[-1], _Property(name, _TYPES[kind], _TYPES[count]))
            case ["property", kind, name] if elements:
                elements[-1] = _with(elements[-1], _Property(name, _TYPES[kind], None))
            case [("comment" | "obj_info"), *_] | []:
                pass
            case _:
                raise CaptureError(path, "a PLY header", repr(line))
    if order == "?":
        raise CaptureError(path, "a format line of " + ", ".join(_ORDERS), "none")
    return order, elements, data[stop + 1 :]


def _with(element: _Element, added: _Property) -> _Element:
    """The element with one more property."""
    return _Element(element.name, element.rows, (*element.properties, added))


def _row_type(element: _Element, order: str, lengths: list[int]) -> np.dtype[np.void]:
    """The type of a row whose lists have these lengths."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    left = iter(lengths)
    for p in element.properties:
        if p.count is None:
            fields.append((p.name, order + p.kind))
        else:
            fields += [(f"{p.name} length", order + p.count), (p.name, order + p.kind, (next(left),))]
    return np.dtype(fields)


def _binary_body(body: bytes, elements: list[_Element], order: str, path: Path) -> tuple[Columns, Lists]:
    """Columns and lists by `element.property`."""
    columns, lists, at = Columns(), Lists(), 0
    for element in elements:
        row = _row_type(element, order, _first_lengths(body, at, element, order))
        if at + element.rows * row.itemsize <= len(body):
            rows = np.frombuffer(body, row, element.rows, at)
            if all((rows[f"{p.name} length"] == rows[p.name].shape[1]).all() for p in element.properties if p.count):
                at += rows.nbytes
                _take_rows(element, rows, columns, lists)
                continue
        if not any(p.count for p in element.properties):
            raise CaptureError(path, f"{element.rows} rows of {element.name}", "the end of the file")
        at = _uneven_rows(body, at, element, order, lists, path)
    return columns, lists


def _first_lengths(body: bytes, at: int, element: _Element, order: str) -> list[int]:
    """Lengths of the lists in the first row."""
    lengths = list[int]()
    for p in element.properties if element.rows else ():
        if p.count is not None:
            lengths.append(int(np.frombuffer(body, order + p.count, 1, at)[0]))
            at += np.dtype(p.count).itemsize + lengths[-1] * np.dtype(p.kind).itemsize
        else:
            at += np.dtype(p.kind).itemsize
    return lengths or [0] * len(element.properties)


def _take_rows(element: _Element, rows: NDArray[np.void], columns: Columns, lists: Lists) -> None:
    """Sort the fields of rows of one type into columns and lists."""
    for p in element.properties:
        values = rows[p.name].astype(p.kind)
        if p.count is None:
            columns[f"{element.name}.{p.name}"] = values
        else:
            lists[f"{element.name}.{p.name}"] = values.reshape(-1), np.full(len(rows), values.shape[1])


def _uneven_rows(body: bytes, at: int, element: _Element, order: str, lists: Lists, path: Path) -> int:
    """Read rows whose lists differ in length, one by one; single values beside the lists are passed over."""
    parts: dict[str, list[NDArray[np.generic]]] = {p.name: [] for p in element.properties if p.count}
    kinds = [(p.name, np.dtype(order + p.kind), p.count and np.dtype(order + p.count)) for p in element.properties]
    for i in range(element.rows):
        for name, kind, count in kinds:
            if not count:
                at += kind.itemsize
                continue
            if at + count.itemsize > len(body):
                raise CaptureError(path, f"{element.rows} rows of {element.name}", f"the end of the file in row {i}")
            n = int(np.frombuffer(body, count, 1, at)[0])
            at += count.itemsize
            if at + n * kind.itemsize > len(body):
                raise CaptureError(path, f"{element.rows} rows of {element.name}", f"the end of the file in row {i}")
            parts[name].append(np.frombuffer(body, kind, n, at))
            at += n * kind.itemsize
    for name, rows in parts.items():
        lists[f"{element.name}.{name}"] = np.concatenate(rows), np.array([len(r) for r in rows])
    return at


def _text_body(body: bytes, elements: list[_Element], path: Path) -> tuple[Columns, Lists]:
    """Columns and lists by `element.property`; values are rounded to the type that the header says."""
    columns, lists = Columns(), Lists()
    lines = iter([line for line in body.decode("ascii", "replace").splitlines() if line.strip()])
    for element in elements:
        rows = [line for _, line in zip(range(element.rows), lines, strict=False)]
        if len(rows) < element.rows:
            raise CaptureError(path, f"{element.rows} rows of {element.name}", f"{len(rows)}")
        if any(p.count for p in element.properties):
            _text_lists(element, rows, lists, path)
            continue
        try:
            table = np.array(" ".join(rows).split(), np.float64).reshape(element.rows, len(element.properties))
        except ValueError as error:
            raise CaptureError(path, f"{len(element.properties)} numbers a {element.name}", str(error)) from None
        for column, p in zip(table.T, element.properties, strict=True):
            columns[f"{element.name}.{p.name}"] = column.astype(p.kind)
    return columns, lists


def _text_lists(element: _Element, rows: list[str], lists: Lists, path: Path) -> None:
    """Lists of text rows."""
    parts: dict[str, list[list[float]]] = {p.name: [] for p in element.properties if p.count}
    for i, line in enumerate(rows):
        words, at = line.split(), 0
        try:
            for p in element.properties:
                n = int(words[at]) if p.count else 1
                values = [float(w) for w in words[at + bool(p.count) : at + bool(p.count) + n]]
                if len(values) < n:
                    raise ValueError
                at += n + bool(p.count)
                if p.count:
                    parts[p.name].append(values)
        except (ValueError, IndexError):
            raise CaptureError(path, f"a row of {element.name}", f"{line.strip()[:60]!r} in row {i}") from None
    kinds = {p.name: p.kind for p in element.properties}
    for name, found in parts.items():
        flat = np.array([x for values in found for x in values], np.float64).astype(kinds[name])
        lists[f"{element.name}.{name}"] = flat, np.array([len(values) for values in found], np.int64)


def ply_colours(data: bytes, path: Path) -> tuple[NDArray[np.float64] | None, int]:
    """(V, 3) red, green, blue of the vertices, 0 .. 1, where the file has them, and the number of triangles.

    Args:
        data: the whole file.
        path: where it came from, for messages.

    Raises:
        CaptureError: a header or body that is not as the format says.
    """
    order, elements, body = _header(data, path)
    vertex = next((e for e in elements if e.name == "vertex"), _Element("vertex", 0, ()))
    if not {"red", "green", "blue"} <= {p.name for p in vertex.properties}:
        return None, 0
    columns, lists = _text_body(body, elements, path) if not order else _binary_body(body, elements, order, path)
    sizes = next((lists[f"face.{name}"][1] for name in _CORNERS if f"face.{name}" in lists), np.zeros(0, np.int64))
    stored = [columns[f"vertex.{name}"] for name in ("red", "green", "blue")]
    most = float(np.iinfo(stored[0].dtype.str).max) if stored[0].dtype.kind in "iu" else 1.0
    return np.stack(stored, 1).astype(np.float64) / most, int((sizes - 2).sum())
