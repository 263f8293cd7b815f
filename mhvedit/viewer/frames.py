"""Frames ready to be drawn, kept up to a limit in bytes: long clips play without filling the memory."""

from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mhvedit.geometry.arrays import FloatArray, Int32Array
from mhvedit.geometry.offsets import offset_of, without_offset
from mhvedit.sequences.meshes import joined
from mhvedit.view.stage import vertex_normals
from mhvedit.viewer.material import Actor

MOST_BYTES = 256 << 20
Float32Array = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class DrawnFrame:
    """A person and what they hold in one frame of the capture, as the graphics take it."""

    points: Float32Array  # (V, 3) m, capture frame, without the offset
    normals: Float32Array  # (V, 3) unit
    faces: Int32Array  # (F, 3)
    offset: FloatArray = field(default_factory=lambda: np.zeros(2))  # (2,) whole m; not 0 far from the origin

    @property
    def n_bytes(self) -> int:
        """Memory that it takes."""
        return self.points.nbytes + self.normals.nbytes + self.faces.nbytes


class FrameCache:
    """The frames that were drawn last, by subject and frame number."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self.most_bytes = most_bytes
        self.n_bytes = 0
        self._kept: OrderedDict[tuple[str, int, Path | None], DrawnFrame] = OrderedDict()

    def frame(self, name: str, actor: Actor, number: int) -> DrawnFrame:
        """A frame of a capture, read where it is not kept.

        Args:
            name: of the subject.
            actor: its capture.
            number: frame number, as in the file names.
        """
        made = actor.sequence.files[-1] if number in actor.sequence.made_of else None  # another after another choice
        key = (name, number, made)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        frame = read_frame(actor, number)
        self._kept[key] = frame
        self.n_bytes += frame.n_bytes
        while self.n_bytes > self.most_bytes and len(self._kept) > 1:
            _, oldest = self._kept.popitem(last=False)
            self.n_bytes -= oldest.n_bytes
        return frame

    def clear(self) -> None:
        """Forget all: the captures are others now."""
        self._kept.clear()
        self.n_bytes = 0


def read_frame(actor: Actor, number: int) -> DrawnFrame:
    """Read a frame of a capture with what the person holds in it.

    Args:
        actor: the capture.
        number: frame number, as in the file names.
    """
    held = [thing.mesh(number) for thing in actor.things if number in thing.numbers]
    mesh = joined([actor.sequence.mesh(number), *held])
    faces = np.ascontiguousarray(mesh.faces, np.int32)
    offset = offset_of(mesh.vertices)
    points, normals = without_offset(mesh.vertices, offset), vertex_normals(mesh.vertices, faces)
    return DrawnFrame(points.astype(np.float32), normals.astype(np.float32), faces, offset)
