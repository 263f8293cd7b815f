"""Texture coordinates, colours and materials of captures."""

import base64
import io
import json
import struct
from pathlib import Path

import DracoPy
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from mhvedit.errors import CaptureError
from mhvedit.sequences.frame_looks import frame_looks
from mhvedit.sequences.looks import Looks, Picture, linear_from_srgb, srgb_from_linear, web_picture
from mhvedit.sequences.meshes import MeshSequence
from mhvedit.sequences.read import open_capture

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\n"
UV = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1 0\n"


def picture_bytes(kind: str = "PNG") -> bytes:
    made = io.BytesIO()
    Image.new("RGB", (2, 2), (9, 80, 200)).save(made, kind)
    return made.getvalue()


def looks(folder: Path, name: str, content: str | bytes) -> Looks | None:
    file = folder / "c" / name
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    capture: MeshSequence = open_capture(folder / "c", name="c")
    found = frame_looks(capture, 1)
    mesh = capture.mesh(1)
    if found is not None:
        assert len(found.material) == len(mesh.faces)
        assert found.colours is None or len(found.colours) == len(mesh.vertices)
    return found


@pytest.mark.parametrize(
    "face",
    ["f 1/1 2/2 3/3 4/4", "f 1/1/1 2/2/1 3/3/1 4/4/1", "f -4/-4 -3/-3 -2/-2 -1/-1", "f 1/1 2/2/1 3/3 4/4 # quad"],
)
def test_corners_of_a_quad(tmp_path: Path, face: str) -> None:
    found = looks(tmp_path, "m_1.obj", SQUARE + UV + "vn 0 1 0\n" + face + "\n")
    assert found is not None and found.uv is not None
    assert found.uv.tolist() == [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]
    assert found.material.tolist() == [-1, -1] and found.materials == ()


def test_faces_without_coordinates_among_others(tmp_path: Path) -> None:
    found = looks(tmp_path, "m_1.obj", SQUARE + UV + "vn 0 1 0\nf 1//1 2//1 3//1\nf 1/2/1 3/3/1 4/4/1\n")
    assert found is not None and found.uv is not None
    assert found.uv.tolist() == [[[0, 0]] * 3, [[1, 0], [1, 1], [0, 1]]]


def test_relative_indices_count_from_where_they_stand(tmp_path: Path) -> None:
    found = looks(tmp_path, "m_1.obj", SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nf 1/-3 2/-2 3/-1\nvt 5 5\nf 1/-1 3/-1 4/-1\n")
    assert found is not None and found.uv is not None
    assert found.uv.tolist() == [[[0, 0], [1, 0], [1, 1]], [[5, 5]] * 3]


def test_materials_of_libraries(tmp_path: Path) -> None:
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "my skin.png").write_bytes(picture_bytes())
    (tmp_path / "c" / "bump.png").write_bytes(picture_bytes("BMP"))
    (tmp_path / "c" / "look book.mtl").write_text(
        "# made by hand\nnewmtl skin tone\nKd 0.1 0.2 0.3\nTr 0.25\nNs 12 # shiny\nmap_Kd my skin.png\n"
        "map_Bump -bm 0.5 bump.png\nnewmtl gone\nKd 1 0 0\nmap_Kd nowhere.png\n"
    )
    content = "mtllib look book.mtl\n" + SQUARE + UV + "usemtl gone\nf 1/1 2/2 3/3\nusemtl skin tone\nf 1/1 3/3 4/4\n"
    found = looks(tmp_path, "m_1.obj", content)
    assert found is not None
    gone, skin = found.materials
    assert found.material.tolist() == [0, 1] and (gone.name, skin.name) == ("gone", "skin tone")
    assert skin.picture == Picture("my skin.png", picture_bytes()) and skin.colour == (1, 1, 1, 0.75)
    assert skin.statements == ("Ns 12",)
    assert skin.maps == (("map_Bump -bm 0.5", Picture("bump.png", picture_bytes("BMP"))),)
    assert gone.picture is None and gone.colour == (1, 0, 0, 1)
    assert found.missing == (tmp_path / "c" / "nowhere.png",)


def test_vertex_colours_of_obj(tmp_path: Path) -> None:
    content = "v 0 0 0 1 0.5 0\nv 1 0 0 0 0 0\nv 1 0 1 1 1 1\nv 0 0 1 0 0 1\nf 1 2 3 4\n"
    found = looks(tmp_path, "m_1.obj", content)
    assert found is not None and found.colours is not None
    assert_allclose(srgb_from_linear(found.colours)[0], (1, 0.5, 0), atol=1e-6)


@pytest.mark.parametrize("content", [SQUARE + "f 1 2 3\n", "v 0 0 0 1 1 1\n" + SQUARE + "f 1 2 3\n"])
def test_files_that_say_nothing(tmp_path: Path, content: str) -> None:
    assert looks(tmp_path, "m_1.obj", content) is None


def test_texture_indices_that_point_nowhere(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match=r"m_1.obj: expected texture indices up to 4, found 5"):
        looks(tmp_path, "m_1.obj", SQUARE + UV + "f 1/1 2/2 3/5\n")


def test_texture_coordinates_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(
        CaptureError, match=r"m_1.obj: expected readable texture coordinates and materials, found Value"
    ):
        looks(tmp_path, "m_1.obj", SQUARE + "vt 0 zero\nf 1/1 2/1 3/1\n")


