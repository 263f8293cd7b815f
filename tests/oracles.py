"""Brute force, written from `editing.md` with sets and loops: what the fast code must agree with, pose for pose."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product
from math import ceil, cos, floor, pi, sin, sqrt
from typing import TypeVar

import numpy as np

from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array

Voxel = tuple[int, int, int]
Shift = tuple[int, int]
Frames = Sequence[frozenset[Voxel]]  # the filled voxels of each frame
Moments = frozenset[int]
History = dict[Voxel, Moments]  # in which frames each voxel is filled
Depths = dict[Voxel, dict[int, float]]  # voxel -> frame -> depth in the solid, voxels
Cone = tuple[tuple[float, float, float], tuple[float, float, float], float]  # eye m, unit direction, half angle rad
T = TypeVar("T")

EXACT = 1e-9  # what floating point may miss
HALF = 0.5


# Solid meshes


def winding_numbers(points: FloatArray, vertices: FloatArray, faces: Int32Array) -> FloatArray:
    """Generalised winding number of a mesh about each point: the sum of signed solid angles over 4 pi."""
    total = np.zeros(len(points))
    for face in faces:
        a, b, c = (vertices[corner] - points for corner in face)
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        ab, bc, ca = ((u * v).sum(1) for u, v in ((a, b), (b, c), (c, a)))
        total += 2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return np.asarray(total / (4 * pi))


# Motion history volumes


def history_of(frames: Frames) -> History:
    """The whole set of frames of each voxel that is ever filled (eq. 2)."""
    return {p: frozenset(i for i, filled in enumerate(frames) if p in filled) for p in frozenset().union(*frames)}


@lru_cache(maxsize=1024)
def depth_map(filled: frozenset[Voxel]) -> dict[Voxel, float]:
    """How deep each filled voxel lies."""
    return {voxel: depth_in(filled, voxel) for voxel in filled}


def depth_in(filled: frozenset[Voxel], voxel: Voxel) -> float:
    """Distance to the nearest empty voxel, centre to centre, less half a voxel."""
    reach = 1
    while True:
        empty = [o for o in cube(reach) if _moved(voxel, o) not in filled]
        nearest = min((sqrt(x * x + y * y + z * z) for x, y, z in empty), default=float("inf"))
        if nearest <= reach:
            return nearest - HALF
        reach += 1


def depths_of(solid: Frames, chosen: Frames) -> Depths:
    """How deep the chosen voxels lie in the solid that they are cut from, frame by frame."""
    found: Depths = {}
    for frame, (filled, wanted) in enumerate(zip(solid, chosen, strict=True)):
        for voxel in filled & wanted:
            found.setdefault(voxel, {})[frame] = depth_map(filled)[voxel]
    return found


def deepest(volumes: Iterable[Depths]) -> Depths:
    """All voxels of several solids; the deeper one counts where they overlap."""
    found: Depths = {}
    for volume in volumes:
        for voxel, by_frame in volume.items():
            here = found.setdefault(voxel, {})
            for frame, depth in by_frame.items():
                here[frame] = max(depth, here.get(frame, depth))
    return found


def turned(cells: Mapping[Voxel, T], yaw: float) -> dict[Voxel, T]:
    """Lattice voxel p is B's iff round(R(-yaw) p) is, halves rounded up and z untouched."""
    c, s = cos(yaw), sin(yaw)
    columns: dict[Shift, list[int]] = {}
    for x, y, z in cells:
        columns.setdefault((x, y), []).append(z)
    reach = 2 + ceil(max((sqrt(x * x + y * y) for x, y in columns), default=0))
    found: dict[Voxel, T] = {}
    for x, y in product(range(-reach, reach + 1), repeat=2):
        u, v = floor(c * x + s * y + 0.5), floor(-s * x + c * y + 0.5)
        for z in columns.get((u, v), []):
            found[x, y, z] = cells[u, v, z]
    return found


# Segments


@dataclass(frozen=True)
class Person:
    """One subject in one segment: its solids, and its parts with the solid that each is cut from."""

    solids: Mapping[str, Frames]
    parts: Mapping[str, tuple[str, Frames]]

    def part(self, name: str) -> Depths:
        solid, frames = self.parts[name]
        return depths_of(self.solids[solid], frames)

    def rest(self, name: str) -> Depths:
        """All that is solid but a part."""
        cut_from, part = self.parts[name]
        kept = {key: list(frames) for key, frames in self.solids.items()}
        kept[cut_from] = [filled - gone for filled, gone in zip(kept[cut_from], part, strict=True)]
        return deepest(depths_of(self.solids[key], frames) for key, frames in kept.items())

    def everything(self) -> Depths:
        return deepest(depths_of(frames, frames) for frames in self.solids.values())


