"""`postures.npz`: the body of `mhvedit avoid` as captured and as edited, and how deep its limbs are, for looking at."""

from dataclasses import dataclass, fields
from enum import IntEnum
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mhvedit.avoidance.methods import touched_frames
from mhvedit.collision.detect import TOLERANCE, CollisionBody, Depths
from mhvedit.errors import CaptureError, ShapeError
from mhvedit.files import UNREADABLE, found_instead, load_npz, write_arrays
from mhvedit.geometry.arrays import BoolArray, FloatArray, Int32Array, IntArray
from mhvedit.geometry.offsets import offset_of, without_offset
from mhvedit.pipeline.avoid_report import Findings
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.skin import skin_into, sparse_weights

POSTURES: Final = "postures.npz"
MM: Final = 1000.0  # in a metre
Float32Array = NDArray[np.float32]


class Take(IntEnum):
    """Which of the two motions."""

    CAPTURED = 0
    EDITED = 1


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """One body, with its equipment, in two motions."""

    vertices: FloatArray  # (V, 3) m, at rest
    faces: Int32Array  # (F, 3)
    limb: IntArray  # (F,) that each triangle belongs to
    limb_names: NDArray[np.str_]  # (L,)
    rest: FloatArray  # (J, 3) m, joints at rest
    weight_start: IntArray  # (V + 1,) see `sparse_weights`
    weight_joint: IntArray  # (N,)
    weight: FloatArray  # (N,)
    rotations: Float32Array  # (2, T, J, 3, 3) world_from_joint, by `Take`
    positions: Float32Array  # (2, T, J, 3) m, without whole metres in plan where the motion is far from the origin
    depth: Float32Array  # (2, T, L) mm, how much deeper than at rest each limb is in another
    touched: BoolArray  # (T,) frames that were edited
    fps: FloatArray  # () Hz
    limit: FloatArray  # () mm, a depth from which on limbs collide

    def __post_init__(self) -> None:
        n_frames, n_joints = len(self.touched), len(self.rest)
        expected = {
            "rotations": (2, n_frames, n_joints, 3, 3),
            "positions": (2, n_frames, n_joints, 3),
            "depth": (2, n_frames, len(self.limb_names)),
            "limb": (len(self.faces),),
            "weight_start": (len(self.vertices) + 1,),
            "weight_joint": (len(self.weight),),
        }
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise ShapeError(name, getattr(self, name).shape, shape)
        most = {"faces": len(self.vertices), "limb": len(self.limb_names), "weight_joint": n_joints}
        for name, number in most.items():
            ids = getattr(self, name)
            if ids.min(initial=0) < 0 or ids.max(initial=0) >= number:
                raise ShapeError(name, f"{ids.min()} to {ids.max()}", f"0 to {number - 1}")
        if n_frames == 0 or self.weight_start[-1] != len(self.weight):
            raise ShapeError("postures", f"{n_frames} frames, {len(self.weight)} weights", "frames, and all weights")

    @property
    def n_frames(self) -> int:
        """T."""
        return len(self.touched)

    @property
    def deepest(self) -> Float32Array:
        """(2, T) mm, of all limbs."""
        return np.asarray(self.depth.max(2, initial=0.0))


def postures_of(found: Findings) -> Postures:
    """What is kept of a motion that was edited."""
    body, captured, edited = found.body, found.problem.captured, found.avoided.motion
    frames = [joint_frames(body.body.skeleton, motion.q) for motion in (captured, edited)]
    positions = np.stack([positions for _, positions in frames])
    offset = offset_of(positions[Take.CAPTURED, 0])
    limb = np.empty(len(body.body.faces), np.int64)
    limb[body.limbs.face_ids] = np.repeat(np.arange(body.limbs.n_limbs), np.diff(body.limbs.arrays.face_start))
    return Postures(
        body.body.vertices,
        body.body.faces,
        limb,
        np.array(body.limbs.names),
        body.body.skeleton.rest_positions,
        *sparse_weights(body.body.weights),
        np.stack([rotations for rotations, _ in frames]).astype(np.float32),
        without_offset(positions, offset).astype(np.float32),
        np.stack([_depth_of_limbs(body, depths) for depths in found.depths]),
        touched_frames(captured, edited),
        np.array(float(captured.fps)),
        np.array(MM * TOLERANCE),
    )


def _depth_of_limbs(body: CollisionBody, depths: Depths) -> Float32Array:
    """(T, L) mm, of the deepest pair that a limb is one of."""
    beyond = MM * (depths.depth - body.rest_depth).clip(0.0)
    out = np.zeros((len(beyond), body.limbs.n_limbs), np.float32)
    for pair, limbs in enumerate(body.pairs.limbs):
        for limb in limbs:
            np.maximum(out[:, limb], beyond[:, pair], out=out[:, limb])
    return out


def posed(postures: Postures, take: Take, frame: int) -> FloatArray:
    """(V, 3) m, the body in a frame of one of its motions."""
    out = np.empty_like(postures.vertices)
    skin_into(
        postures.vertices,
        postures.rest,
        postures.weight_start,
        postures.weight_joint,
        postures.weight,
        postures.rotations[take, frame].astype(np.float64),
        postures.positions[take, frame].astype(np.float64),
        out,
    )
    return out


def write_postures(path: Path, postures: Postures) -> None:
    """Write them into an `.npz`; replaced as a whole or not at all."""
    write_arrays(path, {field.name: getattr(postures, field.name) for field in fields(Postures)})


def read_postures(path: Path) -> Postures:
    """What `write_postures` wrote.

    Raises:
        CaptureError: the file is not there, or damaged.
    """
    try:
        return Postures(**load_npz(path, *(field.name for field in fields(Postures))))
    except UNREADABLE as fault:
        raise CaptureError(
            path, "the postures of a motion; `mhvedit avoid` writes them", found_instead(fault)
        ) from fault
