"""A USD edit layer: it references the captures and holds only who shows which frame when, and where they stand."""

import hashlib
import os
from pathlib import Path
from typing import Any, Final

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.export.content import Exported, ExportScene, LooksOf, Piece, Tell, runs_of
from mhvedit.export.far import centred
from mhvedit.export.pictures import PictureFolder
from mhvedit.export.target import ExportError, put_file, staged
from mhvedit.export.usd_flat import put_subject, put_transform, start_stage
from mhvedit.export.usd_library import describe_stage, identifier, pxr, writing
from mhvedit.export.usd_meshes import PieceWriter
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.axes import to_metres_z_up
from mhvedit.sequences.contents import stamp_of
from mhvedit.sequences.read import USD_SUFFIXES

VERSION: Final = 1  # of the form of assets; raise it when it changes
CAPTURE: Final = "mhvedit:capture"  # key in an asset's custom data: which capture it was made of
OFFSET: Final = "mhvedit:offset"  # the same: x and y, m, that its points are without


def write_usd_edit(scene: ExportScene, path: Path, *, assets: Path, up: str, tell: Tell) -> Exported:
    """Write the edit layer, and USD copies of those captures that are not USD.

    The frames that a subject shows are value clips: one clip, the whole capture, and a table of times with a jump at
    every change, so that nothing is interpolated whatever the reader's setting. A copy holds every frame of its capture
    as read, in metres and z up; it is written once and used again while the capture does not change. Of a capture far
    from the origin, a copy is without a round offset, which the placement has.

    Args:
        scene: what to write.
        path: .usd, .usda or .usdc.
        assets: folder of the copies.
        up: z or y, the up axis of the stage.
        tell: told how far it is.

    Raises:
        CaptureError: a frame cannot be read.
        ExportError: there is a file of somebody else where a copy has to go.
        MissingLibrary: usd-core is not installed.
    """
    lib = pxr()
    written, kept, warnings = list[tuple[Path, Path]](), list[Path](), list[str]()
    assets.parent.mkdir(parents=True, exist_ok=True)
    scene = centred(scene)
    with staged(path) as beside, staged(assets) as made, writing(path):
        layer = lib.Sdf.Layer.CreateNew(str(beside / path.name))
        start_stage(layer, scene, up=up)
        pictures = PictureFolder(made / "pictures", shared=True)
        subjects = set[str]()
        for name in scene.movers:
            parent, parts = put_subject(layer, scene, name, identifier(name, subjects)), set[str]()
            for piece in scene.pieces_of(name):
                inside = f"{parent}/{identifier(piece.part, parts)}"
                as_it_is = piece.path.suffix.lower() in USD_SUFFIXES and not piece.sequence.made_of
                root = captured_root(piece.path) if as_it_is else None
                if root is not None:
                    _put_capture(layer, inside, piece, _relative(piece.path, path), root, scene.source(piece))
                    continue
                asset = assets / f"{piece.name}.usdc"
                if _is_current(asset, piece):
                    kept.append(asset)
                else:
                    warnings += _write_asset(piece, made / asset.name, pictures, tell)
                    written.append((made / asset.name, asset))
                _put_reference(layer, inside, _relative(asset, path), f"/{_root_name(piece)}", scene.source(piece))
        layer.Save()
        del layer
        _put_assets(written, made / "pictures", assets)
        put_file(beside / path.name, path)
    return Exported(path, tuple(kept), tuple(warnings))


def captured_root(path: Path) -> str | None:
    """The one root prim that holds all meshes of a USD capture, or None where there are several.

    Raises:
        CaptureError: it cannot be read.
    """
    lib = pxr()
    try:
        stage = lib.Usd.Stage.Open(str(path))
    except lib.Tf.ErrorException as error:
        raise CaptureError(path, "a readable USD stage", " ".join(str(error).split())[:200]) from error
    predicate = lib.Usd.TraverseInstanceProxies()
    meshes = [prim.GetPath() for prim in stage.Traverse(predicate) if prim.IsA(lib.UsdGeom.Mesh)]
    roots = {str(mesh.GetPrefixes()[0]) for mesh in meshes}
    return roots.pop() if len(roots) == 1 else None


def clip_times(source: IntArray) -> list[tuple[float, float]]:
    """Scene time and capture time at both ends of every run; two entries of one scene time are a jump.

    >>> clip_times(np.array([7, 7, 9]))
    [(0.0, 7.0), (2.0, 7.0), (2.0, 9.0), (3.0, 9.0)]
    """
    return [(float(frame), float(run.number)) for run in runs_of(source) for frame in (run.start, run.stop)]


