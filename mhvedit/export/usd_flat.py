"""A flattened USD stage: everything in one file, each frame's meshes as time samples."""

import os
from pathlib import Path
from typing import Any, Final

import numpy as np

from mhvedit.export.content import Exported, ExportScene, LooksOf, Piece, Tell, placement_steps
from mhvedit.export.far import centred
from mhvedit.export.pictures import PictureFolder
from mhvedit.export.target import ExportError, put_file, put_folder, staged
from mhvedit.export.usd_library import TURNED_Y_UP, describe_stage, identifier, pxr, writing
from mhvedit.export.usd_meshes import PieceWriter
from mhvedit.geometry.arrays import FloatArray
from mhvedit.scene.edit import PropEdit
from mhvedit.sequences.looks import Looks
from mhvedit.sequences.meshes import Mesh

WORLD: Final = "World"


def write_flat_usd(scene: ExportScene, path: Path, *, up: str, tell: Tell) -> Exported:
    """Write a stage that needs no captures: `/World/anna/body/mesh` with time samples, `/World/anna` with placements.

    Of a capture far from the origin, points are without a round offset, which the placement has.
    Pictures of materials go to a folder `<name>_pictures` beside it, or into the package of a .usdz.

    Args:
        scene: what to write.
        path: .usd, .usda, .usdc or .usdz.
        up: z or y, the up axis of the stage.
        tell: told how far it is.

    Raises:
        CaptureError: a frame cannot be read.
        MissingLibrary: usd-core is not installed.
    """
    lib = pxr()
    packed = path.suffix.lower() == ".usdz"
    pictures = path.with_name(f"{path.stem}_pictures")
    warnings = list[str]()
    scene = centred(scene)
    with staged(path) as beside, writing(path):
        file = beside / (f"{path.stem}.usdc" if packed else path.name)
        stage = lib.Usd.Stage.CreateNew(str(file))
        start_stage(stage.GetRootLayer(), scene, up=up)
        folder = PictureFolder(beside / pictures.name, shared=True)
        for piece, prim in define_pieces(stage, scene).items():
            writer = PieceWriter(stage, prim, folder, f"./{pictures.name}/", hold=True)
            warnings += _put_frames(scene, piece, writer, tell)
        stage.GetRootLayer().Save()
        del stage
        if packed:
            file = _packed(file, beside / path.name)
        elif (beside / pictures.name).is_dir():
            _put_pictures(beside / pictures.name, pictures)
        put_file(file, path)
    return Exported(path, warnings=tuple(warnings))


def start_stage(layer: Any, scene: ExportScene, *, up: str) -> None:  # noqa: ANN401 - pxr has no types
    """What the stage says about itself, and its root, which turns it where y is to point up."""
    lib = pxr()
    describe_stage(layer, root=WORLD, fps=scene.edit.fps, start=0, end=scene.edit.n_frames - 1, up=up)
    root = lib.Sdf.CreatePrimInLayer(layer, f"/{WORLD}")
    root.specifier, root.typeName = lib.Sdf.SpecifierDef, "Xform"
    root.SetInfo("kind", "assembly")
    if up == "y":
        put_transform(root, np.array(TURNED_Y_UP, np.float64))


def put_transform(prim: Any, matrix: FloatArray) -> None:  # noqa: ANN401 - pxr has no types
    """Give a prim a fixed (4, 4) transform; rows multiply, as USD has it."""
    lib = pxr()
    moved = lib.Sdf.AttributeSpec(prim, "xformOp:transform", lib.Sdf.ValueTypeNames.Matrix4d)
    moved.default = lib.Gf.Matrix4d(matrix.tolist())
    put_order(prim, ["xformOp:transform"])


def put_order(prim: Any, names: list[str]) -> None:  # noqa: ANN401 - pxr has no types
    """Say in which order the transforms of a prim apply."""
    lib = pxr()
    order = lib.Sdf.AttributeSpec(prim, "xformOpOrder", lib.Sdf.ValueTypeNames.TokenArray, lib.Sdf.VariabilityUniform)
    order.default = lib.Vt.TokenArray(names)


