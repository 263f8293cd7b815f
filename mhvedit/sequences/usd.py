"""USD stages with time-sampled meshes, whose connectivity may change from frame to frame."""

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mhvedit.errors import CaptureError, MhveditError, MissingLibrary
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.contents import Contents
from mhvedit.sequences.raw import RawMesh, checked_mesh, triangulate
from mhvedit.sequences.sources import HeldOpen

Piece = tuple[NDArray[Any], IntArray, IntArray | None]  # points in stage space, triangles, labels


@dataclass(frozen=True, slots=True)
class StageAxes:
    """What a stage says about itself; for information: the scene file decides how it is read."""

    metres_per_unit: float
    up: str  # y or z


class UsdSource:
    """All visible meshes of one stage, in stage space, at each time for which any of them has a sample.

    Time codes are frame numbers and must be whole. Values hold between samples: nothing is interpolated. A stage
    without samples is one frame, 0. Units and up axis of the stage are reported (`axes`) but not applied, nor is
    subdivision: what is read is the cage.
    """

    per_frame = False

    def __init__(self, path: Path, known: Contents | None = None) -> None:
        """Open the stage; `known`: hashes that are remembered."""
        self._path, self._lock = path, threading.Lock()
        with _readable(path):
            layers = _layers_of(path)  # held on to, or the stage would read them once more
            self.files = _files_of(path, layers)
            self._held = HeldOpen(path, self.files, known)
            for layer in layers:
                layer.Reload()  # what something else holds open is shared, as it was when that was opened
            self._stage, self._meshes = _opened_stage(path)
            times = sorted(set[float]().union(*(_sample_times(mesh) for mesh in self._meshes)))
            authored = self._stage.HasAuthoredMetadata("timeCodesPerSecond")
            self.fps = float(self._stage.GetTimeCodesPerSecond()) if authored else None
            self.axes = _stage_axes(self._stage)
        self._sampled = bool(times)
        self.numbers = _frame_numbers(path, times)

    def __reduce__(self) -> tuple[type["UsdSource"], tuple[Path, Contents]]:
        """Another process opens the stage for itself."""
        return UsdSource, (self._path, self._held.known)

    def opened(self, number: int) -> tuple[str, None]:
        """What all layers hold, and the frame."""
        return f"{self._held.identity()}:{number}", None

    def parsed(self, number: int, opened: None) -> RawMesh:
        """All meshes of a frame as one."""
        where = f"{self._path}: frame {number}"
        with self._lock, _readable(where):
            pieces = _pieces(self._meshes, number, self._sampled, where)
        if not pieces:
            raise CaptureError(where, "a visible mesh", "none")
        starts = np.cumsum([0] + [len(points) for points, _, _ in pieces])
        faces = np.concatenate([f + start for (_, f, _), start in zip(pieces, starts, strict=False)])
        labels = [part for _, _, part in pieces if part is not None]
        some = np.concatenate(labels) if len(labels) == len(pieces) else None
        return checked_mesh(where, np.concatenate([points for points, _, _ in pieces]), faces, some)


def _pxr() -> Any:  # noqa: ANN401 - modules of an untyped library
    """The USD library."""
    try:
        from pxr import Usd, UsdGeom
    except ImportError as error:
        raise MissingLibrary("reading USD", "pip install 'mhvedit[usd]'") from error
    return Usd, UsdGeom


@contextmanager
def _readable(where: Path | str) -> Iterator[None]:
    """Say in one sentence what the library finds amiss with a stage, whatever it raises for that.

    Raises:
        CaptureError: it finds something amiss.
    """
    try:
        yield
    except MhveditError:
        raise
    except Exception as error:
        raise CaptureError(where, "a readable USD stage", _in_words(error)) from error


def _in_words(error: Exception) -> str:
    """What an error says, without where in the library's own source it arose."""
    try:
        said = " ".join(str(error).split())
    except UnicodeDecodeError:  # it quotes the file
        return "text that is not UTF-8"
    within = re.search(r" : '(.+?)'(?: Error in |$)", said)
    return re.sub(r"(matching )?\S*pxrInternal\S* ?", "", within[1] if within else said)[:200]


def stage_files(path: Path) -> tuple[Path, ...]:
    """All files that a stage is read from: its own, and those of layers, references, payloads and value clips.

    Raises:
        CaptureError: it is no stage.
        MissingLibrary: usd-core is not installed.
    """
    with _readable(path):
        return _files_of(path, _layers_of(path))


def _layers_of(path: Path) -> list[Any]:
    """All layers of a stage, open."""
    _pxr()
    from pxr import UsdUtils

    unheard = UsdUtils.CoalescingDiagnosticDelegate()  # of warnings: names of clips that are templates
    layers, _, _ = UsdUtils.ComputeAllDependencies(str(path))
    del unheard
    return list(layers)


def _files_of(path: Path, layers: list[Any]) -> tuple[Path, ...]:
    """The file of a stage, and those of its other layers."""
    places = {Path(layer.realPath.split("[")[0]).resolve() for layer in layers if layer.realPath}  # or their .usdz
    return (path, *sorted(places - {path.resolve()}))


