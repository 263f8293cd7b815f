"""A skinned body and its motion: the `.npz` of rest mesh, weights and joint frames, read, posed and written.

A posed vertex is sum_j w_j (R_j (v - rest_j) + p_j), with the weights exactly as the file has them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mhvedit.errors import CaptureError, ShapeError
from mhvedit.files import UNREADABLE, found_instead, load_npz, replacing
from mhvedit.geometry.arrays import FloatArray, Int32Array, IntArray
from mhvedit.skeleton.dofs import body_skeleton, dofs_from_frames
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.model import Motion, Skeleton

STILL: Final = 1e-4  # rad: what turns less in the whole motion does not turn
BONE_SLACK: Final = 1e-3  # m: how much bones may change their length
_SHAPES: Final = {
    "vertices": ("V", 3),
    "faces": ("F", 3),
    "weights": ("V", "J"),
    "joints": ("J",),
    "parents": ("J",),
    "rest": ("J", 3),
    "rotations": ("T", "J", 4),
    "positions": ("T", "J", 3),
    "fps": (),
}


@dataclass(frozen=True, slots=True, eq=False)
class SkinnedBody:
    """A mesh that follows a skeleton."""

    skeleton: Skeleton
    vertices: FloatArray  # (V, 3) m, where q = 0 and the root stands at its rest position
    faces: Int32Array  # (F, 3)
    weights: FloatArray  # (V, J) sums near 1

    def __post_init__(self) -> None:
        expected = (len(self.vertices), self.skeleton.n_joints)
        if self.weights.shape != expected:
            raise ShapeError("weights", self.weights.shape, expected)


@dataclass(frozen=True, slots=True, eq=False)
class SkinnedMotion:
    """What a skinned `.npz` holds: a body, how it moves, and the arrays of the file for writing them back."""

    body: SkinnedBody
    motion: Motion
    stored: Mapping[str, NDArray[Any]]  # as in the file, never written to


def read_skinned(path: Path | str) -> SkinnedMotion:
    """Read a skinned motion.

    Joints turn if they carry weight or turn somewhere in the motion; the root slides too.

    Args:
        path: `.npz` with vertices, faces, weights, joints, parents, rest, rotations, positions and fps.

    Raises:
        CaptureError: naming the array or the frame, what was expected and what is there.
    """
    path = Path(path)
    stored = _load(path)
    rotations = Rotation.from_quat(stored["rotations"].reshape(-1, 4).astype(np.float64)).as_matrix()
    rotations = rotations.reshape(*stored["rotations"].shape[:2], 3, 3)
    positions = stored["positions"].astype(np.float64)
    weights = stored["weights"].astype(np.float64)
    skeleton = _skeleton(path, stored, rotations, weights)
    q = dofs_from_frames(skeleton, rotations, positions)
    _check_bones(path, skeleton, q, positions)
    body = SkinnedBody(skeleton, stored["vertices"].astype(np.float64), stored["faces"].astype(np.int32), weights)
    return SkinnedMotion(body, Motion(q, float(stored["fps"])), stored)


def write_skinned(path: Path | str, skinned: SkinnedMotion, motion: Motion) -> None:
    """Write a skinned body with another motion, in the format it was read in; written beside, then renamed.

    Frames whose posture is that of the file are written as they were, to the last bit.

    Args:
        path: to write.
        skinned: what was read.
        motion: as many frames as it had, or another number.
    """
    arrays: dict[str, Any] = {**skinned.stored, **_stored_frames(skinned, motion)}
    with replacing(Path(path)) as beside, beside.open("wb") as file:
        np.savez_compressed(file, **arrays)


def posed_vertices(body: SkinnedBody, q: FloatArray) -> FloatArray:
    """The mesh in one or more postures.

    Args:
        body: the skinned body.
        q: (..., D) rad or m.

    Returns:
        (..., V, 3) m.
    """
    rotations, positions = joint_frames(body.skeleton, q)
    return skinned_vertices(body, rotations, positions)


def skinned_vertices(body: SkinnedBody, rotations: FloatArray, positions: FloatArray) -> FloatArray:
    """The mesh where its joint frames are given.

    Args:
        body: the skinned body.
        rotations: (..., J, 3, 3) world_from_joint.
        positions: (..., J, 3) m.

    Returns:
        (..., V, 3) m.
    """
    n = body.skeleton.n_joints
    turns, places = rotations.reshape(-1, n, 3, 3), positions.reshape(-1, n, 3)
    vertices = np.empty((len(turns), len(body.vertices), 3))
    start, joint, weight = sparse_weights(body.weights)
    rest = body.skeleton.rest_positions
    for i in range(len(turns)):
        skin_into(body.vertices, rest, start, joint, weight, turns[i], places[i], vertices[i])
    return vertices.reshape(*positions.shape[:-2], -1, 3)


def sparse_weights(weights: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Weights that are not 0, vertex by vertex.

    Args:
        weights: (V, J).

    Returns:
        start (V + 1,), joint (N,) and weight (N,): those of vertex v are start[v] to start[v + 1].
    """
    vertex, joint = np.nonzero(weights)
    start = np.searchsorted(vertex, np.arange(len(weights) + 1))
    return start.astype(np.int64), joint.astype(np.int64), np.ascontiguousarray(weights[vertex, joint])


