"""Writes the frames of one piece into a USD stage: a mesh whose connectivity changes, and its materials."""

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mhvedit.export.content import points_of
from mhvedit.export.pictures import PictureFolder
from mhvedit.export.usd_library import identifier, pxr
from mhvedit.geometry.arrays import IntArray
from mhvedit.sequences.looks import Float32Array, Looks, Material, web_picture
from mhvedit.sequences.meshes import Mesh

HOLD: Final = 2.0**-10  # frames before the next one, at which a frame is told again
SAVE_EVERY: Final = 1 << 26  # bytes of meshes, after which they go to disk


_Kind = tuple[str, tuple[float, ...], bool]  # name and colour of a material, and whether it has a picture


@dataclass(frozen=True, slots=True)
class _Surface:
    """A material in the stage; its picture may change from frame to frame."""

    prim: Any  # UsdShade.Material
    picture: Any  # the file input of its texture, or None
    subset: Any  # UsdGeom.Subset, the faces that it covers


@dataclass(slots=True)
class PieceWriter:
    """Tells a stage, frame by frame, what a piece looks like.

    `subdivisionScheme` is none, so that what is drawn is the captured triangles. Some readers interpolate points
    between frames where their count happens to be equal, although the triangles are others; with `hold` such a frame is
    told twice, the second time just before the next.
    """

    stage: Any
    path: str  # of the piece, an Xform that is there
    pictures: PictureFolder
    pictures_at: str  # the folder of pictures as the stage's layer sees it, with a / at the end
    hold: bool
    _mesh: Any = None
    _surfaces: dict[_Kind, _Surface] = field(default_factory=dict)
    _last: tuple[Mesh, Looks | None] | None = None
    _unsaved: int = 0

    def put(self, frame: int, mesh: Mesh, looks: Looks | None) -> None:
        """The next frame."""
        before = self._last
        if self.hold and before is not None and before[0] is not mesh and _same_size(before[0], mesh):
            self._tell(frame - HOLD, *before)
        self._tell(frame, mesh, looks)
        self._last = mesh, looks
        self._unsaved += mesh.vertices.size * 4 + mesh.faces.size * 4
        if self._unsaved > SAVE_EVERY:
            self.stage.GetRootLayer().Save()
            self._unsaved = 0

    def _tell(self, time: float, mesh: Mesh, looks: Looks | None) -> None:
        vt = pxr().Vt
        points = points_of(mesh)
        prim = self._define() if self._mesh is None else self._mesh
        prim.GetPointsAttr().Set(vt.Vec3fArray.FromNumpy(points), time)
        prim.GetFaceVertexCountsAttr().Set(vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)), time)
        prim.GetFaceVertexIndicesAttr().Set(vt.IntArray.FromNumpy(np.ascontiguousarray(mesh.faces.reshape(-1))), time)
        prim.GetExtentAttr().Set(vt.Vec3fArray.FromNumpy(np.stack([points.min(0), points.max(0)])), time)
        if mesh.labels is not None:
            self._tell_primvar("part", "IntArray", "vertex", vt.IntArray.FromNumpy(mesh.labels), time)
        if looks is not None:
            self._tell_looks(time, looks)

    def _define(self) -> Any:  # noqa: ANN401 - pxr has no types
        """The mesh, when its first frame comes."""
        geom = pxr().UsdGeom
        self._mesh = geom.Mesh.Define(self.stage, f"{self.path}/mesh")
        self._mesh.CreateSubdivisionSchemeAttr(geom.Tokens.none)
        self._mesh.CreateDoubleSidedAttr(True)
        return self._mesh

    def _tell_primvar(self, name: str, kind: str, per: str, values: Any, time: float) -> None:  # noqa: ANN401
        lib = pxr()
        primvars = lib.UsdGeom.PrimvarsAPI(self._mesh)
        primvars.CreatePrimvar(name, getattr(lib.Sdf.ValueTypeNames, kind), per).Set(values, time)

    def _tell_looks(self, time: float, looks: Looks) -> None:
        vt = pxr().Vt
        if looks.uv is not None:
            corners: Float32Array = np.ascontiguousarray(looks.uv.reshape(-1, 2))
            self._tell_primvar("st", "TexCoord2fArray", "faceVarying", vt.Vec2fArray.FromNumpy(corners), time)
        if looks.colours is not None:
            colours = vt.Vec3fArray.FromNumpy(looks.colours)
            self._tell_primvar("displayColor", "Color3fArray", "vertex", colours, time)
        seen = {_kind(m): (i, m) for i, m in enumerate(looks.materials) if (looks.material == i).any()}
        for kind in [kind for kind in self._surfaces if kind not in seen]:
            self._tell_faces(self._surfaces[kind], np.zeros(0, np.int64), time)
        for kind, (i, material) in seen.items():
            surface = self._surfaces[kind] if kind in self._surfaces else self._add_surface(material, time)
            self._tell_faces(surface, np.flatnonzero(looks.material == i), time)
            if surface.picture is not None and material.picture is not None:
                file = self.pictures_at + self.pictures.put(web_picture(material.picture))
                surface.picture.Set(pxr().Sdf.AssetPath(file), time)

    def _tell_faces(self, surface: _Surface, faces: IntArray, time: float) -> None:
        indices: NDArray[np.int32] = faces.astype(np.int32)
        surface.subset.GetIndicesAttr().Set(pxr().Vt.IntArray.FromNumpy(indices), time)

    def _add_surface(self, material: Material, time: float) -> _Surface:
        """A material that has not been seen before, bound to faces of its own."""
        lib = pxr()
        lib.UsdGeom.Scope.Define(self.stage, f"{self.path}/looks")
        name = identifier(material.name, {surface.prim.GetPrim().GetName() for surface in self._surfaces.values()})
        prim, picture = _define_material(self.stage, f"{self.path}/looks/{name}", material)
        binding = lib.UsdShade.MaterialBindingAPI.Apply(self._mesh.GetPrim())
        binding.SetMaterialBindSubsetsFamilyType(lib.UsdGeom.Tokens.nonOverlapping)
        subset = binding.CreateMaterialBindSubset(name, lib.Vt.IntArray())
        subset.GetIndicesAttr().Clear()
        for earlier in self._mesh.GetPointsAttr().GetTimeSamples():
            if earlier < time:
                subset.GetIndicesAttr().Set(lib.Vt.IntArray(), earlier)
        lib.UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(prim)
        self._surfaces[_kind(material)] = _Surface(prim, picture, subset)
        return self._surfaces[_kind(material)]


