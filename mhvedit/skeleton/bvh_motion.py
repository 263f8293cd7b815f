"""BVH in and out as a skeleton and its motion (B8.6): any channel order, units and axes handled at the door.

Joints with three rotations turn in the order of the tables inside and in the order of their channels in the file;
those with fewer only turn about the axes that they have. Frames whose posture does not change are written as they
were, letter by letter.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.errors import CaptureError, ShapeError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.axes import check_axes, from_metres_z_up, to_metres_z_up
from mhvedit.skeleton.bvh import local_frames
from mhvedit.skeleton.bvh_text import BvhJoint, BvhText, read_bvh_text, write_bvh_text
from mhvedit.skeleton.dofs import body_skeleton, dofs_from_local_frames, euler_angles, nearest_solution
from mhvedit.skeleton.forward import joint_frames
from mhvedit.skeleton.model import Motion, Skeleton

SHORT: Final = 1e-6  # m: a bone without length
_AXES: Final = {"x": ("z", "y", "-x"), "y": ("x", "z", "-y"), "z": ("x", "y", "z")}  # of the file, by its up axis


@dataclass(frozen=True, slots=True, eq=False)
class BvhTake:
    """A BVH file as a motion, and the file for writing it back."""

    skeleton: Skeleton  # end sites are joints called `<joint>_end`
    motion: Motion
    text: BvhText
    units: str
    up: str
    notes: tuple[str, ...]  # what is unusual and no error


def read_bvh_motion(path: Path | str, *, units: str = "m", up: str = "z") -> BvhTake:
    """Read a BVH file as a skeleton and its motion.

    Args:
        path: the .bvh file.
        units: m, cm or mm of offsets and positions; BVH itself does not say.
        up: x, y or z: the axis that points up; BVH itself does not say.

    Raises:
        CaptureError: naming the line, what was expected and what is there.
    """
    check_axes(units, up)
    text = read_bvh_text(path)
    turns, places = local_frames(text)
    into = _into_z_up(up)
    turns, places = into @ turns @ into.T, to_metres_z_up(places, units=units, up=up)
    skeleton = _skeleton(path, text, places, units, up)
    q = dofs_from_local_frames(skeleton, turns, places)
    for joint, node in enumerate(text.joints):
        columns = _rotation_columns(text, joint)
        if len(columns) in (1, 2):
            q[:, (skeleton.dof_joint == joint) & ~skeleton.dof_slides] = np.radians(text.values[:, columns])
        elif len(columns) not in (0, 3):
            raise CaptureError(f"{path}: line {node.line}", "at most 3 rotations", f"{len(columns)} for {node.name}")
    return BvhTake(skeleton, Motion(q, text.fps), text, units, up, _notes(skeleton, text))


def write_bvh_motion(path: Path | str, take: BvhTake, motion: Motion) -> None:
    """Write another motion of the same skeleton into a copy of the file; written beside, then renamed.

    Args:
        path: to write.
        take: what was read.
        motion: of its skeleton; any number of frames.
    """
    write_bvh_text(path, _with_motion(take, motion))


def bvh_of(skeleton: Skeleton, motion: Motion, *, units: str = "m", up: str = "z") -> BvhTake:
    """A new BVH file for a motion of any skeleton: its root has six channels, other joints three or none.

    Raises:
        ShapeError: a joint other than the root slides.
    """
    check_axes(units, up)
    sliding = skeleton.dof_joint[skeleton.dof_slides]
    if (sliding > 0).any():
        raise ShapeError("skeleton", f"{skeleton.names[int(sliding.max())]} slides", "no slides but the root's")
    offsets = from_metres_z_up(skeleton.offsets, units=units, up=up)
    joints, head = list[BvhJoint](), ["HIERARCHY"]
    _describe(skeleton, offsets, joints, head)
    width = sum(len(joint.channels or ()) for joint in joints)
    order = [skeleton.names.index(joint.name) for joint in joints]
    text = BvhText((*head, "MOTION"), tuple(joints), f"{1.0 / motion.fps:.7g}", (), np.zeros((0, width)))
    renumbered = _reordered(skeleton, order)
    take = BvhTake(renumbered, Motion(np.zeros((0, skeleton.n_dofs)), motion.fps), text, units, up, ())
    dofs = np.concatenate([np.flatnonzero(skeleton.dof_joint == joint) for joint in order])
    moved = Motion(motion.q[:, dofs], motion.fps)
    return replace(take, motion=moved, text=_with_motion(take, moved))


def _skeleton(path: Path | str, text: BvhText, places: FloatArray, units: str, up: str) -> Skeleton:
    """The skeleton with the DOFs that the channels allow."""
    roots = [joint for joint in text.joints if joint.parent < 0]
    if len(roots) > 1:
        raise CaptureError(f"{path}: line {roots[1].line}", "one ROOT", f"another, {roots[1].name}")
    offsets = to_metres_z_up(np.array([joint.offset for joint in text.joints]), units=units, up=up)
    turning, sliding = {}, []
    for joint, node in enumerate(text.joints):
        names = [channel for channel in node.channels or () if channel.endswith("rotation")]
        if names:
            axes = [_AXES[up]["XYZ".index(name[0])] for name in names]
            turning[node.name] = None if len(names) == 3 else axes
        moves = any(channel.endswith("position") for channel in node.channels or ())
        if moves and (joint == 0 or np.abs(places[:, joint] - offsets[joint]).max() > SHORT):
            sliding.append(node.name)
    parents = np.array([joint.parent for joint in text.joints])
    return body_skeleton(tuple(joint.name for joint in text.joints), parents, offsets, turning=turning, sliding=sliding)


def _notes(skeleton: Skeleton, text: BvhText) -> tuple[str, ...]:
    """Bones without length."""
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    return tuple(
        f"line {node.line}: the bone to {node.name} has no length"
        for joint, node in enumerate(text.joints)
        if joint > 0 and node.channels and lengths[joint] < SHORT
    )


def _with_motion(take: BvhTake, motion: Motion) -> BvhText:
    """The file with other lines of motion where the posture changed."""
    text = take.text
    n_old = min(motion.n_frames, take.motion.n_frames, len(text.rows))
    same = np.zeros(motion.n_frames, np.bool_)
    same[:n_old] = (motion.q[:n_old] == take.motion.q[:n_old]).all(1)
    values = _channel_values(take, motion)
    for frame in np.flatnonzero(~same):
        before = text.values[frame] if frame < n_old else values[frame - 1] if frame > 0 else None
        if before is not None:
            values[frame] = _near(text, values[frame], before)
    rows = tuple(
        text.rows[t] if same[t] else " ".join(f"{value:.6f}" for value in values[t]) for t in range(motion.n_frames)
    )
    seconds = text.seconds if motion.fps == text.fps else f"{1.0 / motion.fps:.7g}"
    return replace(text, rows=rows, values=values, seconds=seconds)


def _channel_values(take: BvhTake, motion: Motion) -> FloatArray:
    """(T, C) all channels of a motion, in the file's units and degrees."""
    skeleton, text = take.skeleton, take.text
    rotations, positions = joint_frames(skeleton, motion.q)
    back = _into_z_up(take.up).T
    values, at = np.zeros((motion.n_frames, sum(len(j.channels or ()) for j in text.joints))), 0
    for joint, node in enumerate(text.joints):
        channels, up = node.channels or (), node.parent
        turn, place = rotations[:, joint], positions[:, joint]
        if up >= 0:
            down = np.swapaxes(rotations[:, up], 1, 2)
            turn, place = down @ turn, (down @ (place - positions[:, up])[..., None])[..., 0]
        places = from_metres_z_up(place, units=take.units, up=take.up)
        for c, channel in enumerate(channels):
            if channel.endswith("position"):
                values[:, at + c] = places[:, "XYZ".index(channel[0])]
        columns = [at + c for c, channel in enumerate(channels) if channel.endswith("rotation")]
        if len(columns) == 3:
            order = "".join(channel[0] for channel in channels if channel.endswith("rotation")).lower()
            values[:, columns] = np.degrees(euler_angles(back @ turn @ back.T, order))
        elif columns:
            mine = (skeleton.dof_joint == joint) & ~skeleton.dof_slides
            values[:, columns] = np.degrees(motion.q[:, mine])
        at += len(channels)
    return values


