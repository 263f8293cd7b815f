"""Binary glTF: every triangle of the default scene, in world coordinates as the file has them (glTF itself is y up)."""

import json
import struct
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
from numpy.typing import NDArray

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.raw import RawMesh, checked_mesh

Json = dict[str, Any]
_KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
DRACO = "KHR_draco_mesh_compression"
_LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_")  # extensions that do not touch the mesh
_READ = {DRACO, "KHR_mesh_quantization"}


def parse_glb(data: bytes, path: Path) -> RawMesh:
    """Read all triangles of the default scene, in the order of its nodes.

    Skins and animations are passed over: what is read is the mesh as it stands in the file.

    Args:
        data: the whole file.
        path: where it came from, for messages.

    Raises:
        CaptureError: not a .glb of version 2, or one that needs an extension that is not read here.
    """
    head, binary = read_chunks(data, path)
    needed = [x for x in head.get("extensionsRequired", []) if x not in _READ and not x.startswith(_LOOKS)]
    if needed:
        raise CaptureError(path, "a .glb without " + ", ".join(needed), "one that needs it")
    vertices, faces, total = list[NDArray[np.floating]](), list[IntArray](), 0
    for matrix, mesh in placed_meshes(head):
        for primitive in head["meshes"][mesh]["primitives"]:
            points, triangles = read_primitive(head, binary, primitive)
            flip = np.linalg.det(matrix[:3, :3]) < 0
            vertices.append(_moved(points, matrix))
            faces.append((triangles[:, ::-1] if flip else triangles) + total)
            total += len(points)
    if not vertices:
        raise CaptureError(path, "a mesh in the default scene", "none")
    return checked_mesh(path, np.concatenate(vertices), np.concatenate(faces))


def read_chunks(data: bytes, path: Path) -> tuple[Json, bytes]:
    """The JSON and the binary chunk of a .glb file."""
    if data[:4] != b"glTF" or len(data) < 20 or struct.unpack_from("<I", data, 4)[0] != 2:
        raise CaptureError(path, "a .glb file of glTF 2", repr(data[:8]))
    size = struct.unpack_from("<I", data, 12)[0]
    head: Json = json.loads(data[20 : 20 + size])
    return head, data[20 + size + 8 :]


def placed_meshes(head: Json) -> list[tuple[FloatArray, int]]:
    """(world matrix, mesh index) of every node of the default scene that has a mesh."""
    nodes = head.get("nodes", [])
    scenes = head.get("scenes", [])
    children = {c for n in nodes for c in n.get("children", [])}
    tops = [i for i in range(len(nodes)) if i not in children]
    roots = scenes[head.get("scene", 0)].get("nodes", []) if scenes else tops
    found, left = list[tuple[FloatArray, int]](), [(np.eye(4), i) for i in reversed(roots)]
    while left:
        world, i = left.pop()
        world = world @ _local_matrix(nodes[i])
        if "mesh" in nodes[i]:
            found.append((world, nodes[i]["mesh"]))
        left += [(world, c) for c in reversed(nodes[i].get("children", []))]
    return found


def _local_matrix(node: Json) -> FloatArray:
    """Parent from node."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)))
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _moved(points: NDArray[np.floating], matrix: FloatArray) -> NDArray[np.floating]:
    """Points in the world; untouched, in their own type, where the node does not move them."""
    if (matrix == np.eye(4)).all():
        return points
    return points.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def read_primitive(head: Json, binary: bytes, primitive: Json) -> tuple[NDArray[np.floating], IntArray]:
    """Positions and triangles of one primitive; points and lines have none."""
    if DRACO in primitive.get("extensions", {}):
        view = head["bufferViews"][primitive["extensions"][DRACO]["bufferView"]]
        start = view.get("byteOffset", 0)
        mesh = DracoPy.decode(binary[start : start + view["byteLength"]])
        return np.asarray(mesh.points).reshape(-1, 3), np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    points = read_accessor(head, binary, primitive["attributes"]["POSITION"])
    if "indices" in primitive:
        corners = read_accessor(head, binary, primitive["indices"]).reshape(-1).astype(np.int64)
    else:
        corners = np.arange(len(points))
    return points, _triangles(corners, primitive.get("mode", 4))


def _triangles(corners: IntArray, mode: int) -> IntArray:
    """Triangles of a list (4), a strip (5) or a fan (6)."""
    if mode == 4:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if mode == 5:
        rows = np.stack([corners[:-2], corners[1:-1], corners[2:]], 1)
        rows[1::2] = rows[1::2, [1, 0, 2]]
        return rows
    if mode == 6:
        return np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], 1)
    return np.zeros((0, 3), np.int64)


def read_accessor(head: Json, binary: bytes, index: int) -> NDArray[Any]:
    """(count, width) values; normalised integers become floats."""
    accessor = head["accessors"][index]
    kind, width, count = np.dtype(_KINDS[accessor["componentType"]]), _WIDTHS[accessor["type"]], accessor["count"]
    if "bufferView" in accessor:
        view = head["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        if count and start + stride * (count - 1) + kind.itemsize * width > len(binary):
            raise ValueError(f"accessor {index} ends beyond the file")
        values: NDArray[Any] = np.ndarray((count, width), kind, binary, start, (stride, kind.itemsize)).copy()
    else:
        values = np.zeros((count, width), kind)
    if "sparse" in accessor:
        _replace_sparse(head, binary, accessor["sparse"], values)
    if accessor.get("normalized") and kind.kind in "iu":
        return np.asarray(np.maximum(values / np.iinfo(kind).max, -1.0))
    return values


def _replace_sparse(head: Json, binary: bytes, sparse: Json, values: NDArray[Any]) -> None:
    """Put the values of a sparse accessor in place."""
    count, where, what = sparse["count"], sparse["indices"], sparse["values"]
    views = head["bufferViews"]
    at = views[where["bufferView"]].get("byteOffset", 0) + where.get("byteOffset", 0)
    rows = np.frombuffer(binary, _KINDS[where["componentType"]], count, at)
    at = views[what["bufferView"]].get("byteOffset", 0) + what.get("byteOffset", 0)
    values[rows] = np.frombuffer(binary, values.dtype, count * values.shape[1], at).reshape(count, -1)