def glb(head: dict[str, object], binary: bytes) -> bytes:
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def textured_glb(image: dict[str, object] | None = None, picture: bytes | None = None) -> bytes:
    """A triangle and its mirror image with a picture in buffer view 3; `image` says more about it, or of another."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    uv = np.array([[0, 0], [1, 0], [0, 1]], np.float32)
    colours = np.array([[0, 128, 255, 255]] * 3, np.uint8)
    blobs = [points.tobytes(), uv.tobytes(), colours.tobytes(), picture or picture_bytes()]
    starts = np.cumsum([0] + [len(b) for b in blobs]).tolist()
    head = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"mesh": 0, "scale": [-1, 1, 1]}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 2}, "material": 1}]},
        ],
        "materials": [
            {},
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 0.5, 1, 0.5]}},
        ],
        "textures": [{"source": 0}],
        "images": [image or {"bufferView": 3, "mimeType": "image/png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5121, "count": 3, "type": "VEC4", "normalized": True},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": a, "byteLength": len(b)} for a, b in zip(starts, blobs, strict=False)
        ],
        "buffers": [{"byteLength": starts[-1]}],
    }
    return glb(head, b"".join(blobs))


def test_looks_of_glb(tmp_path: Path) -> None:
    found = looks(tmp_path, "m_1.glb", textured_glb())
    assert found is not None and found.uv is not None and found.colours is not None
    assert found.uv[0].tolist() == [[0, 1], [1, 1], [0, 0]]
    assert found.uv[1].tolist() == [[0, 0], [1, 1], [0, 1]]  # mirrored, so that it is wound the other way
    assert_allclose(found.colours[0], (0, 128 / 255, 1), atol=1e-6)
    assert found.material.tolist() == [1, 1]
    assert found.materials[1].picture is not None and found.materials[1].picture.data == picture_bytes()
    assert found.materials[1].colour == (1, 0.5, 1, 1)  # opaque, whatever the factor says


@pytest.mark.parametrize(
    ("image", "picture", "name"),
    [
        ({"bufferView": 3, "mimeType": "image/png"}, picture_bytes(), "m_1_picture.png"),
        ({"bufferView": 3, "mimeType": "image/jpeg", "name": "skin"}, picture_bytes("JPEG"), "skin.jpg"),
        ({"bufferView": 3, "mimeType": "image/jpeg", "name": "skin.JPEG"}, picture_bytes("JPEG"), "skin.JPEG"),
        ({"bufferView": 3, "mimeType": "image/png", "name": "skin.v2"}, picture_bytes(), "skin.v2.png"),
        ({"bufferView": 3, "mimeType": "image/webp", "name": "skin"}, b"RIFF", "skin.webp"),
        ({"bufferView": 3, "name": "skin"}, b"whatever", "skin"),
        ({"uri": "data:image/webp;base64,UklGRg=="}, b"", "m_1_picture.webp"),
        ({"uri": "data:;base64," + base64.b64encode(picture_bytes()).decode()}, b"", "m_1_picture.png"),
    ],
)
def test_pictures_within_a_glb_have_names_that_end_in_their_format(
    tmp_path: Path, image: dict[str, object], picture: bytes, name: str
) -> None:
    found = looks(tmp_path, "m_1.glb", textured_glb(image, picture))
    assert found is not None and found.materials[1].picture is not None
    assert found.materials[1].picture.name == name


def test_looks_of_ply_and_draco(tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    paint = np.array([[0, 10, 255]] * 4, np.uint8)
    uv = points[:, [0, 2]].astype(np.float64)
    data = DracoPy.encode(points, faces, colors=paint, tex_coord=uv, preserve_order=True, quantization_bits=20)
    found = looks(tmp_path, "m_1.drc", data)
    assert found is not None and found.uv is not None and found.colours is not None
    assert_allclose(np.sort(found.uv[0], 0), [[0, 0], [1, 0], [1, 1]], atol=1e-6)
    assert_array_equal(np.rint(255 * srgb_from_linear(found.colours)), paint)
    (tmp_path / "c" / "m_1.drc").unlink()
    rows = "\n".join(f"{x} {y} {z} 0 10 255" for x, y, z in points)
    head = "ply\nformat ascii 1.0\nelement vertex 4\n" + "".join(f"property float {a}\n" for a in "xyz")
    head += "".join(f"property uchar {a}\n" for a in ("red", "green", "blue"))
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    found = looks(tmp_path, "m_1.ply", f"{head}{rows}\n4 0 1 2 3\n")
    assert found is not None and found.colours is not None
    assert_array_equal(np.rint(255 * srgb_from_linear(found.colours)), paint)


def test_captures_in_one_file_say_nothing(tmp_path: Path) -> None:
    path = tmp_path / "c.npz"
    np.savez(path, vertices=np.eye(3), faces=[[0, 1, 2]], vertex_counts=[3], face_counts=[1], fps=30)
    assert frame_looks(open_capture(path, name="c"), 0) is None


def test_light_and_colour_values_are_inverse() -> None:
    values = np.arange(256) / 255
    assert_array_equal(np.rint(255 * srgb_from_linear(linear_from_srgb(values))), np.arange(256))
    assert linear_from_srgb(np.array([0.5])) == pytest.approx(0.21404, abs=1e-5)


def test_pictures_for_the_web() -> None:
    for kind, suffix in (("PNG", ".png"), ("JPEG", ".jpg")):
        same = web_picture(Picture("skin.tga", picture_bytes(kind)))
        assert same == Picture(f"skin{suffix}", picture_bytes(kind))
    made = web_picture(Picture("skin.bmp", picture_bytes("BMP")))
    assert made.name == "skin.png"
    with Image.open(io.BytesIO(made.data)) as image:
        assert image.getpixel((1, 1)) == (9, 80, 200)
    with pytest.raises(CaptureError, match=r"skin.bmp: expected a picture, found "):
        web_picture(Picture("skin.bmp", b"never"))