@dataclass(frozen=True)
class Segment:
    """All that a key segment asks; lengths in voxels."""

    a: Person
    b: Person
    interaction: str
    parts: tuple[str, str]
    tau: int
    frames: int = 0  # slack k
    voxels: float = 0.0  # slack r
    depth: float = 0.0
    overlap: float = 0.0
    apart: Sequence[tuple[str, str]] | None = None
    cones: tuple[Cone, Cone] | None = None
    pitch: float = 1.0  # m, for the cones
    seen: tuple[str, str] = field(default=("body", "body"))  # solids that the cones look for


def window_shifts(
    root_a: FloatArray, root_b: FloatArray, yaw: float, *, pitch: float, stride: int, window: float
) -> list[Shift]:
    """Every lattice shift, in steps, that puts B's root into the square around A's."""
    step = pitch * stride
    c, s = cos(yaw), sin(yaw)
    x = c * root_b[0] - s * root_b[1] - root_a[0]
    y = s * root_b[0] + c * root_b[1] - root_a[1]
    far = ceil((abs(x) + abs(y) + window) / step) + 2
    along_x = [i for i in range(-far, far + 1) if abs(x + i * step) <= window / 2 + EXACT]
    along_y = [j for j in range(-far, far + 1) if abs(y + j * step) <= window / 2 + EXACT]
    return list(product(along_x, along_y))


def reasons(segment: Segment, yaw: float, shifts: Iterable[Shift]) -> dict[Shift, str]:
    """What first rejects each pose of B (shift in voxels), or "accepted"."""
    s = segment
    touch = _interest(s.a, s.parts[0]), turned(_interest(s.b, s.parts[1]), yaw)
    near = neighbours(touch[0], s.voxels)
    forbidden = [(name, a, turned(b, yaw), limit) for name, a, b, limit in must_not_meet(s)]
    bodies = history_of(s.a.solids[s.seen[0]]), turned(history_of(s.b.solids[s.seen[1]]), yaw)
    found = {}
    for shift in shifts:
        found[shift] = (
            why_not_in_time(s, touch[0], moved(touch[1], shift), near)
            or next((name for name, a, b, limit in forbidden if sinks_in(a, moved(b, shift), limit)), "")
            or why_not_seen(s, bodies[0], moved(bodies[1], shift), shift, yaw)
            or "accepted"
        )
    return found


def _interest(person: Person, name: str) -> History:
    return history_of(person.parts[name][1])


def moved(cells: Mapping[Voxel, T], shift: Shift) -> dict[Voxel, T]:
    return {(x + shift[0], y + shift[1], z): value for (x, y, z), value in cells.items()}


def neighbours(cells: Iterable[Voxel], radius: float) -> dict[Voxel, list[Voxel]]:
    """For every lattice voxel the given ones that lie within a radius of it, centre to centre."""
    offsets = [o for o in cube(floor(radius)) if sum(v * v for v in o) <= radius**2 + EXACT]
    found: dict[Voxel, list[Voxel]] = {}
    for voxel in cells:
        for offset in offsets:
            found.setdefault(_moved(voxel, offset), []).append(voxel)
    return found


def cube(reach: int) -> list[Voxel]:
    """All lattice offsets of at most so many voxels along each axis."""
    span = range(-reach, reach + 1)
    return list(product(span, span, span))


def _moved(voxel: Voxel, offset: Voxel) -> Voxel:
    return voxel[0] + offset[0], voxel[1] + offset[1], voxel[2] + offset[2]


# The dictionary (eqs 3 to 11)


def why_not_in_time(s: Segment, a: History, b: History, near: Mapping[Voxel, Sequence[Voxel]]) -> str:
    """The first condition of the type that fails: on some pair within r voxels, and on all shared voxels."""
    if s.interaction == "none":
        return ""
    pairs = [(a[p], b[q]) for q in b for p in near.get(q, ())]
    shared = [(a[p], b[p]) for p in b if p in a]
    if not pairs:
        return "no contact"
    if s.interaction == "0&0a":
        return "" if held_throughout(pairs, s.tau, s.frames) else "contact is lost in some frame"
    if s.interaction == "0&0b":
        return "" if any(at_a & at_b for at_a, at_b in pairs) else "never in contact at the same moment"
    if s.interaction == "0&0c":
        return "" if passes(pairs, shared, s.frames) else "neither passes strictly after the other"
    if not any(at_right_moment(s.interaction, pair, s.tau, s.frames) for pair in pairs):
        return "no contact at the right moment"
    if not all(at_right_moment(s.interaction, pair, s.tau, s.frames) for pair in shared):
        return "contact at a wrong moment"
    return ""


def at_right_moment(interaction: str, pair: tuple[Moments, Moments], tau: int, k: int) -> bool:
    """Eqs 4 and 8 to 11 on a pair of voxels: `+` asks for t_end = T_end, `-` for t_start = T_start, with slack."""
    signs = interaction.split("&")
    return all(
        {"+": max(at) >= tau - 1 - k, "-": min(at) <= k, "0": True}[sign] for sign, at in zip(signs, pair, strict=True)
    )


