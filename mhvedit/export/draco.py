"""Draco compression of one mesh, and what a decoder will make of it."""

from dataclasses import dataclass
from typing import Any, Final

import DracoPy
import numpy as np
from numpy.typing import NDArray

from mhvedit.geometry.arrays import IntArray
from mhvedit.sequences.looks import Float32Array

BITS: Final = 14  # of a coordinate, over the longest side of the mesh
UV_BITS: Final = 12
_COLOURS: Final = 7  # number of the attribute that holds them, which is of no type of its own
_NAMES: Final = {0: "POSITION", 3: "TEXCOORD_0", 4: "COLOR_0"}  # by Draco's attribute types


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """A compressed mesh."""

    data: bytes
    ids: dict[str, int]  # Draco's number of each glTF attribute
    attributes: dict[str, NDArray[Any]]  # (V, width) as a decoder gives them
    indices: NDArray[np.uint32]  # (3 F,)


def packed_mesh(points: Float32Array, faces: IntArray, uv: Float32Array | None, colours: Float32Array | None) -> Packed:
    """Compress a mesh; vertices are reordered, and doubled where surfaces only touch.

    Args:
        points: (V, 3).
        faces: (F, 3).
        uv: (V, 2) or None.
        colours: (V, 3) or None; kept exactly.
    """
    data = DracoPy.encode(
        points,
        faces.astype(np.uint32),
        quantization_bits=BITS,
        tex_coord=None if uv is None else uv.astype(np.float64),
        tex_coord_quantization_bits=None if uv is None else UV_BITS,
        generic_attributes=None if colours is None else {_COLOURS: np.ascontiguousarray(colours)},
    )
    mesh = DracoPy.decode(data)
    found = {_NAMES[a["attribute_type"]]: a for a in mesh.attributes}
    return Packed(
        data,
        {name: int(a["unique_id"]) for name, a in found.items()},
        {name: np.asarray(a["data"], np.float32).reshape(-1, int(a["num_components"])) for name, a in found.items()},
        np.asarray(mesh.faces, np.uint32).reshape(-1),
    )
