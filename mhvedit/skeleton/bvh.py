"""BVH motion capture: any channel order, any units, to global joint positions by forward kinematics."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.axes import check_axes, to_metres_z_up
from mhvedit.sequences.meshes import JointTracks

_CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")


@dataclass(frozen=True, slots=True, eq=False)
class BvhMotion:
    """The joints of a BVH file in every frame; bone j goes from joint `parents[j]` to joint j."""

    tracks: JointTracks  # frames 0 .. T-1; m, z up; end sites are called `<joint>_end`
    parents: tuple[int, ...]  # (J,) parent joint, -1 for a root; always before the joint itself
    fps: float  # Hz


@dataclass(frozen=True, slots=True)
class _Joint:
    """One joint as the hierarchy has it."""

    name: str
    parent: int
    line: int
    offset: tuple[float, ...] | None = None
    channels: tuple[str, ...] | None = None


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
    path = Path(path)
    check_axes(units, up)
    try:
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError as error:
        raise CaptureError(path, "a readable BVH file", str(error.strerror)) from error
    joints, motion = _hierarchy(path, lines)
    fps, values = _motion(path, lines, motion, sum(len(j.channels or ()) for j in joints))
    tracks = JointTracks(
        np.arange(len(values)),
        tuple(joint.name for joint in joints),
        to_metres_z_up(_global_positions(joints, values), units=units, up=up),
    )
    return BvhMotion(tracks, tuple(joint.parent for joint in joints), fps)


def _hierarchy(path: Path, lines: list[str]) -> tuple[list[_Joint], int]:
    """All joints and end sites, parents first, and the line after `MOTION`."""
    joints, open_joints = list[_Joint](), list[int]()
    for i, line in enumerate(lines):
        where = f"{path}: line {i + 1}"
        match line.split():
            case ["MOTION"]:
                _check_hierarchy(path, joints, open_joints, where)
                return joints, i + 1
            case [("ROOT" | "JOINT"), *words] if words:
                joints.append(_Joint(_free_name(where, joints, " ".join(words)), _last(open_joints), i + 1))
            case ["End", _] if open_joints:
                name = f"{joints[open_joints[-1]].name}_end"
                joints.append(_Joint(_free_name(where, joints, name), _last(open_joints), i + 1, None, ()))
            case ["{"] if joints:
                open_joints.append(len(joints) - 1)
            case ["}"] if open_joints:
                open_joints.pop()
            case ["OFFSET", *words] if open_joints:
                joints[open_joints[-1]] = _with_offset(joints[open_joints[-1]], where, words)
            case ["CHANNELS", count, *names] if open_joints:
                joints[open_joints[-1]] = _with_channels(joints[open_joints[-1]], where, count, names)
            case ["HIERARCHY"] | []:
                pass
            case _:
                raise CaptureError(where, "a line of a BVH hierarchy", repr(line.strip()[:60]))
    raise CaptureError(path, "a line MOTION", "the end of the file")


def _last(open_joints: list[int]) -> int:
    """The joint whose braces are open, or -1."""
    return open_joints[-1] if open_joints else -1


def _free_name(where: str, joints: list[_Joint], name: str) -> str:
    """The name, unless it is taken."""
    if any(joint.name == name for joint in joints):
        raise CaptureError(where, "each joint name once", f"{name} again")
    return name


def _with_offset(joint: _Joint, where: str, words: list[str]) -> _Joint:
    """The joint with its offset."""
    try:
        offset = tuple(map(float, words))
    except ValueError:
        offset = ()
    if len(offset) != 3 or not np.isfinite(offset).all():
        raise CaptureError(where, "OFFSET and three finite numbers", repr(" ".join(words)[:60]))
    return _Joint(joint.name, joint.parent, joint.line, offset, joint.channels)


def _with_channels(joint: _Joint, where: str, count: str, names: list[str]) -> _Joint:
    """The joint with its channels."""
    if count != str(len(names)) or not set(names) <= set(_CHANNELS) or len(set(names)) < len(names):
        found = repr(" ".join([count, *names])[:80])
        raise CaptureError(where, f"CHANNELS, their number, and that many of {' '.join(_CHANNELS)}", found)
    return _Joint(joint.name, joint.parent, joint.line, joint.offset, tuple(names))


def _check_hierarchy(path: Path, joints: list[_Joint], open_joints: list[int], where: str) -> None:
    """Refuse open braces and joints that lack something."""
    if open_joints or not joints:
        raise CaptureError(where, "a closed hierarchy before MOTION", f"{len(open_joints)} open braces")
    for joint in joints:
        if joint.offset is None or joint.channels is None:
            missing = "OFFSET" if joint.offset is None else "CHANNELS"
            raise CaptureError(f"{path}: line {joint.line}", f"{missing} for {joint.name}", "none")


def _motion(path: Path, lines: list[str], at: int, width: int) -> tuple[float, FloatArray]:
    """Frames a second and (T, width) channel values; `at` counts the lines before."""
    rows = [(i + 1, line.split()) for i, line in enumerate(lines[at:], at) if line.strip()]
    frames = _header_value(path, rows, 0, "Frames:")
    seconds = _header_value(path, rows, 1, "Frame Time:")
    body = rows[2:]
    if len(body) != int(frames):
        last = body[-1][0] if body else at
        raise CaptureError(f"{path}: line {last}", f"{int(frames)} lines of motion", f"{len(body)}")
    for line, words in body:
        if len(words) != width:
            raise CaptureError(f"{path}: line {line}", f"{width} channel values", f"{len(words)}")
    return _rate(seconds), _values(path, body)


def _rate(seconds: float) -> float:
    """Frames a second; a whole number where the frame time is one of 6 decimals (0.033333 is 30)."""
    whole = max(round(1.0 / seconds), 1)
    return float(whole) if abs(1.0 / whole - seconds) < 1e-6 else 1.0 / seconds


def _header_value(path: Path, rows: list[tuple[int, list[str]]], k: int, key: str) -> float:
    """The positive number behind `Frames:` or `Frame Time:`."""
    line, words = rows[k] if k < len(rows) else (rows[-1][0] if rows else 0, [])
    try:
        value = float(words[-1]) if " ".join(words[:-1]).replace(" :", ":") == key else 0.0
    except ValueError:
        value = 0.0
    if not 0 < value < np.inf or (key == "Frames:" and value != int(value)):
        raise CaptureError(f"{path}: line {line}", f"{key} and a positive number", repr(" ".join(words)[:60]))
    return value


def _values(path: Path, body: list[tuple[int, list[str]]]) -> FloatArray:
    """Channel values of all frames."""
    try:
        values = np.array([words for _, words in body], np.float64)
        finite = np.isfinite(values).all(1)
    except ValueError:
        finite = np.array([all(_is_finite(word) for word in words) for _, words in body])
        values = np.zeros((len(body), 0))
    if not finite.all():
        line, words = body[int(np.argmin(finite))]
        bad = next(word for word in words if not _is_finite(word))
        raise CaptureError(f"{path}: line {line}", "finite numbers", repr(bad[:40]))
    return values


def _is_finite(word: str) -> bool:
    """Whether a word is a finite number."""
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def _global_positions(joints: list[_Joint], values: FloatArray) -> FloatArray:
    """(T, J, 3) positions in the axes and units of the file."""
    n, at = len(values), 0
    positions = np.zeros((n, len(joints), 3))
    turns: list[FloatArray] = []  # world from joint
    for j, joint in enumerate(joints):
        channels = joint.channels or ()
        local, turn = _local_motion(joint, values[:, at : at + len(channels)])
        at += len(channels)
        if joint.parent < 0:
            positions[:, j] = local
            turns.append(turn)
        else:
            positions[:, j] = positions[:, joint.parent] + (turns[joint.parent] @ local[..., None])[..., 0]
            turns.append(turns[joint.parent] @ turn)
    return positions


def _local_motion(joint: _Joint, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(T, 3) position and (T, 3, 3) rotation of a joint in its parent."""
    position = np.tile(np.array(joint.offset or (0.0, 0.0, 0.0)), (len(values), 1))
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