@njit(cache=True, nogil=True, error_model="numpy")
def skin_into(
    vertices: FloatArray,
    rest: FloatArray,
    start: IntArray,
    joint: IntArray,
    weight: FloatArray,
    rotations: FloatArray,
    positions: FloatArray,
    out: FloatArray,
) -> None:
    """(V, 3) vertices of one posture."""
    n = rest.shape[0]
    shift = np.empty((n, 3))
    for j in range(n):
        for r in range(3):
            turned = 0.0
            for c in range(3):
                turned += rotations[j, r, c] * rest[j, c]
            shift[j, r] = positions[j, r] - turned
    for v in range(vertices.shape[0]):
        x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        a, b, d = 0.0, 0.0, 0.0
        for k in range(start[v], start[v + 1]):
            j, w = joint[k], weight[k]
            a += w * (rotations[j, 0, 0] * x + rotations[j, 0, 1] * y + rotations[j, 0, 2] * z + shift[j, 0])
            b += w * (rotations[j, 1, 0] * x + rotations[j, 1, 1] * y + rotations[j, 1, 2] * z + shift[j, 1])
            d += w * (rotations[j, 2, 0] * x + rotations[j, 2, 1] * y + rotations[j, 2, 2] * z + shift[j, 2])
        out[v, 0], out[v, 1], out[v, 2] = a, b, d


def _load(path: Path) -> dict[str, NDArray[Any]]:
    """All arrays of the file, checked."""
    try:
        arrays = load_npz(path)
    except UNREADABLE as error:
        raise CaptureError(path, "a skinned motion (.npz)", found_instead(error)) from error
    missing = [name for name in _SHAPES if name not in arrays]
    if missing:
        raise CaptureError(path, "arrays " + ", ".join(_SHAPES), f"no {', '.join(missing)}")
    _check_shapes(path, arrays)
    _check_values(path, arrays)
    return arrays


def _check_shapes(path: Path, arrays: dict[str, NDArray[Any]]) -> None:
    """Refuse arrays that do not fit each other."""
    sizes: dict[str, int] = {}
    for name, shape in _SHAPES.items():
        got = arrays[name].shape
        expected = tuple(sizes.get(s, s) if isinstance(s, str) else s for s in shape)
        if len(got) != len(shape) or any(isinstance(e, int) and e != g for e, g in zip(expected, got, strict=True)):
            raise CaptureError(path, f"{name} of shape ({', '.join(map(str, expected))})", f"{got}")
        sizes |= {s: g for s, g in zip(shape, got, strict=True) if isinstance(s, str)}
        if 0 in got:
            raise CaptureError(path, f"{name} that are not empty", f"shape {got}")


