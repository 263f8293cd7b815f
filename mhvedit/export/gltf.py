"""Binary glTF: a node for each captured frame, shown in its turn by steps of scale; placements as animation.

glTF has no meshes that change their connectivity, so each captured frame that is shown is a mesh of its own; those that
are not its turn are scaled to nothing. glTF is y up: the root node carries the turn, everything below is z up.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mhvedit.export.content import (
    Exported,
    ExportScene,
    LooksOf,
    Piece,
    Tell,
    placement_steps,
    points_of,
    runs_of,
    used_numbers,
)
from mhvedit.export.draco import packed_mesh
from mhvedit.export.far import centred, scene_offset, shift_warning, shifted
from mhvedit.export.glb_file import INDICES, VERTICES, GlbFile, Json, check_size, described
from mhvedit.export.target import put_file, staged
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.scene.edit import EditedScene
from mhvedit.sequences.glb import DRACO
from mhvedit.sequences.looks import Float32Array, Looks, Material, web_picture
from mhvedit.sequences.meshes import BODY, Mesh

Z_UP_IN_Y_UP: Final = [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1]  # columns: (x, y, z) -> (x, z, -y)
SAMPLES: Final = 8  # frames of each piece that are read to estimate the size
DRACO_SHARE: Final = 0.4  # of the plain size, that Draco is taken to stay below
PLAIN: Final[Json] = {
    "name": "plain",
    "doubleSided": True,
    "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1, "baseColorFactor": [0.7, 0.7, 0.7, 1]},
}


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """A mesh as glTF has it: whatever belongs to a corner belongs to a vertex, so vertices are doubled where needed."""

    points: Float32Array  # (V, 3)
    faces: IntArray  # (F, 3)
    uv: Float32Array | None  # (V, 2), counted from the upper edge
    colours: Float32Array | None  # (V, 3) linear


def write_glb(scene: ExportScene, path: Path, *, draco: bool, tell: Tell) -> Exported:
    """Write one .glb; a scene far from the origin is shifted by a round offset, as float32 is all that there is.

    Args:
        scene: what to write.
        path: .glb.
        draco: compress the meshes (14 bits a coordinate: to 0.1 mm on a person); vertices are then reordered.
        tell: told how far it is.

    Raises:
        CaptureError: a frame cannot be read.
        ExportError: more than a .glb can hold.
    """
    check_size(path.name, estimated_size(scene) * (DRACO_SHARE if draco else 1.0))
    offset = scene_offset(scene)
    warnings = list(shift_warning(path.name, offset))
    scene = shifted(centred(scene), offset)
    with staged(path) as beside, GlbFile(beside / "values", path.name) as file:
        writer = _Writer(file, scene, draco, offset)
        for piece in scene.pieces:
            warnings += writer.put_piece(piece, tell)
        writer.put_scene()
        file.finish(beside / path.name)
        put_file(beside / path.name, path)
    return Exported(path, warnings=tuple(warnings), offset=(float(offset[0]), float(offset[1]), 0.0))


def estimated_size(scene: ExportScene) -> float:
    """Bytes that the meshes will take, from some frames of each piece."""
    total = 0.0
    for piece in scene.pieces:
        numbers = used_numbers(scene.source(piece))
        some = [numbers[i] for i in np.unique(np.linspace(0, len(numbers) - 1, min(SAMPLES, len(numbers))).astype(int))]
        sizes = []
        for number in some:
            mesh = piece.sequence.mesh(number)
            width = 2 if len(mesh.vertices) <= 65535 else 4
            sizes.append(mesh.vertices.size * 4 + mesh.faces.size * width)
        total += float(np.mean(sizes)) * len(numbers)
    return total


@dataclass(slots=True)
class _Writer:
    """The tables of one file as they grow."""

    file: GlbFile
    scene: ExportScene
    draco: bool
    offset: FloatArray  # (2,) m, that the scene is without
    channels: list[Json] = field(default_factory=list)
    samplers: list[Json] = field(default_factory=list)
    nodes: dict[str, list[int]] = field(default_factory=dict)  # of each subject's pieces
    materials: dict[tuple[object, ...], int] = field(default_factory=dict)
    textures: dict[bytes, int] = field(default_factory=dict)
    shared: dict[bytes, int] = field(default_factory=dict)  # accessors of times and steps

    def put_piece(self, piece: Piece, tell: Tell) -> tuple[str, ...]:
        """All captured frames of a piece that are shown."""
        source, looks, children = self.scene.source(piece), LooksOf(piece), list[int]()
        runs, numbers = runs_of(source), used_numbers(source)
        for done, number in enumerate(numbers):
            mesh = piece.sequence.mesh(number)
            made = self._put_mesh(f"{piece.name}_{number:04d}", mesh, looks.at(number, mesh))
            shown = [(run.start, run.stop) for run in runs if run.number == number]
            scale = [1, 1, 1] if shown[0][0] == 0 else [0, 0, 0]
            node = self.file.add("nodes", {"name": f"{piece.name}_{number:04d}", "mesh": made, "scale": scale})
            self._put_turns(node, shown)
            children.append(node)
            tell(f"meshes of {piece.name}", (done + 1) / len(numbers))
        name = piece.name if piece.part != BODY else f"{piece.name}.body"
        node = self.file.add("nodes", {"name": name, "children": children})
        self.nodes.setdefault(piece.subject, []).append(node)
        return looks.warnings

    def put_scene(self) -> None:
        """Subjects and props where they stand, the root, and what else a file has to say."""
        subjects = [self._put_subject(name) for name in self.scene.movers]
        root = self.file.add("nodes", {"name": self.scene.edit.name, "matrix": Z_UP_IN_Y_UP, "children": subjects})
        head = self.file.head
        head |= {
            "asset": {"version": "2.0", "generator": "mhvedit"},
            "scene": 0,
            "scenes": [{"name": self.scene.edit.name, "nodes": [root]}],
            "animations": [{"name": self.scene.edit.name, "channels": self.channels, "samplers": self.samplers}],
        }
        if self.offset.any():
            head["scenes"][0]["extras"] = {"offset": [*self.offset.tolist(), 0.0]}
        if self.draco:
            head |= {"extensionsUsed": [DRACO], "extensionsRequired": [DRACO]}

    def _put_subject(self, name: str) -> int:
        """The node that stands where the subject or prop does; its last keys hold the last frame while that lasts."""
        placements, n = _placements(self.scene.edit, name), self.scene.edit.n_frames
        keys = [*placement_steps(placements), (n, placements[-1])]
        frames, rows = np.array([frame for frame, _ in keys]), np.array([row for _, row in keys])
        moved, turned = rows[:, :3].astype(np.float32), rows[:, 3:].astype(np.float32)
        node = self.file.add(
            "nodes",
            {
                "name": name, "children": self.nodes[name],
                "translation": moved[0].tolist(), "rotation": turned[0].tolist(),
            },
        )  # fmt: skip
        self._animate(node, "translation", frames, moved)
        self._animate(node, "rotation", frames, turned)
        return node

    def _put_turns(self, node: int, shown: list[tuple[int, int]]) -> None:
        """Steps of scale: 1 while it is the node's turn; nothing where it always is."""
        n = self.scene.edit.n_frames
        if shown == [(0, n)]:
            return
        keys = {} if shown[0][0] == 0 else {0: 0.0}
        for start, stop in shown:
            keys |= {start: 1.0} if stop == n else {start: 1.0, stop: 0.0}
        values = np.repeat(np.array(list(keys.values()), np.float32)[:, None], 3, 1)
        self._animate(node, "scale", np.array(list(keys)), values)

    def _animate(self, node: int, path: str, frames: IntArray, values: Float32Array) -> None:
        """A channel of steps."""
        times = key_times(frames, self.scene.edit.fps)
        sampler = {
            "input": self._shared(times, limits=True), "output": self._shared(values), "interpolation": "STEP",
        }  # fmt: skip
        self.samplers.append(sampler)
        self.channels.append({"sampler": len(self.samplers) - 1, "target": {"node": node, "path": path}})

    def _shared(self, values: Float32Array, *, limits: bool = False) -> int:
        """An accessor that all channels of the same values use."""
        key = repr((values.shape, limits)).encode() + values.tobytes()
        if key not in self.shared:
            self.shared[key] = self.file.add_values(values, limits=limits)
        return self.shared[key]

    def _put_mesh(self, name: str, mesh: Mesh, looks: Looks | None) -> int:
        """One captured frame; a primitive for each of its materials."""
        corners = corners_of(mesh, looks)
        if self.draco:
            primitives = self._draco_primitives(corners, looks)
        else:
            primitives = self._plain_primitives(corners, looks)
        return self.file.add("meshes", {"name": name, "primitives": primitives})

    def _plain_primitives(self, corners: Corners, looks: Looks | None) -> list[Json]:
        """Indices of each material over the same vertices."""
        attributes = {"POSITION": self.file.add_values(corners.points, target=VERTICES, limits=True)}
        if corners.uv is not None:
            attributes["TEXCOORD_0"] = self.file.add_values(corners.uv, target=VERTICES)
        if corners.colours is not None:
            attributes["COLOR_0"] = self.file.add_values(corners.colours, target=VERTICES)
        kind = np.uint16 if len(corners.points) <= 65535 else np.uint32
        return [
            {
                "attributes": attributes,
                "indices": self.file.add_values(corners.faces[faces].astype(kind).reshape(-1), target=INDICES),
                "material": self._material(looks, index),
            }
            for index, faces in _by_material(len(corners.faces), looks)
        ]

    def _draco_primitives(self, corners: Corners, looks: Looks | None) -> list[Json]:
        """A compressed mesh for each material."""
        primitives = []
        for index, faces in _by_material(len(corners.faces), looks):
            used, place = np.unique(corners.faces[faces], return_inverse=True)
            packed = packed_mesh(
                corners.points[used], place.reshape(-1, 3),
                None if corners.uv is None else corners.uv[used],
                None if corners.colours is None else corners.colours[used],
            )  # fmt: skip
            attributes = {
                name: self.file.add("accessors", described(values, limits=name == "POSITION"))
                for name, values in packed.attributes.items()
            }
            extension = {"bufferView": self.file.add_bytes(packed.data), "attributes": packed.ids}
            primitives.append(
                {
                    "attributes": attributes,
                    "indices": self.file.add("accessors", described(packed.indices, limits=False)),
                    "material": self._material(looks, index),
                    "extensions": {DRACO: extension},
                }
            )
        return primitives

    def _material(self, looks: Looks | None, index: int) -> int:
        """The material's index, each once; -1 is the plain one, white where vertices have colours."""
        material = looks.materials[index] if looks is not None and index >= 0 else None
        if material is None:
            white = looks is not None and looks.colours is not None
            surface = PLAIN["pbrMetallicRoughness"] | ({"baseColorFactor": [1, 1, 1, 1]} if white else {})
            return self._known(("plain", white), PLAIN | {"pbrMetallicRoughness": surface})
        surface = {"metallicFactor": 0, "roughnessFactor": 1, "baseColorFactor": list(material.colour)}
        texture = self._texture(material)
        if texture is not None:
            surface["baseColorTexture"] = {"index": texture}
        stored: Json = {"name": material.name, "doubleSided": True, "pbrMetallicRoughness": surface}
        if material.colour[3] < 1:
            stored["alphaMode"] = "BLEND"
        return self._known((material.name, material.colour, texture), stored)

    def _known(self, key: tuple[object, ...], stored: Json) -> int:
        if key not in self.materials:
            self.materials[key] = self.file.add("materials", stored)
        return self.materials[key]

    def _texture(self, material: Material) -> int | None:
        """The picture inside the file, each once."""
        if material.picture is None:
            return None
        picture = web_picture(material.picture)
        if picture.data not in self.textures:
            kind = "image/png" if picture.name.endswith(".png") else "image/jpeg"
            view = self.file.add_bytes(picture.data)
            image = self.file.add("images", {"name": picture.name, "mimeType": kind, "bufferView": view})
            sampler = (
                0 if self.file.head.get("samplers") else self.file.add("samplers", {"wrapS": 10497, "wrapT": 10497})
            )
            self.textures[picture.data] = self.file.add("textures", {"source": image, "sampler": sampler})
        return self.textures[picture.data]


