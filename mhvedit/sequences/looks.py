"""What a captured frame looks like: texture coordinates, colours, materials; read only when somebody asks for it.

Meshes are read without any of this (`read.open_capture`); an exporter that wants it asks `frame_looks`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mhvedit.errors import CaptureError, ShapeError
from mhvedit.geometry.arrays import Int32Array

Float32Array = NDArray[np.float32]
WHITE: Final = (1.0, 1.0, 1.0, 1.0)
WEB_SUFFIXES: Final = {b"\x89PNG": ".png", b"\xff\xd8\xff": ".jpg"}
MIME_SUFFIXES: Final = {"image/png": ".png", "image/jpeg": ".jpg", "image/webp": ".webp", "image/ktx2": ".ktx2"}


@dataclass(frozen=True, slots=True)
class Picture:
    """An image file."""

    name: str  # of the file
    data: bytes


@dataclass(frozen=True, slots=True)
class Material:
    """What a surface is made of, as far as all formats can say it."""

    name: str
    colour: tuple[float, float, float, float] = WHITE  # linear red, green, blue and opacity; multiplies the picture
    picture: Picture | None = None  # of the surface's colour
    statements: tuple[str, ...] = ()  # other lines of its .mtl, as they stand there
    maps: tuple[tuple[str, Picture], ...] = ()  # other pictures of its .mtl, behind the line up to the file's name


@dataclass(frozen=True, slots=True, eq=False)
class Looks:
    """The looks of one frame; vertices and faces are those of its `Mesh`."""

    materials: tuple[Material, ...]
    material: Int32Array  # (F,) index into materials; -1 for none
    uv: Float32Array | None = None  # (F, 3, 2) of each corner, (0, 0) is the picture's lower left
    colours: Float32Array | None = None  # (V, 3) linear red, green, blue
    missing: tuple[Path, ...] = ()  # files that the capture names and that are not there

    def __post_init__(self) -> None:
        if self.uv is not None and self.uv.shape != (len(self.material), 3, 2):
            raise ShapeError("uv", self.uv.shape, (len(self.material), 3, 2))


LooksReader = Callable[[bytes, Path], Looks | None]


def read_looks(file: Path, readers: dict[str, LooksReader]) -> Looks | None:
    """What one mesh file looks like, or None if it says nothing about that.

    Args:
        file: of one frame.
        readers: by extension.

    Raises:
        CaptureError: whatever is wrong with the file, in one sentence.
    """
    reader = readers.get(file.suffix.lower())
    if reader is None:
        return None
    try:
        return reader(file.read_bytes(), file)
    except (CaptureError, MemoryError):
        raise
    except OSError as error:
        raise CaptureError(file, "a file that can be read", str(error.strerror)) from error
    except Exception as error:  # a parser may fail in any way on a damaged file
        found = " ".join(f"{type(error).__name__}: {error}".split())
        raise CaptureError(file, "readable texture coordinates and materials", found) from error


def web_picture(picture: Picture) -> Picture:
    """The same picture as PNG or JPEG, which every program reads; others become PNG.

    Raises:
        CaptureError: not a picture.
    """
    for start, suffix in WEB_SUFFIXES.items():
        if picture.data.startswith(start):
            return Picture(Path(picture.name).stem + suffix, picture.data)
    try:
        with Image.open(BytesIO(picture.data)) as image:
            made = BytesIO()
            image.convert("RGBA" if "A" in image.getbands() else "RGB").save(made, "PNG")
    except Exception as error:  # whatever a damaged picture makes of the decoder
        raise CaptureError(picture.name, "a picture", f"{type(error).__name__}: {error}") from error
    return Picture(Path(picture.name).stem + ".png", made.getvalue())


def picture_name(name: str, data: bytes, *, mime: str = "") -> str:
    """The name with the ending that the content, or else its stated type, asks for; as it is where neither says.

    Args:
        name: of a picture that was no file.
        data: its content.
        mime: its type, where it is stated.
    """
    suffix = next(
        (ending for start, ending in WEB_SUFFIXES.items() if data.startswith(start)), MIME_SUFFIXES.get(mime, "")
    )
    there = Path(name).suffix.lower().replace(".jpeg", ".jpg")
    return name if there == suffix else name + suffix


def linear_from_srgb(values: NDArray[np.floating]) -> Float32Array:
    """Light of colour values, both 0 .. 1."""
    values = np.asarray(values, np.float64)
    return np.asarray(np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4), np.float32)


def srgb_from_linear(light: NDArray[np.floating]) -> Float32Array:
    """Colour values of light, both 0 .. 1."""
    light = np.clip(np.asarray(light, np.float64), 0.0, 1.0)
    return np.asarray(np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055), np.float32)
