"""Joint profiles: the thesis's text format for motions of the 55-DOF skeleton (Degenhardt, appendix; B8.1-B8.3).

Five comment lines, the time between frames, the number of frames, and a line of 55 numbers for each: three global
positions, three global rotations and 49 joints, in rad.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.errors import CaptureError, ShapeError
from mhvedit.files import replacing
from mhvedit.geometry.arrays import FloatArray
from mhvedit.skeleton.words import is_finite

DOFS: Final = 55
HEADER: Final = (
    "# Joint profiles in rad",
    "# first row is delta time",
    "# second row is the number of increments",
    "# next row is the initial Q values, followed by the Q values for time 2 and so on...",
    "# G1    G2    G3    G4    G5    G6    Q1    Q2    Q3    Q4    Q5...",
)
Spline = Callable[[float], float]  # value at a time, s


@dataclass(frozen=True, slots=True, eq=False)
class JointProfile:
    """A motion as the format has it."""

    q: FloatArray  # (T, 55) m and rad
    seconds: float  # between frames
    origin: FloatArray  # (3,) m, to add to the global position; 0 unless read with `thesis_compat`

    def __post_init__(self) -> None:
        if self.q.ndim != 2 or self.q.shape[1] != DOFS or not len(self.q):
            raise ShapeError("q", self.q.shape, f"(T, {DOFS}), at least one frame")


def read_profile(path: Path | str, *, thesis_compat: bool = False) -> JointProfile:
    """Read a joint profile (B8.2).

    Args:
        path: the text file.
        thesis_compat: as the thesis's reader, take the first frame's global position from all; it is kept in `origin`,
            so that writing gives the file back.

    Raises:
        CaptureError: naming the line, what was expected and what is there.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError as error:
        raise CaptureError(path, "a readable joint profile", str(error.strerror)) from error
    rows = [(i + 1, line.split()) for i, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    seconds = _positive(path, rows, 0, "the time between frames")
    count = _positive(path, rows, 1, "the number of frames")
    body = rows[2:]
    if count != int(count) or len(body) != int(count):
        raise CaptureError(
            f"{path}: line {rows[1][0]}", "the number of frames that follow", f"{rows[1][1][0]} for {len(body)}"
        )
    q = np.array([_numbers(path, line, words) for line, words in body])
    origin = q[0, :3].copy() if thesis_compat else np.zeros(3)
    q[:, :3] -= origin
    return JointProfile(q, seconds, origin)


def write_profile(path: Path | str, profile: JointProfile) -> None:
    """Write a joint profile: six decimals, tabs, no trailing tab (B8.1); written beside, then renamed."""
    q = profile.q.copy()
    q[:, :3] += profile.origin
    rows = ["\t".join(f"{value:.6f}" for value in row) for row in q]
    with replacing(Path(path)) as beside:
        beside.write_text("\n".join([*HEADER, f"{profile.seconds:.6f}", str(len(q)), *rows]) + "\n", encoding="utf-8")


def profile_from_splines(
    splines: Sequence[Spline], end_time: float, frames: int, *, unit: float = 1.0, thesis_compat: bool = False
) -> JointProfile:
    """Sample joint splines (B8.3); axes of the global DOFs are turned as in the thesis.

    Args:
        splines: 55, positions first.
        end_time: s, of the last frame.
        frames: how many.
        unit: m in one unit of the positions.
        thesis_compat: sample at i end_time / frames as the thesis does, which never reaches the end.
    """
    if len(splines) != DOFS:
        raise ShapeError("splines", len(splines), f"{DOFS} of them")
    if frames < 1 or not 0 < end_time < np.inf:
        raise ShapeError("frames and end_time", (frames, end_time), "at least 1, and a positive time")
    seconds = end_time / (frames if thesis_compat else max(frames - 1, 1))
    raw = np.array([[spline(i * seconds) for spline in splines] for i in range(frames)])
    q = raw.copy()
    q[:, 0], q[:, 1], q[:, 2] = unit * raw[:, 1], unit * raw[:, 2], -unit * raw[:, 0]
    q[:, 3], q[:, 4], q[:, 5] = -raw[:, 4], -raw[:, 5], raw[:, 3]
    return JointProfile(q, seconds, np.zeros(3))


def _positive(path: Path, rows: list[tuple[int, list[str]]], k: int, what: str) -> float:
    """The positive number that is alone in a line."""
    line, words = rows[k] if k < len(rows) else (rows[-1][0] if rows else 1, [])
    try:
        value = float(words[0]) if len(words) == 1 else 0.0
    except ValueError:
        value = 0.0
    if not 0 < value < np.inf:
        raise CaptureError(f"{path}: line {line}", f"{what}, a positive number", repr(" ".join(words)[:40]))
    return value


def _numbers(path: Path, line: int, words: list[str]) -> FloatArray:
    """The numbers of a frame."""
    if len(words) != DOFS:
        raise CaptureError(f"{path}: line {line}", f"{DOFS} numbers", f"{len(words)}")
    try:
        values = np.array(words, np.float64)
    except ValueError:
        values = np.full(DOFS, np.nan)
    if not np.isfinite(values).all():
        bad = next((w for w in words if not is_finite(w)), "")
        raise CaptureError(f"{path}: line {line}", "finite numbers", repr(bad[:40]))
    return values
