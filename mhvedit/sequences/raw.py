"""A mesh exactly as a file holds it, and the checks that every file has to pass."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import Int32Array, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class RawMesh:
    """One frame in the units and axes of its file; nothing merged, sorted or dropped."""

    vertices: NDArray[np.floating]  # (V, 3) float32 or float64, as stored
    faces: Int32Array  # (F, 3)
    labels: Int32Array | None = None  # (V,) integer property `part`


def triangulate(corners: NDArray[np.integer], sizes: NDArray[np.integer]) -> IntArray:
    """Cut polygons into fans around their first corner, in their order.

    Args:
        corners: (sum of sizes,) vertex indices of one polygon after the other.
        sizes: (P,) corners of each polygon, at least 3.

    Returns:
        (F, 3) triangles; those of one polygon follow each other.
    """
    whole: IntArray = corners.astype(np.int64, copy=False)
    if (sizes == 3).all():
        return whole.reshape(-1, 3)
    first = np.cumsum(sizes) - sizes
    per_polygon = sizes - 2
    start = np.repeat(first, per_polygon)
    step = np.arange(len(start)) - np.repeat(np.cumsum(per_polygon) - per_polygon, per_polygon)
    return np.stack([whole[start], whole[start + step + 1], whole[start + step + 2]], 1)


def checked_mesh(
    where: Path | str,
    vertices: NDArray[np.generic],
    faces: NDArray[np.integer],
    labels: NDArray[np.integer] | None = None,
) -> RawMesh:
    """A mesh that has finite vertices and faces that point at them.

    Args:
        where: file, or file and frame, for the message.
        vertices: (V, 3); float32 stays float32, everything else becomes float64.
        faces: (F, 3) indices.
        labels: (V,) or None.

    Raises:
        CaptureError: NaN or infinite vertices, no faces, or faces that name a vertex there is not.
    """
    kind = np.float32 if vertices.dtype == np.float32 else np.float64
    points: NDArray[Any] = np.ascontiguousarray(vertices, kind).reshape(-1, 3)
    finite = np.isfinite(points).all(1)
    if not finite.all():
        bad = int(np.argmin(finite))
        raise CaptureError(where, "finite vertices", f"{_plain(points[bad])} at vertex {bad} ({(~finite).sum()} such)")
    if not len(faces):
        raise CaptureError(where, "at least one face", f"{len(points)} vertices and no faces")
    low, high = int(faces.min()), int(faces.max())
    if low < 0 or high >= len(points):
        bad = int(np.argmax(((faces < 0) | (faces >= len(points))).any(1)))
        found = f"({', '.join(map(str, faces[bad]))}) in face {bad}"
        raise CaptureError(where, f"face indices from 0 to {len(points) - 1}", found)
    kept = None if labels is None else np.ascontiguousarray(labels, np.int32)
    return RawMesh(points, np.ascontiguousarray(faces, np.int32), kept)


def same_places(points: NDArray[np.floating]) -> tuple[IntArray, IntArray]:
    """Which points lie at exactly the same place.

    Args:
        points: (V, 3) finite.

    Returns:
        (P,) first point of each place, in order of first use, and (V,) place of each point.
    """
    bits = np.ascontiguousarray(points + points.dtype.type(0), np.float64).view(np.uint64)  # -0.0 becomes 0.0
    with np.errstate(over="ignore"):
        mixed = bits * np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
        keys = (mixed ^ (mixed >> np.uint64(29))).sum(1, dtype=np.uint64)
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    if not (points[first[inverse]] == points).all():  # two places share a key: sort by the bits themselves
        _, first, inverse = np.unique(bits, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return first[order], rank[inverse.reshape(-1)]


def _plain(point: NDArray[np.floating]) -> str:
    """Coordinates as a person writes them."""
    return "(" + ", ".join(f"{x:g}" for x in point) + ")"
