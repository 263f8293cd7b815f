"""Joint tracks as CSV: `frame,joint,x,y,z`, in the frame and units of the meshes on disk."""

import csv
import math
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.errors import CaptureError
from mhvedit.files import replacing
from mhvedit.sequences.axes import check_axes, from_metres_z_up, to_metres_z_up
from mhvedit.sequences.meshes import JointTracks

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
    found = _rows(path)
    numbers = sorted({frame for frame, _ in found})
    joints = tuple(dict.fromkeys(joint for _, joint in found))
    at_number = {number: t for t, number in enumerate(numbers)}
    at_joint = {joint: j for j, joint in enumerate(joints)}
    points = np.full((len(numbers), len(joints), 3), np.nan)
    times = np.array([at_number[frame] for frame, _ in found])
    which = np.array([at_joint[joint] for _, joint in found])
    points[times, which] = to_metres_z_up(np.array(list(found.values())), units=units, up=up)
    return JointTracks(np.array(numbers, np.int64), joints, points)


def _rows(path: Path) -> dict[tuple[int, str], tuple[float, float, float]]:
    """Positions by frame and joint, as written."""
    found: dict[tuple[int, str], tuple[float, float, float]] = {}
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.reader(file)
            where = _columns(path, next(rows, []))
            for row in rows:
                if not any(cell.strip() for cell in row):
                    continue
                frame, joint, point = _row(f"{path}: line {rows.line_num}", row, where)
                if (frame, joint) in found:
                    raise CaptureError(
                        f"{path}: line {rows.line_num}", "each joint once a frame", f"{joint} again in frame {frame}"
                    )
                found[frame, joint] = point
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise CaptureError(path, "a readable CSV file", f"{type(error).__name__}: {error}") from error
    if not found:
        raise CaptureError(path, "at least one row", "none")
    return found


def _columns(path: Path, header: list[str]) -> tuple[int, ...]:
    """Where each of `COLUMNS` stands."""
    names = [name.strip() for name in header]
    if not set(COLUMNS) <= set(names):
        raise CaptureError(f"{path}: line 1", "the header " + ",".join(COLUMNS), repr(",".join(header)[:80]))
    return tuple(names.index(name) for name in COLUMNS)


def _row(line: str, row: list[str], where: tuple[int, ...]) -> tuple[int, str, tuple[float, float, float]]:
    """Frame, joint and position of one line."""
    try:
        frame, joint, x, y, z = (row[i].strip() for i in where)
        number, point = int(frame), (float(x), float(y), float(z))
    except (IndexError, ValueError):
        raise CaptureError(line, "a frame number, a joint and three numbers", repr(",".join(row)[:80])) from None
    if not joint or not all(map(math.isfinite, point)):
        raise CaptureError(line, "a joint with a finite position", repr(",".join(row)[:80]))
    return number, joint, point


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
