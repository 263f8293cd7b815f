"""Looks of Wavefront OBJ: texture coordinates, vertex colours, and the materials of its .mtl files."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import IntArray
from mhvedit.sequences.looks import Float32Array, Looks, Material, Picture, linear_from_srgb
from mhvedit.sequences.raw import triangulate

_PICTURES: Final = ("map_", "bump", "disp", "decal", "refl", "norm")  # statements that end in a file's name


def obj_looks(data: bytes, path: Path) -> Looks | None:
    """Read `vt`, `usemtl` and `mtllib` of an OBJ file; triangles come as `parse_obj` cuts them.

    Args:
        data: the whole file.
        path: where it came from; material libraries are looked for beside it.

    Raises:
        CaptureError: a texture index that points nowhere.
    """
    text = re.sub(r"\\\n", " ", data.decode("utf-8", "replace").replace("\r\n", "\n").replace("\r", "\n"))
    if "vt" not in text and "usemtl" not in text and "mtllib" not in text:
        return _only_colours(text)
    faces, coordinates, seen = list[str](), list[str](), list[int]()
    used, libraries, names, current = list[int](), list[str](), dict[str, int](), -1
    for line in text.split("\n"):
        words = line.split(None, 1)
        match words:
            case ["f", rest]:
                faces.append(rest.split("#")[0])
                seen.append(len(coordinates))
                used.append(current)
            case ["vt", rest]:
                coordinates.append(rest)
            case ["usemtl", rest]:
                current = names.setdefault(rest.strip(), len(names))
            case ["mtllib", rest]:
                libraries.append(rest.split("#")[0].strip())
    found, missing = _libraries(libraries, path.parent)
    sizes = np.array([len(face.split()) for face in faces], np.int64)
    materials = tuple(found.get(name, Material(name)) for name in names)
    uv = _uv(faces, sizes, coordinates, np.array(seen, np.int64), path)
    material = np.repeat(np.array(used, np.int32), sizes - 2)
    return Looks(materials, material, uv, _colours(text), tuple(missing))


def _only_colours(text: str) -> Looks | None:
    """Of a file without pictures and materials."""
    colours = _colours(text)
    if colours is None:
        return None
    n_faces = sum(len(line.split("#")[0].split()) - 3 for line in re.findall(r"(?m)^\s*f\s.*$", text))
    return Looks((), np.full(n_faces, -1, np.int32), None, colours)


def _colours(text: str) -> Float32Array | None:
    """(V, 3) where every vertex has a colour behind its position."""
    first = re.search(r"(?m)^\s*v\s+([^#\n]*)", text)
    if first is None or len(first[1].split()) != 6:
        return None
    rows = [line.split("#")[0].split()[1:] for line in re.findall(r"(?m)^\s*v\s.*$", text)]
    if any(len(row) != 6 for row in rows):
        return None
    return linear_from_srgb(np.array(rows, np.float64)[:, 3:])


def _uv(faces: list[str], sizes: IntArray, coordinates: list[str], seen: IntArray, path: Path) -> Float32Array | None:
    """(F, 3, 2) of the triangles; (0, 0) at corners without any, None where no corner has any."""
    index = _second_indices(faces)
    if not coordinates or not index.any():
        return None
    table = np.array([line.split("#")[0].split()[:2] for line in coordinates], np.float32)
    place = np.where(index < 0, np.repeat(seen, sizes) + index, index - 1)
    wrong = (index != 0) & ((place < 0) | (place >= len(table)))
    if wrong.any():
        raise CaptureError(path, f"texture indices up to {len(table)}", str(index[wrong][0]))
    corners = np.where((index == 0)[:, None], np.float32(0), table[np.where(index == 0, 0, place)])
    return np.asarray(corners[triangulate(np.arange(len(index)), sizes)], np.float32)


def _second_indices(faces: list[str]) -> IntArray:
    """Texture index of every corner as written; 0 for none."""
    corners = " ".join(faces).split()
    whole = " ".join(corners)
    width = corners[0].count("/") + 1 if corners else 1
    if width > 1 and "//" not in whole and whole.count("/") == (width - 1) * len(corners):
        plain = np.array(whole.replace("/", " ").split(), np.int64).reshape(-1, width)
        return np.asarray(plain[:, 1])
    parts = (corner.split("/") for corner in corners)
    return np.array([int(p[1]) if len(p) > 1 and p[1] else 0 for p in parts], np.int64)


def _libraries(names: list[str], folder: Path) -> tuple[dict[str, Material], list[Path]]:
    """Materials by name, and what is not there."""
    found, missing = dict[str, Material](), list[Path]()
    for name in dict.fromkeys(names):
        whole = folder / name.replace("\\", "/")
        for file in [whole] if whole.is_file() else [folder / word for word in name.replace("\\", "/").split()]:
            if file.is_file():
                found |= _library(file, missing)
            else:
                missing.append(file)
    return found, missing


def _library(file: Path, missing: list[Path]) -> dict[str, Material]:
    """The materials of one .mtl file."""
    found, name = dict[str, Material](), ""
    for line in file.read_text("utf-8", "replace").splitlines():
        words = line.split("#")[0].split(None, 1)
        if len(words) == 2 and words[0] == "newmtl":
            name = words[1].strip()
            found[name] = Material(name)
        elif len(words) == 2 and name:
            found[name] = _with_statement(found[name], words[0], words[1].strip(), file.parent, missing)
    return found


def _with_statement(material: Material, key: str, value: str, folder: Path, missing: list[Path]) -> Material:
    """The material with one more line of its library."""
    red, green, blue, opacity = material.colour
    numbers = value.split()
    if key.lower().startswith(_PICTURES):
        options, file = _picture_file(value, folder)
        if not file.is_file():
            missing.append(file)
            return material
        picture = Picture(file.name, file.read_bytes())
        if key == "map_Kd" and not options:
            return replace(material, picture=picture, colour=(1.0, 1.0, 1.0, opacity))
        return replace(material, maps=(*material.maps, (f"{key} {options}".strip(), picture)))
    if key == "Kd" and len(numbers) >= 3:
        if material.picture is None:
            red, green, blue = (float(x) for x in numbers[:3])
        return replace(material, colour=(red, green, blue, opacity))
    if key in ("d", "Tr") and len(numbers) == 1:
        opacity = float(value) if key == "d" else 1.0 - float(value)
        return replace(material, colour=(red, green, blue, opacity))
    return replace(material, statements=(*material.statements, f"{key} {value}"))


def _picture_file(value: str, folder: Path) -> tuple[str, Path]:
    """Options, and the file: all of the rest if there is such a file, or else the last word."""
    whole = folder / value.replace("\\", "/")
    if whole.is_file() or not value.startswith("-"):
        return "", whole
    options, _, last = value.rpartition(" ")
    return options, folder / last.replace("\\", "/")
