"""Meshes that props have stopped: frames of the scene in which a subject does not look as it was captured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mhvedit.errors import CaptureError
from mhvedit.files import UNREADABLE, found_instead, load_npz
from mhvedit.geometry.arrays import FloatArray
from mhvedit.sequences.meshes import MeshSequence
from mhvedit.sequences.read import open_capture

THING: Final = "thing:"  # and the name of what is held: an array of the file
WRITTEN: Final = "the stopped meshes that `mhvedit solve` wrote"


@dataclass(frozen=True, slots=True, eq=False)
class Touched:
    """What a subject shows instead of captured frames.

    Vertices and faces have the captured order, so that parts, labels, colours and textures stay where they are.
    """

    meshes: MeshSequence  # K frames, numbered as in the scene, in the capture's frame: before placement
    things: Mapping[str, FloatArray]  # (K, 3, 4) by part: how what is held moves, in the capture's frame

    @property
    def frames(self) -> tuple[int, ...]:
        """The frames of the scene, ascending."""
        return self.meshes.numbers

    @property
    def file(self) -> Path:
        """Where the meshes are."""
        return self.meshes.files[0]


def open_touched(path: Path) -> Touched:
    """Open stopped meshes: a capture, and for each thing that is held an array `thing:NAME`.

    Args:
        path: of an .npz.

    Raises:
        CaptureError: it cannot be read.
    """
    meshes = open_capture(path, name=path.stem)
    try:
        things = {name.removeprefix(THING): own for name, own in load_npz(path, starting=THING).items()}
    except UNREADABLE as fault:
        raise CaptureError(path, WRITTEN, found_instead(fault)) from fault
    return Touched(meshes, things)


def read_touched(path: Path, frames: Sequence[int]) -> Touched:
    """Open the stopped meshes that an edit names.

    Args:
        path: of an .npz.
        frames: of the scene, that the edit says it holds.

    Raises:
        CaptureError: it is not there, or holds others.
    """
    if not path.is_file():
        raise CaptureError(path, WRITTEN, "no such file")
    found = open_touched(path)
    if list(found.frames) != list(frames):
        raise CaptureError(path, f"{WRITTEN}, of {len(frames)} frames of this edit", f"{len(found.frames)} others")
    return found
