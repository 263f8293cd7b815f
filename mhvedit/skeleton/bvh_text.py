"""The text of BVH files: any channel order, parsed with line numbers, and written back line by line."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.files import replacing
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.words import is_finite

_CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")


@dataclass(frozen=True, slots=True)
class BvhJoint:
    """One joint as the hierarchy has it; an end site has no channels."""

    name: str
    parent: int
    line: int
    offset: tuple[float, ...] = ()  # in the file's units and axes
    channels: tuple[str, ...] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class BvhText:
    """A BVH file; joints and values say what the lines mean."""

    head: tuple[str, ...]  # all lines down to MOTION
    joints: tuple[BvhJoint, ...]
    seconds: str  # frame time, as it is written
    rows: tuple[str, ...]  # T lines of motion, as they are written
    values: FloatArray  # (T, C) all channels, in the file's units and degrees

    @property
    def fps(self) -> float:
        """Frames a second; a whole number where the frame time is one of 6 decimals (0.033333 is 30)."""
        seconds = float(self.seconds)
        whole = max(round(1.0 / seconds), 1)
        return float(whole) if abs(1.0 / whole - seconds) < 1e-6 else 1.0 / seconds


def read_bvh_text(path: Path | str) -> BvhText:
    """Parse a BVH file.

    Raises:
        CaptureError: naming the line, what was expected and what is there.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError as error:
        raise CaptureError(path, "a readable BVH file", str(error.strerror)) from error
    joints, motion = _hierarchy(path, lines)
    seconds, body, values = _motion(path, lines, motion, sum(len(j.channels or ()) for j in joints))
    return BvhText(tuple(lines[:motion]), tuple(joints), seconds, body, values)


def write_bvh_text(path: Path | str, text: BvhText) -> None:
    """Write a BVH file: beside, then renamed."""
    lines = [*text.head, f"Frames: {len(text.rows)}", f"Frame Time: {text.seconds}", *text.rows]
    with replacing(Path(path)) as beside:
        beside.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _hierarchy(path: Path, lines: list[str]) -> tuple[list[BvhJoint], int]:
    """All joints and end sites, parents first, and the line after `MOTION`."""
    joints, open_joints = list[BvhJoint](), list[int]()
    for i, line in enumerate(lines):
        where = f"{path}: line {i + 1}"
        match line.split():
            case ["MOTION"]:
                _check_hierarchy(path, joints, open_joints, where)
                return joints, i + 1
            case [("ROOT" | "JOINT"), *words] if words:
                joints.append(BvhJoint(_free_name(where, joints, " ".join(words)), _last(open_joints), i + 1))
            case ["End", _] if open_joints:
                name = f"{joints[open_joints[-1]].name}_end"
                joints.append(BvhJoint(_free_name(where, joints, name), _last(open_joints), i + 1, channels=()))
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


def _free_name(where: str, joints: list[BvhJoint], name: str) -> str:
    """The name, unless it is taken."""
    if any(joint.name == name for joint in joints):
        raise CaptureError(where, "each joint name once", f"{name} again")
    return name


def _with_offset(joint: BvhJoint, where: str, words: list[str]) -> BvhJoint:
    """The joint with its offset."""
    try:
        offset = tuple(map(float, words))
    except ValueError:
        offset = ()
    if len(offset) != 3 or not np.isfinite(offset).all():
        raise CaptureError(where, "OFFSET and three finite numbers", repr(" ".join(words)[:60]))
    return replace(joint, offset=offset)


def _with_channels(joint: BvhJoint, where: str, count: str, names: list[str]) -> BvhJoint:
    """The joint with its channels."""
    if count != str(len(names)) or not set(names) <= set(_CHANNELS) or len(set(names)) < len(names):
        found = repr(" ".join([count, *names])[:80])
        raise CaptureError(where, f"CHANNELS, their number, and that many of {' '.join(_CHANNELS)}", found)
    return replace(joint, channels=tuple(names))


def _check_hierarchy(path: Path, joints: list[BvhJoint], open_joints: list[int], where: str) -> None:
    """Refuse open braces and joints that lack something."""
    if open_joints or not joints:
        raise CaptureError(where, "a closed hierarchy before MOTION", f"{len(open_joints)} open braces")
    for joint in joints:
        if not joint.offset or joint.channels is None:
            missing = "OFFSET" if not joint.offset else "CHANNELS"
            raise CaptureError(f"{path}: line {joint.line}", f"{missing} for {joint.name}", "none")


def _motion(path: Path, lines: list[str], at: int, width: int) -> tuple[str, tuple[str, ...], FloatArray]:
    """Frame time, lines and (T, width) values of the motion; `at` counts the lines before."""
    rows = [(i + 1, line.split()) for i, line in enumerate(lines[at:], at) if line.strip()]
    frames = _header_value(path, rows, 0, "Frames:")
    _header_value(path, rows, 1, "Frame Time:")
    body = rows[2:]
    if len(body) != int(frames):
        last = body[-1][0] if body else at
        raise CaptureError(f"{path}: line {last}", f"{int(frames)} lines of motion", f"{len(body)}")
    for line, words in body:
        if len(words) != width:
            raise CaptureError(f"{path}: line {line}", f"{width} channel values", f"{len(words)}")
    return rows[1][1][-1], tuple(lines[line - 1] for line, _ in body), _values(path, body)


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
        finite = np.array([all(is_finite(word) for word in words) for _, words in body])
        values = np.zeros((len(body), 0))
    if not finite.all():
        line, words = body[int(np.argmin(finite))]
        bad = next(word for word in words if not is_finite(word))
        raise CaptureError(f"{path}: line {line}", "finite numbers", repr(bad[:40]))
    return values