def _near(text: BvhText, values: FloatArray, before: FloatArray) -> FloatArray:
    """The same posture with each joint's angles as near to those of another line as can be."""
    out = values.copy()
    for joint in range(len(text.joints)):
        columns = _rotation_columns(text, joint)
        if len(columns) == 3:
            out[columns] = np.degrees(nearest_solution(np.radians(values[columns]), np.radians(before[columns])))
    return out


def _rotation_columns(text: BvhText, joint: int) -> list[int]:
    """Columns of a joint's rotations."""
    at = sum(len(node.channels or ()) for node in text.joints[:joint])
    return [at + c for c, name in enumerate(text.joints[joint].channels or ()) if name.endswith("rotation")]


def _into_z_up(up: str) -> FloatArray:
    """(3, 3) z_up_from_file."""
    return to_metres_z_up(np.eye(3), units="m", up=up).T


def _describe(skeleton: Skeleton, offsets: FloatArray, joints: list[BvhJoint], head: list[str]) -> None:
    """Append all joints, depth first, and the lines that say so."""
    waiting: list[tuple[int, int, int]] = [(0, -1, 0)]  # joint or -1 for a closing brace, parent's number, depth
    while waiting:
        joint, up, depth = waiting.pop()
        pad = "  " * depth
        if joint < 0:
            head.append(f"{pad}}}")
            continue
        children = np.flatnonzero(skeleton.parents == joint)
        turns = bool(((skeleton.dof_joint == joint) & ~skeleton.dof_slides).any())
        name = skeleton.names[joint]
        is_end = joint > 0 and not len(children) and not turns and name == f"{joints[up].name}_end"
        spot = ("Xposition", "Yposition", "Zposition") if joint == 0 else ()
        channels = () if is_end else (*spot, "Zrotation", "Yrotation", "Xrotation")
        head.append(f"{pad}End Site" if is_end else f"{pad}{'ROOT' if joint == 0 else 'JOINT'} {name}")
        head.append(f"{pad}{{")
        head.append(f"{pad}  OFFSET " + " ".join(f"{x:.6f}" for x in offsets[joint]))
        if not is_end:
            head.append(f"{pad}  CHANNELS {len(channels)} " + " ".join(channels))
        joints.append(BvhJoint(name, up, len(head) - 2, tuple(offsets[joint]), channels))
        waiting.append((-1, 0, depth))
        waiting += [(int(child), len(joints) - 1, depth + 1) for child in children[::-1]]


def _reordered(skeleton: Skeleton, order: list[int]) -> Skeleton:
    """The same skeleton with its joints in another order, parents first."""
    number = {old: new for new, old in enumerate(order)} | {-1: -1}
    dofs = np.concatenate([np.flatnonzero(skeleton.dof_joint == joint) for joint in order])
    return Skeleton(
        tuple(skeleton.names[joint] for joint in order),
        np.array([number[int(skeleton.parents[joint])] for joint in order]),
        skeleton.offsets[order],
        np.array([number[int(joint)] for joint in skeleton.dof_joint[dofs]], np.int64),
        skeleton.dof_axis[dofs],
        skeleton.dof_slides[dofs],
        skeleton.limits[dofs],
        tuple(skeleton.dof_names[dof] for dof in dofs),
    )