def _put_reference(layer: Any, path: str, asset: str, root: str, source: IntArray) -> None:  # noqa: ANN401
    """A prim that shows frames of a capture."""
    lib = pxr()
    prim = lib.Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = lib.Sdf.SpecifierDef
    prim.referenceList.prependedItems = [lib.Sdf.Reference(asset, root)]
    clip = {
        "assetPaths": lib.Sdf.AssetPathArray([lib.Sdf.AssetPath(asset)]),
        "primPath": root,
        "active": lib.Vt.Vec2dArray([lib.Gf.Vec2d(0, 0)]),
        "times": lib.Vt.Vec2dArray([lib.Gf.Vec2d(*pair) for pair in clip_times(source)]),
    }
    prim.SetInfo("clips", {"default": clip})


def _put_capture(layer: Any, path: str, piece: Piece, asset: str, root: str, source: IntArray) -> None:  # noqa: ANN401
    """A USD capture as it is, below a prim that brings it to metres and z up."""
    lib = pxr()
    prim = lib.Sdf.CreatePrimInLayer(layer, path)
    prim.specifier, prim.typeName = lib.Sdf.SpecifierDef, "Xform"
    put_transform(prim, _to_metres(piece))
    _put_reference(layer, f"{path}/capture", asset, root, source)


def _to_metres(piece: Piece) -> FloatArray:
    """(4, 4) from a capture on disk to metres, z up and without its offset; rows multiply."""
    matrix = np.eye(4)
    matrix[:3, :3] = to_metres_z_up(np.eye(3), units=piece.units, up=piece.up)
    matrix[3, :2] -= piece.offset
    return matrix


def _relative(file: Path, layer: Path) -> str:
    """A file as a layer refers to it, with forward slashes and a ./ in front."""
    found = Path(os.path.relpath(file.resolve(), layer.parent.resolve())).as_posix()
    return found if found.startswith("../") else f"./{found}"


def _root_name(piece: Piece) -> str:
    """Of the root prim of a copy."""
    return identifier(piece.name, set())


def _signature(piece: Piece) -> str:
    """Changes when the capture does: its files, pictures among them, by name and state; frames, rate, axes, offset."""
    made = set(piece.sequence.files if piece.sequence.made_of else ())  # stopped meshes are in another folder
    found = sorted({*piece.path.rglob("*"), *made}) if piece.path.is_dir() else piece.sequence.files
    files = [(file.name, stamp_of(file)) for file in found if file.is_file()]
    what = (VERSION, files, piece.sequence.numbers, piece.sequence.fps, piece.units, piece.up, piece.offset)
    return hashlib.blake2b(repr(what).encode(), digest_size=16).hexdigest()


def _offset_data(piece: Piece) -> dict[str, Any]:
    """What a copy says of the offset that its points are without."""
    return {OFFSET: pxr().Gf.Vec2d(*piece.offset)} if any(piece.offset) else {}


def _is_current(asset: Path, piece: Piece) -> bool:
    """Whether a copy of the capture as it is now is there.

    Raises:
        ExportError: another file is there.
    """
    if not asset.exists():
        return False
    lib = pxr()
    try:
        layer = lib.Sdf.Layer.OpenAsAnonymous(str(asset), metadataOnly=True)
        found = layer.customLayerData.get(CAPTURE)
    except (lib.Tf.ErrorException, AttributeError):
        found = None
    if found is None:
        raise ExportError(asset, "nothing there, or a copy made by `mhvedit export` (see --assets)", "another file")
    return bool(found == _signature(piece))


def _write_asset(piece: Piece, file: Path, pictures: PictureFolder, tell: Tell) -> tuple[str, ...]:
    """A capture as USD: every frame, time codes are frame numbers."""
    lib = pxr()
    stage = lib.Usd.Stage.CreateNew(str(file))
    layer, numbers, root = stage.GetRootLayer(), piece.sequence.numbers, _root_name(piece)
    describe_stage(layer, root=root, fps=piece.sequence.fps, start=numbers[0], end=numbers[-1], up="z")
    layer.customLayerData = {CAPTURE: _signature(piece)} | _offset_data(piece)
    lib.UsdGeom.Xform.Define(stage, f"/{root}")
    writer, looks = PieceWriter(stage, f"/{root}", pictures, "./pictures/", hold=False), LooksOf(piece)
    for done, number in enumerate(numbers):
        mesh = piece.sequence.mesh(number)
        writer.put(number, mesh, looks.at(number, mesh))
        tell(f"USD copy of {piece.name}", (done + 1) / len(numbers))
    layer.Save()
    return looks.warnings


def _put_assets(written: list[tuple[Path, Path]], pictures: Path, assets: Path) -> None:
    """Put complete copies and their pictures in place; pictures first."""
    moves = list(written)
    if pictures.is_dir():
        moves = [(p, assets / "pictures" / p.name) for p in sorted(pictures.iterdir())] + moves
    for made, place in moves:
        place.parent.mkdir(parents=True, exist_ok=True)
        put_file(made, place)
