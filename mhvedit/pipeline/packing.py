"""Volumes and meshes as plain arrays, so that they can be kept: of each volume the voxels that are ever filled."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mhvedit.geometry.grid import VoxelGrid
from mhvedit.sequences.meshes import Mesh
from mhvedit.volumes.history import MotionHistoryVolume
from mhvedit.volumes.subject import PartVolume, SubjectVolumes

Arrays = Mapping[str, NDArray[Any]]
BODY_ARRAYS = ("n_frames", "pitch", "box_0", "where_0", "words_0")  # a subject's solids begin with the body


def packed(volumes: SubjectVolumes) -> dict[str, NDArray[Any]]:
    """Everything about a subject's volumes.

    Args:
        volumes: through one segment.
    """
    solids = list(volumes.solids)
    cut = [name for name in volumes.parts if name not in volumes.solids]
    arrays: dict[str, NDArray[Any]] = {
        "names": np.array(solids + cut),
        "cut_from": np.array(solids + [volumes.parts[name].solid for name in cut]),
        "n_frames": np.array(volumes.body.n_frames),
        "pitch": np.array(volumes.body.grid.pitch),
    }
    own = [volumes.solids[name] for name in solids] + [volumes.parts[name].volume for name in cut]
    for i, volume in enumerate(own):
        words = volume.frames.reshape(-1, volume.frames.shape[-1])
        where = np.flatnonzero(volume.filled)
        arrays[f"box_{i}"] = np.array([volume.grid.start, volume.grid.shape])
        arrays[f"where_{i}"] = where.astype(np.int32 if words.shape[0] < 2**31 else np.int64)
        arrays[f"words_{i}"] = words[where]
    return arrays


def unpacked(arrays: Arrays) -> SubjectVolumes:
    """The volumes that were packed.

    Args:
        arrays: from `packed`.
    """
    names, cut_from = ([str(name) for name in arrays[key]] for key in ("names", "cut_from"))
    volumes = {name: _volume(arrays, i) for i, name in enumerate(names)}
    parts = {name: PartVolume(volumes[name], solid) for name, solid in zip(names, cut_from, strict=True)}
    return SubjectVolumes({name: volumes[name] for name, part in parts.items() if part.solid == name}, parts)


def unpacked_body(arrays: Arrays) -> MotionHistoryVolume:
    """The body alone, of a subject whose volumes were packed.

    Args:
        arrays: from `packed`; those that `BODY_ARRAYS` names suffice.
    """
    return _volume(arrays, 0)


def _volume(arrays: Arrays, i: int) -> MotionHistoryVolume:
    start, shape = (tuple(int(n) for n in row) for row in arrays[f"box_{i}"])
    words = arrays[f"words_{i}"]
    frames = np.zeros((int(np.prod(shape)), words.shape[1]), np.uint64)
    frames[arrays[f"where_{i}"]] = words
    grid = VoxelGrid((start[0], start[1], start[2]), (shape[0], shape[1], shape[2]), float(arrays["pitch"]))
    return MotionHistoryVolume(grid, frames.reshape(*shape, -1), int(arrays["n_frames"]))


def packed_capture(meshes: Sequence[Mesh], numbers: Sequence[int], *, fps: float) -> dict[str, NDArray[Any]]:
    """Meshes as the arrays of an .npz capture.

    Args:
        meshes: T frames, at least one.
        numbers: of these frames.
        fps: Hz.
    """
    labels = [mesh.labels for mesh in meshes if mesh.labels is not None]
    return {
        "vertices": np.concatenate([mesh.vertices for mesh in meshes]),
        "faces": np.concatenate([mesh.faces for mesh in meshes]),
        "vertex_counts": np.array([len(mesh.vertices) for mesh in meshes]),
        "face_counts": np.array([len(mesh.faces) for mesh in meshes]),
        "frame_numbers": np.array(numbers),
        "fps": np.array(fps),
    } | ({"labels": np.concatenate(labels)} if len(labels) == len(meshes) else {})