def _kind(material: Material) -> _Kind:
    """What makes two materials of two frames the same one."""
    return material.name, material.colour, material.picture is not None


def _same_size(a: Mesh, b: Mesh) -> bool:
    """Whether some array of two frames has the same length, so that a reader may interpolate it."""
    return len(a.vertices) == len(b.vertices) or len(a.faces) == len(b.faces)


def _define_material(stage: Any, path: str, material: Material) -> tuple[Any, Any]:  # noqa: ANN401 - pxr has no types
    """A preview surface, and the file input of its picture where it has one."""
    lib = pxr()
    kinds, shade = lib.Sdf.ValueTypeNames, lib.UsdShade
    made = shade.Material.Define(stage, path)
    shader = shade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    red, green, blue, opacity = material.colour
    colour = shader.CreateInput("diffuseColor", kinds.Color3f)
    shader.CreateInput("roughness", kinds.Float).Set(1.0)
    shader.CreateInput("metallic", kinds.Float).Set(0.0)
    shader.CreateInput("opacity", kinds.Float).Set(opacity)
    made.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    if material.picture is None:
        colour.Set(lib.Gf.Vec3f(red, green, blue))
        return made, None
    reader = shade.Shader.Define(stage, f"{path}/coordinates")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", kinds.String).Set("st")
    texture = shade.Shader.Define(stage, f"{path}/picture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("sourceColorSpace", kinds.Token).Set("sRGB")
    texture.CreateInput("wrapS", kinds.Token).Set("repeat")
    texture.CreateInput("wrapT", kinds.Token).Set("repeat")
    texture.CreateInput("scale", kinds.Float4).Set(lib.Gf.Vec4f(red, green, blue, 1.0))
    coordinates = reader.CreateOutput("result", kinds.Float2)
    texture.CreateInput("st", kinds.Float2).ConnectToSource(coordinates)
    colour.ConnectToSource(texture.CreateOutput("rgb", kinds.Float3))
    return made, texture.CreateInput("file", kinds.Asset)
