import json
import struct
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
import pytest
import trimesh

from mhvedit.errors import CaptureError
from mhvedit.sequences.glb import parse_glb

PATH = Path("a.glb")
BOX = trimesh.creation.box((0.4, 0.6, 1.8))


def container(head: dict[str, Any], binary: bytes) -> bytes:
    text = json.dumps(head).encode()
    text, binary = text.ljust(-(-len(text) // 4) * 4, b" "), binary.ljust(-(-len(binary) // 4) * 4, b"\0")
    size = 12 + 8 + len(text) + 8 + len(binary)
    return (
        struct.pack("<4sIII4s", b"glTF", 2, size, len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(binary), b"BIN\0")
        + binary
    )


def scene(
    primitive: dict[str, Any], accessors: list[dict[str, Any]], views: list[dict[str, Any]], **more: list[str]
) -> dict[str, Any]:
    return {
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "accessors": accessors,
        "meshes": [{"primitives": [primitive]}], "bufferViews": views, **more,
    }  # fmt: skip


def test_nodes_stand_where_their_transforms_put_them() -> None:
    turned = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3), (0.3, 0, 0))
    mirrored = np.diag([-1.0, 2.0, 1.0, 1.0])
    world = trimesh.Scene()
    world.add_geometry(BOX, node_name="a", transform=turned)
    world.add_geometry(BOX, node_name="b", parent_node_name="a", transform=mirrored)
    mesh = parse_glb(world.export(file_type="glb"), PATH)
    expected = trimesh.util.concatenate(
        [BOX.copy().apply_transform(turned), BOX.copy().apply_transform(turned @ mirrored)]
    )
    assert mesh.vertices == pytest.approx(expected.vertices, abs=1e-6)
    assert trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume == pytest.approx(expected.volume)


def test_rotation_translation_and_scale_of_a_node() -> None:
    points = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4")
    accessor = {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}
    head = scene({"attributes": {"POSITION": 0}}, [accessor], [{"buffer": 0, "byteLength": 36}])
    half = 0.5**0.5
    head["nodes"] = [{"mesh": 0, "rotation": [0, 0, half, half], "scale": [2, 3, 4], "translation": [10, 20, 30]}]
    mesh = parse_glb(container(head, points.tobytes()), PATH)
    assert mesh.vertices == pytest.approx(np.array([[10, 22, 30], [7, 20, 30], [10, 20, 34]]))
    assert mesh.faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("mode", "expected"),
    [(4, [[0, 1, 2]]), (5, [[0, 1, 2], [2, 1, 3], [2, 3, 4]]), (6, [[0, 1, 2], [0, 2, 3], [0, 3, 4]])],
)
def test_lists_strips_and_fans(mode: int, expected: list[list[int]]) -> None:
    points = np.random.default_rng(0).random((5, 3)).astype("<f4")
    binary = points.tobytes() + np.arange(5, dtype="<u2").tobytes()
    head = scene({"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}, [
        {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 5},
        {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 5},
    ], [{"buffer": 0, "byteLength": 60}, {"buffer": 0, "byteOffset": 60, "byteLength": 10}])  # fmt: skip
    mesh = parse_glb(container(head, binary), PATH)
    assert mesh.faces.tolist() == expected
    assert (mesh.vertices == points).all() and mesh.vertices.dtype == np.float32


def test_draco_inside() -> None:
    data = DracoPy.encode(BOX.vertices, BOX.faces, quantization_bits=20, preserve_order=True)
    primitive = {
        "attributes": {"POSITION": 0},
        "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}},
    }
    head = scene(
        primitive, [], [{"buffer": 0, "byteLength": len(data)}], extensionsRequired=["KHR_draco_mesh_compression"]
    )
    mesh = parse_glb(container(head, data), PATH)
    assert np.abs(mesh.vertices - BOX.vertices).max() < 1e-5 and (mesh.faces == BOX.faces).all()


def test_interleaved_sparse_and_normalised() -> None:
    rows = np.zeros(4, np.dtype([("p", "<i2", 3), ("pad", "<i2"), ("n", "<i4")]))
    rows["p"] = [[0, 0, 0], [32767, 0, 0], [0, 32767, 0], [-32768, 0, 0]]
    extra = np.array([1], "<u2").tobytes() + b"\0\0" + np.array([[0, 0, 32767]], "<i2").tobytes()
    head = scene({"attributes": {"POSITION": 0}, "mode": 6}, [{
        "bufferView": 0, "componentType": 5122, "type": "VEC3", "count": 4, "normalized": True,
        "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 2}},
    }], [{"buffer": 0, "byteLength": 48, "byteStride": 12}, {"buffer": 0, "byteOffset": 48, "byteLength": 2},
         {"buffer": 0, "byteOffset": 52, "byteLength": 6}])  # fmt: skip
    mesh = parse_glb(container(head, rows.tobytes() + extra), PATH)
    assert mesh.vertices.tolist() == [[0, 0, 0], [0, 0, 1], [0, 1, 0], [-1, 0, 0]]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"glTF\x01\0\0\0" + bytes(20), "expected a .glb file of glTF 2"),
        (container(scene({}, [], [], extensionsRequired=["EXT_meshopt_compression"]), b""),
         "expected a .glb without EXT_meshopt_compression, found one that needs it"),
        (container({"scenes": [{"nodes": [0]}], "nodes": [{}]}, b""),
         "expected a mesh in the default scene, found none"),
    ],
)  # fmt: skip
def test_bad_files_are_named(data: bytes, message: str) -> None:
    with pytest.raises(CaptureError, match="^a.glb: " + message):
        parse_glb(data, PATH)