def held_throughout(pairs: Sequence[tuple[Moments, Moments]], tau: int, k: int) -> bool:
    """Eq. 5; the first and last k frames are excused, but never all of them."""
    excused = max(j for j in range(k + 1) if tau - 2 * j >= 1)
    return all(any(i in a and i in b for a, b in pairs) for i in range(excused, tau - excused))


def passes(pairs: Sequence[tuple[Moments, Moments]], shared: Sequence[tuple[Moments, Moments]], k: int) -> bool:
    """Eq. 7: one order for all contact voxels; it may overlap by k."""
    a_later = any(min(a) + k > max(b) for a, b in pairs) and all(min(a) + k > max(b) for a, b in shared)
    b_later = any(min(b) + k > max(a) for a, b in pairs) and all(min(b) + k > max(a) for a, b in shared)
    return a_later or b_later


# Fidelity (eq. 15)


def must_not_meet(s: Segment) -> list[tuple[str, Depths, Depths, float]]:
    """Volumes that share nothing deeper than a limit, in the order in which they are blamed."""
    found = []
    touching = s.interaction not in ("none", "0&0c")
    part_a, part_b = s.parts
    if touching:
        found.append(("contact sinks in too deep", s.a.part(part_a), s.b.part(part_b), max(s.depth, HALF)))
    if s.apart is not None:
        found += [("bodies meet", s.a.part(x), s.b.part(y), s.overlap) for x, y in s.apart]
    elif touching:
        found.append(("bodies meet", s.a.rest(part_a), s.b.everything(), s.overlap))
        found.append(("bodies meet", s.a.part(part_a), s.b.rest(part_b), s.overlap))
    else:
        found.append(("bodies meet", s.a.everything(), s.b.everything(), s.overlap))
    return found


def sinks_in(a: Depths, b: Depths, limit: float) -> bool:
    """Whether some voxel that both fill in one frame lies deeper than a limit in either."""
    return any(
        max(a[p][i], b[p][i]) > limit + EXACT for p in b if p in a for i in b[p] if i in a[p]
    )  # fmt: skip


# Visibility (eq. 14)


def why_not_seen(s: Segment, a: Iterable[Voxel], b: Iterable[Voxel], shift: Shift, yaw: float) -> str:
    """Each stands in the other's cone, whole bodies, voxel centre by voxel centre."""
    if s.cones is None:
        return ""
    cone_a, (eye, direction, half_angle) = s.cones
    if not in_cone(cone_a, b, s.pitch):
        return "B is out of A's sight"
    at = _turned_point(eye, yaw)
    eye = at[0] + shift[0] * s.pitch, at[1] + shift[1] * s.pitch, at[2]
    cone_b = eye, _turned_point(direction, yaw), half_angle
    return "" if in_cone(cone_b, a, s.pitch) else "A is out of B's sight"


def in_cone(cone: Cone, voxels: Iterable[Voxel], pitch: float) -> bool:
    (eye_x, eye_y, eye_z), (dx, dy, dz), half_angle = cone
    for i, j, k in voxels:
        x, y, z = i * pitch - eye_x, j * pitch - eye_y, k * pitch - eye_z
        if x * dx + y * dy + z * dz >= cos(half_angle) * sqrt(x * x + y * y + z * z):
            return True
    return False


def _turned_point(point: tuple[float, float, float], yaw: float) -> tuple[float, float, float]:
    c, s = cos(yaw), sin(yaw)
    return c * point[0] - s * point[1], s * point[0] + c * point[1], point[2]


# Solution groups


def flood_regions(accepted: BoolArray) -> list[set[Voxel]]:
    """Connected sets of cells (26 neighbours, yaw a circle), largest first, equals by first cell."""
    n_yaw = accepted.shape[2]
    left = {(int(i), int(j), int(k)) for i, j, k in np.argwhere(accepted)}
    found = []
    while left:
        region, fresh = set(), [min(left)]
        while fresh:
            i, j, k = fresh.pop()
            if (i, j, k) in left:
                left.remove((i, j, k))
                region.add((i, j, k))
                fresh += [(i + x, j + y, (k + z) % n_yaw) for x, y, z in product((-1, 0, 1), repeat=3)]
        found.append(region)
    return sorted(found, key=lambda region: (-len(region), min(region)))


def clearance(accepted: BoolArray, cell: Voxel, *, step: float, yaw_step: float) -> float:
    """Distance of a cell to the nearest that is not accepted, inside the map or around it; yaw is a circle."""
    n_x, n_y, n_yaw = accepted.shape
    nearest = float("inf")
    for i, j in product(range(-1, n_x + 1), range(-1, n_y + 1)):
        for k in range(n_yaw):
            if 0 <= i < n_x and 0 <= j < n_y and accepted[i, j, k]:
                continue
            around = min((k - cell[2]) % n_yaw, (cell[2] - k) % n_yaw)
            flat = ((i - cell[0]) * step) ** 2 + ((j - cell[1]) * step) ** 2
            nearest = min(nearest, sqrt(flat + (around * yaw_step) ** 2))
    return nearest
