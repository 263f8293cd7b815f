"""Joint tracks as CSV: `frame,joint,x,y,z`, in the frame and units of the meshes on disk."""

import csv
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.files import replacing
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.sequences.axes import check_axes, from_metres_z_up, to_metres_z_up
from mhvedit.sequences.meshes import JointTracks

if TYPE_CHECKING:
    from _csv import Reader

COLUMNS: Final = ("frame", "joint", "x", "y", "z")


def read_tracks(path: Path | str, *, units: str = "m", up: str = "z") -> JointTracks:
    """Read joint tracks; frames ascending, joints in order of first mention, NaN where a frame lacks a joint.

    Everything is taken as a position. For tracks of unit vectors (a joint `facing`) use the direction only: it is
    turned to z up, but its length is scaled with the units.

    Args:
        path: a CSV file whose first line names the columns `COLUMNS`, in any order; others are passed over.
        units: m, cm or mm in the file.
        up: x, y or z: the axis that points up in the file.

    Raises:
        CaptureError: naming the line, what was expected and what is there.
    """
    path = Path(path)
    check_axes(units, up)
    numbers, names, points = _read(path)
    frames, times = np.unique(numbers, return_inverse=True)
    joints = {joint: j for j, joint in enumerate(dict.fromkeys(names))}
    columns = np.array([joints[name] for name in names])
    if len(np.unique(times * len(joints) + columns)) < len(names):
        raise _first_fault(path)
    positions = np.full((len(frames), len(joints), 3), np.nan)
    positions[times, columns] = to_metres_z_up(points, units=units, up=up)
    return JointTracks(frames, tuple(joints), positions)


def _read(path: Path) -> tuple[IntArray, list[str], FloatArray]:
    """(N,) frame and (N,) joint of every line, and its (N, 3) position as written."""
    cells: list[str] = []  # and no object for every line, for the collector to look through
    try:
        with _lines(path) as reader:
            where = _columns(path, next(reader, []))
            for row in reader:
                if any(map(str.strip, row)):
                    cells.extend([row[i] for i in where])
    except IndexError:
        raise _first_fault(path) from None
    if not cells:
        raise CaptureError(path, "at least one row", "none")
    frames, names, *points = (cells[i :: len(where)] for i in range(len(where)))
    try:
        numbers = np.array([int(frame) for frame in frames], np.int64)
        joints = [name.strip() for name in names]
        positions = np.array([[float(number) for number in axis] for axis in points]).T
    except (ValueError, OverflowError):
        raise _first_fault(path) from None
    if not all(joints) or not np.isfinite(positions).all():
        raise _first_fault(path)
    return numbers, joints, positions


@contextmanager
def _lines(path: Path) -> Iterator["Reader"]:
    """The lines of a file, split."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            yield csv.reader(file)
    except UnicodeDecodeError as error:
        raise CaptureError(path, "a CSV file in UTF-8", f"another byte at place {error.start}") from error
    except (OSError, csv.Error) as error:
        raise CaptureError(path, "a readable CSV file", getattr(error, "strerror", None) or str(error)) from error


def _first_fault(path: Path) -> CaptureError:
    """What to say of a file that cannot be read to its end."""
    seen: set[tuple[int, str]] = set()
    with _lines(path) as reader:
        where = _columns(path, next(reader, []))
        for row in reader:
            at = f"{path}: line {reader.line_num}"
            if not any(map(str.strip, row)):
                continue
            try:
                frame, joint = _frame_and_joint(at, row, where)
            except CaptureError as fault:
                return fault
            if (frame, joint) in seen:
                return CaptureError(at, "each joint once a frame", f"{joint} again in frame {frame}")
            seen.add((frame, joint))
    raise AssertionError(f"{path}: no line is at fault")


def _columns(path: Path, header: list[str]) -> tuple[int, ...]:
    """Where each of `COLUMNS` stands."""
    names = [name.strip() for name in header]
    if not set(COLUMNS) <= set(names):
        raise CaptureError(f"{path}: line 1", "the header " + ",".join(COLUMNS), repr(",".join(header)[:80]))
    return tuple(names.index(name) for name in COLUMNS)


def _frame_and_joint(line: str, row: list[str], where: tuple[int, ...]) -> tuple[int, str]:
    """Of one line, which has a position too."""
    try:
        frame, joint, *point = (row[i].strip() for i in where)
        number, finite = int(np.int64(int(frame))), all(math.isfinite(float(x)) for x in point)
    except (IndexError, ValueError, OverflowError):
        raise CaptureError(line, "a frame number, a joint and three numbers", repr(",".join(row)[:80])) from None
    if not joint or not finite:
        raise CaptureError(line, "a joint with a finite position", repr(",".join(row)[:80]))
    return number, joint


def write_tracks(tracks: JointTracks, path: Path | str, *, units: str = "m", up: str = "z") -> None:
    """Write joint tracks so that they read back the same; joints that a frame lacks have no line.

    Args:
        tracks: in metres and z up.
        path: the CSV file; replaced as a whole or not at all.
        units: m, cm or mm to be written.
        up: x, y or z: the axis that is to point up in the file.
    """
    path = Path(path)
    points = from_metres_z_up(tracks.positions, units=units, up=up)
    known = np.isfinite(points).all(-1)
    with replacing(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(COLUMNS)
        for t, j in zip(*np.nonzero(known), strict=True):
            out.writerow([int(tracks.numbers[t]), tracks.joints[j], *map(float, points[t, j])])
