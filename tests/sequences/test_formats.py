"""Every format, written by somebody else's writer, and damaged."""

from pathlib import Path

import DracoPy
import numpy as np
import pytest
import trimesh

from mhvedit.errors import CaptureError
from mhvedit.sequences.formats import PARSERS, parse_mesh

BALL = trimesh.creation.icosphere(subdivisions=2, radius=0.9)


def encoded(mesh: trimesh.Trimesh, suffix: str) -> bytes:
    if suffix == ".drc":
        return bytes(DracoPy.encode(mesh.vertices, mesh.faces, quantization_bits=20, preserve_order=True))
    data = mesh.export(file_type=suffix[1:])
    return data if isinstance(data, bytes) else data.encode()


@pytest.mark.parametrize(
    ("suffix", "close"), [(".obj", 1e-8), (".ply", 1e-7), (".stl", 1e-7), (".glb", 1e-7), (".drc", 3e-6)]
)
def test_what_others_wrote_is_read(suffix: str, close: float) -> None:
    mesh = parse_mesh(encoded(BALL, suffix), Path("a" + suffix))
    if suffix == ".stl":  # has corners only: numbers in order of first use
        assert len(mesh.vertices) == len(BALL.vertices)
    else:
        assert (mesh.faces == BALL.faces).all()
    assert np.abs(mesh.vertices[mesh.faces] - BALL.vertices[BALL.faces]).max() < close
    assert mesh.faces.dtype == np.int32


def test_every_parser_is_tried() -> None:
    assert set(PARSERS) == {".obj", ".ply", ".stl", ".glb", ".drc"}


@pytest.mark.parametrize("suffix", PARSERS)
def test_duplicate_vertices_are_kept(suffix: str) -> None:
    if suffix == ".stl":
        pytest.skip("has no vertices of its own")
    soup = trimesh.Trimesh(
        BALL.vertices[BALL.faces].reshape(-1, 3), np.arange(BALL.faces.size).reshape(-1, 3), process=False
    )
    assert parse_mesh(encoded(soup, suffix), Path("a" + suffix)).vertices.shape == (BALL.faces.size, 3)


@pytest.mark.parametrize("suffix", PARSERS)
def test_empty_file(suffix: str) -> None:
    with pytest.raises(CaptureError, match=f"^a{suffix}: expected a {suffix} mesh, found an empty file$"):
        parse_mesh(b"", Path("a" + suffix))


@pytest.mark.parametrize("suffix", PARSERS)
def test_garbage_is_one_sentence(suffix: str) -> None:
    with pytest.raises(CaptureError, match=rf"^a\{suffix}: expected .*, found .*$") as caught:
        parse_mesh(b"\x00\xff never a mesh \n" * 20, Path("a" + suffix))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", PARSERS)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.98])
def test_a_file_cut_off_is_refused(suffix: str, share: float) -> None:
    data = encoded(BALL, suffix)
    if suffix == ".obj":  # a text that ends early is shorter, but whole, unless faces or their vertices are lost
        share = min(share, 0.5)
    with pytest.raises(CaptureError):
        parse_mesh(data[: int(share * len(data))], Path("a" + suffix))


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".glb"])
def test_nan_is_refused(suffix: str) -> None:
    broken = BALL.copy()
    broken.vertices[7, 1] = np.nan
    with pytest.raises(CaptureError, match="expected finite vertices"):
        parse_mesh(encoded(broken, suffix), Path("a" + suffix))


def test_points_without_faces() -> None:
    data = bytes(DracoPy.encode(BALL.vertices))
    with pytest.raises(CaptureError, match="expected at least one face, found 162 vertices and no faces"):
        parse_mesh(data, Path("a.drc"))


def test_text_stl() -> None:
    text = BALL.export(file_type="stl_ascii")
    mesh = parse_mesh(text.encode(), Path("a.stl"))
    assert np.abs(mesh.vertices[mesh.faces] - BALL.vertices[BALL.faces]).max() < 1e-7
    assert len(mesh.vertices) == len(BALL.vertices)


def test_binary_stl_that_starts_with_solid() -> None:
    data = b"solid but binary".ljust(80, b" ") + encoded(BALL, ".stl")[80:]
    assert len(parse_mesh(data, Path("a.stl")).faces) == len(BALL.faces)
