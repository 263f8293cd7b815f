"""Signed distance of a blend of round shapes, evaluated where it matters.

A shape is one row of a table: origin (3), rotation row by row (9), length, two radii, three scales, blend, operation.
Rows act in their order, so that what is carved stays carved until something later is added there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from .vectors import Floats, frame_along, vec

ADD, CARVE = 0.0, 1.0
CONE, BALL = 0.0, 1.0
BLOCK = 4
ROW = 20

Counts = npt.NDArray[np.int64]

_compile: Callable[..., Any] = numba.njit(cache=True)


def cone(
    start: Floats,
    stop: Floats,
    radii: tuple[float, float],
    *,
    blend: float = 0.02,
    scale: tuple[float, float] = (1.0, 1.0),
    side: Floats | None = None,
    carve: bool = False,
) -> Floats:
    """A round cone between two points, optionally flattened across its axis.

    Args:
        start: (3,) m.
        stop: (3,) m.
        radii: m, at the two ends.
        blend: m, width over which it melts into what is there.
        scale: factors along `side` and along the direction square to both.
        side: (3,) direction; any by default.
        carve: take away instead of adding.
    """
    axis = stop - start
    length = float(np.sqrt(axis @ axis))
    rotation = frame_along(axis if length > 1e-9 else vec(0, 0, 1), vec(1, 0, 0.01) if side is None else side)
    return _row(start, rotation, length, radii, (*scale, 1.0), blend, carve, CONE)


def ball(
    centre: Floats, rotation: Floats, radii: tuple[float, float, float], *, blend: float = 0.02, carve: bool = False
) -> Floats:
    """An ellipsoid with its radii (m) along the columns of `rotation`."""
    return _row(centre, rotation, 0.0, (1.0, 1.0), radii, blend, carve, BALL)


def _row(
    origin: Floats,
    rotation: Floats,
    length: float,
    radii: tuple[float, float],
    scale: tuple[float, float, float],
    blend: float,
    carve: bool,
    kind: float,
) -> Floats:
    """One line of the shape table."""
    tail = [length, *radii, *scale, blend, (CARVE if carve else ADD) + 2.0 * kind]
    return np.concatenate([origin, rotation.ravel(), tail])


def _distance_to(shape: Floats, x: float, y: float, z: float) -> float:
    """Signed distance to one shape, exact or a little too small."""
    px, py, pz = x - shape[0], y - shape[1], z - shape[2]
    u = shape[3] * px + shape[6] * py + shape[9] * pz
    v = shape[4] * px + shape[7] * py + shape[10] * pz
    w = shape[5] * px + shape[8] * py + shape[11] * pz
    sx, sy, sz = shape[15], shape[16], shape[17]
    if shape[19] >= 2.0:
        k0 = np.sqrt((u / sx) ** 2 + (v / sy) ** 2 + (w / sz) ** 2)
        k1 = np.sqrt((u / sx**2) ** 2 + (v / sy**2) ** 2 + (w / sz**2) ** 2)
        distance: float = -min(sx, sy, sz) if k1 < 1e-9 else k0 * (k0 - 1.0) / k1
        return distance
    length, r0, r1 = shape[12], shape[13], shape[14]
    rho = np.sqrt((u / sx) ** 2 + (v / sy) ** 2)
    slope = (r0 - r1) / max(length, 1e-9)
    slope = min(max(slope, -0.999), 0.999)
    rise = np.sqrt(1.0 - slope * slope)
    along = w * rise - rho * slope
    if along < 0.0:
        d = np.sqrt(rho * rho + w * w) - r0
    elif along > length * rise:
        d = np.sqrt(rho * rho + (w - length) ** 2) - r1
    else:
        d = rho * rise + w * slope - r0
    nearest: float = d * min(sx, sy, 1.0)
    return nearest


_one: Any = _compile(_distance_to)


def _merge_shape(d: float, other: float, blend: float, operation: float) -> float:
    """Adds a shape's distance to what is there, or carves it out, smoothly."""
    if operation == 1.0 or operation == 3.0:
        h = max(blend - abs(d + other), 0.0) / blend
        return max(d, -other) + 0.25 * blend * h * h
    h = max(blend - abs(d - other), 0.0) / blend
    return min(d, other) - 0.25 * blend * h * h


_merge: Any = _compile(_merge_shape)


def _blend_at(shapes: Floats, chosen: Counts, count: int, x: float, y: float, z: float) -> float:
    """Signed distance of the whole blend at one point, above the floor."""
    d = 1e3
    for c in range(count):
        shape = shapes[chosen[c]]
        d = _merge(d, _one(shape, x, y, z), shape[18], shape[19])
    return max(d, -z)


