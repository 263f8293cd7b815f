"""What is exported: the edit, and the captures of which it shows frames."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from mhvedit.errors import MissingFrame
from mhvedit.geometry.arrays import FloatArray, IntArray
from mhvedit.geometry.planar import apply_pose
from mhvedit.geometry.quaternions import rotation_matrices
from mhvedit.scene.edit import EditedScene
from mhvedit.sequences.frame_looks import frame_looks
from mhvedit.sequences.looks import Float32Array, Looks
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.sequences.read import USD_SUFFIXES

Tell = Callable[[str, float], None]  # what is being done, share of it that is done


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """One capture in the scene: a subject's body, a thing that it holds, or a prop."""

    subject: str  # or the name of the prop
    part: str  # `body`, or the name of the thing
    name: str  # of files and nodes; no other piece has it
    sequence: MeshSequence
    path: Path  # of the capture
    units: str  # of the capture on disk
    up: str  # of the capture on disk
    offset: tuple[float, float] = (0.0, 0.0)  # m, x and y, that `sequence` is without: see `export.far`


@dataclass(frozen=True, slots=True, eq=False)
class ExportScene:
    """An edit with all that it shows."""

    edit: EditedScene
    pieces: tuple[Piece, ...]

    @property
    def movers(self) -> tuple[str, ...]:
        """Everything that stands somewhere: subjects, then props."""
        return (*self.edit.subjects, *self.edit.props)

    def pieces_of(self, subject: str) -> tuple[Piece, ...]:
        """A subject's body and the things that it holds; of a prop, itself."""
        return tuple(piece for piece in self.pieces if piece.subject == subject)

    def source(self, piece: Piece) -> IntArray:
        """(N,) captured frame in each frame of the scene."""
        prop = self.edit.props.get(piece.subject)
        return self.edit.subjects[piece.subject].source if prop is None else prop.frames

    def placed(self, piece: Piece, mesh: Mesh, frame: int) -> FloatArray:
        """(V, 3) m, the vertices of a piece's mesh in a frame of the scene, in the world."""
        prop = self.edit.props.get(piece.subject)
        if prop is None:
            return apply_pose(self.edit.subjects[piece.subject].placements[frame], mesh.vertices)
        return np.asarray(mesh.vertices @ rotation_matrices(prop.rotations[frame]).T + prop.positions[frame])


@dataclass(frozen=True, slots=True)
class Run:
    """Frames of the scene that show one captured frame."""

    number: int  # of the captured frame
    start: int  # first frame of the scene
    stop: int  # past the last


@dataclass(frozen=True, slots=True, eq=False)
class Exported:
    """What an export wrote, and what it could not take along."""

    written: Path
    kept: tuple[Path, ...] = ()  # files of an earlier export that are used again
    warnings: tuple[str, ...] = ()
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m, z up, that was taken off the world's coordinates


def check_frames(scene: ExportScene) -> None:
    """Check that the captures have all frames that the edit shows.

    Raises:
        MissingFrame: naming the first that is not there.
    """
    for piece in scene.pieces:
        for number in scene.source(piece).tolist():
            if number not in piece.sequence.numbers:
                raise MissingFrame(piece.name, number, piece.sequence.numbers)


def runs_of(source: IntArray) -> list[Run]:
    """Runs of frames that show the same captured frame.

    >>> [(run.number, run.start, run.stop) for run in runs_of(np.array([7, 7, 8, 7]))]
    [(7, 0, 2), (8, 2, 3), (7, 3, 4)]
    """
    groups = [(number, list(frames)) for number, frames in groupby(range(len(source)), lambda k: int(source[k]))]
    return [Run(number, frames[0], frames[-1] + 1) for number, frames in groups]


def used_numbers(source: IntArray) -> list[int]:
    """Captured frames that are shown, each once, in the order of first use."""
    return list(dict.fromkeys(source.tolist()))


def points_of(mesh: Mesh) -> Float32Array:
    """(V, 3) vertices as all formats hold them: the nearest float32 to what mhvedit works on."""
    return np.ascontiguousarray(mesh.vertices, np.float32)


def placement_steps(placements: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Frames at which a placement has to be told: both ends of every stretch over which it does not change.

    Args:
        placements: (N, C) x, y m and yaw rad, or other numbers that say where something is.
    """
    moves = (placements[1:] != placements[:-1]).any(1)
    for frame in range(len(placements)):
        if frame in (0, len(placements) - 1) or moves[frame - 1] or moves[frame]:
            yield frame, placements[frame]


class LooksOf:
    """Looks of one piece, frame by frame; remembers what was missing for a warning."""

    def __init__(self, piece: Piece) -> None:
        self._piece, self._missing = piece, dict[Path, None]()
        self._misfits = 0

    def at(self, number: int, mesh: Mesh) -> Looks | None:
        """The looks of a frame, unless they do not fit its mesh."""
        looks = frame_looks(self._piece.sequence, number)
        if looks is None:
            return None
        self._missing |= dict.fromkeys(looks.missing)
        fits = len(looks.material) == len(mesh.faces) and (
            looks.colours is None or len(looks.colours) == len(mesh.vertices)
        )
        self._misfits += not fits
        return looks if fits else None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was not there, in sentences."""
        said = []
        if self._missing:
            first = next(iter(self._missing))
            said.append(
                f"{self._piece.name}: {len(self._missing)} material or texture files are missing, first {first}"
            )
        if self._misfits:
            said.append(f"{self._piece.name}: materials of {self._misfits} frames do not fit the mesh and are left out")
        if self._piece.path.suffix.lower() in USD_SUFFIXES:
            said.append(f"{self._piece.name}: materials of a USD capture only stay in an edit layer that references it")
        return tuple(said)
