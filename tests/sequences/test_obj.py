import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
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


def by_lines(text: str) -> tuple[list[list[float]], list[list[int]]]:
    """What a sound file says, read as a person would: line by line, word by word."""
    vertices, triangles = list[list[float]](), list[list[int]]()
    text = re.sub(r"\r\n?", "\n", text).replace("\\\n", " ")
    for line in text.split("\n"):
        words = line.split("#")[0].split()
        if words[:1] == ["v"]:
            vertices.append([float(word) for word in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(word.split("/")[0]) for word in words[1:]]
            corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
            triangles += [[corners[0], b, c] for b, c in pairwise(corners[1:])]
    return vertices, triangles


NUMBERS = st.one_of(
    st.floats(-1e3, 1e3).map(repr),
    st.floats(-9, 9).map("{:.6f}".format),
    st.floats(-9, 9).map("{:+.3E}".format),
    st.floats(-9, 9).map("{:.25f}".format),
    st.sampled_from(["0", "-0", "1.", ".5", "1e-300", "4.9e-324", "00012"]),
)
GAPS = st.sampled_from([" ", "  ", "\t", " \\\n", "\\\r\n  "])
CORNERS = st.sampled_from(["{}", "{}/7", "{}//3", "{}/1/2", "{}/-1/-2"])
BETWEEN = st.sampled_from(
    ["", "", "# f 1 1 1", "vn 0 0 1", "vt 0.5 0.5", "g f", "  # v 1", "usemtl v", "s off", "#\\\nv 9 9 9", ""]
)
ENDS = st.sampled_from(["\n", "\r\n", "\r", " \n", " # f\n"])


@st.composite
def obj_texts(draw: st.DrawFn) -> str:
    """Vertices and faces in all the ways in which they may be written."""
    lines, n_vertices = list[str](), 0
    for _ in range(draw(st.integers(1, 12))):
        if n_vertices < 3 or draw(st.booleans()):
            words = ["v", *draw(st.lists(NUMBERS, min_size=3, max_size=6))]
            n_vertices += 1
        else:
            index = st.one_of(st.integers(1, n_vertices), st.integers(-n_vertices, -1))
            corners = draw(st.lists(st.tuples(index, CORNERS), min_size=3, max_size=5))
            words = ["f", *(form.format(corner) for corner, form in corners)]
        line = draw(st.sampled_from(["", " ", "\t"])) + "".join(word + draw(GAPS) for word in words[:-1]) + words[-1]
        lines.append(line + draw(ENDS) + draw(BETWEEN) + "\n")
    return "".join(lines) + "f 1 1 1"


@given(obj_texts())
@settings(max_examples=300, derandomize=True)
def test_files_are_read_as_a_person_reads_them(text: str) -> None:
    vertices, triangles = by_lines(text)
    mesh = parse_obj(text.encode(), PATH)
    assert mesh.vertices.tobytes() == np.array(vertices).tobytes()
    assert mesh.faces.tolist() == triangles


def test_many_odd_numbers_are_all_read() -> None:
    small = [f"{k}e-310" for k in range(1, 301)]
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in zip(*[iter(small)] * 3, strict=True)) + "f 1 2 3\n"
    assert parse_obj(text.encode(), PATH).vertices.reshape(-1).tolist() == [float(x) for x in small]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v 0 0\nv 0 0 0\nf 1 1 2", "expected three coordinates a vertex, found 2 at vertex 1"),
        (SQUARE + "f 1 2 3\nf 1 2", "expected three corners a face, found 2 at face 2"),
        (SQUARE + "f 0 1 2", "expected face indices counted from 1, found index 0 at face 1"),
        (SQUARE + "f 1 2 9", r"expected face indices from 0 to 3, found \(0, 1, 8\) in face 0"),
        (SQUARE + "f 1 2 -5", r"expected face indices from 0 to 3, found \(0, 1, -1\) in face 0"),
        (SQUARE + "v 1 two 3\nf 1 2 3", "expected numbers after v and f, found 'v 1 two 3'"),
        (SQUARE + "f 1 2 3.5", "expected numbers after v and f, found 'f 1 2 3.5'"),
        (SQUARE + "f 1 2 /3", "expected numbers after v and f, found 'f 1 2 /3'"),
        (SQUARE + "f 1 2 " + "9" * 30, "expected numbers after v and f, found 'f 1 2 9999"),
        (SQUARE + "f 1 2 3 4_0 # no", "expected numbers after v and f, found 'f 1 2 3 4_0'"),
        (SQUARE + "v 1 1_0 3\nf 1 2 3", "expected numbers after v and f, found 'v 1 1_0 3'"),
        (SQUARE + "v 1 2 3 red\nf 1 2 3", "expected numbers after v and f, found 'v 1 2 3 red'"),
        (SQUARE + "v 1 nan 3\nf 1 2 3", r"expected finite vertices, found \(1, nan, 3\) at vertex 4"),
        (SQUARE + "v 1 2 1e999\nf 1 2 3", r"expected finite vertices, found \(1, 2, inf\) at vertex 4"),
        (SQUARE + "f 1 2 3\nf 3 2 0", "expected face indices counted from 1, found index 0 at face 2"),
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
