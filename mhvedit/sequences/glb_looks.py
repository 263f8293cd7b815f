"""Looks of binary glTF: texture coordinates, vertex colours, materials with their base colour pictures."""

import base64
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
from numpy.typing import NDArray

from mhvedit.sequences.glb import DRACO, Json, placed_meshes, read_accessor, read_chunks, read_primitive
from mhvedit.sequences.looks import WHITE, Float32Array, Looks, Material, Picture, picture_name


def glb_looks(data: bytes, path: Path) -> Looks | None:
    """Read texture coordinates, colours and materials of all triangles, in the order of `parse_glb`.

    Args:
        data: the whole file.
        path: where it came from; pictures of their own are looked for beside it.
    """
    head, binary = read_chunks(data, path)
    missing = list[Path]()
    materials = tuple(_material(head, binary, i, path, missing) for i in range(len(head.get("materials", []))))
    which, uvs, colours = list[NDArray[np.int32]](), list[Float32Array | None](), list[Float32Array | None]()
    for matrix, mesh in placed_meshes(head):
        for primitive in head["meshes"][mesh]["primitives"]:
            points, triangles = read_primitive(head, binary, primitive)
            triangles = triangles[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else triangles
            uv, colour = _attributes(head, binary, primitive)
            which.append(np.full(len(triangles), primitive.get("material", -1), np.int32))
            uvs.append(None if uv is None else _upwards(uv)[triangles])
            colours.append(None if colour is None or len(colour) != len(points) else colour)
    if not materials and not any(x is not None for x in (*uvs, *colours)):
        return None
    whole = [np.zeros((len(w), 3, 2), np.float32) if uv is None else uv for w, uv in zip(which, uvs, strict=True)]
    painted = [c for c in colours if c is not None]
    return Looks(
        materials,
        np.concatenate(which),
        np.concatenate(whole) if any(uv is not None for uv in uvs) else None,
        np.concatenate(painted) if len(painted) == len(colours) else None,
        tuple(missing),
    )


def _attributes(head: Json, binary: bytes, primitive: Json) -> tuple[Float32Array | None, Float32Array | None]:
    """(V, 2) texture coordinates as stored and (V, 3) linear colours of one primitive."""
    if DRACO in primitive.get("extensions", {}):
        view = head["bufferViews"][primitive["extensions"][DRACO]["bufferView"]]
        start = view.get("byteOffset", 0)
        mesh = DracoPy.decode(binary[start : start + view["byteLength"]])
        uv = getattr(mesh, "tex_coord", None)
        return (None if uv is None or not len(uv) else np.asarray(uv, np.float32).reshape(-1, 2)), None
    found = {
        name: np.asarray(read_accessor(head, binary, primitive["attributes"][name]), np.float32)
        for name in ("TEXCOORD_0", "COLOR_0")
        if name in primitive["attributes"]
    }
    colour = found.get("COLOR_0")
    return found.get("TEXCOORD_0"), None if colour is None else np.ascontiguousarray(colour[:, :3])


def _upwards(uv: Float32Array) -> Float32Array:
    """Texture coordinates that count from the lower edge; glTF counts from the upper."""
    return np.stack([uv[:, 0], 1 - uv[:, 1]], 1)


def _material(head: Json, binary: bytes, index: int, path: Path, missing: list[Path]) -> Material:
    """Base colour and its picture."""
    stored = head["materials"][index]
    surface = stored.get("pbrMetallicRoughness", {})
    red, green, blue, opacity = surface.get("baseColorFactor", WHITE)
    picture = None
    if "baseColorTexture" in surface:
        texture = head["textures"][surface["baseColorTexture"]["index"]]
        if "source" in texture:
            picture = _picture(head["images"][texture["source"]], head, binary, path, missing)
    opacity = 1.0 if stored.get("alphaMode", "OPAQUE") == "OPAQUE" else opacity
    return Material(stored.get("name") or f"material_{index}", (red, green, blue, opacity), picture)


def _picture(image: Json, head: Json, binary: bytes, path: Path, missing: list[Path]) -> Picture | None:
    """An image of a buffer view, a data URI or a file."""
    within = _picture_within(image, head, binary, path)
    if within is not None:
        return within
    file = path.parent / image.get("uri", "")
    if not file.is_file():
        missing.append(file)
        return None
    return Picture(file.name, file.read_bytes())


def _picture_within(image: Json, head: Json, binary: bytes, path: Path) -> Picture | None:
    """An image of a buffer view or a data URI; None if it is a file."""
    name, uri = image.get("name") or f"{path.stem}_picture", image.get("uri", "")
    if "bufferView" in image:
        view: dict[str, Any] = head["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        content, mime = binary[start : start + view["byteLength"]], image.get("mimeType", "")
    elif uri.startswith("data:"):
        content, mime = base64.b64decode(uri.partition(",")[2]), uri[5:].partition(";")[0]
    else:
        return None
    return Picture(picture_name(name, content, mime=mime), content)


def glb_pictures(path: Path) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """Names of the pictures within a .glb and files that it names and that exist; and what of these is not there."""
    head, binary = read_chunks(path.read_bytes(), path)
    pictures, missing = list[Path](), list[Path]()
    for i, image in enumerate(head.get("images", [])):
        try:
            within = _picture_within(image, head, binary, path)
            file = path.parent / image.get("uri", "") if within is None else Path(within.name)
            (pictures if within is not None or file.is_file() else missing).append(file)
        except (LookupError, TypeError, ValueError, AttributeError):
            missing.append(path.with_name(f"{path.name}: image {i}"))
    return tuple(pictures), tuple(missing)