def _opened_stage(path: Path) -> tuple[Any, list[Any]]:
    """The stage, with held interpolation, and its meshes."""
    usd, geom = _pxr()
    stage = usd.Stage.Open(str(path))
    stage.SetInterpolationType(usd.InterpolationTypeHeld)
    predicate = usd.TraverseInstanceProxies()
    meshes = [geom.Mesh(prim) for prim in stage.Traverse(predicate) if prim.IsA(geom.Mesh)]
    if not meshes:
        raise CaptureError(path, "at least one mesh in the stage", "none")
    return stage, meshes


def _stage_axes(stage: Any) -> StageAxes:  # noqa: ANN401 - pxr has no types
    """Metres per unit and up axis, as authored or by USD's own defaults (0.01, y)."""
    _, geom = _pxr()
    return StageAxes(float(geom.GetStageMetersPerUnit(stage)), str(geom.GetStageUpAxis(stage)).lower())


def _sample_times(mesh: Any) -> set[float]:  # noqa: ANN401 - pxr has no types
    """Times at which the mesh, where it stands, or whether it is seen may change."""
    _, geom = _pxr()
    found = set[float]()
    for attribute in (mesh.GetPointsAttr(), mesh.GetFaceVertexIndicesAttr(), mesh.GetFaceVertexCountsAttr()):
        found |= set(attribute.GetTimeSamples())
    prim = mesh.GetPrim()
    while prim and not prim.IsPseudoRoot():
        imageable, placed = geom.Imageable(prim), geom.Xformable(prim)
        found |= set(imageable.GetVisibilityAttr().GetTimeSamples()) if imageable else set()
        found |= set(placed.GetTimeSamples()) if placed else set()
        prim = prim.GetParent()
    return found


def _frame_numbers(path: Path, times: list[float]) -> tuple[int, ...]:
    """Whole time codes of all samples, ascending; 0 alone where nothing is sampled."""
    for time in times:
        if time != round(time):
            raise CaptureError(path, "whole time codes, as they are frame numbers", f"{time:g}")
    return tuple(int(time) for time in times) or (0,)


def _pieces(meshes: list[Any], number: int, sampled: bool, where: str) -> list[Piece]:
    """Each mesh that is seen in a frame and has anything in it."""
    usd, geom = _pxr()
    time = usd.TimeCode(number) if sampled else usd.TimeCode.Default()
    spaces = geom.XformCache(time)
    found = list[Piece]()
    for mesh in meshes:
        points = _array(mesh.GetPointsAttr().Get(time), np.float32).reshape(-1, 3)
        if len(points) and mesh.ComputeVisibility(time) != geom.Tokens.invisible:
            faces = _faces(mesh, time, len(points), where)
            found.append(_placed(mesh, time, points, faces, np.array(spaces.GetLocalToWorldTransform(mesh.GetPrim()))))
    return found


def _array(value: Any, dtype: type[np.generic]) -> NDArray[Any]:  # noqa: ANN401 - pxr has no types
    """An array of USD as one of numpy; empty where there is no value."""
    return np.zeros(0, dtype) if value is None else np.asarray(value)


def _faces(mesh: Any, time: Any, n_vertices: int, where: str) -> IntArray:  # noqa: ANN401 - pxr has no types
    """Triangles as the stage has them."""
    corners = _array(mesh.GetFaceVertexIndicesAttr().Get(time), np.int64)
    sizes = _array(mesh.GetFaceVertexCountsAttr().Get(time), np.int64)
    if len(sizes) and (sizes.min() < 3 or sizes.sum() != len(corners)):
        found = f"{len(corners)} corners, the smallest face of {sizes.min()}"
        raise CaptureError(where, f"{sizes.sum()} corners in faces of 3 or more", found)
    if len(corners) and not 0 <= corners.min() <= corners.max() < n_vertices:
        raise CaptureError(where, f"face indices from 0 to {n_vertices - 1}", f"{corners.min()} to {corners.max()}")
    return triangulate(corners, sizes)


def _placed(mesh: Any, time: Any, points: NDArray[Any], faces: IntArray, matrix: FloatArray) -> Piece:  # noqa: ANN401
    """One mesh in stage space; left-handed faces and mirrored transforms are turned so that normals point out."""
    _, geom = _pxr()
    left = mesh.GetOrientationAttr().Get() == geom.Tokens.leftHanded
    if left != bool(np.linalg.det(matrix[:3, :3]) < 0):
        faces = faces[:, ::-1]
    if not (matrix == np.eye(4)).all():
        points = points.astype(np.float64) @ matrix[:3, :3] + matrix[3, :3]  # USD multiplies rows
    part = geom.PrimvarsAPI(mesh).GetPrimvar("part")
    labels = _array(part.Get(time) if part else None, np.float32)
    whole = labels.dtype.kind in "iu" and labels.shape == (len(points),)
    return points, faces, labels.astype(np.int64) if whole else None