_blend: Any = _compile(_blend_at)


def _choose_shapes(shapes: Floats, x: float, y: float, z: float, radius: float, chosen: Counts, around: Floats) -> int:
    """Which shapes can matter within `radius` of a point."""
    nearest = 1e3
    for s in range(len(shapes)):
        around[s] = _one(shapes[s], x, y, z)
        if shapes[s, 19] == 0.0 or shapes[s, 19] == 2.0:
            nearest = min(nearest, around[s])
    count = 0
    for s in range(len(shapes)):
        if around[s] < max(nearest, 0.0) + 3.0 * radius + shapes[s, 18]:
            chosen[count] = s
            count += 1
    return count


_choose: Any = _compile(_choose_shapes)


def _at_points(shapes: Floats, points: Floats) -> Floats:
    """The field at each point; a shape whose bounding sphere is too far to matter is skipped."""
    out = np.empty(len(points))
    bounds = np.empty((len(shapes), 5))
    for s in range(len(shapes)):
        shape, half = shapes[s], 0.5 * shapes[s, 12]
        small, large = min(shape[15], shape[16], shape[17]), max(shape[15], shape[16], shape[17])
        bounds[s, 0] = shape[0] + shape[5] * half
        bounds[s, 1] = shape[1] + shape[8] * half
        bounds[s, 2] = shape[2] + shape[11] * half
        bounds[s, 3] = half + max(shape[13], shape[14]) * large
        bounds[s, 4] = 1.0 if shape[19] >= 2.0 else min(small, 1.0)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        d = 1e3
        for s in range(len(shapes)):
            dx, dy, dz = x - bounds[s, 0], y - bounds[s, 1], z - bounds[s, 2]
            least = (np.sqrt(dx * dx + dy * dy + dz * dz) - bounds[s, 3]) * bounds[s, 4]
            if least < abs(d) + shapes[s, 18]:
                d = _merge(d, _one(shapes[s], x, y, z), shapes[s, 18], shapes[s, 19])
        out[i] = max(d, -z)
    return out


_points: Any = _compile(_at_points)


def _fill_block(
    shapes: Floats, chosen: Counts, count: int, rotation: Floats, origin: Floats, pitch: float, low: Counts, out: Floats
) -> None:
    """The field at the lattice points of one block."""
    for i in range(low[0], min(low[0] + BLOCK, out.shape[0])):
        for j in range(low[1], min(low[1] + BLOCK, out.shape[1])):
            for k in range(low[2], min(low[2] + BLOCK, out.shape[2])):
                p = origin + rotation @ np.array([i * pitch, j * pitch, k * pitch])
                out[i, j, k] = _blend(shapes, chosen, count, p[0], p[1], p[2])


_fill: Any = _compile(_fill_block)


def _on_lattice(shapes: Floats, rotation: Floats, origin: Floats, pitch: float, out: Floats) -> None:
    """The field on a turned lattice; far from the surface only its sign is right."""
    radius = 0.5 * (BLOCK - 1) * pitch * np.sqrt(3.0)
    chosen = np.empty(len(shapes), np.int64)
    around = np.empty(len(shapes))
    half = 0.5 * (BLOCK - 1)
    for i in range(0, out.shape[0], BLOCK):
        for j in range(0, out.shape[1], BLOCK):
            for k in range(0, out.shape[2], BLOCK):
                c = origin + rotation @ (np.array([i + half, j + half, k + half]) * pitch)
                count = _choose(shapes, c[0], c[1], c[2], radius, chosen, around)
                d = _blend(shapes, chosen, count, c[0], c[1], c[2])
                if abs(d) < 2.0 * radius + pitch:
                    _fill(shapes, chosen, count, rotation, origin, pitch, np.array([i, j, k]), out)
                else:
                    out[i : i + BLOCK, j : j + BLOCK, k : k + BLOCK] = d


_lattice: Any = _compile(_on_lattice)


def field_at(shapes: Floats, points: Floats) -> Floats:
    """Signed distance (N,) m, negative inside, of the blend `shapes` (S, 20) at `points` (N, 3) m."""
    return np.asarray(_points(shapes, np.ascontiguousarray(points)), dtype=np.float64)


def field_on_lattice(
    shapes: Floats, rotation: Floats, origin: Floats, *, pitch: float, counts: tuple[int, int, int]
) -> Floats:
    """The same at origin + rotation @ (i, j, k) * pitch; where the surface is far only the sign is meant."""
    out = np.empty(counts)
    _lattice(np.ascontiguousarray(shapes), np.ascontiguousarray(rotation), origin, pitch, out)
    return out
