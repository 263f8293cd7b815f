"""Motions of any format as a body that moves, and back into the format that they came in."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mhvedit.avoidance.capsules import capsule_body
from mhvedit.avoidance.retarget import retargeted, shared_dofs, stature
from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.axes import METRES, from_metres_z_up
from mhvedit.sequences.guess import PEOPLE, guess_units, guess_up, said_of_units, said_of_up
from mhvedit.skeleton.bvh_motion import BvhTake, read_bvh_motion, write_bvh_motion
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.model import Motion, Skeleton
from mhvedit.skeleton.skin import SkinnedBody, read_skinned, write_skinned

FORMATS = ".npz or .bvh"
CAPSULES_APART = 4  # capsules round a bent trunk overlap where flesh would give way


@dataclass(frozen=True, slots=True, eq=False)
class OpenMotion:
    """A body, how it moves, and how to write another motion of it."""

    body: SkinnedBody
    motion: Motion
    suffix: str  # of the file that is written
    write: Callable[[Path, Motion], None]
    notes: tuple[str, ...] = ()
    nearest: int = 2  # limbs this many joints apart must not meet
    doubts: tuple[str, ...] = ()  # whether the file was read as it was meant, in sentences


def open_motion(path: Path, *, body: Path | None = None, units: str = "m", up: str = "z") -> OpenMotion:
    """Read a motion.

    Args:
        path: skinned `.npz`, or `.bvh`.
        body: skinned `.npz` whose body a `.bvh` is put on; capsules round its own bones by default.
        units: of a `.bvh`: m, cm or mm.
        up: axis of a `.bvh` that points up: x, y or z.

    Raises:
        CaptureError: the file cannot be used, or a body is given for a motion that has one.
    """
    match path.suffix.lower():
        case ".npz":
            if body is not None:
                raise CaptureError(path, "no --body for a skinned motion, which has its own", str(body))
            skinned = read_skinned(path)
            return OpenMotion(
                skinned.body, skinned.motion, ".npz", lambda out, motion: write_skinned(out, skinned, motion)
            )
        case ".bvh":
            return _open_bvh(path, body, units, up)
        case other:
            raise CaptureError(path, f"a motion ({FORMATS})", f"a {other or 'nameless'} file")


def _open_bvh(path: Path, body: Path | None, units: str, up: str) -> OpenMotion:
    """A BVH on capsules of its own, or on a skinned body."""
    take = read_bvh_motion(path, units=units, up=up)
    doubts = tuple(f"{path}: {sentence}" for sentence in _doubts(take))
    if body is None:
        own = capsule_body(take.skeleton)
        return OpenMotion(
            own,
            take.motion,
            ".bvh",
            lambda out, motion: write_bvh_motion(out, take, motion),
            take.notes,
            CAPSULES_APART,
            doubts,
        )
    other = read_skinned(body).body
    moved = retargeted(take.motion, take.skeleton, other.skeleton)
    return OpenMotion(
        other,
        moved,
        ".bvh",
        lambda out, motion: _write_back(out, take, other.skeleton, moved, motion),
        take.notes,
        doubts=doubts,
    )


def _doubts(take: BvhTake) -> tuple[str, ...]:
    """Whether units and up axis are those of a person, asked as of a capture; BVH itself says neither."""
    places = joint_frames(take.skeleton, take.motion.q)[1]
    height = float(np.median(np.ptp(places[..., 2], axis=1)))
    size = float(np.median(np.ptp(places, axis=1).max(1)))
    stored = from_metres_z_up(places, units=take.units, up=take.up)
    low, high = stored.min(1), stored.max(1)
    units, metres = guess_units(low, high), METRES[take.units]
    if units != take.units:
        return (said_of_units(height, size, likely=units, how=f"--units {units}"),)
    up = guess_up(low * metres, high * metres, read_as=take.up)
    if up != take.up:
        return (said_of_up(height, likely=up, how=f"--up {up}"),)
    if not PEOPLE[0] <= size <= PEOPLE[1]:
        return (
            f"{size:.3g} m long, and people are {PEOPLE[0]:g} to {PEOPLE[1]:g} m: are its units none of m, cm and mm?",
        )
    return ()


def _write_back(path: Path, take: BvhTake, target: Skeleton, before: Motion, after: Motion) -> None:
    """What changed on the body, on the file's own skeleton; steps of the root at its own scale."""
    here, there = shared_dofs(take.skeleton, target)
    change: FloatArray = np.zeros_like(take.motion.q)
    change[:, here] = (after.q - before.q)[:, there]
    change[:, take.skeleton.dof_slides] *= stature(take.skeleton) / stature(target)
    q = np.where(change == 0, take.motion.q, take.motion.q + change)
    write_bvh_motion(path, take, Motion(q, take.motion.fps))