def put_subject(layer: Any, scene: ExportScene, name: str, prim_name: str) -> str:  # noqa: ANN401
    """A prim for a subject or a prop, with its placement as translation and turn; returns its path."""
    lib = pxr()
    path = f"/{WORLD}/{prim_name}"
    prim = lib.Sdf.CreatePrimInLayer(layer, path)
    prim.specifier, prim.typeName = lib.Sdf.SpecifierDef, "Xform"
    prim.SetInfo("kind", "component")
    if name in scene.edit.props:
        _put_prop(layer, prim, scene.edit.props[name])
    else:
        _put_placements(layer, prim, scene.edit.subjects[name].placements)
    return path


def _put_placements(layer: Any, prim: Any, placed: FloatArray) -> None:  # noqa: ANN401
    """A subject's placement: translation, and a turn about z."""
    lib = pxr()
    placements = np.array(placed)
    placements[:, 2] = np.unwrap(placements[:, 2])
    moved = lib.Sdf.AttributeSpec(prim, "xformOp:translate", lib.Sdf.ValueTypeNames.Double3)
    turned = lib.Sdf.AttributeSpec(prim, "xformOp:rotateZ", lib.Sdf.ValueTypeNames.Double)
    for frame, (x, y, _) in placement_steps(placements * [1.0, 1.0, 0.0]):
        layer.SetTimeSample(moved.path, float(frame), lib.Gf.Vec3d(float(x), float(y), 0.0))
    for frame, (_, _, yaw) in placement_steps(placements * [0.0, 0.0, 1.0]):
        layer.SetTimeSample(turned.path, float(frame), float(np.degrees(yaw)))
    put_order(prim, ["xformOp:translate", "xformOp:rotateZ"])


def _put_prop(layer: Any, prim: Any, edit: PropEdit) -> None:  # noqa: ANN401
    """A prop's pose: translation, and a quaternion."""
    lib = pxr()
    moved = lib.Sdf.AttributeSpec(prim, "xformOp:translate", lib.Sdf.ValueTypeNames.Double3)
    turned = lib.Sdf.AttributeSpec(prim, "xformOp:orient", lib.Sdf.ValueTypeNames.Quatd)
    for frame, place in placement_steps(edit.positions):
        layer.SetTimeSample(moved.path, float(frame), lib.Gf.Vec3d(*place.tolist()))
    for frame, (x, y, z, w) in placement_steps(edit.rotations):
        layer.SetTimeSample(turned.path, float(frame), lib.Gf.Quatd(float(w), float(x), float(y), float(z)))
    put_order(prim, ["xformOp:translate", "xformOp:orient"])


def define_pieces(stage: Any, scene: ExportScene) -> dict[Piece, str]:  # noqa: ANN401 - pxr has no types
    """Prims of all subjects and props, and of their pieces below them; paths of the latter."""
    lib = pxr()
    found, taken = dict[Piece, str](), set[str]()
    for name in scene.movers:
        subject = put_subject(stage.GetRootLayer(), scene, name, identifier(name, taken))
        inside = set[str]()
        for piece in scene.pieces_of(name):
            found[piece] = f"{subject}/{identifier(piece.part, inside)}"
            lib.UsdGeom.Xform.Define(stage, found[piece])
    return found


def _put_frames(scene: ExportScene, piece: Piece, writer: PieceWriter, tell: Tell) -> tuple[str, ...]:
    """All frames of the scene; a captured frame that repeats is read once."""
    looks, last = LooksOf(piece), dict[int, tuple[Mesh, Looks | None]]()
    for k, number in enumerate(scene.source(piece).tolist()):
        if number not in last:
            mesh = piece.sequence.mesh(number)
            last = {number: (mesh, looks.at(number, mesh))}
        writer.put(k, *last[number])
        tell(f"meshes of {piece.name}", (k + 1) / scene.edit.n_frames)
    return looks.warnings


def _packed(file: Path, package: Path) -> Path:
    """A .usdz of a stage and its pictures."""
    lib = pxr()
    if not lib.UsdUtils.CreateNewUsdzPackage(lib.Sdf.AssetPath(str(file)), str(package)):
        raise ExportError(package.name, "a package of all files of the stage", "one that USD could not put in")
    return package


def _put_pictures(made: Path, pictures: Path) -> None:
    """Put pictures beside the stage; a folder of that name that is there is added to."""
    if not pictures.exists():
        put_folder(made, pictures)
        return
    for picture in sorted(made.iterdir()):
        os.replace(picture, pictures / picture.name)
