"""Interest volumes: which voxels of a subject belong to a named part.

A part either selects voxels of the subject's own mesh (what lies within a radius of a moving point or segment, in a
box, nearest to a vertex label or to a bone) or is a mesh sequence of its own (a sword). Selections are made on voxel
centres.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mhvedit.errors import ShapeError
from mhvedit.geometry.arrays import BoolArray, FloatArray
from mhvedit.geometry.grid import VoxelGrid
from mhvedit.geometry.planar import apply_pose
from mhvedit.sequences.meshes import JointTracks, Mesh, MeshSequence


@dataclass(frozen=True, slots=True, eq=False)
class NearTrack:
    """What lies within a radius of a joint, or of the polyline through several."""

    tracks: JointTracks
    joints: tuple[str, ...]
    radius: float  # m


@dataclass(frozen=True, slots=True, eq=False)
class InBox:
    """What lies in a fixed box of the capture's frame."""

    centre: FloatArray  # (3,) m
    size: FloatArray  # (3,) m


@dataclass(frozen=True, slots=True, eq=False)
class WithLabel:
    """What lies nearest to a vertex whose integer property `part` has this value."""

    label: int


@dataclass(frozen=True, slots=True, eq=False)
class NearBones:
    """What lies nearer to the named bones than to any other bone of the skeleton."""

    tracks: JointTracks
    parents: tuple[int, ...]  # (J,) index of each joint's parent, -1 for a root
    bones: tuple[str, ...]  # a bone is named by the joint at its start


@dataclass(frozen=True, slots=True, eq=False)
class OwnMesh:
    """A mesh sequence of its own, in the capture's frame and numbering."""

    sequence: MeshSequence


@dataclass(frozen=True, slots=True, eq=False)
class WholeBody:
    """All of the subject's mesh."""


Part = NearTrack | InBox | WithLabel | NearBones | OwnMesh | WholeBody
Selection = NearTrack | InBox | WithLabel | NearBones | WholeBody


def select_voxels(
    part: Selection, grid: VoxelGrid, filled: BoolArray, *, mesh: Mesh, number: int, pose: FloatArray
) -> BoolArray:
    """Which filled voxels of one frame belong to a part.

    Args:
        part: a part of the subject's own mesh.
        grid: the frame's box, in the canonical frame.
        filled: (X, Y, Z).
        mesh: the frame's mesh, in the capture's frame.
        number: frame number.
        pose: (3,) capture_from_canonical.

    Returns:
        (X, Y, Z), a subset of `filled`.
    """
    if isinstance(part, WholeBody):
        return filled
    where = np.argwhere(filled)
    centres = apply_pose(pose, (where + np.array(grid.start)) * grid.pitch)
    chosen = np.zeros(filled.shape, np.bool_)
    chosen[tuple(where[_belongs(part, centres, mesh, number)].T)] = True
    return chosen


def select_points(part: Selection, points: FloatArray, *, mesh: Mesh, number: int) -> BoolArray:
    """Which points belong to a part.

    Args:
        part: a part of the subject's own mesh.
        points: (N, 3) m, in the capture's frame.
        mesh: the frame's mesh, in the capture's frame.
        number: frame number.

    Returns:
        (N,).
    """
    if isinstance(part, WholeBody):
        return np.ones(len(points), np.bool_)
    return _belongs(part, points, mesh, number)


def joint_positions(tracks: JointTracks, joints: tuple[str, ...], number: int) -> FloatArray:
    """Where joints are in one frame: (len(joints), 3) m; NaN rows where the tracks do not say."""
    row = np.searchsorted(tracks.numbers, number)
    if row == len(tracks.numbers) or tracks.numbers[row] != number:
        return np.full((len(joints), 3), np.nan)
    return np.asarray(tracks.positions[row, [tracks.joints.index(j) for j in joints]])


def distance_to_polyline(points: FloatArray, line: FloatArray) -> FloatArray:
    """Distance of points to a polyline.

    Args:
        points: (N, 3).
        line: (K, 3), K >= 1; a single corner is a point.

    Returns:
        (N,).
    """
    if line.ndim != 2 or len(line) == 0:
        raise ShapeError("line", line.shape, "(K, 3) with K >= 1")
    best = np.linalg.norm(points - line[0], axis=1)
    for start, end in pairwise(line):
        along = end - start
        t = np.clip((points - start) @ along / max(float(along @ along), 1e-12), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - start - t[:, None] * along, axis=1))
    return np.asarray(best)


def _belongs(
    part: NearTrack | InBox | WithLabel | NearBones, centres: FloatArray, mesh: Mesh, number: int
) -> BoolArray:
    match part:
        case NearTrack():
            line = joint_positions(part.tracks, part.joints, number)
            return np.asarray(distance_to_polyline(centres, line) < part.radius)
        case InBox():
            return np.asarray((np.abs(centres - part.centre) <= part.size / 2).all(1))
        case WithLabel():
            if mesh.labels is None or len(centres) == 0:
                return np.zeros(len(centres), np.bool_)
            from scipy.spatial import cKDTree  # takes long to import, and few captures are labelled

            nearest = cKDTree(mesh.vertices).query(centres)[1]
            return np.asarray(mesh.labels[nearest] == part.label)
        case NearBones():
            return _nearest_bone_is_named(part, centres, number)


def _nearest_bone_is_named(part: NearBones, centres: FloatArray, number: int) -> BoolArray:
    positions = joint_positions(part.tracks, part.tracks.joints, number)
    named = np.full(len(centres), np.inf)
    other = np.full(len(centres), np.inf)
    for child, parent in enumerate(part.parents):
        if parent < 0:
            continue
        far = distance_to_polyline(centres, positions[[parent, child]])
        if part.tracks.joints[parent] in part.bones:
            named = np.minimum(named, far)
        else:
            other = np.minimum(other, far)
    return np.asarray(named <= other)
