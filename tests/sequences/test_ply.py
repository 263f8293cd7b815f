import struct
from pathlib import Path

import numpy as np
import pytest

from mhvedit.errors import CaptureError
from mhvedit.sequences.ply import parse_ply

PATH = Path("a.ply")
POINTS = [(0.1, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (2.0, 2.0, 0.0)]
PARTS = [0, 3, 3, 0, 7]
POLYGONS = [[0, 1, 2], [0, 1, 2, 3], [0, 1, 2, 3, 4]]


def written(order: str, polygons: list[list[int]], *, part: str = "uchar", x: str = "float") -> bytes:
    """A PLY file with everything that a reader can trip over: an element before, one between, a list behind."""
    name = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = (
        f"ply\nformat {name} 1.0\ncomment hello\nelement camera 1\nproperty double zoom\nelement vertex {len(POINTS)}\n"
        f"property {x} x\nproperty {x} y\nproperty {x} z\nproperty uchar red\nproperty {part} part\n"
        f"element face {len(polygons)}\nproperty uchar flags\nproperty list uchar int vertex_indices\nend_header\n"
    )
    if not order:
        rows = ["1.5"] + [f"{p[0]} {p[1]} {p[2]} 255 {k}" for p, k in zip(POINTS, PARTS, strict=True)]
        rows += ["9 " + " ".join(map(str, [len(f), *f])) for f in polygons]
        return (head + "\n".join(rows) + "\n").encode()
    code = {"uchar": "B", "int": "i", "float": "f", "double": "d"}
    body = struct.pack(order + "d", 1.5)
    for p, k in zip(POINTS, PARTS, strict=True):
        body += struct.pack(f"{order}3{code[x]}B{code[part]}", *p, 255, k)
    for f in polygons:
        body += struct.pack(f"{order}BB{len(f)}i", 9, len(f), *f)
    return head.encode() + body


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize("polygons", [POLYGONS, POLYGONS[:1] * 2, POLYGONS[1:2] * 2])
@pytest.mark.parametrize("x", ["float", "double"])
def test_orders_polygons_and_types(order: str, polygons: list[list[int]], x: str) -> None:
    mesh = parse_ply(written(order, polygons, x=x), PATH)
    assert mesh.faces.tolist() == [[f[0], f[i], f[i + 1]] for f in polygons for i in range(1, len(f) - 1)]
    assert mesh.vertices.dtype == (np.float32 if x == "float" else np.float64)
    assert (mesh.vertices == np.array(POINTS, mesh.vertices.dtype)).all()
    assert mesh.labels is not None and mesh.labels.tolist() == PARTS
    assert mesh.labels.dtype == np.int32


@pytest.mark.parametrize("order", ["", "<"])
def test_parts_that_are_not_integers_are_no_labels(order: str) -> None:
    assert parse_ply(written(order, POLYGONS, part="float"), PATH).labels is None


def test_windows_header() -> None:
    head, body = written("<", POLYGONS).split(b"end_header\n", 1)
    mesh = parse_ply(head.replace(b"\n", b"\r\n") + b"end_header\r\n" + body, PATH)
    assert len(mesh.faces) == 6


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"plx\n", "expected a PLY header from ply to end_header, found b'plx"),
        (written("", POLYGONS).replace(b"x\n", b"u\n", 1), "expected vertex properties x, y, z, found none called x"),
        (written("", POLYGONS).replace(b"ascii", b"morse"), "expected a PLY header, found 'format morse 1.0'"),
        (written("<", POLYGONS)[:-30], "expected 3 rows of face, found the end of the file in row"),
        (written("<", POLYGONS)[:-75], "expected 5 rows of vertex, found the end of the file"),
        (written("", POLYGONS).rsplit(b"9 ", 1)[0], "expected 3 rows of face, found 2"),
        (written("", POLYGONS).replace(b"9 3 0 1 2", b"9 3 0 1"), "expected a row of face, found '9 3 0 1' in row 0"),
        (written("", POLYGONS).replace(b"1.0 0.0", b"one 0.0"), "expected 5 numbers a vertex, found could not convert"),
        (written("", [[0, 1]]), "expected three corners a face, found 2 at face 0"),
        (written("<", []), "expected at least one face, found 5 vertices and no faces"),
        (written("<", [[0, 1, 5]]), r"expected face indices from 0 to 4, found \(0, 1, 5\) in face 0"),
    ],
)
def test_bad_files_are_named(data: bytes, message: str) -> None:
    with pytest.raises(CaptureError, match="^a.ply: " + message):
        parse_ply(data, PATH)
