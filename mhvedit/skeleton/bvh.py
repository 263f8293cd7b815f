"""BVH motion capture: any channel order, any units, to global joint positions by forward kinematics."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.axes import check_axes, to_metres_z_up
from mhvedit.sequences.meshes import JointTracks
from mhvedit.skeleton.bvh_text import BvhJoint, BvhText, read_bvh_text


@dataclass(frozen=True, slots=True, eq=False)
class BvhMotion:
    """The joints of a BVH file in every frame; bone j goes from joint `parents[j]` to joint j."""

    tracks: JointTracks  # frames 0 .. T-1; m, z up; end sites are called `<joint>_end`
    parents: tuple[int, ...]  # (J,) parent joint, -1 for a root; always before the joint itself
    fps: float  # Hz


def read_bvh(path: Path | str, *, units: str = "m", up: str = "z") -> BvhMotion:
    """Read a BVH file and place all its joints.

    Rotations are applied in the order in which the channels are listed (R = R1 R2 R3, columns). Position channels
    stand in place of the joint's offset, axis by axis, as most programs write and read them.

    Args:
        path: the .bvh file.
        units: m, cm or mm of offsets and positions; BVH itself does not say.
        up: x, y or z: the axis that points up; BVH itself does not say.

    Raises:
        CaptureError: naming the line, what was expected and what is there.
    """
    check_axes(units, up)
    text = read_bvh_text(path)
    placed = to_metres_z_up(_global_frames(text)[1], units=units, up=up)
    tracks = JointTracks(np.arange(len(placed)), tuple(joint.name for joint in text.joints), placed)
    return BvhMotion(tracks, tuple(joint.parent for joint in text.joints), text.fps)


@dataclass(frozen=True, slots=True, eq=False)
class JointMotion:
    """The frame of one joint through a motion: p_world = rotations @ p_joint + positions."""

    rotations: FloatArray  # (T, 3, 3)
    positions: FloatArray  # (T, 3) m, z up
    fps: float  # Hz


def read_joint_motion(path: Path | str, *, joint: str | None = None, units: str = "m", up: str = "z") -> JointMotion:
    """Read how one joint of a BVH file moves and turns.

    Args:
        path: the .bvh file.
        joint: its name; None for the root.
        units: m, cm or mm of offsets and positions.
        up: x, y or z: the axis that points up. The joint's own axes are brought to z up likewise.

    Raises:
        CaptureError: naming the line, what was expected and what is there; or there is no such joint.
    """
    check_axes(units, up)
    text = read_bvh_text(path)
    names = [each.name for each in text.joints]
    if joint is not None and joint not in names:
        raise CaptureError(path, f"a joint {joint!r}", f"{', '.join(names)}")
    j = 0 if joint is None else names.index(joint)
    turns, places = _global_frames(text)
    axes = to_metres_z_up(np.eye(3), units="m", up=up).T  # z-up from the file's axes
    return JointMotion(axes @ turns[:, j] @ axes.T, to_metres_z_up(places[:, j], units=units, up=up), text.fps)


def _global_frames(text: BvhText) -> tuple[FloatArray, FloatArray]:
    """Rotations (T, J, 3, 3) and positions (T, J, 3) in the axes and units of the file."""
    turns, places = local_frames(text)
    positions = places.copy()
    for j, joint in enumerate(text.joints):
        if joint.parent >= 0:
            up = joint.parent
            positions[:, j] = positions[:, up] + (turns[:, up] @ places[:, j, :, None])[..., 0]
            turns[:, j] = turns[:, up] @ turns[:, j]
    return turns, positions


def local_frames(text: BvhText) -> tuple[FloatArray, FloatArray]:
    """Rotations (T, J, 3, 3) and positions (T, J, 3) of joints in their parents, in the file's axes and units."""
    n, at = len(text.values), 0
    turns, places = np.empty((n, len(text.joints), 3, 3)), np.empty((n, len(text.joints), 3))
    for j, joint in enumerate(text.joints):
        width = len(joint.channels or ())
        places[:, j], turns[:, j] = _local_motion(joint, text.values[:, at : at + width])
        at += width
    return turns, places


def _local_motion(joint: BvhJoint, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(T, 3) position and (T, 3, 3) rotation of a joint in its parent."""
    position = np.tile(np.array(joint.offset), (len(values), 1))
    turn = np.broadcast_to(np.eye(3), (len(values), 3, 3))
    for name, value in zip(joint.channels or (), values.T, strict=True):
        axis = "XYZ".index(name[0])
        if name.endswith("position"):
            position[:, axis] = value
        else:
            turn = turn @ _about(axis, np.radians(value))
    return position, np.asarray(turn)


def _about(axis: int, angle: FloatArray) -> FloatArray:
    """(T, 3, 3) rotations about a coordinate axis."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.zeros((len(angle), 3, 3))
    i, k = (axis + 1) % 3, (axis + 2) % 3
    turn[:, axis, axis] = 1.0
    turn[:, i, i] = turn[:, k, k] = c
    turn[:, i, k], turn[:, k, i] = -s, s
    return turn
