"""Triangle meshes and sequences of them: one data model behind one door."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from mhvedit.errors import MissingFrame, ShapeError
from mhvedit.geometry.arrays import FloatArray, Int32Array, IntArray

BODY: Final = "body"  # the whole captured mesh, as a part and as a solid


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """One frame of a capture, in metres and z up; connectivity is its own."""

    vertices: FloatArray  # (V, 3) m
    faces: Int32Array  # (F, 3) indices into vertices
    labels: Int32Array | None = None  # (V,) the integer vertex property `part`, where the file has one

    def __post_init__(self) -> None:
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3:
            raise ShapeError("vertices", self.vertices.shape, "(V, 3)")
        if self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise ShapeError("faces", self.faces.shape, "(F, 3)")
        if self.labels is not None and self.labels.shape != self.vertices.shape[:1]:
            raise ShapeError("labels", self.labels.shape, self.vertices.shape[:1])


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one, their vertices one after the other; labels of more than one are lost."""
    if len(meshes) == 1:
        return meshes[0]
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, first, strict=True)])
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), faces.astype(np.int32))


@dataclass(frozen=True, slots=True, eq=False)
class MeshSequence:
    """A capture of one subject: frame numbers and a way to read each frame when it is needed."""

    name: str
    numbers: tuple[int, ...]  # ascending, as in the file names; gaps are kept
    fps: float  # Hz
    load: Callable[[int], Mesh]  # frame number -> mesh in metres, z up
    files: tuple[Path, ...] = ()  # the file of each frame, or those that hold all; where it came from files
    place: Callable[[int], FloatArray] | None = None  # `areas.place_of` a frame, where that is kept beside it
    made_of: Mapping[int, int] = field(default_factory=dict)  # of a frame that was made of a captured one: which
    per_frame: bool = False  # whether there is a file for each frame

    def mesh(self, number: int) -> Mesh:
        """Read one frame.

        Args:
            number: frame number, as in the file names.

        Raises:
            MissingFrame: the capture has no such frame.
            CaptureError: the frame cannot be read.
        """
        if number not in self.numbers:
            raise MissingFrame(self.name, number, self.numbers)
        return self.load(number)

    def origin(self, number: int) -> int:
        """The captured frame behind a frame, for which looks, tracks and gaze are known; mostly itself."""
        return self.made_of.get(number, number)


@dataclass(frozen=True, slots=True, eq=False)
class JointTracks:
    """Where named joints are in each frame, in metres and z up, in the frame of the capture's meshes."""

    numbers: IntArray  # (T,) frame numbers, ascending
    joints: tuple[str, ...]  # (J,)
    positions: FloatArray  # (T, J, 3) m; NaN where a frame has no such joint


@dataclass(frozen=True, slots=True, eq=False)
class Facing:
    """Which way a subject's body faces in each frame: the horizontal normal of hips and shoulders."""

    numbers: IntArray  # (T,) frame numbers
    yaw: FloatArray  # (T,) rad about z, from +x, in the capture's frame
    trust: FloatArray  # (T,) 0 .. 1; 1 where it was given


@dataclass(frozen=True, slots=True, eq=False)
class Gaze:
    """Where a subject's eyes are and where they look in each frame."""

    numbers: IntArray  # (T,) frame numbers
    eye: FloatArray  # (T, 3) m, midpoint of the eyes
    direction: FloatArray  # (T, 3) unit