def key_times(frames: IntArray, fps: float) -> Float32Array:
    """Seconds at which frames begin; rounded down, so that a player that asks for a frame's time gets that frame."""
    exact: FloatArray = np.asarray(frames, np.float64) / fps
    near = exact.astype(np.float32)
    return np.asarray(np.where(near > exact, np.nextafter(near, np.float32(0)), near), np.float32)


def corners_of(mesh: Mesh, looks: Looks | None) -> Corners:
    """A mesh with vertices doubled where their corners have different texture coordinates."""
    points, faces = points_of(mesh), mesh.faces.astype(np.int64)
    colours = None if looks is None else looks.colours
    if looks is None or looks.uv is None:
        return Corners(points, faces, None, colours)
    rows: NDArray[Any] = np.concatenate([faces.reshape(-1, 1), looks.uv.reshape(-1, 2).view(np.int32)], 1)
    unique, place = np.unique(rows, axis=0, return_inverse=True)
    uv = unique[:, 1:].astype(np.int32).view(np.float32)
    flipped = np.stack([uv[:, 0], 1 - uv[:, 1]], 1)
    whose = unique[:, 0]
    return Corners(points[whose], place.reshape(-1, 3), flipped, None if colours is None else colours[whose])


def _by_material(n_faces: int, looks: Looks | None) -> list[tuple[int, IntArray]]:
    """Faces of each material that has any."""
    if looks is None:
        return [(-1, np.arange(n_faces))]
    return [(int(index), np.flatnonzero(looks.material == index)) for index in np.unique(looks.material)]


def _placements(scene: EditedScene, name: str) -> FloatArray:
    """(N, 7) place m and quaternion x, y, z, w of a subject or a prop."""
    if name in scene.props:
        prop = scene.props[name]
        return np.concatenate([prop.positions, prop.rotations], 1)
    x, y, yaw = scene.subjects[name].placements.T
    zero = np.zeros(len(yaw))
    return np.stack([x, y, zero, zero, zero, np.sin(yaw / 2), np.cos(yaw / 2)], 1)
