"""Everything solid about one subject in one key segment: body, things held, and the named parts of them."""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.grid import VoxelGrid
from mhvedit.sequences.canonical import in_canonical_frame
from mhvedit.sequences.meshes import BODY, MeshSequence
from mhvedit.volumes.history import MotionHistoryVolume, Volume, difference, history, intersection, union
from mhvedit.volumes.parts import OwnMesh, Part, Selection, select_voxels
from mhvedit.volumes.voxelise import solid_voxels

Filled = tuple[VoxelGrid, BoolArray]  # a frame's box, and (X, Y, Z) which of its voxels are filled
Erosion = Callable[[MotionHistoryVolume], MotionHistoryVolume]  # of a solid, what counts as deep in it


@dataclass(frozen=True, slots=True, eq=False)
class PartVolume:
    """A named part through one segment, and the solid that it is cut from."""

    volume: MotionHistoryVolume
    solid: str  # name of a solid of the subject


@dataclass(frozen=True, slots=True, eq=False)
class SubjectVolumes:
    """A subject through one segment, in its canonical frame: `body` and things with own meshes are its solids."""

    solids: Mapping[str, MotionHistoryVolume]
    parts: Mapping[str, PartVolume]  # `body` and every part that the segment names

    @property
    def body(self) -> MotionHistoryVolume:
        """The captured mesh."""
        return self.solids[BODY]


def subject_volumes(
    sequence: MeshSequence,
    parts: Mapping[str, Part],
    *,
    numbers: tuple[int, ...],
    pose: FloatArray,
    pitch: float,
    wanted: frozenset[str],
    workers: int = 1,
) -> SubjectVolumes:
    """Voxelise one subject in the frames of one segment.

    Args:
        sequence: the capture.
        parts: its named parts; those with meshes of their own are always voxelised, they are solid.
        numbers: (tau,) frame numbers, retimed.
        pose: (3,) capture_from_canonical.
        pitch: voxel size, m.
        wanted: names of the parts to cut out.
        workers: threads; the result does not depend on it.
    """
    own = {name: part.sequence for name, part in parts.items() if isinstance(part, OwnMesh)}
    cut = {name: part for name, part in parts.items() if name in wanted and not isinstance(part, OwnMesh)}
    cutting = partial(_cut_frame, sequence, cut, pose, pitch)
    with ThreadPoolExecutor(workers) as pool:
        frames = list(pool.map(cutting, numbers))
        things = {
            name: list(pool.map(partial(_fill_frame, thing, pose, pitch), numbers)) for name, thing in own.items()
        }
    solids = {BODY: history([body for body, _ in frames])}
    solids |= {name: history(filled) for name, filled in things.items()}
    volumes = {BODY: PartVolume(solids[BODY], BODY)}
    volumes |= {name: PartVolume(history([chosen[name] for _, chosen in frames]), BODY) for name in cut}
    volumes |= {name: PartVolume(solids[name], name) for name in own}
    return SubjectVolumes(solids, volumes)


def _cut_frame(
    sequence: MeshSequence, parts: Mapping[str, Selection], pose: FloatArray, pitch: float, number: int
) -> tuple[Filled, dict[str, Filled]]:
    """The body's voxels in one frame, and those of its parts."""
    mesh = sequence.mesh(number)
    grid, filled = solid_voxels(in_canonical_frame(mesh, pose), pitch)
    chosen = {
        name: (grid, select_voxels(part, grid, filled, mesh=mesh, number=number, pose=pose))
        for name, part in parts.items()
    }
    return (grid, filled), chosen


def _fill_frame(sequence: MeshSequence, pose: FloatArray, pitch: float, number: int) -> Filled:
    """The voxels of a thing in one frame."""
    return solid_voxels(in_canonical_frame(sequence.mesh(number), pose), pitch)


def part_of(subject: SubjectVolumes, name: str) -> MotionHistoryVolume:
    """A named part."""
    return subject.parts[name].volume


def deep_part_of(subject: SubjectVolumes, name: str, deep: Erosion) -> MotionHistoryVolume:
    """What of a named part lies deep in the solid it is cut from."""
    part = subject.parts[name]
    return intersection(part.volume, deep(subject.solids[part.solid]))


def rest_of(subject: SubjectVolumes, name: str) -> Volume:
    """All that is solid about a subject but a named part."""
    return _without(subject, name, subject.solids)


def deep_rest_of(subject: SubjectVolumes, name: str, deep: Erosion) -> Volume:
    """What of the rest lies deep in the solid that it belongs to."""
    return _without(subject, name, {key: deep(solid) for key, solid in subject.solids.items()})


def all_of(subject: SubjectVolumes) -> Volume:
    """All that is solid about a subject."""
    return union(*subject.solids.values())


def deep_all_of(subject: SubjectVolumes, deep: Erosion) -> Volume:
    """What lies deep in any solid of a subject."""
    return union(*(deep(solid) for solid in subject.solids.values()))


def _without(subject: SubjectVolumes, name: str, solids: Mapping[str, MotionHistoryVolume]) -> Volume:
    """Of some solids, or what is deep in them, what is not a part's; a part that is all of its solid leaves nothing."""
    part = subject.parts[name]
    others = [solid for key, solid in solids.items() if key != part.solid]
    if part.volume is subject.solids[part.solid] and others:
        return union(*others)
    return union(difference(solids[part.solid], part.volume), *others)
