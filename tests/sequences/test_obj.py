from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.errors import CaptureError
from mhvedit.sequences.obj import obj_materials, parse_obj

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
PATH = Path("a.obj")


def faces(text: str) -> list[list[int]]:
    found: list[list[int]] = parse_obj(text.encode(), PATH).faces.tolist()
    return found


@pytest.mark.parametrize(
    "line", ["f 1 2 3 4", "f 1/1 2/2 3/3 4/4", "f 1//1 2//1 3//1 4//1", "f 1/1/1 2/2/1 3/3/1 4/4/1", "f -4 -3 -2 -1"]
)
def test_quads_in_every_notation(line: str) -> None:
    assert faces(SQUARE + line) == [[0, 1, 2], [0, 2, 3]]


def test_mixed_polygons_and_notations() -> None:
    assert faces(SQUARE + "v 2 2 0\nf 1/7 2 3\nf 1 2 3 4 5\n f  3//2 4 5 \n") == [
        [0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 3, 4], [2, 3, 4],
    ]  # fmt: skip


def test_negative_indices_count_from_their_line() -> None:
    assert faces("v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nf -4 -2 -1\n") == [[0, 1, 2], [0, 2, 3]]


def test_everything_else_is_passed_over() -> None:
    text = (
        "# f 9 9 9\nmtllib a.mtl\no thing\ng v\ns off\n\n"
        "  v 0 0 0 0.5 0.5 0.5\n\tv 1 0 0 1 1 1 # here\nvn 0 0 1\nvt 0 0\n"
        "v 1e0 1.0 -0 1 1 1\nusemtl f\nvp 1 2\nl 1 2\nf 1 2 3\n"
    )
    mesh = parse_obj(text.encode(), PATH)
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_newlines_and_continuations(newline: str) -> None:
    text = (SQUARE + "f 1 2 \\\n3 4").replace("\n", newline)
    assert faces(text) == [[0, 1, 2], [0, 2, 3]]


def test_degenerate_faces_and_lone_vertices_are_kept() -> None:
    mesh = parse_obj((SQUARE + "f 1 1 2\nf 1 2 3\n").encode(), PATH)
    assert mesh.faces.tolist() == [[0, 0, 1], [0, 1, 2]]
    assert len(mesh.vertices) == 4


@given(st.lists(st.floats(-1e6, 1e6), min_size=9, max_size=9))
def test_numbers_are_read_to_the_last_bit(values: list[float]) -> None:
    rows = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in zip(*[iter(values)] * 3, strict=True))
    assert parse_obj((rows + "f 1 2 3\n").encode(), PATH).vertices.reshape(-1).tolist() == values


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v 0 0\nv 0 0 0\nf 1 1 2", "expected three coordinates a vertex, found 2 at vertex 1"),
        (SQUARE + "f 1 2 3\nf 1 2", "expected three corners a face, found 2 at face 2"),
        (SQUARE + "f 0 1 2", "expected face indices counted from 1, found index 0"),
        (SQUARE + "f 1 2 9", r"expected face indices from 0 to 3, found \(0, 1, 8\) in face 0"),
        (SQUARE + "f 1 2 -5", r"expected face indices from 0 to 3, found \(0, 1, -1\) in face 0"),
        (SQUARE + "v 1 two 3\nf 1 2 3", "expected numbers after v and f, found 'v 1 two 3'"),
        (SQUARE + "f 1 2 3.5", "expected numbers after v and f, found 'f 1 2 3.5'"),
        (SQUARE, "expected at least one face, found 4 vertices and no faces"),
        ("# nothing", "expected at least one face, found 0 vertices and no faces"),
    ],
)
def test_bad_lines_are_named(text: str, message: str) -> None:
    with pytest.raises(CaptureError, match="^a.obj: " + message):
        parse_obj(text.encode(), PATH)


def test_materials_are_followed_but_not_loaded(tmp_path: Path) -> None:
    (tmp_path / "a_0001.obj").write_text("mtllib a.mtl\nmtllib gone.mtl\n# mtllib no.mtl\n" + SQUARE + "f 1 2 3\n")
    (tmp_path / "a.mtl").write_text("newmtl skin\nmap_Kd -s 1 1 1 skin.png\n map_Bump my bumps.png\nmap_Kd lost.png\n")
    for name in ("skin.png", "my bumps.png"):
        (tmp_path / name).write_bytes(b"never read")
    found = obj_materials(tmp_path / "a_0001.obj")
    assert [f.name for f in found.libraries] == ["a.mtl"]
    assert [f.name for f in found.pictures] == ["skin.png", "my bumps.png"]
    assert [f.name for f in found.missing] == ["gone.mtl", "lost.png"]
