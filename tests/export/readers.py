"""Reads exports back with other people's libraries: usd-core, pygltflib and Draco, trimesh."""

import json
import shutil
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
import pygltflib
import trimesh
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdValidation

from mhvedit.geometry.arrays import FloatArray, IntArray

VALIDATOR = """
const validator = require('gltf-validator'), fs = require('fs');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])), {maxIssues: 20})
  .then(report => console.log(JSON.stringify(report.issues)));
"""
KINDS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A mesh that a file shows in a frame."""

    points: NDArray[np.float32]  # as stored
    faces: IntArray
    world: FloatArray  # (4, 4) of the node; columns multiply


def usd_shown(stage: Any, path: str, time: float) -> Shown:  # noqa: ANN401 - pxr has no types
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(path))
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(time))
    assert set(mesh.GetFaceVertexCountsAttr().Get(time)) == {3}
    matrix = np.array(UsdGeom.XformCache(Usd.TimeCode(time)).GetLocalToWorldTransform(mesh.GetPrim()))
    return Shown(np.array(mesh.GetPointsAttr().Get(time)), corners.reshape(-1, 3), matrix.T)


def usd_errors(path: Path) -> list[str]:
    """What the validators of usd-core find: those that `usdchecker` runs."""
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    stage = Usd.Stage.Open(str(path))
    return [f"{error.GetName()}: {error.GetMessage()}" for error in context.Validate(stage)]


@cache
def node_validator() -> str:
    """Where node finds the Khronos validator, or nothing."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        return ""
    place = subprocess.run([npm, "root", "-g"], capture_output=True, text=True).stdout.strip()
    return place if (Path(place) / "gltf-validator").is_dir() else ""


def gltf_errors(path: Path) -> list[str]:
    """Errors and warnings of the Khronos validator; pictures and meshes are decoded by it too."""
    ran = subprocess.run(
        ["node", "-e", VALIDATOR, str(path)], capture_output=True, text=True, env={"NODE_PATH": node_validator()}
    )
    report = json.loads(ran.stdout)
    assert report["numErrors"] + report["numWarnings"] == len([m for m in report["messages"] if m["severity"] < 2])
    return [f"{m['code']} {m['pointer']}: {m['message']}" for m in report["messages"] if m["severity"] < 2]


class Glb:
    """A .glb, played frame by frame."""

    def __init__(self, path: Path) -> None:
        self.gltf = pygltflib.GLTF2().load_binary(str(path))
        self.blob = self.gltf.binary_blob() or b""
        self.by_name = {node.name: i for i, node in enumerate(self.gltf.nodes)}
        self.parents = {child: i for i, node in enumerate(self.gltf.nodes) for child in node.children or []}
        self.channels: dict[int, list[tuple[str, FloatArray, FloatArray]]] = {}
        for animation in self.gltf.animations:
            for channel in animation.channels:
                sampler = animation.samplers[channel.sampler]
                assert sampler.interpolation == "STEP"
                keys = self.values(sampler.input)[:, 0], self.values(sampler.output)
                self.channels.setdefault(channel.target.node, []).append((channel.target.path, *keys))

    def values(self, index: int) -> NDArray[Any]:
        accessor = self.gltf.accessors[index]
        view = self.gltf.bufferViews[accessor.bufferView]
        kind, width = np.dtype(KINDS[accessor.componentType]), WIDTHS[accessor.type]
        start = view.byteOffset + (accessor.byteOffset or 0)
        return np.frombuffer(self.blob, kind, accessor.count * width, start).reshape(-1, width)

    def local(self, index: int, seconds: float) -> FloatArray:
        node = self.gltf.nodes[index]
        if node.matrix is not None:
            return np.array(node.matrix, np.float64).reshape(4, 4).T
        parts = {"translation": node.translation, "rotation": node.rotation, "scale": node.scale}
        for path, times, values in self.channels.get(index, []):
            parts[path] = values[max(0, int(np.searchsorted(times, seconds, side="right")) - 1)].tolist()
        moved, turned = np.eye(4), np.eye(4)
        moved[:3, 3] = parts["translation"] or 0
        x, y, z, w = parts["rotation"] or (0, 0, 0, 1)
        turned = trimesh.transformations.quaternion_matrix([w, x, y, z])
        return np.asarray(moved @ turned @ np.diag([*(parts["scale"] or (1, 1, 1)), 1.0]), np.float64)

    def world(self, index: int, seconds: float) -> FloatArray:
        matrix = self.local(index, seconds)
        while index in self.parents:
            index = self.parents[index]
            matrix = self.local(index, seconds) @ matrix
        return matrix

    def shown(self, group: str, seconds: float) -> list[tuple[str, Shown]]:
        """Meshes below a node that are not scaled to nothing."""
        found = []
        for child in self.gltf.nodes[self.by_name[group]].children:
            node, world = self.gltf.nodes[child], self.world(child, seconds)
            if np.linalg.det(world[:3, :3]) != 0:
                for primitive in self.gltf.meshes[node.mesh].primitives:
                    found.append((node.name, Shown(*self.primitive(primitive), world)))
        return found

    def primitive(self, primitive: Any) -> tuple[NDArray[np.float32], IntArray]:  # noqa: ANN401 - as pygltflib has it
        packed = (primitive.extensions or {}).get("KHR_draco_mesh_compression")
        if packed is not None:
            view = self.gltf.bufferViews[packed["bufferView"]]
            mesh = DracoPy.decode(self.blob[view.byteOffset : view.byteOffset + view.byteLength])
            count = self.gltf.accessors[primitive.attributes.POSITION].count
            assert (len(mesh.points), mesh.faces.size) == (count, self.gltf.accessors[primitive.indices].count)
            return mesh.points, mesh.faces.astype(np.int64)
        return self.values(primitive.attributes.POSITION), self.values(primitive.indices).reshape(-1, 3).astype(int)


def moved(shown: Shown) -> FloatArray:
    """(V, 3) in the world of the file."""
    return np.asarray(shown.points.astype(np.float64) @ shown.world[:3, :3].T + shown.world[:3, 3])


def z_up(points: FloatArray) -> FloatArray:
    """From y up."""
    return np.stack([points[:, 0], -points[:, 2], points[:, 1]], 1)