def _check_values(path: Path, arrays: dict[str, NDArray[Any]]) -> None:
    """Refuse numbers that cannot be."""
    for name in ("vertices", "weights", "rest", "rotations", "positions"):
        finite = np.isfinite(arrays[name])
        if not finite.all():
            where = " ".join(map(str, np.argwhere(~finite)[0]))
            raise CaptureError(path, f"finite {name}", f"{arrays[name][~finite][0]} at index {where}")
    faces, n = arrays["faces"], len(arrays["vertices"])
    if faces.min() < 0 or faces.max() >= n:
        raise CaptureError(path, f"face indices from 0 to {n - 1}", f"{faces.min()} to {faces.max()}")
    lengths = np.linalg.norm(arrays["rotations"].astype(np.float64), axis=-1)
    if not np.allclose(lengths, 1.0, atol=1e-3):
        frame, joint = np.argwhere(~np.isclose(lengths, 1.0, atol=1e-3))[0]
        raise CaptureError(path, "unit quaternions", f"length {lengths[frame, joint]:.4g} in frame {frame}")
    sums = arrays["weights"].astype(np.float64).sum(1)
    if arrays["weights"].min() < 0 or not np.allclose(sums, 1.0, atol=0.01):
        bad = int(np.argmax(np.abs(sums - 1.0)))
        raise CaptureError(path, "weights of at least 0 that add up to 1", f"{sums[bad]:.4g} at vertex {bad}")
    if not 0 < float(arrays["fps"]) < np.inf:
        raise CaptureError(path, "a positive fps", f"{arrays['fps']}")


def _skeleton(path: Path, stored: dict[str, NDArray[Any]], rotations: FloatArray, weights: FloatArray) -> Skeleton:
    """The skeleton, with DOFs where something turns."""
    names = tuple(str(name) for name in stored["joints"])
    parents, rest = stored["parents"].astype(np.int64), stored["rest"].astype(np.float64)
    if parents[0] != -1 or (parents[1:] < 0).any() or (parents >= np.arange(len(parents))).any():
        raise CaptureError(path, "parents before their children, -1 for the first alone", f"{parents.tolist()}")
    offsets = rest - np.where(parents[:, None] >= 0, rest[parents], 0.0)
    local = rotations.copy()
    local[:, 1:] = np.swapaxes(rotations[:, parents[1:]], 2, 3) @ rotations[:, 1:]
    turns = np.abs(local - np.eye(3)).max((0, 2, 3)) > STILL
    carries = np.bincount(weights.argmax(1), minlength=len(names)) > 0
    turning = {name: None for name, yes in zip(names, turns | carries, strict=True) if yes}
    try:
        return body_skeleton(names, parents, offsets, turning=turning, sliding=names[:1])
    except ShapeError as error:
        raise CaptureError(path, str(error.expected), f"{error.name} {error.got}") from error


def _check_bones(path: Path, skeleton: Skeleton, q: FloatArray, positions: FloatArray) -> None:
    """Refuse motions in which bones change their length."""
    stretch = np.linalg.norm(joint_frames(skeleton, q)[1] - positions, axis=-1)
    if stretch.max() > BONE_SLACK:
        frame, joint = np.unravel_index(int(stretch.argmax()), stretch.shape)
        found = f"{skeleton.names[joint]} {stretch.max() * 1e3:.1f} mm off in frame {frame}"
        raise CaptureError(path, f"positions that follow from rest and rotations within {BONE_SLACK * 1e3:g} mm", found)


def _stored_frames(skinned: SkinnedMotion, motion: Motion) -> dict[str, NDArray[Any]]:
    """Rotations, positions and fps of a motion as the file has them; frames that did not change are copied."""
    stored = skinned.stored
    turns, places = joint_frames(skinned.body.skeleton, motion.q)
    quaternions = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_quat().reshape(*turns.shape[:2], 4)
    rotations = quaternions.astype(stored["rotations"].dtype)
    positions = places.astype(stored["positions"].dtype)
    n = min(motion.n_frames, skinned.motion.n_frames)
    same = np.flatnonzero((motion.q[:n] == skinned.motion.q[:n]).all(1))
    rotations[same], positions[same] = stored["rotations"][same], stored["positions"][same]
    fps = stored["fps"] if motion.fps == skinned.motion.fps else np.asarray(motion.fps, stored["fps"].dtype)
    return {"rotations": rotations, "positions": positions, "fps": fps}
